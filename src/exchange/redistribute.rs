//! Particles and contact memory in blocks of consecutive ids, one block per rank: the order in which
//! files hold them, whatever the decomposition.

use super::rows::{push_row, read_rows, read_states, sorted_unique};
use super::{Communicator, agree};
use crate::error::{Error, Result};
use crate::state::{ContactMemory, ParticleState};

/// First id of the block of `rank`; `rank == ranks` gives the end of the last one.
#[must_use]
pub fn block_start(rank: usize, total: u64, ranks: usize) -> u64 {
    (rank as u128 * u128::from(total) / ranks as u128) as u64
}

/// Rank whose block holds `id` < `total`: block r is \[r N/P, (r+1) N/P).
#[must_use]
pub fn block_of(id: u64, total: u64, ranks: usize) -> usize {
    (((u128::from(id) + 1) * ranks as u128 - 1) / u128::from(total.max(1))) as usize
}

/// All particles, each rank getting the block of ids that starts at the returned one, in order of id.
/// Collective.
///
/// # Errors
/// [`Error::Simulation`], on all ranks, if an id is missing, doubled or not below `total`.
pub fn to_id_blocks(
    comm: &Communicator,
    total: u64,
    particles: Vec<ParticleState>,
    step: u64,
) -> Result<(u64, Vec<ParticleState>)> {
    agree(comm, check_ids(&particles, total, step))?;
    let start = block_start(comm.rank(), total, comm.size());
    let end = block_start(comm.rank() + 1, total, comm.size());
    let mut block = if comm.size() == 1 {
        particles
    } else {
        let mut sends = vec![Vec::new(); comm.size()];
        for state in &particles {
            let to = block_of(u64::from(state.id), total, comm.size());
            sends[to].extend_from_slice(bytemuck::bytes_of(state));
        }
        drop(particles);
        let mut block = Vec::with_capacity((end - start) as usize);
        for bytes in comm.all_to_all(sends) {
            read_states(&bytes, &mut block);
        }
        block
    };
    block.sort_unstable_by_key(|state| state.id);
    agree(comm, check_block(&block, start, end, step))?;
    Ok((start, block))
}

/// Contact memory in blocks of the low id (the blocks of [`to_id_blocks`]), in order of the keys. A row
/// that two ranks pass comes out once. Collective.
///
/// # Errors
/// [`Error::Simulation`], on all ranks, if two copies of a row differ or a low id is not below `total`.
pub fn memory_to_id_blocks(
    comm: &Communicator,
    total: u64,
    memory: &ContactMemory,
    step: u64,
) -> Result<ContactMemory> {
    let wrong = memory.keys.iter().find(|key| u64::from(key.low) >= total);
    agree(comm, wrong.map_or(Ok(()), |key| Err(unknown_id(key.low, total, step))))?;
    if comm.size() == 1 {
        return sorted_unique(memory, step);
    }
    let mut sends = vec![Vec::new(); comm.size()];
    for (index, key) in memory.keys.iter().enumerate() {
        push_row(&mut sends[block_of(u64::from(key.low), total, comm.size())], key, memory.row(index));
    }
    let mut block = ContactMemory::new(memory.width);
    for bytes in comm.all_to_all(sends) {
        read_rows(&bytes, &mut block);
    }
    agree(comm, sorted_unique(&block, step))
}

pub(super) fn unknown_id(id: u32, total: u64, step: u64) -> Error {
    Error::Simulation {
        step,
        message: format!("particle id {id} is not below the number of particles, {total}; the input data are damaged"),
    }
}

pub(super) fn check_ids(particles: &[ParticleState], total: u64, step: u64) -> Result<()> {
    match particles.iter().find(|state| u64::from(state.id) >= total) {
        Some(state) => Err(unknown_id(state.id, total, step)),
        None => Ok(()),
    }
}

/// That a sorted block holds each id of start … end − 1 once.
fn check_block(block: &[ParticleState], start: u64, end: u64, step: u64) -> Result<()> {
    let fault = |message| Err(Error::Simulation { step, message });
    for (expected, state) in (start..).zip(block) {
        if u64::from(state.id) < expected {
            return fault(format!("particle {} is there twice; this is an error of the program: report it", state.id));
        }
        if u64::from(state.id) > expected {
            return fault(format!("particle {expected} was lost; this is an error of the program: report it"));
        }
    }
    if block.len() as u64 != end - start {
        return fault(format!(
            "particle {} was lost; this is an error of the program: report it",
            start + block.len() as u64
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::ContactKey;
    use bytemuck::Zeroable;

    fn state(id: u32) -> ParticleState {
        ParticleState { id, ..ParticleState::zeroed() }
    }

    #[test]
    fn blocks_tile_the_ids_and_block_of_is_their_inverse() {
        for (total, ranks) in [(10_u64, 3_usize), (7, 7), (3, 8), (1000, 6), (1, 1), (4_294_967_295, 1000)] {
            assert_eq!((block_start(0, total, ranks), block_start(ranks, total, ranks)), (0, total));
            for rank in 0..ranks {
                let (start, end) = (block_start(rank, total, ranks), block_start(rank + 1, total, ranks));
                if start < end {
                    assert_eq!((block_of(start, total, ranks), block_of(end - 1, total, ranks)), (rank, rank));
                }
            }
        }
    }

    #[test]
    fn a_lost_or_doubled_particle_is_named() {
        let comm = Communicator::single();
        let (start, block) = to_id_blocks(&comm, 3, vec![state(2), state(0), state(1)], 0).expect("complete");
        assert_eq!((start, block.iter().map(|s| s.id).collect::<Vec<_>>()), (0, vec![0, 1, 2]));
        let text = |states| to_id_blocks(&comm, 3, states, 5).map_err(|e| e.to_string()).unwrap_err();
        assert!(text(vec![state(2), state(0)]).contains("step 5: particle 1 was lost"));
        assert!(text(vec![state(1), state(0)]).contains("particle 2 was lost"));
        assert!(text(vec![state(2), state(0), state(0), state(1)]).contains("particle 0 is there twice"));
        assert!(text(vec![state(0), state(1), state(3)]).contains("id 3 is not below"));
    }

    #[test]
    fn memory_comes_out_in_order_of_keys() {
        let mut memory = ContactMemory::new(1);
        for (low, high) in [(2, 3), (0, 3), (0, 1)] {
            memory.push(ContactKey { low, high, shift: [0; 4] }, &[f64::from(low * 10 + high)]);
        }
        let block = memory_to_id_blocks(&Communicator::single(), 3, &memory, 0).expect("no copies");
        assert_eq!(block.values, [1.0, 3.0, 23.0]);
    }
}
