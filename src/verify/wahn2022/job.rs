//! Runs of the program, each in a process of its own, some at a time.

use crate::error::Result;
use crate::output::files::{create_folder, io_error, write_atomically};
use crate::output::history::{self, HistoryRow};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// A run to make: a configuration with changes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Job {
    /// Number of the figure, which names the configuration.
    pub figure: u32,
    /// Name, unique within the figure; names the run directory.
    pub name: String,
    /// `--set` arguments.
    pub sets: Vec<String>,
}

impl Job {
    /// A run of the figure's configuration with these changes.
    pub fn new(figure: u32, name: impl Into<String>, sets: impl IntoIterator<Item = String>) -> Self {
        Self { figure, name: name.into(), sets: sets.into_iter().collect() }
    }
}

/// A run that is done.
#[derive(Debug, Clone)]
pub struct Run {
    /// Its history.
    pub rows: Vec<HistoryRow>,
    /// Wall time \[s\].
    pub wall: f64,
}

/// All runs by figure and name; the reason for those that failed.
#[derive(Debug, Default)]
pub struct Runs {
    done: BTreeMap<(u32, String), std::result::Result<Run, String>>,
}

impl Runs {
    /// A run that was planned.
    ///
    /// # Errors
    /// Why it failed.
    pub fn get(&self, figure: u32, name: &str) -> std::result::Result<&Run, String> {
        match self.done.get(&(figure, name.to_owned())) {
            Some(Ok(run)) => Ok(run),
            Some(Err(reason)) => Err(format!("run {name}: {reason}")),
            None => Err(format!("run {name} was not planned")),
        }
    }

    /// Wall time of the runs of a figure, one after the other, and of its longest run \[s\].
    pub fn wall(&self, figure: u32) -> (f64, f64) {
        let runs = self.done.iter().filter(|((number, _), _)| *number == figure);
        runs.filter_map(|(_, run)| run.as_ref().ok()).fold((0.0, 0.0), |(sum, longest), run| {
            (sum + run.wall, if run.wall > longest { run.wall } else { longest })
        })
    }
}

/// Where runs go, and how.
#[derive(Debug, Clone)]
pub struct Workshop {
    /// Folder of everything.
    pub output: PathBuf,
    /// Processes at a time.
    pub workers: usize,
    /// Take over runs that an earlier call with the same input finished.
    pub reuse: bool,
}

/// The inputs, as they stand in the repository.
const INPUTS: &[(&str, &str)] = &[
    ("two_spheres.csv", include_str!("../../../configs/two_spheres.csv")),
    ("wahn2022/fig09.toml", include_str!("../../../configs/wahn2022/fig09.toml")),
    ("wahn2022/fig10.toml", include_str!("../../../configs/wahn2022/fig10.toml")),
    ("wahn2022/fig12.toml", include_str!("../../../configs/wahn2022/fig12.toml")),
    ("wahn2022/fig13.toml", include_str!("../../../configs/wahn2022/fig13.toml")),
    ("wahn2022/fig14.toml", include_str!("../../../configs/wahn2022/fig14.toml")),
    ("wahn2022/fig15.toml", include_str!("../../../configs/wahn2022/fig15.toml")),
    ("wahn2022/fig16.toml", include_str!("../../../configs/wahn2022/fig16.toml")),
];

impl Workshop {
    /// Make all runs; `each` hears of every one that ends.
    ///
    /// # Errors
    /// The output folder cannot be written. A run that fails is no error here, see [`Runs::get`].
    pub fn make(
        &self,
        jobs: &[Job],
        each: impl Fn(usize, &Job, &std::result::Result<Run, String>) + Sync,
    ) -> Result<Runs> {
        let program =
            std::env::current_exe().map_err(|error| io_error(Path::new("dem-mpi"), "find the program", &error))?;
        self.write_inputs()?;
        let next = AtomicUsize::new(0);
        let runs = Mutex::new(Runs::default());
        std::thread::scope(|scope| {
            for _ in 0..self.workers.min(jobs.len()) {
                scope.spawn(|| {
                    while let Some(job) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                        let result = self.run(&program, job);
                        // A panic of `each` is the only thing that can poison the lock, and it ends the scope.
                        let mut runs = runs.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                        each(runs.done.len() + 1, job, &result);
                        runs.done.insert((job.figure, job.name.clone()), result);
                    }
                });
            }
        });
        Ok(runs.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner))
    }

    fn write_inputs(&self) -> Result<()> {
        create_folder(&self.output.join("configs/wahn2022"))?;
        INPUTS
            .iter()
            .try_for_each(|(name, text)| write_atomically(&self.output.join("configs").join(name), text.as_bytes()))
    }

    fn run(&self, program: &Path, job: &Job) -> std::result::Result<Run, String> {
        let config = format!("wahn2022/fig{:02}.toml", job.figure);
        let text = INPUTS.iter().find(|(name, _)| *name == config).map_or("", |(_, text)| text);
        let directory = self.output.join(format!("runs/fig{:02}/{}", job.figure, job.name));
        let record = directory.join("verify.txt");
        let command = format!(
            "dem-mpi configs/{config}{}",
            job.sets.iter().fold(String::new(), |all, set| all + " --set '" + set + "'")
        );
        let stamp = format!("{command}\ninput {:016x}\n", fingerprint(text));
        let kept = if self.reuse { finished(&record, &stamp) } else { None };
        // A table of another version of the program cannot be read: the run is made anew.
        if let Some(run) = kept.and_then(|wall| Some(Run { rows: history::read(&directory).ok()?, wall })) {
            return Ok(run);
        }
        let wall = self.launch(program, &config, job, &directory)?;
        write_atomically(&record, format!("{stamp}wall {wall:.3} s\n").as_bytes())
            .map_err(|error| error.to_string())?;
        let rows = history::read(&directory).map_err(|error| error.to_string())?;
        Ok(Run { rows, wall })
    }

    fn launch(&self, program: &Path, config: &str, job: &Job, directory: &Path) -> std::result::Result<f64, String> {
        create_folder(directory).map_err(|error| error.to_string())?;
        // An old record must not outlive a run that fails.
        let _ = fs::remove_file(directory.join("verify.txt"));
        let mut command = Command::new(program);
        command.arg(self.output.join("configs").join(config)).args(["--threads", "1", "--output"]).arg(directory);
        for set in &job.sets {
            command.args(["--set", set]);
        }
        let started = Instant::now();
        let output = command.stdin(Stdio::null()).output().map_err(|error| format!("cannot be started ({error})"))?;
        let wall = started.elapsed().as_secs_f64();
        let log = [output.stdout.as_slice(), output.stderr.as_slice()].concat();
        write_atomically(&directory.join("log.txt"), &log).map_err(|error| error.to_string())?;
        if output.status.success() {
            return Ok(wall);
        }
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        let reason = text.lines().rev().find(|line| line.starts_with("dem-mpi: ")).unwrap_or("no reason given");
        Err(format!("{} (log: {})", reason.trim_start_matches("dem-mpi: "), directory.join("log.txt").display()))
    }
}

/// Wall time of an earlier run with this stamp.
fn finished(record: &Path, stamp: &str) -> Option<f64> {
    let text = fs::read_to_string(record).ok()?;
    text.strip_prefix(stamp)?.strip_prefix("wall ")?.strip_suffix(" s\n")?.parse().ok()
}

/// Of a configuration without its comments.
fn fingerprint(text: &str) -> u64 {
    let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
    xxhash_rust::xxh3::xxh3_64(lines.join("\n").as_bytes())
}
