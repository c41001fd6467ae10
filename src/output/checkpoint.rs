//! Checkpoints: everything needed to go on bit for bit, in one file per checkpoint. Particles in id
//! order, contacts in key order, so that the file is the same for any number of ranks. A header
//! before the HDF5 data holds a checksum of all that follows, checked before HDF5 sees the file.

mod seal;

use super::digest::{Digest, digest};
use super::files::io_error;
use super::hdf5_file::{Kind, Layout, Reader, Value, Writer};
use crate::error::{Error, Result};
use crate::exchange::{Communicator, agree, redistribute};
use crate::force::law::Column;
use crate::state::{ContactKey, ContactMemory, GlobalState, LEDGER, ParticleState};
use bytemuck::Zeroable;
use std::fs;
use std::path::{Path, PathBuf};

/// Version of the format: raised when older programs could not read the file.
const FORMAT: &str = "3";

/// The part of a checkpoint that one rank has read.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// Global state, the same on all ranks.
    pub global: GlobalState,
    /// Particles of this rank's block of ids, sorted by id.
    pub particles: Vec<ParticleState>,
    /// Contacts whose low id lies in this rank's block, sorted by key.
    pub memory: ContactMemory,
    /// Name and unit of each memory column of each pair of materials.
    pub columns: Vec<Vec<[String; 2]>>,
    /// The resolved input of the run that wrote it.
    pub config_resolved: String,
    /// Digest of the whole state.
    pub digest: Digest,
}

/// The newest valid checkpoint of a run directory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Latest {
    /// The file.
    pub path: PathBuf,
    /// One line per newer checkpoint that had to be passed over.
    pub warnings: Vec<String>,
}

/// Write `checkpoint-STEP.h5` and then delete all but the newest `keep` up to this step. Collective;
/// every rank passes its owned particles and the contacts whose low id it owns, in any order.
/// `columns` holds the memory columns of each pair of materials.
///
/// # Errors
/// On every rank: [`Error::File`] when the disk has no room or cannot be written (no file remains
/// then); [`Error::Simulation`] when the global state holds a value that is not finite, or an id is
/// missing, doubled or too large.
#[allow(clippy::too_many_arguments)]
pub fn write(
    comm: &Communicator,
    directory: &Path,
    config_resolved: &str,
    columns: &[Vec<Column>],
    global: &GlobalState,
    particles: Vec<ParticleState>,
    memory: ContactMemory,
    keep: usize,
) -> Result<PathBuf> {
    let json = global_json(global)?;
    let columns = serde_json::to_string(&named(columns)).unwrap_or_default();
    let (first, particles) = redistribute::to_id_blocks(comm, global.particles, particles, global.step)?;
    let memory = redistribute::memory_to_id_blocks(comm, global.particles, &memory, global.step)?;
    let digest = digest(comm, global, &particles, &memory);
    let mut counts = [memory.keys.len() as i64];
    comm.sum_i64(&mut counts);
    let first_row = comm.exclusive_sum(memory.keys.len() as u64);

    let mut layout = Layout::new();
    layout.user_block(seal::HEADER_BYTES as u64);
    for (name, text) in [
        ("format", "dem-mpi checkpoint"),
        ("format_version", FORMAT),
        ("program_version", env!("CARGO_PKG_VERSION")),
        ("digest", &digest.to_string()),
        ("global_state", &json),
    ] {
        layout.attribute("/", name, Value::Text(text.to_owned()));
    }
    layout.constant("/config_resolved", Value::Text(config_resolved.to_owned()));
    layout.constant("/memory_columns", Value::Text(columns));
    lay_out_particles(&mut layout, global.particles);
    lay_out_contacts(&mut layout, counts[0] as u64, memory.width as u64);

    let path = path_in(directory, global.step);
    let writer = Writer::create(comm, &path, &layout)?;
    write_particles(&writer, first, &particles)?;
    write_contacts(&writer, first_row, &memory)?;
    let finished = writer.finish()?;
    if let Err(error) = seal::seal(comm, finished.temporary()) {
        finished.discard();
        return Err(error);
    }
    let path = finished.publish()?;
    let pruned = if comm.rank() == 0 { prune(directory, global.step, keep) } else { Ok(()) };
    agree(comm, pruned)?;
    Ok(path)
}

/// The newest valid checkpoint of a run directory before this step (`None`: of all). A newer one that is damaged is passed
/// over with a warning. Collective.
///
/// # Errors
/// [`Error::Checkpoint`] on every rank when there is none that can be used.
pub fn latest(comm: &Communicator, directory: &Path, before: Option<u64>) -> Result<Latest> {
    let found = if comm.rank() == 0 { steps(directory) } else { Ok(Vec::new()) };
    let mut found = agree(comm, found)?;
    found.retain(|step| before.is_none_or(|before| *step < before));
    let mut bytes: Vec<u8> = found.iter().flat_map(|step| step.to_le_bytes()).collect();
    comm.broadcast(0, &mut bytes);
    let mut warnings = Vec::new();
    for step in bytes.chunks_exact(8).rev() {
        let step = step.iter().rev().fold(0u64, |value, &byte| value << 8 | u64::from(byte));
        let path = path_in(directory, step);
        match seal::verify(comm, &path) {
            Ok(()) => return Ok(Latest { path, warnings }),
            Err(error) => warnings.push(format!("passed over: {error}")),
        }
    }
    let reason = if warnings.is_empty() {
        "no checkpoint-STEP.h5 in this folder; give the directory of a run that has written one".to_owned()
    } else {
        format!("no checkpoint in this folder can be used: {}", warnings.join("; "))
    };
    Err(fault(directory, reason))
}

/// Read a checkpoint: every rank its block of ids (and of low ids of contacts). Collective. The file's
/// checksum and the state's digest are verified.
///
/// # Errors
/// [`Error::Checkpoint`] on every rank when the file is damaged, truncated, not a checkpoint, or of
/// another format version.
pub fn read(comm: &Communicator, path: &Path) -> Result<Checkpoint> {
    seal::verify(comm, path)?;
    let part = agree(comm, read_block(comm, path).map_err(|error| as_checkpoint_error(path, error)))?;
    let found = digest(comm, &part.global, &part.particles, &part.memory);
    if found != part.digest {
        let reason = format!(
            "its contents have the digest {found} but it says {}; the file is damaged, use an older checkpoint",
            part.digest
        );
        return Err(fault(path, reason));
    }
    Ok(part)
}

/// Digest of the latest state of a run directory, or of one checkpoint file. One process. The state is
/// read and its digest computed anew.
///
/// # Errors
/// As [`latest`] and [`read`].
pub fn digest_of(path: &Path) -> Result<Digest> {
    let comm = Communicator::single();
    let file = if path.is_dir() { latest(&comm, path, None)?.path } else { path.to_path_buf() };
    Ok(read(&comm, &file)?.digest)
}

/// Delete the checkpoints of later steps: after a restart from `step` they belong to a future that is
/// computed anew. Rank 0 only.
///
/// # Errors
/// [`Error::File`] when one cannot be deleted.
pub fn discard_after(directory: &Path, step: u64) -> Result<()> {
    for later in steps(directory)?.into_iter().filter(|&found| found > step) {
        remove(&path_in(directory, later))?;
    }
    Ok(())
}

/// Path of the checkpoint of a step in a run directory.
#[must_use]
pub fn path_in(directory: &Path, step: u64) -> PathBuf {
    directory.join(file_name(step))
}

fn file_name(step: u64) -> String {
    format!("checkpoint-{step:012}.h5")
}

/// Steps of the checkpoints in a folder, ascending.
fn steps(directory: &Path) -> Result<Vec<u64>> {
    let entries = fs::read_dir(directory).map_err(|error| io_error(directory, "read the folder", &error))?;
    let mut steps: Vec<u64> = entries
        .filter_map(|entry| {
            let name = entry.ok()?.file_name();
            let step = name.to_str()?.strip_prefix("checkpoint-")?.strip_suffix(".h5")?.parse().ok()?;
            (name.to_str() == Some(&file_name(step))).then_some(step)
        })
        .collect();
    steps.sort_unstable();
    Ok(steps)
}

/// Keep the newest `keep` checkpoints up to `step`, the one just written among them.
fn prune(directory: &Path, step: u64, keep: usize) -> Result<()> {
    let older: Vec<u64> = steps(directory)?.into_iter().filter(|&found| found < step).collect();
    let surplus = (older.len() + 1).saturating_sub(keep.max(1));
    for &old in older.iter().take(surplus) {
        remove(&path_in(directory, old))?;
    }
    remove_unfinished(directory)
}

/// What a kill during a write has left; nobody is writing now.
fn remove_unfinished(directory: &Path) -> Result<()> {
    let entries = fs::read_dir(directory).map_err(|error| io_error(directory, "read the folder", &error))?;
    for entry in entries.flatten() {
        let name = entry.file_name();
        if name.to_str().is_some_and(|name| name.starts_with("checkpoint-") && name.ends_with(".h5.part")) {
            remove(&entry.path())?;
        }
    }
    Ok(())
}

fn remove(path: &Path) -> Result<()> {
    fs::remove_file(path).map_err(|error| io_error(path, "delete the old checkpoint", &error))
}

fn fault(path: &Path, message: impl Into<String>) -> Error {
    Error::Checkpoint { path: path.to_path_buf(), message: message.into() }
}

fn as_checkpoint_error(path: &Path, error: Error) -> Error {
    match error {
        Error::File { message, .. } => fault(path, message),
        other => other,
    }
}

fn global_json(global: &GlobalState) -> Result<String> {
    let json = serde_json::to_string(global).unwrap_or_default();
    // JSON has no infinities and no NaN: what does not read back the same is one of them.
    match serde_json::from_str::<GlobalState>(&json) {
        Ok(back) if back == *global => Ok(json),
        _ => Err(Error::Simulation {
            step: global.step,
            message: format!("the global state holds a value that is not finite: {global:?}; lower the time step"),
        }),
    }
}

/// Name and unit of each memory column of each pair of materials, as a checkpoint holds them.
#[must_use]
pub fn named(columns: &[Vec<Column>]) -> Vec<Vec<[String; 2]>> {
    let name = |column: &Column| [column.name.clone(), column.unit.to_owned()];
    columns.iter().map(|pair| pair.iter().map(name).collect()).collect()
}

/// Calls the macro `$do!(field, number type, columns)` for each particle field.
macro_rules! for_each_particle_field {
    ($do:ident) => {
        $do!(id, u32, 1);
        $do!(species, u32, 1);
        $do!(position, f64, 3);
        $do!(radius, f64, 1);
        $do!(semi_axes, f64, 3);
        $do!(velocity, f64, 3);
        $do!(full_velocity, f64, 3);
        $do!(spin, f64, 3);
        $do!(full_spin, f64, 3);
        $do!(orientation, f64, 4);
        $do!(ledger, f64, LEDGER.len());
        $do!(image, i32, 3);
    };
}

fn field_path(name: &str) -> String {
    format!("particles/{name}")
}

fn lay_out_particles(layout: &mut Layout, total: u64) {
    use super::hdf5_file::Scalar;
    layout.group("particles");
    macro_rules! lay_out {
        ($field:ident, $number:ty, $columns:expr) => {
            match $columns {
                1 => layout.dataset(&field_path(stringify!($field)), <$number>::KIND, total),
                columns => layout.table(&field_path(stringify!($field)), <$number>::KIND, total, columns as u64),
            }
        };
    }
    for_each_particle_field!(lay_out);
}

fn write_particles(writer: &Writer, first: u64, particles: &[ParticleState]) -> Result<()> {
    macro_rules! write_field {
        ($field:ident, $number:ty, $columns:expr) => {
            let rows: Vec<_> = particles.iter().map(|particle| particle.$field).collect();
            writer.write::<$number>(&field_path(stringify!($field)), first, bytemuck::cast_slice(&rows))?;
        };
    }
    for_each_particle_field!(write_field);
    Ok(())
}

fn read_particles(reader: &Reader, first: u64, count: u64) -> Result<Vec<ParticleState>> {
    let mut particles = vec![ParticleState::zeroed(); count as usize];
    macro_rules! read_field {
        ($field:ident, $number:ty, $columns:expr) => {
            let path = field_path(stringify!($field));
            check_columns(reader, &path, $columns as u64)?;
            let values = reader.read::<$number>(&path, first, count)?;
            for (particle, row) in particles.iter_mut().zip(values.chunks_exact($columns)) {
                bytemuck::bytes_of_mut(&mut particle.$field).copy_from_slice(bytemuck::cast_slice(row));
            }
        };
    }
    for_each_particle_field!(read_field);
    Ok(particles)
}

fn check_columns(reader: &Reader, path: &str, wanted: u64) -> Result<()> {
    match reader.columns(path)? {
        found if found == wanted => Ok(()),
        found => Err(fault(Path::new(path), format!("{found} columns instead of {wanted}"))),
    }
}

fn lay_out_contacts(layout: &mut Layout, rows: u64, width: u64) {
    layout.group("contacts");
    layout.dataset("contacts/low", Kind::U32, rows);
    layout.dataset("contacts/high", Kind::U32, rows);
    layout.table("contacts/shift", Kind::I32, rows, 3);
    layout.table("contacts/memory", Kind::F64, rows, width);
}

fn write_contacts(writer: &Writer, first: u64, memory: &ContactMemory) -> Result<()> {
    let low: Vec<u32> = memory.keys.iter().map(|key| key.low).collect();
    let high: Vec<u32> = memory.keys.iter().map(|key| key.high).collect();
    let shift: Vec<i32> = memory.keys.iter().flat_map(|key| [key.shift[0], key.shift[1], key.shift[2]]).collect();
    writer.write("contacts/low", first, &low)?;
    writer.write("contacts/high", first, &high)?;
    writer.write("contacts/shift", first, &shift)?;
    writer.write("contacts/memory", first, &memory.values)
}

/// Contacts with `start ≤ low id < end`.
fn read_contacts(reader: &Reader, start: u64, end: u64) -> Result<ContactMemory> {
    let first = first_row_from(reader, start)?;
    let count = first_row_from(reader, end)? - first;
    let width = reader.columns("contacts/memory")?;
    let low = reader.read::<u32>("contacts/low", first, count)?;
    let high = reader.read::<u32>("contacts/high", first, count)?;
    let shift = reader.read::<i32>("contacts/shift", first, count)?;
    let keys = low
        .iter()
        .zip(&high)
        .zip(shift.chunks_exact(3))
        .map(|((&low, &high), s)| ContactKey { low, high, shift: [s[0], s[1], s[2], 0] })
        .collect();
    let values = if width == 0 { Vec::new() } else { reader.read::<f64>("contacts/memory", first, count)? };
    Ok(ContactMemory { keys, width: width as usize, values })
}

/// First row whose low id is at least `id`, by bisection in the file.
fn first_row_from(reader: &Reader, id: u64) -> Result<u64> {
    let (mut begin, mut end) = (0, reader.rows("contacts/low")?);
    while begin < end {
        let middle = begin + (end - begin) / 2;
        let low = reader.read::<u32>("contacts/low", middle, 1)?;
        if low.first().is_some_and(|&low| u64::from(low) < id) {
            begin = middle + 1;
        } else {
            end = middle;
        }
    }
    Ok(begin)
}

fn read_block(comm: &Communicator, path: &Path) -> Result<Checkpoint> {
    let reader = Reader::open(path)?;
    let version = reader.attribute("/", "format_version")?;
    if version != FORMAT {
        let written_by = reader.attribute("/", "program_version")?;
        let reason = format!(
            "format version {version}, written by dem-mpi {written_by}; this program reads version {FORMAT}: \
             restart with the program version that wrote it"
        );
        return Err(fault(path, reason));
    }
    let global: GlobalState = serde_json::from_str(&reader.attribute("/", "global_state")?)
        .map_err(|error| fault(path, format!("its global state cannot be read: {error}")))?;
    let digest = reader.attribute("/", "digest")?.parse().map_err(|error: String| fault(path, error))?;
    let rows = reader.rows("particles/id")?;
    if rows != global.particles {
        return Err(fault(path, format!("it holds {rows} particles but says {}", global.particles)));
    }
    let [start, end] = [0, 1].map(|next| redistribute::block_start(comm.rank() + next, rows, comm.size()));
    // Contacts between walls and particles have their low id among the particles: none lies beyond.
    let particles = read_particles(&reader, start, end - start)?;
    let memory = read_contacts(&reader, start, end)?;
    let columns = serde_json::from_str(&reader.text("/memory_columns")?)
        .map_err(|error| fault(path, format!("its memory columns cannot be read: {error}")))?;
    Ok(Checkpoint { global, particles, memory, columns, config_resolved: reader.text("/config_resolved")?, digest })
}

#[cfg(test)]
mod tests;
