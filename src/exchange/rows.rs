//! Particle states and contact rows as bytes, and the merging of rows that arrive twice. Must not know
//! who sends what to whom.

use crate::error::{Error, Result};
use crate::state::{ContactKey, ContactMemory, ParticleState};

/// Bytes of one contact row: its key, then its values.
fn stride(width: usize) -> usize {
    size_of::<ContactKey>() + width * size_of::<f64>()
}

/// Append one contact row.
pub fn push_row(bytes: &mut Vec<u8>, key: &ContactKey, row: &[f64]) {
    bytes.extend_from_slice(bytemuck::bytes_of(key));
    bytes.extend_from_slice(bytemuck::cast_slice(row));
}

/// Append what [`push_row`] wrote to `memory`.
pub fn read_rows(bytes: &[u8], memory: &mut ContactMemory) {
    for row in bytes.chunks_exact(stride(memory.width)) {
        let (key, values) = row.split_at(size_of::<ContactKey>());
        memory.keys.push(bytemuck::pod_read_unaligned(key));
        memory.values.extend(values.chunks_exact(size_of::<f64>()).map(bytemuck::pod_read_unaligned::<f64>));
    }
}

/// Read what was written by appending `bytemuck::bytes_of(state)`.
pub fn read_states(bytes: &[u8], states: &mut Vec<ParticleState>) {
    states.extend(bytes.chunks_exact(size_of::<ParticleState>()).map(bytemuck::pod_read_unaligned::<ParticleState>));
}

/// The rows in order of their keys, each key once.
///
/// # Errors
/// [`Error::Simulation`] if two rows of one key differ: both ends of a contact compute the same bits.
pub fn sorted_unique(memory: &ContactMemory, step: u64) -> Result<ContactMemory> {
    let mut order: Vec<usize> = (0..memory.keys.len()).collect();
    order.sort_by_key(|&index| memory.keys[index]);
    let mut sorted = ContactMemory::new(memory.width);
    for index in order {
        let (key, row) = (memory.keys[index], memory.row(index));
        match sorted.keys.last() {
            Some(&last) if last == key => check_same(key, sorted.row(sorted.keys.len() - 1), row, step)?,
            _ => sorted.push(key, row),
        }
    }
    Ok(sorted)
}

/// That two copies of a row hold the same bits.
pub fn check_same(key: ContactKey, a: &[f64], b: &[f64], step: u64) -> Result<()> {
    match a.iter().zip(b).position(|(a, b)| a.to_bits() != b.to_bits()) {
        None => Ok(()),
        Some(column) => Err(Error::Simulation {
            step,
            message: format!(
                "the two copies of the memory of contact {}–{} (image shift {:?}) differ in column {column}: {:e} and \
                 {:e}; both ranks must compute the same bits, so this is an error of the program: report it",
                key.low,
                key.high,
                &key.shift[..3],
                a[column],
                b[column]
            ),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(low: u32, high: u32) -> ContactKey {
        ContactKey { low, high, shift: [0, -1, 0, 0] }
    }

    #[test]
    fn rows_come_back_as_written() {
        let mut bytes = Vec::new();
        push_row(&mut bytes, &key(1, 2), &[0.5, -0.0]);
        push_row(&mut bytes, &key(0, 9), &[f64::MIN_POSITIVE, 3.0]);
        let mut memory = ContactMemory::new(2);
        read_rows(&bytes, &mut memory);
        assert_eq!(memory.keys, [key(1, 2), key(0, 9)]);
        assert_eq!(memory.values, [0.5, -0.0, f64::MIN_POSITIVE, 3.0]);
    }

    #[test]
    fn copies_merge_and_differing_copies_are_an_error() {
        let mut memory = ContactMemory::new(1);
        memory.push(key(3, 4), &[1.0]);
        memory.push(key(1, 4), &[2.0]);
        memory.push(key(3, 4), &[1.0]);
        let sorted = sorted_unique(&memory, 0).expect("equal copies");
        assert_eq!((sorted.keys, sorted.values), (vec![key(1, 4), key(3, 4)], vec![2.0, 1.0]));
        memory.push(key(1, 4), &[2.5]);
        assert!(sorted_unique(&memory, 7).is_err());
    }

    #[test]
    fn rows_without_values_are_kept() {
        let mut bytes = Vec::new();
        push_row(&mut bytes, &key(1, 2), &[]);
        let mut memory = ContactMemory::new(0);
        read_rows(&bytes, &mut memory);
        assert_eq!(memory.keys, [key(1, 2)]);
    }
}
