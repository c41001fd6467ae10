//! Sum of the contact forces and torques on a particle, in order of (partner id, image shift), so
//! that every rank and thread count gives the same bits.

use crate::contact::ends::{ChunkEnds, End};
use crate::contact::list::CHUNK;
use crate::force::lane::Lane;
use crate::force::observe::CONTACT_LEDGER;
use crate::force::pass::LEDGER_STRIDE;

/// Output lines of the contact passes as the particles of one chunk see them.
#[derive(Debug)]
pub struct Lines<'a> {
    /// Numbers per line that hold force and torques: 4, 8 or 12.
    pub width: usize,
    /// Numbers per line, with the ledger's.
    pub stride: usize,
    /// The strip's buffer: its ring, then room for the kept lines that the sums read.
    pub buffer: &'a mut [f64],
    /// Slots of the ring.
    pub ring: usize,
    /// Lines kept for the step, from number 0 on.
    pub kept: &'a [f64],
    /// Those of them that the sums read, in the order of their slots.
    pub reads: &'a [u32],
}

impl Lines<'_> {
    /// Sums over the contacts of consecutive particles, in lanes four wide: force \[N\], torque about the centre
    /// \[N m\], the fourth number of each without meaning.
    #[inline(always)]
    pub fn sum_all<L: Lane>(&mut self, chunk: &ChunkEnds, loads: &mut [[f64; 8]; CHUNK]) {
        match (self.width, self.stride) {
            (4, 4) => self.sums::<L, 4, 4>(chunk, loads),
            (8, 8) => self.sums::<L, 8, 8>(chunk, loads),
            (12, 12) => self.sums::<L, 12, 12>(chunk, loads),
            (4, _) => self.sums::<L, 4, { 4 + LEDGER_STRIDE }>(chunk, loads),
            (8, _) => self.sums::<L, 8, { 8 + LEDGER_STRIDE }>(chunk, loads),
            _ => self.sums::<L, 12, { 12 + LEDGER_STRIDE }>(chunk, loads),
        }
    }

    #[inline(always)]
    fn sums<L: Lane, const WIDTH: usize, const STRIDE: usize>(
        &mut self,
        chunk: &ChunkEnds,
        loads: &mut [[f64; 8]; CHUNK],
    ) {
        let lines = self.buffer.as_chunks_mut::<STRIDE>().0;
        let kept = self.kept.as_chunks::<STRIDE>().0;
        for (slot, line) in lines[self.ring..].iter_mut().zip(self.reads) {
            *slot = kept[*line as usize];
        }
        let numbers = lines[..chunk.slots()].as_flattened();
        // From memory, not known to the compiler: its way of making signs of bits is longer.
        let signs = std::hint::black_box([1.0, 0.0, 0.0, 0.0, -1.0]);
        for (place, ends) in chunk.in_order() {
            // SAFETY: every end names a slot of the chunk's, and `numbers` holds them all.
            loads[place % CHUNK] = unsafe { sum::<L, WIDTH, STRIDE>(ends, &signs, numbers) };
        }
    }

    /// Add what the contacts of which this particle has the lower id put into its ledger; after the sums.
    #[inline(always)]
    pub fn add_ledger(&self, ends: &[End], ledger: &mut [f64]) {
        // Contact entries: cell, driven, damping, viscous, friction, plastic; the particle's ledger has
        // the work of body forces between the first two.
        const TO: [usize; CONTACT_LEDGER] = [0, 2, 3, 4, 5, 6];
        for end in ends.iter().filter(|end| !end.is_second()) {
            let entries = &self.buffer[end.number() * self.stride + self.width..][..CONTACT_LEDGER];
            for (value, to) in entries.iter().zip(TO) {
                ledger[to] += value;
            }
        }
    }
}

/// Sum over the contacts of one particle.
///
/// # Safety
/// `numbers` holds `STRIDE` numbers for every slot up to those that the ends name.
#[inline(always)]
unsafe fn sum<L: Lane, const WIDTH: usize, const STRIDE: usize>(
    ends: &[End],
    signs: &[f64; 5],
    numbers: &[f64],
) -> [f64; 8] {
    // SAFETY: as the function's.
    let few = |ends: &[End]| unsafe { sum_few::<L, WIDTH, STRIDE>(ends, signs, numbers) };
    // The numbers are written out, so that the loop over the few ends of most particles is.
    let [force, torque] = match ends.len() {
        3 => few(&ends[..3]),
        4 => few(&ends[..4]),
        5 => few(&ends[..5]),
        6 => few(&ends[..6]),
        7 => few(&ends[..7]),
        8 => few(&ends[..8]),
        9 => few(&ends[..9]),
        _ => few(ends),
    };
    let mut load = [0.0; 8];
    force.store(&mut load[..4]);
    torque.store(&mut load[4..]);
    load
}

/// See [`sum`].
///
/// # Safety
/// As [`sum`].
#[inline(always)]
unsafe fn sum_few<L: Lane, const WIDTH: usize, const STRIDE: usize>(
    ends: &[End],
    signs: &[f64; 5],
    numbers: &[f64],
) -> [L; 2] {
    const { assert!(WIDTH <= STRIDE) };
    let (mut force, mut torque) = (L::splat(0.0), L::splat(0.0));
    for end in ends {
        let line = end.number() * STRIDE;
        // SAFETY: as the function's; all that is read lies within the line's `WIDTH` numbers.
        let four = |start: usize| unsafe { L::load(numbers.get_unchecked(line + start..line + start + 4)) };
        force = force + L::splat(signs[end.side()]) * four(0);
        if WIDTH == 8 {
            torque = torque + four(4);
        }
        if WIDTH == 12 {
            torque = torque + four(4 + end.side());
        }
    }
    [force, torque]
}
