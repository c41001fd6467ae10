//! Makes packings: random close packing, compressed and relaxed under the workload's contact laws, and
//! replicated where more particles are wanted than one base holds.

use super::case::advance;
use super::data::{self, Body, Packing};
use super::workload::{Aspects, DENSITY, Law, Leg, Particles, TIME_STEP, Workload};
use crate::error::{Error, Result};
use crate::exchange::Communicator;
use crate::load::LoadProgramme;
use crate::run::set_up_threads;
use crate::setup;
use crate::state::ParticleState;
use crate::state::shape::ellipsoid_mass;
use std::path::Path;
use std::sync::Arc;

/// Largest packing made directly; larger ones are its replicas.
const BASE_PARTICLES: usize = 12_500;
/// The same for ellipsoids, whose packings take longer.
const BASE_ELLIPSOIDS: usize = 1000;
/// Steps that bring the packing to its solid fraction, and steps that relax it.
const PREPARE_STEPS: [u64; 2] = [1500, 1500];
/// Solid fraction of equal spheres.
const SOLID_FRACTION: f64 = 0.64;
/// Unequal spheres and ellipsoids jam denser: they are brought so far beyond what the packing itself reached.
const BEYOND: f64 = 1.02;

/// A base packing and how often it is repeated along each axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Plan {
    /// Particles of the base.
    pub base: usize,
    /// Copies per axis.
    pub copies: [usize; 3],
}

impl Plan {
    /// The plan for `particles` particles: exactly so many where some near-cubic number of copies divides
    /// them, else up to a few more.
    #[must_use]
    pub fn new(particles: usize, aspects: Option<Aspects>) -> Self {
        let most = if aspects.is_some() { BASE_ELLIPSOIDS } else { BASE_PARTICLES };
        let least = particles.div_ceil(most).max(1);
        let exact = (least..=2 * least).find(|k| particles.is_multiple_of(*k) && is_near_cubic(near_cubic(*k)));
        let count = exact.or_else(|| (least..).find(|k| is_near_cubic(near_cubic(*k)))).unwrap_or(least);
        Self { base: particles.div_ceil(count), copies: near_cubic(count) }
    }

    /// The plan for `cores` times the particles of this one, from the same base.
    #[must_use]
    pub fn times(self, cores: usize) -> Self {
        Self { copies: near_cubic(self.copies.iter().product::<usize>() * cores), ..self }
    }

    /// Number of particles.
    #[must_use]
    pub fn particles(self) -> usize {
        self.base * self.copies.iter().product::<usize>()
    }
}

/// Three factors of `count` that differ as little as can be, in falling order.
fn near_cubic(count: usize) -> [usize; 3] {
    let divisors = |n: usize| (1..=n).filter(move |d| n.is_multiple_of(*d));
    let mut best = [count, 1, 1];
    for a in divisors(count) {
        for b in divisors(count / a).filter(|b| *b <= a) {
            let c = count / a / b;
            if c <= b && a - c < best[0] - best[2] {
                best = [a, b, c];
            }
        }
    }
    best
}

fn is_near_cubic([longest, _, shortest]: [usize; 3]) -> bool {
    longest <= 2 * shortest
}

/// Make the base of a plan and write it to a file (spheres as a LAMMPS data file, ellipsoids as CSV), its copies too
/// if wanted; gives the sides of what the file holds \[m\]. `ratio` is the largest over the smallest radius.
///
/// # Errors
/// The packing cannot be made or the file cannot be written.
pub fn write(path: &Path, plan: Plan, with_copies: bool, ratio: f64, aspects: Option<Aspects>) -> Result<[f64; 3]> {
    let base = make(plan.base, ratio, aspects)?;
    let copies = if with_copies { plan.copies } else { [1; 3] };
    data::write(path, &base, copies)?;
    Ok([0, 1, 2].map(|axis| base.sides[axis] * copies[axis] as f64))
}

fn make(count: usize, ratio: f64, aspects: Option<Aspects>) -> Result<Packing> {
    let comm = Communicator::single();
    let config = |strain: f64| {
        let [inflate, relax] = PREPARE_STEPS;
        let rate = strain / (inflate as f64 * TIME_STEP);
        let legs = vec![(Leg::Isotropic(rate), inflate), (Leg::Isotropic(0.0), relax)];
        Workload { particles: Particles::Made { count, ratio, aspects }, law: Law::Hertz, legs, threads: 1 }.config()
    };
    // What the packing attains tells how much it must be compressed.
    let mut packed = setup::from_packing(&comm, &config(0.0)?)?;
    let sides = packed.global.sides;
    let volume: f64 = packed.particles.iter().map(|p| ellipsoid_mass(p.semi_axes, 1.0)).sum();
    let attained = volume / (sides[0] * sides[1] * sides[2]);
    let wanted = if ratio == 1.0 && aspects.is_none() { SOLID_FRACTION } else { attained * BEYOND };
    let config = Arc::new(config(1.0 - libm::cbrt(attained / wanted))?);
    let threads = set_up_threads(&comm, &config);
    let programme = LoadProgramme { stages: config.stages.clone(), kinematics: config.kinematics };
    programme.enter(&mut packed.global);
    let decomposition = setup::decomposition(&comm, &config, &packed.global)?;
    let mut simulation = setup::simulation(comm, &config, decomposition, packed, threads)?;
    advance(&mut simulation, PREPARE_STEPS.iter().sum())?;
    let (mut particles, _) = simulation.export()?;
    particles.sort_by_key(|particle| particle.id);
    let body = |particle: &ParticleState| Body {
        position: particle.position,
        semi_axes: particle.semi_axes,
        orientation: particle.orientation,
    };
    Ok(Packing {
        sides: simulation.global().sides,
        density: DENSITY,
        bodies: particles.iter().map(body).collect(),
        ellipsoids: aspects.is_some(),
    })
}

/// The ratio of radii as given.
///
/// # Errors
/// It is not from 1 to 10.
pub fn checked_ratio(ratio: f64) -> Result<f64> {
    if (1.0..=10.0).contains(&ratio) {
        return Ok(ratio);
    }
    Err(Error::Input(format!(
        "--radii {ratio}: give the largest over the smallest radius, from 1 to 10, for example 3"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plans_hold_the_wanted_number_in_near_cubic_copies() {
        assert_eq!(Plan::new(250, None), Plan { base: 250, copies: [1; 3] });
        assert_eq!(Plan::new(100_000, None), Plan { base: 12_500, copies: [2; 3] });
        assert_eq!(Plan::new(1_000_000, None).particles(), 1_000_000);
        for particles in [1, 12_501, 30_000, 99_991, 12_345_678] {
            let plan = Plan::new(particles, None);
            assert!(plan.base <= BASE_PARTICLES && is_near_cubic(plan.copies), "{particles}: {plan:?}");
            assert!((particles..particles + particles / 100 + 10).contains(&plan.particles()), "{particles}: {plan:?}");
        }
    }

    #[test]
    fn weak_scaling_keeps_the_base() {
        let plan = Plan::new(100_000, None);
        assert_eq!(plan.times(2), Plan { base: 12_500, copies: [4, 2, 2] });
        assert_eq!(plan.times(8), Plan { base: 12_500, copies: [4; 3] });
    }
}
