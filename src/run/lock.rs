//! One run at a time in a directory: a lock that the system takes back when the process ends, however it ends.

use crate::error::{Error, Result};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read as _, Write as _};
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// Name of the locked file in the run directory. It goes with the run; one that a kill has left locks nothing.
pub const NAME: &str = ".dem-mpi.lock";

/// A run directory that this process has for itself until this drops.
#[derive(Debug)]
pub struct Lock {
    path: PathBuf,
    /// Keeps the lock.
    _file: File,
}

impl Lock {
    /// Take the directory. Where the file system knows no locks, say so and go on.
    ///
    /// # Errors
    /// Another run has it, or the directory cannot be written.
    pub fn take(directory: &Path) -> Result<Self> {
        let path = directory.join(NAME);
        loop {
            let options = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
            let mut file = options.map_err(|error| Error::File {
                path: path.clone(),
                message: format!("cannot be opened ({error}); choose another output.directory or free the disk"),
            })?;
            match file.try_lock() {
                Ok(()) if is_still(&file, &path) => {
                    // Only for whoever finds it locked.
                    let _ = file.set_len(0).and_then(|()| write!(file, "{}", this_process()));
                    return Ok(Self { path, _file: file });
                }
                // The run before has just ended and taken its file away.
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => return Err(taken(directory, &mut file)),
                Err(TryLockError::Error(error)) => {
                    eprintln!(
                        "dem-mpi: warning: {} cannot be locked ({error}): let no other run write there",
                        directory.display()
                    );
                    return Ok(Self { path, _file: file });
                }
            }
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Still locked; what stays locks nothing later.
        let _ = fs::remove_file(&self.path);
    }
}

/// The path still leads to this file.
fn is_still(file: &File, path: &Path) -> bool {
    let identity = |data: fs::Metadata| (data.dev(), data.ino());
    match (file.metadata(), fs::metadata(path)) {
        (Ok(own), Ok(there)) => identity(own) == identity(there),
        _ => false,
    }
}

fn this_process() -> String {
    let process = format!("process {}", std::process::id());
    match fs::read_to_string("/proc/sys/kernel/hostname") {
        Ok(host) => format!("{process} on {}", host.trim()),
        Err(_) => process,
    }
}

fn taken(directory: &Path, file: &mut File) -> Error {
    let mut holder = String::new();
    if file.read_to_string(&mut holder).is_err() || holder.is_empty() {
        "another process".clone_into(&mut holder);
    }
    let message =
        format!("another run is writing there ({holder}); wait for its end, or choose another directory with --output");
    Error::File { path: directory.to_path_buf(), message }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_directory_is_taken_once_and_free_again_without_a_trace() {
        let folder = tempfile::tempdir().expect("folder");
        let lock = Lock::take(folder.path()).expect("free");
        let message = Lock::take(folder.path()).expect_err("taken").to_string();
        assert!(message.contains(&this_process()) && message.contains("--output"), "{message}");
        drop(lock);
        assert!(!folder.path().join(NAME).exists());
        // What a kill leaves.
        fs::write(folder.path().join(NAME), "process 1").expect("write");
        drop(Lock::take(folder.path()).expect("free"));
        assert!(!folder.path().join(NAME).exists());
    }

    #[test]
    fn a_file_that_was_taken_away_while_it_was_opened_locks_nothing() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join(NAME);
        let file = File::create(&path).expect("create");
        assert!(is_still(&file, &path));
        fs::remove_file(&path).expect("remove");
        assert!(!is_still(&file, &path));
        fs::write(&path, "").expect("write");
        assert!(!is_still(&file, &path));
    }
}
