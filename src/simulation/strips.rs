//! The contact passes and the motion of one step over the strips of the contact list.

use super::workers;
use crate::contact::ends::Reading;
use crate::contact::list::{CHUNK, ContactList, Run, Strip};
use crate::contact::section::{BLOCK, CacheLine, Partners, Section};
use crate::force::lane::{is_far, prefetch};
use crate::force::observe::{Observation, Observed, Wanted};
use crate::force::pass::{BodyData, Job, LineRing, PairPass, PassInput};
use crate::force::touches::{BATCH, BlockTouches};
use crate::integrate::displacement::StepResult;
use crate::integrate::gather::Lines;
use crate::integrate::leap_frog::{self, Batch, Slice, StepMotion};
use std::ops::Range;

/// Output lines: those kept for the step and one ring per strip.
#[derive(Debug, Clone, Default)]
pub struct LineBuffers {
    /// Numbers per line that hold forces, torques and moments.
    pub width: usize,
    /// Numbers per line, with the ledger's.
    pub stride: usize,
    kept: Vec<CacheLine>,
    rings: Vec<Ring>,
}

/// What the thread of a strip writes and reads again soon.
#[derive(Debug, Clone)]
struct Ring {
    lines: Vec<CacheLine>,
    touches: Box<[BlockTouches; BATCH]>,
    loads: Box<[[f64; 8]; CHUNK]>,
}

impl Default for Ring {
    fn default() -> Self {
        Self { lines: Vec::new(), touches: bytemuck::zeroed_box(), loads: bytemuck::zeroed_box() }
    }
}

impl LineBuffers {
    /// Empty, for lines of this shape.
    #[must_use]
    pub fn new(width: usize, stride: usize) -> Self {
        Self { width, stride, ..Self::default() }
    }

    /// Make room for the lines of a list; what is there is overwritten by the next pass.
    pub fn fit(&mut self, list: &ContactList) {
        let cache_lines = |numbers: usize| numbers.div_ceil(size_of::<CacheLine>() / size_of::<f64>());
        let zero = CacheLine([0.0; BLOCK]);
        self.kept.resize(cache_lines(list.kept * self.stride), zero);
        self.rings.resize_with(list.strips.len(), Ring::default);
        for (ring, strip) in self.rings.iter_mut().zip(&list.strips) {
            ring.lines.resize(cache_lines(strip.room()), zero);
        }
    }
}

/// A contact that cannot be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassFault {
    /// Section.
    pub section: usize,
    /// Place in it.
    pub place: usize,
    /// Overlap over the smaller radius.
    pub overlap_ratio: f64,
}

/// What all strips share in one step.
#[derive(Clone, Copy)]
pub struct Phase<'a> {
    /// One pass per pair of materials.
    pub passes: &'a [PairPass],
    /// For the passes.
    pub input: PassInput<'a>,
    /// Where the passes only observe: take no samples but of contacts that overlap too much.
    pub only_excess: bool,
}

/// Strips with the sections and buffers that belong to them, to be split among threads.
struct Work<'a> {
    strips: &'a [Strip],
    sections: &'a mut [Section],
    /// Number of the first section.
    first_section: usize,
}

impl Work<'_> {
    fn split(self) -> (Self, Self) {
        let middle = self.strips.len() / 2;
        let cut = self.sections.len() / self.strips.len() * middle;
        let (low, high) = self.sections.split_at_mut(cut);
        (
            Self { strips: &self.strips[..middle], sections: low, first_section: self.first_section },
            Self { strips: &self.strips[middle..], sections: high, first_section: self.first_section + cut },
        )
    }
}

impl Phase<'_> {
    fn evaluate(
        &self,
        run: &Run,
        first_section: usize,
        sections: &mut [Section],
        bodies: BodyData,
        lines: LineRing,
        touches: &mut [BlockTouches; BATCH],
    ) -> Option<PassFault> {
        if run.blocks == 0 {
            return None;
        }
        let section = &mut sections[run.section as usize - first_section];
        let blocks = run.block as usize..(run.block + run.blocks) as usize;
        let excess = self.passes[section.pair].run(Job { input: &self.input, bodies, section, blocks, lines, touches });
        excess.map(|(place, overlap_ratio)| PassFault { section: run.section as usize, place, overlap_ratio })
    }

    /// Contacts whose lines are kept, of these partners (neighbours in the order of a strip's sections).
    pub fn kept(
        &self,
        list: &mut ContactList,
        partners: &[Partners],
        bodies: BodyData,
        lines: &mut LineBuffers,
    ) -> Option<PassFault> {
        let ContactList { strips, sections, runs, pairs, kept, .. } = list;
        let values = &mut bytemuck::cast_slice_mut(&mut lines.kept)[..*kept * lines.stride];
        let (low, high) = (partners[0] as usize - 1, partners[partners.len() - 1] as usize);
        let work = Work { strips, sections, first_section: 0 };
        self.kept_strips(work, (&mut lines.rings, values), runs, low * *pairs..high * *pairs, 3 * *pairs, bodies)
    }

    fn kept_strips(
        &self,
        work: Work,
        (rings, lines): (&mut [Ring], &mut [f64]),
        runs: &[Run],
        wanted: Range<usize>,
        per_strip: usize,
        bodies: BodyData,
    ) -> Option<PassFault> {
        let [strip] = work.strips else {
            if work.strips.is_empty() {
                return None;
            }
            let first_line = work.strips[0].kept.start;
            let (low, high) = work.split();
            let (low_lines, high_lines) =
                lines.split_at_mut((high.strips[0].kept.start - first_line) * self.input.stride);
            let (low_runs, high_runs) = runs.split_at(low.strips.len() * per_strip);
            let (low_rings, high_rings) = rings.split_at_mut(low.strips.len());
            let (a, b) = workers::join(
                || self.kept_strips(low, (low_rings, low_lines), low_runs, wanted.clone(), per_strip, bodies),
                || self.kept_strips(high, (high_rings, high_lines), high_runs, wanted.clone(), per_strip, bodies),
            );
            return a.or(b);
        };
        let mut fault = None;
        for run in &runs[wanted] {
            let first = run.line as usize - strip.kept.start;
            let ring = LineRing { values: &mut *lines, first, mask: usize::MAX };
            let touches = &mut rings[0].touches;
            let found = self.evaluate(run, work.first_section, work.sections, bodies, ring, touches);
            fault = fault.or(found);
        }
        fault
    }

    /// Near contacts and motion of the strips in `which`, whose particles `slice` holds.
    pub fn near(
        &self,
        list: &mut ContactList,
        which: Range<usize>,
        slice: Slice,
        lines: &mut LineBuffers,
        motion: &StepMotion,
    ) -> (StepResult, Option<PassFault>) {
        let (per_strip, kept) = (list.per_strip(), list.kept * lines.stride);
        let (list, sections) = list.parts();
        let view =
            View { list, kept: &bytemuck::cast_slice(&lines.kept)[..kept], width: lines.width, stride: lines.stride };
        let work = Work {
            strips: &list.strips[which.clone()],
            first_section: which.start * per_strip,
            sections: &mut sections[which.start * per_strip..which.end * per_strip],
        };
        self.near_strips(work, slice, &mut lines.rings[which], &view, motion)
    }

    fn near_strips(
        &self,
        work: Work,
        mut slice: Slice,
        rings: &mut [Ring],
        view: &View,
        motion: &StepMotion,
    ) -> (StepResult, Option<PassFault>) {
        let [strip] = work.strips else {
            if work.strips.is_empty() {
                return (StepResult::default(), None);
            }
            let (low, high) = work.split();
            let (low_slice, high_slice) = slice.split(high.strips[0].particles.start - low.strips[0].particles.start);
            let (low_rings, high_rings) = rings.split_at_mut(low.strips.len());
            let (mut a, b) = workers::join(
                || self.near_strips(low, low_slice, low_rings, view, motion),
                || self.near_strips(high, high_slice, high_rings, view, motion),
            );
            a.0.absorb(b.0);
            return (a.0, a.1.or(b.1));
        };
        let (mut result, mut fault) = (StepResult::default(), None);
        let number = work.first_section / work.sections.len();
        let Ring { lines: ring, touches, loads } = &mut rings[0];
        let ring: &mut [f64] = bytemuck::cast_slice_mut(ring);
        let (mask, far) = (strip.ring - 1, is_far(slice.record));
        let pairs = strip.near.len() / strip.chunks().max(1);
        for chunk in 0..strip.chunks() {
            let particles = strip.chunk(chunk);
            if far {
                view.ask_for_ends(&particles);
                view.ask_for_lines(strip.kept_reads_of(chunk));
            }
            let from = strip.near.start + chunk * pairs;
            for run in &view.list.runs[from..from + pairs] {
                let lines = LineRing { values: &mut *ring, first: run.line as usize, mask };
                let bodies = BodyData { records: slice.record, shapes: slice.shape };
                let found = self.evaluate(run, work.first_section, work.sections, bodies, lines, touches);
                fault = fault.or(found);
            }
            let lines = Lines {
                width: view.width,
                stride: view.stride,
                buffer: &mut *ring,
                ring: strip.ring,
                kept: view.kept,
                reads: strip.kept_reads_of(chunk),
            };
            let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(strip.particles.len());
            let chunk = view.list.ends_of(number, chunk);
            let batch = Batch { range, chunk, lines, loads, motion };
            leap_frog::advance(&mut slice, batch, &mut result);
        }
        (result, fault)
    }

    /// Look at all contacts without changing anything. `forces`, if not empty, holds one entry per line.
    #[must_use]
    pub fn observe(
        &self,
        list: &ContactList,
        bodies: BodyData,
        owned: usize,
        wanted: Wanted,
        forces: &mut [[f64; 4]],
    ) -> Observation {
        self.observe_runs(&list.runs, list, bodies, owned, wanted, forces)
    }

    fn observe_runs(
        &self,
        runs: &[Run],
        list: &ContactList,
        bodies: BodyData,
        owned: usize,
        wanted: Wanted,
        forces: &mut [[f64; 4]],
    ) -> Observation {
        const GRAIN: u32 = 4096;
        let first_line = runs.first().map_or(0, |run| run.line);
        let end = runs.last().map_or(0, |run| run.line + run.blocks * BLOCK as u32);
        if runs.len() > 1 && end - first_line > GRAIN && list.strips.len() > 1 {
            let (low, high) = runs.split_at(runs.len() / 2);
            let cut = (high[0].line - first_line) as usize;
            let (low_forces, high_forces) = forces.split_at_mut(cut.min(forces.len()));
            let (mut a, b) = workers::join(
                || self.observe_runs(low, list, bodies, owned, wanted, low_forces),
                || self.observe_runs(high, list, bodies, owned, wanted, high_forces),
            );
            a.merge(b);
            return a;
        }
        let mut observed = Observed {
            wanted,
            beyond: self.only_excess.then_some(self.input.max_overlap_fraction),
            owned,
            line: 0,
            observation: Observation::new(wanted),
            forces,
            first_line: first_line as usize,
        };
        let (mut touches, mut memory) = (bytemuck::zeroed_box(), Vec::new());
        for run in runs.iter().filter(|run| run.blocks > 0) {
            let section = &list.sections[run.section as usize];
            observed.line = run.line as usize;
            let blocks = run.block as usize..(run.block + run.blocks) as usize;
            let bodies = bodies.from(section.origin);
            let room = (&mut *touches, &mut memory);
            self.passes[section.pair].observe(&self.input, bodies, section, blocks, room, &mut observed);
        }
        observed.observation
    }
}

/// What the strips read.
struct View<'a> {
    list: Reading<'a>,
    kept: &'a [f64],
    width: usize,
    stride: usize,
}

impl View<'_> {
    /// Ask for what the sums of these particles read beside the lines, so that it is there after their contacts.
    fn ask_for_ends(&self, particles: &Range<usize>) {
        let (offsets, ends) = self.list.arrays();
        let [first, last] = [particles.start, particles.end].map(|particle| offsets[particle] as usize);
        prefetch(ends, first, last - first);
        prefetch(offsets, particles.end, 2 * CHUNK);
    }

    /// Ask for kept lines.
    fn ask_for_lines(&self, lines: &[u32]) {
        for line in lines {
            prefetch(self.kept, *line as usize * self.stride, self.stride);
        }
    }
}
