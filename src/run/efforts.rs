//! What a run takes beside its steps: set-up, files, memory of the process.

use crate::output::ranks::{Effort, RankRow};
use crate::setup::SetupReport;
use crate::simulation::Simulation;
use std::fs;
use std::path::Path;

/// Collected from the start of a run to its end.
pub struct Efforts {
    rows: Vec<(&'static str, Effort)>,
    snapshots: Effort,
    checkpoints: Effort,
    bytes_before: u64,
    peak_of_setup: u64,
}

impl Efforts {
    /// Before anything is set up.
    pub fn begin() -> Self {
        Self {
            rows: Vec::new(),
            snapshots: Effort::default(),
            checkpoints: Effort::default(),
            bytes_before: resident_bytes(),
            peak_of_setup: 0,
        }
    }

    /// A part of the set-up.
    pub fn set_up(&mut self, name: &'static str, seconds: f64) {
        self.rows.push((name, Effort { times: u64::from(seconds > 0.0), seconds, bytes: 0 }));
    }

    /// The parts that the set-up has timed itself.
    pub fn report(&mut self, report: &SetupReport) {
        self.set_up("distribution", report.distribution);
        self.set_up("overlap check", report.check);
        self.set_up("first lists", report.lists);
        self.peak_of_setup = peak_bytes();
    }

    /// A snapshot was written, perhaps with the file of its contacts.
    pub fn snapshot(&mut self, path: &Path, seconds: f64) {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let contacts = path.with_file_name(name.replacen("particles", "contacts", 1));
        self.snapshots.add(seconds, length(path) + length(&contacts));
    }

    /// A checkpoint was written.
    pub fn checkpoint(&mut self, path: &Path, seconds: f64) {
        self.checkpoints.add(seconds, length(path));
    }

    /// Rows of the table of efforts.
    pub fn rows(&self) -> Vec<(&'static str, Effort)> {
        let files = [("snapshots", self.snapshots), ("checkpoints", self.checkpoints)];
        self.rows.iter().copied().chain(files).collect()
    }

    /// Rows of the table over ranks.
    pub fn per_rank(&self, simulation: &Simulation) -> [RankRow; 6] {
        let (found, model) = (simulation.traffic(), simulation.expected_traffic());
        let row = |name, value, expected| RankRow { name, value, expected };
        [
            row("ghosts", found.ghosts, Some(model.ghosts)),
            row("messages per step", found.messages, Some(model.messages)),
            row("bytes per step", found.bytes, Some(model.bytes)),
            row("kB before set-up", (self.bytes_before / 1000) as f64, None),
            row("peak kB of set-up", (self.peak_of_setup / 1000) as f64, None),
            row("peak kB of run", (peak_bytes() / 1000) as f64, None),
        ]
    }
}

fn length(path: &Path) -> u64 {
    fs::metadata(path).map_or(0, |metadata| metadata.len())
}

/// Resident memory of this process \[B\]; 0 where the system does not say.
#[must_use]
pub fn resident_bytes() -> u64 {
    status("VmRSS:")
}

/// The largest resident memory that this process has had \[B\]; 0 where the system does not say.
#[must_use]
pub fn peak_bytes() -> u64 {
    status("VmHWM:")
}

/// Memory of this machine that is free or can be made so \[B\]; `None` where the system does not say.
#[must_use]
pub fn available_bytes() -> Option<u64> {
    line_of("/proc/meminfo", "MemAvailable:")
}

/// Ranks on this machine, of so many in all: as the launcher says, else all.
#[must_use]
pub fn ranks_here(ranks: usize) -> usize {
    let said = ["OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS", "SLURM_NTASKS_PER_NODE"]
        .iter()
        .find_map(|name| std::env::var(name).ok()?.parse::<usize>().ok());
    said.unwrap_or(ranks).max(1)
}

fn status(name: &str) -> u64 {
    line_of("/proc/self/status", name).unwrap_or(0)
}

/// A line of a text of the system, which gives it in kB of 1024 bytes.
fn line_of(path: &str, name: &str) -> Option<u64> {
    let text = fs::read_to_string(path).ok()?;
    let rest = text.lines().find_map(|line| line.strip_prefix(name))?;
    Some(rest.split_whitespace().next()?.parse::<u64>().ok()? * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_resident_and_the_peak_is_at_least_that() {
        let block = vec![1_u8; 64 << 20];
        assert!(block.iter().map(|&byte| u64::from(byte)).sum::<u64>() == 64 << 20);
        assert!(resident_bytes() >= 64 << 20 && peak_bytes() >= 64 << 20);
        drop(block);
        assert!(peak_bytes() >= 64 << 20);
    }
}
