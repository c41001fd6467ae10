//! Vector instructions come to be only where the compiler fits what works on lanes into a function compiled for them.
//! Outside each would be a call of its own, ten times slower and with the right results: a test must look at the
//! program, as the release profile makes it.

#![cfg(all(target_arch = "x86_64", not(debug_assertions)))]

use std::process::Command;

/// Functions of the core library for single vector instructions that a program calls instead of containing them.
fn called_instructions(symbols: &str) -> Vec<&str> {
    symbols.lines().filter(|line| line.contains("core_arch") && line.contains("_mm")).collect()
}

/// Functions for vector instructions that keep vectors on a stack that they have not aligned, in a disassembly.
fn unaligned_stacks(disassembly: &str) -> Vec<&str> {
    let bodies = disassembly.split("\n\n").filter_map(|function| function.trim_start().split_once(">:\n"));
    let lanes =
        bodies.filter(|(name, _)| name.contains("dem_mpi") && (name.contains("avx2") || name.contains("avx512")));
    let unaligned = |body: &str| {
        let kept = |line: &str| line.contains("(%rsp)") && (line.contains("%ymm") || line.contains("%zmm"));
        let aligns = |line: &str| line.contains("and ") && line.trim_end().ends_with(",%rsp");
        body.lines().any(kept) && !body.lines().any(aligns)
    };
    lanes.filter(|(_, body)| unaligned(body)).map(|(name, _)| name).collect()
}

#[test]
fn vectors_on_the_stack_are_aligned() {
    let program = env!("CARGO_BIN_EXE_dem-mpi");
    let output = Command::new("objdump")
        .args(["-d", "--no-show-raw-insn", program])
        .output()
        .expect("objdump comes with the linker");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let disassembly = String::from_utf8_lossy(&output.stdout);
    assert!(disassembly.matches("avx2").count() > 10, "the program has been stripped of its symbols");
    let unaligned = unaligned_stacks(&disassembly);
    assert!(unaligned.is_empty(), "these need `force::lane::align_stack`:\n{unaligned:#?}");
}

#[test]
fn an_unaligned_stack_is_found() {
    let function = |begin: &str| {
        format!(
            "\n\n0000000000001000 <_RN7dem_mpi4avx2>:\n    1000:\tpush   %rbp\n{begin}    1010:\tvmovupd %ymm0,0x20(%rsp)\n\n"
        )
    };
    let unaligned = function("    1001:\tsub    $0x40,%rsp\n");
    assert_eq!(unaligned_stacks(&unaligned), ["0000000000001000 <_RN7dem_mpi4avx2"]);
    assert!(unaligned_stacks(&function("    1001:\tand    $0xffffffffffffffc0,%rsp\n")).is_empty());
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
