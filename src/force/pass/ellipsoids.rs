//! The loop around the laws where there are ellipsoids: geometry a block at a time, then the law, then lines
//! with both torques.

use super::{BodyData, Excess, Job, LEDGER_STRIDE, LawPass, PassInput, RECORDS_AHEAD, excess_of};
use crate::contact::section::{BLOCK, CacheLine, Partners, Section};
use crate::force::composition::MAX_MEMORY;
use crate::force::ellipsoid::touch::{self, EllipsoidTouch, Surroundings, TouchBlock};
use crate::force::lane::{Lane, add, cross, dot, is_far, prefetch, scale, sub};
#[cfg(target_arch = "x86_64")]
use crate::force::lane::{avx2::F64x4, avx512::F64x8};
use crate::force::law::{Column, ContactLaw};
use crate::force::observe::Observed;
use crate::force::simd::Simd;
use crate::state::particles::RECORD;
use std::ops::Range;

/// The stored normal, behind the law's own memory: where the search for the common normal starts in the next step.
pub fn normal_columns() -> impl Iterator<Item = Column> {
    ["x", "y", "z"].into_iter().map(|axis| Column { name: format!("contact_normal_{axis}"), unit: "1" })
}

impl<C: ContactLaw> LawPass<C> {
    pub(super) fn run_ellipsoids(&self, job: Job) -> Excess {
        if job.section.partners == Partners::Wall {
            return self.ellipsoid_walls(job);
        }
        match job.input.simd {
            // SAFETY: a level is chosen only if the processor has it (`Simd::is_available`).
            #[cfg(target_arch = "x86_64")]
            Simd::Avx512 => unsafe { self.ellipsoids_avx512(job) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Simd::Avx2 => unsafe { self.ellipsoids_avx2(job) },
            _ => self.ellipsoids::<f64>(job),
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn ellipsoids_avx2(&self, job: Job) -> Excess {
        self.ellipsoids::<F64x4>(job)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512vl")]
    fn ellipsoids_avx512(&self, job: Job) -> Excess {
        self.ellipsoids::<F64x8>(job)
    }

    fn take(&self, touches: &mut TouchBlock, input: &PassInput, bodies: BodyData, section: &Section, block: usize) {
        let range = if C::LASTS { self.law.range() } else { 0.0 };
        let surroundings = Surroundings { motion: input.motion, range, simd: input.simd };
        touches.take(&surroundings, bodies.records, bodies.shapes, section, block, C::MEMORY);
    }

    #[inline(always)]
    fn ellipsoids<L: Lane>(&self, job: Job) -> Excess {
        let Job { input, bodies, section, blocks, lines, .. } = job;
        let mut excess = None;
        let limit = L::splat(input.max_overlap_fraction);
        let start = blocks.start * BLOCK;
        section.hints.resize(section.blocks(), [CacheLine([0.0; BLOCK]); 3]);
        let mut touches = TouchBlock::EMPTY;
        let far = is_far(bodies.records);
        for block in blocks {
            let ahead = (block + RECORDS_AHEAD) * BLOCK..(block + RECORDS_AHEAD + 1) * BLOCK;
            if far && let (Some(first), Some(second)) = (section.first.get(ahead.clone()), section.second.get(ahead)) {
                for (first, second) in first.iter().zip(second) {
                    let body = (*first).max(*second) as usize / RECORD;
                    prefetch(bodies.records, body, 1);
                    prefetch(bodies.shapes, body, 1);
                }
            }
            self.take(&mut touches, input, bodies, section, block);
            section.hints[block] = touches.normals();
            let memory = &mut section.memory[block * section.columns..(block + 1) * section.columns];
            for lane in (0..BLOCK).step_by(L::WIDTH) {
                let place = block * BLOCK + lane;
                let touch = touches.load::<L>(lane);
                let slot = ((lines.first + place - start) & lines.mask) * input.stride;
                let rows = &mut lines.values[slot..slot + L::WIDTH * input.stride];
                self.ellipsoid_contacts(input, &touch, memory, lane, rows, false);
                let pair = &touch.pair;
                // Written so that NaN counts as a fault.
                let within = (limit * pair.min_radius).at_least(pair.touch.overlap);
                if excess.is_none() && L::any(pair.touching & !within) {
                    excess = first_excess(&touches, input.max_overlap_fraction, block * BLOCK);
                }
            }
        }
        excess
    }

    fn ellipsoid_walls(&self, job: Job) -> Excess {
        let Job { input, bodies, section, blocks, lines, .. } = job;
        let mut excess = None;
        for place in blocks.start * BLOCK..(blocks.end * BLOCK).min(section.count) {
            let slot = (lines.first + place - blocks.start * BLOCK) & lines.mask;
            let rows = &mut lines.values[slot * input.stride..(slot + 1) * input.stride];
            let start = place / BLOCK * section.columns;
            let touch = wall_touch(input, bodies, section, place);
            let memory = &mut section.memory[start..start + section.columns];
            self.ellipsoid_contacts(input, &touch, memory, place % BLOCK, rows, true);
            excess = excess.or_else(|| excess_of(&touch.pair, input.max_overlap_fraction, place));
        }
        excess
    }

    /// Law, memory and output of `L::WIDTH` contacts that begin at `lane` of their block.
    #[inline(always)]
    fn ellipsoid_contacts<L: Lane>(
        &self,
        input: &PassInput,
        touch: &EllipsoidTouch<L>,
        memory: &mut [CacheLine],
        lane: usize,
        rows: &mut [f64],
        wall: bool,
    ) {
        let zero = L::splat(0.0);
        let pair = &touch.pair;
        let alive = self.alive(pair);
        if !L::any(alive) {
            rows.fill(0.0);
            for column in memory {
                zero.store(&mut column.0[lane..]);
            }
            return;
        }
        let mut values = [zero; MAX_MEMORY];
        for column in 0..C::MEMORY {
            values[column] = L::load(&memory[column].0[lane..]);
        }
        let response = self.law.evaluate(&pair.touch, &mut values[..C::MEMORY]);
        for column in 0..C::MEMORY {
            L::select(alive, values[column], zero).store(&mut memory[column].0[lane..]);
        }
        for (column, part) in memory[C::MEMORY..].iter_mut().zip(pair.touch.normal) {
            L::select(alive, part, zero).store(&mut column.0[lane..]);
        }
        let force = sub(response.tangential_force, scale(pair.touch.normal, response.normal_force));
        let first = only(alive, add(cross(touch.arms[0], force), response.moment));
        let second = only(alive, add(cross(touch.arms[1], force), response.moment));
        let force = only(alive, force);
        let stride = input.stride;
        L::scatter([force[0], force[1], force[2], zero], rows, stride, 0);
        L::scatter([first[0], first[1], first[2], zero], rows, stride, 4);
        L::scatter([-second[0], -second[1], -second[2], zero], rows, stride, 8);
        if input.ledger {
            let own = stride - LEDGER_STRIDE;
            let kept = |value: L| L::select(alive, value, zero);
            // As between spheres.
            let work = kept(dot(force, pair.imposed_velocity) * L::splat(input.time_step));
            let (cell, driven) = if wall { (zero, work) } else { (work, zero) };
            let e = &response.energies;
            L::scatter([cell, driven, kept(e.damping), kept(e.viscous)], rows, stride, own);
            L::scatter([kept(e.friction), kept(e.plastic), zero, zero], rows, stride, own + 4);
        }
    }

    pub(super) fn observe_ellipsoids(
        &self,
        input: &PassInput,
        bodies: BodyData,
        section: &Section,
        blocks: Range<usize>,
        observed: &mut Observed,
    ) {
        let line = observed.line;
        let start = blocks.start * BLOCK;
        let mut touches = TouchBlock::EMPTY;
        let walls = section.partners == Partners::Wall;
        for block in blocks {
            if !walls {
                self.take(&mut touches, input, bodies, section, block);
            }
            for place in block * BLOCK..((block + 1) * BLOCK).min(section.count) {
                observed.line = line + place - start;
                let touch =
                    if walls { wall_touch(input, bodies, section, place) } else { touches.load::<f64>(place % BLOCK) };
                self.observe_ellipsoid(&touch, section, place, observed);
            }
        }
    }

    fn observe_ellipsoid(&self, touch: &EllipsoidTouch<f64>, section: &Section, place: usize, observed: &mut Observed) {
        let pair = &touch.pair;
        if !self.alive(pair) {
            observed.no_touch();
            return;
        }
        // With room for the stored normal.
        let mut memory = [0.0; MAX_MEMORY + 3];
        section.read_memory(place, &mut memory);
        let response = self.law.evaluate(&pair.touch, &mut memory[..C::MEMORY]);
        if C::LASTS && !response.joined {
            observed.no_touch();
            return;
        }
        let force = sub(response.tangential_force, scale(pair.touch.normal, response.normal_force));
        let virials = [-dot(touch.arms[0], force), dot(touch.arms[1], force)];
        let wall = (section.partners == Partners::Wall).then(|| section.second[place]);
        observed.touch(section.first_of(place), pair, &response, virials, wall);
    }
}

/// The first contact of a block that overlaps too much or is not a number; `place` is the block's first.
#[cold]
fn first_excess(touches: &TouchBlock, limit: f64, place: usize) -> Excess {
    (0..BLOCK).find_map(|lane| excess_of(&touches.load::<f64>(lane).pair, limit, place + lane))
}

/// A vector where `mask` holds, 0 elsewhere.
#[inline(always)]
fn only<L: Lane>(mask: L::Mask, v: [L; 3]) -> [L; 3] {
    let zero = L::splat(0.0);
    [L::select(mask, v[0], zero), L::select(mask, v[1], zero), L::select(mask, v[2], zero)]
}

fn wall_touch(input: &PassInput, bodies: BodyData, section: &Section, place: usize) -> EllipsoidTouch<f64> {
    let first = section.first_of(place);
    touch::wall(&bodies.records[first], &bodies.shapes[first], section.second[place], input.motion)
}
