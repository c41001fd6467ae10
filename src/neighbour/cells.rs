//! Linked cells: points of a box sorted into bins for look-ups of near ones.

/// Points sorted by bin; bin `b` holds `order[starts[b]..starts[b+1]]`.
#[derive(Debug)]
pub struct Bins {
    counts: [usize; 3],
    low: [f64; 3],
    inverse_size: [f64; 3],
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl Bins {
    /// Sort points into bins of at least `size` over the box from `low` to `high`; points outside go
    /// to the nearest bin.
    #[must_use]
    pub fn new(low: [f64; 3], high: [f64; 3], size: f64, points: &[[f64; 3]]) -> Self {
        let mut counts = [0, 1, 2].map(|k| (((high[k] - low[k]) / size) as usize).max(1));
        // A sparse system must not get more bins than it can fill.
        while counts.iter().product::<usize>() > 4 * points.len() + 64 {
            counts = counts.map(|n| n.div_ceil(2));
        }
        let inverse_size = [0, 1, 2].map(|k| counts[k] as f64 / (high[k] - low[k]));
        let mut bins = Self { counts, low, inverse_size, starts: Vec::new(), order: Vec::new() };
        let total = counts.iter().product::<usize>();
        let of_point: Vec<u32> = points.iter().map(|p| bins.bin_of(*p) as u32).collect();
        let mut starts = vec![0_u32; total + 1];
        for bin in &of_point {
            starts[*bin as usize + 1] += 1;
        }
        for bin in 0..total {
            starts[bin + 1] += starts[bin];
        }
        let mut next = starts.clone();
        bins.order = vec![0; points.len()];
        for (point, bin) in of_point.iter().enumerate() {
            let place = &mut next[*bin as usize];
            bins.order[*place as usize] = point as u32;
            *place += 1;
        }
        bins.starts = starts;
        bins
    }

    fn coordinates(&self, point: [f64; 3]) -> [usize; 3] {
        [0, 1, 2].map(|k| {
            let place = (point[k] - self.low[k]) * self.inverse_size[k];
            (place.max(0.0) as usize).min(self.counts[k] - 1)
        })
    }

    fn bin_of(&self, point: [f64; 3]) -> usize {
        let [x, y, z] = self.coordinates(point);
        (z * self.counts[1] + y) * self.counts[0] + x
    }

    /// The points in order of their bins.
    #[must_use]
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Call `visit` for every point in the bin of `centre` and the bins around it.
    #[inline]
    pub fn for_each_near(&self, centre: [f64; 3], mut visit: impl FnMut(usize)) {
        let here = self.coordinates(centre);
        let [xs, ys, zs] = [0, 1, 2].map(|k| (here[k].saturating_sub(1), (here[k] + 1).min(self.counts[k] - 1)));
        for z in zs.0..=zs.1 {
            for y in ys.0..=ys.1 {
                let row = (z * self.counts[1] + y) * self.counts[0];
                let range = self.starts[row + xs.0] as usize..self.starts[row + xs.1 + 1] as usize;
                for place in range {
                    visit(self.order[place] as usize);
                }
            }
        }
    }
}
