//! Particles from a file: CSV or HDF5, a table with units in its column names, or a LAMMPS data file.
//! Checks every value and reports what is wrong with its place in the file.

mod columns;
mod csv;
mod hdf5;
mod lammps;

use super::grid::Cell;
use super::rcp::wrap;
use crate::error::{Error, Result};
use crate::state::shape::{bounding_radius, normalised};
use columns::{Columns, Quantity};
use std::path::Path;

/// One particle as the file gives it, SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Index into the names of species.
    pub species: u32,
    /// Centre, wrapped into the cell \[m\].
    pub position: [f64; 3],
    /// Radius \[m\]; of an ellipsoid its largest semi-axis.
    pub radius: f64,
    /// Semi-axes of an ellipsoid \[m\].
    pub semi_axes: Option<[f64; 3]>,
    /// Unit quaternion (w, x, y, z), if the file has it.
    pub orientation: Option<[f64; 4]>,
    /// Density \[kg/m³\], if the file has it.
    pub density: Option<f64>,
    /// Velocity \[m/s\], if the file has it.
    pub velocity: Option<[f64; 3]>,
    /// Spin \[rad/s\], if the file has it.
    pub spin: Option<[f64; 3]>,
}

/// The cell as far as it is known before the file is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Sides \[m\]; `None`: the box of the file.
    pub sides: Option<[f64; 3]>,
    /// Periodic axes; the others have walls.
    pub periodic: [bool; 3],
}

/// What a file gives.
#[derive(Debug, Clone, PartialEq)]
pub struct Contents {
    /// Sides of the cell \[m\].
    pub sides: [f64; 3],
    /// Particles in the order of their ids.
    pub rows: Vec<Row>,
}

/// The formats, told apart by the ending of the name, and LAMMPS data files by their text too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Csv,
    Hdf5,
    Lammps,
}

/// What the formats of tables come down to: columns of equal length, and where each row stands.
#[derive(Debug)]
struct Table {
    columns: Columns,
    species: Vec<String>,
    /// One list per entry of `columns.numbers`, in the file's units.
    numbers: Vec<Vec<f64>>,
    /// Words for the place of each row: `line 7`, `row 6`.
    place: Vec<String>,
}

/// The length of a quaternion in a file may differ from 1 by so much.
const QUATERNION_TOLERANCE: f64 = 1e-3;

/// So many problems are listed; the rest is counted.
const MAX_PROBLEMS: usize = 10;

/// Read particles and, where the file has it, their cell.
///
/// **LAMMPS data file** (by the extension `.data` or `.lmp`, or by its line `N atoms`), `atom_style sphere`
/// in SI units: atom `id` becomes particle `id − 1`, type `t` the `t`-th species, the box is the cell with
/// its low corner moved to the origin. Image flags are read over.
///
/// **Tables**: ids follow the order of the rows. Columns (CSV, one header line) or datasets in the root group (HDF5, by the extension `.h5` or
/// `.hdf5`): `species` (a name), `x_m`, `y_m`, `z_m`, `radius_m` or, for ellipsoids, the semi-axes `a_m`,
/// `b_m`, `c_m` with the orientation `qw`, `qx`, `qy`, `qz` (body to space, of unit length), and, each as a complete triple or
/// not at all, `vx_m_per_s` … and `wx_rad_per_s` …. Lengths also with the unit `mm`, `um` or `nm`,
/// velocities with `mm_per_s`, `um_per_s` or `nm_per_s`. Lines that begin with `#` are comments.
/// Positions beyond a periodic face are wrapped.
///
/// # Errors
/// [`Error::Input`] with line, column, value and remedy of every problem (the first ten); a box that is not
/// that of `region`; a table without sides in `region`; a file without particles.
pub fn read(path: &Path, species: &[&str], region: &Region) -> Result<Contents> {
    let read = format(path).and_then(|format| match format {
        Format::Lammps => lammps::read(path, species, region),
        Format::Csv | Format::Hdf5 => from_table(&table(path, format)?, species, region),
    });
    let read = read.and_then(|contents| match contents.rows[..] {
        [] => Err("the file holds no particles; give it a row for each".into()),
        _ => Ok(contents),
    });
    read.map_err(|message| Error::Input(format!("{}: {message}", path.display())))
}

/// Names for the species of a file, for callers that have no input: the names in a table, in the order of
/// their first use, or the numbers of the types of a LAMMPS data file.
///
/// # Errors
/// [`Error::Input`] as for [`read`].
pub fn species_names(path: &Path) -> Result<Vec<String>> {
    let names = format(path).and_then(|format| match format {
        Format::Lammps => lammps::header(path).map(|header| (1..=header.types).map(|t| t.to_string()).collect()),
        Format::Csv | Format::Hdf5 => table(path, format).map(|table| {
            let mut seen = std::collections::BTreeSet::new();
            table.species.into_iter().filter(|name| seen.insert(name.clone())).collect()
        }),
    });
    names.map_err(|message| Error::Input(format!("{}: {message}", path.display())))
}

fn format(path: &Path) -> std::result::Result<Format, String> {
    if path.is_dir() {
        return Err("is a folder; name the particle file in it".into());
    }
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase();
    match extension.as_str() {
        "h5" | "hdf5" => Ok(Format::Hdf5),
        "csv" => Ok(Format::Csv),
        "data" | "lmp" => Ok(Format::Lammps),
        _ if lammps::recognise(path) => Ok(Format::Lammps),
        _ => Err(
            "particles are read from .csv, .h5 and .hdf5 files and from LAMMPS data files (.data, .lmp); rename or \
                  convert the file"
                .into(),
        ),
    }
}

fn table(path: &Path, format: Format) -> std::result::Result<Table, String> {
    if format == Format::Hdf5 { hdf5::read(path) } else { csv::read(path) }
}

fn from_table(table: &Table, species: &[&str], region: &Region) -> std::result::Result<Contents, String> {
    let Some(sides) = region.sides else {
        return Err("a table says nothing of the cell; set the `sides` of the cell in the input".into());
    };
    let cell = Cell { sides, periodic: region.periodic };
    rows(table, species, &cell).map(|rows| Contents { sides, rows })
}

fn rows(table: &Table, species: &[&str], cell: &Cell) -> std::result::Result<Vec<Row>, String> {
    let mut problems = Problems::default();
    let rows = (0..table.species.len()).filter_map(|row| table.row(row, species, cell, &mut problems)).collect();
    problems.into_result(rows)
}

impl Table {
    /// One checked particle; `None`, with the reasons in `problems`, if it cannot be used.
    fn row(&self, row: usize, species: &[&str], cell: &Cell, problems: &mut Problems) -> Option<Row> {
        let before = problems.count;
        let name = self.species[row].as_str();
        let species_index = species.iter().position(|known| *known == name);
        if species_index.is_none() {
            problems.add(format!(
                "{}, column species: unknown species \"{name}\"; known: {}",
                self.place[row],
                species.join(", ")
            ));
        }
        let mut number = |quantity: Quantity, axis: usize| -> Option<f64> {
            let column = self.columns.index(quantity, axis)?;
            let value = self.numbers[column][row];
            if let Some(reason) = refuse(quantity, value, self.columns.numbers[column].to_si(value), axis, cell) {
                let name = &self.columns.numbers[column].name;
                problems.add(format!("{}, column {name}: {value} {reason}", self.place[row]));
            }
            Some(self.columns.numbers[column].to_si(value))
        };
        let mut triple = |quantity| Some([number(quantity, 0)?, number(quantity, 1)?, number(quantity, 2)?]);
        let position = triple(Quantity::Position)?;
        let (velocity, spin) = (triple(Quantity::Velocity), triple(Quantity::Spin));
        let semi_axes = triple(Quantity::SemiAxis);
        let quaternion = [0, 1, 2, 3].map(|component| number(Quantity::Orientation, component));
        let radius = semi_axes.map(bounding_radius).or_else(|| number(Quantity::Radius, 0))?;
        let orientation = match quaternion {
            [Some(w), Some(x), Some(y), Some(z)] => Some([w, x, y, z]),
            _ => None,
        };
        let square: f64 = orientation.map_or(1.0, |q| q.iter().map(|c| c * c).sum());
        if (square - 1.0).abs() > 2.0 * QUATERNION_TOLERANCE {
            problems.add(format!(
                "{}, columns qw to qz: the quaternion has the length {:.4}, an orientation has 1; correct or normalise it",
                self.place[row],
                square.sqrt()
            ));
        }
        if problems.count > before {
            return None;
        }
        let orientation = orientation.map(normalised);
        let position = [0, 1, 2].map(|k| if cell.periodic[k] { wrap(position[k], cell.sides[k]) } else { position[k] });
        Some(Row {
            species: species_index? as u32,
            position,
            radius,
            semi_axes,
            orientation,
            density: None,
            velocity,
            spin,
        })
    }
}

/// Why a number cannot be used, with the remedy.
fn refuse(quantity: Quantity, value: f64, si: f64, axis: usize, cell: &Cell) -> Option<String> {
    if !value.is_finite() {
        return Some("is not a finite number; correct it or remove the particle".into());
    }
    if matches!(quantity, Quantity::Radius | Quantity::SemiAxis) && si <= 0.0 {
        let what = if quantity == Quantity::Radius { "radius" } else { "semi-axis" };
        return Some(format!("is not a {what}; it must be greater than 0"));
    }
    if quantity == Quantity::Position && !cell.periodic[axis] && !(0.0..=cell.sides[axis]).contains(&si) {
        return Some(format!(
            "lies outside the walls of the cell, which reaches from 0 to {:e} m; move the particle or enlarge the cell",
            cell.sides[axis]
        ));
    }
    None
}

/// Collects what is wrong, so that all of it is told at once.
#[derive(Debug, Default)]
struct Problems {
    count: usize,
    texts: Vec<String>,
}

impl Problems {
    fn add(&mut self, text: String) {
        self.count += 1;
        if self.texts.len() < MAX_PROBLEMS {
            self.texts.push(text);
        }
    }

    fn into_result<T>(self, value: T) -> std::result::Result<T, String> {
        let hidden = self.count - self.texts.len();
        match (self.count, hidden) {
            (0, _) => Ok(value),
            (_, 0) => Err(self.texts.join("\n")),
            _ => Err(format!("{}\nand {hidden} more", self.texts.join("\n"))),
        }
    }
}

#[cfg(test)]
mod tests;
