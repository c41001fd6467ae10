//! Starts cases in processes of their own, and reads and sorts what they measured.

use super::{BasePacking, BenchOptions};
use crate::error::{Error, Result};
use crate::output::files::create_folder;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::str::FromStr;

/// Ranks and threads per rank.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Ranks.
    pub ranks: usize,
    /// Threads per rank.
    pub threads: usize,
}

impl Layout {
    /// Ranks × threads.
    #[must_use]
    pub fn cores(self) -> usize {
        self.ranks * self.threads
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        write!(formatter, "{}x{}", self.ranks, self.threads)
    }
}

impl FromStr for Layout {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text.split_once('x').map(|(ranks, threads)| (ranks.parse(), threads.parse())) {
            Some((Ok(ranks @ 1..=1_000_000), Ok(threads @ 1..=1024))) => Ok(Self { ranks, threads }),
            _ => Err("give RANKSxTHREADS, for example 2x1; at most 1000000 ranks of 1024 threads".into()),
        }
    }
}

/// What one case printed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Measurement {
    /// Particles over all ranks.
    pub particles: f64,
    /// Particle-steps per second.
    pub rate: f64,
    /// Touching contacts times steps per second.
    pub contacts: f64,
    /// Core time per contact and step \[ns\].
    pub per_contact: f64,
    /// Contacts per particle, each counted at both.
    pub coordination: f64,
    /// Resident bytes per particle.
    pub bytes: f64,
    /// The largest there were.
    pub peak_bytes: f64,
    /// Share of the time in the halo exchange, 0 to 1.
    pub halo: f64,
    /// Share of the time in reductions, 0 to 1.
    pub reduce: f64,
    /// Largest busy time of a rank over the mean.
    pub imbalance: f64,
}

impl Measurement {
    /// From the lines of a case; the name of what is missing if it is not complete.
    fn parse(text: &str) -> std::result::Result<Self, &'static str> {
        let value = |name: &'static str| {
            let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
            line.and_then(|rest| rest.split_whitespace().next()?.parse::<f64>().ok()).ok_or(name)
        };
        Ok(Self {
            particles: value("particles")?,
            rate: value("particle-steps/s")?,
            contacts: value("contacts/s")?,
            per_contact: value("ns/contact/step/core")?,
            coordination: value("coordination")?,
            bytes: value("bytes/particle")?,
            peak_bytes: value("peak bytes/particle")?,
            halo: 0.01 * value("share halo")?,
            reduce: 0.01 * value("share reduce")?,
            imbalance: value("imbalance")?,
        })
    }
}

/// Repeats of one case, by rate.
#[derive(Debug, Clone, Default)]
pub struct Series {
    sorted: Vec<Measurement>,
}

impl Series {
    /// Add a repeat.
    pub fn add(&mut self, one: Measurement) {
        let place = self.sorted.partition_point(|other| other.rate < one.rate);
        self.sorted.insert(place, one);
    }

    /// The repeat with the median rate (the lower of two).
    #[must_use]
    pub fn median(&self) -> Measurement {
        self.sorted.get(self.sorted.len().saturating_sub(1) / 2).copied().unwrap_or_default()
    }

    /// Smallest and largest rate.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        [self.sorted.first(), self.sorted.last()].map(|one| one.map_or(0.0, |one| one.rate))
    }
}

/// A folder for packings: a given one, or one that goes when the bench ends.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    temporary: bool,
}

impl Folder {
    /// Make it.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn new(given: Option<&Path>) -> Result<Self> {
        let own = || std::env::temp_dir().join(format!("dem-mpi-bench-{}", std::process::id()));
        let path = given.map_or_else(own, Path::to_path_buf);
        create_folder(&path)?;
        Ok(Self { path, temporary: given.is_none() })
    }

    /// Its path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if self.temporary {
            // What cannot be removed stays in the system's temporary folder.
            let _ = std::fs::remove_dir_all(&self.path);
        }
    }
}

/// Run one case and read what it measured.
///
/// # Errors
/// It cannot be started or fails.
pub fn measure(
    packing: &BasePacking,
    copies: [usize; 3],
    layout: Layout,
    options: &BenchOptions,
) -> Result<Measurement> {
    let failed = |what: String| Error::File { path: "bench".into(), message: what };
    let program = std::env::current_exe().map_err(|error| failed(format!("cannot find this program: {error}")))?;
    let mut words = launcher(options.launcher.as_deref(), layout, available_cores());
    words.push(program.to_string_lossy().into_owned());
    let copies = copies.map(|n| n.to_string()).join("x");
    let mut command = Command::new(&words[0]);
    command.args(&words[1..]).args(["bench", "--copies", &copies, "--law", options.law.name()]);
    command.args(["--threads", &layout.threads.to_string()]).arg("--packing").arg(&packing.path);
    if let Some(sides) = packing.sides {
        command.arg("--sides").args(sides.map(|side| side.to_string()));
    }
    for (name, steps) in [("--steps", options.steps), ("--warm", options.warm)] {
        if let Some(steps) = steps {
            command.args([name, &steps.to_string()]);
        }
    }
    let output = command.output().map_err(|error| {
        failed(format!("cannot start {:?} ({error}); name another command with --launcher", words[0]))
    })?;
    let text = String::from_utf8_lossy(&output.stdout);
    if !output.status.success() {
        return Err(failed(format!("{command:?} failed: {}", String::from_utf8_lossy(&output.stderr).trim())));
    }
    Measurement::parse(&text).map_err(|name| failed(format!("{command:?} printed no line \"{name}\":\n{text}")))
}

/// Cores of this machine that this process may use.
#[must_use]
pub fn available_cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// The words before the program.
fn launcher(template: Option<&str>, layout: Layout, cores: usize) -> Vec<String> {
    let Layout { ranks, threads } = layout;
    if let Some(template) = template.filter(|template| !template.trim().is_empty()) {
        let filled = template.replace("{ranks}", &ranks.to_string()).replace("{threads}", &threads.to_string());
        return filled.split_whitespace().map(str::to_owned).collect();
    }
    if ranks == 1 {
        return Vec::new();
    }
    let binding = if layout.cores() <= cores {
        format!("--map-by slot:PE={threads} --bind-to core")
    } else {
        // Ranks that share cores must give way to each other.
        "--oversubscribe --bind-to none --mca mpi_yield_when_idle 1".to_owned()
    };
    format!("mpirun {binding} -n {ranks}").split_whitespace().map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layouts_are_ranks_and_threads() {
        assert_eq!("4x2".parse(), Ok(Layout { ranks: 4, threads: 2 }));
        for text in ["4", "0x1", "1x0", "4x2x1", "fourx2", ""] {
            assert!(text.parse::<Layout>().is_err(), "{text}");
        }
    }

    #[test]
    fn the_launcher_takes_ranks_and_threads() {
        let layout = Layout { ranks: 8, threads: 4 };
        assert_eq!(launcher(Some("srun -n {ranks} -c {threads}"), layout, 1), ["srun", "-n", "8", "-c", "4"]);
        assert!(launcher(None, layout, 32).contains(&"slot:PE=4".to_owned()));
        assert!(launcher(None, layout, 31).contains(&"--oversubscribe".to_owned()));
        assert!(launcher(None, Layout { ranks: 1, threads: 4 }, 32).is_empty());
    }

    #[test]
    fn a_case_is_read_only_when_complete() {
        let text = "p.data: ready after 0.1 s\nparticles               100\nranks x threads         1 x 1\n\
                    share halo              12.5 %\nshare reduce            2 %\nimbalance               1.25\n\
                    particle-steps/s        2.0000e6\ncontacts/s              6e6\nns/contact/step/core    166.7\n\
                    coordination            6.01\nbytes/particle          400\npeak bytes/particle     900\nloop 1 s\n";
        let one = Measurement::parse(text).expect("complete");
        assert_eq!((one.particles, one.rate, one.halo, one.peak_bytes), (100.0, 2e6, 0.125, 900.0));
        assert_eq!(Measurement::parse(&text.replace("imbalance", "balance")), Err("imbalance"));
    }

    #[test]
    fn the_median_is_by_rate() {
        let mut series = Series::default();
        for rate in [3.0, 1.0, 2.0] {
            series.add(Measurement { rate, ..Measurement::default() });
        }
        assert_eq!((series.median().rate, series.range()), (2.0, [1.0, 3.0]));
    }
}
