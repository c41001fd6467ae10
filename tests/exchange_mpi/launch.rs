//! Starting this test program on several ranks.

use std::io::Read;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Environment variable with the name of the check.
pub const CHECK: &str = "DEM_MPI_EXCHANGE_CHECK";

/// Lines that a rank prints for comparison begin with this.
pub const MARK: &str = "exact sum: ";

pub struct Outcome {
    pub success: bool,
    pub code: Option<i32>,
    pub output: String,
}

impl Outcome {
    pub fn marked_lines(&self) -> Vec<String> {
        assert!(self.success, "{}", self.output);
        // The test harness may print on the same line before the mark.
        self.output.lines().filter_map(|line| Some(line.split_once(MARK)?.1.to_string())).collect()
    }
}

pub fn succeeds(check: &str, ranks: usize) {
    let outcome = run(check, ranks);
    assert!(outcome.success, "{check} on {ranks} ranks:\n{}", outcome.output);
}

/// Run a check under mpirun. A run that hangs is killed and fails the test.
pub fn run(check: &str, ranks: usize) -> Outcome {
    const LIMIT: Duration = Duration::from_secs(120);
    let program = std::env::current_exe().expect("path of this program");
    let mut child = Command::new("mpirun")
        .args(["--oversubscribe", "-n", &ranks.to_string()])
        .arg(program)
        .args(["on_each_rank", "--exact", "--ignored", "--nocapture", "--test-threads=1"])
        .env(CHECK, check)
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("mpirun is on the PATH (Debian: apt-get install openmpi-bin)");
    let readers = [drain(child.stdout.take()), drain(child.stderr.take())];
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().expect("status of mpirun") {
            break status;
        }
        if start.elapsed() > LIMIT {
            child.kill().expect("kill mpirun");
            child.wait().expect("end of mpirun");
            panic!("{check} on {ranks} ranks hangs");
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    let output = readers.map(|reader| reader.join().expect("reader of the output")).concat();
    Outcome { success: status.success(), code: status.code(), output }
}

fn drain(stream: Option<impl Read + Send + 'static>) -> std::thread::JoinHandle<String> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut stream) = stream {
            stream.read_to_end(&mut bytes).expect("output of mpirun");
        }
        String::from_utf8_lossy(&bytes).into_owned()
    })
}
