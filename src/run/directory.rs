//! The directory of a run before its first step: what must lie there, what goes, what comes from that of the checkpoint.
//! Rank 0 alone. A run that is refused leaves what it found, and nothing in a directory that it made or found empty.

use super::lock::{self, Lock};
use crate::config::Config;
use crate::error::{Error, Result};
use crate::output::digest::Digest;
use crate::output::files::{publish, temporary_name};
use crate::output::{checkpoint, history, snapshot};
use crate::state::GlobalState;
use std::fs;
use std::path::{Path, PathBuf};

/// The folder of snapshots in a run directory.
const SNAPSHOTS: &str = "snapshots";

/// Make the run directory ready for a run from this state, and keep other runs out of it while the lock lives. With a
/// checkpoint, the state is that of it: a restart goes on in the directory of its checkpoint, or begins one in which no run has
/// written, with the table and snapshots so far.
///
/// # Errors
/// The directory cannot be made or written, another run is writing there, or it holds one; table or snapshots do not reach to
/// the checkpoint.
pub fn prepare(config: &Config, checkpoint: Option<&Path>, global: &GlobalState) -> Result<Lock> {
    let directory = &config.output.directory;
    let missing: Vec<&Path> =
        directory.ancestors().filter(|folder| !folder.as_os_str().is_empty() && !folder.exists()).collect();
    let made = fs::create_dir_all(directory).map_err(|error| failed("make the run directory", directory, &error));
    let prepared = made.and_then(|()| Lock::take(directory)).and_then(|lock| {
        let blank =
            fs::read_dir(directory).is_ok_and(|entries| entries.flatten().all(|entry| entry.file_name() == lock::NAME));
        let begun = begin(config, checkpoint, global);
        if begun.is_err() && blank {
            remove_beginning(directory, global);
        }
        begun.map(|()| lock)
    });
    if prepared.is_err() {
        // Those in which another run has put something stay.
        for folder in missing {
            let _ = fs::remove_dir(folder);
        }
    }
    prepared
}

/// Remove what was taken over into an empty directory. The error to report is the one before; what cannot be removed stays.
fn remove_beginning(directory: &Path, global: &GlobalState) {
    let _ = fs::remove_dir_all(directory.join(SNAPSHOTS));
    for path in [checkpoint::path_in(directory, global.step), history::path_in(directory)] {
        for path in [temporary_name(&path), path] {
            let _ = fs::remove_file(path);
        }
    }
}

/// The directory is that of the checkpoint, and holds all that a run writes which ends there. Changes nothing.
#[must_use]
pub fn is_finished(config: &Config, checkpoint: &Path, global: &GlobalState, digest: Digest) -> bool {
    let directory = &config.output.directory;
    let status = fs::read_to_string(directory.join("status.toml")).unwrap_or_default();
    let status: toml::Table = status.parse().unwrap_or_default();
    let says = |key: &str, wanted: &str| status.get(key).and_then(toml::Value::as_str) == Some(wanted);
    is_same(folder_of(checkpoint), directory)
        && says("state", "finished")
        && says("digest", &digest.to_string())
        && history::check(directory, global.history_rows + 1).is_ok()
}

fn begin(config: &Config, checkpoint: Option<&Path>, global: &GlobalState) -> Result<()> {
    if let Some(checkpoint) = checkpoint {
        let (from, to) = (folder_of(checkpoint), config.output.directory.as_path());
        check_beginning(from, config, global)?;
        if !is_same(from, to) {
            check_free(to, checkpoint)?;
            take_over(from, to, checkpoint, global.step)?;
        }
    }
    clear_future(config, global)
}

fn failed(attempt: &str, path: &Path, error: &std::io::Error) -> Error {
    Error::File {
        path: path.to_path_buf(),
        message: format!("cannot {attempt} ({error}); choose another output.directory or free the disk"),
    }
}

fn folder_of(checkpoint: &Path) -> &Path {
    checkpoint.parent().filter(|from| !from.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn is_same(one: &Path, other: &Path) -> bool {
    matches!((fs::canonicalize(one), fs::canonicalize(other)), (Ok(one), Ok(other)) if one == other)
}

/// That the rows and snapshots which the state counts lie beside the checkpoint.
fn check_beginning(from: &Path, config: &Config, global: &GlobalState) -> Result<()> {
    let table = history::path_in(from);
    if global.history_rows > 0 && !table.exists() {
        let message = "is not there, and a restart goes on with it: give the checkpoint where it lies in its run directory, \
                       put the table and snapshots of that run beside it, or begin anew without --restart";
        return Err(Error::File { path: table, message: message.to_owned() });
    }
    history::check(from, global.history_rows)?;
    config.output.snapshots.map_or(Ok(()), |_| snapshot::check(from, global.snapshots))
}

/// That no run has written into the directory, whose files would be mixed with those of this one.
fn check_free(to: &Path, checkpoint: &Path) -> Result<()> {
    if !history::path_in(to).exists() {
        return Ok(());
    }
    Err(Error::Input(format!(
        "output.directory {to} holds another run than the checkpoint {}: go on with that run with --restart {to}, go on \
         where the checkpoint is with --output {}, or give the name of a new directory",
        checkpoint.display(),
        folder_of(checkpoint).display(),
        to = to.display(),
    )))
}

/// The snapshots, the checkpoint and the table of one directory also in the other, so that this one tells the whole run and
/// can be gone on with from now on.
fn take_over(from: &Path, to: &Path, checkpoint: &Path, step: u64) -> Result<()> {
    let (shown, folder) = (from.join(SNAPSHOTS), to.join(SNAPSHOTS));
    if is_same(&shown, &folder) {
        let message =
            "is that of the checkpoint's run, whose snapshots would be overwritten; remove the link".to_owned();
        return Err(Error::File { path: folder, message });
    }
    if let Ok(entries) = fs::read_dir(shown) {
        fs::create_dir_all(&folder).map_err(|error| failed("make the folder", &folder, &error))?;
        for entry in entries.flatten().filter(|entry| entry.path().is_file()) {
            copy(&entry.path(), &folder.join(entry.file_name()))?;
        }
    }
    place(checkpoint, &checkpoint::path_in(to, step))?;
    // Last: what holds a table counts as a run.
    place(&history::path_in(from), &history::path_in(to))
}

/// Copy a file, under its name once it is complete.
fn place(from: &Path, to: &Path) -> Result<()> {
    let part = temporary_name(to);
    copy(from, &part)?;
    publish(&part, to)
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::copy(from, to).map(|_| ()).map_err(|error| Error::File {
        path: from.to_path_buf(),
        message: format!("cannot copy to {} ({error}); free the disk or check the permissions", to.display()),
    })
}

/// Clear away what belongs to a future that is computed anew from this state: later checkpoints first, as a restart from them
/// would miss what goes next; the end of an earlier run; and snapshots, where none are wanted.
fn clear_future(config: &Config, global: &GlobalState) -> Result<()> {
    let directory = &config.output.directory;
    checkpoint::discard_after(directory, global.step)?;
    for path in ends_of_earlier_runs(directory) {
        fs::remove_file(&path).map_err(|error| failed("remove the old file", &path, &error))?;
    }
    if config.output.snapshots.is_some() { Ok(()) } else { snapshot::discard_after(directory, global.snapshots) }
}

/// Status file and post-mortem files in a run directory.
fn ends_of_earlier_runs(directory: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    let old = |name: &str| name == "status.toml" || name.starts_with("post_mortem-rank") && name.ends_with(".json");
    entries.filter(|entry| entry.file_name().to_str().is_some_and(old)).map(|entry| entry.path()).collect()
}
