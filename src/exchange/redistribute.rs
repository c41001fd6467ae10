//! Stand-in: one process.
use super::Communicator;
use crate::error::Result;
use crate::state::{ContactMemory, ParticleState};

/// First id of a block.
#[must_use]
pub fn block_start(rank: usize, total: u64, ranks: usize) -> u64 {
    (rank as u128 * u128::from(total) / ranks as u128) as u64
}

/// Rank of an id.
#[must_use]
pub fn block_of(id: u64, total: u64, ranks: usize) -> usize {
    (((u128::from(id) + 1) * ranks as u128 - 1) / u128::from(total.max(1))) as usize
}

/// Blocks of ids.
#[allow(clippy::missing_errors_doc)]
pub fn to_id_blocks(
    _comm: &Communicator,
    _total: u64,
    mut particles: Vec<ParticleState>,
    _step: u64,
) -> Result<(u64, Vec<ParticleState>)> {
    particles.sort_by_key(|p| p.id);
    Ok((0, particles))
}

/// Blocks of low ids.
#[allow(clippy::missing_errors_doc)]
pub fn memory_to_id_blocks(
    _comm: &Communicator,
    _total: u64,
    memory: &ContactMemory,
    _step: u64,
) -> Result<ContactMemory> {
    let mut order: Vec<usize> = (0..memory.keys.len()).collect();
    order.sort_by_key(|&i| memory.keys[i]);
    let mut sorted = ContactMemory::new(memory.width);
    for i in order {
        sorted.push(memory.keys[i], memory.row(i));
    }
    Ok(sorted)
}
