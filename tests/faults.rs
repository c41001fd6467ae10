//! What goes wrong is said once, ends every rank with a code, and loses nothing.

mod common;

use common::{Run, data, launch, root, scratch, text};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn expect_failure(output: &Output, code: i32, fragments: &[&str]) {
    let said = text(output);
    assert_eq!(output.status.code(), Some(code), "{said}");
    for fragment in fragments {
        assert!(said.contains(fragment), "expected {fragment:?} in: {said}");
    }
    assert_eq!(said.matches("dem-mpi: ").count(), 1, "one message, not {said}");
}

/// A finished short run of which the checkpoints can be spoilt.
fn finished(name: &str) -> PathBuf {
    let directory = scratch(name);
    let config = data("mixed_flow.toml");
    let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &directory, &[]);
    assert!(output.status.success(), "{}", text(&output));
    directory
}

fn restart(from: &Path, ranks: usize) -> Output {
    let config = data("mixed_flow.toml");
    let directory = scratch("again");
    launch(&Run { config: &config, ranks, threads: 1 }, &directory, &["--restart", from.to_str().expect("UTF-8")])
}

#[test]
fn corrupt_truncated_and_foreign_checkpoints_are_refused() {
    let directory = finished("spoilt");
    let good = fs::read(directory.join("checkpoint-000000001000.h5")).expect("a checkpoint");
    let file = directory.join("spoilt.h5");
    let mut flipped = good.clone();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 1;
    for (bytes, what) in [
        (flipped, "damaged"),
        (good[..good.len() / 2].to_vec(), "truncated"),
        ([&good[..], b"more"].concat(), "too long"),
        (b"not a checkpoint".to_vec(), "not a dem-mpi checkpoint"),
    ] {
        fs::write(&file, bytes).expect("the build folder can be written");
        for ranks in [1, 2] {
            let output = restart(&file, ranks);
            assert_eq!(output.status.code(), Some(1), "{what} on {ranks} ranks: {}", text(&output));
            assert!(text(&output).contains("spoilt.h5"), "{what}: {}", text(&output));
            assert!(text(&output).contains(what), "{what}: {}", text(&output));
        }
    }
}

#[test]
fn a_checkpoint_whose_contacts_keep_something_else_is_refused() {
    let directory = finished("other-laws");
    let config = data("mixed_flow.toml");
    for (law, wanted) in [
        (
            "{ scheme = \"midpoint\" }",
            "of soft with soft keep hertzian (m^2) instead of overlap (m), long_term_force (N);",
        ),
        ("{ damping = \"tsuji\" }", ""),
    ] {
        let changed = format!("pair.0.normal.maxwell_zener={law}");
        let extra = ["--restart", directory.to_str().expect("UTF-8"), "--set", &changed];
        let output = launch(&Run { config: &config, ranks: 2, threads: 1 }, &scratch("others"), &extra);
        assert_eq!(output.status.success(), wanted.is_empty(), "{}", text(&output));
        assert!(text(&output).contains(wanted), "{}", text(&output));
    }
}

#[test]
fn a_restart_into_the_directory_of_another_run_is_refused() {
    let (from, other) = (finished("from"), finished("other"));
    let config = data("mixed_flow.toml");
    let history = fs::read(other.join("history.csv")).expect("a history");
    let extra = ["--restart", from.to_str().expect("UTF-8")];
    let refused = launch(&Run { config: &config, ranks: 2, threads: 1 }, &other, &extra);
    assert!(!refused.status.success(), "{}", text(&refused));
    for fragment in ["holds another run", other.to_str().expect("UTF-8"), "--output"] {
        assert!(text(&refused).contains(fragment), "expected {fragment:?} in: {}", text(&refused));
    }
    assert_eq!(fs::read(other.join("history.csv")).expect("a history"), history);
    assert!(other.join("checkpoint-000000001000.h5").exists() && other.join("status.toml").exists());
    let own = launch(&Run { config: &config, ranks: 2, threads: 1 }, &from, &extra);
    assert!(own.status.success(), "{}", text(&own));
}

#[test]
fn a_damaged_newest_checkpoint_is_passed_over_with_a_warning() {
    let directory = finished("passed-over");
    let newest = directory.join("checkpoint-000000001000.h5");
    let mut bytes = fs::read(&newest).expect("a checkpoint");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&newest, bytes).expect("the build folder can be written");
    let output = restart(&directory, 2);
    assert!(output.status.success(), "{}", text(&output));
    assert!(text(&output).contains("passed over") && text(&output).contains("000000000500"), "{}", text(&output));
}

#[test]
fn a_full_disk_ends_the_run_with_one_message_and_keeps_the_last_checkpoint() {
    let mount = scratch("disk");
    let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", "size=1500k", "tmpfs"]).arg(&mount).status();
    if !mounted.is_ok_and(|status| status.success()) {
        eprintln!("SKIPPED: a small tmpfs cannot be mounted here (not root?), so no disk can be filled");
        return;
    }
    let config = data("mixed_flow.toml");
    let directory = mount.join("run");
    let extra = ["--set", "output.checkpoint_steps=100", "--set", "output.checkpoints_kept=100"];
    let output = launch(&Run { config: &config, ranks: 2, threads: 1 }, &directory, &extra);
    let checkpoints: Vec<String> = fs::read_dir(&directory)
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| entry.file_name().into_string().ok())
        .filter(|name| name.contains(".h5"))
        .collect();
    let resumed = restart(&directory, 1);
    assert!(Command::new("umount").arg(&mount).status().is_ok_and(|status| status.success()));
    expect_failure(&output, 1, &["checkpoint-", "free"]);
    assert!(checkpoints.iter().all(|name| name.ends_with(".h5")), "half-written files: {checkpoints:?}");
    assert!(!checkpoints.is_empty() && resumed.status.success(), "{checkpoints:?}: {}", text(&resumed));
}

#[test]
fn an_overlap_beyond_the_limit_stops_all_ranks_with_a_post_mortem() {
    let config = data("mixed_flow.toml");
    let mut contacts = Vec::new();
    for ranks in [1, 2, 3, 4] {
        let directory = scratch("overlap");
        // The jump of an increment makes many contacts overlap too much at once.
        let stage = "stage=[{routine=\"quasi_static\", strain_increment=0.009, increments=2}]";
        let limit = "contact.max_overlap_fraction=0.001";
        let extra = ["--set", limit, "--set", stage, "--set", "output.energy_ledger=false"];
        let output = launch(&Run { config: &config, ranks, threads: 1 }, &directory, &extra);
        expect_failure(&output, 1, &["overlaps by", "max_overlap_fraction", "step"]);
        let names = fs::read_dir(&directory).into_iter().flatten().flatten();
        assert!(names.filter_map(|e| e.file_name().into_string().ok()).any(|n| n.starts_with("post_mortem")));
        let said = text(&output);
        let named = said.split_once("the contact of ").and_then(|(_, rest)| rest.split_once(", more than"));
        contacts.push(named.map_or_else(|| panic!("no contact in {said}"), |(contact, _)| contact.to_owned()));
    }
    assert!(contacts.iter().all(|contact| *contact == contacts[0]), "not the same on any ranks: {contacts:?}");
}

#[test]
fn a_grid_that_cannot_work_is_an_error_and_idle_ranks_are_announced() {
    let config = data("mixed_flow.toml");
    let output =
        launch(&Run { config: &config, ranks: 2, threads: 1 }, &scratch("grid"), &["--set", "parallel.grid=[3, 1, 1]"]);
    expect_failure(&output, 1, &["parallel layout", "3"]);
    let idle = ["--set", "parallel.min_particles_per_rank=300"];
    let output = launch(&Run { config: &config, ranks: 3, threads: 1 }, &scratch("idle"), &idle);
    assert!(output.status.success() && text(&output).contains("stay idle"), "{}", text(&output));
}

#[test]
fn missing_files_are_named() {
    let missing = data("no_such.toml");
    let output = launch(&Run { config: &missing, ranks: 2, threads: 1 }, &scratch("missing"), &[]);
    assert!(!output.status.success() && text(&output).contains("no_such.toml"), "{}", text(&output));
    let config = data("mixed_flow.toml");
    let nowhere = ["--restart", "no_such_run"];
    let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &scratch("nowhere"), &nowhere);
    assert!(!output.status.success() && text(&output).contains("no_such_run"), "{}", text(&output));
}

#[test]
fn an_unstable_time_step_is_an_error_that_names_both_numbers() {
    let config = data("mixed_flow.toml");
    let extra = ["--set", "time_step.fixed=1 ms"];
    let output = launch(&Run { config: &config, ranks: 2, threads: 1 }, &scratch("unstable"), &extra);
    expect_failure(&output, 1, &["unstable", "1.000e-3"]);
}

#[test]
fn energies_that_are_no_numbers_are_an_error() {
    let config = root().join("configs/quickstart.toml");
    for ranks in [1, 2] {
        let extra = ["--set", "species.0.radius=1e60", "--set", "parallel.min_particles_per_rank=1"];
        let output = launch(&Run { config: &config, ranks, threads: 1 }, &scratch("huge"), &extra);
        expect_failure(&output, 1, &["kinetic energy is NaN", "units of radii"]);
    }
}

#[test]
fn waiting_for_a_stress_while_the_cell_only_expands_comes_to_an_end() {
    let config = data("mixed_flow.toml");
    let extra =
        ["--set", "stage=[{strain_rate={z=-200}, until_stress={z=1e6}}]", "--set", "output.energy_ledger=false"];
    let output = launch(&Run { config: &config, ranks: 2, threads: 1 }, &scratch("vain"), &extra);
    expect_failure(&output, 1, &["waits for the stress of until_stress while the cell only expands", "another end"]);
}

#[test]
fn constants_that_no_law_reads_are_warned_of_once() {
    let config = data("mixed_flow.toml");
    let extra = ["--set", "material.0.yield_stress=1e6"];
    let output = launch(&Run { config: &config, ranks: 2, threads: 1 }, &scratch("idle"), &extra);
    assert!(output.status.success(), "{}", text(&output));
    let warning = "yield_stress of the material \"hard\" has no effect";
    assert_eq!(text(&output).matches(warning).count(), 1, "{}", text(&output));
    let config = root().join("configs/quickstart.toml");
    let short = ["--set", "stage=[{hold=true, steps=1}]", "--set", "output.plots=false", "--set"];
    for (damping, said) in [("none", 1), ("tsuji", 0)] {
        let damping = format!("contact.normal.maxwell_zener.damping={damping}");
        let output = launch(
            &Run { config: &config, ranks: 1, threads: 1 },
            &scratch("undamped"),
            &[&short[..], &[&damping]].concat(),
        );
        assert!(output.status.success(), "{}", text(&output));
        let warning = "restitution of the material \"PVDF\" has no effect: no normal law of its contacts has a dashpot";
        assert_eq!(text(&output).matches(warning).count(), said, "{}", text(&output));
    }
}
