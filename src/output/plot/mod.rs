//! Pictures of a run from its history table, as SVG and PNG. Reads files only.

mod draw;
mod panel;
mod png;

pub use draw::{Curve, draw_curves};
pub use panel::{Corner, Ink, Panel, Series, Style, draw_panel};

use super::files::create_folder;
use super::history::{self, HistoryRow};
use crate::error::{Error, Result};
use crate::state::LEDGER;
use std::path::{Path, PathBuf};

/// One picture: name of the file without ending, title, axis labels, curves in SI units with their
/// factors already applied.
struct Figure {
    name: &'static str,
    title: String,
    x_label: String,
    y_label: String,
    curves: Vec<Curve>,
}

/// Draw the pictures of a run directory into its folder `plots/`: stress over strain and over time,
/// coordination and solid fraction, energies. Returns the files written.
///
/// # Errors
/// [`Error::File`] when the history cannot be read, has fewer than two rows, or a picture cannot be
/// written.
pub fn plot_run(directory: &Path) -> Result<Vec<PathBuf>> {
    let rows = history::read(directory)?;
    if rows.len() < 2 {
        let message = format!("has {} rows; a curve needs two: let the run write more history", rows.len());
        return Err(Error::File { path: history::path_in(directory), message });
    }
    let folder = directory.join("plots");
    create_folder(&folder)?;
    let mut files = Vec::new();
    for figure in figures(&rows) {
        for ending in ["svg", "png"] {
            let path = folder.join(format!("{}.{ending}", figure.name));
            draw_curves(&path, &figure.title, &figure.x_label, &figure.y_label, &figure.curves)?;
            files.push(path);
        }
    }
    Ok(files)
}

/// What stands along the x axis: its name in titles, its label, and the number of a row.
struct Abscissa {
    name: &'static str,
    label: String,
    value: Box<dyn Fn(&HistoryRow) -> f64>,
}

impl Abscissa {
    /// Time, or where it stands still the increments.
    fn of_progress(rows: &[HistoryRow]) -> Self {
        if rows.iter().all(|row| row.time == rows[0].time) {
            let value = Box::new(|row: &HistoryRow| row.increment as f64);
            return Self { name: "increments", label: "increment".to_owned(), value };
        }
        let time = scale_of(rows.iter().map(|row| row.time), "s");
        Self {
            name: "time",
            label: format!("time / {}", time.unit),
            value: Box::new(move |row| time.factor * row.time),
        }
    }

    /// The strain of the axis, or of a cell that keeps its shape as [`Self::of_progress`].
    fn of_strain(rows: &[HistoryRow], axis: usize) -> Self {
        if rows.iter().all(|row| row.strain == rows[0].strain) {
            return Self::of_progress(rows);
        }
        Self {
            name: "strain",
            label: format!("nominal strain {} / %", AXES[axis]),
            value: Box::new(move |row| 100.0 * row.strain[axis]),
        }
    }
}

const AXES: [&str; 3] = ["xx", "yy", "zz"];

fn figures(rows: &[HistoryRow]) -> Vec<Figure> {
    let axis = loaded_axis(rows);
    let stress = scale_of(rows.iter().flat_map(|row| [row.stress[axis], row.mean_stress()]), "Pa");
    let (progress, strain) = (Abscissa::of_progress(rows), Abscissa::of_strain(rows, axis));
    let figure = |name, what: &str, over: &Abscissa, y_label: &str, curves| Figure {
        name,
        title: format!("{what} over {}", over.name),
        x_label: over.label.clone(),
        y_label: y_label.to_owned(),
        curves,
    };
    let stress_label = format!("stress / {}", stress.unit);
    let stresses = |over: &Abscissa| {
        vec![
            curve(AXES[axis], rows, &over.value, |row| stress.factor * row.stress[axis]),
            curve("mean", rows, &over.value, |row| stress.factor * row.mean_stress()),
        ]
    };
    let coordination = vec![
        curve("all particles", rows, &strain.value, |row| row.coordination),
        curve("without rattlers", rows, &strain.value, |row| row.coordination_without_rattlers),
    ];
    let solid_fraction = vec![curve("solid fraction", rows, &strain.value, |row| row.solid_fraction)];
    let (energies, unit) = energies(rows, &progress);
    let figures = [
        figure("stress_strain", "Stress", &strain, &stress_label, stresses(&strain)),
        figure("stress_time", "Stress", &progress, &stress_label, stresses(&progress)),
        figure("coordination", "Coordination number", &strain, "coordination number", coordination),
        figure("solid_fraction", "Solid fraction", &strain, "solid fraction", solid_fraction),
        figure("energies", "Energies", &progress, &format!("energy / {unit}"), energies),
    ];
    // A gas at rest has no energies to show.
    figures.into_iter().filter(|figure| figure.curves.iter().any(Curve::shows)).collect()
}

/// Curves of the energies that are not zero throughout, and their unit.
fn energies(rows: &[HistoryRow], over: &Abscissa) -> (Vec<Curve>, String) {
    type Energy = (String, Box<dyn Fn(&HistoryRow) -> f64>);
    let mut all: Vec<Energy> = vec![
        ("kinetic".to_owned(), Box::new(|row| row.kinetic)),
        ("elastic".to_owned(), Box::new(|row| row.elastic)),
        ("viscoelastic".to_owned(), Box::new(|row| row.viscoelastic)),
    ];
    for (index, name) in LEDGER.iter().enumerate() {
        all.push((name.replace('_', " "), Box::new(move |row| row.ledger[index])));
    }
    // Entries that stay zero (no such law, ledger off) would only crowd the legend.
    let used: Vec<Energy> = all.into_iter().filter(|(_, value)| rows.iter().any(|row| value(row) != 0.0)).collect();
    let energy = scale_of(rows.iter().flat_map(|row| used.iter().map(|(_, value)| value(row))), "J");
    let curves =
        used.iter().map(|(name, value)| curve(name, rows, &over.value, |row| energy.factor * value(row))).collect();
    (curves, energy.unit)
}

fn curve(label: &str, rows: &[HistoryRow], x: impl Fn(&HistoryRow) -> f64, y: impl Fn(&HistoryRow) -> f64) -> Curve {
    Curve { label: label.to_owned(), points: rows.iter().map(|row| (x(row), y(row))).collect() }
}

/// The axis strained most.
fn loaded_axis(rows: &[HistoryRow]) -> usize {
    let reach = |axis: usize| rows.iter().map(|row| row.strain[axis].abs()).fold(0.0, f64::max);
    // zz wins a tie, as the direction of loading by custom.
    if reach(2) >= reach(0).max(reach(1)) { 2 } else { usize::from(reach(1) > reach(0)) }
}

/// A unit with a prefix and the factor from SI to it.
#[derive(Debug, Clone, PartialEq)]
struct Scale {
    factor: f64,
    unit: String,
}

/// The prefix that brings the largest value between 1 and 1000.
fn scale_of(values: impl Iterator<Item = f64>, unit: &str) -> Scale {
    const PREFIXES: [(f64, &str); 10] = [
        (1e9, "G"),
        (1e6, "M"),
        (1e3, "k"),
        (1.0, ""),
        (1e-3, "m"),
        (1e-6, "µ"),
        (1e-9, "n"),
        (1e-12, "p"),
        (1e-15, "f"),
        (1e-18, "a"),
    ];
    let largest = values.map(f64::abs).filter(|value| value.is_finite()).fold(0.0, f64::max);
    // Seconds are not counted in thousands.
    let fits = |(size, prefix): &&(f64, &str)| largest >= *size && (unit != "s" || prefix.len() != 1 || *size < 1.0);
    let (size, prefix) = PREFIXES.iter().find(fits).copied().unwrap_or((1.0, ""));
    Scale { factor: 1.0 / size, unit: format!("{prefix}{unit}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::history::HistoryWriter;

    fn relaxation(directory: &Path) {
        let mut writer = HistoryWriter::create(directory).expect("create");
        for step in 0..200u64 {
            let time = step as f64 / 20.0;
            let strain = time.min(1.0) * 3.0e-3;
            let stress = strain * 1.0e9 * if time > 1.0 { 0.4 + 0.6 / time } else { 1.0 };
            writer
                .write(&HistoryRow {
                    step,
                    time,
                    strain: [0.0, 0.0, strain],
                    stress: [0.5 * stress, 0.5 * stress, stress, 0.0, 0.0, 0.0],
                    solid_fraction: 0.635 / (1.0 - strain),
                    coordination: 5.5 + 100.0 * strain,
                    coordination_without_rattlers: 5.9 + 100.0 * strain,
                    elastic: stress * strain * 1.0e-17,
                    kinetic: 1.0e-14,
                    ledger: [2.0 * stress * strain * 1.0e-17, 0.0, 0.0, 1.0e-13 * time, 0.0, 0.0, 0.0],
                    ..HistoryRow::default()
                })
                .expect("write");
        }
    }

    #[test]
    fn every_picture_of_a_run_is_drawn_as_svg_and_png() {
        let folder = tempfile::tempdir().expect("folder");
        relaxation(folder.path());
        let files = plot_run(folder.path()).expect("plot");
        assert_eq!(files.len(), 10);
        for file in &files {
            let bytes = std::fs::read(file).expect("read");
            assert!(bytes.len() > 2_000, "{file:?} has {} bytes", bytes.len());
        }
        let svg = std::fs::read_to_string(&files[0]).expect("read");
        assert!(svg.contains("stress / MPa") && svg.contains("nominal strain zz / %"), "labels with units");
        if let Some(kept) = std::env::var_os("DEM_MPI_KEEP_PLOTS") {
            for file in &files {
                std::fs::copy(file, Path::new(&kept).join(file.file_name().unwrap_or_default())).expect("copy");
            }
        }
    }

    fn titles(change: impl Fn(u64, &mut HistoryRow)) -> Vec<String> {
        let rows = (0..9).map(|step| {
            let mut row =
                HistoryRow { step, time: step as f64, stress: [1.0; 6], elastic: 1.0, ..HistoryRow::default() };
            change(step, &mut row);
            row
        });
        figures(&rows.collect::<Vec<_>>())
            .into_iter()
            .map(|figure| format!("{}: {}", figure.title, figure.x_label))
            .collect()
    }

    #[test]
    fn what_does_not_change_is_no_axis_and_what_is_not_there_no_picture() {
        let strained = titles(|step, row| row.strain[0] = 1e-3 * step as f64);
        assert_eq!(strained[0], "Stress over strain: nominal strain xx / %");
        assert_eq!(strained[4], "Energies over time: time / s");
        let held = titles(|_, _| ());
        assert_eq!((held[0].as_str(), held.len()), ("Stress over time: time / s", 5));
        let relaxed = titles(|step, row| (row.time, row.increment) = (0.0, step));
        assert_eq!(relaxed[4], "Energies over increments: increment");
        assert_eq!(titles(|_, row| row.elastic = 0.0).len(), 4);
    }

    #[test]
    fn a_history_without_rows_is_an_error_that_says_so() {
        let folder = tempfile::tempdir().expect("folder");
        HistoryWriter::create(folder.path()).expect("create");
        let message = plot_run(folder.path()).expect_err("no rows").to_string();
        assert!(message.contains("has 0 rows"), "{message}");
    }

    #[test]
    fn units_are_chosen_by_size() {
        let unit = |value: f64, unit: &str| scale_of([value, f64::NAN].into_iter(), unit).unit;
        assert_eq!(unit(2.5e6, "Pa"), "MPa");
        assert_eq!(unit(-3.0e-14, "J"), "fJ");
        assert_eq!(unit(5.0e3, "s"), "s");
        assert_eq!(unit(4.0e-5, "s"), "µs");
        assert_eq!(unit(0.0, "Pa"), "Pa");
    }
}
