//! Ghosts: copies of the remote particles that owned ones may touch, one per particle at its wrapped
//! position, however many of its images matter (image shifts live in the contacts).
//!
//! The plan is made when the lists are; between, each step sends positions, image counters and
//! velocities straight to every rank that needs them, however many subdomains away it is.

use super::{Communicator, Decomposition};
use crate::error::Result;
use crate::state::particles::{Particles, Record};

/// Words per ghost and step: position, image counter, velocity, spin.
const MOVING_WORDS: usize = 10;
/// Words per ghost when the plan is made: identity, image, the whole record.
const STATIC_WORDS: usize = 15;
/// Bits per axis of the image counter in the message of a step.
const IMAGE_BITS: u32 = 21;

/// What goes to one rank.
#[derive(Debug)]
struct Send {
    rank: usize,
    particles: Vec<u32>,
    buffer: Vec<u64>,
}

/// What comes from one rank: ghosts `first ..`.
#[derive(Debug)]
struct Receive {
    rank: usize,
    first: usize,
    buffer: Vec<u64>,
}

/// Who sends which particles to whom.
#[derive(Debug, Default)]
pub struct HaloPlan {
    sends: Vec<Send>,
    receives: Vec<Receive>,
}

/// Ranks that may exchange ghosts, and the columns of the grid that a particle is needed in.
struct Neighbourhood<'a> {
    decomposition: &'a Decomposition,
    sides: [f64; 3],
    periodic: [bool; 3],
    rank: usize,
}

impl Neighbourhood<'_> {
    /// Columns along an axis whose interval, grown by `margin`, holds some image of `x`.
    fn columns(&self, axis: usize, x: f64, margin: f64) -> Vec<usize> {
        let count = self.decomposition.grid[axis] as i64;
        let width = self.sides[axis] / count as f64;
        // A hair wider, so that rounding never costs a ghost.
        let margin = margin * (1.0 + 1e-9);
        let (first, last) = (((x - margin) / width).floor() as i64, ((x + margin) / width).floor() as i64);
        if last - first + 1 >= count {
            return (0..count as usize).collect();
        }
        if self.periodic[axis] {
            (first..=last).map(|column| column.rem_euclid(count) as usize).collect()
        } else {
            (first.max(0)..=last.min(count - 1)).map(|column| column as usize).collect()
        }
    }

    /// The other ranks of the product of columns, ascending.
    fn ranks(&self, columns: [Vec<usize>; 3]) -> Vec<usize> {
        let mut ranks = Vec::new();
        for x in &columns[0] {
            for y in &columns[1] {
                for z in &columns[2] {
                    let rank = self.decomposition.rank([*x, *y, *z]);
                    if rank != self.rank {
                        ranks.push(rank);
                    }
                }
            }
        }
        ranks.sort_unstable();
        ranks
    }

    /// All ranks that may need particles of this one. The relation is symmetric, so that both sides know
    /// without asking that a message comes.
    fn partners(&self, largest_margin: f64) -> Vec<usize> {
        let here = self.decomposition.coordinates(self.rank);
        self.ranks([0, 1, 2].map(|axis| {
            let count = self.decomposition.grid[axis] as i64;
            let width = self.sides[axis] / count as f64;
            let hops = (largest_margin * (1.0 + 1e-9) / width).floor() as i64 + 1;
            if 2 * hops + 1 >= count {
                return (0..count as usize).collect();
            }
            let around = here[axis] as i64 - hops..=here[axis] as i64 + hops;
            if self.periodic[axis] {
                around.map(|column| column.rem_euclid(count) as usize).collect()
            } else {
                around.filter(|c| (0..count).contains(c)).map(|c| c as usize).collect()
            }
        }))
    }
}

impl HaloPlan {
    /// Find out who needs which owned particle, and append the ghosts behind the owned particles, in
    /// order of the sending rank. `reach` is the largest radius plus the skin \[m\]: a particle is needed
    /// where some image of it lies within its own radius plus `reach` of a subdomain.
    ///
    /// # Errors
    /// None of its own; collective.
    pub fn build(
        comm: &Communicator,
        decomposition: &Decomposition,
        particles: &mut Particles,
        sides: [f64; 3],
        periodic: [bool; 3],
        reach: f64,
    ) -> Result<Self> {
        let mut plan = Self::default();
        if comm.size() == 1 {
            return Ok(plan);
        }
        let around = Neighbourhood { decomposition, sides, periodic, rank: comm.rank() };
        let partners = around.partners(2.0 * reach);
        let mut lists = vec![Vec::new(); partners.len()];
        for (index, record) in particles.record.iter().enumerate() {
            let margin = record.radius + reach;
            let columns = [0, 1, 2].map(|axis| around.columns(axis, record.position[axis], margin));
            if columns.iter().all(|c| c.len() == 1) && around.ranks(columns.clone()).is_empty() {
                continue;
            }
            for rank in around.ranks(columns) {
                if let Ok(partner) = partners.binary_search(&rank) {
                    lists[partner].push(index as u32);
                }
            }
        }
        plan.exchange_static(comm, particles, &partners, lists);
        Ok(plan)
    }

    fn exchange_static(
        &mut self,
        comm: &Communicator,
        particles: &mut Particles,
        partners: &[usize],
        lists: Vec<Vec<u32>>,
    ) {
        let counts: Vec<u64> = lists.iter().map(|list| list.len() as u64).collect();
        let mut incoming = vec![0_u64; partners.len()];
        comm.exchange_each(
            partners.iter().zip(&counts).map(|(rank, count)| (*rank, bytemuck::bytes_of(count))),
            partners.iter().zip(&mut incoming).map(|(rank, count)| (*rank, bytemuck::bytes_of_mut(count))),
            || (),
        );
        let mut outgoing: Vec<(usize, Vec<u64>)> = Vec::new();
        for (rank, list) in partners.iter().zip(lists).filter(|(_, list)| !list.is_empty()) {
            outgoing.push((*rank, list.iter().flat_map(|index| static_words(particles, *index as usize)).collect()));
            let words = list.len() * MOVING_WORDS;
            self.sends.push(Send { rank: *rank, particles: list, buffer: vec![0; words] });
        }
        let mut arriving: Vec<(usize, Vec<u64>)> = partners
            .iter()
            .zip(&incoming)
            .filter(|(_, count)| **count > 0)
            .map(|(rank, count)| (*rank, vec![0_u64; *count as usize * STATIC_WORDS]))
            .collect();
        comm.exchange_each(
            outgoing.iter().map(|(rank, words)| (*rank, bytemuck::cast_slice(words))),
            arriving.iter_mut().map(|(rank, words)| (*rank, bytemuck::cast_slice_mut(words))),
            || (),
        );
        for (rank, words) in arriving {
            let count = words.len() / STATIC_WORDS;
            self.receives.push(Receive { rank, first: particles.len(), buffer: vec![0; count * MOVING_WORDS] });
            for ghost in words.chunks_exact(STATIC_WORDS) {
                append_ghost(particles, ghost);
            }
        }
    }

    /// Send the present state of the border particles and receive that of the ghosts; `meanwhile` runs
    /// while the messages fly. `wrapped` gets the ghosts whose image counter changed, with the change.
    pub fn update<R>(
        &mut self,
        comm: &Communicator,
        particles: &mut Particles,
        wrapped: &mut Vec<(u32, [i32; 3])>,
        meanwhile: impl FnOnce(&Particles) -> R,
    ) -> R {
        for send in &mut self.sends {
            for (index, words) in send.particles.iter().zip(send.buffer.chunks_exact_mut(MOVING_WORDS)) {
                let record = &particles.record[*index as usize];
                words[..3].copy_from_slice(&record.position.map(f64::to_bits));
                words[3] = pack_image(particles.image[*index as usize]);
                words[4..7].copy_from_slice(&record.velocity.map(f64::to_bits));
                words[7..10].copy_from_slice(&record.spin.map(f64::to_bits));
            }
        }
        let result = if self.sends.is_empty() && self.receives.is_empty() {
            meanwhile(particles)
        } else {
            comm.exchange_each(
                self.sends.iter().map(|send| (send.rank, bytemuck::cast_slice(&send.buffer))),
                self.receives.iter_mut().map(|receive| (receive.rank, bytemuck::cast_slice_mut(&mut receive.buffer))),
                || meanwhile(particles),
            )
        };
        for receive in &self.receives {
            for (offset, words) in receive.buffer.chunks_exact(MOVING_WORDS).enumerate() {
                let ghost = receive.first + offset;
                let three = |from: usize| [0, 1, 2].map(|k| f64::from_bits(words[from + k]));
                let record = &mut particles.record[ghost];
                record.position = three(0);
                record.velocity = three(4);
                record.spin = three(7);
                let change = image_change(particles.image[ghost], words[3]);
                if change != [0; 3] {
                    for k in 0..3 {
                        particles.image[ghost][k] += change[k];
                    }
                    wrapped.push((ghost as u32, change));
                }
            }
        }
        result
    }

    /// Messages sent and bytes sent per step by this rank.
    #[must_use]
    pub fn traffic(&self) -> (usize, usize) {
        (self.sends.len(), self.sends.iter().map(|send| send.buffer.len() * size_of::<u64>()).sum())
    }
}

/// The low bits of the image counters: enough to know by how much they changed since the last step.
fn pack_image(image: [i32; 3]) -> u64 {
    let mask = (1_u64 << IMAGE_BITS) - 1;
    image.iter().rev().fold(0, |word, count| word << IMAGE_BITS | (*count as u64 & mask))
}

fn image_change(known: [i32; 3], word: u64) -> [i32; 3] {
    let mask = (1_u64 << IMAGE_BITS) - 1;
    [0, 1, 2].map(|k| {
        let now = word >> (IMAGE_BITS * k as u32) & mask;
        let change = now.wrapping_sub(known[k] as u64) & mask;
        // Sign of a two's complement number of so many bits.
        if change >> (IMAGE_BITS - 1) == 1 { (change as i64 - (1_i64 << IMAGE_BITS)) as i32 } else { change as i32 }
    })
}

fn static_words(particles: &Particles, index: usize) -> [u64; STATIC_WORDS] {
    let mut words = [0; STATIC_WORDS];
    let [x, y, z] = particles.image[index].map(|count| u64::from(count as u32));
    words[0] = u64::from(particles.id[index]) << 32 | u64::from(particles.species[index]);
    words[1] = x << 32 | y;
    words[2] = z;
    words[3..].copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&particles.record[index])));
    words
}

fn append_ghost(particles: &mut Particles, words: &[u64]) {
    particles.id.push((words[0] >> 32) as u32);
    particles.species.push(words[0] as u32);
    particles.image.push([(words[1] >> 32) as i32, words[1] as i32, words[2] as i32]);
    let mut record: Record = bytemuck::Zeroable::zeroed();
    bytemuck::bytes_of_mut(&mut record).copy_from_slice(bytemuck::cast_slice(&words[3..]));
    particles.record.push(record);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn image_changes_survive_the_packing_in_both_directions() {
        for known in [[0, 0, 0], [-5, 7, 1 << 20], [1 << 25, -(1 << 25), -1]] {
            for change in [[0, 0, 0], [1, -1, 0], [-1, 1, 1]] {
                let now = [0, 1, 2].map(|k| known[k] + change[k]);
                assert_eq!(image_change(known, pack_image(now)), change, "{known:?}");
            }
        }
    }

    #[test]
    fn columns_cover_every_image_within_the_margin() {
        let decomposition = Decomposition { grid: [5, 1, 3] };
        let around = Neighbourhood {
            decomposition: &decomposition,
            sides: [10.0, 10.0, 3.0],
            periodic: [true, true, false],
            rank: 0,
        };
        for tenth in 0..100 {
            let (x, margin) = (f64::from(tenth) * 0.1, 2.7);
            for column in 0..5_usize {
                let (low, high) = (2.0 * column as f64 - margin, 2.0 * (column + 1) as f64 + margin);
                let near = (-2..=2).any(|s| (low..high).contains(&(x + 10.0 * f64::from(s))));
                let listed = around.columns(0, x, margin).contains(&column);
                assert!(listed || !near, "x = {x}, column {column}");
            }
            assert_eq!(around.columns(1, x, margin), [0]);
        }
        assert_eq!(around.columns(2, 0.1, 0.5), [0], "no image through a wall");
    }
}
