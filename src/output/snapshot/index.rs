//! Names of snapshot files and the two time indices beside them: the JSON series that ParaView opens
//! and the XDMF sidecar for older readers. Both are replaced atomically.

use super::Moment;
use crate::error::{Error, Result};
use crate::output::files::{io_error, write_atomically};
use serde_json::{Value, json};
use std::fmt::Write;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

pub(super) fn particle_file(number: usize) -> String {
    format!("particles-{number:06}.vtkhdf")
}

pub(super) fn contact_file(number: usize) -> String {
    format!("contacts-{number:06}.vtkhdf")
}

pub(super) fn dump_file(number: usize) -> String {
    format!("particles-{number:06}.dump")
}

/// Number of a snapshot file, complete or not; `None` for other files.
pub(super) fn number_of(name: &str) -> Option<usize> {
    let name = name.strip_suffix(".part").unwrap_or(name);
    let name = name.strip_suffix(".vtkhdf").or_else(|| name.strip_suffix(".dump"))?;
    let digits = name.strip_prefix("particles-").or_else(|| name.strip_prefix("contacts-"))?;
    digits.parse().ok()
}

fn series_name(kind: &str) -> String {
    format!("{kind}.vtkhdf.series")
}

/// What tells the snapshots apart in the indices: their times \[s\], or, if any two share one (in quasi-static
/// stages time stands still), the steps of all.
pub(super) fn times(moments: &[Moment]) -> Vec<f64> {
    let distinct = moments.windows(2).all(|pair| pair[1].time > pair[0].time);
    moments.iter().map(|moment| if distinct { moment.time } else { moment.step as f64 }).collect()
}

/// Index of all snapshots of a kind.
///
/// # Errors
/// [`Error::File`] when it cannot be written.
pub(super) fn write_series(folder: &Path, kind: &str, times: &[f64], name: fn(usize) -> String) -> Result<()> {
    let files: Vec<Value> =
        times.iter().enumerate().map(|(number, time)| json!({"name": name(number), "time": time})).collect();
    let text = format!("{:#}\n", json!({"file-series-version": "1.0", "files": files}));
    write_atomically(&folder.join(series_name(kind)), text.as_bytes())
}

/// What to do where snapshots are missing.
const REMEDY: &str = "put the files of that run back, restart from an older checkpoint, or leave out output.snapshots to go on without any";

/// That the index lists at least `count` snapshots, and that these are there.
///
/// # Errors
/// [`Error::File`] when it cannot be read or holds fewer, or a snapshot is missing.
pub(super) fn check_length(folder: &Path, count: usize) -> Result<()> {
    if count == 0 {
        return Ok(());
    }
    let path = folder.join(series_name("particles"));
    let index: Value = match fs::read_to_string(&path) {
        Ok(text) => serde_json::from_str(&text).unwrap_or_default(),
        Err(error) if error.kind() == ErrorKind::NotFound => Value::Null,
        Err(error) => return Err(io_error(&path, "read the index of snapshots", &error)),
    };
    let listed = index["files"].as_array().map_or(0, Vec::len);
    if listed < count {
        let message = format!("lists {listed} snapshots where the checkpoint has written {count}; {REMEDY}");
        return Err(Error::File { path, message });
    }
    match (0..count).map(|number| folder.join(particle_file(number))).find(|path| !path.exists()) {
        Some(path) => Err(Error::File { path, message: format!("is missing, though the index lists it; {REMEDY}") }),
        None => Ok(()),
    }
}

/// Cut the existing indices down to these snapshots.
///
/// # Errors
/// [`Error::File`] when one cannot be replaced or removed.
pub(super) fn keep_first(folder: &Path, times: &[f64]) -> Result<()> {
    for (kind, name) in [("particles", particle_file as fn(usize) -> String), ("contacts", contact_file)] {
        let path = folder.join(series_name(kind));
        if times.is_empty() && path.exists() {
            fs::remove_file(&path).map_err(|error| io_error(&path, "delete the old index", &error))?;
        } else if path.exists() {
            write_series(folder, kind, times, name)?;
        }
    }
    let path = folder.join("particles.xmf");
    match fs::read_to_string(&path) {
        Ok(_) if times.is_empty() => {
            fs::remove_file(&path).map_err(|error| io_error(&path, "delete the old index", &error))
        }
        Ok(text) => write_atomically(&path, first_grids(&text, times).as_bytes()),
        Err(_) => Ok(()),
    }
}

const GRID_END: &str = "      </Grid>\n";
const TAIL: &str = "    </Grid>\n  </Domain>\n</Xdmf>\n";

const TIME: &str = "        <Time ";

/// The sidecar with only its first grids, at these times.
fn first_grids(text: &str, times: &[f64]) -> String {
    let end = text.match_indices(GRID_END).nth(times.len() - 1).map_or(0, |(at, _)| at + GRID_END.len());
    let mut times = times.iter();
    let lines = text[..end].lines().map(|line| match times.as_slice() {
        [time, ..] if line.starts_with(TIME) => {
            times.next();
            format!("{TIME}Value=\"{time:?}\"/>\n")
        }
        _ => format!("{line}\n"),
    });
    lines.chain([TAIL.to_owned()]).collect()
}

/// XDMF over the same datasets.
///
/// # Errors
/// [`Error::File`] when it cannot be written.
pub(super) fn write_xdmf(folder: &Path, times: &[f64], total: u64, ellipsoids: bool) -> Result<()> {
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n<Xdmf Version=\"3.0\">\n  <Domain>\n    \
         <Grid Name=\"particles\" GridType=\"Collection\" CollectionType=\"Temporal\">\n",
    );
    for (number, &time) in times.iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = write_grid(&mut text, &particle_file(number), time, total, ellipsoids);
    }
    text.push_str(TAIL);
    write_atomically(&folder.join("particles.xmf"), text.as_bytes())
}

fn write_grid(text: &mut String, file: &str, time: f64, total: u64, ellipsoids: bool) -> std::fmt::Result {
    writeln!(text, "      <Grid Name=\"{file}\" GridType=\"Uniform\">")?;
    writeln!(text, "{TIME}Value=\"{time:?}\"/>")?;
    writeln!(
        text,
        "        <Topology TopologyType=\"Polyvertex\" NumberOfElements=\"{total}\" NodesPerElement=\"1\"/>"
    )?;
    let item = |number: &str, columns: u64, path: &str| {
        let dimensions = if columns == 1 { total.to_string() } else { format!("{total} {columns}") };
        let precision = if number == "UInt" { 4 } else { 8 };
        format!(
            "<DataItem Dimensions=\"{dimensions}\" NumberType=\"{number}\" Precision=\"{precision}\" \
             Format=\"HDF\">{file}:/VTKHDF/{path}</DataItem>"
        )
    };
    writeln!(text, "        <Geometry GeometryType=\"XYZ\">{}</Geometry>", item("Float", 3, "Points"))?;
    let shapes = [("semi_axes", "Vector", "Float", 3), ("shape_tensor", "Tensor", "Float", 9)];
    for (name, kind, number, columns) in [
        ("id", "Scalar", "UInt", 1),
        ("species", "Scalar", "UInt", 1),
        ("radius", "Scalar", "Float", 1),
        ("orientation", "Matrix", "Float", 4),
        ("velocity", "Vector", "Float", 3),
        ("angular_velocity", "Vector", "Float", 3),
        ("stress_trace", "Scalar", "Float", 1),
        ("coordination", "Scalar", "UInt", 1),
    ]
    .into_iter()
    .chain(shapes.into_iter().filter(|_| ellipsoids))
    {
        let item = item(number, columns, &format!("PointData/{name}"));
        writeln!(
            text,
            "        <Attribute Name=\"{name}\" AttributeType=\"{kind}\" Center=\"Node\">{item}</Attribute>"
        )?;
    }
    text.push_str(GRID_END);
    Ok(())
}
