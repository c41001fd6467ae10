//! The list of contacts that touch or nearly do, and for every particle its contacts in the order of
//! summation.
//!
//! The owned particles of a rank are cut into strips: runs of consecutive local indices, tiles of space
//! ([`crate::neighbour::tiles`]), at least one per thread. A contact belongs to the strip of its owner: the particle with
//! the lower local index, or either of them if they are in different strips. Within a strip the step goes chunk by chunk:
//! contacts owned by the chunk's particles, then sum and motion of these particles, whose contacts are then complete. So
//! the output lines of contacts within the strip are needed for a short while only and live in a ring buffer; those of
//! all other contacts are kept for the step, and copied behind the ring for the chunk whose sums read them, which so
//! find every line in one buffer.

use super::ends::{End, Reading, Visits};
use super::section::{BLOCK, PARTNERS, Partners, Section};
use super::shift;
use crate::state::ContactKey;
use crate::state::particles::Particles;
use rayon::prelude::*;
use std::ops::Range;

/// Particles per chunk.
pub const CHUNK: usize = 128;

/// Some blocks of a section, evaluated in one go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Run {
    /// Number of the section.
    pub section: u32,
    /// First block.
    pub block: u32,
    /// Number of blocks.
    pub blocks: u32,
    /// Number of the first block's first output line.
    pub line: u32,
}

/// Owned particles that one thread moves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Strip {
    /// Local indices.
    pub particles: Range<usize>,
    /// Runs of the near contacts: for each chunk one per pair of materials.
    pub near: Range<usize>,
    /// Kept lines of this strip.
    pub kept: Range<usize>,
    /// Number of the first near line.
    pub first_line: usize,
    /// Lines that the ring must hold, a power of two.
    pub ring: usize,
    /// See [`Strip::room`]; no line of an end of the strip's particles reaches beyond.
    room: usize,
    /// Kept lines that the particles' sums read, chunk by chunk.
    pub kept_reads: Vec<u32>,
    /// For each chunk the end of its part of `kept_reads`.
    pub kept_read_ends: Vec<u32>,
    /// For each chunk the order in which its particles are summed up, over the ends of firsts and of seconds.
    pub(super) visits: Vec<[Visits; 2]>,
}

impl Strip {
    /// Chunks.
    #[must_use]
    pub fn chunks(&self) -> usize {
        self.particles.len().div_ceil(CHUNK)
    }

    /// Numbers in the buffer: the ring's lines, then one per kept line that the sums of a chunk read, as many as the chunk
    /// with the most.
    #[must_use]
    pub fn room(&self) -> usize {
        self.room
    }

    /// Kept lines that the sums of a chunk read.
    #[must_use]
    pub fn kept_reads_of(&self, chunk: usize) -> &[u32] {
        let start = chunk.checked_sub(1).map_or(0, |before| self.kept_read_ends[before]);
        &self.kept_reads[start as usize..self.kept_read_ends[chunk] as usize]
    }

    /// Local indices of a chunk.
    #[must_use]
    pub fn chunk(&self, chunk: usize) -> Range<usize> {
        let start = self.particles.start + chunk * CHUNK;
        start..(start + CHUNK).min(self.particles.end)
    }
}

/// All contacts of a rank and, per local particle (owned and ghost), its ends in order of (partner
/// id, image shift seen from the particle): the order in which forces are summed on every rank.
#[derive(Debug, Clone, Default)]
pub struct ContactList {
    /// Strips: first those whose particles no other rank sees, then the others.
    pub strips: Vec<Strip>,
    /// Number of strips whose particles no other rank sees.
    pub inner: usize,
    /// Pairs of materials.
    pub pairs: usize,
    /// Sections, `4 · pairs` per strip: for each of [`PARTNERS`] one per pair.
    pub sections: Vec<Section>,
    /// All runs, in order of their lines: kept contacts first, one run per section.
    pub runs: Vec<Run>,
    /// Number of kept lines.
    pub kept: usize,
    /// Number of output lines, padding included.
    pub lines: usize,
    /// Numbers per output line.
    stride: usize,
    /// `ends[offsets[p]..offsets[p+1]]` are those of local particle `p`.
    offsets: Vec<u32>,
    /// Ends of all particles.
    ends: Vec<End>,
}

impl ContactList {
    /// Empty sections for particles cut into strips; `columns` are the memory columns per pair of materials.
    pub fn cut(&mut self, strips: Vec<Range<usize>>, inner: usize, columns: &[usize]) {
        self.inner = inner;
        self.pairs = columns.len();
        self.sections.clear();
        for particles in &strips {
            for partners in PARTNERS {
                let origin = if partners == Partners::Near { particles.start } else { 0 };
                let sections = columns.iter().enumerate();
                self.sections.extend(sections.map(|(pair, columns)| Section::new(pair, partners, *columns, origin)));
            }
        }
        let strip = |particles| Strip {
            particles,
            near: 0..0,
            kept: 0..0,
            first_line: 0,
            ring: BLOCK,
            room: 0,
            kept_reads: Vec::new(),
            kept_read_ends: Vec::new(),
            visits: Vec::new(),
        };
        self.strips = strips.into_iter().map(strip).collect();
    }

    /// What a step reads, and the sections, whose memory it changes.
    pub fn parts(&mut self) -> (Reading<'_>, &mut [Section]) {
        let Self { strips, sections, runs, offsets, ends, .. } = self;
        (Reading { strips, runs, offsets, ends }, sections)
    }

    /// Sections per strip.
    #[must_use]
    pub fn per_strip(&self) -> usize {
        PARTNERS.len() * self.pairs
    }

    /// The output lines of a local particle's contacts, in the order of summation, and whether it is their second.
    pub fn lines_of(&self, particle: usize) -> impl Iterator<Item = (usize, bool)> {
        self.places_of(particle).map(move |place| self.line_at(particle, place))
    }

    /// Where the ends of a local particle are.
    fn places_of(&self, particle: usize) -> Range<usize> {
        self.offsets[particle] as usize..self.offsets[particle + 1] as usize
    }

    /// Output line of one of a particle's ends, and whether the particle is its second.
    fn line_at(&self, particle: usize, place: usize) -> (usize, bool) {
        let (end, number) = (self.ends[place], self.ends[place].number());
        let strip = self.strips.partition_point(|strip| strip.particles.end <= particle);
        let line = self.strips.get(strip).map_or(number, |strip| {
            let number = 2 * number / self.stride;
            let chunk = (particle - strip.particles.start) / CHUNK;
            if number >= strip.ring {
                return strip.kept_reads_of(chunk)[number - strip.ring] as usize;
            }
            let last = self.reached(strip, chunk) - 1;
            last - ((last - number) & (strip.ring - 1))
        });
        (line, end.is_second())
    }

    /// Number of the first line after those of a strip's chunk.
    fn reached(&self, strip: &Strip, chunk: usize) -> usize {
        let next = strip.near.start + (chunk + 1) * self.pairs;
        self.runs.get(next).map_or(self.lines, |run| run.line as usize)
    }

    /// Contacts without padding.
    #[must_use]
    pub fn contacts(&self) -> usize {
        self.sections.iter().map(|s| s.count).sum()
    }

    /// Section and place of an output line.
    #[must_use]
    pub fn locate(&self, line: usize) -> (usize, usize) {
        let run = self.runs[self.runs.partition_point(|run| run.line as usize <= line) - 1];
        (run.section as usize, run.block as usize * BLOCK + line - run.line as usize)
    }

    /// A particle was wrapped by `wraps` images (+1: it left through the high face): adjust the shifts
    /// of its contacts so that every pair vector stays what it was.
    pub fn apply_wrap(&mut self, particle: usize, wraps: [i32; 3]) {
        for place in self.places_of(particle) {
            let (line, is_second) = self.line_at(particle, place);
            let (section, place) = self.locate(line);
            let section = &mut self.sections[section];
            if section.partners == Partners::Wall {
                continue;
            }
            let old = shift::decode(section.shift[place]);
            let sign = if is_second { 1 } else { -1 };
            section.shift[place] = shift::encode([0, 1, 2].map(|k| old[k] + sign * wraps[k]));
        }
    }

    /// The identity of a contact.
    #[must_use]
    pub fn key(&self, section: usize, place: usize, particles: &Particles, total: u32) -> ContactKey {
        let section = &self.sections[section];
        let low = particles.id[section.first_of(place)];
        let (high, shift) = if section.partners == Partners::Wall {
            (total + section.wall_of(place), [0; 3])
        } else {
            (particles.id[section.second_of(place)], shift::decode(section.shift[place]))
        };
        ContactKey { low, high, shift: [shift[0], shift[1], shift[2], 0] }
    }

    /// Number the output lines, of `stride` numbers each, and order every particle's ends. Call after filling the
    /// sections.
    pub fn index(&mut self, particles: &Particles, total: u32, stride: usize) {
        self.stride = stride;
        self.number_lines();
        self.order_ends(particles, total);
        self.order_sums();
    }

    fn number_lines(&mut self) {
        let per_strip = self.per_strip();
        let Self { strips, sections, runs, pairs, .. } = self;
        runs.clear();
        let mut line = 0;
        for (number, strip) in strips.iter_mut().enumerate() {
            let start = line;
            for section in number * per_strip + *pairs..(number + 1) * per_strip {
                let blocks = sections[section].blocks();
                runs.push(Run { section: section as u32, block: 0, blocks: blocks as u32, line: line as u32 });
                line += blocks * BLOCK;
            }
            strip.kept = start..line;
        }
        self.kept = line;
        for (number, strip) in strips.iter_mut().enumerate() {
            let near = &sections[number * per_strip..number * per_strip + *pairs];
            let from = runs.len();
            strip.first_line = line;
            let mut reached = vec![0; *pairs];
            for chunk in 0..strip.chunks() {
                let end = (chunk + 1) * CHUNK;
                for (pair, section) in near.iter().enumerate() {
                    let block = reached[pair];
                    let mut place = block * BLOCK;
                    while place < section.count && owner(section, place) < end {
                        place += 1;
                    }
                    let blocks = place.div_ceil(BLOCK) - block;
                    let section = (number * per_strip + pair) as u32;
                    runs.push(Run { section, block: block as u32, blocks: blocks as u32, line: line as u32 });
                    line += blocks * BLOCK;
                    reached[pair] += blocks;
                }
            }
            strip.near = from..runs.len();
            strip.ring = ring_of(strip, &runs[strip.near.clone()], near, number * per_strip, line);
        }
        self.lines = line;
    }

    /// From lines to places in the strips' buffers, and the order of the sums.
    fn order_sums(&mut self) {
        let Self { strips, offsets, ends, kept, stride, .. } = self;
        for strip in strips {
            strip.kept_reads.clear();
            strip.kept_read_ends.clear();
            strip.visits.clear();
            let mut most = strip.ring;
            for chunk in 0..strip.chunks() {
                let particles = strip.chunk(chunk);
                let mut counts = [[0; CHUNK]; 2];
                let mut slots = strip.ring;
                for (place, particle) in particles.clone().enumerate() {
                    for end in &mut ends[offsets[particle] as usize..offsets[particle + 1] as usize] {
                        let line = end.number();
                        let slot = if line < *kept {
                            strip.kept_reads.push(line as u32);
                            slots += 1;
                            slots - 1
                        } else {
                            line & (strip.ring - 1)
                        };
                        counts[usize::from(end.is_second())][place] += 1;
                        *end = End::new(slot * *stride / 2, end.is_second());
                    }
                }
                strip.visits.push(counts.map(|counts| Visits::new(&counts[..particles.len()])));
                strip.kept_read_ends.push(strip.kept_reads.len() as u32);
                most = most.max(slots);
            }
            strip.room = most * *stride;
        }
    }

    /// The largest number that an [`End`] has to hold.
    #[must_use]
    pub fn largest_number(&self) -> usize {
        self.strips.iter().map(|strip| strip.room / 2).fold(self.lines, usize::max)
    }

    fn order_ends(&mut self, particles: &Particles, total: u32) {
        let locals = particles.len();
        let Self { sections, runs, offsets, ends, .. } = self;
        offsets.clear();
        offsets.resize(locals + 2, 0);
        // Counted two places on, so that filling leaves the starts where they belong.
        for section in sections.iter() {
            for place in 0..section.count {
                offsets[section.first_of(place) + 2] += 1;
                if section.partners != Partners::Wall {
                    offsets[section.second_of(place) + 2] += 1;
                }
            }
        }
        for particle in 0..locals {
            offsets[particle + 2] += offsets[particle + 1];
        }
        // Not kept: it is larger than the list itself.
        let mut keyed = vec![(0_u64, End::new(0, false)); offsets[locals + 1] as usize];
        let mut place_end = |particle: usize, key: u64, end: End| {
            let slot = &mut offsets[particle + 1];
            keyed[*slot as usize] = (key, end);
            *slot += 1;
        };
        for run in runs.iter() {
            let section = &sections[run.section as usize];
            let places = run.block as usize * BLOCK..((run.block + run.blocks) as usize * BLOCK).min(section.count);
            for (line, place) in (run.line as usize..).zip(places) {
                let first = section.first_of(place);
                if section.partners == Partners::Wall {
                    place_end(first, order_key(total + section.wall_of(place), [0; 3], false), End::new(line, false));
                } else {
                    let second = section.second_of(place);
                    let shift = shift::decode(section.shift[place]);
                    place_end(first, order_key(particles.id[second], shift, false), End::new(line, false));
                    place_end(second, order_key(particles.id[first], shift.map(|s| -s), true), End::new(line, true));
                }
            }
        }
        offsets.pop();
        ends.clear();
        ends.resize(keyed.len(), End::new(0, false));
        sort_ends(offsets, &mut keyed, ends);
    }
}

/// Sort the ends of each particle by their keys, on all threads.
fn sort_ends(offsets: &[u32], keyed: &mut [(u64, End)], ends: &mut [End]) {
    const GRAIN: usize = 4096;
    let particles = offsets.len() - 1;
    if particles > GRAIN {
        let middle = particles / 2;
        let cut = (offsets[middle] - offsets[0]) as usize;
        let (keyed_low, keyed_high) = keyed.split_at_mut(cut);
        let (ends_low, ends_high) = ends.split_at_mut(cut);
        rayon::join(
            || sort_ends(&offsets[..=middle], keyed_low, ends_low),
            || sort_ends(&offsets[middle..], keyed_high, ends_high),
        );
        return;
    }
    for window in offsets.windows(2) {
        let range = (window[0] - offsets[0]) as usize..(window[1] - offsets[0]) as usize;
        keyed[range].sort_unstable_by_key(|(key, _)| *key);
    }
    for (end, (_, sorted)) in ends.iter_mut().zip(keyed) {
        *end = *sorted;
    }
}

/// Owner of a near contact, counted from the start of its strip.
fn owner(section: &Section, place: usize) -> usize {
    section.first_of(place).min(section.second_of(place)) - section.origin
}

/// Lines that must be there together: from a contact's own to the last one evaluated before the particle
/// at its other end is summed.
fn ring_of(strip: &Strip, runs: &[Run], near: &[Section], first_section: usize, last: usize) -> usize {
    let pairs = near.len();
    let reached = |chunk: usize| runs.get((chunk + 1) * pairs).map_or(last, |run| run.line as usize);
    let longest = runs.par_chunks(pairs.max(1)).map(|chunk| {
        let spans = chunk.iter().flat_map(|run| {
            let section = &near[run.section as usize - first_section];
            let places = run.block as usize * BLOCK..((run.block + run.blocks) as usize * BLOCK).min(section.count);
            places.map(move |place| {
                let other = section.first_of(place).max(section.second_of(place)) - section.origin;
                let line = run.line as usize + (place / BLOCK - run.block as usize) * BLOCK;
                reached(other / CHUNK) - line
            })
        });
        spans.max().unwrap_or(BLOCK)
    });
    debug_assert!(strip.first_line <= last);
    longest.max().unwrap_or(BLOCK).next_power_of_two()
}

/// Orders by partner id, then by shift, x first. A particle is the second in contacts with lower ids; so it is counted
/// also where its partner is an image of itself, so that ends of seconds always come before those of firsts.
fn order_key(partner: u32, shift: [i32; 3], second: bool) -> u64 {
    let [x, y, z] = shift.map(|s| (s + 128) as u64);
    u64::from(!second) << 56 | u64::from(partner) << 24 | x << 16 | y << 8 | z
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Near contacts over one and seventy places, contacts across strips and with ghosts, 300 owned particles in two strips.
    fn list(particles: &Particles) -> ContactList {
        let here = shift::encode([0; 3]);
        let mut list = ContactList::default();
        list.cut(vec![0..200, 200..300], 0, &[1]);
        let mut fill = |strip: usize, kind: usize, pairs: &[(usize, usize)]| {
            let section = &mut list.sections[strip * PARTNERS.len() + kind];
            section.resize(pairs.len());
            for (place, (a, b)) in pairs.iter().enumerate() {
                let (low, high) = if particles.id[*a] < particles.id[*b] { (*a, *b) } else { (*b, *a) };
                section.set(place, (low - section.origin) as u32, (high - section.origin) as u32, here);
            }
        };
        for (strip, range) in [0..200, 200..300].into_iter().enumerate() {
            let near: Vec<_> = range.clone().flat_map(|p| [(p, p + 1), (p, p + 70)]).collect();
            fill(strip, 0, &near.into_iter().filter(|(_, b)| *b < range.end).collect::<Vec<_>>());
        }
        fill(0, 1, &(0..200).step_by(3).map(|p| (p, 200 + p / 2)).collect::<Vec<_>>());
        fill(1, 3, &(250..300).map(|p| (p, 300 + p % 7)).collect::<Vec<_>>());
        list.index(particles, 310, 6);
        list
    }

    #[test]
    fn the_lines_of_a_particle_are_those_of_its_contacts_in_order_of_the_partners_ids() {
        let mut particles = Particles { owned: 300, ..Particles::default() };
        // Ids in another order than the particles.
        particles.id.extend((0..307).map(|p| p * 101 % 307));
        particles.record.resize(307, bytemuck::Zeroable::zeroed());
        let list = list(&particles);
        let mut expected = vec![Vec::new(); particles.id.len()];
        for run in &list.runs {
            let section = &list.sections[run.section as usize];
            let places = run.block as usize * BLOCK..((run.block + run.blocks) as usize * BLOCK).min(section.count);
            for (line, place) in (run.line as usize..).zip(places) {
                let (first, second) = (section.first_of(place), section.second_of(place));
                assert_eq!(list.locate(line), (run.section as usize, place));
                expected[first].push((particles.id[second], line, false));
                expected[second].push((particles.id[first], line, true));
            }
        }
        assert!(expected.iter().any(|lines| lines.len() > 4) && list.strips[0].ring < list.lines);
        for (particle, lines) in expected.iter_mut().enumerate() {
            lines.sort_unstable();
            let lines: Vec<_> = lines.iter().map(|(_, line, is_second)| (*line, *is_second)).collect();
            assert_eq!(list.lines_of(particle).collect::<Vec<_>>(), lines, "particle {particle}");
        }
    }
}
