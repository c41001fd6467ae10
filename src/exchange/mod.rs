//! Stand-in for the exchange module: one process.
pub mod communicator;
pub mod redistribute;
use crate::error::Result;
pub use communicator::Communicator;

/// Collective agreement on an outcome.
pub fn agree<T>(_comm: &Communicator, result: Result<T>) -> Result<T> {
    result
}
