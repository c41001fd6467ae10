//! Rows to the ranks that hold the blocks of their ids: how files come to be in id order.

use super::Communicator;
use crate::state::{ContactMemory, ParticleState};

/// The rank whose id block `[r·N/P, (r+1)·N/P)` holds an id.
#[must_use]
pub fn block_of(id: u32, total: u64, ranks: usize) -> usize {
    (((u64::from(id) + 1) * ranks as u64 - 1) / total) as usize
}

/// Particles to their id blocks, sorted by id, with the first id of this rank's block.
#[must_use]
pub fn to_id_blocks(comm: &Communicator, total: u64, particles: Vec<ParticleState>) -> (u64, Vec<ParticleState>) {
    let ranks = comm.size();
    let start = comm.rank() as u64 * total / ranks as u64;
    let mut particles = if ranks == 1 {
        particles
    } else {
        let mut sends = vec![Vec::new(); ranks];
        for state in &particles {
            sends[block_of(state.id, total, ranks)].extend_from_slice(bytemuck::bytes_of(state));
        }
        bytemuck::pod_collect_to_vec(&comm.all_to_all(sends).concat())
    };
    particles.sort_unstable_by_key(|state| state.id);
    (start, particles)
}

/// Contact memory to the id blocks of the lower ids, sorted by key.
#[must_use]
pub fn memory_to_id_blocks(comm: &Communicator, total: u64, memory: ContactMemory) -> ContactMemory {
    let ranks = comm.size();
    if ranks == 1 {
        return memory.sorted_without_copies();
    }
    let rows: Vec<(usize, usize)> =
        memory.keys.iter().enumerate().map(|(row, key)| (row, block_of(key.low, total, ranks))).collect();
    send_memory(comm, &memory, &rows).sorted_without_copies()
}

/// Send rows of contact memory, given as (row, rank); returns what arrives, own rows included.
#[must_use]
pub fn send_memory(comm: &Communicator, memory: &ContactMemory, rows: &[(usize, usize)]) -> ContactMemory {
    let mut keys = vec![Vec::new(); comm.size()];
    let mut values = vec![Vec::new(); comm.size()];
    for (row, to) in rows {
        keys[*to].extend_from_slice(bytemuck::bytes_of(&memory.keys[*row]));
        values[*to].extend_from_slice(bytemuck::cast_slice(memory.row(*row)));
    }
    ContactMemory {
        keys: bytemuck::pod_collect_to_vec(&comm.all_to_all(keys).concat()),
        width: memory.width,
        values: bytemuck::pod_collect_to_vec(&comm.all_to_all(values).concat()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_id_lies_in_its_block() {
        for total in [1_u64, 7, 10, 250, 1001] {
            for ranks in [1_usize, 2, 3, 8, 13] {
                for id in 0..total {
                    let rank = block_of(id as u32, total, ranks) as u64;
                    let (from, to) = (rank * total / ranks as u64, (rank + 1) * total / ranks as u64);
                    assert!((from..to).contains(&id), "id {id} of {total} on {ranks}: rank {rank}");
                }
            }
        }
    }
}
