//! Large packings from small ones: copies side by side, every particle displaced at random. What a
//! particle becomes follows from its id alone, so that each process can make any part of the whole.

use super::random::{Draws, Purpose};
use super::{MAX_PARTICLES, Packing, initial_velocity, periodic_axes, rcp};
use crate::config::{Config, Motion};
use crate::error::{Error, Result};
use crate::state::ParticleState;
use crate::state::shape::smallest_semi_axis;
use std::ops::Range;

/// Number of particles of all copies of a packing with `base` particles.
///
/// # Errors
/// [`Error::Packing`] if ids cannot number them.
pub fn total(config: &Config, base: usize) -> Result<u64> {
    let copies = config.replication.number();
    let total = copies.saturating_mul(base as u64);
    if total > MAX_PARTICLES as u64 {
        return Err(Error::Packing(format!(
            "{copies} copies of {base} particles are more than ids can number ({MAX_PARTICLES}); reduce \
             `replicate` in the section of the packing (such as packing.random_close.replicate)"
        )));
    }
    Ok(total)
}

/// The particles with these ids, of all copies of `base`.
///
/// Id = id in the base + number of the copy × particles of the base; copies are numbered along x, then
/// y, then z. Copies have the radii, species and spins of the base. Random initial velocities are drawn
/// anew for each id, those of a file are kept.
#[must_use]
pub fn share(config: &Config, base: &Packing, ids: Range<u64>) -> Vec<ParticleState> {
    let replication = &config.replication;
    let count = base.particles.len() as u64;
    let (whole, periodic) = (replication.whole(base.sides), periodic_axes(&config.cell));
    ids.map(|id| {
        let copy = (id / count) as usize;
        let original = &base.particles[(id % count) as usize];
        let [x, y, _] = replication.copies;
        let place = [copy % x, copy / x % y, copy / x / y];
        let moved = displacement(config, id, smallest_semi_axis(original.semi_axes));
        let position = [0, 1, 2].map(|k| {
            let coordinate = original.position[k] + place[k] as f64 * base.sides[k] + moved[k];
            if periodic[k] { rcp::wrap(coordinate, whole[k]) } else { coordinate }
        });
        let species = &config.species[original.species as usize];
        let drawn = species.velocity_deviation > 0.0
            && species.motion == Motion::Free
            && original.velocity == initial_velocity(config.seed, original.id as usize, species);
        let velocity = if drawn { initial_velocity(config.seed, id as usize, species) } else { original.velocity };
        ParticleState { id: id as u32, position, velocity, ..*original }
    })
    .collect()
}

/// Uniformly distributed in a ball of `perturbation` times the radius (smallest semi-axis) \[m\].
fn displacement(config: &Config, id: u64, radius: f64) -> [f64; 3] {
    let largest = config.replication.perturbation * radius;
    if largest == 0.0 {
        return [0.0; 3];
    }
    let mut draws = Draws::new(config.seed, Purpose::Perturbation, id);
    loop {
        let point = [0; 3].map(|_| 2.0 * draws.uniform() - 1.0);
        if point[0] * point[0] + point[1] * point[1] + point[2] * point[2] <= 1.0 {
            return point.map(|x| x * largest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_input::{config, species};
    use super::*;
    use crate::config::{RadiusDistribution, Replication};

    fn base_and_config(copies: [usize; 3], perturbation: f64) -> (Packing, Config) {
        let mut given = config(vec![species("a", 30, RadiusDistribution::Fixed(0.25e-6))]);
        given.species[0].velocity_deviation = 0.1;
        given.replication = Replication { copies, perturbation };
        (super::super::build(&given).unwrap(), given)
    }

    #[test]
    fn one_copy_that_stays_in_place_is_the_packing_itself() {
        let (base, given) = base_and_config([1; 3], 0.0);
        assert_eq!(share(&given, &base, 0..30), base.particles);
    }

    #[test]
    fn shares_join_to_the_whole_whatever_the_blocks() {
        let (base, given) = base_and_config([2, 1, 3], 0.05);
        assert_eq!(total(&given, 30).unwrap(), 180);
        let whole = share(&given, &base, 0..180);
        let parts = [0..7, 7..100, 100..180].map(|ids| share(&given, &base, ids)).concat();
        assert_eq!(whole, parts);
        let sides = given.replication.whole(base.sides);
        for (id, particle) in whole.iter().enumerate() {
            assert_eq!(particle.id as usize, id);
            assert!((0..3).all(|k| particle.position[k] >= 0.0 && particle.position[k] < sides[k]));
        }
        assert_ne!(whole[0].velocity, whole[30].velocity);
    }

    #[test]
    fn displacements_fill_the_ball_and_do_not_leave_it() {
        let (_, given) = base_and_config([1; 3], 0.1);
        let lengths: Vec<f64> =
            (0..4000).map(|id| displacement(&given, id, 2.0).iter().map(|x| x * x).sum::<f64>().sqrt()).collect();
        assert!(lengths.iter().all(|length| *length <= 0.2));
        // Uniform in the ball: half of the points lie beyond 2^(-1/3) of its radius.
        let beyond = lengths.iter().filter(|length| **length > 0.2 * 0.7937).count();
        assert!((1850..2150).contains(&beyond), "{beyond}");
    }

    #[test]
    fn more_than_ids_can_number_is_an_error() {
        let (_, given) = base_and_config([10_000, 1000, 1000], 0.0);
        assert!(total(&given, 30).unwrap_err().to_string().contains("packing.random_close.replicate"));
    }
}
