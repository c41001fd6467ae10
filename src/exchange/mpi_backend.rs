//! The MPI back end of the communicator: the only file that names MPI. Errors of MPI itself are fatal
//! (the library's default handler ends the job), so that no rank waits for one that failed.

use crate::error::{Error, Result};
use mpi::collective::SystemOperation;
use mpi::datatype::PartitionMut;
use mpi::environment::{Threading, Universe};
use mpi::ffi;
use mpi::topology::{Color, SimpleCommunicator};
use mpi::traits::{AsRaw, Communicator as _, CommunicatorCollectives as _, Root as _};
use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

/// Handle of an MPI communicator, as HDF5 takes it.
pub type RawCommunicator = ffi::MPI_Comm;
/// Handle of an MPI info object, as HDF5 takes it.
pub type RawInfo = ffi::MPI_Info;

/// The empty info object.
#[must_use]
pub fn raw_info_null() -> RawInfo {
    // SAFETY: a constant of the MPI library, never written.
    unsafe { ffi::RSMPI_INFO_NULL }
}

/// MPI counts are C integers; longer messages travel in pieces of this many bytes.
const PIECE: usize = 1 << 30;

/// Ranks of one MPI communicator.
pub struct MpiBackend {
    // Fields drop in this order: the communicator is freed before MPI is finalised.
    group: SimpleCommunicator,
    universe: Rc<Universe>,
    requests: RefCell<Vec<ffi::MPI_Request>>,
}

impl Drop for MpiBackend {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.group.abort(1);
        }
    }
}

fn count(length: usize) -> i32 {
    i32::try_from(length).expect("pieces of messages fit a C integer")
}

impl MpiBackend {
    /// Initialise MPI, threads beside the one that communicates allowed.
    pub fn world() -> Result<Self> {
        let (universe, level) = mpi::initialize_with_threading(Threading::Funneled).ok_or_else(|| {
            Error::Layout("MPI is already initialised or was finalised; it starts once per process".into())
        })?;
        if level < Threading::Funneled {
            return Err(Error::Layout(format!(
                "this MPI library allows no threads beside the one that communicates (it offers {level:?}, needed is \
                 Funneled); use an MPI built with thread support"
            )));
        }
        let group = universe.world();
        Ok(Self::of(group, Rc::new(universe)))
    }

    fn of(group: SimpleCommunicator, universe: Rc<Universe>) -> Self {
        Self { group, universe, requests: RefCell::default() }
    }

    pub fn rank(&self) -> usize {
        self.group.rank() as usize
    }

    pub fn size(&self) -> usize {
        self.group.size() as usize
    }

    pub fn barrier(&self) {
        self.group.barrier();
    }

    pub fn max_i64(&self, values: &mut [i64]) {
        self.reduce(values, SystemOperation::max());
    }

    pub fn sum_i64(&self, values: &mut [i64]) {
        self.reduce(values, SystemOperation::sum());
    }

    fn reduce(&self, values: &mut [i64], operation: SystemOperation) {
        const CHUNK: usize = 1024;
        for chunk in values.chunks_mut(CHUNK) {
            let mut own = [0_i64; CHUNK];
            let own = &mut own[..chunk.len()];
            own.copy_from_slice(chunk);
            self.group.all_reduce_into(&*own, chunk, operation);
        }
    }

    pub fn exclusive_sum(&self, value: u64) -> u64 {
        let mut below = 0_u64;
        self.group.exclusive_scan_into(&value, &mut below, SystemOperation::sum());
        // MPI leaves the result on rank 0 undefined.
        if self.rank() == 0 { 0 } else { below }
    }

    pub fn broadcast(&self, root: usize, bytes: &mut Vec<u8>) {
        let root = self.group.process_at_rank(count(root));
        let mut length = bytes.len() as u64;
        root.broadcast_into(&mut length);
        bytes.resize(length as usize, 0);
        for piece in bytes.chunks_mut(PIECE) {
            root.broadcast_into(piece);
        }
    }

    pub fn all_gather(&self, bytes: &[u8]) -> Vec<Vec<u8>> {
        let ranks = self.size();
        let mut lengths = vec![0_u64; ranks];
        self.group.all_gather_into(&(bytes.len() as u64), &mut lengths[..]);
        let mut gathered: Vec<Vec<u8>> = lengths.iter().map(|&length| Vec::with_capacity(length as usize)).collect();
        // Displacements are C integers too: a round takes at most one piece from all ranks together.
        let share = (PIECE / ranks).max(1);
        let rounds = lengths.iter().map(|&length| (length as usize).div_ceil(share)).max().unwrap_or(0);
        let mut landing = Vec::new();
        for round in 0..rounds {
            let part = |length: usize| length.saturating_sub(round * share).min(share);
            let counts: Vec<i32> = lengths.iter().map(|&length| count(part(length as usize))).collect();
            let starts: Vec<i32> = counts
                .iter()
                .scan(0, |next, &length| {
                    *next += length;
                    Some(*next - length)
                })
                .collect();
            landing.resize(counts.iter().map(|&length| length as usize).sum(), 0_u8);
            let start = (round * share).min(bytes.len());
            let own = &bytes[start..start + part(bytes.len())];
            let mut landing_parts = PartitionMut::new(&mut landing[..], &counts[..], &starts[..]);
            self.group.all_gather_varcount_into(own, &mut landing_parts);
            for (rank, whole) in gathered.iter_mut().enumerate() {
                let start = starts[rank] as usize;
                whole.extend_from_slice(&landing[start..start + counts[rank] as usize]);
            }
        }
        gathered
    }

    pub fn all_to_all(&self, sends: &[Vec<u8>]) -> Vec<Vec<u8>> {
        let lengths: Vec<u64> = sends.iter().map(|bytes| bytes.len() as u64).collect();
        let mut incoming = vec![0_u64; lengths.len()];
        self.group.all_to_all_into(&lengths[..], &mut incoming[..]);
        let mut received: Vec<Vec<u8>> = incoming.iter().map(|&length| vec![0; length as usize]).collect();
        self.exchange(
            sends.iter().map(Vec::as_slice).enumerate(),
            received.iter_mut().map(Vec::as_mut_slice).enumerate(),
            || (),
        );
        received
    }

    /// Non-blocking sends and receives, with `meanwhile` in between. The request list is kept between
    /// calls, so that a step allocates nothing.
    pub fn exchange<'a, 'b, R>(
        &self,
        sends: impl Iterator<Item = (usize, &'a [u8])>,
        receives: impl Iterator<Item = (usize, &'b mut [u8])>,
        meanwhile: impl FnOnce() -> R,
    ) -> R {
        let mut requests = self.requests.borrow_mut();
        requests.clear();
        let flight = Flight { group: &self.group, requests: &mut requests };
        for (rank, bytes) in receives {
            for piece in bytes.chunks_mut(PIECE) {
                // SAFETY: `flight` completes every request before this function returns or aborts the
                // job if it unwinds, and `piece` stays exclusively borrowed until then ('b outlives the call).
                unsafe {
                    let mut request = ffi::RSMPI_REQUEST_NULL;
                    ffi::MPI_Irecv(
                        piece.as_mut_ptr().cast(),
                        count(piece.len()),
                        ffi::RSMPI_UINT8_T,
                        count(rank),
                        0,
                        self.group.as_raw(),
                        &raw mut request,
                    );
                    flight.requests.push(request);
                }
            }
        }
        for (rank, bytes) in sends {
            for piece in bytes.chunks(PIECE) {
                // SAFETY: as above; `piece` stays borrowed, so that nobody writes it meanwhile.
                unsafe {
                    let mut request = ffi::RSMPI_REQUEST_NULL;
                    ffi::MPI_Isend(
                        piece.as_ptr().cast(),
                        count(piece.len()),
                        ffi::RSMPI_UINT8_T,
                        count(rank),
                        0,
                        self.group.as_raw(),
                        &raw mut request,
                    );
                    flight.requests.push(request);
                }
            }
        }
        let result = meanwhile();
        drop(flight);
        result
    }

    pub fn first(&self, ranks: usize) -> Option<Self> {
        let color = if self.rank() < ranks { Color::with_value(0) } else { Color::undefined() };
        self.group.split_by_color(color).map(|group| Self::of(group, Rc::clone(&self.universe)))
    }

    pub fn sleep_until_all(&self) {
        let mut pause = Duration::from_micros(100);
        let mut request = self.group.immediate_barrier();
        while let Err(pending) = request.test() {
            request = pending;
            std::thread::sleep(pause);
            pause = (pause * 2).min(Duration::from_millis(20));
        }
    }

    pub fn abort(&self, code: i32) -> ! {
        self.group.abort(code)
    }

    pub fn raw(&self) -> RawCommunicator {
        self.group.as_raw()
    }
}

/// Messages under way; waits for all of them when dropped.
struct Flight<'a> {
    group: &'a SimpleCommunicator,
    requests: &'a mut Vec<ffi::MPI_Request>,
}

impl Drop for Flight<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            // The buffers are about to be freed under MPI's hands, and partners wait: end the job.
            self.group.abort(1);
        }
        // SAFETY: the list holds exactly the requests started by `exchange`, each completed here once.
        unsafe {
            ffi::MPI_Waitall(count(self.requests.len()), self.requests.as_mut_ptr(), ffi::RSMPI_STATUSES_IGNORE);
        }
    }
}
