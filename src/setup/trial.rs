//! What a run would refuse before its first step, found in one process and without making a packing: the run's own
//! set-up as far as it is cheap. For `dem-mpi check`.

use super::{Initial, beginning, model, simulation};
use crate::config::{Config, Motion, PackingConfig, RadiusDistribution, Routine, ShapeConfig, Species};
use crate::error::Result;
use crate::exchange::{Communicator, Decomposition};
use crate::integrate::time_step::Measured;
use crate::packing::{self, Packing, replicate};
use crate::state::shape::is_sphere;
use crate::state::{ContactMemory, ParticleState};
use std::sync::Arc;

/// Up to so many particles of a file the first state is made as a whole, with lists and contacts.
const WHOLE: u64 = 1_000_000;
/// So many particles are drawn to look at their sizes.
const DRAWN: usize = 1_000_000;

/// Set up the run of this input on so many ranks as far as this is cheap, in this process alone: a particle file is read
/// and checked, and up to a million particles of it get their lists and contacts; of other packings the sizes are drawn.
/// Gives the input as the particle file completes it, if there is one: counts, sizes, cell, largest velocities.
///
/// # Errors
/// Those that the run would end with before its first step.
pub fn trial(config: &Arc<Config>, ranks: usize) -> Result<Option<Config>> {
    if let Some(grid) = config.parallel.grid.filter(|_| ranks > 1) {
        Decomposition::explicit(grid, ranks)?;
    }
    match config.packing {
        PackingConfig::File { .. } => file(config, packing::build(config)?).map(Some),
        _ if config.species.iter().map(|species| species.count).sum::<usize>() <= DRAWN => {
            // Sides that follow from the packing are not known yet, and nothing is refused for them.
            let sides = config.cell.sides.map_or([f64::INFINITY; 3], |sides| config.replication.whole(sides));
            of_sizes(config, packing::unplaced(config)?, sides).map(|()| None)
        }
        _ => Ok(None),
    }
}

fn file(config: &Arc<Config>, base: Packing) -> Result<Config> {
    let count = replicate::total(config, base.particles.len())?;
    let sides = config.replication.whole(base.sides);
    let completed = completed(config, &base);
    if count > WHOLE {
        of_sizes(config, base.particles, sides)?;
        return Ok(completed);
    }
    let global = beginning(config, sides, count);
    let initial = Initial {
        global,
        particles: replicate::share(config, &base, 0..count),
        memory: ContactMemory::new(0),
        columns: Vec::new(),
    };
    let alone = Decomposition { grid: [1; 3] };
    simulation(Communicator::single(), config, alone, initial, 1)?.check_fixed_time_step()?;
    Ok(completed)
}

/// The input with the cell of the file, and for every species that occurs there its particles.
fn completed(config: &Config, base: &Packing) -> Config {
    let mut completed = config.clone();
    completed.cell.sides = Some(base.sides);
    completed.species.clear();
    for (index, species) in config.species.iter().enumerate() {
        let own = || base.particles.iter().filter(|particle| particle.species as usize == index);
        let radius: Vec<f64> = own().map(|particle| libm::cbrt(particle.semi_axes.iter().product())).collect();
        if radius.is_empty() {
            completed.species.push(species.clone());
            continue;
        }
        let ratios = |axis: usize| {
            own()
                .map(|p| p.semi_axes[axis] / p.semi_axes[0])
                .fold([f64::INFINITY, 0.0], |[low, high], ratio| [f64::min(low, ratio), f64::max(high, ratio)])
        };
        let spherical = own().all(|particle| is_sphere(particle.semi_axes));
        let shape = if spherical {
            ShapeConfig::Sphere
        } else {
            ShapeConfig::AspectRatios { b_to_a: ratios(1), c_to_a: ratios(2) }
        };
        let fastest = own().max_by(|a, b| square(a.velocity).total_cmp(&square(b.velocity)));
        completed.species.push(Species {
            count: radius.len(),
            shape,
            velocity: fastest.map_or([0.0; 3], |particle| particle.velocity),
            velocity_deviation: 0.0,
            radius: RadiusDistribution::Tabulated { weight: vec![1.0; radius.len()], radius },
            ..species.clone()
        });
    }
    completed
}

fn square(v: [f64; 3]) -> f64 {
    v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
}

/// What sizes, speeds and constants alone tell: the cell's fit and the time step without contacts. The stiffness of
/// contacts can only lower the latter's limit.
fn of_sizes(config: &Arc<Config>, particles: Vec<ParticleState>, sides: [f64; 3]) -> Result<()> {
    let free = particles.iter().filter(|p| config.species[p.species as usize].motion == Motion::Free);
    let max_speed = free.map(|particle| square(particle.velocity)).fold(0.0, f64::max).sqrt();
    let count = replicate::total(config, particles.len())?;
    let global = beginning(config, sides, count);
    let initial = Initial { global, particles, memory: ContactMemory::new(0), columns: Vec::new() };
    let model = model(&Communicator::single(), config, &initial)?;
    if config.stages.first().is_none_or(|stage| stage.routine == Routine::QuasiStatic) {
        return Ok(());
    }
    model.time_step.choose(Measured { max_stiffness: 0.0, max_speed }, 0).map(|_| ())
}
