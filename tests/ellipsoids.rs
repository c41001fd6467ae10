//! Ellipsoids: one input, the same bits, whatever the ranks, threads, skins and restarts; pictures included.

mod common;

use common::{Run, data, digest_of, history_of, launch, scratch, text};
use std::path::Path;

/// Digest, history and the text files of the snapshots.
type Outcome = (String, Vec<u8>, Vec<(String, Vec<u8>)>);

fn outcome_in(directory: &Path, run: &Run, extra: &[&str]) -> Outcome {
    let output = launch(run, directory, extra);
    assert!(output.status.success(), "{}", text(&output));
    (digest_of(&output), history_of(directory), pictures(directory))
}

fn outcome(name: &str, run: &Run, extra: &[&str]) -> Outcome {
    outcome_in(&scratch(name), run, extra)
}

fn pictures(directory: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = std::fs::read_dir(directory.join("snapshots")).expect("the run wrote snapshots");
    let mut files: Vec<(String, Vec<u8>)> = entries
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|end| end != "vtkhdf"))
        .map(|path| (path.display().to_string(), path))
        .map(|(name, path)| {
            (name.rsplit('/').next().unwrap_or_default().to_owned(), std::fs::read(path).expect("a file"))
        })
        .collect();
    files.sort();
    files
}

#[test]
fn the_bits_do_not_depend_on_ranks_threads_skins_and_vectors() {
    let config = data("ellipsoids.toml");
    let reference = outcome("reference", &Run { config: &config, ranks: 1, threads: 1 }, &[]);
    assert_eq!(reference.2.iter().filter(|(name, _)| name.ends_with(".dump")).count(), 5);
    for (ranks, threads, skin) in [(1, 2, "0.05"), (2, 1, "0.2"), (3, 1, "0.05"), (4, 2, "0.1")] {
        let skin = format!("parallel.skin={skin}");
        let got = outcome("layout", &Run { config: &config, ranks, threads }, &["--set", &skin]);
        assert_eq!(got, reference, "{ranks} ranks, {threads} threads, {skin}");
    }
    let slabs = ["--set", "parallel.grid=[6, 1, 1]", "--set", "parallel.simd=scalar"];
    assert_eq!(outcome("slabs", &Run { config: &config, ranks: 6, threads: 1 }, &slabs), reference);
}

#[test]
fn bc_kinematics_have_the_same_bits_too() {
    let config = data("ellipsoids.toml");
    let extra = ["--set", "load.kinematics=BC"];
    let reference = outcome("bc", &Run { config: &config, ranks: 1, threads: 1 }, &extra);
    assert_eq!(outcome("bc", &Run { config: &config, ranks: 3, threads: 1 }, &extra), reference);
}

#[test]
fn a_restart_in_the_middle_changes_nothing_on_any_rank_count() {
    let config = data("ellipsoids.toml");
    let reference = outcome("whole", &Run { config: &config, ranks: 1, threads: 1 }, &[]);
    for ranks in [1, 2, 4] {
        let directory = scratch("half");
        outcome_in(&directory, &Run { config: &config, ranks: 2, threads: 1 }, &[]);
        let half = directory.join("checkpoint-000000000500.h5");
        let restart = ["--restart", half.to_str().expect("a UTF-8 path")];
        let again = outcome_in(&directory, &Run { config: &config, ranks, threads: 1 }, &restart);
        assert_eq!(again, reference, "{ranks} ranks");
    }
}
