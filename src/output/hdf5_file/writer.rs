//! Collective writing. Rank 0 lays the file out under a temporary name and reserves its space on the
//! disk; all ranks agree; then all ranks open it and write their rows together.
//!
//! Why so: on a full disk every parallel HDF5 write hung inside the MPI library's I/O, so the space
//! must be certain before the first parallel call. And a structure made by one rank gives the same
//! bytes for any number of ranks.

use super::{Entry, Kind, Layout, Scalar, Value};
use crate::error::{Error, Result};
use crate::exchange::{Communicator, agree};
use crate::output::files::{create_folder, io_error, publish, temporary_name};
use hdf5::dataset::{AllocTime, DatasetBuilder, FillTime};
use hdf5::types::TypeDescriptor;
use hdf5_sys::h5p::{H5Pclose, H5Pcreate};
use hdf5_sys::{h5a, h5d, h5i::hid_t, h5s};
use std::fs::{self, File, OpenOptions};
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::ptr::null;

/// A file being written by all ranks.
pub struct Writer {
    comm: Communicator,
    path: PathBuf,
    temporary: PathBuf,
    file: hdf5::File,
}

/// A file that is complete but still has its temporary name.
pub struct Finished {
    comm: Communicator,
    path: PathBuf,
    temporary: PathBuf,
}

impl Writer {
    /// Lay out the file that will be called `path` and open it on all ranks. Collective; `layout` is
    /// the same on all ranks.
    ///
    /// # Errors
    /// [`Error::File`] on every rank when the folder cannot be written or the disk has no room; no
    /// file remains then.
    pub fn create(comm: &Communicator, path: &Path, layout: &Layout) -> Result<Self> {
        let temporary = temporary_name(path);
        let laid_out = if comm.rank() == 0 { lay_out(path, &temporary, layout) } else { Ok(()) };
        let agreed = agree(comm, laid_out);
        if agreed.is_err() && comm.rank() == 0 {
            // The reason is already known; what is left of the part file must not fill the disk.
            let _ = fs::remove_file(&temporary);
        }
        agreed?;
        match open_on_all_ranks(comm, &temporary) {
            Ok(file) => Ok(Self { comm: comm.clone(), path: path.to_path_buf(), temporary, file }),
            Err(error) => Err(give_up(comm, path, &temporary, "open the file for writing", &error)),
        }
    }

    /// This is rank 0, which also writes what belongs to no rank's rows.
    #[must_use]
    pub fn is_first_rank(&self) -> bool {
        self.comm.rank() == 0
    }

    /// Write this rank's rows of a dataset, beginning at row `start`. Collective, in the same order of
    /// datasets on all ranks; a rank may have no rows.
    ///
    /// # Errors
    /// [`Error::File`] with one rank; with several, an HDF5 error ends the program (it may be known to
    /// one rank alone while the others already wait in the MPI library).
    pub fn write<T: Scalar>(&self, dataset: &str, start: u64, values: &[T]) -> Result<()> {
        self.write_rows(dataset, start, values)
            .map_err(|error| give_up(&self.comm, &self.path, &self.temporary, &format!("write `{dataset}`"), &error))
    }

    /// Close the file on all ranks and sync it. Collective.
    ///
    /// # Errors
    /// As [`Writer::write`]; and [`Error::File`] on every rank when the disk refuses the data.
    pub fn finish(self) -> Result<Finished> {
        let Self { comm, path, temporary, file } = self;
        if let Err(error) = file.flush().and_then(|()| file.close()) {
            return Err(give_up(&comm, &path, &temporary, "close the file", &error));
        }
        comm.barrier();
        Ok(Finished { comm, path, temporary })
    }

    fn write_rows<T: Scalar>(&self, name: &str, start: u64, values: &[T]) -> hdf5::Result<()> {
        let dataset = self.file.dataset(name)?;
        let shape: Vec<u64> = dataset.shape().iter().map(|&extent| extent as u64).collect();
        let columns: u64 = shape.iter().skip(1).product();
        if shape.iter().product::<u64>() == 0 {
            return Ok(());
        }
        let mut count = shape.clone();
        count[0] = values.len() as u64 / columns.max(1);
        assert_eq!(count.iter().product::<u64>(), values.len() as u64, "whole rows of `{name}`");
        let mut offset = vec![0; shape.len()];
        offset[0] = start;
        let number = hdf5::Datatype::from_type::<T>()?;
        hdf5::sync::sync(|| {
            let selection = Selection::new(&shape, &offset, &count)?;
            let transfer = transfer_properties(self.comm.size() > 1)?;
            // SAFETY: all identifiers are open; the memory space describes exactly `values`, whose
            // type is `number`. Raw because the safe interface has no collective transfer.
            let status = unsafe {
                h5d::H5Dwrite(
                    dataset.id(),
                    number.id(),
                    selection.memory,
                    selection.file,
                    transfer,
                    values.as_ptr().cast(),
                )
            };
            let result = hdf5::h5check(status).map(|_| ());
            // SAFETY: `transfer` came from H5Pcreate and is closed once.
            unsafe { H5Pclose(transfer) };
            result
        })
    }
}

impl Finished {
    /// Where the complete file now is.
    #[must_use]
    pub fn temporary(&self) -> &Path {
        &self.temporary
    }

    /// Sync the file and give it its final name. Collective.
    ///
    /// # Errors
    /// [`Error::File`] on every rank when the disk refuses.
    pub fn publish(self) -> Result<PathBuf> {
        let done = if self.comm.rank() == 0 { self.sync_and_rename() } else { Ok(()) };
        agree(&self.comm, done)?;
        Ok(self.path)
    }

    /// Remove the file instead, after a fault in between. Collective.
    pub fn discard(self) {
        if self.comm.rank() == 0 {
            // A left-over part file does no harm; the fault is reported by the caller.
            let _ = fs::remove_file(&self.temporary);
        }
    }

    fn sync_and_rename(&self) -> Result<()> {
        File::open(&self.temporary)
            .and_then(|file| file.sync_all())
            .map_err(|error| io_error(&self.path, "sync the file", &error))?;
        publish(&self.temporary, &self.path)
    }
}

/// Hyperslabs in memory and in the file, closed on drop.
struct Selection {
    memory: hid_t,
    file: hid_t,
}

impl Selection {
    fn new(shape: &[u64], offset: &[u64], count: &[u64]) -> hdf5::Result<Self> {
        let rank = i32::try_from(shape.len()).unwrap_or(i32::MAX);
        // SAFETY: `shape`, `offset` and `count` hold `rank` numbers each.
        unsafe {
            let file = hdf5::h5check(h5s::H5Screate_simple(rank, shape.as_ptr(), null()))?;
            let memory = hdf5::h5check(h5s::H5Screate_simple(rank, count.as_ptr(), null()))?;
            let spaces = Self { memory, file };
            if count.contains(&0) {
                hdf5::h5check(h5s::H5Sselect_none(file))?;
                hdf5::h5check(h5s::H5Sselect_none(memory))?;
            } else {
                let set = h5s::H5S_seloper_t::H5S_SELECT_SET;
                let (start, extent) = (offset.as_ptr(), count.as_ptr());
                hdf5::h5check(h5s::H5Sselect_hyperslab(file, set, start, null(), extent, null()))?;
            }
            Ok(spaces)
        }
    }
}

impl Drop for Selection {
    fn drop(&mut self) {
        // SAFETY: both were opened in `new` and are closed once.
        unsafe {
            h5s::H5Sclose(self.memory);
            h5s::H5Sclose(self.file);
        }
    }
}

/// Property list of a transfer: collective when several ranks write. Called under the HDF5 lock.
fn transfer_properties(collective: bool) -> hdf5::Result<hid_t> {
    // SAFETY: plain constructors; the caller closes the list.
    unsafe {
        let list = hdf5::h5check(H5Pcreate(*hdf5::globals::H5P_DATASET_XFER))?;
        #[cfg(feature = "mpi")]
        if collective {
            use hdf5_sys::h5p::{H5FD_mpio_xfer_t, H5Pset_dxpl_mpio};
            hdf5::h5check(H5Pset_dxpl_mpio(list, H5FD_mpio_xfer_t::H5FD_MPIO_COLLECTIVE))?;
        }
        #[cfg(not(feature = "mpi"))]
        debug_assert!(!collective, "one process without MPI");
        Ok(list)
    }
}

/// After an HDF5 error. With several ranks: print and end the program, since neither closing the file
/// nor agreeing with ranks that wait inside the MPI library can be relied on.
fn give_up(comm: &Communicator, path: &Path, temporary: &Path, attempt: &str, error: &hdf5::Error) -> Error {
    // Best effort: the message below matters more.
    let _ = fs::remove_file(temporary);
    let fault = Error::File {
        path: path.to_path_buf(),
        message: format!("cannot {attempt}: HDF5 says: {error}; check the file system of the output directory"),
    };
    if comm.size() > 1 {
        eprintln!("error (rank {}): {fault}", comm.rank());
        comm.abort(1);
    }
    fault
}

/// Make the structure and reserve the space. Rank 0 only.
fn lay_out(path: &Path, temporary: &Path, layout: &Layout) -> Result<()> {
    if let Some(folder) = path.parent() {
        create_folder(folder)?;
    }
    // Before HDF5 touches the disk, with an estimate; creating the file frees the space again.
    reserve(path, temporary, layout.size_estimate())?;
    build_structure(temporary, layout).map_err(|error| Error::File {
        path: path.to_path_buf(),
        message: format!("cannot create the file: HDF5 says: {error}; check the disk's free space"),
    })?;
    let size = fs::metadata(temporary).map_err(|error| io_error(path, "measure the new file", &error))?.len();
    reserve(path, temporary, size)
}

/// Make sure that the disk holds `bytes` for the file.
fn reserve(path: &Path, temporary: &Path, bytes: u64) -> Result<()> {
    let file = OpenOptions::new()
        .create(true)
        .truncate(false)
        .write(true)
        .open(temporary)
        .map_err(|error| io_error(path, "create the file", &error))?;
    let length = libc::off_t::try_from(bytes).unwrap_or(libc::off_t::MAX);
    let outcome = loop {
        // SAFETY: the descriptor is open for writing as long as `file` lives.
        match unsafe { libc::posix_fallocate(file.as_raw_fd(), 0, length) } {
            // A signal came in between, as before a time limit: try again.
            libc::EINTR => {}
            code => break code,
        }
    };
    match outcome {
        // Some file systems cannot reserve; the write itself will then tell.
        0 | libc::EOPNOTSUPP | libc::EINVAL => Ok(()),
        code => {
            let error = std::io::Error::from_raw_os_error(code);
            Err(Error::File {
                path: path.to_path_buf(),
                message: format!(
                    "cannot reserve the {bytes} bytes that this file needs: {error}; free space on that file \
                     system, choose another output directory, or write less often"
                ),
            })
        }
    }
}

fn build_structure(temporary: &Path, layout: &Layout) -> hdf5::Result<()> {
    let file = hdf5::File::with_options()
        .with_fcpl(|plist| plist.userblock(layout.user_block).obj_track_times(false))
        .create(temporary)?;
    for entry in &layout.entries {
        match entry {
            Entry::Group { path } => {
                file.create_group(path)?;
            }
            Entry::Dataset { path, kind, rows, columns } => {
                let mut shape = vec![extent(*rows)?];
                if let Some(columns) = columns {
                    shape.push(extent(*columns)?);
                }
                fixed(file.new_dataset_builder()).empty_as(&descriptor(*kind)).shape(shape).create(path.as_str())?;
            }
            Entry::Constant { path, value } => write_constant(&file, path, value)?,
            Entry::Attribute { path, name, value } => write_attribute(&file, path, name, value)?,
        }
    }
    file.close()
}

fn extent(length: u64) -> hdf5::Result<usize> {
    usize::try_from(length).map_err(|_| hdf5::Error::from("a dataset longer than the address space"))
}

/// Contiguous, at a place fixed now, never filled, without time stamps: the same bytes each time.
fn fixed(builder: DatasetBuilder) -> DatasetBuilder {
    builder.alloc_time(Some(AllocTime::Early)).fill_time(FillTime::Never).obj_track_times(false)
}

fn descriptor(kind: Kind) -> TypeDescriptor {
    use hdf5::H5Type;
    match kind {
        Kind::F64 => f64::type_descriptor(),
        Kind::F32 => f32::type_descriptor(),
        Kind::I64 => i64::type_descriptor(),
        Kind::I32 => i32::type_descriptor(),
        Kind::U32 => u32::type_descriptor(),
        Kind::U8 => u8::type_descriptor(),
    }
}

/// HDF5 has no strings of length zero: an empty text becomes one zero byte.
fn text_bytes(text: &str) -> (Vec<u8>, TypeDescriptor) {
    let bytes = if text.is_empty() { vec![0] } else { text.as_bytes().to_vec() };
    let length = bytes.len();
    let kind = if text.is_ascii() { TypeDescriptor::FixedAscii(length) } else { TypeDescriptor::FixedUnicode(length) };
    (bytes, kind)
}

fn write_constant(file: &hdf5::File, path: &str, value: &Value) -> hdf5::Result<()> {
    let builder = fixed(file.new_dataset_builder());
    match value {
        Value::Integers(values) => builder.empty::<i64>().shape(values.len()).create(path)?.write_raw(values),
        Value::Reals(values) => builder.empty::<f64>().shape(values.len()).create(path)?.write_raw(values),
        Value::Text(text) => {
            let (bytes, kind) = text_bytes(text);
            let dataset = builder.empty_as(&kind).create(path)?;
            let number = dataset.dtype()?;
            // SAFETY: a scalar of `bytes.len()` characters, the length of its own type. Raw because
            // the safe interface wants the length at compile time.
            let status = hdf5::sync::sync(|| unsafe {
                h5d::H5Dwrite(dataset.id(), number.id(), h5s::H5S_ALL, h5s::H5S_ALL, 0, bytes.as_ptr().cast())
            });
            hdf5::h5check(status).map(|_| ())
        }
    }
}

fn write_attribute(file: &hdf5::File, path: &str, name: &str, value: &Value) -> hdf5::Result<()> {
    let group = file.group(path)?;
    let builder = group.new_attr_builder();
    match value {
        Value::Integers(values) => builder.empty::<i64>().shape(values.len()).create(name)?.write_raw(values),
        Value::Reals(values) => builder.empty::<f64>().shape(values.len()).create(name)?.write_raw(values),
        Value::Text(text) => {
            let (bytes, kind) = text_bytes(text);
            let attribute = builder.empty_as(&kind).create(name)?;
            let number = attribute.dtype()?;
            // SAFETY: as for the text dataset above.
            let status =
                hdf5::sync::sync(|| unsafe { h5a::H5Awrite(attribute.id(), number.id(), bytes.as_ptr().cast()) });
            hdf5::h5check(status).map(|_| ())
        }
    }
}

fn open_on_all_ranks(comm: &Communicator, temporary: &Path) -> hdf5::Result<hdf5::File> {
    #[cfg(feature = "mpi")]
    if let Some(handle) = comm.raw().filter(|_| comm.size() > 1) {
        return hdf5::File::with_options().with_fapl(|plist| plist.mpio(handle, None)).open_rw(temporary);
    }
    debug_assert_eq!(comm.size(), 1, "several ranks have an MPI communicator");
    hdf5::File::open_rw(temporary)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_larger_than_the_disk_is_refused_cleanly_before_anything_is_written() {
        let folder = tempfile::tempdir().expect("folder");
        let mut layout = Layout::new();
        layout.dataset("x", Kind::F64, 1_000_000_000_000_000);
        let path = folder.path().join("big.h5");
        let message =
            Writer::create(&Communicator::single(), &path, &layout).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(message.contains("big.h5: cannot reserve the 80000000"), "{message}");
        assert_eq!(fs::read_dir(folder.path()).expect("folder").count(), 0, "nothing is left behind");
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().expect("folder");
        let file = folder.path().join("plain_file");
        fs::write(&file, "x").expect("write");
        let result = Writer::create(&Communicator::single(), &file.join("a.h5"), &Layout::new());
        let message = result.err().map(|error| error.to_string()).unwrap_or_default();
        assert!(message.contains("plain_file"), "{message}");
    }
}
