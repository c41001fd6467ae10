//! Runs the public binary, with and without mpirun, and reads what it left.

#![allow(dead_code, reason = "each test program uses its own part")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Longest time that one run may take before it counts as hanging.
const TIMEOUT: Duration = Duration::from_secs(300);

/// How a run is launched.
pub struct Run<'a> {
    pub config: &'a Path,
    pub ranks: usize,
    pub threads: usize,
}

/// The folder of the repository.
pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// A file of tests/data.
pub fn data(name: &str) -> PathBuf {
    root().join("tests/data").join(name)
}

/// An empty folder of this test process and thread, under the build folder.
pub fn scratch(name: &str) -> PathBuf {
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("main").replace("::", "-");
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(test).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("the build folder can be written");
    folder
}

/// The command of a run; one rank runs without mpirun.
pub fn command(ranks: usize) -> Command {
    let program = env!("CARGO_BIN_EXE_dem-mpi");
    if ranks == 1 {
        return Command::new(program);
    }
    let mut command = Command::new("mpirun");
    command.args(["--oversubscribe", "--bind-to", "none", "--mca", "mpi_yield_when_idle", "1"]);
    command.args(["-n", &ranks.to_string(), program]);
    command.env("OMPI_ALLOW_RUN_AS_ROOT", "1").env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
    command
}

/// Start a run in the background.
pub fn start(run: &Run, directory: &Path, extra: &[&str]) -> Child {
    let mut command = command(run.ranks);
    command.arg(run.config).arg("--output").arg(directory).args(["--threads", &run.threads.to_string()]).args(extra);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("the program starts (is mpirun installed? make setup)")
}

/// Run to the end.
pub fn launch(run: &Run, directory: &Path, extra: &[&str]) -> Output {
    wait(start(run, directory, extra))
}

/// Wait for the end; a run that takes too long is killed and fails the test.
pub fn wait(child: Child) -> Output {
    let id = child.id();
    let (done, finished) = std::sync::mpsc::channel::<()>();
    let watch = std::thread::spawn(move || {
        if finished.recv_timeout(TIMEOUT).is_err() {
            let _ = Command::new("kill").args(["-9", &id.to_string()]).status();
            return true;
        }
        false
    });
    let output = child.wait_with_output().expect("the program can be waited for");
    let _ = done.send(());
    assert!(!watch.join().expect("the watch does not panic"), "the run hung: {}", text(&output));
    output
}

/// Everything that a run printed.
pub fn text(output: &Output) -> String {
    format!("{}\n{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// The digest that a run printed.
pub fn digest_of(output: &Output) -> String {
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    let line = stdout.lines().find_map(|line| line.strip_prefix("digest ")).map(str::to_owned);
    line.unwrap_or_else(|| panic!("no digest in {}", text(output)))
}

/// The bytes of history.csv.
pub fn history_of(directory: &Path) -> Vec<u8> {
    std::fs::read(directory.join("history.csv")).expect("the run wrote a history")
}

/// Wait until a file matching the predicate stands in the folder.
pub fn wait_for_file(directory: &Path, wanted: impl Fn(&str) -> bool) {
    let started = Instant::now();
    while started.elapsed() < TIMEOUT {
        let entries = std::fs::read_dir(directory).into_iter().flatten().flatten();
        if entries.filter_map(|entry| entry.file_name().into_string().ok()).any(|name| wanted(&name)) {
            return;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("no such file appeared in {}", directory.display());
}

/// Names and contents of what lies in a run directory, but for checkpoints, of which only the names count.
pub fn listing(directory: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = std::fs::read_dir(directory).expect("the directory can be read").flatten();
    let mut files: Vec<_> = entries
        .filter(|entry| entry.path().is_file())
        .map(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            let content =
                if name.ends_with(".h5") { Vec::new() } else { std::fs::read(entry.path()).unwrap_or_default() };
            (name, content)
        })
        .collect();
    files.sort();
    files
}
