//! Vector instructions come to be only where the compiler fits what works on lanes into a function compiled for them.
//! Outside each would be a call of its own, ten times slower and with the right results: a test must look at the
//! program, as the release profile makes it.

#![cfg(all(target_arch = "x86_64", not(debug_assertions)))]

use std::process::Command;

/// Functions of the core library for single vector instructions that a program calls instead of containing them.
fn called_instructions(symbols: &str) -> Vec<&str> {
    symbols.lines().filter(|line| line.contains("core_arch") && line.contains("_mm")).collect()
}

#[test]
fn every_vector_instruction_is_within_the_function_that_uses_it() {
    let output = Command::new("nm").arg(env!("CARGO_BIN_EXE_dem-mpi")).output().expect("nm comes with the linker");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let symbols = String::from_utf8_lossy(&output.stdout);
    assert!(symbols.contains("7dem_mpi"), "the program has been stripped of its symbols");
    let called = called_instructions(&symbols);
    assert!(called.is_empty(), "these are called; find the closure or function that is not inlined:\n{called:#?}");
}

#[test]
fn a_called_instruction_is_found_by_its_name() {
    let called = "000000000070ae60 t _RNvNtNtNtCsgEmfK2I1SDS_4core9core_arch3x863avx14__mm256_set1_pd";
    let other = "0000000000859880 t _ZN7dem_mpi5force4pass4laws13Laws$LT$C$GT$6blocks17h04d19bda8827eee2E";
    assert_eq!(called_instructions(&format!("{called}\n{other}\n")), [called]);
}
