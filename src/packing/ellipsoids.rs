//! Checks on ellipsoids in their initial places: nothing overlaps more than allowed.

use super::grid::Cell;
use super::overlap::Worst;
use super::relaxation::pairs::{PairList, separation};
use super::relaxation::touch::{Symmetric, overlap, squared_axes};
use crate::error::{Error, Result};
use crate::state::shape::{bounding_radius, smallest_semi_axis};

/// An ellipsoid in its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    position: [f64; 3],
    square: Symmetric,
    /// Largest and smallest semi-axis \[m\].
    largest: f64,
    smallest: f64,
}

impl Body {
    /// From its centre \[m\], semi-axes \[m\] and unit quaternion.
    #[must_use]
    pub fn new(position: [f64; 3], semi_axes: [f64; 3], orientation: [f64; 4]) -> Self {
        Self {
            position,
            square: squared_axes(semi_axes, orientation),
            largest: bounding_radius(semi_axes),
            smallest: smallest_semi_axis(semi_axes),
        }
    }
}

/// The pair (index = id) that overlaps most, images included; `None` if none does. The overlap is that
/// along the normal of the touching scaled ellipsoids, to first order in 1 − μ, over the smaller of the
/// smallest semi-axes.
#[must_use]
pub fn worst_overlap(bodies: &[Body], sides: [f64; 3]) -> Option<Worst> {
    let positions: Vec<[f64; 3]> = bodies.iter().map(|body| body.position).collect();
    let radii: Vec<f64> = bodies.iter().map(|body| body.largest).collect();
    let list = PairList::new(&positions, &radii, sides, 0.0);
    let mut worst: Option<Worst> = None;
    for pair in &list.pairs {
        let (first, second) = (pair.first as usize, pair.second as usize);
        let d = separation(&positions, first, second, pair.shift, sides);
        let Some(found) = overlap(&bodies[first].square, &bodies[second].square, d, pair.place) else { continue };
        let slope = found.gradient.map(|component| component * component).iter().sum::<f64>().sqrt();
        let depth = (1.0 - found.scale) / slope;
        let fraction = depth / bodies[first].smallest.min(bodies[second].smallest);
        if worst.is_none_or(|worst| fraction > worst.fraction) {
            worst = Some(Worst { ids: [pair.first, pair.second], fraction });
        }
    }
    worst
}

/// Refuse ellipsoids (index = id) of which a pair, images included, overlaps by more than `max_fraction`
/// of the smaller of their smallest semi-axes, or of which one reaches that far through a wall.
///
/// # Errors
/// [`Error::Packing`] naming the worst pair or the particle, its overlap and what to do.
pub fn check_overlaps(bodies: &[Body], cell: &Cell, max_fraction: f64) -> Result<()> {
    for (id, body) in bodies.iter().enumerate() {
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate().filter(|(axis, _)| !cell.periodic[*axis]) {
            // How far the surface reaches along an axis of space.
            let reach = body.square[axis].sqrt();
            let overlap = reach - body.position[axis].min(cell.sides[axis] - body.position[axis]);
            if overlap > max_fraction * body.smallest {
                return Err(Error::Packing(format!(
                    "particle {id} reaches through a wall of the {name} axis by {overlap:.4e} m, {:.3e} of its smallest \
                     semi-axis, where {max_fraction} is allowed; move the particle, enlarge the cell, or make it smaller",
                    overlap / body.smallest
                )));
            }
        }
    }
    let largest = bodies.iter().map(|body| body.largest).fold(0.0, f64::max);
    // Along walled axes images are out of reach.
    let sides = [0, 1, 2].map(|k| cell.sides[k] + if cell.periodic[k] { 0.0 } else { 4.0 * largest });
    worst_overlap(bodies, sides).map_or(Ok(()), |worst| worst.check(max_fraction))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::shape::UPRIGHT;

    const CELL: Cell = Cell { sides: [10.0; 3], periodic: [true, true, false] };

    fn long(x: f64, z: f64) -> Body {
        Body::new([x, 5.0, z], [2.0, 1.0, 0.5], UPRIGHT)
    }

    #[test]
    fn an_overlap_is_measured_along_the_normal_through_periodic_faces() {
        let worst = worst_overlap(&[long(1.0, 5.0), long(7.1, 5.0)], [10.0; 3]).expect("they overlap");
        assert_eq!(worst.ids, [0, 1]);
        assert!((worst.fraction - 0.2).abs() < 1e-9, "{worst:?}");
        let message = check_overlaps(&[long(1.0, 5.0), long(7.1, 5.0)], &CELL, 0.1).unwrap_err().to_string();
        assert!(message.contains("particles 0 and 1 overlap by 2.000e-1"), "{message}");
        assert!(check_overlaps(&[long(1.0, 5.0), long(7.0, 5.0)], &CELL, 1e-9).is_ok());
    }

    #[test]
    fn flat_ellipsoids_may_lie_close_to_a_wall_and_to_each_other() {
        let stack: Vec<Body> = (0..10).map(|n| long(3.0, 0.5 + f64::from(n))).collect();
        assert!(check_overlaps(&stack, &CELL, 1e-9).is_ok());
        let message = check_overlaps(&[long(3.0, 0.3)], &CELL, 0.1).unwrap_err().to_string();
        assert!(message.contains("particle 0 reaches through a wall of the z axis"), "{message}");
    }
}
