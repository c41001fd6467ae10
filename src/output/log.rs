//! The terminal: the table of the run, a progress bar when somebody watches, and the table of costs at
//! the end. Rank 0 prints; knows nothing of how the values come about.

use super::history::HistoryRow;
use crate::exchange::Communicator;
use indicatif::{ProgressBar, ProgressStyle};
use std::fmt::Write;
use std::io::{IsTerminal, stderr};

/// Steps of the progress bar.
const BAR_LENGTH: u64 = 10_000;

/// Heading, width and cell of each column of the table.
type TableColumn = (&'static str, usize, fn(&HistoryRow) -> String);
const TABLE: [TableColumn; 10] = [
    ("step", 10, |row| row.step.to_string()),
    ("time s", 10, |row| short(row.time)),
    ("step s", 9, |row| short(row.time_step)),
    ("strain zz %", 11, |row| format!("{:.4}", 100.0 * row.strain[2])),
    ("stress zz MPa", 13, |row| format!("{:.5}", 1e-6 * row.stress[2])),
    ("mean MPa", 9, |row| format!("{:.4}", 1e-6 * row.mean_stress())),
    ("solid", 6, |row| format!("{:.4}", row.solid_fraction)),
    ("coord.", 6, |row| format!("{:.2}", row.coordination)),
    ("kinetic J", 9, |row| short(row.kinetic)),
    ("unbalanced", 10, |row| if row.unbalanced_ratio.is_nan() { "-".to_owned() } else { short(row.unbalanced_ratio) }),
];

fn short(value: f64) -> String {
    format!("{value:.3e}")
}

/// Prints a run's progress. Made on rank 0 only.
#[derive(Debug)]
pub struct Log {
    bar: Option<ProgressBar>,
    headed: bool,
}

impl Log {
    /// A log; with a progress bar on the error stream when that is a terminal.
    #[must_use]
    pub fn new() -> Self {
        let style = ProgressStyle::with_template("[{elapsed_precise}] {bar:36} {percent:>3} %, {eta} left  {msg}");
        let bar = style.ok().filter(|_| stderr().is_terminal()).map(|style| {
            let bar = ProgressBar::new(BAR_LENGTH);
            bar.set_style(style);
            bar
        });
        Self { bar, headed: false }
    }

    /// A line of text between the rows.
    pub fn line(&self, text: &str) {
        if let Some(bar) = &self.bar {
            bar.suspend(|| say!("{text}"));
        } else {
            say!("{text}");
        }
    }

    /// One row of the table, its headings before the first; `done` is the fraction of the run.
    pub fn row(&mut self, row: &HistoryRow, done: f64) {
        if !self.headed {
            self.line(&headings());
            self.headed = true;
        }
        self.line(&table_row(row, done));
    }

    /// Move the progress bar to this fraction of the run; `message` stands beside it (stage, speed).
    pub fn progress(&self, done: f64, message: &str) {
        if let Some(bar) = &self.bar {
            bar.set_position((done.clamp(0.0, 1.0) * BAR_LENGTH as f64) as u64);
            if bar.message() != message {
                bar.set_message(message.to_owned());
            }
        }
    }

    /// Take the progress bar away.
    pub fn finish(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }
}

impl Default for Log {
    fn default() -> Self {
        Self::new()
    }
}

fn headings() -> String {
    let words: Vec<String> = TABLE.iter().map(|(name, width, _)| format!("{name:>width$}")).collect();
    format!("{}  done", words.join("  "))
}

fn table_row(row: &HistoryRow, done: f64) -> String {
    let words: Vec<String> = TABLE.iter().map(|(_, width, cell)| format!("{:>width$}", cell(row))).collect();
    format!("{}  {:>3.0}%", words.join("  "), 100.0 * done)
}

/// Wall time of one rank per stage of the step \[s\].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StageTimes {
    /// Neighbour lists, with re-sorting and migration.
    pub neighbours: f64,
    /// Contacts across periodic faces, strips and ranks, and with walls.
    pub contacts: f64,
    /// The other contacts, summing forces and moving particles.
    pub step: f64,
    /// Looks at the state: time step, load, reports.
    pub observe: f64,
    /// Halo exchange: packing and waiting.
    pub halo: f64,
    /// Global sums and agreement.
    pub reduce: f64,
    /// History, snapshots, checkpoints.
    pub output: f64,
    /// The whole loop, what the stages leave over included.
    pub total: f64,
}

impl StageTimes {
    fn rows(&self) -> [(&'static str, f64); 8] {
        let stages = [
            ("neighbours", self.neighbours),
            ("border contacts", self.contacts),
            ("contacts, motion", self.step),
            ("observation", self.observe),
            ("halo", self.halo),
            ("reduce", self.reduce),
            ("output", self.output),
        ];
        let named: f64 = stages.iter().map(|(_, seconds)| seconds).sum();
        let [a, b, c, d, e, f, g] = stages;
        [a, b, c, d, e, f, g, ("other", (self.total - named).max(0.0))]
    }

    /// Work of this rank that does not wait for others: what imbalance is measured on \[s\].
    #[must_use]
    pub fn busy(&self) -> f64 {
        self.neighbours + self.contacts + self.step
    }
}

/// What the costs are divided by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunSize {
    /// Particles over all ranks.
    pub particles: u64,
    /// Steps done in this run.
    pub steps: u64,
    /// Threads per rank.
    pub threads: usize,
    /// Bytes held by this rank for particles, ghosts, lists and contacts.
    pub bytes: u64,
}

/// The table of costs: time per stage (mean and largest over ranks), imbalance (largest busy time over
/// the mean), particle-steps per second, Cundall number N·steps/s per core and over all, bytes per
/// particle. Collective; the text is the same on all ranks.
#[must_use]
pub fn cost_table(comm: &Communicator, times: &StageTimes, size: &RunSize) -> String {
    let own = times.rows();
    let mut numbers: Vec<f64> = own.iter().map(|(_, seconds)| *seconds).collect();
    numbers.extend([times.total, times.busy(), size.bytes as f64]);
    let ranks: Vec<Vec<f64>> = comm
        .all_gather(bytemuck::cast_slice(&numbers))
        .iter()
        .map(|bytes| bytemuck::pod_collect_to_vec::<u8, f64>(bytes))
        .collect();
    let mean = |k: usize| ranks.iter().map(|rank| rank[k]).sum::<f64>() / ranks.len() as f64;
    let max = |k: usize| ranks.iter().map(|rank| rank[k]).fold(0.0, f64::max);
    let (total, busy, bytes) = (own.len(), own.len() + 1, own.len() + 2);
    let wall = max(total);
    let share = |seconds: f64| if wall > 0.0 { 100.0 * seconds / wall } else { 0.0 };
    let mut text = format!("{:<20}{:>12}{:>8}{:>12}\n", "stage", "mean s", "share", "slowest s");
    let names = own.iter().map(|(name, _)| *name).chain(["total"]);
    for (k, name) in names.enumerate() {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name:<20}{:>12.3}{:>7.1}%{:>12.3}", mean(k), share(mean(k)), max(k));
    }
    let particle_steps = size.particles as f64 * size.steps as f64;
    let rate = if wall > 0.0 { particle_steps / wall } else { 0.0 };
    let cores = comm.size() * size.threads.max(1);
    let imbalance = if mean(busy) > 0.0 { max(busy) / mean(busy) } else { 1.0 };
    let per_particle = mean(bytes) * comm.size() as f64 / size.particles.max(1) as f64;
    let lines = [
        ("ranks × threads", format!("{} × {}", comm.size(), size.threads)),
        ("steps", size.steps.to_string()),
        ("imbalance", format!("{imbalance:.3} (slowest rank over the mean)")),
        ("Cundall number", format!("{rate:.4e} particle-steps/s, {:.4e} per core", rate / cores as f64)),
        ("memory", format!("{per_particle:.0} bytes per particle")),
    ];
    for (name, value) in lines {
        let _ = writeln!(text, "{name:<20}{value}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_the_table_line_up_with_the_headings() {
        let row = HistoryRow { step: 1_234_567, time: 1.25e-3, unbalanced_ratio: f64::NAN, ..HistoryRow::default() };
        let [head, body] = [headings(), table_row(&row, 0.5)];
        assert_eq!(head.len(), body.len(), "\n{head}\n{body}");
        assert!(body.ends_with(" 50%"));
    }

    #[test]
    fn cost_table_gives_shares_and_particle_steps_per_second() {
        let times = StageTimes { contacts: 1.0, step: 0.5, total: 2.0, ..StageTimes::default() };
        let size = RunSize { particles: 1_000, steps: 500, threads: 2, bytes: 400_000 };
        let text = cost_table(&Communicator::single(), &times, &size);
        let line = |name: &str| text.lines().find(|line| line.starts_with(name)).unwrap_or_default().to_owned();
        assert!(line("border contacts").contains("50.0%"), "{text}");
        assert!(line("other").contains("0.500"), "{text}");
        assert!(line("Cundall number").contains("2.5000e5 particle-steps/s, 1.2500e5 per core"), "{text}");
        assert!(line("memory").contains("400 bytes per particle"), "{text}");
    }
}
