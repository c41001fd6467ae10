//! Contacts of one pair of materials in blocks, with their memory.

use super::shift;
use crate::state::particles::RECORD;
use bytemuck::{Pod, Zeroable};

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
    pub first: Vec<u32>,
    /// The other particle likewise (or the number of the wall).
    pub second: Vec<u32>,
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
        self.first[place] = first * unit;
        self.second[place] = if self.partners == Partners::Wall { second } else { second * unit };
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

#[cfg(test)]
mod tests {
    use super::*;

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
