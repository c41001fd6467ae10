//! Particles and their contact memory move to the ranks that own their positions: all of them at the
//! start, and those that crossed a border at every rebuild. Nothing is lost on the way, which is checked.

use super::redistribute::{block_of, check_ids, unknown_id};
use super::rows::{check_same, push_row, read_rows, read_states};
use super::{Communicator, Decomposition, agree};
use crate::error::{Error, Result};
use crate::state::particles::{Extras, Particles, SpeciesConstants};
use crate::state::{ContactKey, ContactMemory, ParticleState};
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::BTreeMap;

/// What migration reads beside particles and memory; the same on all ranks.
#[derive(Debug, Clone, Copy)]
pub struct MigrationSetting<'a> {
    /// Who owns which part of the cell.
    pub decomposition: &'a Decomposition,
    /// Constants per species.
    pub species: &'a [SpeciesConstants],
    /// Cell sides \[m\].
    pub sides: [f64; 3],
    /// What of a particle is followed.
    pub extras: Extras,
    /// Number of particles over all ranks; ids from here on are walls.
    pub particles_total: u64,
    /// The current step, for messages.
    pub step: u64,
}

impl MigrationSetting<'_> {
    fn fault(&self, message: String) -> Error {
        Error::Simulation { step: self.step, message }
    }

    /// Owner of this position on this rank's own authority.
    fn owner(&self, rank: usize, id: u32, position: [f64; 3]) -> Result<usize> {
        if position.iter().all(|x| x.is_finite()) {
            return Ok(self.decomposition.owner(position, self.sides));
        }
        Err(self.fault(format!(
            "rank {rank}: particle {id} is at {position:?} m; the motion is unstable: take a smaller time step, or look \
             for an extreme overlap at the start"
        )))
    }
}

/// Send each particle outside this rank's box to its owner, with every row of contact memory that
/// involves it, and drop the rows of which no end is left here. Ghosts are dropped. Particles that stay
/// keep their order and come before those that arrive. Returns how many moved, over all ranks.
/// Collective.
///
/// A row is held by the owner of each of its ends (walls have none); copies of a row are identical.
///
/// # Errors
/// [`Error::Simulation`], on all ranks, if a position is not finite, copies of a row differ, or a
/// particle was lost.
pub fn migrate(
    comm: &Communicator,
    setting: &MigrationSetting,
    particles: &mut Particles,
    memory: &mut ContactMemory,
) -> Result<usize> {
    particles.drop_ghosts();
    let rank = comm.rank();
    let owners: Result<Vec<usize>> = (0..particles.owned)
        .map(|index| setting.owner(rank, particles.id[index], particles.record[index].position))
        .collect();
    let owners = agree(comm, owners)?;
    if comm.size() == 1 {
        return Ok(0);
    }
    let before = census(particles);
    let mut parcels = BTreeMap::<usize, Parcel>::new();
    let leaving: FxHashMap<u32, usize> = (0..particles.owned)
        .filter(|&index| owners[index] != rank)
        .map(|index| (particles.id[index], owners[index]))
        .collect();
    for index in (0..particles.owned).filter(|&index| owners[index] != rank) {
        parcels.entry(owners[index]).or_default().states.push(particles.state(index));
    }
    if !leaving.is_empty() {
        keep_owned(particles, |index| owners[index] == rank);
        hand_over_rows(&mut parcels, &leaving, &particles.id, memory);
    }
    let parcels = parcels.into_iter().map(|(to, parcel)| (to, parcel.to_bytes())).collect();
    let received = deliver(comm, &setting.decomposition.neighbours(rank), parcels);
    let arriving = Parcel::from_bytes(&received, memory.width);
    append(particles, Particles::from_states(&arriving.states, setting.species, setting.extras));
    agree(comm, merge_rows(memory, &arriving.rows, setting.step))?;
    let after = census(particles);
    conserved(comm, setting, [before[0], after[0], before[1], after[1], leaving.len() as i64])
}

/// Send each parcel to its rank; returned is what came, in order of the senders. Between two rebuilds
/// particles cross into neighbouring boxes, and then nothing here grows with the number of all ranks;
/// if any rank has a parcel for a farther one, all ranks exchange with all. Collective.
fn deliver(comm: &Communicator, neighbours: &[usize], parcels: BTreeMap<usize, Vec<u8>>) -> Vec<Vec<u8>> {
    let mut far = [i64::from(parcels.keys().any(|to| neighbours.binary_search(to).is_err()))];
    comm.max_i64(&mut far);
    if far[0] != 0 {
        let mut sends = vec![Vec::new(); comm.size()];
        for (to, parcel) in parcels {
            sends[to] = parcel;
        }
        return comm.all_to_all(sends);
    }
    let length = |to: &usize| parcels.get(to).map_or(0, |parcel| parcel.len() as u64);
    let lengths: Vec<u64> = neighbours.iter().map(length).collect();
    let mut coming = vec![0_u64; neighbours.len()];
    comm.exchange_each(
        neighbours.iter().zip(&lengths).map(|(&to, length)| (to, bytemuck::bytes_of(length))),
        neighbours.iter().zip(&mut coming).map(|(&from, length)| (from, bytemuck::bytes_of_mut(length))),
        || (),
    );
    let mut received: Vec<Vec<u8>> = coming.iter().map(|&length| vec![0; length as usize]).collect();
    comm.exchange_each(
        parcels.iter().map(|(&to, parcel)| (to, parcel.as_slice())),
        neighbours.iter().zip(&mut received).map(|(&from, place)| (from, place.as_mut_slice())),
        || (),
    );
    received
}

/// Keep the owned particles at these indices, in their order. There are no ghosts.
fn keep_owned(particles: &mut Particles, keep: impl Fn(usize) -> bool) {
    fn sift<T>(values: &mut Vec<T>, keep: &impl Fn(usize) -> bool) {
        let mut index = 0;
        values.retain(|_| {
            index += 1;
            keep(index - 1)
        });
    }
    // Naming every field makes the compiler ask here for a field added later.
    let Particles { owned, id, species, record, extras: _, shape, image, velocity, spin, orientation, ledger } =
        particles;
    sift(id, &keep);
    sift(species, &keep);
    sift(record, &keep);
    sift(shape, &keep);
    sift(image, &keep);
    sift(velocity, &keep);
    sift(spin, &keep);
    sift(orientation, &keep);
    sift(ledger, &keep);
    *owned = id.len();
}

/// Append the owned particles of `more`. There are no ghosts.
fn append(particles: &mut Particles, more: Particles) {
    let Particles { owned, id, species, record, extras: _, shape, image, velocity, spin, orientation, ledger } = more;
    particles.owned += owned;
    particles.id.extend(id);
    particles.species.extend(species);
    particles.record.extend(record);
    particles.shape.extend(shape);
    particles.image.extend(image);
    particles.velocity.extend(velocity);
    particles.spin.extend(spin);
    particles.orientation.extend(orientation);
    particles.ledger.extend(ledger);
}

/// Number of owned particles and sum of their ids.
fn census(particles: &Particles) -> [i64; 2] {
    [particles.owned as i64, particles.id[..particles.owned].iter().map(|&id| i64::from(id)).sum()]
}

/// That number and ids are what they were; returns the number of moved particles.
fn conserved(comm: &Communicator, setting: &MigrationSetting, mut counts: [i64; 5]) -> Result<usize> {
    comm.sum_i64(&mut counts);
    let [before, after, ids_before, ids_after, moved] = counts;
    if before == after && ids_before == ids_after && after as u64 == setting.particles_total {
        return Ok(moved as usize);
    }
    Err(setting.fault(format!(
        "migration lost particles: there are to be {}, there were {before} (sum of ids {ids_before}) before and \
         {after} (sum of ids {ids_after}) after; this is an error of the program: report it",
        setting.particles_total
    )))
}

/// Copy rows to where their ends go, then keep those that still have an end in `staying`.
fn hand_over_rows(
    parcels: &mut BTreeMap<usize, Parcel>,
    leaving: &FxHashMap<u32, usize>,
    staying: &[u32],
    memory: &mut ContactMemory,
) {
    let staying: FxHashSet<u32> = staying.iter().copied().collect();
    let mut kept = ContactMemory::new(memory.width);
    for (index, key) in memory.keys.iter().enumerate() {
        let row = memory.row(index);
        let (low, high) = (leaving.get(&key.low), leaving.get(&key.high));
        if let Some(&to) = low {
            push_row(&mut parcels.entry(to).or_default().rows, key, row);
        }
        if let Some(&to) = high.filter(|&to| low != Some(to)) {
            push_row(&mut parcels.entry(to).or_default().rows, key, row);
        }
        // Walls are never in `staying`: a wall's row goes with its particle.
        if staying.contains(&key.low) || staying.contains(&key.high) {
            kept.push(*key, row);
        }
    }
    *memory = kept;
}

/// Append rows that are not there yet; those that are must be the same.
fn merge_rows(memory: &mut ContactMemory, arriving: &ContactMemory, step: u64) -> Result<()> {
    if arriving.keys.is_empty() {
        return Ok(());
    }
    let mut places: FxHashMap<ContactKey, usize> =
        memory.keys.iter().enumerate().map(|(index, key)| (*key, index)).collect();
    for (index, key) in arriving.keys.iter().enumerate() {
        if let Some(&place) = places.get(key) {
            check_same(*key, memory.row(place), arriving.row(index), step)?;
        } else {
            places.insert(*key, memory.keys.len());
            memory.push(*key, arriving.row(index));
        }
    }
    Ok(())
}

/// What one rank sends to another in a migration.
#[derive(Clone, Default)]
struct Parcel {
    states: Vec<ParticleState>,
    rows: Vec<u8>,
}

/// All parcels that a rank received, opened.
struct Arriving {
    states: Vec<ParticleState>,
    rows: ContactMemory,
}

impl Parcel {
    /// The number of states, the states, the rows; nothing at all if both are empty.
    fn to_bytes(&self) -> Vec<u8> {
        if self.states.is_empty() && self.rows.is_empty() {
            return Vec::new();
        }
        let states: &[u8] = bytemuck::cast_slice(&self.states);
        [&(self.states.len() as u64).to_le_bytes(), states, &self.rows].concat()
    }

    fn from_bytes(received: &[Vec<u8>], width: usize) -> Arriving {
        let mut arriving = Arriving { states: Vec::new(), rows: ContactMemory::new(width) };
        for bytes in received {
            let Some((count, rest)) = bytes.split_first_chunk() else { continue };
            let count = u64::from_le_bytes(*count) as usize;
            let (states, rows) = rest.split_at(count * size_of::<ParticleState>());
            read_states(states, &mut arriving.states);
            read_rows(rows, &mut arriving.rows);
        }
        arriving
    }
}

/// Initial distribution: states held by any ranks go to the owners of their positions, rows of contact
/// memory to the owners of both ends. Collective; each id and each row is passed by one rank (equal
/// copies of rows merge).
///
/// # Errors
/// [`Error::Simulation`], on all ranks, if an id is missing, doubled or not below
/// `setting.particles_total`, or a position is not finite.
pub fn distribute(
    comm: &Communicator,
    setting: &MigrationSetting,
    states: &[ParticleState],
    memory: &ContactMemory,
) -> Result<(Particles, ContactMemory)> {
    agree(comm, check_ids(states, setting.particles_total, setting.step))?;
    let owners: Result<Vec<usize>> =
        states.iter().map(|state| setting.owner(comm.rank(), state.id, state.position)).collect();
    let owners = agree(comm, owners)?;
    let mut parcels = vec![Parcel::default(); comm.size()];
    for (state, &owner) in states.iter().zip(&owners) {
        parcels[owner].states.push(*state);
    }
    let entries = states.iter().zip(&owners).map(|(state, &owner)| [state.id, owner as u32]);
    let directory = Directory::build(comm, setting, entries)?;
    let owner_of = directory.look_up(comm, memory)?;
    for (index, key) in memory.keys.iter().enumerate() {
        let (low, high) = (owner_of.get(&key.low), owner_of.get(&key.high));
        for &to in low.into_iter().chain(high.filter(|&to| low != Some(to))) {
            push_row(&mut parcels[to as usize].rows, key, memory.row(index));
        }
    }
    // Each copy of the particles goes as soon as the next one stands.
    let received = comm.all_to_all(parcels.into_iter().map(|parcel| parcel.to_bytes()).collect());
    let arriving = Parcel::from_bytes(&received, memory.width);
    drop(received);
    let particles = Particles::from_states(&arriving.states, setting.species, setting.extras);
    let mut owned_memory = ContactMemory::new(memory.width);
    agree(comm, merge_rows(&mut owned_memory, &arriving.rows, setting.step))?;
    Ok((particles, owned_memory))
}

/// Who owns which particle, each rank knowing it for one block of ids.
struct Directory<'a> {
    setting: &'a MigrationSetting<'a>,
    owners: FxHashMap<u32, u32>,
}

impl<'a> Directory<'a> {
    /// From each rank's pairs (id, owner).
    fn build(
        comm: &Communicator,
        setting: &'a MigrationSetting<'a>,
        entries: impl Iterator<Item = [u32; 2]>,
    ) -> Result<Self> {
        let total = setting.particles_total;
        let mut sends = vec![Vec::new(); comm.size()];
        for entry in entries {
            sends[block_of(u64::from(entry[0]), total, comm.size())].extend_from_slice(bytemuck::bytes_of(&entry));
        }
        let mut owners = FxHashMap::default();
        let mut doubled = None;
        for bytes in comm.all_to_all(sends) {
            for pair in bytes.chunks_exact(size_of::<[u32; 2]>()) {
                let [id, owner]: [u32; 2] = bytemuck::pod_read_unaligned(pair);
                if owners.insert(id, owner).is_some() {
                    doubled = Some(id);
                }
            }
        }
        let unique = doubled.map_or(Ok(()), |id| {
            Err(setting.fault(format!("particle {id} is given twice; ids must be 0 … {}", total.saturating_sub(1))))
        });
        agree(comm, unique)?;
        let mut known = [owners.len() as i64];
        comm.sum_i64(&mut known);
        if known[0] as u64 != total {
            return Err(setting.fault(format!(
                "{} particles are given where {total} are expected; ids must be 0 … {}, each once",
                known[0],
                total.saturating_sub(1)
            )));
        }
        Ok(Self { setting, owners })
    }

    /// Owners of all particles that this rank's rows mention.
    fn look_up(&self, comm: &Communicator, memory: &ContactMemory) -> Result<FxHashMap<u32, u32>> {
        let total = self.setting.particles_total;
        let wrong = memory.keys.iter().find(|key| u64::from(key.low) >= total);
        agree(comm, wrong.map_or(Ok(()), |key| Err(unknown_id(key.low, total, self.setting.step))))?;
        let mut ids: Vec<u32> = memory.keys.iter().flat_map(|key| [key.low, key.high]).collect();
        ids.retain(|&id| u64::from(id) < total);
        ids.sort_unstable();
        ids.dedup();
        let mut questions = vec![Vec::new(); comm.size()];
        for id in &ids {
            questions[block_of(u64::from(*id), total, comm.size())].extend_from_slice(&id.to_ne_bytes());
        }
        let mut answers = comm.all_to_all(questions);
        for id in answers.iter_mut().flat_map(|bytes| bytes.chunks_exact_mut(size_of::<u32>())) {
            let owner = self.owners[&bytemuck::pod_read_unaligned::<u32>(id)];
            id.copy_from_slice(&owner.to_ne_bytes());
        }
        // Sorted ids were asked in order of blocks, so the answers in order of ranks match them one by one.
        let owners = comm.all_to_all(answers);
        let owners = owners.iter().flat_map(|bytes| bytes.chunks_exact(size_of::<u32>()));
        Ok(ids.into_iter().zip(owners.map(bytemuck::pod_read_unaligned::<u32>)).collect())
    }
}
