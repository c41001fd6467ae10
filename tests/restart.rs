//! Stops of every kind, and restarts on other rank counts: the run goes on as if nothing had happened.

mod common;

use common::{Run, data, digest_of, history_of, launch, scratch, start, text, wait, wait_for_file};
use std::path::Path;
use std::process::Command;

/// Enough steps that a signal arrives in mid-run.
const LONG: [&str; 6] =
    ["--set", "stage.1.steps=8000", "--set", "output.checkpoint_steps=1000", "--set", "output.snapshots=2000 steps"];

fn uninterrupted(extra: &[&str]) -> (String, Vec<u8>, usize) {
    let config = data("mixed_flow.toml");
    let directory = scratch("uninterrupted");
    let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &directory, extra);
    assert!(output.status.success(), "{}", text(&output));
    (digest_of(&output), history_of(&directory), snapshots(&directory))
}

fn snapshots(directory: &Path) -> usize {
    let entries = std::fs::read_dir(directory.join("snapshots")).into_iter().flatten().flatten();
    entries.filter(|entry| entry.path().extension().is_some_and(|end| end == "vtkhdf")).count()
}

/// Stops a run of two ranks with a signal once a checkpoint stands, restarts it on `ranks`, and compares.
fn stop_and_restart(signal: &str, to_rank: bool, codes: &[i32], ranks: usize) {
    let config = data("mixed_flow.toml");
    let reference = uninterrupted(&LONG);
    let directory = scratch("stopped");
    let child = start(&Run { config: &config, ranks: 2, threads: 1 }, &directory, &LONG);
    wait_for_file(&directory, |name| name.ends_with(".h5"));
    let target = if to_rank { rank_of(&directory) } else { child.id().to_string() };
    assert!(Command::new("kill").args([signal, &target]).status().expect("kill starts").success());
    let output = wait(child);
    let code = output.status.code();
    assert!(
        code.is_some_and(|code| codes.is_empty() && code != 0 || codes.contains(&code)),
        "{code:?}: {}",
        text(&output)
    );
    let restart = ["--restart", directory.to_str().expect("a UTF-8 path")];
    let again = launch(&Run { config: &config, ranks, threads: 1 }, &directory, &[&LONG[..], &restart].concat());
    assert!(again.status.success(), "{}", text(&again));
    assert_eq!((digest_of(&again), history_of(&directory), snapshots(&directory)), reference, "{signal}");
}

/// Process number of one rank: a process other than mpirun whose command line names the run directory.
fn rank_of(directory: &Path) -> String {
    let pattern = format!("dem-mpi .*{}", directory.display());
    let output = Command::new("pgrep").args(["-f", "-n", &pattern]).output().expect("pgrep starts");
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
}

#[test]
fn sigusr1_checkpoints_and_asks_to_be_queued_again() {
    stop_and_restart("-USR1", false, &[75], 3);
}

#[test]
fn an_interrupt_loses_nothing_that_a_checkpoint_holds() {
    stop_and_restart("-INT", false, &[], 1);
}

#[test]
fn a_killed_rank_ends_the_run_and_leaves_the_last_checkpoint() {
    stop_and_restart("-KILL", true, &[], 4);
}

#[test]
fn a_restart_in_the_middle_changes_nothing_on_any_rank_count() {
    let config = data("mixed_flow.toml");
    let reference = uninterrupted(&[]);
    for ranks in [1, 2, 3] {
        let directory = scratch("half");
        let output = launch(&Run { config: &config, ranks: 2, threads: 1 }, &directory, &[]);
        assert!(output.status.success(), "{}", text(&output));
        // The run leaves checkpoints of steps 500 and 1000; go back to the first.
        let half = directory.join("checkpoint-000000000500.h5");
        let restart = ["--restart", half.to_str().expect("a UTF-8 path")];
        let again = launch(&Run { config: &config, ranks, threads: 2 }, &directory, &restart);
        assert!(again.status.success(), "{}", text(&again));
        assert_eq!((digest_of(&again), history_of(&directory), snapshots(&directory)), reference, "{ranks} ranks");
        let told = Command::new(env!("CARGO_BIN_EXE_dem-mpi")).arg("digest").arg(&directory).output().expect("starts");
        assert_eq!(String::from_utf8_lossy(&told.stdout).trim(), reference.0);
    }
}

#[test]
fn dents_and_necks_survive_a_restart_on_any_rank_count() {
    let config = data("dents.toml");
    let run = |directory: &Path, ranks: usize, extra: &[&str]| {
        let output = launch(&Run { config: &config, ranks, threads: 1 }, directory, extra);
        assert!(output.status.success(), "{}", text(&output));
        (digest_of(&output), history_of(directory))
    };
    let reference = run(&scratch("dents"), 1, &[]);
    for ranks in [1, 2, 4] {
        let directory = scratch("dents_half");
        run(&directory, 2, &[]);
        let half = directory.join("checkpoint-000000000500.h5");
        let again = run(&directory, ranks, &["--restart", half.to_str().expect("a UTF-8 path")]);
        assert_eq!(again, reference, "{ranks} ranks");
    }
}

#[test]
fn a_stage_added_to_a_complete_run_is_run_as_if_it_had_been_there() {
    let config = data("mixed_flow.toml");
    let whole = std::fs::read_to_string(&config).expect("the input is text");
    let directory = scratch("added");
    let (first, second) = (whole.find("[[stage]]").expect("a stage"), whole.rfind("[[stage]]").expect("another"));
    assert!(first < second);
    let after = second + whole[second..].find("[output]").expect("then output");
    let short = directory.join("short.toml");
    std::fs::write(&short, [&whole[..second], &whole[after..]].concat()).expect("the build folder can be written");
    let run_directory = directory.join("run");
    let output = launch(&Run { config: &short, ranks: 1, threads: 1 }, &run_directory, &[]);
    assert!(output.status.success(), "{}", text(&output));
    let restart = ["--restart", run_directory.to_str().expect("a UTF-8 path")];
    let again = launch(&Run { config: &short, ranks: 1, threads: 1 }, &run_directory, &restart);
    assert!(again.status.success() && text(&again).contains("nothing to do"), "{}", text(&again));
    let longer = launch(&Run { config: &config, ranks: 2, threads: 1 }, &run_directory, &restart);
    assert!(longer.status.success(), "{}", text(&longer));
    assert_eq!(digest_of(&longer), uninterrupted(&[]).0);
    // A quasi-static one too.
    let quasi_static = directory.join("quasi_static.toml");
    let stage = "[[stage]]\nroutine = \"quasi_static\"\nstrain_increment.z = \"0.01 %\"\nincrements = 1\n";
    std::fs::write(
        &quasi_static,
        [&whole[..after], stage, &whole[after..]].concat().replace("energy_ledger = true", ""),
    )
    .expect("the build folder can be written");
    let relaxed = launch(&Run { config: &quasi_static, ranks: 1, threads: 1 }, &run_directory, &restart);
    assert!(matches!(relaxed.status.code(), Some(0 | 1)) && !text(&relaxed).contains("panicked"), "{}", text(&relaxed));
}
