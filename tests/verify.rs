//! `dem-mpi verify` through the public binary.

mod common;

use common::{command, text};

#[test]
fn every_analytic_case_passes() {
    let output = command(1).arg("verify").output().expect("the program starts");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    assert!(text(&output).contains(" 0 failed"), "{}", text(&output));
}

#[test]
fn a_filter_that_names_no_case_lists_them() {
    let output = command(1).args(["verify", "no such case"]).output().expect("the program starts");
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert!(text(&output).contains("order of the integrator"), "{}", text(&output));
}
