//! The communicator facade: one process or several, the same calls. Must not know what is sent.

use crate::error::{Error, Result};
use std::rc::Rc;

#[cfg(feature = "mpi")]
use super::mpi_backend::{MpiBackend, RawCommunicator};

/// A group of ranks. Cloning is cheap. It stays on the thread that made it (MPI is initialised for
/// calls from one thread), which the compiler checks: it is neither `Send` nor `Sync`.
///
/// Except for [`Communicator::rank`], [`Communicator::size`], [`Communicator::abort`] and
/// [`Communicator::exchange`], all calls are collective: every rank makes them, in the same order.
///
/// MPI is finalised when the last clone drops. If that happens while a panic unwinds, the whole job
/// is aborted instead, since the other ranks would wait for ever.
#[derive(Clone)]
pub struct Communicator {
    backend: Rc<Backend>,
}

impl std::fmt::Debug for Communicator {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(formatter, "rank {} of {}", self.rank(), self.size())
    }
}

enum Backend {
    Single,
    #[cfg(feature = "mpi")]
    Mpi(MpiBackend),
}

/// Variables with the number of ranks, set by launchers.
const SIZE_VARIABLES: [&str; 4] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MV2_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS"];

/// Variables that only a launcher of MPI programs sets.
const LAUNCH_VARIABLES: [&str; 5] = ["OMPI_COMM_WORLD_SIZE", "PMI_RANK", "PMIX_RANK", "PMIX_NAMESPACE", "PMI_FD"];

/// Number of ranks that the launcher says it started, 1 if it does not say.
fn launched_ranks() -> usize {
    SIZE_VARIABLES.iter().filter_map(|name| std::env::var(name).ok()?.parse().ok()).max().unwrap_or(1)
}

/// Whether a launcher of MPI programs started this process.
fn launched() -> bool {
    launched_ranks() > 1 || LAUNCH_VARIABLES.iter().any(|name| std::env::var_os(name).is_some())
}

impl Communicator {
    /// This process alone.
    #[must_use]
    pub fn single() -> Self {
        Self { backend: Rc::new(Backend::Single) }
    }

    /// All ranks that `mpirun` or `srun` started; [`Communicator::single`] without such a launcher.
    ///
    /// # Errors
    /// [`Error::Layout`] if MPI cannot be initialised, sees another number of ranks than the launcher
    /// started, or is wanted by the launcher but not built in.
    #[cfg(feature = "mpi")]
    pub fn world() -> Result<Self> {
        if !launched() {
            return Ok(Self::single());
        }
        let backend = MpiBackend::world()?;
        let (expected, found) = (launched_ranks(), backend.size());
        if found == 1 && expected > 1 {
            return Err(Error::Layout(format!(
                "the launcher started {expected} processes, but each of them sees itself alone; start the program \
                 with the mpirun of the MPI that it was built with, or with srun --mpi=pmix"
            )));
        }
        Ok(Self { backend: Rc::new(Backend::Mpi(backend)) })
    }

    /// [`Communicator::single`]; the program was built without MPI.
    ///
    /// # Errors
    /// [`Error::Layout`] if a launcher started several processes.
    #[cfg(not(feature = "mpi"))]
    pub fn world() -> Result<Self> {
        let expected = launched_ranks();
        if launched() && expected > 1 {
            return Err(Error::Layout(format!(
                "the launcher started {expected} processes, but this program was built without MPI; start it without \
                 mpirun, or build it with the feature mpi"
            )));
        }
        Ok(Self::single())
    }

    /// Number of this rank, 0 … size − 1.
    #[must_use]
    pub fn rank(&self) -> usize {
        match &*self.backend {
            Backend::Single => 0,
            #[cfg(feature = "mpi")]
            Backend::Mpi(mpi) => mpi.rank(),
        }
    }

    /// Number of ranks.
    #[must_use]
    pub fn size(&self) -> usize {
        match &*self.backend {
            Backend::Single => 1,
            #[cfg(feature = "mpi")]
            Backend::Mpi(mpi) => mpi.size(),
        }
    }

    /// Wait until every rank has come here.
    pub fn barrier(&self) {
        match &*self.backend {
            Backend::Single => {}
            #[cfg(feature = "mpi")]
            Backend::Mpi(mpi) => mpi.barrier(),
        }
    }

    /// Largest value over the ranks, entry by entry, in place. A NaN on any rank gives NaN everywhere;
    /// −0 counts as less than +0, so that the bits do not depend on the order of ranks.
    pub fn max_f64(&self, values: &mut [f64]) {
        self.greatest_f64(values);
    }

    /// Smallest value over the ranks, entry by entry, in place; NaN and zeros as in
    /// [`Communicator::max_f64`].
    pub fn min_f64(&self, values: &mut [f64]) {
        values.iter_mut().for_each(|value| *value = -*value);
        self.greatest_f64(values);
        values.iter_mut().for_each(|value| *value = -*value);
    }

    /// Maximum through integer keys of the same order; NaN has the largest key.
    fn greatest_f64(&self, values: &mut [f64]) {
        const CHUNK: usize = 16;
        const NOT_A_NUMBER: i64 = i64::MAX;
        for chunk in values.chunks_mut(CHUNK) {
            let mut keys = [0_i64; CHUNK];
            for (key, value) in keys.iter_mut().zip(chunk.iter()) {
                *key = if value.is_nan() { NOT_A_NUMBER } else { ordered_key(*value) };
            }
            self.max_i64(&mut keys[..chunk.len()]);
            for (key, value) in keys.iter().zip(chunk.iter_mut()) {
                *value = if *key == NOT_A_NUMBER { f64::NAN } else { from_ordered_key(*key) };
            }
        }
    }

    /// Largest value over the ranks, entry by entry, in place.
    pub fn max_i64(&self, values: &mut [i64]) {
        match &*self.backend {
            Backend::Single => _ = values,
            #[cfg(feature = "mpi")]
            Backend::Mpi(mpi) => mpi.max_i64(values),
        }
    }

    /// Sum over the ranks, entry by entry, in place.
    pub fn sum_i64(&self, values: &mut [i64]) {
        match &*self.backend {
            Backend::Single => _ = values,
            #[cfg(feature = "mpi")]
            Backend::Mpi(mpi) => mpi.sum_i64(values),
        }
    }

    /// Sum of `value` over all ranks below this one.
    #[must_use]
    pub fn exclusive_sum(&self, value: u64) -> u64 {
        match &*self.backend {
            Backend::Single => {
                _ = value;
                0
            }
            #[cfg(feature = "mpi")]
            Backend::Mpi(mpi) => mpi.exclusive_sum(value),
        }
    }

    /// `bytes` of rank `root` to all ranks; what the others hold is replaced.
    pub fn broadcast(&self, root: usize, bytes: &mut Vec<u8>) {
        match &*self.backend {
            Backend::Single => _ = (root, bytes),
            #[cfg(feature = "mpi")]
            Backend::Mpi(mpi) => mpi.broadcast(root, bytes),
        }
    }

    /// `bytes` of every rank to all ranks, in order of ranks; lengths may differ.
    #[must_use]
    pub fn all_gather(&self, bytes: &[u8]) -> Vec<Vec<u8>> {
        match &*self.backend {
            Backend::Single => vec![bytes.to_vec()],
            #[cfg(feature = "mpi")]
            Backend::Mpi(mpi) => mpi.all_gather(bytes),
        }
    }

    /// Buffer `r` of `sends` goes to rank `r`; returned is what came from each rank. Any sizes; after
    /// one message with the sizes only buffers that hold something travel, directly.
    ///
    /// # Panics
    /// If there is not one buffer per rank.
    #[must_use]
    pub fn all_to_all(&self, sends: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
        assert_eq!(sends.len(), self.size(), "all_to_all takes one buffer per rank");
        match &*self.backend {
            Backend::Single => sends,
            #[cfg(feature = "mpi")]
            Backend::Mpi(mpi) => mpi.all_to_all(&sends),
        }
    }

    /// Non-blocking messages of known sizes between pairs of ranks; `meanwhile` runs while they fly.
    /// Several messages between the same pair are matched in order. Empty messages are not sent.
    pub fn exchange<R>(
        &self,
        sends: &[(usize, &[u8])],
        receives: &mut [(usize, &mut [u8])],
        meanwhile: impl FnOnce() -> R,
    ) -> R {
        self.exchange_each(
            sends.iter().map(|(rank, bytes)| (*rank, *bytes)),
            receives.iter_mut().map(|(rank, bytes)| (*rank, &mut **bytes)),
            meanwhile,
        )
    }

    /// [`Communicator::exchange`] with iterators, for callers that must not allocate.
    pub fn exchange_each<'a, 'b, R>(
        &self,
        sends: impl Iterator<Item = (usize, &'a [u8])>,
        receives: impl Iterator<Item = (usize, &'b mut [u8])>,
        meanwhile: impl FnOnce() -> R,
    ) -> R {
        match &*self.backend {
            Backend::Single => {
                let result = meanwhile();
                for ((to, bytes), (from, place)) in sends.zip(receives) {
                    debug_assert!(to == 0 && from == 0);
                    place.copy_from_slice(bytes);
                }
                result
            }
            #[cfg(feature = "mpi")]
            Backend::Mpi(mpi) => mpi.exchange(sends, receives, meanwhile),
        }
    }

    /// The communicator of the first `ranks` ranks; `None` on the others. All ranks call it.
    #[must_use]
    pub fn first(&self, ranks: usize) -> Option<Communicator> {
        if ranks >= self.size() {
            return Some(self.clone());
        }
        match &*self.backend {
            Backend::Single => None,
            #[cfg(feature = "mpi")]
            Backend::Mpi(mpi) => mpi.first(ranks).map(|part| Self { backend: Rc::new(Backend::Mpi(part)) }),
        }
    }

    /// A barrier that sleeps between looks, so that idle ranks leave their core to others. It notices
    /// the last rank up to 20 ms late.
    pub fn sleep_until_all(&self) {
        match &*self.backend {
            Backend::Single => {}
            #[cfg(feature = "mpi")]
            Backend::Mpi(mpi) => mpi.sleep_until_all(),
        }
    }

    /// End all ranks of the job at once with this exit code. Print the reason before.
    pub fn abort(&self, code: i32) -> ! {
        match &*self.backend {
            Backend::Single => std::process::exit(code),
            #[cfg(feature = "mpi")]
            Backend::Mpi(mpi) => mpi.abort(code),
        }
    }

    /// The MPI handle, as `H5Pset_fapl_mpio` takes it; `None` for a single process without a launcher,
    /// where MPI is not initialised and files are opened serially.
    #[cfg(feature = "mpi")]
    #[must_use]
    pub fn raw(&self) -> Option<RawCommunicator> {
        match &*self.backend {
            Backend::Single => None,
            Backend::Mpi(mpi) => Some(mpi.raw()),
        }
    }
}

/// An integer that orders like the value (−0 below +0).
fn ordered_key(value: f64) -> i64 {
    let bits = value.to_bits() as i64;
    if bits < 0 { bits ^ i64::MAX } else { bits }
}

fn from_ordered_key(key: i64) -> f64 {
    f64::from_bits(if key < 0 { key ^ i64::MAX } else { key } as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_order_as_the_values_do_and_come_back() {
        let values = [f64::NEG_INFINITY, -2.5, -f64::MIN_POSITIVE, -5e-324, -0.0, 0.0, 5e-324, 1.0, f64::INFINITY];
        for pair in values.windows(2) {
            assert!(ordered_key(pair[0]) < ordered_key(pair[1]), "{pair:?}");
        }
        for value in values {
            assert_eq!(from_ordered_key(ordered_key(value)).to_bits(), value.to_bits());
        }
    }

    #[test]
    fn one_process_gets_its_own_values_back() {
        let comm = Communicator::single();
        let mut values = vec![1.0, -0.0, f64::NAN, 3.5];
        comm.max_f64(&mut values);
        comm.min_f64(&mut values);
        assert_eq!(values[0], 1.0);
        assert_eq!(values[1].to_bits(), (-0.0_f64).to_bits());
        assert!(values[2].is_nan());
        assert_eq!(comm.exclusive_sum(7), 0);
        assert_eq!(comm.all_gather(&[1, 2]), [[1, 2]]);
        assert_eq!(comm.all_to_all(vec![vec![3]]), [[3]]);
        assert!(comm.first(1).is_some());
    }

    #[test]
    fn messages_to_oneself_arrive_in_order() {
        let comm = Communicator::single();
        let (mut a, mut b) = ([0_u8; 2], [0_u8; 1]);
        let during =
            comm.exchange(&[(0, &[1, 2]), (0, &[3])], &mut [(0, a.as_mut_slice()), (0, b.as_mut_slice())], || 42);
        assert_eq!((during, a, b), (42, [1, 2], [3]));
    }
}
