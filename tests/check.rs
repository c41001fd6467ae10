//! `dem-mpi check` refuses what the run refuses before its first step, and commands for one process speak once under
//! mpirun.

mod common;

use common::{Run, command, data, launch, root, scratch, text};
use std::fs;
use std::path::Path;
use std::process::{Output, Stdio};

fn call(ranks: usize, arguments: &[&str]) -> Output {
    let mut command = command(ranks);
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    common::wait(command.spawn().expect("the program starts"))
}

fn utf8(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// What the last line of an error says.
fn complaint(output: &Output) -> String {
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    stderr.split_once("dem-mpi: ").map(|(_, rest)| rest.trim().to_owned()).unwrap_or_default()
}

#[test]
fn what_is_wrong_with_a_particle_file_is_found_as_the_run_finds_it() {
    let folder = scratch("files");
    let good = "species,x_m,y_m,z_m,radius_m\nbead,1e-3,2e-3,2e-3,1e-3\nbead,3e-3,2e-3,2e-3,1e-3\n";
    let cases = [
        (good.to_owned(), ""),
        (good.replace("3e-3,2e-3", "1.1e-3,2e-3"), "overlap by"),
        (good.replace("bead,3", "sand,3"), "unknown species \"sand\""),
        (good.replace("radius_m", "radius"), "column \"radius\" is not known"),
        (good.lines().next().unwrap_or_default().to_owned(), "holds no particles"),
        (good.replace(",1e-3\n", ",1e-15\n"), "times the smallest diameter"),
        (good.replace("bead,3e-3", "bead,1e999"), "is not a finite number"),
    ];
    let input = folder.join("in.toml");
    let text_of = fs::read_to_string(root().join("tests/bad_inputs/no_particle_file.toml")).expect("an input");
    let text_of = text_of.replace("nowhere.csv", "particles.csv");
    fs::write(&input, text_of).expect("the build folder can be written");
    for (particles, wanted) in cases {
        fs::write(folder.join("particles.csv"), &particles).expect("the build folder can be written");
        let sides = "cell.sides=[\"1 cm\", \"1 cm\", \"1 cm\"]";
        let checked = call(1, &["check", utf8(&input), "--set", sides]);
        let directory = folder.join("run");
        let run = launch(&Run { config: &input, ranks: 1, threads: 1 }, &directory, &["--set", sides]);
        assert_eq!(checked.status.code(), run.status.code(), "{}\n{}", text(&checked), text(&run));
        assert_eq!(checked.status.success(), wanted.is_empty(), "{}", text(&checked));
        if wanted.is_empty() {
            assert!(
                text(&checked).contains("2 from") && text(&checked).contains("solid fraction"),
                "{}",
                text(&checked)
            );
        } else {
            assert!(complaint(&checked).contains(wanted), "{}", text(&checked));
            assert_eq!(complaint(&checked), complaint(&run));
        }
    }
}

#[test]
fn a_step_that_the_run_will_refuse_ends_the_check_with_the_error_of_the_run() {
    let config = data("mixed_flow.toml");
    let extra = ["--set", "time_step.fixed=1 ms"];
    let checked = call(1, &[&["check", utf8(&config)], &extra[..]].concat());
    let run = launch(&Run { config: &config, ranks: 1, threads: 1 }, &scratch("unstable"), &extra);
    assert_eq!(checked.status.code(), Some(1), "{}", text(&checked));
    assert_eq!(run.status.code(), Some(1));
    assert!(complaint(&checked).contains("is unstable"), "{}", text(&checked));
    let fine = call(1, &["check", utf8(&config)]);
    assert!(fine.status.success(), "{}", text(&fine));
}

#[test]
fn commands_for_one_process_speak_once_under_mpirun() {
    let config = data("mixed_flow.toml");
    let directory = scratch("run");
    let run = launch(&Run { config: &config, ranks: 1, threads: 1 }, &directory, &[]);
    assert!(run.status.success(), "{}", text(&run));
    let (directory, config) = (utf8(&directory), utf8(&config));
    for (arguments, code, once) in [
        (vec!["check", config], 0, "Rayleigh time"),
        (vec!["plot", directory], 0, "stress_strain.svg"),
        (vec!["plot", "no_such_run"], 1, "no_such_run"),
        (vec!["digest", "no_such_run"], 1, "no_such_run"),
        (vec!["scaling"], 0, "Assumed"),
        (vec!["verify", "plastic"], 2, "run it without mpirun"),
        (vec!["verify", "becker2021"], 2, "run it without mpirun"),
        (vec!["bench", "--no-such-option"], 2, "Usage"),
    ] {
        let output = call(2, &arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", text(&output));
        assert_eq!(text(&output).matches(once).count(), 1, "{arguments:?}: {}", text(&output));
    }
    let digests = [1, 2].map(|ranks| call(ranks, &["digest", directory]).stdout);
    assert!(!digests[0].is_empty() && digests[0] == digests[1]);
}
