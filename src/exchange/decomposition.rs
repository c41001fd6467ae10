//! Division of the cell among ranks: a regular grid of boxes in fractional coordinates, so that it
//! deforms with the cell. Must not know particles beyond a position.

use crate::error::{Error, Result};

/// A regular grid of ranks; rank = (x · grid\[1\] + y) · grid\[2\] + z.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Decomposition {
    /// Ranks per axis.
    pub grid: [usize; 3],
}

impl Decomposition {
    /// The grid that cuts the least surface, over all factorisations of the largest rank count not above
    /// `ranks` that leaves each rank at least `min_particles_per_rank` of `particles` on average. It may
    /// use fewer ranks than there are, at least one. `sides` of the cell \[m\].
    #[must_use]
    pub fn automatic(ranks: usize, particles: u64, min_particles_per_rank: usize, sides: [f64; 3]) -> Self {
        let sensible = particles / (min_particles_per_rank.max(1) as u64);
        let used = ranks.min(usize::try_from(sensible).unwrap_or(usize::MAX)).max(1);
        let area = [sides[1] * sides[2], sides[2] * sides[0], sides[0] * sides[1]];
        let mut best = ([1, 1, used], f64::INFINITY, 0.0);
        for x in divisors(used) {
            for y in divisors(used / x) {
                let grid = [x, y, used / x / y];
                // An axis of one rank is not cut; n ranks on it share n planes.
                let planes = grid.map(|n| if n > 1 { n as f64 } else { 0.0 });
                let surface = planes[0] * area[0] + planes[1] * area[1] + planes[2] * area[2];
                // Of equal surfaces, the thickest boxes: they need the fewest hops.
                let thickness = (0..3).map(|k| sides[k] / grid[k] as f64).fold(f64::INFINITY, f64::min);
                let same = surface <= best.1 * (1.0 + 1e-12);
                if surface < best.1 * (1.0 - 1e-12) || same && thickness > best.2 {
                    best = (grid, surface, thickness);
                }
            }
        }
        Self { grid: best.0 }
    }

    /// The grid that the user asks for. It may use fewer ranks than there are; boxes may be thinner than
    /// the reach of contacts, since the halo reaches over several of them.
    ///
    /// # Errors
    /// [`Error::Layout`] if an entry is zero or the product exceeds `ranks`.
    pub fn explicit(grid: [usize; 3], ranks: usize) -> Result<Self> {
        let [x, y, z] = grid;
        let product = x.checked_mul(y).and_then(|xy| xy.checked_mul(z));
        match product {
            Some(0) => Err(Error::Layout(format!(
                "the grid {x} × {y} × {z} has an axis with no rank; give at least 1 per axis, or leave the grid out"
            ))),
            Some(product) if product <= ranks => Ok(Self { grid }),
            None => Err(Error::Layout(format!(
                "the grid {x} × {y} × {z} needs more ranks than can be counted, and the program runs on {ranks}; choose a \
                 smaller grid, or leave the grid out"
            ))),
            Some(product) => Err(Error::Layout(format!(
                "the grid {x} × {y} × {z} needs {product} ranks, but the program runs on {ranks}; start it with \
                     mpirun -n {product}, choose a smaller grid, or leave the grid out"
            ))),
        }
    }

    /// Number of ranks used.
    #[must_use]
    pub fn ranks(&self) -> usize {
        self.grid.iter().product()
    }

    /// Rank whose box holds the wrapped `position` \[m\]; positions outside the cell belong to the nearest
    /// box.
    #[must_use]
    pub fn owner(&self, position: [f64; 3], sides: [f64; 3]) -> usize {
        self.rank([0, 1, 2].map(|k| self.column(k, position[k], sides[k])))
    }

    /// Position along `axis` in units of boxes, within \[0, grid\].
    #[inline]
    pub(super) fn place(&self, axis: usize, coordinate: f64, side: f64) -> f64 {
        let boxes = self.grid[axis] as f64;
        (coordinate / side * boxes).clamp(0.0, boxes)
    }

    /// Index along `axis` of the box that owns this coordinate.
    #[inline]
    pub(super) fn column(&self, axis: usize, coordinate: f64, side: f64) -> usize {
        (self.place(axis, coordinate, side) as usize).min(self.grid[axis] - 1)
    }

    /// Low and high corner of a rank's box as fractions of the sides.
    #[must_use]
    pub fn bounds(&self, rank: usize) -> ([f64; 3], [f64; 3]) {
        let coordinates = self.coordinates(rank);
        let fraction = |k: usize, index: usize| index as f64 / self.grid[k] as f64;
        ([0, 1, 2].map(|k| fraction(k, coordinates[k])), [0, 1, 2].map(|k| fraction(k, coordinates[k] + 1)))
    }

    /// Rank at these grid coordinates.
    #[must_use]
    pub fn rank(&self, coordinates: [usize; 3]) -> usize {
        (coordinates[0] * self.grid[1] + coordinates[1]) * self.grid[2] + coordinates[2]
    }

    /// The other ranks whose boxes share a face, an edge or a corner with that of `rank`, those across the
    /// faces of the cell included, ascending.
    #[must_use]
    pub fn neighbours(&self, rank: usize) -> Vec<usize> {
        let own = self.coordinates(rank);
        let columns = [0, 1, 2].map(|k| [self.grid[k] - 1, 0, 1].map(|step| (own[k] + step) % self.grid[k]));
        let mut ranks = Vec::with_capacity(27);
        for x in columns[0] {
            for y in columns[1] {
                ranks.extend(columns[2].map(|z| self.rank([x, y, z])));
            }
        }
        ranks.sort_unstable();
        ranks.dedup();
        ranks.retain(|&other| other != rank);
        ranks
    }

    /// Grid coordinates of a rank.
    #[must_use]
    pub fn coordinates(&self, rank: usize) -> [usize; 3] {
        [rank / (self.grid[1] * self.grid[2]), rank / self.grid[2] % self.grid[1], rank % self.grid[2]]
    }
}

fn divisors(number: usize) -> impl Iterator<Item = usize> {
    (1..=number).filter(move |candidate| number.is_multiple_of(*candidate))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_cube_is_cut_into_cubes_and_a_rod_into_slices() {
        assert_eq!(Decomposition::automatic(8, 1_000_000, 100, [1.0; 3]).grid, [2, 2, 2]);
        assert_eq!(Decomposition::automatic(64, 1_000_000, 100, [1.0; 3]).grid, [4, 4, 4]);
        assert_eq!(Decomposition::automatic(4, 1_000_000, 100, [1.0, 10.0, 1.0]).grid, [1, 4, 1]);
    }

    #[test]
    fn few_particles_leave_ranks_idle() {
        assert_eq!(Decomposition::automatic(8, 250, 100, [1.0; 3]).ranks(), 2);
        assert_eq!(Decomposition::automatic(8, 10, 100, [1.0; 3]).ranks(), 1);
        assert_eq!(Decomposition::automatic(8, 8, 0, [1.0; 3]).ranks(), 8);
    }

    #[test]
    fn a_grid_that_cannot_work_names_product_and_ranks() {
        let text = Decomposition::explicit([2, 2, 2], 3).map_err(|e| e.to_string()).unwrap_err();
        assert!(text.contains("2 × 2 × 2 needs 8 ranks") && text.contains("runs on 3"), "{text}");
        assert!(Decomposition::explicit([2, 0, 2], 3).is_err());
        assert!(Decomposition::explicit([usize::MAX, 2, 1], 3).is_err());
        assert_eq!(Decomposition::explicit([3, 1, 1], 5).map(|d| d.ranks()).ok(), Some(3));
    }

    #[test]
    fn neighbours_touch_across_the_faces_of_the_cell_and_are_mutual() {
        assert_eq!(Decomposition { grid: [4, 1, 1] }.neighbours(0), [1, 3]);
        assert_eq!(Decomposition { grid: [2, 1, 1] }.neighbours(1), [0]);
        assert!(Decomposition { grid: [1; 3] }.neighbours(0).is_empty());
        let grid = Decomposition { grid: [5, 4, 3] };
        for rank in 0..grid.ranks() {
            assert_eq!(grid.neighbours(rank).len(), 26);
            assert!(grid.neighbours(rank).iter().all(|&other| grid.neighbours(other).contains(&rank)));
        }
    }

    proptest! {
        #[test]
        fn every_position_has_one_owner_whose_box_holds_it(
            grid in [1_usize..6, 1..6, 1..6], fraction in [0.0..1.0, 0.0..1.0, 0.0..1.0], side in 1e-6..1e3_f64
        ) {
            let decomposition = Decomposition { grid };
            let sides = [side, 2.0 * side, 0.3 * side];
            let owner = decomposition.owner([0, 1, 2].map(|k: usize| fraction[k] * sides[k]), sides);
            let (low, high) = decomposition.bounds(owner);
            for k in 0..3 {
                prop_assert!(low[k] <= fraction[k] + 1e-12 && fraction[k] <= high[k] + 1e-12);
            }
            prop_assert_eq!(decomposition.rank(decomposition.coordinates(owner)), owner);
        }
    }
}
