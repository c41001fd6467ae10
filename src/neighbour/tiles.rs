//! The order of particles in memory: neighbours in space near each other, and what a step has under way in the cache.

use super::cells::Bins;
use crate::state::particles::Record;
use std::ops::Range;

/// Most particles in a layer of a tile, as thick as listed pairs reach. A sweep through a tile has the records of about
/// two layers under way and the output lines of one; beyond this they leave the second cache, and a tile more costs
/// less (docs/performance.md).
const LAYER_LIMIT: f64 = 4000.0;

/// Order particles in place and cut them into runs, at least `parts`.
///
/// Each run is a tile of space with an equal share of the particles, which lie in layers across its longest side. Where
/// layers are too large for the cache there are more tiles, a multiple of `parts`. `reach`: how far the centres of
/// listed pairs can be apart \[m\]. Empty runs are left out.
pub fn arrange(records: &[Record], members: &mut [u32], parts: usize, reach: f64) -> Vec<Range<usize>> {
    let tiles = (Extent::of(records, members).layer(members.len(), reach) / LAYER_LIMIT).ceil().max(1.0) as usize;
    let mut end = 0;
    divide(records, members, tiles.next_multiple_of(parts), reach)
        .into_iter()
        .filter(|count| *count > 0)
        .map(|count| {
            end += count;
            end - count..end
        })
        .collect()
}

/// Numbers of particles in the tiles.
fn divide(records: &[Record], members: &mut [u32], tiles: usize, reach: f64) -> Vec<usize> {
    let extent = Extent::of(records, members);
    if tiles == 1 {
        extent.sort(records, members, reach);
        return vec![members.len()];
    }
    let [_, middle, slow] = extent.axes;
    // Across the longest side the surface is least, but layers become smaller along another one only.
    let axis = if extent.layer(members.len(), reach) > LAYER_LIMIT { middle } else { slow };
    let cut = members.len() * (tiles / 2) / tiles;
    if cut > 0 {
        let along = |member: u32| records[member as usize].position[axis];
        members.select_nth_unstable_by(cut, |a, b| along(*a).total_cmp(&along(*b)).then(a.cmp(b)));
    }
    let (below, above) = members.split_at_mut(cut);
    let (mut counts, more) =
        rayon::join(|| divide(records, below, tiles / 2, reach), || divide(records, above, tiles - tiles / 2, reach));
    counts.extend(more);
    counts
}

/// The box around some particles.
struct Extent {
    low: [f64; 3],
    high: [f64; 3],
    /// By length of the sides, the shortest first.
    axes: [usize; 3],
}

impl Extent {
    fn of(records: &[Record], members: &[u32]) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for member in members {
            for (k, x) in records[*member as usize].position.into_iter().enumerate() {
                low[k] = if x < low[k] { x } else { low[k] };
                high[k] = if x > high[k] { x } else { high[k] };
            }
        }
        let mut axes = [0, 1, 2];
        axes.sort_by(|a, b| (high[*a] - low[*a]).total_cmp(&(high[*b] - low[*b])));
        Self { low, high, axes }
    }

    /// How many of `count` particles are in a layer of this thickness across the longest side, on average.
    fn layer(&self, count: usize, thickness: f64) -> f64 {
        let [.., slow] = self.axes;
        let share = thickness / (self.high[slow] - self.low[slow]);
        count as f64 * if share < 1.0 { share } else { 1.0 }
    }

    /// Sort particles by cells, the longest side last.
    fn sort(&self, records: &[Record], members: &mut [u32], cell: f64) {
        if members.is_empty() {
            return;
        }
        let turned = |p: [f64; 3]| self.axes.map(|axis| p[axis]);
        let points: Vec<[f64; 3]> = members.iter().map(|member| turned(records[*member as usize].position)).collect();
        let bins = Bins::new(turned(self.low), turned(self.high), cell, &points);
        let sorted: Vec<u32> = bins.order().iter().map(|place| members[*place as usize]).collect();
        members.copy_from_slice(&sorted);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    /// Spheres of diameter 1 on a lattice of this many sites per axis, in a mixed order.
    fn lattice(sites: [usize; 3]) -> Vec<Record> {
        let count = sites.iter().product::<usize>();
        (0..count)
            .map(|index| {
                let site = index * 7919 % count;
                let place = [site % sites[0], site / sites[0] % sites[1], site / sites[0] / sites[1]];
                Record { position: place.map(|k| k as f64), radius: 0.5, ..Record::zeroed() }
            })
            .collect()
    }

    /// Runs and order of a lattice, checked to hold each particle once.
    fn arranged(sites: [usize; 3], parts: usize) -> (Vec<Record>, Vec<Range<usize>>) {
        let records = lattice(sites);
        let mut members: Vec<u32> = (0..records.len() as u32).collect();
        let runs = arrange(&records, &mut members, parts, 1.0);
        let mut seen = members.clone();
        seen.sort_unstable();
        assert!(seen.into_iter().eq(0..records.len() as u32));
        assert_eq!(runs.first().map(|run| run.start), Some(0));
        assert!(runs.windows(2).all(|pair| pair[0].end == pair[1].start));
        assert_eq!(runs.last().map(|run| run.end), Some(records.len()));
        (members.iter().map(|member| records[*member as usize]).collect(), runs)
    }

    #[test]
    fn a_sweep_goes_along_the_longest_side() {
        for axis in 0..3 {
            let mut sites = [10; 3];
            sites[axis] = 40;
            let (records, runs) = arranged(sites, 1);
            assert_eq!(runs, std::slice::from_ref(&(0..4000)));
            // Layers are as thick as the reach or a little more.
            assert!(records.windows(2).all(|pair| pair[0].position[axis] <= pair[1].position[axis] + 1.0));
        }
    }

    #[test]
    fn parts_are_compact_and_of_equal_size() {
        let (records, runs) = arranged([40, 10, 10], 4);
        assert_eq!(runs, [0..1000, 1000..2000, 2000..3000, 3000..4000]);
        for (number, run) in runs.into_iter().enumerate() {
            let low = (10 * number) as f64;
            assert!(records[run].iter().all(|record| (low..low + 10.0).contains(&record.position[0])));
        }
    }

    #[test]
    fn large_layers_are_cut_across() {
        let (records, runs) = arranged([120, 100, 80], 2);
        // 8000 and some in a layer: more than two tiles of 4000, the next multiple of two.
        assert_eq!(runs.len(), 4);
        let members: Vec<u32> = (0..records.len() as u32).collect();
        for run in runs {
            let extent = Extent::of(&records, &members[run.clone()]);
            assert!(extent.layer(run.len(), 1.0) <= LAYER_LIMIT);
            assert_eq!(extent.high[0] - extent.low[0], 119.0);
        }
    }

    #[test]
    fn more_parts_than_particles_and_no_particles_leave_no_empty_runs() {
        assert_eq!(arranged([3, 1, 1], 8).1, [0..1, 1..2, 2..3]);
        assert!(arrange(&[], &mut [], 2, 1.0).is_empty());
    }
}
