//! The jobscripts with stand-ins for the queue's commands: the signal reaches the launcher, exit code 75
//! queues again, the next job goes on from the checkpoint, any other code is passed on.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Stands for `srun` and `mpirun`: notes its arguments; a first run waits for SIGUSR1, writes a checkpoint
/// and ends with 75, a restart ends with `$FAKE_CODE`.
const LAUNCHER: &str = r#"#!/bin/bash
echo "$*" >>launched
case "$*" in *--restart*) exit "${FAKE_CODE:-0}" ;; esac
trap 'mkdir -p runs/demo; touch runs/demo/checkpoint-5.h5; exit 75' USR1
touch ready
for _ in $(seq 600); do sleep 0.05; done
exit 1
"#;

/// Stands for `scontrol` and `qsub`.
const QUEUE: &str = "#!/bin/bash\necho \"$(basename \"$0\") $*\" >>queued\n";

/// Stands for `qstat -f`: a limit of 302 s.
const STATUS: &str = "#!/bin/bash\necho '    Resource_List.walltime = 00:05:02'\n";

/// Stands for `dem-mpi`: notes one argument a line.
const PROGRAM: &str = "#!/bin/bash\nprintf '%s\\n' \"$@\" >started\nexit \"${FAKE_CODE:-0}\"\n";

struct Cluster(TempDir);

impl Cluster {
    fn new() -> Self {
        let cluster = Self(tempfile::tempdir().expect("temporary folder"));
        fs::create_dir(cluster.path("bin")).expect("folder");
        let commands = [
            ("srun", LAUNCHER),
            ("mpirun", LAUNCHER),
            ("scontrol", QUEUE),
            ("qsub", QUEUE),
            ("qstat", STATUS),
            ("dem-mpi", PROGRAM),
        ];
        for (name, text) in commands {
            let file = cluster.path("bin").join(name);
            fs::write(&file, text).expect("write");
            fs::set_permissions(&file, fs::Permissions::from_mode(0o755)).expect("executable");
        }
        fs::write(cluster.path("nodes"), "a\na\nb\nb\n").expect("write");
        cluster
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_default()
    }

    fn start(&self, script: &str, arguments: &[&str], variables: &[(&str, &str)]) -> Child {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobscripts").join(script);
        let old_path = std::env::var("PATH").unwrap_or_default();
        Command::new("bash")
            .arg(script)
            .args(arguments)
            .current_dir(self.0.path())
            .env("PATH", format!("{}:{old_path}", self.path("bin").display()))
            .env("SLURM_JOB_ID", "7")
            .env("SLURM_CPUS_PER_TASK", "4")
            .env("PBS_JOBID", "7.server")
            .env("PBS_NODEFILE", self.path("nodes"))
            .env("PBS_O_WORKDIR", self.0.path())
            .env("OMP_NUM_THREADS", "4")
            .envs(variables.iter().copied())
            .stdout(Stdio::null())
            .spawn()
            .expect("bash starts")
    }

    fn wait_until_running(&self) {
        let start = Instant::now();
        while !self.path("ready").exists() {
            assert!(start.elapsed() < Duration::from_secs(20), "the launcher did not start");
            sleep(Duration::from_millis(20));
        }
    }
}

#[test]
fn slurm_job_checkpoints_on_the_signal_and_queues_again() {
    let cluster = Cluster::new();
    let mut job = cluster.start("slurm.sh", &["configs/demo.toml"], &[]);
    cluster.wait_until_running();
    let signal = Command::new("kill").args(["-USR1", &job.id().to_string()]).status().expect("kill");
    assert!(signal.success());
    assert_eq!(job.wait().expect("wait").code(), Some(0));
    assert_eq!(cluster.text("queued"), "scontrol requeue 7\n");

    let mut job = cluster.start("slurm.sh", &["configs/demo.toml"], &[]);
    assert_eq!(job.wait().expect("wait").code(), Some(0));
    let launched = cluster.text("launched");
    let last = launched.lines().last().unwrap_or_default();
    assert_eq!(last, "--cpu-bind=cores dem-mpi configs/demo.toml --output runs/demo --threads 4 --restart runs/demo");
    assert_eq!(cluster.text("queued").lines().count(), 1, "a complete run is not queued again");
}

#[test]
fn slurm_job_passes_a_failure_on() {
    let cluster = Cluster::new();
    fs::create_dir_all(cluster.path("runs/demo")).expect("folder");
    fs::write(cluster.path("runs/demo/checkpoint-5.h5"), "").expect("write");
    let mut job = cluster.start("slurm.sh", &["demo.toml"], &[("FAKE_CODE", "1")]);
    assert_eq!(job.wait().expect("wait").code(), Some(1));
    assert_eq!(cluster.text("queued"), "");
}

#[test]
fn pbs_job_keeps_its_own_time_and_queues_a_following_job() {
    let cluster = Cluster::new();
    let variables = [("CONFIG", "configs/demo.toml")];
    let mut job = cluster.start("pbs.sh", &[], &variables);
    assert_eq!(job.wait().expect("wait").code(), Some(0), "the limit less the grace is 2 s");
    assert_eq!(
        cluster.text("queued"),
        "qsub -W depend=afterany:7.server -v CONFIG=configs/demo.toml,RUN_DIR=runs/demo,JOBSCRIPT=jobscripts/pbs.sh \
         jobscripts/pbs.sh\n"
    );
    let mut job = cluster.start("pbs.sh", &[], &variables);
    assert_eq!(job.wait().expect("wait").code(), Some(0));
    let launched = cluster.text("launched");
    let last = launched.lines().last().unwrap_or_default();
    assert_eq!(
        last,
        "-n 4 --map-by slot:PE=4 --bind-to core dem-mpi configs/demo.toml --output runs/demo --threads 4 --restart \
         runs/demo"
    );
}

#[test]
fn scaling_jobs_grow_to_all_tasks_and_launch_with_srun() {
    for (kind, particles) in [("strong", "10000000"), ("weak", "100000")] {
        let cluster = Cluster::new();
        let script = format!("{kind}_scaling.sh");
        let mut job = cluster.start(&script, &[], &[("SLURM_NTASKS", "12")]);
        assert_eq!(job.wait().expect("wait").code(), Some(0));
        let started = cluster.text("started");
        let expected = [
            "bench",
            &format!("--{kind}"),
            "--particles",
            particles,
            "--layouts",
            "1x4,2x4,4x4,8x4,12x4",
            "--output",
            &format!("bench-{kind}"),
            "--launcher",
            "srun -n {ranks} -c {threads} --cpu-bind=cores",
        ];
        assert_eq!(started.lines().collect::<Vec<_>>(), expected);

        let arguments = ["5000", "out", "--repeats", "1"];
        let mut job = cluster.start(&script, &arguments, &[("SLURM_NTASKS", "1"), ("FAKE_CODE", "3")]);
        assert_eq!(job.wait().expect("wait").code(), Some(3), "a failure is passed on");
        let started = cluster.text("started");
        let lines: Vec<&str> = started.lines().collect();
        assert_eq!([lines[3], lines[5], lines[7]], ["5000", "1x4", "out"]);
        assert_eq!(lines[lines.len() - 2..], ["--repeats", "1"]);
    }
}
