//! `history.csv`: one header line whose names carry the units, then numbers only. Rank 0 writes it;
//! knows nothing of how the values come about.

use super::files::{io_error, write_atomically};
use crate::error::{Error, Result};
use crate::state::LEDGER;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

const AXES: [&str; 3] = ["xx", "yy", "zz"];
const TENSOR: [&str; 6] = ["xx", "yy", "zz", "xy", "xz", "yz"];

/// One row. Stresses and strains are positive in compression; tensors in the order xx, yy, zz, xy,
/// xz, yz.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HistoryRow {
    /// Steps done.
    pub step: u64,
    /// Time \[s\].
    pub time: f64,
    /// Time step \[s\].
    pub time_step: f64,
    /// Nominal strain per axis.
    pub strain: [f64; 3],
    /// Contact part of the stress \[Pa\].
    pub stress: [f64; 6],
    /// Kinetic part of the stress per axis \[Pa\].
    pub kinetic_stress: [f64; 3],
    /// Solid fraction.
    pub solid_fraction: f64,
    /// Mean coordination number.
    pub coordination: f64,
    /// Mean coordination number without rattlers.
    pub coordination_without_rattlers: f64,
    /// Particles that no contact network holds.
    pub rattlers: u64,
    /// Touching pairs.
    pub contacts: u64,
    /// Kinetic energy \[J\].
    pub kinetic: f64,
    /// Energy held by contact springs \[J\].
    pub elastic: f64,
    /// Energy held by Maxwell branches \[J\].
    pub viscoelastic: f64,
    /// Energy ledger since the start \[J\], in the order of [`LEDGER`].
    pub ledger: [f64; LEDGER.len()],
    /// Mean unbalanced force over mean contact force; NaN before anything touches.
    pub unbalanced_ratio: f64,
    /// Largest overlap over the smaller radius.
    pub max_overlap_ratio: f64,
    /// Fabric tensor.
    pub fabric: [f64; 6],
    /// Equilibria that quasi-static stages have found so far.
    pub increment: u64,
    /// Inertial number `ε̇ d √(ρ/p)`: largest strain rate, diameter and (scaled) density, mean stress p; 0 while the cell
    /// rests, NaN under strain without stress.
    pub inertial_number: f64,
}

/// Column names in the order of [`HistoryRow::values`].
#[must_use]
pub fn columns() -> Vec<String> {
    let mut names: Vec<String> = ["step", "time_s", "time_step_s"].map(String::from).to_vec();
    names.extend(AXES.map(|axis| format!("strain_{axis}")));
    names.extend(TENSOR.map(|part| format!("stress_{part}_Pa")));
    names.extend(AXES.map(|axis| format!("kinetic_stress_{axis}_Pa")));
    names.extend(
        ["solid_fraction", "coordination", "coordination_without_rattlers", "rattlers", "contacts"].map(String::from),
    );
    names.extend(["kinetic_J", "elastic_J", "viscoelastic_J"].map(String::from));
    names.extend(LEDGER.map(|entry| format!("{entry}_J")));
    names.extend(["unbalanced_ratio", "max_overlap_ratio"].map(String::from));
    names.extend(TENSOR.map(|part| format!("fabric_{part}")));
    names.extend(["increment", "inertial_number"].map(String::from));
    names
}

/// A cell of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Cell {
    Count(u64),
    Real(f64),
}

impl HistoryRow {
    /// Mean contact stress (p = trace/3) \[Pa\].
    #[must_use]
    pub fn mean_stress(&self) -> f64 {
        (self.stress[0] + self.stress[1] + self.stress[2]) / 3.0
    }

    fn cells(&self) -> Vec<Cell> {
        let mut cells = vec![Cell::Count(self.step), Cell::Real(self.time), Cell::Real(self.time_step)];
        let mut reals = |values: &[f64]| cells.extend(values.iter().map(|&value| Cell::Real(value)));
        reals(&self.strain);
        reals(&self.stress);
        reals(&self.kinetic_stress);
        reals(&[self.solid_fraction, self.coordination, self.coordination_without_rattlers]);
        cells.extend([Cell::Count(self.rattlers), Cell::Count(self.contacts)]);
        let mut reals = |values: &[f64]| cells.extend(values.iter().map(|&value| Cell::Real(value)));
        reals(&[self.kinetic, self.elastic, self.viscoelastic]);
        reals(&self.ledger);
        reals(&[self.unbalanced_ratio, self.max_overlap_ratio]);
        reals(&self.fabric);
        cells.extend([Cell::Count(self.increment), Cell::Real(self.inertial_number)]);
        cells
    }

    fn line(&self) -> String {
        let words: Vec<String> = self
            .cells()
            .into_iter()
            .map(|cell| match cell {
                Cell::Count(value) => value.to_string(),
                Cell::Real(value) if value.is_nan() => "nan".to_owned(),
                // The shortest decimal that reads back as the same number.
                Cell::Real(value) => format!("{value:?}"),
            })
            .collect();
        words.join(",") + "\n"
    }

    /// From the words of a line; the error names the column at fault.
    fn parse(line: &str) -> std::result::Result<Self, String> {
        let names = columns();
        let words: Vec<&str> = line.split(',').collect();
        if words.len() != names.len() {
            return Err(format!("{} columns instead of {}", words.len(), names.len()));
        }
        let mut cells = words.into_iter().zip(names);
        let mut word = || cells.next().unwrap_or_default();
        let mut row = Self { step: count(word())?, time: real(word())?, time_step: real(word())?, ..Self::default() };
        for part in row.strain.iter_mut().chain(&mut row.stress).chain(&mut row.kinetic_stress) {
            *part = real(word())?;
        }
        row.solid_fraction = real(word())?;
        row.coordination = real(word())?;
        row.coordination_without_rattlers = real(word())?;
        row.rattlers = count(word())?;
        row.contacts = count(word())?;
        for part in [&mut row.kinetic, &mut row.elastic, &mut row.viscoelastic].into_iter().chain(&mut row.ledger) {
            *part = real(word())?;
        }
        for part in [&mut row.unbalanced_ratio, &mut row.max_overlap_ratio].into_iter().chain(&mut row.fabric) {
            *part = real(word())?;
        }
        row.increment = count(word())?;
        row.inertial_number = real(word())?;
        Ok(row)
    }
}

fn real((word, name): (&str, String)) -> std::result::Result<f64, String> {
    word.parse().map_err(|_| format!("`{word}` in column {name} is not a number"))
}

fn count((word, name): (&str, String)) -> std::result::Result<u64, String> {
    word.parse().map_err(|_| format!("`{word}` in column {name} is not a whole number"))
}

/// Path of the table in a run directory.
#[must_use]
pub fn path_in(directory: &Path) -> PathBuf {
    directory.join("history.csv")
}

/// Appends rows to the table of a run directory. Rank 0 only.
#[derive(Debug)]
pub struct HistoryWriter {
    path: PathBuf,
    file: File,
}

impl HistoryWriter {
    /// A new table with its header; an old one is replaced.
    ///
    /// # Errors
    /// [`Error::File`] when it cannot be written.
    pub fn create(directory: &Path) -> Result<Self> {
        let path = path_in(directory);
        write_atomically(&path, (columns().join(",") + "\n").as_bytes())?;
        Self::open(path)
    }

    /// Go on after the first `rows` rows of an old table (restart), dropping later ones.
    ///
    /// # Errors
    /// [`Error::File`] when the table is missing, holds fewer rows, or cannot be written.
    pub fn resume(directory: &Path, rows: u64) -> Result<Self> {
        truncate(directory, rows)?;
        Self::open(path_in(directory))
    }

    /// Append one row; it is in the file when this returns.
    ///
    /// # Errors
    /// [`Error::File`] when it cannot be written.
    pub fn write(&mut self, row: &HistoryRow) -> Result<()> {
        self.file.write_all(row.line().as_bytes()).map_err(|error| io_error(&self.path, "append a row", &error))
    }

    fn open(path: PathBuf) -> Result<Self> {
        match OpenOptions::new().append(true).open(&path) {
            Ok(file) => Ok(Self { path, file }),
            Err(error) => Err(io_error(&path, "open the table", &error)),
        }
    }
}

/// Keep the header and the first `rows` rows of a table; the rest belongs to a future that a restart
/// computes anew. Atomic. Rank 0 only.
///
/// # Errors
/// [`Error::File`] when the table is missing, is not ours, or holds fewer rows.
pub fn truncate(directory: &Path, rows: u64) -> Result<()> {
    write_atomically(&path_in(directory), first_rows(directory, rows)?.as_bytes())
}

/// That the table holds so many rows. Rank 0 only.
///
/// # Errors
/// As [`truncate`].
pub fn check(directory: &Path, rows: u64) -> Result<()> {
    if rows == 0 { Ok(()) } else { first_rows(directory, rows).map(|_| ()) }
}

/// The header and the first `rows` rows.
fn first_rows(directory: &Path, rows: u64) -> Result<String> {
    let path = path_in(directory);
    let text = read_text(&path)?;
    let wanted = usize::try_from(rows).unwrap_or(usize::MAX).saturating_add(1);
    let lines: Vec<&str> = text.split_inclusive('\n').filter(|line| line.ends_with('\n')).take(wanted).collect();
    if lines.len() < wanted {
        let message = format!(
            "holds {} rows where the checkpoint has written {rows}; restart from an older checkpoint, or begin anew \
             without --restart",
            lines.len().saturating_sub(1)
        );
        return Err(Error::File { path, message });
    }
    Ok(lines.concat())
}

/// All rows of the table of a run directory; a last line cut off by a kill is left out.
///
/// # Errors
/// [`Error::File`] when the table is missing or a line is not as this program writes it.
pub fn read(directory: &Path) -> Result<Vec<HistoryRow>> {
    let path = path_in(directory);
    let text = read_text(&path)?;
    let lines = text.split_inclusive('\n').filter(|line| line.ends_with('\n')).map(str::trim_end);
    lines
        .enumerate()
        .skip(1)
        .map(|(index, line)| {
            HistoryRow::parse(line)
                .map_err(|reason| Error::File { path: path.clone(), message: format!("line {}: {reason}", index + 1) })
        })
        .collect()
}

fn read_text(path: &Path) -> Result<String> {
    let text = fs::read_to_string(path).map_err(|error| io_error(path, "read the table", &error))?;
    if text.lines().next() != Some(columns().join(",").as_str()) {
        let message = "its header is not the one of this program's history table; give a run directory".to_owned();
        return Err(Error::File { path: path.to_path_buf(), message });
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(step: u64) -> HistoryRow {
        let x = step as f64 / 3.0;
        HistoryRow {
            step,
            time: x * 1.0e-7,
            strain: [0.0, -x, 1.0e-300],
            stress: [x, 1.0e6 * x, f64::MIN_POSITIVE, -0.0, 4.0, 5.0],
            rattlers: step,
            contacts: 3 * step,
            elastic: 1.0e22,
            ledger: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0],
            max_overlap_ratio: 0.1,
            fabric: [6.0, 5.0, 4.0, 3.0, 2.0, 1.0],
            increment: 2 * step,
            inertial_number: 1e-5 * x,
            ..HistoryRow::default()
        }
    }

    #[test]
    fn rows_read_back_bit_for_bit() {
        let folder = tempfile::tempdir().expect("folder");
        let mut writer = HistoryWriter::create(folder.path()).expect("create");
        let rows: Vec<HistoryRow> = (0..5).map(row).collect();
        for row in &rows {
            writer.write(row).expect("write");
        }
        assert_eq!(read(folder.path()).expect("read"), rows);
    }

    #[test]
    fn header_has_one_name_per_cell_with_units() {
        let names = columns();
        assert_eq!(names.len(), row(1).cells().len());
        for name in ["step", "time_s", "strain_zz", "stress_zz_Pa", "kinetic_J", "friction_J", "unbalanced_ratio"] {
            assert!(names.contains(&name.to_owned()), "{name}");
        }
    }

    #[test]
    fn an_undefined_ratio_is_written_as_nan_and_reads_back() {
        let line = HistoryRow { unbalanced_ratio: f64::NAN, ..row(1) }.line();
        assert!(line.contains(",nan,"), "{line}");
        assert!(HistoryRow::parse(line.trim_end()).expect("parse").unbalanced_ratio.is_nan());
    }

    #[test]
    fn truncation_gives_the_bytes_of_a_run_that_stopped_there() {
        let [long, short] = [8, 3].map(|count| {
            let folder = tempfile::tempdir().expect("folder");
            let mut writer = HistoryWriter::create(folder.path()).expect("create");
            (0..count).for_each(|step| writer.write(&row(step)).expect("write"));
            folder
        });
        // A line that a kill cut off.
        let mut text = fs::read_to_string(path_in(long.path())).expect("read");
        text.push_str("9,0.1,0.");
        fs::write(path_in(long.path()), text).expect("write");
        assert_eq!(read(long.path()).expect("read").len(), 8);
        let mut writer = HistoryWriter::resume(long.path(), 3).expect("resume");
        let bytes = |folder: &tempfile::TempDir| fs::read(path_in(folder.path())).expect("read");
        assert_eq!(bytes(&long), bytes(&short));
        writer.write(&row(3)).expect("write");
        assert_eq!(read(long.path()).expect("read").len(), 4);
    }

    #[test]
    fn a_table_that_is_too_short_or_foreign_is_refused() {
        let folder = tempfile::tempdir().expect("folder");
        HistoryWriter::create(folder.path()).expect("create");
        let message = truncate(folder.path(), 2).expect_err("too short").to_string();
        assert!(message.contains("holds 0 rows"), "{message}");
        fs::write(path_in(folder.path()), "a,b\n1,2\n").expect("write");
        assert!(read(folder.path()).is_err());
        fs::write(path_in(folder.path()), columns().join(",") + "\nx,1\n").expect("write");
        let message = read(folder.path()).expect_err("bad line").to_string();
        assert!(message.contains("line 2"), "{message}");
    }
}
