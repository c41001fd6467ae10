//! Packings made of copies: every rank makes a share, and the whole is the same for any number of them.

mod common;

use common::{Run, data, digest_of, history_of, launch, scratch, text};

fn outcome(name: &str, ranks: usize, extra: &[&str]) -> (String, Vec<u8>) {
    let directory = scratch(name);
    let output = launch(&Run { config: &data("replicated.toml"), ranks, threads: 1 }, &directory, extra);
    assert!(output.status.success(), "{name}: {}", text(&output));
    (digest_of(&output), history_of(&directory))
}

#[test]
fn copies_have_the_same_bits_over_ranks() {
    let reference = outcome("one", 1, &[]);
    for ranks in [2, 4, 7] {
        assert_eq!(outcome("several", ranks, &[]), reference, "{ranks} ranks");
    }
    let thin = ["--set", "parallel.grid=[8, 1, 1]"];
    assert_eq!(outcome("thin", 8, &thin), reference, "boxes thinner than the reach");
}

#[test]
fn tiles_of_layers_that_are_too_large_for_the_cache_have_the_same_bits() {
    // 300,000 particles, about 6900 in a layer (`neighbour/tiles.rs`): one thread goes through two tiles. Two ranks have
    // layers of 3500 and no tiles.
    let extra = ["--set", "packing.random_close.replicate=[14, 14, 14]", "--set", "stage.0.until_strain={z=0.0002}"];
    let reference = outcome("tiles", 1, &extra);
    assert_eq!(outcome("no_tiles", 2, &extra), reference);
}

/// A column of the first row of a history.
fn first(history: &[u8], column: &str) -> f64 {
    let text = String::from_utf8_lossy(history).into_owned();
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let (names, row) = (lines.next().expect("a header"), lines.next().expect("a row"));
    let place = names.iter().position(|name| *name == column).expect("the column is there");
    row[place].parse().expect("a number")
}

#[test]
fn a_rod_of_three_copies_is_as_dense_as_the_base_and_three_times_as_much() {
    let extra = |copies| {
        let replicate = format!("packing.random_close.replicate={copies}");
        ["--set".to_owned(), replicate, "--set".to_owned(), "packing.random_close.perturbation=0".to_owned()]
    };
    let history = |copies| {
        let extra = extra(copies);
        outcome("rod", 2, &extra.iter().map(String::as_str).collect::<Vec<_>>()).1
    };
    let (base, rod) = (history("[1, 1, 1]"), history("[1, 1, 3]"));
    let fraction = [&base, &rod].map(|history| first(history, "solid_fraction"));
    assert!((fraction[0] - fraction[1]).abs() < 1e-12, "{fraction:?}");
    let kinetic = [&base, &rod].map(|history| first(history, "kinetic_J"));
    assert!((1.5..6.0).contains(&(kinetic[1] / kinetic[0])), "{kinetic:?}");
}

#[test]
fn too_large_displacements_stop_every_rank_with_one_message_that_does_not_depend_on_ranks() {
    let extra = ["--set", "packing.random_close.perturbation=0.4", "--set", "contact.max_overlap_fraction=0.2"];
    let mut messages = Vec::new();
    for ranks in [1, 2, 4] {
        let directory = scratch("overlapping");
        let output = launch(&Run { config: &data("replicated.toml"), ranks, threads: 1 }, &directory, &extra);
        assert_eq!(output.status.code(), Some(1), "{}", text(&output));
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        let lines: Vec<String> = stderr.lines().filter(|line| line.contains("overlap by")).map(str::to_owned).collect();
        assert_eq!(lines.len(), 1, "{stderr}");
        assert!(lines[0].contains("packing.random_close.perturbation"), "{stderr}");
        messages.extend(lines);
    }
    assert!(messages.iter().all(|message| *message == messages[0]), "{messages:?}");
}

#[test]
fn copies_along_an_axis_with_walls_are_refused() {
    let extra = ["--set", "cell.boundary={z=\"walls\"}", "--set", "cell.wall_material=grain"];
    let output = launch(&Run { config: &data("replicated.toml"), ranks: 1, threads: 1 }, &scratch("walls"), &extra);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert!(text(&output).contains("2 copies along the z axis, which has walls"), "{}", text(&output));
}
