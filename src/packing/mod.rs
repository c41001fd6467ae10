//! Initial state: sizes, positions and velocities of all particles, by id. Made by one process, serially
//! and from counter-based random numbers; knows nothing of ranks.

pub mod drop_and_roll;
pub mod file;
pub mod grid;
pub mod overlap;
pub mod radii;
pub mod random;
pub mod rcp;
pub mod relax;
pub mod replicate;
pub mod tournament;

#[cfg(test)]
mod test_input;

use crate::config::{Boundary, CellConfig, Config, Motion, PackingConfig, Species};
use crate::error::{Error, Result};
use crate::state::{LEDGER, ParticleState};
use grid::{Ball, Cell};
use random::{Draws, Purpose};

pub use overlap::{Worst, check_overlaps};

/// The cell and all its particles at time 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Packing {
    /// Sides of the cell \[m\].
    pub sides: [f64; 3],
    /// Particles in the order of their ids, positions wrapped into the cell.
    pub particles: Vec<ParticleState>,
}

/// Make the packing that the input describes, and check it for overlaps.
///
/// # Errors
/// [`Error::Packing`] if the input gives no particle, the solid fraction or the sides cannot be met,
/// or particles overlap; [`Error::File`] if a particle file cannot be used.
pub fn build(config: &Config) -> Result<Packing> {
    let packing = match &config.packing {
        PackingConfig::RandomClose { contraction_rate, max_moves_per_particle } => {
            random_close(config, *contraction_rate, *max_moves_per_particle)?
        }
        PackingConfig::DropAndRoll(settings) => drop_and_roll::input::build(config, settings)?,
        PackingConfig::File { path } => from_file(config, path)?,
    };
    if packing.particles.is_empty() {
        return Err(Error::Packing("there are no particles; give a species a count above 0".into()));
    }
    if packing.particles.len() > MAX_PARTICLES {
        return Err(Error::Packing(format!(
            "{} particles are more than ids can number ({MAX_PARTICLES}); reduce the counts",
            packing.particles.len()
        )));
    }
    let balls: Vec<Ball> = packing
        .particles
        .iter()
        .map(|particle| Ball { position: particle.position, radius: particle.radius })
        .collect();
    let cell = Cell { sides: packing.sides, periodic: periodic_axes(&config.cell) };
    check_overlaps(&balls, &cell, config.max_overlap_fraction)?;
    Ok(packing)
}

/// Ids are 32 bits wide and walls are numbered after the particles.
pub(crate) const MAX_PARTICLES: usize = u32::MAX as usize - 16;

pub(crate) fn periodic_axes(cell: &CellConfig) -> [bool; 3] {
    cell.boundary.map(|boundary| boundary == Boundary::Periodic)
}

fn random_close(config: &Config, contraction_rate: f64, max_moves_per_particle: f64) -> Result<Packing> {
    let sized = radii::draw_radii(config.seed, &config.species)?;
    if sized.is_empty() {
        return Err(Error::Packing("there are no particles to pack; give a species a count above 0".into()));
    }
    let radii: Vec<f64> = sized.iter().map(|one| one.radius).collect();
    let shape = Cell { sides: config.cell.sides.unwrap_or(config.cell.aspect), periodic: periodic_axes(&config.cell) };
    let solid_fraction = if config.cell.sides.is_some() {
        Some(rcp::solid_volume(&radii) / shape.volume())
    } else {
        config.cell.solid_fraction
    };
    let packed = rcp::pack(&rcp::Request {
        radii: &radii,
        shape,
        solid_fraction,
        seed: config.seed,
        contraction_rate,
        max_moves_per_particle,
    })?;
    let sides = config.cell.sides.unwrap_or(packed.sides);
    let particles = sized
        .iter()
        .zip(&packed.positions)
        .enumerate()
        .map(|(id, (one, position))| {
            let position = [0, 1, 2].map(|k| rcp::wrap(position[k], sides[k]));
            at_rest_in_its_species(config, id, one.species, position, one.radius)
        })
        .collect();
    Ok(Packing { sides, particles })
}

fn from_file(config: &Config, path: &std::path::Path) -> Result<Packing> {
    let region = file::Region { sides: config.cell.sides, periodic: periodic_axes(&config.cell) };
    let names: Vec<&str> = config.species.iter().map(|species| species.name.as_str()).collect();
    let file::Contents { sides, rows } = file::read(path, &names, &region)?;
    let particles = rows
        .into_iter()
        .enumerate()
        .map(|(id, row)| {
            check_density(config, id, &row).map_err(|message| Error::File { path: path.to_owned(), message })?;
            let mut particle = at_rest_in_its_species(config, id, row.species, row.position, row.radius);
            // What is prescribed stays prescribed, whatever the file says.
            if config.species[row.species as usize].motion == Motion::Free {
                particle.velocity = row.velocity.unwrap_or(particle.velocity);
                particle.spin = row.spin.unwrap_or(particle.spin);
                (particle.full_velocity, particle.full_spin) = (particle.velocity, particle.spin);
            }
            Ok(particle)
        })
        .collect::<Result<_>>()?;
    Ok(Packing { sides, particles })
}

/// Densities belong to materials: one in the file must be the material's, scaled or not.
fn check_density(config: &Config, id: usize, row: &file::Row) -> std::result::Result<(), String> {
    let Some(density) = row.density else { return Ok(()) };
    let species = &config.species[row.species as usize];
    let material = &config.materials[species.material];
    let known = [material.density, material.density * material.density_scaling];
    if known.iter().any(|known| (density - known).abs() <= 1e-6 * known) {
        return Ok(());
    }
    Err(format!(
        "particle {id} (species {}) has the density {density} kg/m3, its material {} {} kg/m3 and density_scaling {}; \
         set the material's density to that of the file",
        species.name, material.name, material.density, material.density_scaling
    ))
}

/// A particle with the initial velocity and spin of its species and nothing behind it.
fn at_rest_in_its_species(config: &Config, id: usize, species: u32, position: [f64; 3], radius: f64) -> ParticleState {
    let of_species = &config.species[species as usize];
    let (velocity, spin) = match of_species.motion {
        Motion::Driven { velocity, spin } => (velocity, spin),
        Motion::Free => (initial_velocity(config.seed, id, of_species), of_species.spin),
    };
    ParticleState {
        id: id as u32,
        species,
        position,
        radius,
        velocity,
        full_velocity: velocity,
        spin,
        full_spin: spin,
        orientation: [1.0, 0.0, 0.0, 0.0],
        ledger: [0.0; LEDGER.len()],
        image: [0; 3],
        reserved: 0,
    }
}

/// The species' velocity plus a normal deviate per component \[m/s\].
fn initial_velocity(seed: u64, id: usize, species: &Species) -> [f64; 3] {
    if species.velocity_deviation == 0.0 {
        return species.velocity;
    }
    let mut draws = Draws::new(seed, Purpose::Velocity, id as u64);
    species.velocity.map(|component| component + species.velocity_deviation * draws.normal())
}

#[cfg(test)]
mod tests;
