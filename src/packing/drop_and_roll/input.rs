//! The drop-and-roll packing that an input describes: how many spheres to drop on how wide a floor.

use super::super::{MAX_PARTICLES, Packing, at_rest_in_its_species, radii, rcp};
use super::{DroppedBed, Request, cut, drop_all};
use crate::config::{Boundary, Config, DropAndRollConfig, Species};
use crate::error::{Error, Result};

/// Solid fraction of equal spheres, to size the floor from the number of particles.
const SOLID_FRACTION: f64 = 0.58;

/// Drop the particles, and cut the cell out of the bed.
///
/// With a periodic z axis more particles are dropped than counted, in the proportions of the species, and as
/// many as counted are kept in all (of each species about its count). With walls in z the bed stays whole,
/// on the wall below; the other is above the given height, or touches the highest particle.
///
/// # Errors
/// As [`drop_all`] and [`cut::cut`]; the bed is higher than the given cell.
pub fn build(config: &Config, settings: &DropAndRollConfig) -> Result<Packing> {
    let count: usize = config.species.iter().map(|species| species.count).sum();
    if count == 0 {
        return Err(Error::Packing("there are no particles to drop; give a species a count above 0".into()));
    }
    let floor = floor(config);
    if config.cell.boundary[2] != Boundary::Periodic {
        return walled(config, floor);
    }
    let dropped = count.saturating_add(margin_count(config, floor, settings.margin).saturating_mul(2));
    if dropped > MAX_PARTICLES {
        return Err(Error::Packing(format!(
            "drop and roll would have to drop {dropped} particles to keep {count}, more than ids can number \
             ({MAX_PARTICLES}); lower packing.drop_and_roll.margin, or make the cell.aspect higher in z"
        )));
    }
    let sized = radii::draw_radii(config.seed, &with_total(&config.species, count, dropped))?;
    let radii: Vec<f64> = sized.iter().map(|one| one.radius).collect();
    let bed = drop_all(&Request { radii: &radii, floor, seed: config.seed })?;
    let cut = cut::cut(&bed, &radii, floor, count, settings.remaining_overlap)?;
    let particles = cut
        .kept
        .iter()
        .zip(&cut.positions)
        .enumerate()
        .map(|(id, (old, position))| {
            let one = &sized[*old as usize];
            at_rest_in_its_species(config, id, one.species, *position, one.radius)
        })
        .collect();
    Ok(Packing { sides: cut.sides, particles })
}

/// Width of the floor along x and y \[m\]: as given, or such that a bed of all particles has about the
/// proportions of the cell.
fn floor(config: &Config) -> [f64; 2] {
    if let Some([x, y, _]) = config.cell.sides {
        return [x, y];
    }
    let [x, y, z] = config.cell.aspect;
    let solid: f64 = config.species.iter().map(|species| species.count as f64 * species.radius.mean_volume()).sum();
    let scale = libm::cbrt(solid / (SOLID_FRACTION * x * y * z));
    [x * scale, y * scale]
}

/// Particles in a layer of the bed that is `margin` largest diameters high.
fn margin_count(config: &Config, [x, y]: [f64; 2], margin: f64) -> usize {
    let count: f64 = config.species.iter().map(|species| species.count as f64).sum();
    let solid: f64 = config.species.iter().map(|species| species.count as f64 * species.radius.mean_volume()).sum();
    let used = config.species.iter().filter(|species| species.count > 0);
    let largest = used.map(|species| species.radius.max()).fold(0.0, f64::max);
    libm::ceil(SOLID_FRACTION * x * y * 2.0 * largest * margin * count / solid) as usize
}

/// The species with `total` particles instead of `count`, in the same proportions.
fn with_total(species: &[Species], count: usize, total: usize) -> Vec<Species> {
    let share = |part: usize| (part as u128 * total as u128 / count as u128) as usize;
    let mut before = 0;
    species
        .iter()
        .map(|one| {
            let first = share(before);
            before += one.count;
            Species { count: share(before) - first, ..one.clone() }
        })
        .collect()
}

fn walled(config: &Config, floor: [f64; 2]) -> Result<Packing> {
    let sized = radii::draw_radii(config.seed, &config.species)?;
    let radii: Vec<f64> = sized.iter().map(|one| one.radius).collect();
    let DroppedBed { positions, top, .. } = drop_all(&Request { radii: &radii, floor, seed: config.seed })?;
    let height = config.cell.sides.map_or(top, |sides| sides[2]);
    if top > height {
        return Err(Error::Packing(format!(
            "the bed of {} dropped particles is {top:.4e} m high, and the cell {height:.4e} m (solid fraction of the bed \
             {:.3}); make the cell higher or wider, or use fewer particles",
            radii.len(),
            rcp::solid_volume(&radii) / (floor[0] * floor[1] * top)
        )));
    }
    let particles = sized.iter().zip(positions).enumerate();
    let particles = particles
        .map(|(id, (one, position))| at_rest_in_its_species(config, id, one.species, position, one.radius))
        .collect();
    Ok(Packing { sides: [floor[0], floor[1], height], particles })
}
