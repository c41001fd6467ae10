//! dem-mpi: the discrete element method for battery electrodes and granular matter, parallel over
//! MPI ranks and threads, with the same bits on every machine shape. See `ARCHITECTURE.md`.

/// Print a line to standard output. A reader that has gone (`| head`) must not end a run.
macro_rules! say {
    ($($part:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout(), $($part)*);
    }};
}

pub mod bench;
pub mod cli;
pub mod config;
pub mod contact;
pub mod error;
pub mod exchange;
pub mod force;
pub mod integrate;
pub mod load;
pub mod neighbour;
pub mod output;
pub mod packing;
pub mod run;
pub mod scaling;
pub mod setup;
pub mod simulation;
pub mod state;
pub mod units;
pub mod verify;
