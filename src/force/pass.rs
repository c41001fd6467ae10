//! The loop around the laws, written once and monomorphised per composition: records in, one output
//! line per contact out, memory updated in place.

use super::composition::{self, MAX_MEMORY};
use super::geometry::{self, CellMotion, PairTouch};
use super::lane::{cross, dot, scale, sub};
use super::law::{Column, ContactLaw, ContactResponse, LawVisitor, Touch};
use super::observe::{CONTACT_LEDGER, Observation, Sample, Wanted};
use crate::config::PairConfig;
use crate::contact::list::{BLOCK, Partners, Section};
use crate::state::particles::Record;

/// Contacts that one thread takes at least.
const GRAIN: usize = 2048;

/// What the pass reads beside the section itself.
#[derive(Debug, Clone, Copy)]
pub struct PassInput<'a> {
    /// Records of owned particles and ghosts.
    pub records: &'a [Record],
    /// Number of owned particles.
    pub owned: usize,
    /// Cell.
    pub motion: &'a CellMotion,
    /// Numbers per output line: 4 (forces), 8 (with torques), 12 (with rolling moments).
    pub stride: usize,
    /// Largest allowed overlap over the smaller radius.
    pub max_overlap_fraction: f64,
    /// Time since the last evaluation \[s\].
    pub time_step: f64,
    /// What to observe; `None`: the plain pass.
    pub wanted: Option<Wanted>,
    /// Split the work over the threads of the current pool.
    pub parallel: bool,
}

/// What the pass writes for a section.
#[derive(Debug)]
pub struct PassOutput<'a> {
    /// Output lines of the section, `stride` numbers each: `{F, arm_first, n×F, arm_second, M, 0}`, F
    /// the force on the first.
    pub lines: &'a mut [f64],
    /// Ledger lines, [`CONTACT_LEDGER`] numbers each; empty unless wanted.
    pub ledger: &'a mut [f64],
}

/// What a pass brings back.
#[derive(Debug, Default)]
pub struct PassResult {
    /// Observation, if wanted.
    pub observation: Option<Observation>,
    /// Place and overlap ratio of a contact that overlaps too much or is not a number.
    pub fault: Option<(usize, f64)>,
}

impl PassResult {
    fn merge(mut self, other: Self) -> Self {
        match (&mut self.observation, other.observation) {
            (Some(mine), Some(theirs)) => mine.merge(theirs),
            (mine @ None, theirs) => *mine = theirs,
            _ => {}
        }
        self.fault = self.fault.or(other.fault);
        self
    }
}

/// The pass of one pair of materials.
pub trait PairPass: Send + Sync {
    /// Recompute what depends on the time step \[s\].
    fn prepare(&mut self, time_step: f64);
    /// Memory columns.
    fn columns(&self) -> Vec<Column>;
    /// Numbers per output line that this law needs.
    fn stride(&self) -> usize;
    /// Tangent stiffness \[N/m\] of a fresh touch of this overlap and effective radius \[m\].
    fn reference_stiffness(&self, overlap: f64, effective_radius: f64) -> f64;
    /// Evaluate all contacts of a section.
    fn run(&self, input: &PassInput, section: &mut Section, output: PassOutput) -> PassResult;
}

struct LawPass<C> {
    law: C,
}

struct Builder;

impl LawVisitor for Builder {
    type Output = Box<dyn PairPass>;
    fn visit<C: ContactLaw>(self, law: C) -> Self::Output {
        Box::new(LawPass { law })
    }
}

/// The pass for a configured pair of materials.
#[must_use]
pub fn build(pair: &PairConfig) -> Box<dyn PairPass> {
    composition::visit(pair, Builder)
}

/// A run of whole blocks of a section, so that threads can share one.
struct Slice<'a> {
    place: usize,
    count: usize,
    first: &'a [u32],
    second: &'a [u32],
    shift: &'a [u16],
    memory: &'a mut [f64],
    lines: &'a mut [f64],
    ledger: &'a mut [f64],
}

impl<C: ContactLaw> PairPass for LawPass<C> {
    fn prepare(&mut self, time_step: f64) {
        self.law.prepare(time_step);
    }

    fn columns(&self) -> Vec<Column> {
        self.law.columns()
    }

    fn stride(&self) -> usize {
        match (C::TANGENTIAL, C::ROLLING) {
            (_, true) => 12,
            (true, false) => 8,
            (false, false) => 4,
        }
    }

    fn reference_stiffness(&self, overlap: f64, effective_radius: f64) -> f64 {
        let touch = Touch {
            overlap,
            overlap_rate: 0.0,
            effective_radius,
            effective_mass: 1.0,
            normal: [0.0, 0.0, 1.0],
            slip_velocity: [0.0; 3],
            relative_spin: [0.0; 3],
            mean_spin: [0.0; 3],
        };
        let mut memory = [0.0; MAX_MEMORY];
        self.law.evaluate(&touch, &mut memory[..C::MEMORY]).stiffness
    }

    fn run(&self, input: &PassInput, section: &mut Section, output: PassOutput) -> PassResult {
        let slice = Slice {
            place: 0,
            count: section.count,
            first: &section.first,
            second: &section.second,
            shift: &section.shift,
            memory: &mut section.memory,
            lines: output.lines,
            ledger: output.ledger,
        };
        let (base, partners) = (section.base, section.partners);
        match (input.wanted.is_some(), partners == Partners::Wall) {
            (false, false) => self.split::<false, false>(input, base, slice),
            (false, true) => self.split::<false, true>(input, base, slice),
            (true, false) => self.split::<true, false>(input, base, slice),
            (true, true) => self.split::<true, true>(input, base, slice),
        }
    }
}

impl<C: ContactLaw> LawPass<C> {
    fn split<const OBSERVE: bool, const WALL: bool>(&self, input: &PassInput, base: usize, slice: Slice) -> PassResult {
        if !input.parallel || slice.count <= GRAIN {
            return self.contacts::<OBSERVE, WALL>(input, base, slice);
        }
        let middle = (slice.count / 2).next_multiple_of(BLOCK);
        let (first_low, first_high) = slice.first.split_at(middle);
        let (second_low, second_high) = slice.second.split_at(middle);
        let (shift_low, shift_high) = slice.shift.split_at(middle);
        let (memory_low, memory_high) = slice.memory.split_at_mut(middle * C::MEMORY);
        let (lines_low, lines_high) = slice.lines.split_at_mut(middle * input.stride);
        let cut = if slice.ledger.is_empty() { 0 } else { middle * CONTACT_LEDGER };
        let (ledger_low, ledger_high) = slice.ledger.split_at_mut(cut);
        let low = Slice {
            place: slice.place,
            count: middle,
            first: first_low,
            second: second_low,
            shift: shift_low,
            memory: memory_low,
            lines: lines_low,
            ledger: ledger_low,
        };
        let high = Slice {
            place: slice.place + middle,
            count: slice.count - middle,
            first: first_high,
            second: second_high,
            shift: shift_high,
            memory: memory_high,
            lines: lines_high,
            ledger: ledger_high,
        };
        let (a, b) = rayon::join(
            || self.split::<OBSERVE, WALL>(input, base, low),
            || self.split::<OBSERVE, WALL>(input, base, high),
        );
        a.merge(b)
    }

    fn contacts<const OBSERVE: bool, const WALL: bool>(
        &self,
        input: &PassInput,
        base: usize,
        slice: Slice,
    ) -> PassResult {
        let mut result = PassResult::default();
        let wanted = input.wanted.unwrap_or_default();
        let mut observation = Observation::new(wanted);
        // Outside the loop: only the law's own columns are ever set.
        let mut memory = [0.0; MAX_MEMORY];
        for place in 0..slice.count {
            let line = &mut slice.lines[place * input.stride..(place + 1) * input.stride];
            let start = place / BLOCK * BLOCK * C::MEMORY + place % BLOCK;
            let a = &input.records[slice.first[place] as usize];
            let touching = if WALL {
                geometry::wall(a, slice.second[place], input.motion)
            } else {
                let b = &input.records[slice.second[place] as usize];
                geometry::spheres(a, b, slice.shift[place], input.motion)
            };
            let Some(pair) = touching else {
                line.fill(0.0);
                for column in 0..C::MEMORY {
                    slice.memory[start + column * BLOCK] = 0.0;
                }
                if OBSERVE && wanted.ledger {
                    slice.ledger[place * CONTACT_LEDGER..(place + 1) * CONTACT_LEDGER].fill(0.0);
                }
                continue;
            };
            // Written so that NaN counts as a fault.
            let within = pair.touch.overlap <= input.max_overlap_fraction * pair.min_radius;
            if !within && result.fault.is_none() {
                result.fault = Some((slice.place + place, pair.touch.overlap / pair.min_radius));
            }
            for (column, value) in memory[..C::MEMORY].iter_mut().enumerate() {
                *value = slice.memory[start + column * BLOCK];
            }
            let response = self.law.evaluate(&pair.touch, &mut memory[..C::MEMORY]);
            for (column, value) in memory[..C::MEMORY].iter().enumerate() {
                slice.memory[start + column * BLOCK] = *value;
            }
            let force = sub(response.tangential_force, scale(pair.touch.normal, response.normal_force));
            write_line(line, &pair, &response, force);
            if OBSERVE {
                if wanted.ledger {
                    let entry = &mut slice.ledger[place * CONTACT_LEDGER..(place + 1) * CONTACT_LEDGER];
                    write_ledger(entry, &pair, &response, force, input.time_step, WALL);
                }
                let sample = Sample {
                    line: base + slice.place + place,
                    branch: pair.branch,
                    normal: pair.touch.normal,
                    overlap: pair.touch.overlap,
                    force: scale(force, -1.0),
                    normal_force: response.normal_force,
                    arms: [pair.arm_first, pair.arm_second],
                    counted: (slice.first[place] as usize) < input.owned,
                    wall: if WALL { Some(slice.second[place] as usize) } else { None },
                };
                observation.collect(&sample, &response.energies, wanted);
                observation.max_stiffness = observation.max_stiffness.max(response.stiffness);
                observation.max_overlap_ratio = observation.max_overlap_ratio.max(pair.touch.overlap / pair.min_radius);
            }
        }
        if OBSERVE {
            result.observation = Some(observation);
        }
        result
    }
}

#[inline(always)]
fn write_line(line: &mut [f64], pair: &PairTouch, response: &ContactResponse<f64>, force: [f64; 3]) {
    line[..3].copy_from_slice(&force);
    line[3] = pair.arm_first;
    if line.len() >= 8 {
        line[4..7].copy_from_slice(&cross(pair.touch.normal, response.tangential_force));
        line[7] = pair.arm_second;
    }
    if line.len() >= 12 {
        line[8..11].copy_from_slice(&response.moment);
        line[11] = 0.0;
    }
}

/// Energies that pass through one contact in one step \[J\]. The cell puts in `−F_second · v_imposed Δt`;
/// at a moving wall the same work is the wall's.
#[inline(always)]
fn write_ledger(
    entry: &mut [f64],
    pair: &PairTouch,
    response: &ContactResponse<f64>,
    force: [f64; 3],
    time_step: f64,
    wall: bool,
) {
    let work = dot(force, pair.imposed_velocity) * time_step;
    let e = &response.energies;
    let (cell, driven) = if wall { (0.0, work) } else { (work, 0.0) };
    entry.copy_from_slice(&[cell, driven, e.damping, e.viscous, e.friction, e.plastic]);
}
