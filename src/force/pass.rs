//! The loop around the laws, written once and monomorphised per composition and per width of the lanes:
//! records in, one output line per contact out, memory updated in place.

use super::composition::{self, MAX_MEMORY};
use super::geometry::{self, CellMotion, PairTouch};
use super::lane::{Lane, is_far, prefetch};
#[cfg(target_arch = "x86_64")]
use super::lane::{avx2::F64x4, avx512::F64x8};
use super::law::{Column, ContactLaw, LawVisitor, Touch};
use super::observe::Observed;
use super::simd::Simd;
use super::touches::{BATCH, BlockTouches, Content};
use crate::config::PairConfig;
use crate::contact::section::{BLOCK, Partners, Section};
use crate::state::particles::Record;
use crate::state::shape::Shape;
use std::ops::Range;

mod ellipsoids;
mod laws;
mod spheres;

use laws::Laws;

/// Numbers at the end of an output line that the energy ledger takes.
pub const LEDGER_STRIDE: usize = 8;

/// How many blocks ahead records are asked for.
const RECORDS_AHEAD: usize = 16;

/// How many blocks ahead the list and the memory are asked for: the list before the records that it names.
const LIST_AHEAD: usize = 2 * RECORDS_AHEAD;

/// What all passes of a step share.
#[derive(Debug, Clone, Copy)]
pub struct PassInput<'a> {
    /// Cell.
    pub motion: &'a CellMotion,
    /// Numbers per output line: 4 (force), 8 (with one torque for both bodies), 12 (with one for each), then the ledger's.
    pub stride: usize,
    /// Write the ledger's numbers.
    pub ledger: bool,
    /// Largest allowed overlap over the smaller radius.
    pub max_overlap_fraction: f64,
    /// Time since the last evaluation \[s\].
    pub time_step: f64,
    /// Instructions to use.
    pub simd: Simd,
}

/// Where the output lines of some blocks go: line `n` to place `n mod capacity` of the buffer.
#[derive(Debug)]
pub struct LineRing<'a> {
    /// Lines, `stride` numbers each: `{F, 0, T, 0}`, F the force on the first, T the torque on each of two spheres of
    /// equal radii; otherwise `{F, 0, T_first, 0, T_second, 0}`; then the ledger's
    /// `{cell, driven, damping, viscous, friction, plastic, 0, 0}`.
    pub values: &'a mut [f64],
    /// Number of the first block's first line, a multiple of eight.
    pub first: usize,
    /// Capacity less one, all ones in binary; `usize::MAX` for a buffer that never wraps.
    pub mask: usize,
}

/// Owned particles and ghosts as a pass reads them, from a section's origin on.
#[derive(Debug, Clone, Copy)]
pub struct BodyData<'a> {
    /// Records.
    pub records: &'a [Record],
    /// Semi-axes and orientations; empty when every particle of all ranks is a sphere.
    pub shapes: &'a [Shape],
}

impl BodyData<'_> {
    /// From this place on.
    #[must_use]
    pub fn from(&self, origin: usize) -> Self {
        Self { records: &self.records[origin..], shapes: &self.shapes[origin.min(self.shapes.len())..] }
    }
}

/// Some blocks of a section to evaluate.
#[derive(Debug)]
pub struct Job<'a> {
    /// What all passes share.
    pub input: &'a PassInput<'a>,
    /// Owned particles and ghosts from the section's origin on.
    pub bodies: BodyData<'a>,
    /// The section; its memory moves on by one step.
    pub section: &'a mut Section,
    /// Numbers of the blocks.
    pub blocks: Range<usize>,
    /// Where the forces go.
    pub lines: LineRing<'a>,
    /// Room for touches between geometry and law.
    pub touches: &'a mut [BlockTouches; BATCH],
}

/// A contact that overlaps too much or is not a number: its place in the section and overlap ratio.
pub type Excess = Option<(usize, f64)>;

/// The pass of one pair of materials.
pub trait PairPass: Send + Sync {
    /// Recompute what depends on the time step \[s\]; `relaxed`: in the limit of infinitely slow processes.
    fn prepare(&mut self, time_step: f64, relaxed: bool);
    /// Memory columns.
    fn columns(&self) -> Vec<Column>;
    /// Numbers per output line that this law needs.
    fn stride(&self) -> usize;
    /// Tangent stiffness \[N/m\] of a fresh touch of this overlap and effective radius \[m\].
    fn reference_stiffness(&self, overlap: f64, effective_radius: f64) -> f64;
    /// Gap over the effective radius up to which contacts keep their memory; 0 if it ends with the touch.
    fn range(&self) -> f64;
    /// Evaluate some blocks of a section.
    fn run(&self, job: Job) -> Excess;
    /// Look at some blocks of a section without changing anything.
    fn observe(
        &self,
        input: &PassInput,
        bodies: BodyData,
        section: &Section,
        blocks: Range<usize>,
        observed: &mut Observed,
    );
}

/// What the particles of all ranks are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bodies {
    /// Spheres, all of one radius.
    EqualSpheres,
    /// Spheres.
    Spheres,
    /// Ellipsoids, spheres among them.
    Ellipsoids,
}

struct LawPass<C> {
    law: C,
    bodies: Bodies,
}

struct Builder(Bodies);

impl LawVisitor for Builder {
    type Output = Box<dyn PairPass>;
    fn visit<C: ContactLaw>(self, law: C) -> Self::Output {
        Box::new(LawPass { law, bodies: self.0 })
    }
}

/// The pass for a configured pair of materials.
#[must_use]
pub fn build(pair: &PairConfig, bodies: Bodies) -> Box<dyn PairPass> {
    composition::visit(pair, Builder(bodies))
}

impl<C: ContactLaw> PairPass for LawPass<C> {
    fn prepare(&mut self, time_step: f64, relaxed: bool) {
        self.law.prepare(time_step);
        if relaxed {
            self.law.relax();
        }
    }

    fn columns(&self) -> Vec<Column> {
        let mut columns = self.law.columns();
        if self.bodies == Bodies::Ellipsoids {
            columns.extend(ellipsoids::normal_columns());
        }
        columns
    }

    fn stride(&self) -> usize {
        match (self.bodies, C::TANGENTIAL) {
            (Bodies::Ellipsoids, _) => 12,
            _ if C::ROLLING => 12,
            (_, false) => 4,
            (Bodies::Spheres, true) => 12,
            (Bodies::EqualSpheres, true) => 8,
        }
    }

    fn reference_stiffness(&self, overlap: f64, effective_radius: f64) -> f64 {
        let touch = Touch {
            overlap,
            overlap_rate: 0.0,
            effective_radius,
            radius_factor: 1.0,
            overlap_factor: 1.0,
            size: 4.0 * effective_radius,
            effective_mass: 1.0,
            normal: [0.0, 0.0, 1.0],
            slip_velocity: [0.0; 3],
            relative_spin: [0.0; 3],
            spin_about_normal: 0.0,
        };
        let mut memory = [0.0; MAX_MEMORY];
        self.law.evaluate(&touch, &mut memory[..C::MEMORY]).stiffness
    }

    fn range(&self) -> f64 {
        if C::LASTS { self.law.range() } else { 0.0 }
    }

    fn run(&self, job: Job) -> Excess {
        if self.bodies == Bodies::Ellipsoids {
            return self.run_ellipsoids(job);
        }
        if job.section.partners == Partners::Wall {
            return self.walls(job);
        }
        let Job { input, bodies, section, blocks, mut lines, touches } = job;
        let records = bodies.records;
        let content = Content { rolling: C::ROLLING, ledger: input.ledger, range: self.range() };
        let far = is_far(records);
        let equal = self.bodies == Bodies::EqualSpheres;
        if equal && let Some(record) = records.first() {
            touches.iter_mut().for_each(|touches| touches.put_radius(record.radius));
        }
        let geometry = if equal { spheres::geometry::<true> } else { spheres::geometry::<false> };
        let mut excess = None;
        for start in blocks.clone().step_by(BATCH) {
            let blocks = start..(start + BATCH).min(blocks.end);
            if far {
                let ahead = start + LIST_AHEAD;
                prefetch(&section.memory, ahead * C::MEMORY, BATCH * C::MEMORY);
                prefetch(&section.first, ahead * BLOCK, BATCH * BLOCK);
                prefetch(&section.second, ahead * BLOCK, BATCH * BLOCK);
                prefetch(&section.shift, ahead * BLOCK, BATCH * BLOCK);
            }
            let found = geometry(input, records, section, blocks.clone(), content, touches);
            excess = excess.or(found);
            let laws = Laws { law: &self.law, stride: input.stride, time_step: input.time_step, equal };
            let memory = &mut section.memory[blocks.start * C::MEMORY..blocks.end * C::MEMORY];
            let touches = &mut touches[..blocks.len()];
            match (input.simd, input.ledger) {
                // SAFETY: a level is chosen only if the processor has it (`Simd::is_available`).
                #[cfg(target_arch = "x86_64")]
                (Simd::Avx512, false) => unsafe { laws.avx512::<false>(touches, memory, &mut lines) },
                // SAFETY: as above.
                #[cfg(target_arch = "x86_64")]
                (Simd::Avx512, true) => unsafe { laws.avx512::<true>(touches, memory, &mut lines) },
                // SAFETY: as above.
                #[cfg(target_arch = "x86_64")]
                (Simd::Avx2, false) => unsafe { laws.avx2::<false>(touches, memory, &mut lines) },
                // SAFETY: as above.
                #[cfg(target_arch = "x86_64")]
                (Simd::Avx2, true) => unsafe { laws.avx2::<true>(touches, memory, &mut lines) },
                (_, false) => laws.blocks::<f64, false>(touches, memory, &mut lines),
                (_, true) => laws.blocks::<f64, true>(touches, memory, &mut lines),
            }
            lines.first += blocks.len() * BLOCK;
        }
        excess
    }

    fn observe(
        &self,
        input: &PassInput,
        bodies: BodyData,
        section: &Section,
        blocks: Range<usize>,
        observed: &mut Observed,
    ) {
        if self.bodies == Bodies::Ellipsoids {
            self.observe_ellipsoids(input, bodies, section, blocks, observed);
            return;
        }
        let records = bodies.records;
        if !observed.single() && section.partners != Partners::Wall {
            let [stiffness, ratio] = match input.simd {
                // SAFETY: as in `run`.
                #[cfg(target_arch = "x86_64")]
                Simd::Avx2 => unsafe { self.peaks_avx2(input, records, section, blocks) },
                // SAFETY: as in `run`.
                #[cfg(target_arch = "x86_64")]
                Simd::Avx512 => unsafe { self.peaks_avx512(input, records, section, blocks) },
                _ => self.peaks::<f64>(input, records, section, blocks),
            };
            observed.observation.raise(stiffness, ratio);
            return;
        }
        let line = observed.line;
        for place in blocks.start * BLOCK..(blocks.end * BLOCK).min(section.count) {
            observed.line = line + place - blocks.start * BLOCK;
            self.observe_one(input, records, section, place, observed);
        }
    }
}

impl<C: ContactLaw> LawPass<C> {
    /// Lanes whose law is asked.
    #[inline(always)]
    fn alive<L: Lane>(&self, pair: &PairTouch<L>) -> L::Mask {
        pair.alive(if C::LASTS { self.law.range() } else { 0.0 })
    }

    fn walls(&self, job: Job) -> Excess {
        let Job { input, bodies, section, blocks, lines, .. } = job;
        let records = bodies.records;
        let laws = Laws { law: &self.law, stride: input.stride, time_step: input.time_step, equal: false };
        let mut excess = None;
        for place in blocks.start * BLOCK..(blocks.end * BLOCK).min(section.count) {
            let slot = (lines.first + place - blocks.start * BLOCK) & lines.mask;
            let rows = &mut lines.values[slot * input.stride..(slot + 1) * input.stride];
            let start = place / BLOCK * C::MEMORY;
            let pair = geometry::wall(&records[section.first_of(place)], section.second[place], input.motion);
            let memory = &mut section.memory[start..start + C::MEMORY];
            let lane = place % BLOCK;
            if input.ledger {
                laws.wall::<true>(&pair, memory, lane, rows);
            } else {
                laws.wall::<false>(&pair, memory, lane, rows);
            }
            excess = excess.or_else(|| excess_of(&pair, input.max_overlap_fraction, place));
        }
        excess
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn peaks_avx2(&self, input: &PassInput, records: &[Record], section: &Section, blocks: Range<usize>) -> [f64; 2] {
        self.peaks::<F64x4>(input, records, section, blocks)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512vl")]
    fn peaks_avx512(&self, input: &PassInput, records: &[Record], section: &Section, blocks: Range<usize>) -> [f64; 2] {
        self.peaks::<F64x8>(input, records, section, blocks)
    }

    /// Largest tangent stiffness and largest overlap over the smaller radius.
    #[inline(always)]
    fn peaks<L: Lane>(
        &self,
        input: &PassInput,
        records: &[Record],
        section: &Section,
        blocks: Range<usize>,
    ) -> [f64; 2] {
        let zero = L::splat(0.0);
        let (mut stiffness, mut ratio) = (zero, zero);
        for place in (blocks.start * BLOCK..blocks.end * BLOCK).step_by(L::WIDTH) {
            let lanes = place..place + L::WIDTH;
            let pairs = [&section.first[lanes.clone()], &section.second[lanes.clone()]];
            let pair = geometry::spheres::<L>(records, pairs, &section.shift[lanes], input.motion);
            let mut values = [zero; MAX_MEMORY];
            let memory = &section.memory[place / BLOCK * C::MEMORY..(place / BLOCK + 1) * C::MEMORY];
            for column in 0..C::MEMORY {
                values[column] = L::load(&memory[column].0[place % BLOCK..]);
            }
            let response = self.law.evaluate(&pair.touch, &mut values[..C::MEMORY]);
            stiffness = L::select(self.alive(&pair), response.stiffness, zero).max(stiffness);
            ratio = L::select(pair.touching, pair.touch.overlap / pair.min_radius, zero).max(ratio);
        }
        let mut lanes = [0.0; 2 * BLOCK];
        stiffness.store(&mut lanes);
        ratio.store(&mut lanes[BLOCK..]);
        let largest = |values: &[f64]| values.iter().fold(0.0, |m, v| if *v > m { *v } else { m });
        [largest(&lanes[..BLOCK]), largest(&lanes[BLOCK..])]
    }

    fn observe_one(
        &self,
        input: &PassInput,
        records: &[Record],
        section: &Section,
        place: usize,
        observed: &mut Observed,
    ) {
        let first = &section.first[place..=place];
        let wall = (section.partners == Partners::Wall).then(|| section.second[place]);
        let pair = if let Some(wall) = wall {
            geometry::wall(&records[section.first_of(place) - section.origin], wall, input.motion)
        } else {
            let pair = [first, &section.second[place..=place]];
            geometry::spheres(records, pair, &section.shift[place..=place], input.motion)
        };
        if !self.alive(&pair) {
            observed.no_touch();
            return;
        }
        let mut memory = [0.0; MAX_MEMORY];
        section.read_memory(place, &mut memory);
        let response = self.law.evaluate(&pair.touch, &mut memory[..C::MEMORY]);
        if C::LASTS && !response.joined {
            observed.no_touch();
            return;
        }
        let virials = [pair.arm_first * response.normal_force, pair.arm_second * response.normal_force];
        observed.touch(section.first_of(place), &pair, &response, virials, wall);
    }
}

/// Whether a contact overlaps too much or is not a number.
fn excess_of(pair: &PairTouch<f64>, limit: f64, place: usize) -> Excess {
    let (overlap, radius) = (pair.touch.overlap, pair.min_radius);
    // Written so that NaN counts as a fault.
    let within = overlap <= limit * radius;
    (pair.touching && !within).then_some((place, overlap / radius))
}

#[cfg(test)]
mod tests;
