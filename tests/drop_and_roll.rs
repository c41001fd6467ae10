//! The drop-and-roll packing through the public binary: the same on every rank count, with the overlap
//! that its relaxation left.

mod common;

use common::{Run, digest_of, history_of, launch, root, scratch, text};

fn outcome(ranks: usize, extra: &[&str]) -> (String, Vec<u8>, String) {
    let directory = scratch("run");
    let config = root().join("configs/drop_and_roll.toml");
    let mut all = vec!["--set", "stage.0.until_strain={z=1e-4}", "--set", "output.history=\"50 steps\""];
    all.extend(["--set", "parallel.min_particles_per_rank=1"]);
    all.extend(extra);
    let output = launch(&Run { config: &config, ranks, threads: 1 }, &directory, &all);
    assert!(output.status.success(), "{}", text(&output));
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    let overlap = stdout.lines().find(|line| line.starts_with("packing: largest overlap")).unwrap_or_default();
    (digest_of(&output), history_of(&directory), overlap.to_owned())
}

#[test]
fn the_packing_and_its_run_have_the_same_bits_over_ranks() {
    let reference = outcome(1, &[]);
    for ranks in [2, 3] {
        assert_eq!(outcome(ranks, &[]), reference, "{ranks} ranks");
    }
    let fraction = reference.2.split_whitespace().nth(3).and_then(|word| word.parse::<f64>().ok());
    assert!(fraction.is_some_and(|fraction| fraction > 0.0 && fraction <= 1e-6), "{}", reference.2);
}

#[test]
fn a_larger_overlap_may_be_left_and_copies_be_made() {
    let remaining = ["--set", "packing.drop_and_roll.remaining_overlap=1e-3"];
    let (_, _, overlap) = outcome(1, &remaining);
    let fraction: f64 = overlap.split_whitespace().nth(3).unwrap().parse().unwrap();
    assert!(fraction > 1e-6 && fraction <= 1e-3, "{overlap}");
    let copies = ["--set", "packing.drop_and_roll.replicate=[1, 2, 1]"];
    assert_eq!(outcome(2, &copies), outcome(1, &copies));
}
