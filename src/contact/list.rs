//! The list of contacts that touch or nearly do, in sections of equal law, with their memory in
//! blocks of eight, and for every particle its contacts in the order of summation.

use super::shift;
use crate::state::ContactKey;
use crate::state::particles::Particles;

/// Contacts per memory block: memory lies as `[column][8]` per block.
pub const BLOCK: usize = 8;

/// What the two ends of the contacts of a section are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Partners {
    /// Two owned particles.
    Owned,
    /// An owned particle and a ghost.
    Ghost,
    /// An owned particle and a plane wall; `second` is the wall, 2·axis + side.
    Wall,
}

/// Contacts of one pair of materials with the same kind of partners. Padded to whole blocks; the
/// padding repeats particle 0 with a far image and is never read.
#[derive(Debug, Clone)]
pub struct Section {
    /// Index of the pair of materials.
    pub pair: usize,
    /// Kind of partners.
    pub partners: Partners,
    /// Contacts without the padding.
    pub count: usize,
    /// Local index of the particle with the lower global id.
    pub first: Vec<u32>,
    /// Local index of the other particle (or the wall).
    pub second: Vec<u32>,
    /// Packed image shift of the second.
    pub shift: Vec<u16>,
    /// Memory columns of this pair's law.
    pub columns: usize,
    /// Memory, `[block][column][8]`.
    pub memory: Vec<f64>,
    /// Number of the first contact's output line.
    pub base: usize,
}

impl Section {
    /// An empty section.
    #[must_use]
    pub fn new(pair: usize, partners: Partners, columns: usize) -> Self {
        Self {
            pair,
            partners,
            count: 0,
            first: Vec::new(),
            second: Vec::new(),
            shift: Vec::new(),
            columns,
            memory: Vec::new(),
            base: 0,
        }
    }

    /// Forget all contacts, keep the buffers.
    pub fn clear(&mut self) {
        self.count = 0;
        self.first.clear();
        self.second.clear();
        self.shift.clear();
        self.memory.clear();
    }

    /// Append a contact with zero memory; returns its place.
    pub fn push(&mut self, first: u32, second: u32, code: u16) -> usize {
        let place = self.count;
        if place.is_multiple_of(BLOCK) {
            self.first.resize(place + BLOCK, 0);
            self.second.resize(place + BLOCK, 0);
            self.shift.resize(place + BLOCK, shift::encode([shift::MAX_SHIFT; 3]));
            self.memory.resize((place + BLOCK) * self.columns, 0.0);
        }
        self.first[place] = first;
        self.second[place] = second;
        self.shift[place] = code;
        self.count += 1;
        place
    }

    /// Copy the memory of a contact out; columns beyond this law's stay untouched.
    pub fn read_memory(&self, place: usize, row: &mut [f64]) {
        let start = place / BLOCK * BLOCK * self.columns + place % BLOCK;
        for (column, value) in row.iter_mut().enumerate().take(self.columns) {
            *value = self.memory[start + column * BLOCK];
        }
    }

    /// Set the memory of a contact from a row.
    pub fn write_memory(&mut self, place: usize, row: &[f64]) {
        let start = place / BLOCK * BLOCK * self.columns + place % BLOCK;
        for (column, value) in row.iter().enumerate().take(self.columns) {
            self.memory[start + column * BLOCK] = *value;
        }
    }
}

/// One end of a contact as its particle sees it: the number of the output line and the side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct End(u32);

impl End {
    /// `second`: the particle is the contact's second.
    #[must_use]
    pub fn new(line: usize, second: bool) -> Self {
        Self((line as u32) << 1 | u32::from(second))
    }
    /// Number of the output line.
    #[inline(always)]
    #[must_use]
    pub fn line(self) -> usize {
        (self.0 >> 1) as usize
    }
    /// The particle is the contact's second.
    #[inline(always)]
    #[must_use]
    pub fn is_second(self) -> bool {
        self.0 & 1 == 1
    }
}

/// All contacts of a rank and, per local particle (owned and ghost), its ends in order of (partner
/// id, image shift seen from the particle): the order in which forces are summed on every rank.
#[derive(Debug, Clone, Default)]
pub struct ContactList {
    /// Sections; output lines are numbered through them.
    pub sections: Vec<Section>,
    /// `ends[offsets[p]..offsets[p+1]]` are those of local particle `p`.
    pub offsets: Vec<u32>,
    /// Ends of all particles.
    pub ends: Vec<End>,
    /// Number of output lines, padding included.
    pub lines: usize,
}

impl ContactList {
    /// The ends of a local particle.
    #[inline(always)]
    #[must_use]
    pub fn ends_of(&self, particle: usize) -> &[End] {
        &self.ends[self.offsets[particle] as usize..self.offsets[particle + 1] as usize]
    }

    /// Contacts without padding.
    #[must_use]
    pub fn contacts(&self) -> usize {
        self.sections.iter().map(|s| s.count).sum()
    }

    /// Section and place of an output line.
    #[must_use]
    pub fn locate(&self, line: usize) -> (usize, usize) {
        let section = self.sections.partition_point(|s| s.base + s.first.len() <= line);
        (section, line - self.sections[section].base)
    }

    /// A particle was wrapped by `wraps` images (+1: it left through the high face): adjust the shifts
    /// of its contacts so that every pair vector stays what it was.
    pub fn apply_wrap(&mut self, particle: usize, wraps: [i32; 3]) {
        let range = self.offsets[particle] as usize..self.offsets[particle + 1] as usize;
        for position in range {
            let end = self.ends[position];
            let (section, place) = self.locate(end.line());
            let section = &mut self.sections[section];
            if section.partners == Partners::Wall {
                continue;
            }
            let old = shift::decode(section.shift[place]);
            let sign = if end.is_second() { 1 } else { -1 };
            section.shift[place] = shift::encode([0, 1, 2].map(|k| old[k] + sign * wraps[k]));
        }
    }

    /// The identity of a contact.
    #[must_use]
    pub fn key(&self, section: usize, place: usize, particles: &Particles, total: u32) -> ContactKey {
        let section = &self.sections[section];
        let low = particles.id[section.first[place] as usize];
        let second = section.second[place];
        let (high, shift) = if section.partners == Partners::Wall {
            (total + second, [0; 3])
        } else {
            (particles.id[second as usize], shift::decode(section.shift[place]))
        };
        ContactKey { low, high, shift: [shift[0], shift[1], shift[2], 0] }
    }

    /// Number the output lines and order every particle's ends. Call after filling the sections.
    pub fn index(&mut self, particles: &Particles, total: u32) {
        self.lines = 0;
        for section in &mut self.sections {
            section.base = self.lines;
            self.lines += section.first.len();
        }
        let locals = particles.len();
        self.offsets.clear();
        self.offsets.resize(locals + 1, 0);
        for section in &self.sections {
            for place in 0..section.count {
                self.offsets[section.first[place] as usize + 1] += 1;
                if section.partners != Partners::Wall {
                    self.offsets[section.second[place] as usize + 1] += 1;
                }
            }
        }
        for particle in 0..locals {
            self.offsets[particle + 1] += self.offsets[particle];
        }
        let mut next = self.offsets.clone();
        let mut keyed = vec![(0_u64, End(0)); self.offsets[locals] as usize];
        let mut place_end = |particle: u32, key: u64, end: End| {
            let slot = &mut next[particle as usize];
            keyed[*slot as usize] = (key, end);
            *slot += 1;
        };
        for section in &self.sections {
            for place in 0..section.count {
                let (first, second, line) = (section.first[place], section.second[place], section.base + place);
                if section.partners == Partners::Wall {
                    place_end(first, order_key(total + second, [0; 3]), End::new(line, false));
                } else {
                    let shift = shift::decode(section.shift[place]);
                    place_end(first, order_key(particles.id[second as usize], shift), End::new(line, false));
                    let back = shift.map(|s| -s);
                    place_end(second, order_key(particles.id[first as usize], back), End::new(line, true));
                }
            }
        }
        for particle in 0..locals {
            keyed[self.offsets[particle] as usize..self.offsets[particle + 1] as usize]
                .sort_unstable_by_key(|(key, _)| *key);
        }
        self.ends.clear();
        self.ends.extend(keyed.into_iter().map(|(_, end)| end));
    }
}

/// Orders by partner id, then by shift, x first.
fn order_key(partner: u32, shift: [i32; 3]) -> u64 {
    let [x, y, z] = shift.map(|s| (s + 128) as u64);
    u64::from(partner) << 24 | x << 16 | y << 8 | z
}
