//! Initial state: sizes, positions and velocities of all particles, by id. Made by one process, serially
//! and from counter-based random numbers; knows nothing of ranks.

pub mod drop_and_roll;
pub mod ellipsoids;
pub mod file;
pub mod grid;
pub mod overlap;
pub mod radii;
pub mod random;
pub mod rcp;
pub mod relax;
pub mod relaxation;
pub mod replicate;
pub mod tournament;

#[cfg(test)]
mod test_input;

use crate::config::{Boundary, CellConfig, Config, MOST_DIAMETERS, Motion, PackingConfig, Species};
use crate::error::{Error, Result};
use crate::state::shape::{UPRIGHT, bounding_radius, ellipsoid_volume, is_sphere, smallest_semi_axis};
use crate::state::{LEDGER, ParticleState};
use ellipsoids::Body;
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
/// or particles overlap; [`Error::Input`] if a particle file cannot be used.
pub fn build(config: &Config) -> Result<Packing> {
    let packing = match &config.packing {
        PackingConfig::RandomClose { contraction_rate, max_moves_per_particle } => {
            random_close(config, *contraction_rate, *max_moves_per_particle)?
        }
        PackingConfig::Relaxation { tolerance, max_steps } => relaxed(config, *tolerance, *max_steps)?,
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
    check(config, &packing)?;
    Ok(packing)
}

/// The particles that the input counts, with their sizes and initial velocities, before they have places.
///
/// # Errors
/// As [`radii::draw_radii`].
pub fn unplaced(config: &Config) -> Result<Vec<ParticleState>> {
    let sized = radii::draw_radii(config.seed, &config.species)?;
    let particles = sized.iter().enumerate();
    Ok(particles.map(|(id, one)| at_rest_in_its_species(config, id, one.species, [0.0; 3], one.semi_axes)).collect())
}

fn check(config: &Config, packing: &Packing) -> Result<()> {
    let (particles, allowed) = (&packing.particles, config.max_overlap_fraction);
    let smallest = particles.iter().map(|p| 2.0 * smallest_semi_axis(p.semi_axes)).fold(f64::INFINITY, f64::min);
    let longest = packing.sides.into_iter().fold(0.0, f64::max);
    if longest > MOST_DIAMETERS * smallest {
        return Err(Error::Packing(format!(
            "the longest side of the cell, {longest:e} m, is more than {MOST_DIAMETERS:e} times the smallest diameter, \
             {smallest:e} m, and positions cannot tell what touches; look at the units of sides and radii"
        )));
    }
    let cell = Cell { sides: packing.sides, periodic: periodic_axes(&config.cell) };
    if particles.iter().all(|particle| is_sphere(particle.semi_axes)) {
        let ball = |particle: &ParticleState| Ball { position: particle.position, radius: particle.radius };
        return check_overlaps(&particles.iter().map(ball).collect::<Vec<_>>(), &cell, allowed);
    }
    let body = |particle: &ParticleState| Body::new(particle.position, particle.semi_axes, particle.orientation);
    ellipsoids::check_overlaps(&particles.iter().map(body).collect::<Vec<_>>(), &cell, allowed)
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
    let radii: Vec<f64> = sized.iter().map(|one| one.semi_axes[0]).collect();
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
            at_rest_in_its_species(config, id, one.species, position, one.semi_axes)
        })
        .collect();
    Ok(Packing { sides, particles })
}

fn relaxed(config: &Config, tolerance: f64, max_steps: usize) -> Result<Packing> {
    let sized = radii::draw_radii(config.seed, &config.species)?;
    if sized.is_empty() {
        return Err(Error::Packing("there are no particles to pack; give a species a count above 0".into()));
    }
    let semi_axes: Vec<[f64; 3]> = sized.iter().map(|one| one.semi_axes).collect();
    let orientations: Vec<[f64; 4]> = (0..sized.len()).map(|id| random_orientation(config.seed, id)).collect();
    let solid: f64 = semi_axes.iter().map(|axes| ellipsoid_volume(*axes)).sum();
    let of_sides = config.cell.sides.map(|sides| solid / (sides[0] * sides[1] * sides[2]));
    let packed = relaxation::pack(&relaxation::Request {
        semi_axes: &semi_axes,
        orientations: &orientations,
        aspect: config.cell.sides.unwrap_or(config.cell.aspect),
        solid_fraction: of_sides.or(config.cell.solid_fraction),
        seed: config.seed,
        tolerance,
        max_steps,
    })?;
    let sides = config.cell.sides.unwrap_or(packed.sides);
    let particles = (0..sized.len())
        .map(|id| {
            let position = [0, 1, 2].map(|k| rcp::wrap(packed.positions[id][k], sides[k]));
            let mut particle = at_rest_in_its_species(config, id, sized[id].species, position, semi_axes[id]);
            if !is_sphere(semi_axes[id]) {
                particle.orientation = packed.orientations[id];
            }
            particle
        })
        .collect();
    Ok(Packing { sides, particles })
}

/// Uniform over all rotations.
fn random_orientation(seed: u64, id: usize) -> [f64; 4] {
    Draws::new(seed, Purpose::Orientation, id as u64).rotation()
}

fn from_file(config: &Config, path: &std::path::Path) -> Result<Packing> {
    let region = file::Region { sides: config.cell.sides, periodic: periodic_axes(&config.cell) };
    let names: Vec<&str> = config.species.iter().map(|species| species.name.as_str()).collect();
    let file::Contents { sides, rows } = file::read(path, &names, &region)?;
    let particles = rows
        .into_iter()
        .enumerate()
        .map(|(id, row)| {
            check_density(config, id, &row)
                .map_err(|message| Error::Input(format!("{}: {message}", path.display())))?;
            let semi_axes = row.semi_axes.unwrap_or([row.radius; 3]);
            let mut particle = at_rest_in_its_species(config, id, row.species, row.position, semi_axes);
            particle.orientation = row.orientation.unwrap_or(particle.orientation);
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
fn at_rest_in_its_species(
    config: &Config,
    id: usize,
    species: u32,
    position: [f64; 3],
    semi_axes: [f64; 3],
) -> ParticleState {
    let of_species = &config.species[species as usize];
    let (velocity, spin) = match of_species.motion {
        Motion::Driven { velocity, spin } => (velocity, spin),
        Motion::Free => (initial_velocity(config.seed, id, of_species), of_species.spin),
    };
    ParticleState {
        id: id as u32,
        species,
        position,
        radius: bounding_radius(semi_axes),
        semi_axes,
        velocity,
        full_velocity: velocity,
        spin,
        full_spin: spin,
        orientation: UPRIGHT,
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
