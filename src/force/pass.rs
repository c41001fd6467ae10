//! The contact pass: records in, one output line per contact out, memory updated in place. A batch of blocks goes
//! through stages: geometry, normal law, rolling law, tangential law, output lines. Only the stages of normal and
//! tangential law are compiled per composition.

use super::composition::{self, RollingVisitor};
use super::geometry::{CellMotion, PairTouch};
use super::lane::{is_far, prefetch};
use super::law::{Column, ContactLaw, LawVisitor, RollingLaw, Touch};
use super::observe::Observed;
use super::simd::Simd;
use super::touches::{BATCH, BlockTouches, Content};
use crate::config::PairConfig;
use crate::contact::section::{BLOCK, CacheLine, Partners, Section};
use crate::state::particles::Record;
use crate::state::shape::Shape;
use bytemuck::Zeroable;
use std::ops::Range;

mod ellipsoids;
mod laws;
mod output;
mod spheres;
mod walls;

use laws::{LawBatch, LawStages, Rolling, RollingStage, Stages};
pub use output::LineRing;
use output::{LineForm, Output};

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
    /// Numbers per output line: 4 (force), 6 (with one torque for both bodies), 12 (with one for each), then the ledger's.
    pub stride: usize,
    /// Write the ledger's numbers.
    pub ledger: bool,
    /// Largest allowed overlap over the smaller radius.
    pub max_overlap_fraction: f64,
    /// Time since the last evaluation \[s\].
    pub time_step: f64,
    /// Time for which the work of what the cell and walls impose counts, by the trapezoidal rule: half of the time since
    /// the last evaluation and half of that to the next one, if there is one \[s\].
    pub work_time: f64,
    /// Instructions to use.
    pub simd: Simd,
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

/// Where the touches of some blocks come from.
struct Source<'a> {
    input: &'a PassInput<'a>,
    /// Owned particles and ghosts from the section's origin on.
    bodies: BodyData<'a>,
    section: &'a Section,
    /// Numbers of the blocks.
    blocks: Range<usize>,
    content: Content,
    /// From which of the section's memory columns on the stored normals of ellipsoids are.
    normals: usize,
}

/// A contact that overlaps too much or is not a number: its place in the section and overlap ratio.
pub type Excess = Option<(usize, f64)>;

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

impl Bodies {
    /// The same bodies where it does not count that all radii are equal.
    fn of_any_radius(self) -> Self {
        if self == Self::EqualSpheres { Self::Spheres } else { self }
    }
}

/// The pass of one pair of materials.
pub struct PairPass {
    laws: Box<dyn LawStages>,
    rolling: Option<Box<dyn RollingStage>>,
    bodies: Bodies,
    /// Memory columns of all laws.
    columns: usize,
}

struct BoxStages;

impl LawVisitor for BoxStages {
    type Output = Box<dyn LawStages>;
    fn visit<C: ContactLaw>(self, law: C) -> Self::Output {
        Box::new(Stages(law))
    }
}

impl RollingVisitor for BoxStages {
    type Output = Box<dyn RollingStage>;
    fn visit<R: RollingLaw>(self, law: R) -> Self::Output {
        Box::new(Rolling(law))
    }
}

impl PairPass {
    /// The pass for a configured pair of materials.
    #[must_use]
    pub fn new(pair: &PairConfig, bodies: Bodies) -> Self {
        let laws = composition::visit(pair, BoxStages);
        let rolling = composition::visit_rolling(pair, BoxStages);
        let columns = laws.columns().len() + rolling.as_ref().map_or(0, |rolling| rolling.columns().len());
        Self { laws, rolling, bodies, columns }
    }

    /// Recompute what depends on the time step \[s\]; `relaxed`: in the limit of infinitely slow processes.
    pub fn prepare(&mut self, time_step: f64, relaxed: bool) {
        self.laws.prepare(time_step, relaxed);
        if let Some(rolling) = &mut self.rolling {
            rolling.prepare(time_step);
        }
    }

    /// Memory columns.
    #[must_use]
    pub fn columns(&self) -> Vec<Column> {
        let mut columns = self.laws.columns();
        columns.extend(self.rolling.iter().flat_map(|rolling| rolling.columns()));
        if self.bodies == Bodies::Ellipsoids {
            columns.extend(ellipsoids::normal_columns());
        }
        columns
    }

    /// Numbers per output line that force and torques need.
    #[must_use]
    pub fn width(&self) -> usize {
        match (self.bodies, self.laws.is_tangential()) {
            (Bodies::Ellipsoids, _) => 12,
            _ if self.rolling.is_some() => 12,
            (_, false) => 4,
            (Bodies::Spheres, true) => 12,
            (Bodies::EqualSpheres, true) => 6,
        }
    }

    /// Tangent stiffness \[N/m\] of a fresh touch of this overlap and effective radius \[m\].
    #[must_use]
    pub fn reference_stiffness(&self, overlap: f64, effective_radius: f64) -> f64 {
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
        let pair = PairTouch {
            touching: true,
            touch,
            branch: [0.0, 0.0, 4.0 * effective_radius],
            imposed_velocity: [0.0; 3],
            arm_first: 2.0 * effective_radius,
            arm_second: 2.0 * effective_radius,
            min_radius: 2.0 * effective_radius,
        };
        let mut touches = BlockTouches::zeroed();
        touches.put_none();
        touches.put_any(0, &pair, 0.0);
        let mut batch = LawBatch {
            simd: Simd::Scalar,
            detailed: true,
            energies: false,
            touches: std::slice::from_mut(&mut touches),
            memory: &mut vec![CacheLine([0.0; BLOCK]); self.columns],
            columns: self.columns,
        };
        self.laws.evaluate(&mut batch, None, None);
        touches.response::<f64>(0).stiffness
    }

    /// Gap over the effective radius up to which contacts keep their memory; 0 if it ends with the touch.
    #[must_use]
    pub fn range(&self) -> f64 {
        self.laws.range()
    }

    /// Evaluate some blocks of a section.
    #[must_use]
    pub fn run(&self, job: Job) -> Excess {
        let Job { input, bodies, section, blocks, lines, touches } = job;
        let (records, columns) = (bodies.records, section.columns);
        let ellipsoids = self.bodies == Bodies::Ellipsoids;
        let walls = section.partners == Partners::Wall;
        let kind = if walls { self.bodies.of_any_radius() } else { self.bodies };
        if kind == Bodies::EqualSpheres
            && let Some(record) = records.first()
        {
            touches.iter_mut().for_each(|touches| touches.put_radius(record.radius));
        }
        if ellipsoids && !walls {
            section.hints.resize(section.blocks(), [CacheLine([0.0; BLOCK]); 3]);
        }
        let detailed = input.ledger || ellipsoids;
        let far = is_far(records);
        let PassInput { stride, ledger, work_time, .. } = *input;
        let rolling = self.rolling.is_some();
        let content = Content { rolling, detailed, range: self.range() };
        let form = LineForm { stride, ledger, work_time, bodies: kind, rolling, walls };
        let mut output = Output { lines, form };
        let mut answer = |blocks: Range<usize>, touches: &mut [BlockTouches], memory: &mut [CacheLine]| {
            if far {
                prefetch(memory, (blocks.start + LIST_AHEAD) * columns, BATCH * columns);
            }
            let memory = &mut memory[blocks.start * columns..blocks.end * columns];
            let mut batch = LawBatch { simd: input.simd, detailed, energies: ledger, touches, memory, columns };
            self.laws.evaluate(&mut batch, self.rolling.as_deref(), Some(&mut output));
            if detailed {
                output.write(&mut batch, self.columns);
            }
            output.lines.first += blocks.len() * BLOCK;
        };
        if !ellipsoids && !walls {
            // The laws get the memory while the geometry goes on reading the rest of the section.
            let mut memory = std::mem::take(&mut section.memory);
            let source = Source { input, bodies, section, blocks, content, normals: self.columns };
            let mut each = |blocks, touches: &mut _| answer(blocks, touches, &mut memory);
            let excess = match kind {
                Bodies::EqualSpheres => spheres::geometry::<true>(&source, touches, &mut each),
                _ => spheres::geometry::<false>(&source, touches, &mut each),
            };
            section.memory = memory;
            return excess;
        }
        let mut excess = None;
        for start in blocks.clone().step_by(BATCH) {
            let blocks = start..(start + BATCH).min(blocks.end);
            let source = Source { input, bodies, section, blocks: blocks.clone(), content, normals: self.columns };
            let found = geometry(&source, kind, touches);
            excess = excess.or(found);
            let touches = &mut touches[..blocks.len()];
            answer(blocks.clone(), touches, &mut section.memory);
            if ellipsoids && !walls {
                for (hint, touches) in section.hints[blocks].iter_mut().zip(&*touches) {
                    *hint = touches.normals();
                }
            }
        }
        excess
    }

    /// Look at some blocks of a section without changing anything; gets room for touches and for a copy of their memory.
    pub fn observe(
        &self,
        input: &PassInput,
        bodies: BodyData,
        section: &Section,
        blocks: Range<usize>,
        (touches, memory): (&mut [BlockTouches; BATCH], &mut Vec<CacheLine>),
        observed: &mut Observed,
    ) {
        let columns = section.columns;
        let (kind, lasts) = (self.bodies.of_any_radius(), self.laws.lasts());
        let ellipsoids = kind == Bodies::Ellipsoids;
        let walls = section.partners == Partners::Wall;
        let PassInput { stride, work_time, .. } = *input;
        let rolling = self.rolling.is_some();
        let content = Content { rolling, detailed: true, range: self.range() };
        let form = LineForm { stride, ledger: false, work_time, bodies: kind, rolling, walls };
        let nowhere = LineRing { values: &mut [], first: 0, mask: 0 };
        let mut output = Output { lines: nowhere, form };
        let (line, single) = (observed.line, observed.single());
        for start in blocks.clone().step_by(BATCH) {
            let batch = start..(start + BATCH).min(blocks.end);
            let source = Source { input, bodies, section, blocks: batch.clone(), content, normals: self.columns };
            geometry(&source, kind, touches);
            memory.clear();
            memory.extend_from_slice(&section.memory[batch.start * columns..batch.end * columns]);
            let touches = &mut touches[..batch.len()];
            let (simd, detailed) = (input.simd, true);
            let mut answered = LawBatch { simd, detailed, energies: single, touches, memory, columns };
            if !single {
                // The normal law knows the stiffness.
                self.laws.evaluate(&mut answered, None, None);
                observed.take_maxima(answered.touches);
                continue;
            }
            self.laws.evaluate(&mut answered, self.rolling.as_deref(), Some(&mut output));
            for place in batch.start * BLOCK..(batch.end * BLOCK).min(section.count) {
                observed.line = line + place - blocks.start * BLOCK;
                let wall = walls.then(|| section.wall_of(place));
                let (touches, lane) = (&answered.touches[place / BLOCK - batch.start], place % BLOCK);
                let (first, force) = (section.first_of(place), touches.force_on_first(lane));
                if input.ledger {
                    observed.take_last_step(first, form.ledger_entries(&force, touches, lane));
                }
                observed.take(touches, lane, first, wall, (ellipsoids, lasts));
            }
        }
    }
}

/// Touches of the blocks of a batch of such bodies.
fn geometry(source: &Source, bodies: Bodies, touches: &mut [BlockTouches; BATCH]) -> Excess {
    match (source.section.partners, bodies) {
        (Partners::Wall, _) => walls::geometry(source, touches),
        (_, Bodies::Ellipsoids) => ellipsoids::geometry(source, touches),
        (_, Bodies::EqualSpheres) => spheres::geometry::<true>(source, touches, &mut |_, _| ()),
        (_, Bodies::Spheres) => spheres::geometry::<false>(source, touches, &mut |_, _| ()),
    }
}

#[cfg(test)]
mod tests;
