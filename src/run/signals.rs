//! Signals that end a run in order: SIGUSR1 (requeue), SIGINT and SIGTERM.

use crate::error::{Error, Result};
use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR1};
use signal_hook::flag;
use std::mem::MaybeUninit;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Number of SIGUSR1.
pub const USR1: i32 = SIGUSR1;

/// Hold SIGUSR1 back while the program begins, also in a program that takes the place of this one; see [`let_through`].
pub fn hold_back() {
    change_mask(libc::SIG_BLOCK);
}

/// Let SIGUSR1 through, also one that was held back: to [`Signals::listen`] if that came before, else it ends the program.
pub fn let_through() {
    change_mask(libc::SIG_UNBLOCK);
}

/// Of this thread, while there is no other.
fn change_mask(how: i32) {
    let mut set = MaybeUninit::<libc::sigset_t>::uninit();
    // SAFETY: the set is filled by `sigemptyset` before it is used, and no old mask is asked for.
    unsafe {
        libc::sigemptyset(set.as_mut_ptr());
        libc::sigaddset(set.as_mut_ptr(), SIGUSR1);
        libc::pthread_sigmask(how, set.as_ptr(), std::ptr::null_mut());
    }
}

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
