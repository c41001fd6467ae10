//! Particles and contacts from wherever they are to blocks of ids, one per rank, in order.

use super::{SnapshotContact, SnapshotContacts, SnapshotParticle};
use crate::exchange::Communicator;
use crate::exchange::redistribute::block_of;
use bytemuck::Pod;

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
