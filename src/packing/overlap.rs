//! The check that every packing passes before it is used: nothing overlaps more than allowed.

use super::grid::{Ball, Cell, Grid};
use crate::error::{Error, Result};

/// A pair of particles and how far they overlap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Worst {
    /// The two ids, low first.
    pub ids: [u32; 2],
    /// Overlap over the smaller radius.
    pub fraction: f64,
}

impl Worst {
    /// That the pair is allowed to overlap so far.
    ///
    /// # Errors
    /// [`Error::Packing`] naming the pair, its overlap and what to do.
    pub fn check(&self, max_fraction: f64) -> Result<()> {
        if self.fraction <= max_fraction {
            return Ok(());
        }
        let ([low, high], fraction) = (self.ids, self.fraction);
        Err(Error::Packing(format!(
            "particles {low} and {high} overlap by {fraction:.3e} of the smaller radius, where {max_fraction} is allowed; \
             correct their positions or radii, enlarge the cell, lower `perturbation` in the section of the packing (such as \
             packing.random_close.perturbation), or raise contact.max_overlap_fraction"
        )))
    }
}

/// Refuse balls (index = id) of which a pair, images of one particle included, overlaps by more than
/// `max_fraction` of the smaller radius, or of which one reaches that far through a wall.
///
/// Cost is linear in the number of balls.
///
/// # Errors
/// [`Error::Packing`] naming the worst pair, its overlap and what to do.
pub fn check_overlaps(balls: &[Ball], cell: &Cell, max_fraction: f64) -> Result<()> {
    check_against_faces((0..).zip(balls.iter().copied()), cell, max_fraction)?;
    let ids: Vec<u32> = (0..balls.len() as u32).collect();
    worst_overlap(balls, &ids, balls.len(), cell, max_fraction).map_or(Ok(()), |worst| worst.check(max_fraction))
}

/// The pair of which the first ball is among the first `own` of `balls` that overlaps most, if it does by
/// more than `floor` of the smaller radius; of equal ones that of the lowest ids. `ids` of the balls;
/// balls of one id are images of each other and are no pair. Every side of the cell is at least a
/// diameter along its periodic axes.
#[must_use]
pub fn worst_overlap(balls: &[Ball], ids: &[u32], own: usize, cell: &Cell, floor: f64) -> Option<Worst> {
    if balls.is_empty() {
        return None;
    }
    let grid = Grid::new(*cell, balls, 1.0);
    let mut worst = Worst { ids: [0, 0], fraction: floor };
    for (index, ball) in balls[..own].iter().enumerate() {
        // Each pair of own balls once, from its smaller one.
        grid.visit_near(index, ball, 1.0, own == balls.len(), |other, image| {
            if ids[other] == ids[index] {
                return;
            }
            let partner = &balls[other];
            let d = image.separation(ball, partner);
            let distance = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            let fraction = (ball.radius + partner.radius - distance) / ball.radius.min(partner.radius);
            // So that copies of a packing tie, from wherever they are seen.
            let fraction = (fraction * 1e12).round() * 1e-12;
            let pair = [ids[index].min(ids[other]), ids[index].max(ids[other])];
            if fraction > worst.fraction || (fraction == worst.fraction && fraction > floor && pair < worst.ids) {
                worst = Worst { ids: pair, fraction };
            }
        });
    }
    (worst.fraction > floor).then_some(worst)
}

/// Own images across the periodic faces, and walls. It comes first: thereafter the cell is known to be
/// wide enough for a search of few images.
///
/// # Errors
/// [`Error::Packing`] naming the particle, its overlap and what to do.
pub fn check_against_faces(balls: impl Iterator<Item = (u32, Ball)>, cell: &Cell, max_fraction: f64) -> Result<()> {
    for (id, ball) in balls {
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let (side, position) = (cell.sides[axis], ball.position[axis]);
            let (overlap, what) = if cell.periodic[axis] {
                (2.0 * ball.radius - side, "its own periodic image")
            } else {
                (ball.radius - position.min(side - position), "a wall")
            };
            // Beyond two radii there is no telling how many images touch: no such cell makes sense.
            if overlap > max_fraction.min(1.0) * ball.radius {
                return Err(Error::Packing(format!(
                    "particle {id} (radius {:.4e} m, {name} = {position:.4e} m) overlaps {what} by {overlap:.4e} m, \
                     {:.3e} of its radius, where {max_fraction} is allowed; enlarge the cell (side {side:.4e} m), move \
                     the particle, or make it smaller",
                    ball.radius,
                    overlap / ball.radius
                )));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn balls(list: &[([f64; 3], f64)]) -> Vec<Ball> {
        list.iter().map(|(position, radius)| Ball { position: *position, radius: *radius }).collect()
    }

    fn cube(side: f64) -> Cell {
        Cell { sides: [side; 3], periodic: [true; 3] }
    }

    #[test]
    fn the_worst_pair_is_named_with_its_overlap() {
        let list = balls(&[([1.0; 3], 0.5), ([1.0, 1.0, 1.8], 0.5), ([5.0; 3], 1.0), ([5.0, 5.0, 6.0], 0.5)]);
        let message = check_overlaps(&list, &cube(10.0), 0.1).unwrap_err().to_string();
        assert!(message.contains("particles 2 and 3") && message.contains("1.000e0 of the smaller"), "{message}");
        assert!(check_overlaps(&list, &cube(10.0), 1.01).is_ok());
    }

    #[test]
    fn overlaps_across_periodic_faces_are_found_and_across_walls_are_not() {
        let list = balls(&[([0.5, 5.0, 5.0], 0.5), ([9.8, 5.0, 5.0], 0.5)]);
        assert!(check_overlaps(&list, &cube(10.0), 0.1).unwrap_err().to_string().contains("particles 0 and 1"));
        let walled = Cell { periodic: [false, true, true], ..cube(10.0) };
        let message = check_overlaps(&list, &walled, 0.1).unwrap_err().to_string();
        assert!(message.contains("particle 1") && message.contains("wall"), "{message}");
    }

    #[test]
    fn own_images_count_as_partners() {
        let message = check_overlaps(&balls(&[([0.1; 3], 0.6)]), &cube(1.0), 0.1).unwrap_err().to_string();
        assert!(message.contains("own periodic image"), "{message}");
    }

    #[test]
    fn two_spheres_that_touch_across_all_faces_pass() {
        let cell = Cell { sides: [1.0, 1.0, 2.0], periodic: [true; 3] };
        let list = balls(&[([0.5, 0.5, 0.5], 0.5), ([0.5, 0.5, 1.5], 0.5)]);
        assert!(check_overlaps(&list, &cell, 0.0).is_ok());
    }

    #[test]
    fn agrees_with_brute_force_on_random_points() {
        use super::super::random::{Draws, Purpose};
        use super::super::test_input::smallest_relative_distance;
        for count in [2, 5, 60] {
            let list: Vec<Ball> = (0..count)
                .map(|id| {
                    let mut draws = Draws::new(count, Purpose::Position, id);
                    Ball { position: [0; 3].map(|_| 2.0 * draws.uniform()), radius: 0.01 + 0.2 * draws.uniform() }
                })
                .collect();
            let positions: Vec<_> = list.iter().map(|ball| ball.position).collect();
            let radii: Vec<_> = list.iter().map(|ball| ball.radius).collect();
            let free = smallest_relative_distance(&positions, &radii, &cube(2.0)) >= 1.0;
            assert_eq!(check_overlaps(&list, &cube(2.0), 0.0).is_ok(), free);
        }
    }
}
