//! Stand-in: one process.

/// One process.
#[derive(Clone, Debug)]
pub struct Communicator;

#[allow(missing_docs)]
impl Communicator {
    pub fn single() -> Self {
        Self
    }
    pub fn rank(&self) -> usize {
        0
    }
    pub fn size(&self) -> usize {
        1
    }
    pub fn barrier(&self) {}
    pub fn max_f64(&self, _values: &mut [f64]) {}
    pub fn sum_i64(&self, _values: &mut [i64]) {}
    pub fn exclusive_sum(&self, _value: u64) -> u64 {
        0
    }
    pub fn broadcast(&self, _root: usize, _bytes: &mut Vec<u8>) {}
    pub fn all_gather(&self, bytes: &[u8]) -> Vec<Vec<u8>> {
        vec![bytes.to_vec()]
    }
    pub fn all_to_all(&self, sends: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
        sends
    }
    pub fn abort(&self, code: i32) -> ! {
        std::process::exit(code)
    }
    #[cfg(feature = "mpi")]
    pub fn raw(&self) -> Option<mpi::ffi::MPI_Comm> {
        None
    }
}
