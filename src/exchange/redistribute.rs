//! Stand-in: one process.
use super::Communicator;
use crate::state::{ContactMemory, ParticleState};

/// Blocks of ids.
pub fn to_id_blocks(_comm: &Communicator, _total: u64, mut particles: Vec<ParticleState>) -> (u64, Vec<ParticleState>) {
    particles.sort_by_key(|p| p.id);
    (0, particles)
}

/// Blocks of low ids.
pub fn memory_to_id_blocks(_comm: &Communicator, _total: u64, memory: ContactMemory) -> ContactMemory {
    let mut order: Vec<usize> = (0..memory.keys.len()).collect();
    order.sort_by_key(|&i| memory.keys[i]);
    let mut sorted = ContactMemory::new(memory.width);
    for i in order {
        sorted.push(memory.keys[i], memory.row(i));
    }
    sorted
}
