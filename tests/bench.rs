//! `dem-mpi bench` through the program: a packing made, timed on one and two ranks, scaling studies.

mod common;

use common::{command, scratch, text};
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};

fn bench(ranks: usize, folder: &Path, arguments: &[&str]) -> Output {
    let mut command = command(ranks);
    command.current_dir(folder).env("OMPI_ALLOW_RUN_AS_ROOT", "1").env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
    command.arg("bench").args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    common::wait(command.spawn().expect("the program starts"))
}

fn packing(folder: &Path) -> PathBuf {
    let output = bench(1, folder, &["--write-data", "p.data", "--particles", "300"]);
    assert!(output.status.success(), "{}", text(&output));
    folder.join("p.data")
}

/// The number behind a name at the beginning of a line.
fn number(output: &Output, name: &str) -> f64 {
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    let found = stdout.lines().find_map(|line| line.strip_prefix(name)?.split_whitespace().next()?.parse().ok());
    found.unwrap_or_else(|| panic!("no {name} in {}", text(output)))
}

#[test]
fn a_packing_is_timed_on_any_ranks_and_the_last_line_is_the_loop_time() {
    let folder = scratch("packing");
    packing(&folder);
    let run = |ranks, more: &[&str]| {
        let arguments = [&["--packing", "p.data", "--steps", "20", "--warm", "5"], more].concat();
        let output = bench(ranks, &folder, &arguments);
        assert!(output.status.success(), "{}", text(&output));
        let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
        let last: Vec<&str> = stdout.lines().last().unwrap_or_default().split(' ').collect();
        let [loop_word, seconds, unit] = last[..] else { panic!("{stdout}") };
        let seconds: f64 = seconds.parse().expect("seconds");
        assert!(loop_word == "loop" && unit == "s" && seconds > 0.0, "{stdout}");
        let rate = number(&output, "particle-steps/s");
        let expected = number(&output, "particles ") * 20.0 / seconds;
        assert!((rate / expected - 1.0).abs() < 1e-3, "{stdout}");
        output
    };
    let one = run(1, &["--threads", "2"]);
    assert_eq!(number(&one, "particles "), 300.0);
    let coordination = number(&one, "coordination");
    assert!((5.0..6.5).contains(&coordination), "coordination {coordination}");
    assert_eq!(number(&run(2, &[]), "coordination"), coordination, "the same steps on two ranks");
    assert_eq!(number(&run(1, &["--copies", "2x1x1"]), "particles "), 600.0);
    assert!(text(&run(1, &["--law", "maxwell_zener"])).contains("maxwell_zener + mindlin"));
}

#[test]
fn numbers_without_meaning_are_refused() {
    for (name, value) in [("--repeats", "0"), ("--steps", "0"), ("--threads", "0")] {
        let output = bench(1, &scratch("refused"), &[name, value]);
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        assert!(text(&output).contains(&format!("'{value}' for '{name}")), "{}", text(&output));
    }
    for (name, value) in
        [("--contact-share", "2"), ("--solid-fraction", "1.1"), ("--latency", "0"), ("--step-cost", "1e300")]
    {
        let mut command = command(1);
        command.args(["scaling", name, value]).stdout(Stdio::piped()).stderr(Stdio::piped());
        let output = common::wait(command.spawn().expect("the program starts"));
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        assert!(text(&output).contains(&format!("{name} {value}: give")), "{}", text(&output));
    }
}

#[test]
fn replicas_behave_like_the_base() {
    let folder = scratch("copies");
    packing(&folder);
    let coordination = |ranks, copies: &str| {
        let arguments = ["--packing", "p.data", "--steps", "5", "--warm", "1", "--copies", copies];
        let output = bench(ranks, &folder, &arguments);
        assert!(output.status.success(), "{}", text(&output));
        number(&output, "coordination")
    };
    let base = coordination(1, "1x1x1");
    assert!((coordination(1, "2x1x2") - base).abs() < 0.01);
    assert!((coordination(2, "2x2x2") - base).abs() < 0.01);
}

#[test]
fn scaling_studies_leave_a_table_and_pictures() {
    for (kind, sizes) in [("--strong", [300, 300]), ("--weak", [300, 600])] {
        let folder = scratch(kind.trim_start_matches('-'));
        let arguments =
            [kind, "--particles", "300", "--layouts", "1x1,2x1", "--repeats", "1", "--steps", "10", "--warm", "1"];
        let output = bench(1, &folder, &[&arguments[..], &["--output", "out"]].concat());
        assert!(output.status.success(), "{}", text(&output));
        let table = std::fs::read_to_string(folder.join("out/scaling.csv")).expect("table");
        let rows: Vec<Vec<f64>> = table
            .lines()
            .skip(1)
            .map(|line| line.split(',').map(|word| word.parse().expect("a number")).collect())
            .collect();
        let particles: Vec<f64> = rows.iter().map(|row| row[0]).collect();
        assert_eq!(particles, sizes.map(f64::from), "{table}");
        assert_eq!([rows[0][1], rows[1][1], rows[0][6], rows[0][7]], [1.0, 2.0, 1.0, 1.0], "{table}");
        assert!(rows[0][8] < 0.5 && rows[1][8] > 0.0, "halo shares: {table}");
        for picture in ["speed_up.png", "efficiency.png"] {
            assert!(std::fs::metadata(folder.join("out").join(picture)).expect("picture").len() > 2_000);
        }
    }
}

#[test]
fn wrong_usage_is_refused_with_one_message() {
    let folder = scratch("usage");
    packing(&folder);
    let cases: [(usize, &[&str], &str); 13] = [
        (1, &["--threads", "2"], "were not provided"),
        (1, &["--packing", "p.data", "--output", "out"], "cannot be used with"),
        (1, &["--write-data", "q.data", "--particles", "10", "--output", "out"], "cannot be used with"),
        (2, &["--packing", "p.data", "--copies", "100000x100000x100000"], "more than ids can number"),
        (2, &["--packing", "p.data", "--copies", "200x200x300"], "GB are free; give fewer copies"),
        (1, &["--packing", "p.data", "--sides", "1", "nan", "1"], "three lengths above 0"),
        (2, &["--particles", "300"], "run it without mpirun"),
        (2, &["--packing", "absent.data"], "correct the path"),
        (1, &["--write-data", "p.data"], "needs one --particles N"),
        (1, &["--layouts", "2"], "RANKSxTHREADS"),
        (1, &["--strong", "--particles", "1,2"], "one number"),
        (1, &["--radii", "0.5"], "from 1 to 10"),
        (
            1,
            &["--particles", "300", "--repeats", "1", "--layouts", "2x1", "--launcher", "no-such-mpirun"],
            "--launcher",
        ),
    ];
    for (ranks, arguments, expected) in cases {
        let output = bench(ranks, &folder, arguments);
        assert!(!output.status.success(), "{arguments:?}: {}", text(&output));
        assert_eq!(text(&output).matches(expected).count(), 1, "{arguments:?}: {}", text(&output));
    }
}

#[test]
fn more_ranks_than_particles_are_refused_and_none_are_assumed() {
    let scaling = |arguments: &[&str]| {
        let mut command = command(1);
        command.arg("scaling").args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
        common::wait(command.spawn().expect("the program starts"))
    };
    let refused = scaling(&["--particles", "10", "--ranks", "1,11"]);
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
    assert!(
        text(&refused).contains("--ranks 11: give numbers from 1 to that of the particles, 10"),
        "{}",
        text(&refused)
    );
    let table = scaling(&["--particles", "2000"]);
    assert!(table.status.success() && String::from_utf8_lossy(&table.stdout).lines().count() == 4, "{}", text(&table));
    assert!(text(&scaling(&["--help"])).contains("[default: 1,1000,10000,100000"));
}
