//! What a run leaves behind: tables, snapshots, checkpoints, plots, the terminal. Reads the state
//! that it is given; never changes it.

pub mod checkpoint;
pub mod digest;
pub(crate) mod files;
pub mod hdf5_file;
pub mod history;
pub mod log;
pub mod plot;
pub mod ranks;
pub mod snapshot;
