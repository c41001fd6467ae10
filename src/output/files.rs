//! Small helpers for files of text: atomic replacement and error texts. Knows nothing of HDF5.

use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// An [`Error::File`] from what was tried and what the system said.
pub(crate) fn io_error(path: &Path, attempt: &str, error: &io::Error) -> Error {
    let remedy = match error.kind() {
        io::ErrorKind::NotFound => "; check that the path exists",
        io::ErrorKind::PermissionDenied => "; check the permissions of the file and of its folder",
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "; free space on that file system or choose another output directory"
        }
        io::ErrorKind::NotADirectory => "; a file stands where a folder is needed: choose another path",
        io::ErrorKind::IsADirectory => "; a folder stands where a file is needed: choose another path",
        io::ErrorKind::AlreadyExists => "; something else has that name: choose another path",
        io::ErrorKind::ReadOnlyFilesystem => "; choose a path on a file system that can be written",
        io::ErrorKind::InvalidData => "; the file is damaged or of another kind",
        _ => "; look at the path and its file system, or choose another one",
    };
    Error::File { path: path.to_path_buf(), message: format!("cannot {attempt}: {error}{remedy}") }
}

/// The name under which a file is written before it is complete.
pub(crate) fn temporary_name(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_os_string();
    name.push(".part");
    PathBuf::from(name)
}

/// Replace a file by `contents` so that a reader, or a kill at any moment, sees the old or the new
/// text, never a part.
///
/// # Errors
/// [`Error::File`] when the folder cannot be written; the old file is then untouched.
pub(crate) fn write_atomically(path: &Path, contents: &[u8]) -> Result<()> {
    let temporary = temporary_name(path);
    let written = File::create(&temporary).and_then(|mut file| {
        file.write_all(contents)?;
        file.sync_all()
    });
    if let Err(error) = written {
        // The first error is the one to report; a left-over part file does no harm.
        let _ = fs::remove_file(&temporary);
        return Err(io_error(path, "write the file", &error));
    }
    publish(&temporary, path)
}

/// Give a complete and synced file its final name, and make the name itself survive a power cut.
///
/// # Errors
/// [`Error::File`] when the rename fails.
pub(crate) fn publish(temporary: &Path, path: &Path) -> Result<()> {
    fs::rename(temporary, path).map_err(|error| io_error(path, "rename the finished file", &error))?;
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    File::open(folder).and_then(|folder| folder.sync_all()).map_err(|error| io_error(folder, "sync the folder", &error))
}

/// Create a folder with its parents.
///
/// # Errors
/// [`Error::File`] naming the folder.
pub(crate) fn create_folder(path: &Path) -> Result<()> {
    fs::create_dir_all(path).map_err(|error| io_error(path, "create the folder", &error))
}
