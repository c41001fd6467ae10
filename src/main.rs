//! The program: see `dem-mpi --help`.

fn main() {}
