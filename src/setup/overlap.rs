//! The check for overlaps of a packing that no process holds as a whole: each rank looks at its own
//! particles and at copies of those around them.

use crate::config::Config;
use crate::error::Result;
use crate::exchange::{Communicator, Decomposition, HaloPlan, agree};
use crate::packing::Worst;
use crate::packing::grid::{Ball, Cell};
use crate::packing::overlap::{check_against_faces, worst_overlap};
use crate::packing::periodic_axes;
use crate::state::particles::Particles;
use crate::state::shape::smallest_semi_axis;

/// The cell, and who owns what.
pub struct Space<'a> {
    /// Ranks and their boxes.
    pub decomposition: &'a Decomposition,
    /// Sides of the cell \[m\].
    pub sides: [f64; 3],
    /// Boundaries and the allowed overlap.
    pub config: &'a Config,
}

/// The pair that overlaps most, over all ranks; `None` if none does. Each rank passes its owned
/// particles, inside its box; they come back as they were. Collective.
///
/// # Errors
/// An overlap beyond what the input allows, the same error on every rank.
pub fn largest(
    comm: &Communicator,
    space: &Space,
    particles: &mut Particles,
    max_radius: f64,
) -> Result<Option<Worst>> {
    let allowed = space.config.max_overlap_fraction;
    let cell = Cell { sides: space.sides, periodic: periodic_axes(&space.config.cell) };
    let ball = |particles: &Particles, index: usize| Ball {
        position: particles.record[index].position,
        // Of an ellipsoid the sphere inside it: what more of it overlaps the first step finds.
        radius: smallest_semi_axis(particles.semi_axes(index)),
    };
    let own = (0..particles.owned).map(|index| (particles.id[index], ball(particles, index)));
    agree(comm, check_against_faces(own, &cell, allowed))?;
    let owned = particles.owned;
    HaloPlan::build(comm, space.decomposition, particles, cell.sides, cell.periodic, max_radius)?;
    let window = Window::new(space.decomposition, comm.rank(), &cell, 2.0 * max_radius);
    let (mut balls, mut ids) = (Vec::with_capacity(particles.len()), Vec::with_capacity(particles.len()));
    for index in 0..owned {
        balls.push(window.seen(ball(particles, index), [0; 3]));
        ids.push(particles.id[index]);
    }
    for index in 0..particles.len() {
        for image in window.images(&ball(particles, index)).filter(|image| index >= owned || *image != [0; 3]) {
            balls.push(window.seen(ball(particles, index), image));
            ids.push(particles.id[index]);
        }
    }
    particles.drop_ghosts();
    let worst = over_ranks(comm, worst_overlap(&balls, &ids, owned, &window.cell, 0.0));
    worst.map_or(Ok(()), |worst| worst.check(allowed))?;
    Ok(worst)
}

/// A rank's box with a margin, as a cell of its own: periodic where the rank has the axis for itself.
struct Window {
    cell: Cell,
    low: [f64; 3],
    whole: Cell,
    cut: [bool; 3],
}

impl Window {
    fn new(decomposition: &Decomposition, rank: usize, whole: &Cell, margin: f64) -> Self {
        let (low, high) = decomposition.bounds(rank);
        let cut = decomposition.grid.map(|ranks| ranks > 1);
        let edge = |k: usize, fraction: f64, margin: f64| fraction * whole.sides[k] + if cut[k] { margin } else { 0.0 };
        let low = [0, 1, 2].map(|k| edge(k, low[k], -margin));
        let high = [0, 1, 2].map(|k| edge(k, high[k], margin));
        let cell = Cell {
            sides: [0, 1, 2].map(|k| high[k] - low[k]),
            periodic: [0, 1, 2].map(|k| whole.periodic[k] && !cut[k]),
        };
        Self { cell, low, whole: *whole, cut }
    }

    /// An image of a ball in the window's coordinates.
    fn seen(&self, ball: Ball, image: [i32; 3]) -> Ball {
        let coordinate = |k: usize| ball.position[k] + f64::from(image[k]) * self.whole.sides[k] - self.low[k];
        Ball { position: [0, 1, 2].map(coordinate), ..ball }
    }

    /// Images that lie in the window; along axes that are not cut the window itself is periodic.
    fn images(&self, ball: &Ball) -> impl Iterator<Item = [i32; 3]> {
        let along = |k: usize| {
            let inside = |shift: &i32| {
                let coordinate = ball.position[k] + f64::from(*shift) * self.whole.sides[k] - self.low[k];
                *shift == 0 && !(self.cut[k] && self.whole.periodic[k])
                    || self.cut[k] && self.whole.periodic[k] && (0.0..=self.cell.sides[k]).contains(&coordinate)
            };
            (-2..=2).filter(inside).collect::<Vec<i32>>()
        };
        let [x, y, z] = [0, 1, 2].map(along);
        x.into_iter().flat_map(move |i| {
            let z = z.clone();
            y.clone().into_iter().flat_map(move |j| z.clone().into_iter().map(move |k| [i, j, k]))
        })
    }
}

/// The worst of all ranks, of equal ones that of the lowest ids. Collective.
fn over_ranks(comm: &Communicator, own: Option<Worst>) -> Option<Worst> {
    let mut fraction = [own.map_or(0.0, |worst| worst.fraction)];
    comm.max_f64(&mut fraction);
    let mut candidate = own.filter(|worst| worst.fraction == fraction[0]);
    let ids = [0, 1].map(|end| {
        let mut lowest = [candidate.map_or(i64::MIN, |worst| -i64::from(worst.ids[end]))];
        comm.max_i64(&mut lowest);
        candidate = candidate.filter(|worst| -i64::from(worst.ids[end]) == lowest[0]);
        -lowest[0].max(-i64::from(u32::MAX)) as u32
    });
    (fraction[0] > 0.0).then_some(Worst { ids, fraction: fraction[0] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_of_half_a_cell_sees_partners_through_both_faces() {
        let whole = Cell { sides: [4.0, 3.0, 3.0], periodic: [true, true, false] };
        let window = Window::new(&Decomposition { grid: [2, 1, 1] }, 0, &whole, 1.0);
        assert_eq!(window.cell.periodic, [false, true, false]);
        assert_eq!(window.cell.sides, [4.0, 3.0, 3.0]);
        let images = |x: f64| window.images(&Ball { position: [x, 1.0, 1.0], radius: 0.5 }).collect::<Vec<_>>();
        assert_eq!(images(1.0), [[0; 3]]);
        assert_eq!(images(2.5), [[0; 3]]);
        assert_eq!(images(3.5), [[-1, 0, 0]]);
        assert_eq!(images(3.0), [[-1, 0, 0], [0; 3]]);
    }
}
