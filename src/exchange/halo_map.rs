//! The geometry of the halo: which ranks need a particle. Follows from the regular grid alone, so that
//! both ends of a message know of it without asking. Must not know messages.

use super::Decomposition;

/// Widens intervals by a little, in units of a box, so that rounding never loses a partner.
const ROUNDING: f64 = 1e-9;

/// The grid as one rank sees it.
pub struct HaloMap {
    decomposition: Decomposition,
    rank: usize,
    sides: [f64; 3],
    periodic: [bool; 3],
    partners: Vec<usize>,
}

impl HaloMap {
    /// Map for halos of radius + `reach` \[m\], no radius being larger than `reach`.
    pub fn new(decomposition: &Decomposition, rank: usize, sides: [f64; 3], periodic: [bool; 3], reach: f64) -> Self {
        let decomposition = *decomposition;
        let own = decomposition.coordinates(rank);
        let columns = [0, 1, 2].map(|k| {
            // The same number of hops to both sides, so that the relation is mutual.
            let hops = 1 + (2.0 * reach / sides[k] * decomposition.grid[k] as f64 + ROUNDING) as i64;
            let centre = own[k] as i64;
            columns(decomposition.grid[k], periodic[k], centre - hops, centre + hops)
        });
        let mut partners = Vec::new();
        for_each_rank(&decomposition, &columns, |other| {
            if other != rank {
                partners.push(other);
            }
        });
        partners.sort_unstable();
        Self { decomposition, rank, sides, periodic, partners }
    }

    /// Ranks that may need a particle of this one or the other way round, ascending. The relation is
    /// mutual: if a rank is a partner here, this rank is a partner there.
    pub fn partners(&self) -> &[usize] {
        &self.partners
    }

    /// Whether this rank owns the position.
    pub fn owns(&self, position: [f64; 3]) -> bool {
        self.decomposition.owner(position, self.sides) == self.rank
    }

    /// Calls `visit` once for every partner (its index in [`HaloMap::partners`]) of which the box grown by
    /// `margin` \[m\] holds some periodic image of `position`. The position is one that this rank owns.
    pub fn for_each_needing(&self, position: [f64; 3], margin: f64, mut visit: impl FnMut(usize)) {
        let grid = self.decomposition.grid;
        let mut spans = [(0, 0); 3];
        for k in 0..3 {
            let place = self.decomposition.place(k, position[k], self.sides[k]);
            let width = margin / self.sides[k] * grid[k] as f64 + ROUNDING;
            spans[k] = ((place - width).floor() as i64, (place + width).floor() as i64);
        }
        // Most particles lie deep inside their box.
        if (0..3).all(|k| spans[k].0 == spans[k].1 || grid[k] == 1) {
            return;
        }
        let columns = [0, 1, 2].map(|k| columns(grid[k], self.periodic[k], spans[k].0, spans[k].1));
        for_each_rank(&self.decomposition, &columns, |other| {
            if other != self.rank {
                // The partners' hops are at least as wide as any particle's margin.
                if let Ok(index) = self.partners.binary_search(&other) {
                    visit(index);
                } else {
                    debug_assert!(false, "rank {other} needs a particle but is no partner");
                }
            }
        });
    }
}

/// Distinct columns of an axis that the unwrapped columns low … high stand for.
fn columns(boxes: usize, periodic: bool, low: i64, high: i64) -> Columns {
    let count = boxes as i64;
    if !periodic {
        let low = low.clamp(0, count - 1);
        Columns { first: low, number: high.clamp(0, count - 1) - low + 1, boxes: count }
    } else if high - low + 1 >= count {
        Columns { first: 0, number: count, boxes: count }
    } else {
        Columns { first: low.rem_euclid(count), number: high - low + 1, boxes: count }
    }
}

/// A run of columns, wrapping around.
#[derive(Clone, Copy)]
struct Columns {
    first: i64,
    number: i64,
    boxes: i64,
}

impl Columns {
    fn iter(self) -> impl Iterator<Item = usize> {
        (self.first..self.first + self.number)
            .map(move |column| (if column < self.boxes { column } else { column - self.boxes }) as usize)
    }
}

fn for_each_rank(decomposition: &Decomposition, columns: &[Columns; 3], mut visit: impl FnMut(usize)) {
    for x in columns[0].iter() {
        for y in columns[1].iter() {
            for z in columns[2].iter() {
                visit(decomposition.rank([x, y, z]));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// By definition: some image of the position lies in the rank's box grown by the margin.
    fn needs(
        grid: &Decomposition,
        rank: usize,
        x: [f64; 3],
        sides: [f64; 3],
        periodic: [bool; 3],
        margin: f64,
    ) -> bool {
        let (low, high) = grid.bounds(rank);
        (0..3).all(|k| {
            let images = if periodic[k] { 12 } else { 0 };
            (-images..=images).any(|shift| {
                let image = x[k] + f64::from(shift) * sides[k];
                low[k] * sides[k] - margin <= image && image <= high[k] * sides[k] + margin
            })
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn every_rank_that_needs_a_particle_is_found_and_hardly_any_other(
            grid in [1_usize..7, 1..5, 1..5], fraction in [0.0..1.0, 0.0..1.0, 0.0..1.0],
            periodic in any::<[bool; 3]>(), reach in 0.01..2.0_f64, radius in 0.0..1.0_f64
        ) {
            let (sides, grid) = ([1.0, 0.7, 1.3], Decomposition { grid });
            let x = [0, 1, 2].map(|k: usize| fraction[k] * sides[k]);
            let margin = reach + radius * reach;
            let owner = grid.owner(x, sides);
            let map = HaloMap::new(&grid, owner, sides, periodic, reach);
            let mut found = vec![0; grid.ranks()];
            map.for_each_needing(x, margin, |index| found[map.partners()[index]] += 1);
            for rank in (0..grid.ranks()).filter(|&rank| rank != owner) {
                prop_assert!(found[rank] <= 1);
                prop_assert!(found[rank] == 1 || !needs(&grid, rank, x, sides, periodic, margin));
                prop_assert!(found[rank] == 0 || needs(&grid, rank, x, sides, periodic, margin + 1e-6));
            }
        }

        #[test]
        fn partners_are_mutual(
            grid in [1_usize..7, 1..5, 1..5], periodic in any::<[bool; 3]>(), reach in 0.001..1.0_f64
        ) {
            let (sides, grid) = ([1.0, 0.7, 1.3], Decomposition { grid });
            let maps: Vec<_> =
                (0..grid.ranks()).map(|rank| HaloMap::new(&grid, rank, sides, periodic, reach)).collect();
            for (rank, map) in maps.iter().enumerate() {
                for &partner in map.partners() {
                    prop_assert!(maps[partner].partners().contains(&rank));
                }
            }
        }
    }

    #[test]
    fn a_particle_outside_a_wall_is_still_seen_by_the_neighbours_of_its_owner() {
        let grid = Decomposition { grid: [2, 2, 1] };
        let map = HaloMap::new(&grid, 0, [1.0; 3], [false, true, true], 0.2);
        let mut found = Vec::new();
        map.for_each_needing([-5.0, 0.4, 0.5], 0.3, |index| found.push(map.partners()[index]));
        assert_eq!(found, [1]);
    }
}
