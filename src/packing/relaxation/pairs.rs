//! Which particles of a periodic cell may overlap: a list that stays good while they move little.

/// Two particles, the second displaced by an integer number of sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// First particle.
    pub first: u32,
    /// Second one; the first again for own images.
    pub second: u32,
    /// Sides to add to the second.
    pub shift: [i32; 3],
    /// Where the last search for its overlap ended.
    pub place: f64,
}

/// All pairs closer than the sum of their radii plus a margin, in the order of their ids and shifts.
#[derive(Debug, Default)]
pub struct PairList {
    /// The pairs.
    pub pairs: Vec<Pair>,
    /// Positions when the list was made.
    reference: Vec<[f64; 3]>,
    sides: [f64; 3],
    margin: f64,
    largest: f64,
}

impl PairList {
    /// Make the list. Positions may lie anywhere; they are taken as they are.
    #[must_use]
    pub fn new(positions: &[[f64; 3]], radii: &[f64], sides: [f64; 3], margin: f64) -> Self {
        let largest = radii.iter().fold(0.0, |most: f64, radius| if *radius > most { *radius } else { most });
        let grid = Grid::new(positions, sides, 2.0 * largest + margin);
        let mut pairs = Vec::new();
        let mut near = Vec::new();
        for first in 0..positions.len() {
            near.clear();
            grid.for_each_near(first, |second, shift| {
                if (first, [0; 3]) >= (second, shift) {
                    return;
                }
                let reach = radii[first] + radii[second] + margin;
                let d = separation(positions, first, second, shift, sides);
                if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < reach * reach {
                    near.push(Pair { first: first as u32, second: second as u32, shift, place: 0.5 });
                }
            });
            near.sort_unstable_by_key(|pair| (pair.second, pair.shift));
            pairs.extend_from_slice(&near);
        }
        Self { pairs, reference: positions.to_vec(), sides, margin, largest }
    }

    /// Whether a pair that is not listed may have come closer than the sum of its radii.
    #[must_use]
    pub fn is_stale(&self, positions: &[[f64; 3]], sides: [f64; 3]) -> bool {
        let stretch = sides[0] / self.sides[0];
        let mut farthest = 0.0;
        for (now, then) in positions.iter().zip(&self.reference) {
            let square: f64 = [0, 1, 2].map(|k| now[k] - stretch * then[k]).map(|x| x * x).iter().sum();
            if square > farthest {
                farthest = square;
            }
        }
        let room = stretch * (2.0 * self.largest + self.margin) - 2.0 * self.largest;
        // Smaller pairs have the same margin: with stretch < 1 the largest ones lose most.
        let room = if stretch < 1.0 { room } else { stretch * self.margin };
        2.0 * farthest.sqrt() >= room
    }
}

/// From the first particle to an image of the second.
#[inline(always)]
#[must_use]
pub fn separation(positions: &[[f64; 3]], first: usize, second: usize, shift: [i32; 3], sides: [f64; 3]) -> [f64; 3] {
    let (a, b) = (positions[first], positions[second]);
    [0, 1, 2].map(|k| b[k] - a[k] + f64::from(shift[k]) * sides[k])
}

/// Particles by cells of a regular grid, as large as the reach at least; a thin periodic cell is one cell
/// of the grid along that axis, seen as often as it takes.
struct Grid {
    counts: [usize; 3],
    /// How many cells to look at on each side.
    range: [i32; 3],
    cells: Vec<Vec<u32>>,
    /// Cell of each particle, and the sides to subtract from its position to have it in the box.
    home: Vec<([usize; 3], [i32; 3])>,
}

impl Grid {
    fn new(positions: &[[f64; 3]], sides: [f64; 3], reach: f64) -> Self {
        // As many as fit, but not more than there are particles.
        let most = libm::ceil(libm::cbrt(positions.len() as f64)).max(1.0);
        let counts = sides.map(|side| libm::floor(side / reach).clamp(1.0, most) as usize);
        let range = [0, 1, 2].map(|k| libm::ceil(reach * counts[k] as f64 / sides[k]) as i32);
        let mut cells = vec![Vec::new(); counts[0] * counts[1] * counts[2]];
        let mut home = Vec::with_capacity(positions.len());
        for (particle, position) in positions.iter().enumerate() {
            let turns = [0, 1, 2].map(|k| libm::floor(position[k] / sides[k]));
            let cell = [0, 1, 2].map(|k| {
                let along = (position[k] / sides[k] - turns[k]) * counts[k] as f64;
                (along as usize).min(counts[k] - 1)
            });
            cells[index(counts, cell)].push(particle as u32);
            home.push((cell, turns.map(|turn| turn as i32)));
        }
        Self { counts, range, cells, home }
    }

    /// Calls `visit(other, shift)` for each particle in the cells around that of `particle`, images and
    /// itself included.
    fn for_each_near(&self, particle: usize, mut visit: impl FnMut(usize, [i32; 3])) {
        let (cell, turns) = self.home[particle];
        let [rx, ry, rz] = self.range;
        for x in -rx..=rx {
            for y in -ry..=ry {
                for z in -rz..=rz {
                    let offset = [x, y, z];
                    let at = [0, 1, 2].map(|k| cell[k] as i32 + offset[k]);
                    let around = [0, 1, 2].map(|k| at[k].div_euclid(self.counts[k] as i32));
                    let inside = [0, 1, 2].map(|k| at[k].rem_euclid(self.counts[k] as i32) as usize);
                    for other in &self.cells[index(self.counts, inside)] {
                        let theirs = self.home[*other as usize].1;
                        visit(*other as usize, [0, 1, 2].map(|k| around[k] + turns[k] - theirs[k]));
                    }
                }
            }
        }
    }
}

fn index(counts: [usize; 3], cell: [usize; 3]) -> usize {
    (cell[2] * counts[1] + cell[1]) * counts[0] + cell[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in 0 … 1 that look random.
    fn scattered(count: usize, sides: [f64; 3]) -> Vec<[f64; 3]> {
        let part =
            |n: usize, k: usize| (n as f64 * [0.754_877, 0.569_84, 0.324_71][k] + 0.31 * n as f64 * n as f64) % 1.0;
        (0..count).map(|n| [0, 1, 2].map(|k| (3.0 * part(n, k) - 1.0) * sides[k])).collect()
    }

    #[test]
    fn the_list_is_that_of_brute_force_even_in_thin_cells() {
        for (count, sides, reach) in
            [(300, [7.0, 8.0, 6.0], 0.4), (60, [1.0, 9.0, 2.1], 0.5), (3, [0.9, 0.8, 1.0], 0.5)]
        {
            let positions = scattered(count, sides);
            let radii: Vec<f64> = (0..count).map(|n| reach * (1.0 + (n % 3) as f64 / 3.0)).collect();
            let list = PairList::new(&positions, &radii, sides, 0.1);
            let mut expected = 0;
            for first in 0..count {
                for second in first..count {
                    for shift in (-9..=9).flat_map(|x| (-9..=9).flat_map(move |y| (-9..=9).map(move |z| [x, y, z]))) {
                        if first == second && shift <= [0; 3] {
                            continue;
                        }
                        let d = separation(&positions, first, second, shift, sides);
                        let near = radii[first] + radii[second] + 0.1;
                        if d.iter().map(|x| x * x).sum::<f64>() < near * near {
                            expected += 1;
                            let wanted = (first as u32, second as u32, shift);
                            assert!(list.pairs.iter().any(|pair| (pair.first, pair.second, pair.shift) == wanted));
                        }
                    }
                }
            }
            assert_eq!(list.pairs.len(), expected);
        }
    }

    #[test]
    fn a_list_is_stale_when_particles_moved_or_the_cell_shrank() {
        let positions = scattered(20, [5.0; 3]);
        let list = PairList::new(&positions, &[0.5; 20], [5.0; 3], 0.2);
        assert!(!list.is_stale(&positions, [5.0; 3]));
        let scaled = |factor: f64| positions.iter().map(|x| x.map(|x| factor * x)).collect::<Vec<_>>();
        assert!(!list.is_stale(&scaled(0.9), [4.5; 3]));
        assert!(list.is_stale(&scaled(0.8), [4.0; 3]));
        let mut moved = positions.clone();
        moved[7][1] += 0.11;
        assert!(list.is_stale(&moved, [5.0; 3]));
    }
}
