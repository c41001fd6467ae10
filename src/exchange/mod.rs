//! Everything that ranks tell each other: the communicator facade, the division of the cell among
//! ranks, the halo, migration, exact sums and redistribution to id blocks. MPI is known to
//! `mpi_backend` alone; no part of this module knows forces, lists or files.

pub mod agree;
pub mod communicator;
pub mod decomposition;
pub mod exact_sum;
pub mod halo;
mod halo_map;
pub mod migrate;
pub mod model;
#[cfg(feature = "mpi")]
mod mpi_backend;
pub mod redistribute;
mod rows;

pub use agree::agree;
pub use communicator::Communicator;
pub use decomposition::Decomposition;
pub use exact_sum::ExactSum;
pub use halo::{HaloContent, HaloPlan};
pub use migrate::{MigrationSetting, distribute, migrate};
#[cfg(feature = "mpi")]
pub use mpi_backend::{RawCommunicator, RawInfo, raw_info_null};
