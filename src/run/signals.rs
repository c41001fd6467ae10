//! Signals that end a run in order: SIGUSR1 (requeue), SIGINT and SIGTERM.

use crate::error::{Error, Result};
use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR1};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Number of SIGUSR1.
pub const USR1: i32 = SIGUSR1;

/// The last signal received, if any.
#[derive(Debug, Clone)]
pub struct Signals(Arc<AtomicUsize>);

impl Signals {
    /// Take over the three signals.
    ///
    /// # Errors
    /// The system refuses a handler.
    pub fn listen() -> Result<Self> {
        let received = Arc::new(AtomicUsize::new(0));
        for signal in [SIGINT, SIGTERM, SIGUSR1] {
            signal_hook::flag::register_usize(signal, Arc::clone(&received), signal as usize).map_err(|error| {
                Error::File {
                    path: PathBuf::from("signals"),
                    message: format!("cannot handle signal {signal}: {error}"),
                }
            })?;
        }
        Ok(Self(received))
    }

    /// Number of the signal received, 0 for none.
    #[must_use]
    pub fn pending(&self) -> i32 {
        self.0.load(Ordering::Relaxed) as i32
    }
}
