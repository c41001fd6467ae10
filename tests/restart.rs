//! Stops of every kind, and restarts on other rank counts: the run goes on as if nothing had happened.

mod common;

use common::{Run, data, digest_of, history_of, launch, listing, scratch, start, text, wait, wait_for_file};
use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::os::unix::fs::OpenOptionsExt as _;
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

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

/// A named pipe in which the program waits until it is opened for writing.
fn pipe(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    let made = Command::new("mkfifo").arg(&path).status().expect("mkfifo starts");
    assert!(made.success());
    path
}

/// The other end of a pipe, once `child` reads it; `None` if it ends without.
fn opened(pipe: &Path, child: &mut Child) -> Option<File> {
    loop {
        // Without a reader this fails at once.
        match OpenOptions::new().write(true).custom_flags(libc::O_NONBLOCK).open(pipe) {
            Ok(file) => return Some(file),
            Err(_) if child.try_wait().expect("the program can be asked").is_some() => return None,
            Err(_) => sleep(Duration::from_millis(10)),
        }
    }
}

#[test]
fn sigusr1_while_the_input_is_read_or_mpi_starts_is_heard() {
    let folder = scratch("early");
    let program = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_dem-mpi"));
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).args(["--set", "output.plots=false", "--output"]);
        command
    };
    let input = std::fs::read(data("mixed_flow.toml")).expect("the input is there");
    let (config, settings) = (pipe(&folder, "input.toml"), pipe(&folder, "mpi.conf"));
    let reads = program().arg(folder.join("a")).arg(&config).spawn().expect("the program starts");
    // Open MPI reads these settings when it starts; other libraries do not, and without MPI nothing does.
    let mut starts = program();
    starts.arg(folder.join("b")).arg(data("mixed_flow.toml")).env("OMPI_MCA_mca_base_param_files", &settings);
    starts
        .env("OMPI_COMM_WORLD_SIZE", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
    let starts = starts.spawn().expect("the program starts");
    for (mut child, pipe, content) in [(reads, &config, input), (starts, &settings, Vec::new())] {
        let Some(mut file) = opened(pipe, &mut child) else {
            eprintln!("SKIPPED: this MPI does not read {}", pipe.display());
            continue;
        };
        // Whoever else would read it finds an empty file.
        std::fs::remove_file(pipe).expect("it is there");
        std::fs::write(pipe, "").expect("the build folder can be written");
        assert!(Command::new("kill").args(["-USR1", &child.id().to_string()]).status().expect("kill starts").success());
        // Either it is dead then or it has heard.
        sleep(Duration::from_millis(200));
        let _ = file.write_all(&content);
        drop(file);
        let output = wait(child);
        assert_eq!(output.status.code(), Some(75), "{}: {}", pipe.display(), text(&output));
    }
}

#[test]
fn sigusr1_ends_a_command_that_does_not_listen() {
    let config = pipe(&scratch("check"), "input.toml");
    let mut command = Command::new(env!("CARGO_BIN_EXE_dem-mpi"));
    let mut child = command.arg("check").arg(&config).spawn().expect("the program starts");
    let _file = opened(&config, &mut child).expect("it reads its input");
    assert!(Command::new("kill").args(["-USR1", &child.id().to_string()]).status().expect("kill starts").success());
    assert_eq!(wait(child).status.signal(), Some(libc::SIGUSR1));
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
fn memory_of_a_contact_that_has_just_parted_depends_neither_on_a_restart_nor_on_the_skin() {
    let config = data("parting_from_walls.toml");
    let digest = |name: &str, extra: &[&str]| {
        let folder = scratch(name);
        let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &folder, extra);
        assert!(output.status.success(), "{}", text(&output));
        (digest_of(&output), folder)
    };
    let (whole, folder) = digest("parting", &[]);
    for skin in ["0.3", "0.005"] {
        assert_eq!(digest("other_skin", &["--set", &format!("parallel.skin={skin}")]).0, whole, "skin {skin}");
    }
    let checkpoint = folder.join(format!("checkpoint-{:012}.h5", 200));
    let restarted = digest("parting_restarted", &["--restart", checkpoint.to_str().expect("a path")]);
    assert_eq!(restarted.0, whole);
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

#[test]
fn a_run_that_cannot_begin_leaves_an_earlier_one_as_it_was() {
    let config = data("mixed_flow.toml");
    let directory = scratch("earlier");
    let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &directory, &[]);
    assert!(output.status.success(), "{}", text(&output));
    let before = listing(&directory);
    assert!(before.iter().any(|(name, _)| name == "status.toml"));
    let half = directory.join("checkpoint-000000000500.h5");
    let restart = ["--restart", half.to_str().expect("a UTF-8 path")];
    let refused: [(&[&str], &str); 5] = [
        (&["--set", "time_step=\"1 s\""], "unstable"),
        (&["--set", "packing.random_close.perturbation=0.5"], "overlap"),
        (&[restart[0], restart[1], "--set", "time_step=\"1 s\""], "unstable"),
        (&[restart[0], restart[1], "--set", "stage.0.strain_rate=[\"1 1/s\", 0, 0]"], "stage.0.strain_rate"),
        (&[restart[0], restart[1], "--set", "species.1.count=151"], "species.1.count is 151 and was 150"),
    ];
    for (extra, named) in refused {
        let output = launch(&Run { config: &config, ranks: 2, threads: 1 }, &directory, extra);
        assert!(!output.status.success() && text(&output).contains(named), "{extra:?}: {}", text(&output));
        assert_eq!(listing(&directory), before, "{extra:?}");
    }
    // The history of the run is gone: nothing else may go with it.
    std::fs::remove_file(directory.join("history.csv")).expect("it is there");
    let before = listing(&directory);
    let output = launch(&Run { config: &config, ranks: 2, threads: 1 }, &directory, &restart);
    assert!(!output.status.success() && text(&output).contains("history.csv"), "{}", text(&output));
    assert_eq!(listing(&directory), before);
}

#[test]
fn other_species_than_those_of_the_checkpoint_are_refused() {
    let config = data("mixed_flow.toml");
    let folder = scratch("species");
    let directory = folder.join("run");
    let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &directory, &[]);
    assert!(output.status.success(), "{}", text(&output));
    let before = listing(&directory);
    let whole = std::fs::read_to_string(&config).expect("the input is text");
    let starts: Vec<usize> = whole.match_indices("[[species]]").map(|(at, _)| at).collect();
    let end = whole.find("[contact.normal").expect("then laws");
    let (hard, soft) = (&whole[starts[0]..starts[1]], &whole[starts[1]..end]);
    let third = "[[species]]\nname = \"third\"\nmaterial = \"hard\"\nradius = \"1 mm\"\ncount = 1\n\n";
    for (species, named) in [
        ([soft, hard, ""], "the species are \"soft\", \"hard\" and were \"hard\", \"soft\""),
        ([hard, soft, third], "the species are \"hard\", \"soft\", \"third\" and were \"hard\", \"soft\""),
        ([hard, "", ""], "the species are \"hard\" and were \"hard\", \"soft\""),
    ] {
        let other = folder.join("other.toml");
        let input = [&whole[..starts[0]], &species.concat(), &whole[end..]].concat();
        std::fs::write(&other, input).expect("the build folder can be written");
        let restart = ["--restart", directory.to_str().expect("a UTF-8 path")];
        let output = launch(&Run { config: &other, ranks: 2, threads: 1 }, &directory, &restart);
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        assert!(text(&output).contains(named), "{named}: {}", text(&output));
        assert_eq!(listing(&directory), before, "{named}");
    }
}

/// Steps of the rows of a history.
fn steps_of(directory: &Path) -> Vec<u64> {
    let history = String::from_utf8(history_of(directory)).expect("text");
    history
        .lines()
        .skip(1)
        .map(|line| line.split(',').next().and_then(|step| step.parse().ok()).expect("a step"))
        .collect()
}

#[test]
fn rows_keep_a_changed_interval_after_a_restart() {
    let config = data("mixed_flow.toml");
    let directory = scratch("intervals");
    let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &directory, &[]);
    assert!(output.status.success(), "{}", text(&output));
    let half = directory.join("checkpoint-000000000500.h5");
    let restart = ["--restart", half.to_str().expect("a UTF-8 path"), "--set", "output.history=\"90 steps\""];
    let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &directory, &restart);
    assert!(output.status.success(), "{}", text(&output));
    let expected: Vec<u64> = (0..500).step_by(50).chain((540..1000).step_by(90)).chain([1000]).collect();
    assert_eq!(steps_of(&directory), expected);
}

#[test]
fn rows_keep_their_interval_around_a_quasi_static_stage() {
    let directory = scratch("after_quasi_static");
    let config = directory.join("mixed.toml");
    let input = "[[material]]\nname = \"m\"\ndensity = 2500\nyoung_modulus = \"1 GPa\"\npoisson_ratio = 0.25\n\
                 restitution = 0.5\n[[species]]\nname = \"s\"\nmaterial = \"m\"\nradius = \"1 mm\"\ncount = 40\n\
                 [contact.normal.hertz]\n[[stage]]\nhold = true\nsteps = 100\n[[stage]]\nroutine = \"quasi_static\"\nstrain_increment = { z = \"0.05 %\" }\n\
                 increments = 3\n[[stage]]\nstrain_rate = { z = \"0.1 1/s\" }\nsteps = 230\n\
                 [output]\nhistory = \"50 steps\"\nsnapshots = \"100 steps\"\nplots = false\n";
    std::fs::write(&config, input).expect("the build folder can be written");
    let run_directory = directory.join("run");
    let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &run_directory, &[]);
    assert!(output.status.success(), "{}", text(&output));
    let steps = steps_of(&run_directory);
    // A dynamic stage and three equilibria, the last of which is the second dynamic stage's first state.
    assert_eq!(steps[..3], [0, 50, 100]);
    let (start, end) = (steps[5], steps[5] + 230);
    let multiples = (start + 1..end).filter(|step| step % 50 == 0);
    let expected: Vec<u64> = steps[..6].iter().copied().chain(multiples).chain([end]).collect();
    assert_eq!(steps, expected);
    assert!(snapshots(&run_directory) >= 5, "{}", snapshots(&run_directory));
}
