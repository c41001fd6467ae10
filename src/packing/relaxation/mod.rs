//! Random packings of ellipsoids and spheres: overlaps are relaxed under a pressure that falls until the
//! particles just touch. Serial; equal input gives equal bits.

pub mod pairs;
mod relax;
pub mod touch;

use super::random::{Draws, Purpose};
use super::rcp::wrap;
use crate::error::{Error, Result};
use crate::state::shape::ellipsoid_volume;
use relax::{Goal, Look, System};

/// What to pack.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// Semi-axes per particle \[m\].
    pub semi_axes: &'a [[f64; 3]],
    /// Orientation per particle at the start, unit quaternions.
    pub orientations: &'a [[f64; 4]],
    /// Proportions of the periodic box.
    pub aspect: [f64; 3],
    /// Solid fraction to end with; `None`: the one where the particles jam.
    pub solid_fraction: Option<f64>,
    /// Seed of the random places.
    pub seed: u64,
    /// Residual force over mean contact force at which a pressure counts as balanced.
    pub tolerance: f64,
    /// Steps per pressure.
    pub max_steps: usize,
}

/// A packing without overlaps.
#[derive(Debug, Clone, PartialEq)]
pub struct Packed {
    /// Sides of the box \[m\].
    pub sides: [f64; 3],
    /// Centres, in the box \[m\].
    pub positions: Vec<[f64; 3]>,
    /// Orientations, unit quaternions.
    pub orientations: Vec<[f64; 4]>,
}

/// Solid fraction of the random points at the start.
const START: f64 = 0.3;

/// The pressures, in units of the overlap energy per volume of a particle of mean size: at the first one
/// the particles overlap by several per cent, so that they find a dense arrangement, at the last one by
/// less than 1e-5.
const PRESSURES: [f64; 5] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6];

/// Below its jamming fraction a packing is relaxed at a solid fraction larger by this, then stretched.
const SLACK: f64 = 3e-3;

/// Largest 1 − μ of a packing that may be stretched until nothing overlaps.
const DEEPEST: f64 = 1e-3;

/// Pack ellipsoids at random into a periodic box.
///
/// From random places in a dilute box, the enthalpy `Σ ½ (1 − μ)² + P V` is minimised over places,
/// orientations and the size of the box at one falling pressure after the other; last, the box is
/// stretched by the little that makes the worst pair just touch. Equal spheres end near a solid fraction
/// of 0.64, ellipsoids of semi-axes 1.25 : 1 : 0.8 near 0.73.
///
/// # Errors
/// [`Error::Packing`] if the pressure is not balanced in `max_steps`, or the solid fraction cannot be
/// reached.
///
/// # Source
/// Jamming by minimising an overlap energy: O'Hern, Silbert, Liu, Nagel 2003
/// (doi:10.1103/PhysRevE.68.011306); under pressure: Dagois-Bohy et al. 2012
/// (doi:10.1103/PhysRevLett.109.095703). Densities of ellipsoids: Donev et al. 2004
/// (doi:10.1126/science.1093010).
pub fn pack(request: &Request) -> Result<Packed> {
    let volume: f64 = request.semi_axes.iter().map(|axes| ellipsoid_volume(*axes)).sum();
    let unit = libm::cbrt(volume / request.semi_axes.len() as f64 / ellipsoid_volume([1.0; 3]));
    let volume = volume / (unit * unit * unit);
    if let Some(fraction) = request.solid_fraction {
        let tight = fraction * (1.0 + SLACK);
        let mut system = start(request, unit, volume / tight);
        let tolerance = 1.0 - libm::cbrt(1.0 / (1.0 + 0.9 * SLACK));
        let goal = Goal { pressure: None, tolerance, max_steps: request.max_steps };
        if system.relax(goal).1 {
            return Ok(finished(system, unit, volume / fraction));
        }
    }
    let (system, look) = jam(request, start(request, unit, volume / START))?;
    // A little more than enough, against rounding.
    let stretch = (1.0 + 1e-12) / (1.0 - look.deepest);
    let jammed = volume / (system.volume() * stretch * stretch * stretch);
    match request.solid_fraction {
        None => Ok(finished(system, unit, volume / jammed)),
        Some(fraction) if fraction <= jammed => Ok(finished(system, unit, volume / fraction)),
        Some(fraction) => Err(Error::Packing(format!(
            "the particles jam at a solid fraction of {jammed:.4}, below the wanted {fraction:.4}; lower \
             cell.solid_fraction (or enlarge cell.sides), or lower packing.relaxation.tolerance for a denser packing"
        ))),
    }
}

fn jam(request: &Request, mut system: System) -> Result<(System, Look)> {
    let mut look = Look::default();
    for pressure in PRESSURES {
        let goal = Goal { pressure: Some(pressure), tolerance: request.tolerance, max_steps: request.max_steps };
        look = system.relax(goal).0;
    }
    // A pressure that was not balanced does no harm as long as the overlaps are small in the end.
    if look.deepest <= DEEPEST {
        return Ok((system, look));
    }
    Err(Error::Packing(format!(
        "the relaxation did not come to rest in {} steps per pressure (an overlap of {:.1e} is left); raise \
         packing.relaxation.max_steps or its tolerance",
        request.max_steps, look.deepest
    )))
}

/// Random places in a box of this volume; lengths in units of the mean radius.
fn start(request: &Request, unit: f64, volume: f64) -> System {
    let [x, y, z] = request.aspect;
    let scale = libm::cbrt(volume / (x * y * z));
    let sides = request.aspect.map(|proportion| scale * proportion);
    let place = |id: usize| {
        let mut draws = Draws::new(request.seed, Purpose::Position, id as u64);
        sides.map(|side| side * draws.uniform())
    };
    let positions = (0..request.semi_axes.len()).map(place).collect();
    let semi_axes = request.semi_axes.iter().map(|axes| axes.map(|axis| axis / unit)).collect();
    System::new(positions, request.orientations.to_vec(), semi_axes, sides)
}

/// Back to metres, in a box of this volume (in units of the mean radius).
fn finished(mut system: System, unit: f64, volume: f64) -> Packed {
    system.stretch(libm::cbrt(volume / system.volume()));
    let sides = system.sides.map(|side| unit * side);
    let positions = system.positions.iter().map(|x| [0, 1, 2].map(|k| wrap(unit * x[k], sides[k]))).collect();
    Packed { sides, positions, orientations: system.orientations }
}

#[cfg(test)]
mod tests;
