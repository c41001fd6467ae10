//! The `dem-mpi` command.

/// The C library's own settings, among them large memory pages.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const TUNABLES: &str = "GLIBC_TUNABLES";

/// Large pages; and the size from which memory goes back to the system when it is freed: a fixed one, as the C library
/// otherwise raises it to that of the largest array freed, and keeps what set-up no longer needs.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const SETTINGS: &str = "glibc.malloc.hugetlb=1:glibc.malloc.mmap_threshold=4194304";

fn main() {
    // Until it is known who is to hear it; the second beginning would else be a second time in which it kills.
    dem_mpi::run::hold_back();
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    with_large_pages();
    std::process::exit(dem_mpi::cli::main());
}

/// Begin anew with memory in large pages, worth 5 to 15 % from 10⁵ particles on (docs/performance.md). The C library
/// reads this setting only when a program begins. Whoever sets the variable, be it to nothing, has the say.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn with_large_pages() {
    use std::os::unix::process::CommandExt as _;
    if std::env::var_os(TUNABLES).is_some() {
        return;
    }
    if let Ok(program) = std::env::current_exe() {
        let mut arguments = std::env::args_os();
        let name = arguments.next().unwrap_or_else(|| "dem-mpi".into());
        // Comes back only if it failed; then small pages do.
        let _ = std::process::Command::new(program).arg0(name).args(arguments).env(TUNABLES, SETTINGS).exec();
    }
}
