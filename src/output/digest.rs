//! The fingerprint of a state: the same for every distribution over ranks and order in memory.

use crate::exchange::Communicator;
use crate::state::{ContactMemory, GlobalState, ParticleState};
use std::fmt;
use std::str::FromStr;
use xxhash_rust::xxh3::{Xxh3, xxh3_128};

/// A 128-bit fingerprint, written as 32 hexadecimal digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Digest(pub u128);

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl FromStr for Digest {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let plain = text.len() == 32 && text.bytes().all(|b| b.is_ascii_hexdigit());
        match u128::from_str_radix(text, 16) {
            Ok(value) if plain => Ok(Self(value)),
            _ => Err(format!("`{text}` is not a digest of 32 hexadecimal digits")),
        }
    }
}

/// Digest of the whole state. Collective; every rank passes its owned particles and the contact rows
/// whose low id it owns, in any order, and every rank gets the same value.
///
/// Sum modulo 2¹²⁸ of the XXH3-128 of each particle's bytes, of each contact's key and memory, and of
/// the global state as JSON. Left out of the global state is what depends on output settings alone:
/// the number of history rows and of snapshots; and what has passed: the time before and the start of the stage before.
#[must_use]
pub fn digest(
    comm: &Communicator,
    global: &GlobalState,
    particles: &[ParticleState],
    memory: &ContactMemory,
) -> Digest {
    let mut own = 0u128;
    for particle in particles {
        own = own.wrapping_add(xxh3_128(bytemuck::bytes_of(particle)));
    }
    for (row, key) in memory.keys.iter().enumerate() {
        let mut hasher = Xxh3::new();
        hasher.update(bytemuck::bytes_of(key));
        hasher.update(bytemuck::cast_slice(memory.row(row)));
        own = own.wrapping_add(hasher.digest128());
    }
    if comm.rank() == 0 {
        own = own.wrapping_add(global_hash(global));
    }
    Digest(sum_over_ranks(comm, own))
}

/// Sum modulo 2¹²⁸ over all ranks. Collective.
pub(crate) fn sum_over_ranks(comm: &Communicator, own: u128) -> u128 {
    let parts = comm.all_gather(&own.to_le_bytes());
    parts.iter().fold(0u128, |sum, part| {
        let mut bytes = [0u8; 16];
        bytes.copy_from_slice(part);
        sum.wrapping_add(u128::from_le_bytes(bytes))
    })
}

fn global_hash(global: &GlobalState) -> u128 {
    let physical =
        GlobalState { history_rows: 0, snapshots: 0, previous_time: None, previous_stage: None, ..global.clone() };
    let json = serde_json::to_string(&physical).expect("a struct of numbers always has a JSON form");
    xxh3_128(json.as_bytes())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::state::{ContactKey, StageStart};
    use bytemuck::Zeroable;

    /// A state with `count` particles and a contact between each and the next, in a scrambled order.
    pub(crate) fn sample(count: u32) -> (GlobalState, Vec<ParticleState>, ContactMemory) {
        let global = GlobalState {
            step: 4200,
            time: 0.1 + 0.2,
            time_step: 1.0e-7 / 3.0,
            previous_time_step: 1.1e-7,
            initial_sides: [1.0, 2.0, 3.0],
            sides: [1.0, 2.0, 2.9],
            strain: [0.0, 0.0, 1.0 / 30.0],
            strain_rate: [0.0, 0.0, 0.3],
            stage: 1,
            stage_start_time: 0.05,
            stage_start_strain: [0.0; 3],
            stage_start_step: 17,
            stage_start_stress: [0.0; 3],
            history_rows: 3,
            snapshots: 2,
            measured_stress: [1.0e6, -2.5e-3, 7.0],
            particles: u64::from(count),
            quasi_static: None,
            previous_time: Some(0.3),
            previous_stage: None,
        };
        let mut particles = Vec::new();
        let mut memory = ContactMemory::new(3);
        for i in 0..count {
            // 7 and count are coprime in the tests: a scrambled order that meets every id.
            let id = i * 7 % count;
            let x = f64::from(id);
            let mut particle = ParticleState::zeroed();
            particle.id = id;
            particle.species = id % 2;
            particle.position = [x / 3.0, -x, x * 1.0e-9];
            particle.radius = 0.25e-6;
            particle.velocity = [x, 0.5, 0.1];
            particle.orientation = [1.0, 0.0, 0.0, x];
            particle.ledger[6] = x * 7.0;
            particle.image = [1, -2, i32::try_from(id).unwrap_or(0)];
            particles.push(particle);
            let other = (id + 1) % count;
            let key = ContactKey { low: id.min(other), high: id.max(other), shift: [0, 0, 1, 0] };
            memory.push(key, &[x, 0.0, -x / 7.0]);
        }
        (global, particles, memory)
    }

    fn reversed(memory: &ContactMemory) -> ContactMemory {
        let mut other = ContactMemory::new(memory.width);
        for row in (0..memory.keys.len()).rev() {
            other.push(memory.keys[row], memory.row(row));
        }
        other
    }

    #[test]
    fn digest_does_not_depend_on_order_in_memory() {
        let comm = Communicator::single();
        let (global, mut particles, memory) = sample(20);
        let first = digest(&comm, &global, &particles, &memory);
        particles.reverse();
        assert_eq!(first, digest(&comm, &global, &particles, &reversed(&memory)));
    }

    #[test]
    fn digest_sees_one_changed_bit_anywhere_but_not_the_output_counters() {
        let comm = Communicator::single();
        let (global, particles, memory) = sample(20);
        let first = digest(&comm, &global, &particles, &memory);
        let mut other = particles.clone();
        other[3].velocity[1] = f64::from_bits(other[3].velocity[1].to_bits() ^ 1);
        assert_ne!(first, digest(&comm, &global, &other, &memory));
        let mut other = memory.clone();
        other.values[5] += 8.0;
        assert_ne!(first, digest(&comm, &global, &particles, &other));
        let other = GlobalState { time: 0.3, ..global.clone() };
        assert_ne!(first, digest(&comm, &other, &particles, &memory));
        let start = StageStart { time: 0.1, step: 1, strain: [0.0; 3], stress: [0.0; 3] };
        let (previous_time, previous_stage) = (None, Some(start));
        let other = GlobalState { history_rows: 99, snapshots: 98, previous_time, previous_stage, ..global };
        assert_eq!(first, digest(&comm, &other, &particles, &memory));
    }

    #[test]
    fn digest_text_reads_back() {
        let digest = Digest(0x00ab_cdef);
        assert_eq!(digest.to_string(), "00000000000000000000000000abcdef");
        assert_eq!(digest.to_string().parse(), Ok(digest));
        assert!("12".parse::<Digest>().is_err());
    }
}
