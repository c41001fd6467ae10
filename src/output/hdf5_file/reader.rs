//! Reading: every rank opens the file by itself and reads the rows that it wants.

use super::Scalar;
use crate::error::{Error, Result};
use hdf5::types::TypeDescriptor;
use hdf5_sys::{h5a, h5d, h5s};
use std::path::{Path, PathBuf};

/// A file open for reading.
pub struct Reader {
    path: PathBuf,
    file: hdf5::File,
}

impl Reader {
    /// Open a file.
    ///
    /// # Errors
    /// [`Error::File`] when it is missing or not HDF5.
    pub fn open(path: &Path) -> Result<Self> {
        match hdf5::File::open(path) {
            Ok(file) => Ok(Self { path: path.to_path_buf(), file }),
            Err(error) => Err(Error::File {
                path: path.to_path_buf(),
                message: format!("cannot open as an HDF5 file: {error}; check the path and that the file is complete"),
            }),
        }
    }

    /// Rows of a dataset.
    ///
    /// # Errors
    /// [`Error::File`] when the file has no such dataset.
    pub fn rows(&self, dataset: &str) -> Result<u64> {
        let shape = self.named(dataset, self.file.dataset(dataset))?.shape();
        Ok(shape.first().map_or(0, |&rows| rows as u64))
    }

    /// Columns of a dataset; 1 if it has one dimension.
    ///
    /// # Errors
    /// [`Error::File`] when the file has no such dataset.
    pub fn columns(&self, dataset: &str) -> Result<u64> {
        let shape = self.named(dataset, self.file.dataset(dataset))?.shape();
        Ok(shape.iter().skip(1).product::<usize>() as u64)
    }

    /// Rows `start … start + count − 1` of a dataset, row after row.
    ///
    /// # Errors
    /// [`Error::File`] when the dataset is missing, has other numbers than `T`, or too few rows.
    pub fn read<T: Scalar>(&self, dataset: &str, start: u64, count: u64) -> Result<Vec<T>> {
        let handle = self.named(dataset, self.file.dataset(dataset))?;
        if !self.named(dataset, handle.dtype())?.is::<T>() {
            return Err(self.fault(dataset, &format!("its numbers are not of the type {:?}", T::KIND)));
        }
        let rows = handle.shape().first().map_or(0, |&rows| rows as u64);
        let Some(end) = start.checked_add(count).filter(|&end| end <= rows) else {
            return Err(self.fault(dataset, &format!("it has {rows} rows; rows {start} + {count} were wanted")));
        };
        if count == 0 {
            return Ok(Vec::new());
        }
        // Both fit: the dataset that contains them has a length of type usize.
        let range = start as usize..end as usize;
        let values = match handle.ndim() {
            1 => handle.read_slice_1d::<T, _>(range).map(|array| array.into_iter().collect()),
            _ => handle.read_slice_2d::<T, _>((range, ..)).map(|array| array.into_iter().collect()),
        };
        self.named(dataset, values)
    }

    /// A text stored as a scalar dataset.
    ///
    /// # Errors
    /// [`Error::File`] when it is missing or not a text.
    pub fn text(&self, dataset: &str) -> Result<String> {
        let handle = self.named(dataset, self.file.dataset(dataset))?;
        let kind = self.named(dataset, handle.dtype())?;
        let mut bytes = self.text_buffer(dataset, &kind, handle.ndim())?;
        // SAFETY: a scalar fixed-length string; the buffer has the length of its type. Raw because the
        // safe interface wants the length at compile time.
        let status = hdf5::sync::sync(|| unsafe {
            h5d::H5Dread(handle.id(), kind.id(), h5s::H5S_ALL, h5s::H5S_ALL, 0, bytes.as_mut_ptr().cast())
        });
        self.named(dataset, hdf5::h5check(status))?;
        self.decode(dataset, bytes)
    }

    /// A text attribute of the group at `group`.
    ///
    /// # Errors
    /// [`Error::File`] when it is missing or not a text.
    pub fn attribute(&self, group: &str, name: &str) -> Result<String> {
        let handle = self.named(name, self.file.group(group).and_then(|group| group.attr(name)))?;
        let kind = self.named(name, handle.dtype())?;
        let mut bytes = self.text_buffer(name, &kind, handle.ndim())?;
        // SAFETY: as in `text`.
        let status = hdf5::sync::sync(|| unsafe { h5a::H5Aread(handle.id(), kind.id(), bytes.as_mut_ptr().cast()) });
        self.named(name, hdf5::h5check(status))?;
        self.decode(name, bytes)
    }

    fn text_buffer(&self, name: &str, kind: &hdf5::Datatype, dimensions: usize) -> Result<Vec<u8>> {
        match self.named(name, kind.to_descriptor())? {
            TypeDescriptor::FixedAscii(_) | TypeDescriptor::FixedUnicode(_) if dimensions == 0 => {
                Ok(vec![0; kind.size()])
            }
            other => Err(self.fault(name, &format!("it is not a text but {other}"))),
        }
    }

    fn decode(&self, name: &str, mut bytes: Vec<u8>) -> Result<String> {
        let length = bytes.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
        bytes.truncate(length);
        String::from_utf8(bytes).map_err(|_| self.fault(name, "its text is not UTF-8"))
    }

    fn named<T>(&self, name: &str, result: hdf5::Result<T>) -> Result<T> {
        result.map_err(|error| self.fault(name, &format!("HDF5 says: {error}")))
    }

    fn fault(&self, name: &str, reason: &str) -> Error {
        Error::File { path: self.path.clone(), message: format!("cannot read `{name}`: {reason}") }
    }
}
