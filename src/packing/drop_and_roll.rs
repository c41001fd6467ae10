//! Drop and roll: spheres fall one after the other on those at rest and roll down to where three of them
//! hold them. Serial, hence the same bits on any machine.

pub mod cut;
mod descent;
pub mod input;
mod roll;

use super::grid::{Ball, Cell, Grid};
use super::random::{Draws, Purpose};
use super::rcp::wrap;
use crate::error::{Error, Result};
use roll::Bed;

/// What to drop.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// Radius of every particle \[m\], by id.
    pub radii: &'a [f64],
    /// Sides of the floor, periodic in x and y \[m\].
    pub floor: [f64; 2],
    /// Seed of the order and the starting points.
    pub seed: u64,
}

/// Spheres at rest on a floor at z = 0.
#[derive(Debug, Clone, PartialEq)]
pub struct DroppedBed {
    /// Centres \[m\], by id; x and y wrapped into the floor.
    pub positions: Vec<[f64; 3]>,
    /// Height of the highest point \[m\].
    pub top: f64,
    /// Falls, and rolls on one or two spheres, of all particles together.
    pub legs: u64,
}

/// Drop spheres one after the other, in random order, from points uniform over the floor.
///
/// A sphere falls to the floor, where it stays, or on a first sphere, rolls down its meridian to a second
/// one, on both to a third one, and rests if its centre then lies inside the horizontal triangle of the
/// three; else it rolls on those of them that still carry it. It has no inertia and does not move any more
/// once it rests. Equal spheres attain a solid fraction of 0.58 away from floor and surface.
///
/// # Errors
/// [`Error::Packing`] if the floor is narrower than a sphere, or a sphere does not come to rest.
///
/// # Source
/// Visscher and Bolsterli 1972, doi:10.1038/239504a0; W Sec. 2.1 and Fig. 3.
pub fn drop_all(request: &Request) -> Result<DroppedBed> {
    let largest = request.radii.iter().copied().fold(0.0, f64::max);
    if let Some(axis) = (0..2).find(|axis| request.floor[*axis] < 2.0 * largest) {
        return Err(Error::Packing(format!(
            "the floor of drop and roll is {:.4e} m wide along {}, and the largest of {} particles {:.4e} m: use more \
             particles or other proportions of the cell",
            request.floor[axis],
            ["x", "y"][axis],
            request.radii.len(),
            2.0 * largest
        )));
    }
    let mut order: Vec<(f64, u32)> = (0..request.radii.len() as u32)
        .map(|id| (Draws::new(request.seed, Purpose::DropOrder, u64::from(id)).uniform(), id))
        .collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));

    // Nobody knows the height before the end; the grid is made anew when the bed outgrows it.
    let mut height = 2.0 * super::rcp::solid_volume(request.radii) / (request.floor[0] * request.floor[1]);
    height = height.max(4.0 * largest);
    let mut balls: Vec<Ball> =
        order.iter().map(|(_, id)| Ball { position: [0.0; 3], radius: request.radii[*id as usize] }).collect();
    let mut grid = Grid::empty(slab(request.floor, height), &balls, 1.0);
    let mut positions = vec![[0.0; 3]; balls.len()];
    let (mut top, mut legs) = (0.0_f64, 0_u64);
    for (number, (_, id)) in order.iter().enumerate() {
        let radius = balls[number].radius;
        let mut draws = Draws::new(request.seed, Purpose::Position, u64::from(*id));
        let start = request.floor.map(|side| draws.uniform() * side);
        let tie = 2.0 * std::f64::consts::PI * draws.uniform();
        let bed = Bed { balls: &balls, grid: &grid, top, largest };
        let (rest, taken) = bed.settle(radius, start, tie).ok_or_else(|| restless(*id, radius))?;
        legs += taken as u64 + 1;
        let position = [wrap(rest[0], request.floor[0]), wrap(rest[1], request.floor[1]), rest[2]];
        balls[number].position = position;
        positions[*id as usize] = position;
        top = top.max(position[2] + radius);
        if top > height {
            height *= 2.0;
            grid = Grid::empty(slab(request.floor, height), &balls, 1.0);
            (0..number).for_each(|earlier| grid.add(earlier, balls[earlier].position));
        }
        grid.add(number, position);
    }
    Ok(DroppedBed { positions, top, legs })
}

fn slab([x, y]: [f64; 2], height: f64) -> Cell {
    Cell { sides: [x, y, height], periodic: [true, true, false] }
}

fn restless(id: u32, radius: f64) -> Error {
    Error::Packing(format!(
        "particle {id} (radius {radius:.4e} m) does not come to rest in drop and roll; choose another seed, and please \
         report this input"
    ))
}

#[inline]
fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests;
