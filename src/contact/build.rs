//! From the Verlet list to the list of contacts, with the memory carried over.

use super::list::{BLOCK, ContactList, Partners, Section};
use super::shift;
use crate::neighbour::verlet::Candidate;
use crate::state::particles::Particles;
use crate::state::{ContactKey, ContactMemory};
use rustc_hash::FxHashMap;

/// What the builder must know beside particles and candidates.
#[derive(Debug, Clone)]
pub struct BuildContext {
    /// Material of each species.
    pub material: Vec<usize>,
    /// Number of materials.
    pub materials: usize,
    /// Memory columns of each pair of materials.
    pub columns: Vec<usize>,
    /// Wall material per axis, `None` on periodic axes.
    pub walls: [Option<usize>; 3],
    /// Number of particles on all ranks; walls have the ids from here on.
    pub total: u32,
    /// Inner skin \[m\]: pairs up to this gap are listed.
    pub skin: f64,
}

impl BuildContext {
    /// Row-wise upper triangle, as [`crate::config::Config::pair_index`].
    #[must_use]
    pub fn pair_index(&self, a: usize, b: usize) -> usize {
        let (low, high) = if a < b { (a, b) } else { (b, a) };
        low * self.materials - low * (low + 1) / 2 + high
    }

    /// Largest number of memory columns.
    #[must_use]
    pub fn memory_width(&self) -> usize {
        self.columns.iter().copied().max().unwrap_or(0)
    }

    /// An empty list with the sections of all pairs: owned partners first, then walls, then ghosts, so
    /// that what needs no halo comes first.
    #[must_use]
    pub fn empty_list(&self) -> ContactList {
        let mut list = ContactList::default();
        for partners in [Partners::Owned, Partners::Wall, Partners::Ghost] {
            for (pair, columns) in self.columns.iter().enumerate() {
                list.sections.push(Section::new(pair, partners, *columns));
            }
        }
        list
    }

    fn section_of(&self, partners: Partners, pair: usize) -> usize {
        let group = match partners {
            Partners::Owned => 0,
            Partners::Wall => 1,
            Partners::Ghost => 2,
        };
        group * self.columns.len() + pair
    }

    /// Refill `list` with all candidates and walls nearer than the inner skin, and give back the memory
    /// that `memory` holds for them.
    pub fn fill(
        &self,
        list: &mut ContactList,
        particles: &Particles,
        sides: [f64; 3],
        candidates: &[Candidate],
        memory: &ContactMemory,
    ) {
        for section in &mut list.sections {
            section.clear();
        }
        let rows = Rows::new(memory);
        for candidate in candidates {
            self.add_pair(list, particles, sides, candidate, &rows);
        }
        self.add_walls(list, particles, sides, &rows);
        list.index(particles, self.total);
    }

    fn add_pair(
        &self,
        list: &mut ContactList,
        particles: &Particles,
        sides: [f64; 3],
        candidate: &Candidate,
        rows: &Rows,
    ) {
        let (first, second) = (candidate.first as usize, candidate.second as usize);
        let (a, b) = (&particles.record[first], &particles.record[second]);
        let shift = [0, 1, 2].map(|k| candidate.shift[k] + particles.image[second][k] - particles.image[first][k]);
        let d = [0, 1, 2].map(|k| b.position[k] + f64::from(shift[k]) * sides[k] - a.position[k]);
        let sum = a.radius + b.radius + self.skin;
        if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] >= sum * sum {
            return;
        }
        let ghost = first >= particles.owned || second >= particles.owned;
        let partners = if ghost { Partners::Ghost } else { Partners::Owned };
        let material = |index: usize| self.material[particles.species[index] as usize];
        let section = self.section_of(partners, self.pair_index(material(first), material(second)));
        let section = &mut list.sections[section];
        let place = section.push(candidate.first, candidate.second, shift::encode(shift));
        let key = ContactKey {
            low: particles.id[first],
            high: particles.id[second],
            shift: [shift[0], shift[1], shift[2], 0],
        };
        if let Some(row) = rows.find(&key) {
            section.write_memory(place, row);
        }
    }

    fn add_walls(&self, list: &mut ContactList, particles: &Particles, sides: [f64; 3], rows: &Rows) {
        for (axis, side) in sides.iter().enumerate() {
            let Some(wall_material) = self.walls[axis] else { continue };
            for index in 0..particles.owned {
                let record = &particles.record[index];
                for high in [false, true] {
                    let distance = if high { side - record.position[axis] } else { record.position[axis] };
                    if distance >= record.radius + self.skin || record.inverse_mass == 0.0 {
                        continue;
                    }
                    let wall = 2 * axis as u32 + u32::from(high);
                    let pair = self.pair_index(self.material[particles.species[index] as usize], wall_material);
                    let section = &mut list.sections[self.section_of(Partners::Wall, pair)];
                    let place = section.push(index as u32, wall, shift::encode([0; 3]));
                    let key = ContactKey { low: particles.id[index], high: self.total + wall, shift: [0; 4] };
                    if let Some(row) = rows.find(&key) {
                        section.write_memory(place, row);
                    }
                }
            }
        }
    }

    /// All non-zero memory of the list. `only_owned_low`: leave out contacts whose lower id is a ghost,
    /// so that over all ranks each contact comes once.
    #[must_use]
    pub fn collect_memory(&self, list: &ContactList, particles: &Particles, only_owned_low: bool) -> ContactMemory {
        let width = self.memory_width();
        let mut memory = ContactMemory::new(width);
        let mut row = vec![0.0; width];
        for (number, section) in list.sections.iter().enumerate() {
            if section.columns == 0 {
                continue;
            }
            for place in 0..section.count {
                if only_owned_low && section.first[place] as usize >= particles.owned {
                    continue;
                }
                row.fill(0.0);
                section.read_memory(place, &mut row);
                if row.iter().any(|value| *value != 0.0) {
                    memory.push(list.key(number, place, particles, self.total), &row);
                }
            }
        }
        memory
    }
}

/// Look-up of memory rows by identity.
struct Rows<'a> {
    memory: &'a ContactMemory,
    index: FxHashMap<ContactKey, u32>,
}

impl<'a> Rows<'a> {
    fn new(memory: &'a ContactMemory) -> Self {
        let index = memory.keys.iter().enumerate().map(|(row, key)| (*key, row as u32)).collect();
        Self { memory, index }
    }
    fn find(&self, key: &ContactKey) -> Option<&'a [f64]> {
        self.index.get(key).map(|row| self.memory.row(*row as usize))
    }
}

const _: () = assert!(BLOCK == 8, "memory blocks are laid out for eight lanes");
