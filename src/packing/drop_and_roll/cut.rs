//! From a bed on a floor to a packing that is periodic in z as well: floor and surface are cut off, and the
//! overlaps at the seam relaxed.

use super::super::grid::{Ball, Cell};
use super::super::relax::{Relaxed, relax};
use super::DroppedBed;
use crate::error::{Error, Result};

/// The middle of a bed, periodic in all directions.
#[derive(Debug, Clone, PartialEq)]
pub struct PeriodicCut {
    /// Sides of the cell \[m\].
    pub sides: [f64; 3],
    /// Ids in the bed, ascending.
    pub kept: Vec<u32>,
    /// Centres of the kept particles \[m\], wrapped into the cell.
    pub positions: Vec<[f64; 3]>,
    /// The relaxation of the seam.
    pub relaxed: Relaxed,
    /// By how much the cell was made higher than the slab cut out, since overlaps would not vanish \[m\].
    pub heightened: f64,
}

/// Steps of the relaxation before the cell is made higher …
const STEPS: usize = 3000;
/// … by this fraction of the mean diameter, this often at most.
const HEIGHTENING: f64 = 0.02;
const ATTEMPTS: usize = 50;

/// Cut the `keep` particles of middle height out of a bed on this floor (`radii` by id), with as many left
/// out below as above, and relax the overlaps that periodicity in z makes until none exceeds `tolerance`
/// times the smaller radius.
///
/// The faces lie halfway between the heights of the last centre inside and the first one outside. What
/// stays in place stays as dropped. Should overlaps not vanish, the cell is opened at the seam a little at a time.
///
/// # Errors
/// [`Error::Packing`] if the slab is lower than the largest particle, or overlaps remain.
///
/// # Source
/// W Sec. 2.1.
pub fn cut(bed: &DroppedBed, radii: &[f64], floor: [f64; 2], keep: usize, tolerance: f64) -> Result<PeriodicCut> {
    let height = |id: &u32| bed.positions[*id as usize][2];
    let mut order: Vec<u32> = (0..radii.len() as u32).collect();
    order.sort_unstable_by(|a, b| height(a).total_cmp(&height(b)).then(a.cmp(b)));
    let first = (order.len() - keep) / 2;
    let inside = &order[first..first + keep];
    let face = |above: usize| {
        let below = above.checked_sub(1).map_or(0.0, |below| height(&order[below]));
        0.5 * (below + order.get(above).map_or(bed.top, height))
    };
    let (low, high) = (face(first), face(first + keep));
    let mut kept = inside.to_vec();
    kept.sort_unstable();
    let mut balls: Vec<Ball> = kept
        .iter()
        .map(|id| {
            let [x, y, z] = bed.positions[*id as usize];
            Ball { position: [x, y, z - low], radius: radii[*id as usize] }
        })
        .collect();
    let largest = balls.iter().map(|ball| ball.radius).fold(0.0, f64::max);
    let mean = balls.iter().map(|ball| ball.radius).sum::<f64>() / keep as f64;
    let mut cell = Cell { sides: [floor[0], floor[1], high - low], periodic: [true; 3] };
    if cell.sides[2] < 2.0 * largest {
        return Err(Error::Packing(format!(
            "the {keep} particles kept of drop and roll fill a height of {:.4e} m, and the largest is {:.4e} m across: \
             use more particles, or a cell.aspect that is higher in z",
            cell.sides[2],
            2.0 * largest
        )));
    }
    for _ in 0..ATTEMPTS {
        let relaxed = relax(&cell, &mut balls, tolerance, STEPS);
        if relaxed.worst.is_none_or(|worst| worst.fraction <= tolerance) {
            let positions = balls.iter().map(|ball| ball.position).collect();
            return Ok(PeriodicCut {
                sides: cell.sides,
                kept,
                positions,
                relaxed,
                heightened: cell.sides[2] - (high - low),
            });
        }
        cell.sides[2] += 2.0 * HEIGHTENING * mean;
    }
    Err(Error::Packing(format!(
        "overlaps above {tolerance} of the radius remain at the cut of the {keep} particles of drop and roll, although \
         the cell was opened by {:.4e} m; use more particles, or raise packing.drop_and_roll.remaining_overlap",
        cell.sides[2] - (high - low)
    )))
}
