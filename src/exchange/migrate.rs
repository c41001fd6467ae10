//! Particles to the ranks that own their positions, each with the memory of its contacts.

use super::redistribute::{block_of, send_memory};
use super::{Communicator, Decomposition, agree};
use crate::error::{Error, Result};
use crate::state::particles::{Particles, SpeciesConstants};
use crate::state::{ContactMemory, ParticleState};
use rustc_hash::FxHashMap;

/// What migration must know of the run.
#[derive(Debug, Clone, Copy)]
pub struct MigrationSetting<'a> {
    /// Constants per species.
    pub species: &'a [SpeciesConstants],
    /// Time step that led to the present positions \[s\].
    pub time_step: f64,
    /// Cell sides \[m\].
    pub sides: [f64; 3],
    /// Number of particles on all ranks.
    pub total: u64,
}

/// Move owned particles (no ghosts may be there) to the owners of their positions, with every memory
/// row that names them; drop the rows that no longer concern this rank.
///
/// # Errors
/// Particles were lost or doubled on the way: the sum over ranks is not the total.
pub fn migrate(
    comm: &Communicator,
    decomposition: &Decomposition,
    particles: &mut Particles,
    memory: &mut ContactMemory,
    setting: &MigrationSetting,
) -> Result<()> {
    if comm.size() == 1 {
        return Ok(());
    }
    let rank = comm.rank();
    let owner: Vec<usize> =
        particles.record.iter().map(|record| decomposition.owner(record.position, setting.sides)).collect();
    let mut moving = [f64::from(u8::from(owner.iter().any(|to| *to != rank)))];
    comm.max_f64(&mut moving);
    let to: FxHashMap<u32, usize> = particles.id.iter().copied().zip(owner.iter().copied()).collect();
    let mut rows: Vec<(usize, usize)> = Vec::new();
    let mut kept = ContactMemory::new(memory.width);
    for (row, key) in memory.keys.iter().enumerate() {
        let (low, high) = (to.get(&key.low).copied(), to.get(&key.high).copied());
        if low == Some(rank) || high == Some(rank) {
            kept.push(*key, memory.row(row));
        }
        rows.extend(low.filter(|to| *to != rank).map(|to| (row, to)));
        rows.extend(high.filter(|to| *to != rank && Some(*to) != low).map(|to| (row, to)));
    }
    if moving[0] != 0.0 {
        let mut sends = vec![Vec::new(); comm.size()];
        let mut states = Vec::with_capacity(particles.owned);
        for (index, to) in owner.iter().enumerate() {
            let state = particles.state(index);
            if *to == rank {
                states.push(state);
            } else {
                sends[*to].extend_from_slice(bytemuck::bytes_of(&state));
            }
        }
        for received in comm.all_to_all(sends) {
            states.extend(bytemuck::pod_collect_to_vec::<u8, ParticleState>(&received));
        }
        let received = send_memory(comm, memory, &rows);
        for (row, key) in received.keys.iter().enumerate() {
            kept.push(*key, received.row(row));
        }
        *particles = Particles::from_states(&states, setting.species, setting.time_step);
    }
    *memory = kept.sorted_without_copies();
    let mut count = [particles.owned as i64];
    comm.sum_i64(&mut count);
    if count[0] == setting.total as i64 {
        return Ok(());
    }
    Err(Error::Layout(format!(
        "{} particles after migration, {} expected: this is a fault of the program; please report it with the input",
        count[0], setting.total
    )))
}

/// Particles that lie on any ranks, and contact memory that lies on any ranks, to their owners: a memory
/// row goes to the owners of both its ends.
///
/// # Errors
/// A particle is missing.
pub fn distribute(
    comm: &Communicator,
    decomposition: &Decomposition,
    particles: Vec<ParticleState>,
    memory: ContactMemory,
    sides: [f64; 3],
    total: u64,
) -> Result<(Vec<ParticleState>, ContactMemory)> {
    let ranks = comm.size();
    if ranks == 1 {
        return Ok((particles, memory));
    }
    let mut sends = vec![Vec::new(); ranks];
    for state in &particles {
        sends[decomposition.owner(state.position, sides)].extend_from_slice(bytemuck::bytes_of(state));
    }
    let owned: Vec<ParticleState> = bytemuck::pod_collect_to_vec(&comm.all_to_all(sends).concat());
    // A directory: the rank that holds the block of an id learns who owns the particle.
    let mut announcements = vec![Vec::new(); ranks];
    for state in &owned {
        let entry = [state.id, comm.rank() as u32];
        announcements[block_of(state.id, total, ranks)].extend_from_slice(bytemuck::bytes_of(&entry));
    }
    let entries: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&comm.all_to_all(announcements).concat());
    let directory: FxHashMap<u32, usize> = entries.iter().map(|[id, rank]| (*id, *rank as usize)).collect();
    // Each row visits the directory of its low end and that of its high end.
    let to_directory = |memory: &ContactMemory, id: fn(&crate::state::ContactKey) -> u32| {
        let in_range = |id: u32| u64::from(id) < total;
        let rows: Vec<(usize, usize)> = memory
            .keys
            .iter()
            .enumerate()
            .filter(|(_, key)| in_range(id(key)))
            .map(|(row, key)| (row, block_of(id(key), total, ranks)))
            .collect();
        send_memory(comm, memory, &rows)
    };
    let to_owner = |memory: &ContactMemory, id: fn(&crate::state::ContactKey) -> u32| -> Result<ContactMemory> {
        let mut rows = Vec::with_capacity(memory.keys.len());
        let mut missing = Ok(());
        for (row, key) in memory.keys.iter().enumerate() {
            match directory.get(&id(key)) {
                Some(rank) => rows.push((row, *rank)),
                None => missing = Err(Error::Layout(format!("no rank owns particle {} of a contact", id(key)))),
            }
        }
        agree(comm, missing)?;
        Ok(send_memory(comm, memory, &rows))
    };
    let mut mine = to_owner(&to_directory(&memory, |key| key.low), |key| key.low)?;
    let of_high = to_owner(&to_directory(&memory, |key| key.high), |key| key.high)?;
    for (row, key) in of_high.keys.iter().enumerate() {
        mine.push(*key, of_high.row(row));
    }
    Ok((owned, mine.sorted_without_copies()))
}
