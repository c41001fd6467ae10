//! Rayon's workers kept awake between the parallel parts of a step. A worker that sleeps must be woken by the system, which
//! takes long beside a step of 10⁴ particles with its two parallel parts: it is worth a tenth (docs/performance.md).

use std::cell::Cell;
use std::hint::spin_loop;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// A worker without work for so long goes to sleep: longer than what a step does on one thread, short
/// enough that files are written and lists reduced without a second core burning.
const PATIENCE: Duration = Duration::from_micros(500);

/// Looks for work between two looks at the clock.
const LOOKS: u32 = 64;

/// Workers that are looking for work in [`attend`].
static ATTENDING: AtomicUsize = AtomicUsize::new(0);

thread_local! {
    static ATTENDS: Cell<bool> = const { Cell::new(false) };
}

/// Have all workers but this one look for work until nothing came for half a millisecond.
pub fn keep_awake() {
    let threads = rayon::current_num_threads();
    if ATTENDING.load(Ordering::Relaxed) + 1 < threads {
        let caller = rayon::current_thread_index();
        rayon::spawn_broadcast(move |context| {
            // A worker may come here from within its own search for work.
            if caller != Some(context.index()) && !ATTENDS.replace(true) {
                ATTENDING.fetch_add(1, Ordering::Relaxed);
                attend();
                ATTENDING.fetch_sub(1, Ordering::Relaxed);
                ATTENDS.set(false);
            }
        });
        // This thread's own share of the broadcast, which does nothing: it must not pile up step by step.
        rayon::yield_local();
    }
}

fn attend() {
    let mut idle_since = None;
    loop {
        if found_work(|| false) {
            idle_since = None;
        } else if idle_since.get_or_insert_with(Instant::now).elapsed() > PATIENCE {
            return;
        }
    }
}

/// Look for work for a while and do what is found. If there is none, others may have this core.
fn found_work(until: impl Fn() -> bool) -> bool {
    for _ in 0..LOOKS {
        if rayon::yield_now() == Some(rayon::Yield::Executed) || until() {
            return true;
        }
        spin_loop();
    }
    std::thread::yield_now();
    false
}

/// Both, on two threads if one is free. Unlike in `rayon::join` this thread does not fall asleep while it waits.
pub fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    let done = AtomicBool::new(false);
    rayon::join(
        || {
            let result = a();
            let attends = ATTENDS.replace(true);
            // What would have this thread attend must return at once: it waits for one thing only.
            let is_done = || done.load(Ordering::Acquire);
            while !is_done() {
                found_work(is_done);
            }
            ATTENDS.set(attends);
            result
        },
        || {
            let _done = SetWhenDropped(&done);
            b()
        },
    )
}

/// Says that the work ended, by a panic too.
struct SetWhenDropped<'a>(&'a AtomicBool);

impl Drop for SetWhenDropped<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_halves_run_nested_too_and_their_results_come_back() {
        fn sum(range: std::ops::Range<u64>) -> u64 {
            if range.end - range.start < 10 {
                return range.sum();
            }
            let middle = range.start.midpoint(range.end);
            let (low, high) = join(|| sum(range.start..middle), || sum(middle..range.end));
            low + high
        }
        keep_awake();
        assert_eq!(sum(0..10_000), 49_995_000);
    }

    #[test]
    fn a_panic_in_either_half_reaches_the_caller() {
        let caught = |a: fn(), b: fn()| std::panic::catch_unwind(|| join(a, b)).is_err();
        assert!(caught(|| panic!("first"), || ()) && caught(|| (), || panic!("second")));
        assert!(!caught(|| (), || ()));
    }

    #[test]
    fn workers_attend_and_without_work_go_to_sleep() {
        let begin = Instant::now();
        let wait_until = |enough: &dyn Fn(usize) -> bool, meanwhile: &dyn Fn()| {
            while !enough(ATTENDING.load(Ordering::Relaxed)) {
                assert!(begin.elapsed() < Duration::from_secs(60));
                meanwhile();
            }
        };
        // Four threads: what the other tests' pool attends with may be counted too.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().expect("four threads start");
        pool.install(|| {
            wait_until(&|attending| attending > 0, &keep_awake);
            wait_until(&|attending| attending == 0, &|| std::thread::sleep(PATIENCE));
        });
    }
}
