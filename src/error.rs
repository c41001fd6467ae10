//! The one error type that crosses module borders. Every message names place, value and remedy.

use std::path::PathBuf;

/// What can go wrong in a run; `Display` is the message that the user reads.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The input is wrong; the text holds every problem found, each with file, line and remedy.
    #[error("{0}")]
    Input(String),
    /// A file cannot be read or written.
    #[error("{path}: {message}")]
    File {
        /// The file or folder concerned.
        path: PathBuf,
        /// What happened and what to do.
        message: String,
    },
    /// A checkpoint cannot be used (corrupt, truncated, foreign).
    #[error("checkpoint {path}: {message}")]
    Checkpoint {
        /// The checkpoint file.
        path: PathBuf,
        /// What is wrong with it and what to do.
        message: String,
    },
    /// The simulation cannot go on (lost particle, NaN, overlap too large, unstable step).
    #[error("step {step}: {message}")]
    Simulation {
        /// The step at which the fault appeared.
        step: u64,
        /// Rank, particle, value and remedy.
        message: String,
    },
    /// The packing cannot be made.
    #[error("packing: {0}")]
    Packing(String),
    /// The parallel layout cannot work.
    #[error("parallel layout: {0}")]
    Layout(String),
}

/// Shorthand for results with [`Error`].
pub type Result<T> = std::result::Result<T, Error>;
