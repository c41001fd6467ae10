//! The header before the HDF5 data: `dem-mpi checkpoint 1 BYTES CHECKSUM`. It tells truncated,
//! damaged and foreign files from good ones before the HDF5 library, which does not survive every
//! damage, reads a byte of them.

use super::{FORMAT, fault};
use crate::error::Result;
use crate::exchange::{Communicator, agree};
use crate::output::digest::sum_over_ranks;
use crate::output::files::io_error;
use std::fs::{File, OpenOptions};
use std::io::Read;
use std::os::unix::fs::FileExt;
use std::path::Path;
use xxhash_rust::xxh3::Xxh3;

/// Bytes before the HDF5 data.
pub(super) const HEADER_BYTES: usize = 512;
const BLOCK_BYTES: u64 = 1 << 20;
const MAGIC: &str = "dem-mpi checkpoint ";

/// Write the header of a complete file. Collective.
///
/// # Errors
/// [`crate::error::Error::File`] on every rank when the file cannot be read back or written.
pub(super) fn seal(comm: &Communicator, path: &Path) -> Result<()> {
    let (bytes, own) = agree(comm, own_part(comm, path).map_err(|error| io_error(path, "read back the file", &error)))?;
    let checksum = sum_over_ranks(comm, own);
    let written = if comm.rank() == 0 { write_header(path, bytes, checksum) } else { Ok(()) };
    agree(comm, written.map_err(|error| io_error(path, "write the checksum", &error)))
}

/// Check that a file is a checkpoint, whole and undamaged. Collective.
///
/// # Errors
/// [`crate::error::Error::Checkpoint`] on every rank.
pub(super) fn verify(comm: &Communicator, path: &Path) -> Result<()> {
    let (bytes, expected) = agree(comm, read_header(path))?;
    let part = own_part(comm, path).map_err(|error| fault(path, format!("cannot be read: {error}")));
    let (found_bytes, own) = agree(comm, part)?;
    if found_bytes != bytes {
        let (what, remedy) = if found_bytes < bytes {
            ("truncated", String::new())
        } else {
            ("too long", format!(", or cut off what was appended (truncate --size={bytes})"))
        };
        let reason = format!("{what}: {found_bytes} bytes instead of {bytes}; use an older checkpoint{remedy}");
        return Err(fault(path, reason));
    }
    let found = sum_over_ranks(comm, own);
    if found != expected {
        let reason = format!("damaged: checksum {found:032x} instead of {expected:032x}; use an older checkpoint");
        return Err(fault(path, reason));
    }
    Ok(())
}

fn write_header(path: &Path, bytes: u64, checksum: u128) -> std::io::Result<()> {
    let mut header = format!("{MAGIC}{FORMAT} {bytes} {checksum:032x}\n").into_bytes();
    header.resize(HEADER_BYTES, 0);
    OpenOptions::new().write(true).open(path)?.write_all_at(&header, 0)
}

/// Length and checksum that the header promises.
fn read_header(path: &Path) -> Result<(u64, u128)> {
    let mut header = Vec::new();
    File::open(path)
        .and_then(|file| file.take(HEADER_BYTES as u64).read_to_end(&mut header))
        .map_err(|error| fault(path, format!("cannot be opened: {error}; check the path")))?;
    let foreign = || fault(path, "not a dem-mpi checkpoint; give a checkpoint-STEP.h5 file or a run directory");
    let line = header.split(|&byte| byte == b'\n').next().and_then(|line| std::str::from_utf8(line).ok());
    let words = line.and_then(|line| line.strip_prefix(MAGIC)).ok_or_else(foreign)?;
    let words: Vec<&str> = words.split(' ').collect();
    if words.first().is_some_and(|&version| version != FORMAT) {
        let reason = format!(
            "format version {} where this program reads version {FORMAT}; restart with the program that wrote it",
            words[0]
        );
        return Err(fault(path, reason));
    }
    let parsed = match words[..] {
        [_, bytes, checksum] => bytes.parse().ok().zip(u128::from_str_radix(checksum, 16).ok()),
        _ => None,
    };
    parsed.ok_or_else(|| fault(path, "damaged: its header cannot be read; use an older checkpoint"))
}

/// Length of the file, and this rank's share of the checksum: every size-th block after the header.
fn own_part(comm: &Communicator, path: &Path) -> std::io::Result<(u64, u128)> {
    let file = File::open(path)?;
    let bytes = file.metadata()?.len();
    let blocks = bytes.saturating_sub(HEADER_BYTES as u64).div_ceil(BLOCK_BYTES);
    let mut buffer = vec![0; BLOCK_BYTES as usize];
    let mut sum = 0u128;
    for block in (comm.rank() as u64..blocks).step_by(comm.size()) {
        let start = HEADER_BYTES as u64 + block * BLOCK_BYTES;
        let length = BLOCK_BYTES.min(bytes - start) as usize;
        file.read_exact_at(&mut buffer[..length], start)?;
        let mut hasher = Xxh3::with_seed(block);
        hasher.update(&buffer[..length]);
        sum = sum.wrapping_add(hasher.digest128());
    }
    Ok((bytes, sum))
}
