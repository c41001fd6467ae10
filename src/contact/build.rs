//! From the Verlet list to the list of contacts. Contacts that stay keep their memory where it is; after a
//! new Verlet list it comes back by identity.

use super::list::ContactList;
use super::section::{PARTNERS, Partners, Section};
use super::shift;
use crate::neighbour::verlet::Candidates;
use crate::state::particles::{Particles, Record};
use crate::state::{ContactKey, ContactMemory};
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use std::ops::Range;

/// The candidate is in the list of contacts.
const LISTED: u32 = 1 << Candidates::FREE_BIT;
/// Number of the candidate's section within its strip, from this bit on.
const SECTION_BIT: u32 = Candidates::FREE_BIT + 1;

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
    /// Numbers per output line.
    pub stride: usize,
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

    /// Empty `list` and cut it into strips; mark every candidate with its section.
    pub fn start(
        &self,
        list: &mut ContactList,
        particles: &Particles,
        candidates: &mut Candidates,
        strips: Vec<Range<usize>>,
        inner: usize,
    ) {
        list.cut(strips, inner, &self.columns);
        let material = |index: usize| self.material[particles.species[index] as usize];
        let here = u32::from(shift::encode([0; 3]));
        for strip in &list.strips {
            for owner in strip.particles.clone() {
                for place in candidates.offsets[owner] as usize..candidates.offsets[owner + 1] as usize {
                    let (partner, code) = (candidates.partner[place] as usize, &mut candidates.code[place]);
                    let partners = if partner >= particles.owned {
                        Partners::Ghost
                    } else if strip.particles.contains(&partner)
                        && *code & (LISTED - 1) & !Candidates::PARTNER_FIRST == here
                    {
                        Partners::Near
                    } else {
                        Partners::Apart
                    };
                    let section = self.section_of(partners, self.pair_index(material(owner), material(partner)));
                    *code |= (section as u32) << SECTION_BIT;
                }
            }
        }
    }

    fn section_of(&self, partners: Partners, pair: usize) -> usize {
        partners as usize * self.columns.len() + pair
    }

    /// Bring `list` up to date: all candidates and walls nearer than the inner skin, those that stay with
    /// their memory, new ones without. `crossed` are the images that each local particle crossed since the
    /// candidates were found.
    pub fn refresh(
        &self,
        list: &mut ContactList,
        particles: &Particles,
        sides: [f64; 3],
        candidates: &mut Candidates,
        crossed: &[[i8; 4]],
    ) {
        let per_strip = list.per_strip();
        let mut work = Vec::with_capacity(list.strips.len());
        let mut codes = candidates.code.as_mut_slice();
        let mut done = 0;
        for (strip, sections) in list.strips.iter().zip(list.sections.chunks_mut(per_strip)) {
            let end = candidates.offsets[strip.particles.end] as usize;
            let (own, rest) = codes.split_at_mut(end - done);
            work.push((strip.particles.clone(), sections, own));
            (codes, done) = (rest, end);
        }
        let (offsets, partners) = (&candidates.offsets, &candidates.partner);
        work.into_par_iter().for_each(|(owners, sections, code)| {
            let view = StripView { context: self, particles, sides, crossed, offsets, partners, owners };
            view.refresh(sections, code);
            self.refresh_walls(sections, &view.owners, particles, sides);
        });
        list.index(particles, self.total, self.stride);
    }

    fn refresh_walls(&self, sections: &mut [Section], owners: &Range<usize>, particles: &Particles, sides: [f64; 3]) {
        if self.walls.iter().all(Option::is_none) {
            return;
        }
        let mut old: Vec<(Section, usize)> = (0..self.columns.len())
            .map(|pair| {
                let section = &mut sections[self.section_of(Partners::Wall, pair)];
                let empty = Section::new(pair, Partners::Wall, section.columns, 0);
                (std::mem::replace(section, empty), 0)
            })
            .collect();
        let mut row = vec![0.0; self.memory_width()];
        for index in owners.clone() {
            let record = &particles.record[index];
            for (axis, material) in self.walls.iter().enumerate().filter_map(|(axis, wall)| Some((axis, (*wall)?))) {
                for wall in [2 * axis as u32, 2 * axis as u32 + 1] {
                    if !reaches_wall(record, wall, sides, self.skin) || record.inverse_mass == 0.0 {
                        continue;
                    }
                    let pair = self.pair_index(self.material[particles.species[index] as usize], material);
                    let section = &mut sections[self.section_of(Partners::Wall, pair)];
                    let place = section.count;
                    section.resize(place + 1);
                    section.set(place, index as u32, wall, shift::encode([0; 3]));
                    // Both lists are in order of particle and wall.
                    let (before, cursor) = &mut old[pair];
                    let key = |place: usize| (before.first_of(place), before.wall_of(place));
                    while *cursor < before.count && key(*cursor) < (index, wall) {
                        *cursor += 1;
                    }
                    if *cursor < before.count && key(*cursor) == (index, wall) {
                        before.read_memory(*cursor, &mut row);
                        section.write_memory(place, &row);
                    }
                }
            }
        }
    }

    /// Give the contacts of a list without memory the rows that `memory` holds for them.
    pub fn restore(&self, list: &mut ContactList, particles: &Particles, memory: &ContactMemory) {
        if memory.keys.is_empty() {
            return;
        }
        let rows = Rows::new(memory, particles);
        for number in 0..list.sections.len() {
            for place in 0..list.sections[number].count {
                let key = list.key(number, place, particles, self.total);
                let first = list.sections[number].first_of(place);
                if let Some(row) = rows.find(first, &key) {
                    list.sections[number].write_memory(place, row);
                }
            }
        }
    }

    /// All non-zero memory of those contacts of the list that `wanted` holds for, called with section and place.
    #[must_use]
    pub fn collect_memory(
        &self,
        list: &ContactList,
        particles: &Particles,
        wanted: impl Fn(&Section, usize) -> bool,
    ) -> ContactMemory {
        let width = self.memory_width();
        let mut memory = ContactMemory::new(width);
        let mut row = vec![0.0; width];
        for (number, section) in list.sections.iter().enumerate().filter(|(_, section)| section.columns > 0) {
            for place in (0..section.count).filter(|&place| wanted(section, place)) {
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

/// Whether the gap of a contact, between the spheres around ellipsoids, is less than `reach`.
#[must_use]
pub fn is_within(section: &Section, place: usize, particles: &Particles, sides: [f64; 3], reach: f64) -> bool {
    let first = &particles.record[section.first_of(place)];
    if section.partners == Partners::Wall {
        return reaches_wall(first, section.wall_of(place), sides, reach);
    }
    let second = &particles.record[section.second_of(place)];
    are_near(first, second, shift::decode(section.shift[place]), sides, reach)
}

/// Whether the gap to a wall (2·axis + side) is less than `reach`.
fn reaches_wall(record: &Record, wall: u32, sides: [f64; 3], reach: f64) -> bool {
    let (axis, high) = (wall as usize / 2, wall % 2 == 1);
    let distance = if high { sides[axis] - record.position[axis] } else { record.position[axis] };
    distance < record.radius + reach
}

/// Whether the gap between two spheres, the second in its image, is less than `reach`.
fn are_near(a: &Record, b: &Record, shift: [i32; 3], sides: [f64; 3], reach: f64) -> bool {
    let d = [0, 1, 2].map(|k| b.position[k] + f64::from(shift[k]) * sides[k] - a.position[k]);
    let sum = a.radius + b.radius + reach;
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < sum * sum
}

/// The candidates of one strip's particles.
struct StripView<'a> {
    context: &'a BuildContext,
    particles: &'a Particles,
    sides: [f64; 3],
    crossed: &'a [[i8; 4]],
    offsets: &'a [u32],
    partners: &'a [u32],
    owners: Range<usize>,
}

/// A candidate as a contact: its first and second particle and their shift now.
struct Pair {
    first: usize,
    second: usize,
    shift: [i32; 3],
}

impl StripView<'_> {
    fn pair(&self, owner: usize, partner: usize, code: u32) -> Pair {
        let (first, second) = if code & Candidates::PARTNER_FIRST == 0 { (owner, partner) } else { (partner, owner) };
        let then = shift::decode((code & 511) as u16);
        let (a, b) = (self.crossed[first], self.crossed[second]);
        Pair { first, second, shift: [0, 1, 2].map(|k| then[k] + i32::from(b[k]) - i32::from(a[k])) }
    }

    fn is_near(&self, pair: &Pair) -> bool {
        let (a, b) = (&self.particles.record[pair.first], &self.particles.record[pair.second]);
        are_near(a, b, pair.shift, self.sides, self.context.skin)
    }

    /// Two sweeps over the candidates, in whose order the contacts of each section lie: forward to close the
    /// gaps that contacts leave, backward to open gaps for new ones.
    fn refresh(&self, sections: &mut [Section], code: &mut [u32]) {
        const NEW: u32 = 1 << 31;
        let base = self.offsets[self.owners.start] as usize;
        let mut read = vec![0; sections.len()];
        let mut write = vec![0; sections.len()];
        let mut count = vec![0; sections.len()];
        for owner in self.owners.clone() {
            for place in self.offsets[owner] as usize..self.offsets[owner + 1] as usize {
                let code = &mut code[place - base];
                let number = ((*code & !NEW) >> SECTION_BIT) as usize;
                let near = self.is_near(&self.pair(owner, self.partners[place] as usize, *code));
                count[number] += usize::from(near);
                if *code & LISTED != 0 {
                    if near {
                        if read[number] != write[number] {
                            sections[number].relocate(read[number], write[number]);
                        }
                        write[number] += 1;
                    } else {
                        *code &= !LISTED;
                    }
                    read[number] += 1;
                } else if near {
                    *code |= NEW;
                }
            }
        }
        for (number, section) in sections.iter_mut().enumerate().filter(|(_, s)| s.partners != Partners::Wall) {
            section.resize(write[number]);
            section.resize(count[number]);
        }
        for owner in self.owners.clone().rev() {
            if write == count {
                break;
            }
            for place in (self.offsets[owner] as usize..self.offsets[owner + 1] as usize).rev() {
                let code = &mut code[place - base];
                let number = ((*code & !NEW) >> SECTION_BIT) as usize;
                if *code & NEW != 0 {
                    let pair = self.pair(owner, self.partners[place] as usize, *code);
                    let section = &mut sections[number];
                    let origin = section.origin;
                    count[number] -= 1;
                    section.set(
                        count[number],
                        (pair.first - origin) as u32,
                        (pair.second - origin) as u32,
                        shift::encode(pair.shift),
                    );
                    *code = *code & !NEW | LISTED;
                } else if *code & LISTED != 0 {
                    count[number] -= 1;
                    write[number] -= 1;
                    if write[number] != count[number] {
                        sections[number].relocate(write[number], count[number]);
                    }
                }
            }
        }
    }
}

/// Look-up of memory rows by identity: the rows of each local particle that is the first of a contact.
struct Rows<'a> {
    memory: &'a ContactMemory,
    offsets: Vec<u32>,
    order: Vec<u32>,
}

impl<'a> Rows<'a> {
    fn new(memory: &'a ContactMemory, particles: &Particles) -> Self {
        let local: FxHashMap<u32, u32> = (0..).zip(&particles.id).map(|(local, id)| (*id, local)).collect();
        let first: Vec<Option<u32>> = memory.keys.iter().map(|key| local.get(&key.low).copied()).collect();
        let mut offsets = vec![0_u32; particles.len() + 2];
        for place in first.iter().flatten() {
            offsets[*place as usize + 2] += 1;
        }
        for place in 2..offsets.len() {
            offsets[place] += offsets[place - 1];
        }
        let mut rows = vec![0; memory.keys.len()];
        for (row, place) in first.iter().enumerate().filter_map(|(row, place)| Some((row, (*place)?))) {
            let slot = &mut offsets[place as usize + 1];
            rows[*slot as usize] = row as u32;
            *slot += 1;
        }
        Self { memory, offsets, order: rows }
    }

    fn find(&self, first: usize, key: &ContactKey) -> Option<&'a [f64]> {
        let range = self.offsets[first] as usize..self.offsets[first + 1] as usize;
        let row = self.order[range].iter().find(|row| self.memory.keys[**row as usize] == *key)?;
        Some(self.memory.row(*row as usize))
    }
}

const _: () = assert!(PARTNERS.len() == 4, "a section's number within its strip has its place in the candidate's code");
