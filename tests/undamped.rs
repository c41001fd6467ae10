//! Runs without any dashpot, whose laws are given the velocities of half steps: springs gain no energy, and the bits are the
//! same however such a run is laid out.

mod common;

use common::{Run, data, digest_of, history_of, launch, root, scratch, text};
use std::path::Path;

/// Takes the dashpots out of tests/data/mixed_flow.toml and tests/data/ellipsoids.toml, which then overlap more.
const WITHOUT_DASHPOTS: [[&str; 2]; 3] = [
    ["--set", "contact.normal.hertz.damping=none"],
    ["--set", "contact.rolling.spring_slider.damping_ratio=0"],
    ["--set", "contact.max_overlap_fraction=0.4"],
];

fn outcome_in(directory: &Path, run: &Run, extra: &[&str]) -> (String, Vec<u8>) {
    let output = launch(run, directory, &[WITHOUT_DASHPOTS.as_flattened(), extra].concat());
    assert!(output.status.success(), "{}", text(&output));
    (digest_of(&output), history_of(directory))
}

fn outcome(run: &Run, extra: &[&str]) -> (String, Vec<u8>) {
    outcome_in(&scratch("run"), run, extra)
}

#[test]
fn a_compressed_packing_with_friction_gains_no_energy() {
    // With increments from extrapolated velocities the dissipated energy was four times the work.
    let directory = scratch("cyclic");
    let extra = [
        ["--set", "contact.normal.maxwell_zener.damping=none"],
        ["--set", "stage.1.cycles=1"],
        ["--set", "output.plots=false"],
    ];
    let config = root().join("configs/cyclic.toml");
    let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &directory, extra.as_flattened());
    assert!(output.status.success(), "{}", text(&output));
    let history = String::from_utf8(history_of(&directory)).expect("text");
    let mut lines = history.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let balance = |line: &str| -> [f64; 2] {
        let energies = names.iter().zip(line.split(',')).filter(|(name, _)| name.ends_with("_J"));
        let mut sums = [0.0; 2];
        for (name, value) in energies {
            sums[usize::from(name.starts_with("work"))] += value.parse::<f64>().expect("a number");
        }
        sums
    };
    let rows: Vec<[f64; 2]> = lines.map(balance).collect();
    let ([before, _], [after, work]) = (rows[0], rows[rows.len() - 1]);
    assert!(work > 0.0 && (after - before - work).abs() < 1e-3 * work, "{before} {after} {work}");
}

#[test]
fn the_bits_do_not_depend_on_ranks_threads_skins_and_vectors() {
    for config in ["mixed_flow.toml", "ellipsoids.toml"] {
        let config = data(config);
        let orientations = ["--set", "output.orientations=true"];
        let reference = outcome(&Run { config: &config, ranks: 1, threads: 1 }, &orientations);
        for (ranks, threads, skin) in [(1, 2, "0.2"), (2, 1, "0.05"), (3, 2, "0.1"), (4, 1, "0.05")] {
            let skin = format!("parallel.skin={skin}");
            let extra = [&orientations[..], &["--set", &skin]].concat();
            let got = outcome(&Run { config: &config, ranks, threads }, &extra);
            assert_eq!(got, reference, "{ranks} ranks, {threads} threads, {skin}");
        }
        let scalar = [&orientations[..], &["--set", "parallel.simd=scalar"]].concat();
        assert_eq!(outcome(&Run { config: &config, ranks: 1, threads: 1 }, &scalar), reference);
    }
}

#[test]
fn bc_kinematics_have_the_same_bits_too() {
    let config = data("mixed_flow.toml");
    let bc = ["--set", "load.kinematics=BC"];
    let reference = outcome(&Run { config: &config, ranks: 1, threads: 1 }, &bc);
    assert_eq!(outcome(&Run { config: &config, ranks: 3, threads: 1 }, &bc), reference);
}

#[test]
fn a_restart_in_the_middle_changes_nothing() {
    let config = data("mixed_flow.toml");
    let reference = outcome(&Run { config: &config, ranks: 1, threads: 1 }, &[]);
    for ranks in [1, 3] {
        let directory = scratch("half");
        outcome_in(&directory, &Run { config: &config, ranks: 2, threads: 1 }, &[]);
        let half = directory.join("checkpoint-000000000500.h5");
        let restart = ["--restart", half.to_str().expect("a UTF-8 path")];
        assert_eq!(outcome_in(&directory, &Run { config: &config, ranks, threads: 1 }, &restart), reference);
    }
}

#[test]
fn a_restart_with_dashpots_is_refused() {
    // Their springs are half an increment ahead.
    let config = data("mixed_flow.toml");
    let directory = scratch("half");
    let run = Run { config: &config, ranks: 1, threads: 1 };
    outcome_in(&directory, &run, &[]);
    let half = directory.join("checkpoint-000000000500.h5");
    let output = launch(&run, &directory, &["--restart", half.to_str().expect("a UTF-8 path")]);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert!(text(&output).contains("tangential_force_x_at_step"), "{}", text(&output));
}
