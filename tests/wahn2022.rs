//! `dem-mpi verify wahn2022` through the public binary: table, pictures, exit code.

mod common;

use common::{command, scratch, text};
use std::fs;
use std::path::Path;

/// Width and height that a PNG file states of itself.
fn png_size(path: &Path) -> (u32, u32) {
    let bytes = fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    assert!(bytes.starts_with(b"\x89PNG\r\n\x1a\n"), "{}", path.display());
    let number = |at: usize| u32::from_be_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    (number(16), number(20))
}

#[test]
fn two_spheres_come_out_as_in_the_paper() {
    let folder = scratch("figures");
    let output = command(1)
        .args(["verify", "wahn2022", "--only", "9,10,12", "--output"])
        .arg(&folder)
        .output()
        .expect("the program starts");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    let table = fs::read_to_string(folder.join("wahn2022.md")).expect("the table is written");
    assert!(table.contains("0 failed") && !table.contains("FAIL"), "{table}");
    for claim in ["| MZ off the independent integration of the law", "| force at 20 s over Hertz(E_soft)"] {
        assert!(table.lines().any(|line| line.starts_with(claim) && line.ends_with("| pass |")), "{claim}: {table}");
    }
    for name in ["fig09", "fig10a", "fig10b", "fig12"] {
        let (width, height) = png_size(&folder.join(format!("wahn2022/{name}.png")));
        assert!(width > 1000 && height > 700, "{name}: {width} x {height}");
        let svg = fs::read_to_string(folder.join(format!("wahn2022/{name}.svg"))).expect("the SVG is written");
        assert!(svg.contains("normal contact force / mN"), "{name}");
        assert!(table.contains(&format!("(wahn2022/{name}.png)")), "{name}: {table}");
    }
    // Each run is a run directory of its own that reruns by itself.
    assert!(folder.join("runs/fig09/mz-100/history.csv").is_file());
}

#[test]
fn a_small_packing_relaxes_to_its_elastic_companion() {
    let folder = scratch("figures");
    let run = |more: &[&str]| {
        let mut command = command(1);
        command.args(["verify", "wahn2022", "--quick", "--only", "16", "--output"]).arg(&folder).args(more);
        command.output().expect("the program starts")
    };
    let first = run(&[]);
    let table = fs::read_to_string(folder.join("wahn2022.md")).expect("the table is written");
    let line = table.lines().find(|line| line.starts_with("| MZ over elastic E_soft of the same kinematics at 10 s"));
    assert!(line.is_some_and(|line| line.ends_with("| pass |")), "{table}");
    for name in ["fig16a", "fig16b"] {
        png_size(&folder.join(format!("wahn2022/{name}.png")));
    }
    assert_eq!(first.status.code(), Some(0), "{}", text(&first));

    let record = fs::read_to_string(folder.join("runs/fig16/soft-1/verify.txt")).expect("the record is there");
    // A run that fails makes the figure fail, and says where to look.
    fs::remove_dir_all(folder.join("runs/fig16/mz-1")).expect("the run was there");
    fs::write(folder.join("runs/fig16/mz-1"), "in the way").expect("the folder can be written");
    let broken = run(&["--reuse"]);
    assert_eq!(broken.status.code(), Some(1), "{}", text(&broken));
    assert!(text(&broken).contains("FAIL") && text(&broken).contains("run mz-1"), "{}", text(&broken));
    // The others were taken over.
    let again = fs::read_to_string(folder.join("runs/fig16/soft-1/verify.txt")).expect("the record is there");
    assert_eq!(again, record, "a finished run was made again");
}

#[test]
fn an_unknown_figure_is_refused_with_the_known_ones() {
    let output = command(1).args(["verify", "wahn2022", "--only", "11"]).output().expect("the program starts");
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert!(text(&output).contains("--only 11") && text(&output).contains("9, 10, 12"), "{}", text(&output));
}
