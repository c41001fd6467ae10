//! When the lists are stale, and how they are made anew. Two lists: the Verlet list with the whole
//! skin, and inside it the contact list with a thin one.

use super::{Model, Simulation, Stage};
use crate::contact::build::is_within;
use crate::contact::ends::End;
use crate::contact::list::ContactList;
use crate::error::{Error, Result};
use crate::exchange::{HaloPlan, MigrationSetting, migrate};
use crate::force::pass::PairPass;
use crate::integrate::displacement::{Displacement, Watch};
use crate::integrate::leap_frog::{Reference, StepMotion};
use crate::neighbour::tiles;
use crate::neighbour::verlet::Region;
use crate::state::ContactMemory;

/// Skin of the contact list as a fraction of the largest diameter.
const INNER_SKIN: f64 = 0.005;

/// Gap over radius within which rounding may decide whether spheres touch.
const ROUNDING: f64 = 1e-9;

/// With fewer particles per thread threads cost more than they give.
const MIN_PARTICLES_PER_STRIP: usize = 1000;

/// Up to so many particles per thread each thread gets two strips, so that one which is held up leaves work to the others
/// (+9 % at 10⁴ on two busy cores). With more the contacts between strips cost what that gains (−5 % at 10⁵).
const FEW_PARTICLES_PER_THREAD: usize = 15_000;

/// How much motion the lists still bear. Results never depend on it: it only has to be safe.
#[derive(Debug, Clone, Copy, Default)]
pub struct ListBudget {
    /// Cell sides when the contact list was made \[m\].
    pub reference_sides: [f64; 3],
    /// Cell sides when the Verlet list was made \[m\].
    verlet_sides: [f64; 3],
    /// Sum over earlier contact lists of the bound on displacements during each \[m\].
    displaced: f64,
    /// Displacement since the contact list was made.
    pub displacement: Displacement,
}

/// What motion has made stale.
enum Stale {
    Nothing,
    ContactList,
    VerletList,
}

impl Model {
    /// Skin of the contact list \[m\].
    #[must_use]
    pub fn inner_skin(&self) -> f64 {
        let fraction = 0.25 * self.config.parallel.skin;
        let skin = 2.0 * self.max_radius * if INNER_SKIN < fraction { INNER_SKIN } else { fraction };
        let reach = self.memory_reach();
        if reach > skin { reach } else { skin }
    }

    /// Largest gap over which a contact may keep its memory, with room for rounding \[m\]. No effective radius
    /// is above the largest radius.
    pub(super) fn memory_reach(&self) -> f64 {
        let range = self.passes.iter().map(PairPass::range).fold(0.0, |m, r| if r > m { r } else { m });
        1.01 * range * self.max_radius
    }

    /// Skin of the Verlet list \[m\].
    #[must_use]
    pub fn outer_skin(&self) -> f64 {
        let skin = 2.0 * self.max_radius * self.config.parallel.skin;
        // Some room to move beside what the contacts' memory needs.
        let least = 2.0 * self.memory_reach();
        if least > skin { least } else { skin }
    }
}

impl Simulation {
    /// Make anew what the motion since the last time has made stale; `farthest` is the largest
    /// [`StepResult::farthest`](crate::integrate::displacement::StepResult::farthest) of all ranks.
    pub(super) fn refresh_lists(&mut self, motion: &StepMotion, farthest: f64) -> Result<()> {
        self.budget.displacement.follow(motion, farthest);
        let bound = self.budget.displacement.bound;
        match self.stale(bound) {
            Stale::Nothing => {}
            Stale::ContactList => {
                self.timers.start(Stage::Neighbours);
                self.update_ghosts();
                self.budget.displaced = self.displaced(bound);
                self.rebuild_contacts()?;
                self.timers.contact_rebuilds += 1;
                self.timers.stop();
            }
            Stale::VerletList => {
                self.timers.start(Stage::Neighbours);
                self.update_ghosts();
                let memory = self.model.lists.collect_memory(&self.contacts, &self.particles, |_, _| true);
                self.rebuild_all(memory)?;
                self.timers.verlet_rebuilds += 1;
                self.timers.stop();
            }
        }
        // So close that the next step needs to be measured, unless particles are accelerated to twice their speed.
        let Displacement { bound, step, .. } = self.budget.displacement;
        let near = !matches!(self.stale(bound + 2.0 * step), Stale::Nothing);
        self.budget.displacement.watch = if near { Watch::Displacements } else { Watch::Speeds };
        Ok(())
    }

    /// The memory of contacts whose lower id is owned. What has parted in the last step keeps its memory until the laws are
    /// asked again, if it is still listed; it is left out, as the state must not depend on when lists were made.
    pub(super) fn memory_of_state(&self) -> ContactMemory {
        let (particles, sides) = (&self.particles, self.global.sides);
        let (lasting, touching) = (self.model.memory_reach(), ROUNDING * self.model.max_radius);
        let reach = if lasting > touching { lasting } else { touching };
        self.model.lists.collect_memory(&self.contacts, particles, |section, place| {
            section.first_of(place) < particles.owned && is_within(section, place, particles, sides, reach)
        })
    }

    /// Send and receive ghosts, and adjust the contacts of ghosts that wrapped.
    pub(super) fn update_ghosts(&mut self) {
        let content = self.model.ghosts();
        self.halo.update(&self.comm, &mut self.particles, content, &mut self.ghost_wraps, |_| ());
        take_ghost_wraps(&self.ghost_wraps, &mut self.contacts, &mut self.reference);
    }

    /// What is stale if no particle has moved farther than `displacement` since the contact list was made, relative to
    /// the affine motion of the cell.
    fn stale(&self, displacement: f64) -> Stale {
        let largest_sum = 2.0 * self.model.max_radius;
        // A pair farther than sum + skin then is farther than sum now, if
        // low·(sum + skin) − 2·displacement > sum, for any sum up to the largest. A small part of the skin
        // is kept for rounding.
        let room =
            |low: f64, skin: f64| low * skin - (if low < 1.0 { 1.0 - low } else { 0.0 }) * largest_sum - 1e-6 * skin;
        let (outer_low, _) = self.stretch(self.budget.verlet_sides);
        let (inner_low, _) = self.stretch(self.budget.reference_sides);
        let outer_room = room(outer_low, self.model.outer_skin()) - self.model.inner_skin();
        // Written so that with NaN everything is stale.
        let outer_holds = 2.0 * self.displaced(displacement) < outer_room;
        let inner_holds = 2.0 * displacement < room(inner_low, self.model.inner_skin());
        match (outer_holds, inner_holds) {
            (true, true) => Stale::Nothing,
            (true, false) => Stale::ContactList,
            (false, _) => Stale::VerletList,
        }
    }

    /// The displacement since the Verlet list was made, given the one since the contact list.
    fn displaced(&self, displacement: f64) -> f64 {
        let (_, high) = self.stretch(self.budget.reference_sides);
        self.budget.displaced * high + displacement
    }

    /// Smallest factor by which sides have grown, and the largest or 1.
    fn stretch(&self, from: [f64; 3]) -> (f64, f64) {
        let factors = [0, 1, 2].map(|k| self.global.sides[k] / from[k]);
        let low = factors.iter().fold(f64::INFINITY, |m, f| if *f < m { *f } else { m });
        let high = factors.iter().fold(1.0_f64, |m, f| if *f > m { *f } else { m });
        (low, high)
    }

    /// Particles to their owners, ghosts, Verlet list, contact list. `memory` holds at least the contacts
    /// of the particles that are here.
    pub(super) fn rebuild_all(&mut self, mut memory: ContactMemory) -> Result<()> {
        let sides = self.global.sides;
        self.contacts.cut(Vec::new(), 0, &self.model.lists.columns);
        self.particles.drop_ghosts();
        let setting = MigrationSetting {
            decomposition: &self.decomposition,
            species: &self.model.species,
            sides,
            extras: self.model.extras(),
            particles_total: self.global.particles,
            step: self.global.step,
        };
        migrate(&self.comm, &setting, &mut self.particles, &mut memory)?;
        let (low, high) = self.decomposition.bounds(self.comm.rank());
        let region = Region {
            sides,
            periodic: self.periodic(),
            low: [0, 1, 2].map(|k| low[k] * sides[k]),
            high: [0, 1, 2].map(|k| high[k] * sides[k]),
            max_radius: self.model.max_radius,
            skin: self.model.outer_skin(),
        };
        let reach = region.max_radius + region.skin;
        // Particles that other ranks see come last, each part in order of space.
        let seen =
            HaloPlan::seen_elsewhere(&self.comm, &self.decomposition, &self.particles, sides, region.periodic, reach);
        let (mut order, mut border): (Vec<u32>, Vec<u32>) =
            (0..self.particles.owned as u32).partition(|particle| !seen[*particle as usize]);
        let inner = order.len();
        let mut strips = tiles::arrange(&self.particles.record, &mut order, self.parts(inner), region.reach());
        let inner_strips = strips.len();
        let parts = self.parts(border.len());
        let outer = tiles::arrange(&self.particles.record, &mut border, parts, region.reach());
        strips.extend(outer.into_iter().map(|strip| strip.start + inner..strip.end + inner));
        order.append(&mut border);
        self.particles.reorder(&order);
        self.halo =
            HaloPlan::build(&self.comm, &self.decomposition, &mut self.particles, sides, region.periodic, reach)?;
        self.candidates = region.candidates(&self.particles, &strips);
        self.reference.reset(&self.particles);
        self.model.lists.start(&mut self.contacts, &self.particles, &mut self.candidates, strips, inner_strips);
        self.budget = ListBudget { reference_sides: sides, verlet_sides: sides, displaced: 0.0, ..self.budget };
        self.rebuild_contacts()?;
        self.model.lists.restore(&mut self.contacts, &self.particles, &memory);
        Ok(())
    }

    /// Parts for so many particles, one or two per thread if that pays.
    fn parts(&self, count: usize) -> usize {
        match (self.threads, count / self.threads) {
            (1, _) | (_, ..MIN_PARTICLES_PER_STRIP) => 1,
            (threads, particles) if (2 * MIN_PARTICLES_PER_STRIP..FEW_PARTICLES_PER_THREAD).contains(&particles) => {
                2 * threads
            }
            (threads, _) => threads,
        }
    }

    fn rebuild_contacts(&mut self) -> Result<()> {
        let sides = self.global.sides;
        self.budget.reference_sides = sides;
        self.budget.displacement = Displacement { bound: 0.0, ..self.budget.displacement };
        let crossed = &self.reference.crossed;
        self.model.lists.refresh(&mut self.contacts, &self.particles, sides, &mut self.candidates, crossed);
        let mut largest = [self.contacts.largest_number() as f64, self.contacts.lines as f64];
        self.comm.max_f64(&mut largest);
        if largest[0] > End::MAX as f64 {
            return Err(Error::Input(format!(
                "{} contacts listed on one rank are more than it can number; start more ranks",
                largest[1]
            )));
        }
        self.lines.fit(&self.contacts);
        self.reference.take(&self.particles);
        Ok(())
    }
}

/// Adjust contacts and counters of ghosts that crossed a periodic face.
pub(super) fn take_ghost_wraps(wraps: &[(u32, [i32; 3])], contacts: &mut ContactList, reference: &mut Reference) {
    for (ghost, wraps) in wraps {
        contacts.apply_wrap(*ghost as usize, *wraps);
        reference.cross(*ghost as usize, *wraps);
    }
}
