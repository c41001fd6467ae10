//! The Verlet list: all pairs nearer than the sum of their radii plus the skin, each once, with every
//! periodic image and own images, listed with their owner: the particle with the lower local index, or, if the two
//! are in different strips, either of them, so that every strip has its share.

use super::cells::Bins;
use crate::contact::shift::{encode, lexicographically_positive};
use crate::state::particles::Particles;
use rayon::prelude::*;
use std::ops::Range;

/// Pairs that may come to touch, by owner. The shifts are those of the positions when the list was made;
/// what particles cross after that comes on top.
#[derive(Debug, Clone, Default)]
pub struct Candidates {
    /// `offsets[p]..offsets[p+1]` are those of owned particle `p`.
    pub offsets: Vec<u32>,
    /// Local index of the partner.
    pub partner: Vec<u32>,
    /// Packed shift of the particle with the higher global id, seen from the other, in the lowest nine bits;
    /// the bits above belong to who lists contacts.
    pub code: Vec<u32>,
}

impl Candidates {
    /// Set if the partner has the lower global id.
    pub const PARTNER_FIRST: u32 = 1 << 9;
    /// First bit that is free.
    pub const FREE_BIT: u32 = 10;
}

/// Box and reach of a search.
#[derive(Debug, Clone, Copy)]
pub struct Region {
    /// Cell sides \[m\].
    pub sides: [f64; 3],
    /// Periodic axes.
    pub periodic: [bool; 3],
    /// Low corner of this rank's box \[m\].
    pub low: [f64; 3],
    /// High corner of this rank's box \[m\].
    pub high: [f64; 3],
    /// Largest radius of all particles on all ranks \[m\].
    pub max_radius: f64,
    /// Skin \[m\]: pairs up to this gap are listed.
    pub skin: f64,
}

/// Particles and their images in and around this rank's box.
struct Points {
    position: Vec<[f64; 3]>,
    particle: Vec<u32>,
    shift: Vec<[i32; 3]>,
}

impl Region {
    /// All images of all local particles that some owned particle may touch; the first `owned` points
    /// are the owned particles themselves.
    fn points(&self, particles: &Particles) -> Points {
        let owned = particles.owned;
        let mut points = Points {
            position: particles.record[..owned].iter().map(|r| r.position).collect(),
            particle: (0..owned as u32).collect(),
            shift: vec![[0; 3]; owned],
        };
        for (index, record) in particles.record.iter().enumerate() {
            let reach = record.radius + self.max_radius + self.skin;
            let range = [0, 1, 2].map(|k| {
                if !self.periodic[k] {
                    return (0, 0);
                }
                let first = ((self.low[k] - reach - record.position[k]) / self.sides[k]).ceil();
                let last = ((self.high[k] + reach - record.position[k]) / self.sides[k]).floor();
                (first as i32, last as i32)
            });
            for x in range[0].0..=range[0].1 {
                for y in range[1].0..=range[1].1 {
                    for z in range[2].0..=range[2].1 {
                        let shift = [x, y, z];
                        if index < owned && shift == [0; 3] {
                            continue;
                        }
                        points
                            .position
                            .push([0, 1, 2].map(|k| record.position[k] + f64::from(shift[k]) * self.sides[k]));
                        points.particle.push(index as u32);
                        points.shift.push(shift);
                    }
                }
            }
        }
        points
    }

    /// How far the centres of listed pairs can be apart \[m\].
    #[must_use]
    pub fn reach(&self) -> f64 {
        2.0 * self.max_radius + self.skin
    }

    /// The Verlet list of this rank: every pair with at least one owned particle, once. Pairs of two
    /// driven particles are left out. `strips` are runs of owned particles, ascending and without gaps.
    #[must_use]
    pub fn candidates(&self, particles: &Particles, strips: &[Range<usize>]) -> Candidates {
        const GRAIN: usize = 1024;
        let owned = particles.owned;
        let mut candidates = Candidates { offsets: vec![0], ..Candidates::default() };
        if owned == 0 {
            return candidates;
        }
        let points = self.points(particles);
        let reach = self.reach();
        let low = [0, 1, 2].map(|k| self.low[k] - reach);
        let high = [0, 1, 2].map(|k| self.high[k] + reach);
        let bins = Bins::new(low, high, reach, &points.position);
        let parts: Vec<Candidates> = (0..owned.div_ceil(GRAIN))
            .into_par_iter()
            .map(|part| {
                let mut found = Candidates::default();
                for owner in part * GRAIN..((part + 1) * GRAIN).min(owned) {
                    let strip = &strips[strips.partition_point(|strip| strip.end <= owner)];
                    self.candidates_of(owner, strip, particles, &points, &bins, &mut found);
                    found.offsets.push(found.partner.len() as u32);
                }
                found
            })
            .collect();
        let total = parts.iter().map(|part| part.partner.len()).sum();
        candidates.offsets.reserve(owned);
        candidates.partner.reserve(total);
        candidates.code.reserve(total);
        for part in parts {
            let before = candidates.partner.len() as u32;
            candidates.offsets.extend(part.offsets.iter().map(|offset| before + offset));
            candidates.partner.extend(part.partner);
            candidates.code.extend(part.code);
        }
        candidates
    }

    fn candidates_of(
        &self,
        owner: usize,
        strip: &Range<usize>,
        particles: &Particles,
        points: &Points,
        bins: &Bins,
        found: &mut Candidates,
    ) {
        let record = particles.record[owner];
        let id = particles.id[owner];
        bins.for_each_near(record.position, |point| {
            let partner = points.particle[point] as usize;
            // Two owned particles meet twice, once from each side. Within a strip the lower index owns the pair; between
            // two strips it does if it is even.
            let lower_owns =
                partner >= particles.owned || strip.contains(&partner) || owner.min(partner).is_multiple_of(2);
            if partner != owner && (owner < partner) != lower_owns {
                return;
            }
            let shift = points.shift[point];
            if partner == owner && !lexicographically_positive(shift) {
                return;
            }
            let other = &particles.record[partner];
            let sum = record.radius + other.radius + self.skin;
            let d = [0, 1, 2].map(|k| points.position[point][k] - record.position[k]);
            if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] >= sum * sum
                || (record.inverse_mass == 0.0 && other.inverse_mass == 0.0)
            {
                return;
            }
            found.partner.push(partner as u32);
            found.code.push(if id <= particles.id[partner] {
                u32::from(encode(shift))
            } else {
                u32::from(encode(shift.map(|s| -s))) | Candidates::PARTNER_FIRST
            });
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::particles::Record;
    use bytemuck::Zeroable;

    /// Pairs as (lower, higher) local index with the code, and how many each strip owns.
    fn listed(strips: &[Range<usize>]) -> (Vec<(usize, usize, u32)>, Vec<usize>) {
        // A cubic lattice of 8 x 8 x 8 touching spheres, two layers of which are ghosts.
        let mut particles = Particles { owned: 384, ..Particles::default() };
        for index in 0..512_u32 {
            let position = [index / 64, index / 8 % 8, index % 8].map(|k| f64::from(k) + 0.5);
            particles.record.push(Record { position, radius: 0.5, inverse_mass: 1.0, ..Record::zeroed() });
            particles.id.push(index * 101 % 512);
        }
        let region = Region {
            sides: [8.0; 3],
            periodic: [true; 3],
            low: [0.0; 3],
            high: [6.0, 8.0, 8.0],
            max_radius: 0.5,
            skin: 0.1,
        };
        let candidates = region.candidates(&particles, strips);
        let (mut pairs, mut owned) = (Vec::new(), vec![0; strips.len()]);
        for owner in 0..particles.owned {
            for place in candidates.offsets[owner] as usize..candidates.offsets[owner + 1] as usize {
                let partner = candidates.partner[place] as usize;
                let first = (candidates.code[place] & Candidates::PARTNER_FIRST == 0) == (owner < partner);
                let shift = candidates.code[place] & (Candidates::PARTNER_FIRST - 1);
                pairs.push((owner.min(partner), owner.max(partner), shift << 1 | u32::from(first)));
                let strip = strips.iter().position(|strip| strip.contains(&owner)).expect("every owner is in a strip");
                owned[strip] += 1;
            }
        }
        pairs.sort_unstable();
        (pairs, owned)
    }

    #[test]
    fn strips_share_the_pairs_between_them_and_none_is_lost_or_doubled() {
        let (pairs, _) = listed(std::slice::from_ref(&(0..384)));
        // Three per owned particle, and the 64 from the ghosts to the owned ones above them.
        assert_eq!(pairs.len(), 3 * 384 + 64);
        let (same, owned) = listed(&[0..192, 192..384]);
        assert_eq!(same, pairs);
        // 64 pairs lie between the strips, each has 64 with ghosts.
        assert_eq!(owned, [608, 608]);
    }
}
