//! Sum of the contact forces and torques on a particle, in order of (partner id, image shift), so
//! that every rank and thread count gives the same bits.

use crate::contact::list::End;
use crate::force::lane::Lane;
use crate::force::observe::CONTACT_LEDGER;
use crate::force::pass::LEDGER_STRIDE;

/// Output lines of the contact passes as the particles of one strip see them.
#[derive(Debug, Clone, Copy)]
pub struct Lines<'a> {
    /// Numbers per line that hold forces, torques and moments: 4, 8, 12, or 16 between ellipsoids.
    pub width: usize,
    /// Numbers per line, with the ledger's.
    pub stride: usize,
    /// Lines kept for the step, from number 0 on.
    pub kept: &'a [f64],
    /// The strip's ring: line `n` at place `n mod capacity`.
    pub ring: &'a [f64],
    /// Capacity of the ring less one.
    pub mask: usize,
}

/// The ends of the particles of one chunk.
#[derive(Debug, Clone, Copy)]
pub struct ChunkEnds<'a> {
    /// `ends[offsets[p]..offsets[p + 1]]` are those of the chunk's particle `p`.
    pub offsets: &'a [u32],
    /// Ends of the contact list.
    pub ends: &'a [End],
    /// The chunk's part of the list's order of summing.
    pub summing: &'a [u8],
    /// How many particles, the first ones in this order, have lines in the ring only.
    pub near_only: usize,
}

impl ChunkEnds<'_> {
    /// The ends of one particle.
    #[inline(always)]
    #[must_use]
    pub fn of(&self, place: u8) -> &[End] {
        let place = usize::from(place);
        &self.ends[self.offsets[place] as usize..self.offsets[place + 1] as usize]
    }
}

impl Lines<'_> {
    /// Numbers `offset .. offset + N` of a line.
    #[inline(always)]
    fn part<const N: usize>(&self, number: usize, offset: usize) -> &[f64; N] {
        let kept = number * self.stride < self.kept.len();
        let place = if kept { number } else { number & self.mask };
        let values = if kept { self.kept } else { self.ring };
        let start = place * self.stride + offset;
        values[start..start + N].try_into().expect("a slice of N numbers")
    }

    /// Sums over the contacts of consecutive particles, in lanes four wide: force \[N\], torque about the centre
    /// \[N m\], the fourth number of each without meaning.
    #[inline(always)]
    pub fn sum_all<L: Lane>(&self, chunk: &ChunkEnds, loads: &mut [[f64; 8]]) {
        match (self.width, self.stride) {
            (4, 4) => self.sums::<L, 4, 4>(chunk, loads),
            (8, 8) => self.sums::<L, 8, 8>(chunk, loads),
            (12, 12) => self.sums::<L, 12, 12>(chunk, loads),
            (16, 16) => self.sums::<L, 16, 16>(chunk, loads),
            (4, _) => self.sums::<L, 4, { 4 + LEDGER_STRIDE }>(chunk, loads),
            (8, _) => self.sums::<L, 8, { 8 + LEDGER_STRIDE }>(chunk, loads),
            (12, _) => self.sums::<L, 12, { 12 + LEDGER_STRIDE }>(chunk, loads),
            _ => self.sums::<L, 16, { 16 + LEDGER_STRIDE }>(chunk, loads),
        }
    }

    #[inline(always)]
    fn sums<L: Lane, const WIDTH: usize, const STRIDE: usize>(&self, chunk: &ChunkEnds, loads: &mut [[f64; 8]]) {
        let [ring, kept] = [self.ring, self.kept].map(|values| values.as_chunks::<STRIDE>().0);
        // From memory, not known to the compiler: its way of making signs of bits is longer.
        let signs = std::hint::black_box([1.0, -1.0]);
        let (near_only, others) = chunk.summing.split_at(chunk.near_only);
        for place in near_only {
            let line = |line: usize| &ring[line & self.mask];
            loads[usize::from(*place)] = sum::<L, WIDTH, STRIDE>(chunk.of(*place), &signs, line);
        }
        // By table, not by branch: which of the two comes next is anybody's guess.
        let (lines, masks) = ([ring, kept], [self.mask, usize::MAX]);
        for place in others {
            loads[usize::from(*place)] = sum::<L, WIDTH, STRIDE>(chunk.of(*place), &signs, |line| {
                let table = usize::from(line < kept.len());
                &lines[table][line & masks[table]]
            });
        }
    }

    /// Add what the contacts of which this particle has the lower id put into its ledger.
    #[inline(always)]
    pub fn add_ledger(&self, ends: &[End], ledger: &mut [f64]) {
        // Contact entries: cell, driven, damping, viscous, friction, plastic; the particle's ledger has
        // the work of body forces between the first two.
        const TO: [usize; CONTACT_LEDGER] = [0, 2, 3, 4, 5, 6];
        for end in ends.iter().filter(|end| !end.is_second()) {
            let entries = self.part::<CONTACT_LEDGER>(end.line(), self.width);
            for (value, to) in entries.iter().zip(TO) {
                ledger[to] += value;
            }
        }
    }
}

/// Sum over the contacts of one particle.
#[inline(always)]
fn sum<'a, L: Lane, const WIDTH: usize, const STRIDE: usize>(
    ends: &[End],
    signs: &[f64; 2],
    line_of: impl Fn(usize) -> &'a [f64; STRIDE],
) -> [f64; 8] {
    let (mut force, mut torque) = (L::splat(0.0), L::splat(0.0));
    for end in ends {
        let line = line_of(end.line());
        let second = usize::from(end.is_second());
        let sign = L::splat(signs[second]);
        force = force + sign * L::load(&line[..4]);
        if WIDTH == 16 {
            torque = torque + L::load(&line[4 + 4 * second..][..4]);
            continue;
        }
        if WIDTH >= 8 {
            torque = torque + L::splat(line[3 + 4 * second]) * L::load(&line[4..8]);
        }
        if WIDTH >= 12 {
            torque = torque + sign * L::load(&line[8..12]);
        }
    }
    let mut load = [0.0; 8];
    force.store(&mut load[..4]);
    torque.store(&mut load[4..]);
    load
}
