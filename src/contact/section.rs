//! Contacts of one pair of materials in blocks, with their memory.

use super::shift;
use crate::state::particles::{RECORD, Record};
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// Contacts per block: the widest lanes.
pub const BLOCK: usize = 8;

/// A number for each contact of a block; keeps buffers aligned to cache lines.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct CacheLine(pub [f64; BLOCK]);

/// What the two ends of the contacts of a section are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Partners {
    /// Two owned particles of one strip, neither across a periodic face.
    Near,
    /// Two owned particles of different strips, or across a periodic face.
    Apart,
    /// An owned particle and a plane wall; `second` is the wall, 2·axis + side.
    Wall,
    /// An owned particle and a ghost.
    Ghost,
}

/// Kinds of partners in the order of a strip's sections.
pub const PARTNERS: [Partners; 4] = [Partners::Near, Partners::Apart, Partners::Wall, Partners::Ghost];

/// Contacts of one pair of materials with the same kind of partners, owned by the particles of one strip, in
/// order of the owner (see [`crate::neighbour::verlet`]). Padded to whole blocks; the padding pairs
/// particle 0 with its own far image and never touches.
#[derive(Debug, Clone)]
pub struct Section {
    /// Index of the pair of materials.
    pub pair: usize,
    /// Kind of partners.
    pub partners: Partners,
    /// Contacts without the padding.
    pub count: usize,
    /// Local index that the entries of `first` and `second` count from.
    pub origin: usize,
    /// The particle with the lower global id: its index times [`RECORD`], where its record begins in the array of
    /// numbers, so that the contact pass has nothing to compute.
    first: Vec<u32>,
    /// The other particle likewise (or the number of the wall).
    second: Vec<u32>,
    /// No entry of `first` and, but for walls, of `second` is larger.
    highest: u32,
    /// Packed image shift of the second.
    pub shift: Vec<u16>,
    /// Memory columns of this pair's law.
    pub columns: usize,
    /// Memory, the numbers of a block column by column.
    pub memory: Vec<CacheLine>,
    /// Between ellipsoids the last normal of each contact, touching or not, where there is one: mere hints that spare a
    /// search where a plane keeps the two apart. No result depends on them, and they may belong to another contact.
    pub hints: Vec<[CacheLine; 3]>,
}

impl Section {
    /// An empty section.
    #[must_use]
    pub fn new(pair: usize, partners: Partners, columns: usize, origin: usize) -> Self {
        Self {
            pair,
            partners,
            count: 0,
            origin,
            first: Vec::new(),
            second: Vec::new(),
            highest: 0,
            shift: Vec::new(),
            columns,
            memory: Vec::new(),
            hints: Vec::new(),
        }
    }

    /// Blocks, the last one with its padding.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.first.len() / BLOCK
    }

    /// Local index of the first particle of a contact.
    #[must_use]
    pub fn first_of(&self, place: usize) -> usize {
        self.origin + self.first[place] as usize / RECORD
    }

    /// Local index of the second particle of a contact (not of a wall).
    #[must_use]
    pub fn second_of(&self, place: usize) -> usize {
        self.origin + self.second[place] as usize / RECORD
    }

    /// Number of the wall of a contact with one.
    #[must_use]
    pub fn wall_of(&self, place: usize) -> u32 {
        self.second[place]
    }

    /// Offsets of the firsts and of the seconds, padding included.
    #[must_use]
    pub fn offsets(&self) -> [&[u32]; 2] {
        [&self.first, &self.second]
    }

    /// The pairs of particles, whose records from the section's origin on these are.
    ///
    /// # Panics
    /// If there is no record for some particle, or if the section is of a wall.
    #[inline]
    #[must_use]
    pub fn pairs<'a>(&'a self, records: &'a [Record]) -> Pairs<'a> {
        assert!(self.partners != Partners::Wall, "a wall has no record");
        let last = records.len().checked_sub(1);
        let inside = last.is_some_and(|last| self.highest as usize <= last * RECORD);
        assert!(inside || self.first.is_empty(), "the contact list names particles that are not there");
        let (first, second) = (self.first.as_chunks().0, self.second.as_chunks().0);
        Pairs { records, first, second, codes: self.shift.as_chunks().0 }
    }

    /// Set the number of contacts. New places hold padding and zero memory; so do the places that were cut
    /// off within the last block.
    pub fn resize(&mut self, count: usize) {
        let padded = count.next_multiple_of(BLOCK);
        let far = shift::encode([shift::MAX_SHIFT; 3]);
        let kept = self.count.min(count);
        self.first.resize(padded, 0);
        self.second.resize(padded, 0);
        self.shift.resize(padded, far);
        self.memory.resize(padded / BLOCK * self.columns, CacheLine::zeroed());
        self.count = count;
        for place in kept..padded {
            self.set(place, 0, 0, far);
        }
    }

    /// Make `place` a contact with zero memory; indices from the origin on, or the number of the wall.
    pub fn set(&mut self, place: usize, first: u32, second: u32, code: u16) {
        let unit = RECORD as u32;
        let wall = self.partners == Partners::Wall;
        self.first[place] = first * unit;
        self.second[place] = if wall { second } else { second * unit };
        self.highest = self.highest.max(self.first[place]);
        if !wall {
            self.highest = self.highest.max(self.second[place]);
        }
        self.shift[place] = code;
        let start = place / BLOCK * self.columns;
        for line in &mut self.memory[start..start + self.columns] {
            line.0[place % BLOCK] = 0.0;
        }
    }

    /// Copy a contact with its memory from one place to another.
    pub fn relocate(&mut self, from: usize, to: usize) {
        self.first[to] = self.first[from];
        self.second[to] = self.second[from];
        self.shift[to] = self.shift[from];
        let (source, target) = (from / BLOCK * self.columns, to / BLOCK * self.columns);
        for column in 0..self.columns {
            self.memory[target + column].0[to % BLOCK] = self.memory[source + column].0[from % BLOCK];
        }
    }

    /// Copy the memory of a contact out; columns beyond this law's stay untouched.
    pub fn read_memory(&self, place: usize, row: &mut [f64]) {
        let start = place / BLOCK * self.columns;
        for (value, line) in row.iter_mut().zip(&self.memory[start..start + self.columns]) {
            *value = line.0[place % BLOCK];
        }
    }

    /// Set the memory of a contact from a row.
    pub fn write_memory(&mut self, place: usize, row: &[f64]) {
        let start = place / BLOCK * self.columns;
        for (value, line) in row.iter().zip(&mut self.memory[start..start + self.columns]) {
            line.0[place % BLOCK] = *value;
        }
    }
}

/// The contacts of a section as pairs of records, all of which are there.
#[derive(Debug, Clone, Copy)]
pub struct Pairs<'a> {
    records: &'a [Record],
    first: &'a [[u32; BLOCK]],
    second: &'a [[u32; BLOCK]],
    codes: &'a [[u16; BLOCK]],
}

impl<'a> Pairs<'a> {
    /// The records as numbers.
    #[inline(always)]
    #[must_use]
    pub fn numbers(&self) -> &'a [f64] {
        bytemuck::cast_slice(self.records)
    }

    /// Some blocks.
    #[inline(always)]
    #[must_use]
    pub fn part(&self, blocks: Range<usize>) -> Self {
        Self {
            records: self.records,
            first: &self.first[blocks.clone()],
            second: &self.second[blocks.clone()],
            codes: &self.codes[blocks],
        }
    }

    /// One block.
    #[inline(always)]
    #[must_use]
    pub fn block(&self, number: usize) -> BlockPairs<'a> {
        let offsets = [&self.first[number], &self.second[number]];
        BlockPairs { records: self.records, offsets, codes: &self.codes[number] }
    }

    /// Block by block.
    #[inline(always)]
    pub fn blocks(&self) -> impl Iterator<Item = BlockPairs<'a>> + Clone + use<'a> {
        let records = self.records;
        let lists = self.first.iter().zip(self.second).zip(self.codes);
        lists.map(move |((first, second), codes)| BlockPairs { records, offsets: [first, second], codes })
    }

    /// Of each contact of a block, if there is one, the record that lies farther on in memory: its offset.
    #[inline(always)]
    #[must_use]
    pub fn farther(&self, block: usize) -> Option<[u32; BLOCK]> {
        let (first, second) = (self.first.get(block)?, self.second.get(block)?);
        Some(std::array::from_fn(|place| first[place].max(second[place])))
    }
}

/// The pairs of a block, all of whose records are there.
#[derive(Debug, Clone, Copy)]
pub struct BlockPairs<'a> {
    records: &'a [Record],
    offsets: [&'a [u32; BLOCK]; 2],
    codes: &'a [u16; BLOCK],
}

impl<'a> BlockPairs<'a> {
    /// The two records of a pair.
    #[inline(always)]
    #[must_use]
    pub fn records(&self, place: usize) -> [&'a Record; 2] {
        self.offsets.map(|offsets| &self.records[offsets[place] as usize / RECORD])
    }

    /// Where the records of `N` firsts and of `N` seconds begin, of the pairs from `place` on: addresses of [`RECORD`]
    /// numbers each.
    #[inline(always)]
    #[must_use]
    pub fn starts<const N: usize>(&self, place: usize) -> [[*const f64; N]; 2] {
        let start: *const f64 = self.records.as_ptr().cast();
        self.offsets.map(|offsets| std::array::from_fn(|k| start.wrapping_add(offsets[place + k] as usize)))
    }

    /// Offsets of the firsts and of the seconds.
    #[inline(always)]
    #[must_use]
    pub fn offsets(&self) -> [&'a [u32; BLOCK]; 2] {
        self.offsets
    }

    /// Packed image shifts of the seconds.
    #[inline(always)]
    #[must_use]
    pub fn codes(&self) -> &'a [u16; BLOCK] {
        self.codes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "names particles that are not there")]
    fn pairs_without_all_their_records_are_refused() {
        let mut section = Section::new(0, Partners::Near, 0, 0);
        section.resize(10);
        section.set(9, 3, 20, 0);
        let records = vec![Record::zeroed(); 21];
        assert_eq!(section.pairs(&records).block(1).records(1).len(), 2);
        let _ = section.pairs(&records[..20]);
    }

    #[test]
    fn memory_stays_with_its_contact() {
        let mut section = Section::new(0, Partners::Near, 2, 0);
        section.resize(10);
        for place in 0..10 {
            section.set(place, place as u32, 20, 0);
            section.write_memory(place, &[place as f64, -1.0]);
        }
        section.relocate(9, 2);
        section.resize(3);
        let mut row = [0.0; 2];
        section.read_memory(2, &mut row);
        assert_eq!((section.first_of(2), section.second_of(2), row), (9, 20, [9.0, -1.0]));
        assert_eq!((section.blocks(), section.memory.len(), section.first[3]), (1, 2, 0));
        section.read_memory(3, &mut row);
        assert_eq!(row, [0.0; 2]);
    }
}
