//! Tables at the end of a run that show how ranks differ, and what set-up and files took.

use crate::exchange::Communicator;
use std::fmt::Write;

/// A quantity that every rank has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RankRow {
    /// Name with its unit.
    pub name: &'static str,
    /// This rank's value.
    pub value: f64,
    /// The mean that a model expects.
    pub expected: Option<f64>,
}

/// Smallest, mean and largest value over the ranks, and the model's mean. Collective; the text is the
/// same on all ranks.
#[must_use]
pub fn rank_table(comm: &Communicator, rows: &[RankRow]) -> String {
    let values = || rows.iter().map(|row| row.value).collect::<Vec<f64>>();
    let (mut low, mut high) = (values(), values());
    comm.min_f64(&mut low);
    comm.max_f64(&mut high);
    // Counts and bytes: whole numbers.
    let mut sum: Vec<i64> = rows.iter().map(|row| row.value as i64).collect();
    comm.sum_i64(&mut sum);
    let mut text = format!("{:<20}{:>12}{:>12}{:>12}{:>12}\n", "per rank", "least", "mean", "most", "model");
    for (k, row) in rows.iter().enumerate() {
        let mean = sum[k] as f64 / comm.size() as f64;
        let expected = row.expected.map_or("-".to_owned(), |value| format!("{value:.1}"));
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{:<20}{:>12.0}{mean:>12.1}{:>12.0}{expected:>12}", row.name, low[k], high[k]);
    }
    text
}

/// Something done once or several times outside the steps.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Effort {
    /// How often.
    pub times: u64,
    /// Wall time of all times together \[s\].
    pub seconds: f64,
    /// Bytes written, if it writes.
    pub bytes: u64,
}

impl Effort {
    /// One more time.
    pub fn add(&mut self, seconds: f64, bytes: u64) {
        self.times += 1;
        self.seconds += seconds;
        self.bytes += bytes;
    }
}

/// Seconds, and where something is written MB and GB/s; what never happened is left out.
#[must_use]
pub fn effort_table(rows: &[(&'static str, Effort)]) -> String {
    let mut text = format!("{:<20}{:>12}{:>8}{:>12}{:>12}\n", "set-up and files", "s", "times", "MB", "GB/s");
    for (name, effort) in rows.iter().filter(|(_, effort)| effort.times > 0) {
        let _ = write!(text, "{name:<20}{:>12.3}{:>8}", effort.seconds, effort.times);
        if effort.bytes > 0 && effort.seconds > 0.0 {
            let bytes = effort.bytes as f64;
            let _ = write!(text, "{:>12.1}{:>12.3}", 1e-6 * bytes, 1e-9 * bytes / effort.seconds);
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_rank_is_least_mean_and_most() {
        let rows = [
            RankRow { name: "ghosts", value: 12.0, expected: Some(11.5) },
            RankRow { name: "peak bytes", value: 7.0, expected: None },
        ];
        let text = rank_table(&Communicator::single(), &rows);
        let words = |line: usize| text.lines().nth(line).unwrap_or_default().split_whitespace().collect::<Vec<_>>();
        assert_eq!(words(1), ["ghosts", "12", "12.0", "12", "11.5"]);
        assert_eq!(words(2), ["peak", "bytes", "7", "7.0", "7", "-"]);
    }

    #[test]
    fn files_show_their_rate_and_what_did_not_happen_is_left_out() {
        let mut checkpoint = Effort::default();
        checkpoint.add(0.5, 1_000_000_000);
        checkpoint.add(1.5, 1_000_000_000);
        let text = effort_table(&[("snapshots", Effort::default()), ("checkpoints", checkpoint)]);
        let words: Vec<&str> = text.lines().nth(1).unwrap_or_default().split_whitespace().collect();
        assert_eq!(words, ["checkpoints", "2.000", "2", "2000.0", "1.000"]);
        assert!(!text.contains("snapshots"));
    }
}
