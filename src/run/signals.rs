//! Signals that end a run in order: SIGUSR1 (requeue), SIGINT and SIGTERM.

use crate::error::{Error, Result};
use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR1};
use signal_hook::flag;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Number of SIGUSR1.
pub const USR1: i32 = SIGUSR1;

/// The last signal received, if any.
#[derive(Debug, Clone)]
pub struct Signals {
    received: Arc<AtomicUsize>,
    /// Nothing to save yet.
    setting_up: Arc<AtomicBool>,
}

impl Signals {
    /// Take over the three signals. Until [`Signals::heed`] SIGINT and SIGTERM end the program at once.
    ///
    /// # Errors
    /// The system refuses a handler.
    pub fn listen() -> Result<Self> {
        let (received, setting_up) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicBool::new(true)));
        for signal in [SIGINT, SIGTERM, SIGUSR1] {
            let at_once = if signal == SIGUSR1 {
                Ok(())
            } else {
                flag::register_conditional_default(signal, Arc::clone(&setting_up)).map(|_| ())
            };
            at_once.and_then(|()| flag::register_usize(signal, Arc::clone(&received), signal as usize)).map_err(
                |error| Error::File {
                    path: PathBuf::from("signals"),
                    message: format!("cannot handle signal {signal}: {error}"),
                },
            )?;
        }
        Ok(Self { received, setting_up })
    }

    /// From now on a signal waits until the run looks for it.
    pub fn heed(&self) {
        self.setting_up.store(false, Ordering::Relaxed);
    }

    /// Number of the signal received, 0 for none.
    #[must_use]
    pub fn pending(&self) -> i32 {
        self.received.load(Ordering::Relaxed) as i32
    }
}
