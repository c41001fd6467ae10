//! The `dem-mpi` command.

fn main() {
    std::process::exit(dem_mpi::cli::main());
}
