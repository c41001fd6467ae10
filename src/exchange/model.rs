//! How much ranks have to tell each other: the expected halo of a rank from the geometry alone, and the
//! step time and parallel efficiency that follow for a machine described by four numbers. Must not know
//! messages or particles.

/// What one rank exchanges per step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Traffic {
    /// Ghosts on the rank.
    pub ghosts: f64,
    /// Messages that it sends.
    pub messages: f64,
    /// Bytes that it sends.
    pub bytes: f64,
}

/// A cell uniformly filled with particles, divided among ranks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HaloGeometry {
    /// Ranks per axis.
    pub grid: [usize; 3],
    /// Sides of the cell \[m\].
    pub sides: [f64; 3],
    /// Which axes are periodic.
    pub periodic: [bool; 3],
    /// How far a particle may lie outside a rank's box and still be its ghost: its radius, the largest
    /// radius and the skin \[m\].
    pub margin: f64,
    /// Particles over all ranks.
    pub particles: f64,
}

/// The columns of ranks along an axis that a box grown by the margin reaches: how much of each it covers
/// \[m\], the box's own column first.
type Reached = Vec<f64>;

impl HaloGeometry {
    /// Expected traffic of a rank, averaged over ranks:
    ///
    /// ghosts = ρ (Π w_k − Π b_k), messages = Σ (1 − exp(−ρ V_j)), bytes = ghosts × `bytes_per_ghost`
    ///
    /// with the number density ρ \[1/m³\], the box's sides b_k = L_k/g_k \[m\], the sides w_k ≤ L_k of what
    /// the grown box covers of the cell (a particle is one ghost, however many of its images it shows)
    /// and the volume V_j \[m³\] that it covers of the box of each other rank j, faces, edges, corners and
    /// boxes several hops away alike. A message is sent where it holds a particle; the exponential is the
    /// chance of none for places independent of each other, which matters for corners alone.
    #[must_use]
    pub fn expected(&self, bytes_per_ghost: f64) -> Traffic {
        let axes = [0, 1, 2].map(|axis| self.reached(axis));
        let density = self.particles / (self.sides[0] * self.sides[1] * self.sides[2]);
        let own: f64 = (0..3).map(|k| self.sides[k] / self.grid[k] as f64).product();
        let mut traffic = Traffic::default();
        let weight = 1.0 / axes.iter().map(|places| places.len() as f64).product::<f64>();
        for [x, y, z] in combinations(&axes) {
            let covered: f64 = [x, y, z].iter().map(|reached| reached.iter().sum::<f64>()).product();
            traffic.ghosts += weight * density * (covered - own);
            let lists = [x, y, z].map(Vec::as_slice);
            let all = combinations(&lists).map(|[a, b, c]| 1.0 - libm::exp(-density * a * b * c));
            // The first combination is the box itself.
            traffic.messages += weight * all.skip(1).sum::<f64>();
        }
        traffic.bytes = traffic.ghosts * bytes_per_ghost;
        traffic
    }

    /// What the boxes along an axis reach; one entry where all boxes are alike.
    fn reached(&self, axis: usize) -> Vec<Reached> {
        let boxes = self.grid[axis];
        let places = if self.periodic[axis] { 1 } else { boxes };
        (0..places).map(|own| self.reached_from(axis, own)).collect()
    }

    fn reached_from(&self, axis: usize, own: usize) -> Reached {
        let (boxes, side) = (self.grid[axis], self.sides[axis]);
        let width = side / boxes as f64;
        if boxes == 1 {
            return vec![side];
        }
        let (low, high) = (own as f64 * width - self.margin, (own + 1) as f64 * width + self.margin);
        let images = if self.periodic[axis] { (self.margin / side).ceil() as i64 + 1 } else { 0 };
        let others = (0..boxes).filter(|&column| column != own).filter_map(|column| {
            let start = column as f64 * width;
            let mut parts: Vec<(f64, f64)> = (-images..=images)
                .map(|image| start + image as f64 * side)
                .map(|start| ((low - start).max(0.0), (high - start).min(width)))
                .filter(|(from, to)| from < to)
                .collect();
            parts.sort_by(|a, b| a.0.total_cmp(&b.0));
            let (mut covered, mut end) = (0.0, 0.0);
            for (from, to) in parts {
                covered += (to - from.max(end)).max(0.0);
                end = to.max(end);
            }
            (covered > 0.0).then_some(covered)
        });
        std::iter::once(width).chain(others).collect()
    }

    /// Faces of a rank's box that are cut by other ranks \[m²\].
    fn cut_surface(&self) -> f64 {
        let width = [0, 1, 2].map(|k| self.sides[k] / self.grid[k] as f64);
        let faces = [width[1] * width[2], width[2] * width[0], width[0] * width[1]];
        (0..3).filter(|&k| self.grid[k] > 1).fold(0.0, |sum, k| sum + 2.0 * faces[k])
    }

    /// Share of a rank's particles that no other rank sees.
    fn inner_share(&self) -> f64 {
        let along = |k: usize| {
            let width = self.sides[k] / self.grid[k] as f64;
            if self.grid[k] == 1 { 1.0 } else { (1.0 - 2.0 * self.margin / width).max(0.0) }
        };
        along(0) * along(1) * along(2)
    }
}

/// All combinations of one entry per list, the first entries first.
fn combinations<'a, T>(lists: &'a [impl AsRef<[T]>; 3]) -> impl Iterator<Item = [&'a T; 3]>
where
    T: 'a,
{
    let [x, y, z] = lists;
    x.as_ref().iter().flat_map(move |a| y.as_ref().iter().flat_map(move |b| z.as_ref().iter().map(move |c| [a, b, c])))
}

/// A machine, as far as the model knows one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Machine {
    /// Time that a rank alone needs per particle and step \[s\].
    pub step_cost: f64,
    /// Share of it that goes into contacts.
    pub contact_share: f64,
    /// From one rank to another \[s\].
    pub latency: f64,
    /// A rank's share of the network \[B/s\].
    pub bandwidth: f64,
}

/// What a step costs a rank, part by part \[s\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepTime {
    /// The rank's share of the work that one rank alone would do.
    pub work: f64,
    /// Contacts across borders, which both sides evaluate.
    pub doubled: f64,
    /// Halo messages: latencies and transfer.
    pub halo: f64,
    /// The agreement of all ranks: two times log₂ P latencies.
    pub agreement: f64,
    /// Of the work, contacts that need no ghost: the halo can travel behind them.
    pub inner: f64,
}

impl StepTime {
    /// From the geometry, the traffic expected in it, the machine and the mean radius \[m\].
    ///
    /// A share R S/(2 V) of the contacts is evaluated twice: a contact of length 2R in a random direction
    /// crosses the cut faces S \[m²\] of a box V \[m³\] with that chance, counted half for each side.
    #[must_use]
    pub fn new(geometry: &HaloGeometry, traffic: &Traffic, machine: &Machine, radius: f64) -> Self {
        let ranks: f64 = geometry.grid.iter().product::<usize>() as f64;
        let work = geometry.particles / ranks * machine.step_cost;
        let volume = geometry.sides.iter().product::<f64>() / ranks;
        let contacts = machine.contact_share * work;
        Self {
            work,
            doubled: contacts * radius * geometry.cut_surface() / (2.0 * volume),
            halo: traffic.messages * machine.latency + traffic.bytes / machine.bandwidth,
            agreement: 2.0 * libm::log2(ranks) * machine.latency,
            inner: contacts * geometry.inner_share(),
        }
    }

    /// Work over time of a step, nothing hidden.
    #[must_use]
    pub fn efficiency(&self) -> f64 {
        self.work / (self.work + self.doubled + self.halo + self.agreement)
    }

    /// The same if the halo travels behind the inner contacts.
    #[must_use]
    pub fn efficiency_with_overlap(&self) -> f64 {
        let waiting = (self.halo - self.inner).max(0.0);
        self.work / (self.work + self.doubled + waiting + self.agreement)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Decomposition;
    use super::super::halo_map::HaloMap;
    use super::*;

    fn cube(grid: [usize; 3], margin: f64, particles: f64) -> HaloGeometry {
        HaloGeometry { grid, sides: [1.0; 3], periodic: [true; 3], margin, particles }
    }

    fn near(a: f64, b: f64, relative: f64) -> bool {
        (a - b).abs() <= relative * b.abs()
    }

    #[test]
    fn slabs_cubes_and_thin_slabs_have_the_halo_that_one_can_work_out_by_hand() {
        let slab = cube([4, 1, 1], 0.05, 1e6).expected(88.0);
        assert!(near(slab.ghosts, 1e5, 1e-12) && near(slab.messages, 2.0, 1e-12), "{slab:?}");
        assert!(near(slab.bytes, 88e5, 1e-12));
        let eight = cube([4, 4, 4], 0.05, 1e9).expected(88.0);
        assert!(near(eight.ghosts, 1e9 * (0.35_f64 * 0.35 * 0.35 - 1.0 / 64.0), 1e-12), "{eight:?}");
        assert!(near(eight.messages, 26.0, 1e-9), "{eight:?}");
        // Margin of two and a half slabs: three hops to each side.
        let thin = cube([20, 1, 1], 0.125, 1e6).expected(88.0);
        assert!(near(thin.ghosts, 2.5e5, 1e-9) && near(thin.messages, 6.0, 1e-9), "{thin:?}");
        // The grown box covers the whole cell: every particle is a ghost once.
        let all = cube([3, 1, 1], 0.9, 900.0).expected(88.0);
        assert!(near(all.ghosts, 600.0, 1e-9) && near(all.messages, 2.0, 1e-9), "{all:?}");
        assert_eq!(cube([1, 1, 1], 0.2, 1e6).expected(88.0), Traffic::default());
    }

    #[test]
    fn walls_cost_the_outer_ranks_half_of_their_halo() {
        let open = HaloGeometry { periodic: [false, true, true], ..cube([4, 1, 1], 0.05, 1e6) }.expected(88.0);
        assert!(near(open.ghosts, 75_000.0, 1e-9) && near(open.messages, 1.5, 1e-9), "{open:?}");
    }

    /// Counts with the map that the halo itself is built from.
    fn counted(geometry: &HaloGeometry, points: usize) -> Traffic {
        let grid = Decomposition { grid: geometry.grid };
        let reach = geometry.margin / 2.0;
        let maps: Vec<HaloMap> =
            (0..grid.ranks()).map(|rank| HaloMap::new(&grid, rank, geometry.sides, geometry.periodic, reach)).collect();
        let mut used = vec![std::collections::BTreeSet::new(); grid.ranks()];
        let mut ghosts = 0;
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        for _ in 0..points {
            let position = geometry.sides.map(|side| side * uniform());
            let owner = grid.owner(position, geometry.sides);
            maps[owner].for_each_needing(position, 2.0 * reach, |partner| {
                ghosts += 1;
                used[owner].insert(partner);
            });
        }
        let ranks = grid.ranks() as f64;
        let messages = used.iter().map(|partners| partners.len() as f64).sum::<f64>() / ranks;
        Traffic { ghosts: f64::from(ghosts) / ranks, messages, bytes: 0.0 }
    }

    #[test]
    fn the_model_agrees_with_the_map_of_the_halo_on_random_points() {
        for (grid, periodic, margin) in [
            ([2, 1, 1], [true; 3], 0.1),
            ([2, 2, 2], [true; 3], 0.07),
            ([4, 3, 2], [true, false, true], 0.06),
            ([8, 2, 1], [true, true, false], 0.3),
            ([12, 1, 1], [false; 3], 0.2),
            ([5, 4, 3], [true; 3], 0.02),
        ] {
            let geometry = HaloGeometry { grid, sides: [1.0, 0.7, 1.3], periodic, margin, particles: 40_000.0 };
            let (expected, found) = (geometry.expected(88.0), counted(&geometry, 40_000));
            assert!(near(found.ghosts, expected.ghosts, 0.03), "{grid:?}: {found:?}, model {expected:?}");
            assert!(near(found.messages, expected.messages, 0.03), "{grid:?}: {found:?}, model {expected:?}");
        }
    }

    #[test]
    fn efficiency_falls_with_ranks_and_is_better_with_overlap() {
        let machine = Machine { step_cost: 1e-7, contact_share: 0.6, latency: 2e-6, bandwidth: 1e10 };
        let at = |n: usize| {
            let geometry = cube([n; 3], 0.0022, 1e9);
            StepTime::new(&geometry, &geometry.expected(88.0), &machine, 0.001)
        };
        let times = [1, 10, 22, 46].map(at);
        assert_eq!(times[0].efficiency(), 1.0);
        for pair in times.windows(2) {
            assert!(pair[1].efficiency() < pair[0].efficiency());
            assert!(pair[1].efficiency_with_overlap() > pair[1].efficiency());
        }
        // Cubes of side b: 3R/b of the contacts is evaluated twice.
        assert!(near(times[1].doubled, 0.6 * times[1].work * 3.0 * 0.001 / 0.1, 1e-9));
    }
}
