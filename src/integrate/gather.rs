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
    /// Numbers per line that hold force and torques: 4, 6 or 12.
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
    /// \[N m\], the fourth number of each without meaning. First those of which the particle is the second, whose
    /// forces are subtracted, then the others; the partners' ids rise in each and from the first to the second.
    #[inline(always)]
    pub fn sum_all<L: Lane>(&mut self, chunk: &ChunkEnds, loads: &mut [[f64; 8]; CHUNK]) {
        const { assert!(LEDGER_STRIDE == 8) };
        match self.stride {
            4 => self.fetch::<4>(),
            6 => self.fetch::<6>(),
            12 => self.fetch::<12>(),
            14 => self.fetch::<14>(),
            _ => self.fetch::<20>(),
        }
        match self.width {
            4 => self.sums::<L, 4>(chunk, loads),
            6 => self.sums::<L, 6>(chunk, loads),
            _ => self.sums::<L, 12>(chunk, loads),
        }
    }

    #[inline(always)]
    fn sums<L: Lane, const WIDTH: usize>(&self, chunk: &ChunkEnds, loads: &mut [[f64; 8]; CHUNK]) {
        let numbers = &self.buffer[..chunk.room()];
        sum_side::<L, WIDTH, true>(chunk, numbers, loads);
        sum_side::<L, WIDTH, false>(chunk, numbers, loads);
    }

    /// Copy the kept lines behind the ring.
    #[inline(always)]
    fn fetch<const STRIDE: usize>(&mut self) {
        let lines = self.buffer.as_chunks_mut::<STRIDE>().0;
        let kept = self.kept.as_chunks::<STRIDE>().0;
        for (slot, line) in lines[self.ring..].iter_mut().zip(self.reads) {
            *slot = kept[*line as usize];
        }
    }

    /// Add what the contacts of which this particle has the lower id put into its ledger; after the sums.
    #[inline(always)]
    pub fn add_ledger(&self, ends: &[End], ledger: &mut [f64]) {
        for end in ends.iter().filter(|end| !end.is_second()) {
            let entries = &self.buffer[end.place::<false>() + self.width..][..CONTACT_LEDGER.len()];
            for (value, to) in entries.iter().zip(CONTACT_LEDGER) {
                ledger[to] += value;
            }
        }
    }
}

/// Sums over the ends of one side of all particles of a chunk: of seconds from zero on, of firsts on what is there.
#[inline(always)]
fn sum_side<L: Lane, const WIDTH: usize, const SECOND: bool>(
    chunk: &ChunkEnds,
    numbers: &[f64],
    loads: &mut [[f64; 8]; CHUNK],
) {
    for (count, group) in chunk.visits(SECOND).groups().enumerate() {
        // The numbers are written out, so that the loop over the few ends of most particles is.
        match count {
            0 => sum_group::<L, WIDTH, SECOND, 0>(chunk, group, numbers, loads),
            1 => sum_group::<L, WIDTH, SECOND, 1>(chunk, group, numbers, loads),
            2 => sum_group::<L, WIDTH, SECOND, 2>(chunk, group, numbers, loads),
            3 => sum_group::<L, WIDTH, SECOND, 3>(chunk, group, numbers, loads),
            4 => sum_group::<L, WIDTH, SECOND, 4>(chunk, group, numbers, loads),
            5 => sum_group::<L, WIDTH, SECOND, 5>(chunk, group, numbers, loads),
            6 => sum_group::<L, WIDTH, SECOND, 6>(chunk, group, numbers, loads),
            7 => sum_group::<L, WIDTH, SECOND, 7>(chunk, group, numbers, loads),
            8 => sum_group::<L, WIDTH, SECOND, 8>(chunk, group, numbers, loads),
            _ => {
                for place in group {
                    let load = &mut loads[usize::from(*place) % CHUNK];
                    let ends = chunk.of_side(usize::from(*place), SECOND);
                    // SAFETY: no line of an end reaches beyond the chunk's room, which `numbers` is.
                    unsafe { sum::<L, WIDTH, SECOND>(ends, numbers, load) };
                }
            }
        }
    }
}

/// Sums over the ends of one side of particles that have `COUNT` of them.
#[inline(always)]
fn sum_group<L: Lane, const WIDTH: usize, const SECOND: bool, const COUNT: usize>(
    chunk: &ChunkEnds,
    group: &[u8],
    numbers: &[f64],
    loads: &mut [[f64; 8]; CHUNK],
) {
    if COUNT == 0 && !SECOND {
        return;
    }
    for place in group {
        let place = usize::from(*place);
        // SAFETY: the place is one of this group's; no line of an end reaches beyond the chunk's room, which `numbers` is.
        unsafe {
            let ends = chunk.written_out::<SECOND, COUNT>(place);
            sum::<L, WIDTH, SECOND>(ends, numbers, &mut loads[place % CHUNK]);
        }
    }
}

/// Sum over the ends of one side of one particle.
///
/// # Safety
/// `numbers` holds the lines of the ends.
#[inline(always)]
unsafe fn sum<L: Lane, const WIDTH: usize, const SECOND: bool>(ends: &[End], numbers: &[f64], load: &mut [f64; 8]) {
    // Of lines of six the last four are read, so that the torque lies in the last three lanes.
    let first_torque = if WIDTH == 6 { 3 } else { 4 };
    let from = match (WIDTH, SECOND) {
        (6, _) => 2,
        (12, true) => 8,
        _ => 4,
    };
    let (mut force, mut torque) =
        if SECOND { (L::splat(0.0), L::splat(0.0)) } else { (L::load(&load[..4]), L::load(&load[first_torque..])) };
    for end in ends {
        let line = end.place::<SECOND>();
        // SAFETY: as the function's; all that is read lies within the line's `WIDTH` numbers.
        let four = |start: usize| unsafe { L::load(numbers.get_unchecked(line + start..line + start + 4)) };
        force = if SECOND { force - four(0) } else { force + four(0) };
        if WIDTH > 4 {
            torque = torque + four(from);
        }
    }
    force.store(&mut load[..4]);
    torque.store(&mut load[first_torque..]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::list::ContactList;
    use crate::contact::section::{PARTNERS, Partners};
    use crate::contact::shift;
    use crate::force::lane::portable::Portable;
    use crate::state::particles::Particles;

    /// Particles in one strip with none to 43 contacts on either side, near ones and across a face.
    fn list(particles: &Particles) -> ContactList {
        let mut list = ContactList::default();
        list.cut(std::iter::once(0..particles.owned).collect(), 1, &[1]);
        for (partners, step) in [(Partners::Near, 3), (Partners::Apart, 7)] {
            let kind = PARTNERS.iter().position(|kind| *kind == partners).expect("a kind of partners");
            let stars = [(40, 3), (41, 40), (150, 12), (199, 1)].into_iter();
            let mut pairs: Vec<(u32, u32)> = stars
                .flat_map(|(centre, count)| (0..count).map(move |k| (centre, (centre + step * (k + 1)) % 200)))
                .chain((0..200).step_by(5).flat_map(|p| (1..p / 20).map(move |k| (p, (p + step + k) % 200))))
                .map(
                    |(a, b)| {
                        if particles.id[a] < particles.id[b] { (a as u32, b as u32) } else { (b as u32, a as u32) }
                    },
                )
                .collect();
            pairs.sort_by_key(|(a, b)| *a.min(b));
            let section = &mut list.sections[kind];
            section.resize(pairs.len());
            for (place, (a, b)) in pairs.into_iter().enumerate() {
                section.set(place, a, b, shift::encode([0; 3]));
            }
        }
        list
    }

    fn compare<const WIDTH: usize, const STRIDE: usize>() {
        let mut particles = Particles { owned: 200, ..Particles::default() };
        particles.id.extend((0..200).map(|p| p * 101 % 211));
        particles.record.resize(200, bytemuck::Zeroable::zeroed());
        let mut list = list(&particles);
        list.index(&particles, 211, STRIDE);
        let value = |line: usize, number: usize| ((line * 37 + number * 101) % 1009) as f64 / 7.0 - 71.0;
        let mut most = 0;
        for (chunk, start) in (0..particles.owned).step_by(CHUNK).enumerate() {
            // A ring with room for all lines, so that none has been overwritten.
            let strip = &list.strips[0];
            let mut buffer = vec![0.0; strip.room()];
            let reached = list.runs.get(strip.near.start + chunk + 1).map_or(list.lines, |run| run.line as usize);
            for line in reached.saturating_sub(strip.ring).max(list.kept)..reached {
                for number in 0..STRIDE {
                    buffer[(line & (strip.ring - 1)) * STRIDE + number] = value(line, number);
                }
            }
            let kept: Vec<f64> = (0..list.kept * STRIDE).map(|k| value(k / STRIDE, k % STRIDE)).collect();
            let (ring, reads) = (strip.ring, strip.kept_reads_of(chunk).to_vec());
            let (buffer, kept, reads) = (&mut buffer[..], &kept[..], &reads[..]);
            let mut lines = Lines { width: WIDTH, stride: STRIDE, buffer, ring, kept, reads };
            let mut loads = [[0.0; 8]; CHUNK];
            lines.sum_all::<Portable<4>>(&list.parts().0.ends_of(0, chunk), &mut loads);
            for (particle, load) in (start..particles.owned).zip(&loads) {
                let mut expected = [0.0; 6];
                for (line, second) in list.lines_of(particle) {
                    for axis in 0..3 {
                        let force = value(line, axis);
                        expected[axis] += if second { -force } else { force };
                        expected[3 + axis] += match WIDTH {
                            4 => 0.0,
                            6 => value(line, 3 + axis),
                            _ => value(line, if second { 8 } else { 4 } + axis),
                        };
                    }
                }
                most = most.max(list.lines_of(particle).count());
                let got = [load[0], load[1], load[2], load[4], load[5], load[6]];
                assert_eq!(got, expected, "width {WIDTH}, stride {STRIDE}, particle {particle}");
            }
        }
        assert!(most > 40, "{most}");
    }

    #[test]
    fn sums_are_those_over_the_lines_in_order() {
        compare::<4, 4>();
        compare::<6, 6>();
        compare::<12, 12>();
        compare::<4, 12>();
        compare::<6, 14>();
        compare::<12, 20>();
    }
}
