//! The Verlet list: all pairs nearer than the sum of their radii plus the skin, each once, oriented
//! from the lower global id, with every periodic image and own images.

use super::cells::Bins;
use crate::contact::shift::lexicographically_positive;
use crate::state::particles::Particles;
use rayon::prelude::*;

/// A pair that may come to touch. The shift counts from the unwrapped positions, so that wraps do not
/// change it: the shift of the wrapped positions is `shift + image[second] − image[first]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Candidate {
    /// Local index of the particle with the lower id.
    pub first: u32,
    /// Local index of the other.
    pub second: u32,
    /// Image shift of the second in unwrapped coordinates.
    pub shift: [i32; 3],
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

    /// Local order of the owned particles that keeps neighbours in space near in memory.
    #[must_use]
    pub fn spatial_order(&self, particles: &Particles) -> Vec<u32> {
        let positions: Vec<[f64; 3]> = particles.record[..particles.owned].iter().map(|r| r.position).collect();
        if positions.is_empty() {
            return Vec::new();
        }
        Bins::new(self.low, self.high, 2.0 * self.max_radius + self.skin, &positions).order().to_vec()
    }

    /// The Verlet list of this rank: every pair with at least one owned particle, once. Pairs of two
    /// driven particles are left out.
    #[must_use]
    pub fn candidates(&self, particles: &Particles) -> Vec<Candidate> {
        if particles.owned == 0 {
            return Vec::new();
        }
        let points = self.points(particles);
        let reach = 2.0 * self.max_radius + self.skin;
        let low = [0, 1, 2].map(|k| self.low[k] - reach);
        let high = [0, 1, 2].map(|k| self.high[k] + reach);
        let bins = Bins::new(low, high, reach, &points.position);
        let per_chunk: Vec<Vec<Candidate>> = (0..particles.owned.div_ceil(1024))
            .into_par_iter()
            .map(|chunk| {
                let mut found = Vec::new();
                let range = chunk * 1024..((chunk + 1) * 1024).min(particles.owned);
                for first in range {
                    self.candidates_of(first, particles, &points, &bins, &mut found);
                }
                found
            })
            .collect();
        per_chunk.concat()
    }

    fn candidates_of(
        &self,
        owner: usize,
        particles: &Particles,
        points: &Points,
        bins: &Bins,
        found: &mut Vec<Candidate>,
    ) {
        let record = particles.record[owner];
        let id = particles.id[owner];
        bins.for_each_near(record.position, |point| {
            let other = points.particle[point] as usize;
            let shift = points.shift[point];
            let is_first = if other < particles.owned {
                // Two owned particles meet twice, once from each side: keep the lower id's view.
                if id > particles.id[other] || (id == particles.id[other] && !lexicographically_positive(shift)) {
                    return;
                }
                true
            } else {
                id < particles.id[other]
            };
            let partner = &particles.record[other];
            let sum = record.radius + partner.radius + self.skin;
            let d = [0, 1, 2].map(|k| points.position[point][k] - record.position[k]);
            if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] >= sum * sum
                || (record.inverse_mass == 0.0 && partner.inverse_mass == 0.0)
            {
                return;
            }
            let unwrapped = [0, 1, 2].map(|k| shift[k] - particles.image[other][k] + particles.image[owner][k]);
            found.push(if is_first {
                Candidate { first: owner as u32, second: other as u32, shift: unwrapped }
            } else {
                Candidate { first: other as u32, second: owner as u32, shift: unwrapped.map(|s| -s) }
            });
        });
    }
}
