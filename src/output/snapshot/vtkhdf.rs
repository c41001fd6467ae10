//! The VTKHDF PolyData layout, version 2.0: points, the four kinds of cells (all groups must be
//! there, empty or not), and arrays on points, on cells and on the whole.

use super::{Moment, SnapshotContacts, SnapshotParticle};
use crate::error::Result;
use crate::exchange::Communicator;
use crate::force::law::Column;
use crate::output::hdf5_file::{Kind, Layout, Reader, Scalar, Value, Writer};
use crate::state::shape::rotation_matrix;
use std::collections::BTreeSet;
use std::path::Path;

const TIME: &str = "VTKHDF/FieldData/TimeValue";
const STEP: &str = "VTKHDF/FieldData/step";
const SIDES: &str = "VTKHDF/FieldData/cell_sides";

const CELL_KINDS: [&str; 4] = ["Vertices", "Lines", "Polygons", "Strips"];

/// Particles of one rank, and where they stand among all.
pub(super) struct Block<'a> {
    /// Number of all particles.
    pub total: u64,
    /// Row of the first own one.
    pub first: u64,
    /// The own ones.
    pub particles: &'a [SnapshotParticle],
    /// Write semi-axes and tensors too.
    pub ellipsoids: bool,
}

/// Particles as vertices with arrays on the points. Collective.
///
/// # Errors
/// As [`Writer::create`] and [`Writer::write`].
pub(super) fn write_particles(comm: &Communicator, path: &Path, moment: &Moment, block: &Block) -> Result<()> {
    let Block { total, first, particles, ellipsoids } = *block;
    let mut layout = frame(moment, total, "Vertices", total, 1);
    layout.group("VTKHDF/PointData");
    for (name, kind, columns) in [
        ("id", Kind::U32, 1),
        ("species", Kind::U32, 1),
        ("radius", Kind::F64, 1),
        ("orientation", Kind::F64, 4),
        ("velocity", Kind::F64, 3),
        ("angular_velocity", Kind::F64, 3),
        ("stress_trace", Kind::F64, 1),
        ("coordination", Kind::U32, 1),
    ] {
        array(&mut layout, &format!("VTKHDF/PointData/{name}"), kind, total, columns);
    }
    if ellipsoids {
        array(&mut layout, "VTKHDF/PointData/semi_axes", Kind::F64, total, 3);
        array(&mut layout, "VTKHDF/PointData/shape_tensor", Kind::F64, total, 9);
    }
    let writer = Writer::create(comm, path, &layout)?;
    write_cells(&writer, "Vertices", first, particles.len() as u64, 1)?;
    let field = Rows { writer: &writer, first };
    field.put("Points", particles, |p| p.position)?;
    field.put("PointData/id", particles, |p| [p.id])?;
    field.put("PointData/species", particles, |p| [p.species])?;
    field.put("PointData/radius", particles, |p| [p.radius])?;
    field.put("PointData/orientation", particles, |p| p.orientation)?;
    field.put("PointData/velocity", particles, |p| p.velocity)?;
    field.put("PointData/angular_velocity", particles, |p| p.angular_velocity)?;
    field.put("PointData/stress_trace", particles, |p| [p.stress_trace])?;
    field.put("PointData/coordination", particles, |p| [p.coordination])?;
    if ellipsoids {
        field.put("PointData/semi_axes", particles, |p| p.semi_axes)?;
        field.put("PointData/shape_tensor", particles, shape_tensor)?;
    }
    writer.finish()?.publish().map(|_| ())
}

/// `R diag(a, b, c) Rᵀ` \[m\], row by row: its eigenvectors are the axes of the body, its eigenvalues the
/// semi-axes, which is what glyphs of tensors draw.
fn shape_tensor(particle: &SnapshotParticle) -> [f64; 9] {
    let (rotation, axes) = (rotation_matrix(particle.orientation), particle.semi_axes);
    let entry = |i: usize, j: usize| {
        let term = |k: usize| axes[k] * rotation[i][k] * rotation[j][k];
        term(0) + term(1) + term(2)
    };
    std::array::from_fn(|n| entry(n / 3, n % 3))
}

/// Contacts as lines from centre to centre with arrays on the cells. Collective.
///
/// # Errors
/// As [`write_particles`].
pub(super) fn write_contacts(
    comm: &Communicator,
    path: &Path,
    moment: &Moment,
    input: &SnapshotContacts,
) -> Result<()> {
    let contacts = &input.contacts;
    let own = contacts.len() as u64;
    let mut counts = [own as i64];
    comm.sum_i64(&mut counts);
    let total = counts[0] as u64;
    let first = comm.exclusive_sum(own);
    let mut layout = frame(moment, 2 * total, "Lines", total, 2);
    layout.group("VTKHDF/CellData");
    for (name, kind, columns) in [
        ("low", Kind::U32, 1),
        ("high", Kind::U32, 1),
        ("shift", Kind::I32, 3),
        ("force", Kind::F64, 3),
        ("normal_force", Kind::F64, 1),
        ("overlap", Kind::F64, 1),
    ] {
        array(&mut layout, &format!("VTKHDF/CellData/{name}"), kind, total, columns);
    }
    let memory_names = memory_names(&input.columns, input.width);
    for name in &memory_names {
        array(&mut layout, &format!("VTKHDF/CellData/{name}"), Kind::F64, total, 1);
    }
    let writer = Writer::create(comm, path, &layout)?;
    write_cells(&writer, "Lines", first, own, 2)?;
    let ends: Vec<[f64; 3]> = contacts
        .iter()
        .flat_map(|contact| [contact.start, [0, 1, 2].map(|k| contact.start[k] + contact.branch[k])])
        .collect();
    Rows { writer: &writer, first: 2 * first }.put("Points", &ends, |&end| end)?;
    let field = Rows { writer: &writer, first };
    field.put("CellData/low", contacts, |c| [c.key.low])?;
    field.put("CellData/high", contacts, |c| [c.key.high])?;
    field.put("CellData/shift", contacts, |c| [c.key.shift[0], c.key.shift[1], c.key.shift[2]])?;
    field.put("CellData/force", contacts, |c| c.force)?;
    field.put("CellData/normal_force", contacts, |c| [c.normal_force])?;
    field.put("CellData/overlap", contacts, |c| [c.overlap])?;
    for (column, name) in memory_names.iter().enumerate() {
        let values: Vec<f64> = input.memory.iter().skip(column).step_by(input.width).copied().collect();
        writer.write(&format!("VTKHDF/CellData/{name}"), first, &values)?;
    }
    writer.finish()?.publish().map(|_| ())
}

/// Attributes, points, cells and whole-cell values of a file with one kind of cells.
fn frame(moment: &Moment, points: u64, cells_in: &str, cells: u64, points_per_cell: u64) -> Layout {
    let mut layout = Layout::new();
    layout.group("VTKHDF");
    layout.attribute("VTKHDF", "Version", Value::Integers(vec![2, 0]));
    layout.attribute("VTKHDF", "Type", Value::Text("PolyData".to_owned()));
    layout.constant("VTKHDF/NumberOfPoints", Value::Integers(vec![points as i64]));
    layout.table("VTKHDF/Points", Kind::F64, points, 3);
    for kind in CELL_KINDS {
        let count = if kind == cells_in { cells } else { 0 };
        layout.group(&format!("VTKHDF/{kind}"));
        layout.constant(&format!("VTKHDF/{kind}/NumberOfCells"), Value::Integers(vec![count as i64]));
        let entries = count * points_per_cell;
        layout.constant(&format!("VTKHDF/{kind}/NumberOfConnectivityIds"), Value::Integers(vec![entries as i64]));
        if kind == cells_in {
            layout.dataset(&format!("VTKHDF/{kind}/Offsets"), Kind::I64, count + 1);
        } else {
            layout.constant(&format!("VTKHDF/{kind}/Offsets"), Value::Integers(vec![0]));
        }
        layout.dataset(&format!("VTKHDF/{kind}/Connectivity"), Kind::I64, entries);
    }
    layout.group("VTKHDF/FieldData");
    layout.constant(TIME, Value::Reals(vec![moment.time]));
    layout.constant(STEP, Value::Integers(vec![moment.step as i64]));
    layout.constant(SIDES, Value::Reals(moment.sides.to_vec()));
    layout
}

/// The moment that a file shows. One rank.
///
/// # Errors
/// As [`Reader::open`] and [`Reader::read`].
pub(super) fn read_moment(path: &Path) -> Result<Moment> {
    let reader = Reader::open(path)?;
    let (time, step) = (reader.read::<f64>(TIME, 0, 1)?, reader.read::<i64>(STEP, 0, 1)?);
    let sides = reader.read::<f64>(SIDES, 0, 3)?;
    Ok(Moment { step: step[0] as u64, time: time[0], sides: [sides[0], sides[1], sides[2]] })
}

fn array(layout: &mut Layout, path: &str, kind: Kind, rows: u64, columns: u64) {
    match columns {
        1 => layout.dataset(path, kind, rows),
        _ => layout.table(path, kind, rows, columns),
    }
}

/// Every cell has its own points, numbered through.
fn write_cells(writer: &Writer, kind: &str, first: u64, own: u64, points_per_cell: u64) -> Result<()> {
    let numbers = |range: std::ops::Range<u64>, stride: u64| range.map(|n| (n * stride) as i64).collect::<Vec<i64>>();
    // One offset more than cells: the leading zero is the first rank's.
    let begin = if writer.is_first_rank() { 0 } else { first + 1 };
    let offsets = numbers(begin..first + own + 1, points_per_cell);
    writer.write(&format!("VTKHDF/{kind}/Offsets"), begin, &offsets)?;
    let connectivity = numbers(first * points_per_cell..(first + own) * points_per_cell, 1);
    writer.write(&format!("VTKHDF/{kind}/Connectivity"), first * points_per_cell, &connectivity)
}

/// Writes arrays that begin at the same row.
struct Rows<'a> {
    writer: &'a Writer,
    first: u64,
}

impl Rows<'_> {
    fn put<S, T: Scalar, const N: usize>(&self, name: &str, items: &[S], row: impl Fn(&S) -> [T; N]) -> Result<()> {
        let values: Vec<T> = items.iter().flat_map(row).collect();
        self.writer.write(&format!("VTKHDF/{name}"), self.first, &values)
    }
}

/// Array names of the memory columns: that of the law where all pairs of materials agree, else the number.
fn memory_names(columns: &[Vec<Column>], width: usize) -> Vec<String> {
    (0..width)
        .map(|index| {
            let names: BTreeSet<&str> =
                columns.iter().filter_map(|pair| pair.get(index)).map(|column| column.name.as_str()).collect();
            match names.first() {
                Some(name) if names.len() == 1 => format!("memory_{name}"),
                _ => format!("memory_{index}"),
            }
        })
        .collect()
}
