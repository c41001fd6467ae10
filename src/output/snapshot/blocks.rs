//! Particles and contacts from wherever they are to blocks of ids, one per rank, in order.

use super::{SnapshotContact, SnapshotContacts, SnapshotParticle};
use crate::exchange::Communicator;
use bytemuck::Pod;

/// Rank whose block \[r N/P, (r + 1) N/P) holds `id`.
fn block_of(id: u64, total: u64, size: usize) -> usize {
    let wide = |rank: usize| (rank as u128 * u128::from(total) / size as u128) as u64;
    let mut rank = ((u128::from(id) * size as u128 / u128::from(total.max(1))) as usize).min(size - 1);
    while rank + 1 < size && wide(rank + 1) <= id {
        rank += 1;
    }
    while wide(rank) > id {
        rank -= 1;
    }
    rank
}

/// First id of the own block, and its particles sorted by id. Collective.
pub(super) fn particles_by_id(
    comm: &Communicator,
    total: u64,
    particles: Vec<SnapshotParticle>,
) -> (u64, Vec<SnapshotParticle>) {
    let mut sends = vec![Vec::new(); comm.size()];
    for particle in &particles {
        sends[block_of(particle.id.into(), total, comm.size())].extend_from_slice(bytemuck::bytes_of(particle));
    }
    let mut own: Vec<SnapshotParticle> = received(&comm.all_to_all(sends));
    own.sort_unstable_by_key(|particle| particle.id);
    (comm.exclusive_sum(own.len() as u64), own)
}

/// Contacts of the own block of low ids, sorted by key. Collective.
pub(super) fn contacts_by_key(comm: &Communicator, total: u64, input: SnapshotContacts) -> SnapshotContacts {
    let mut contacts = vec![Vec::new(); comm.size()];
    let mut memory = vec![Vec::new(); comm.size()];
    for (row, contact) in input.contacts.iter().enumerate() {
        let rank = block_of(contact.key.low.into(), total, comm.size());
        contacts[rank].extend_from_slice(bytemuck::bytes_of(contact));
        let values = &input.memory[row * input.width..(row + 1) * input.width];
        memory[rank].extend_from_slice(bytemuck::cast_slice(values));
    }
    let contacts: Vec<SnapshotContact> = received(&comm.all_to_all(contacts));
    let memory: Vec<f64> = received(&comm.all_to_all(memory));
    let mut order: Vec<usize> = (0..contacts.len()).collect();
    order.sort_unstable_by_key(|&row| contacts[row].key);
    SnapshotContacts {
        contacts: order.iter().map(|&row| contacts[row]).collect(),
        memory: order.iter().flat_map(|&row| &memory[row * input.width..(row + 1) * input.width]).copied().collect(),
        ..input
    }
}

fn received<T: Pod>(parts: &[Vec<u8>]) -> Vec<T> {
    parts.iter().flat_map(|part| bytemuck::pod_collect_to_vec::<u8, T>(part)).collect()
}

#[cfg(test)]
mod tests {
    use super::block_of;

    #[test]
    fn blocks_tile_the_ids_for_any_number_of_ranks() {
        for (total, size) in [(1u64, 3usize), (7, 3), (10, 4), (3, 8), (1000, 7), (5, 5)] {
            for id in 0..total {
                let rank = block_of(id, total, size) as u64;
                let size = size as u64;
                assert!(rank * total / size <= id && id < (rank + 1) * total / size, "{id} of {total} on {size}");
            }
        }
    }
}
