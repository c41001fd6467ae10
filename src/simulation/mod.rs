//! The simulation of one rank: all state and the step that moves it, in the order of ARCHITECTURE.md.
//! Only this module and `setup` see all stages.

pub mod affine;
mod fault;
mod least_scale;
mod lists;
mod relaxation;
mod report;
mod snapshot;
mod strips;
mod timers;
mod traffic;
mod workers;

pub use least_scale::{FreeParticles, LeastScale};
pub use report::Report;
pub use timers::{STAGES, Stage, Timers};

use crate::config::{AxisControl, Config, Kinematics};
use crate::contact::build::BuildContext;
use crate::contact::list::ContactList;
use crate::contact::section::Partners;
use crate::contact::shift::ShiftTable;
use crate::error::Result;
use crate::exchange::{Communicator, Decomposition, HaloContent, HaloPlan};
use crate::force::geometry::CellMotion;
use crate::force::law::Column;
use crate::force::observe::{Observation, Wanted};
use crate::force::pass::{BodyData, LEDGER_STRIDE, PairPass, PassInput};
use crate::force::simd::Simd;
use crate::integrate::displacement::StepResult;
use crate::integrate::leap_frog::{Reference, Slice, StepMotion};
use crate::integrate::time_step::TimeStepControl;
use crate::load::{LoadProgramme, StepPlan};
use crate::neighbour::verlet::Candidates;
use crate::state::particles::{Extras, Particles, SpeciesConstants};
use crate::state::{ContactMemory, GlobalState, ParticleState};
use lists::{ListBudget, take_ghost_wraps};
use std::sync::Arc;
use strips::{LineBuffers, PassFault, Phase};

/// What is constant over a run.
pub struct Model {
    /// The checked input.
    pub config: Arc<Config>,
    /// Constants per species.
    pub species: Vec<SpeciesConstants>,
    /// One contact pass per pair of materials.
    pub passes: Vec<PairPass>,
    /// The same with the artificial damping of quasi-static stages, and without any; empty without such stages.
    pub static_passes: [Vec<PairPass>; 2],
    /// Stages and kinematics.
    pub programme: LoadProgramme,
    /// Bounds of the time step.
    pub time_step: TimeStepControl,
    /// Least force and energy for tests of equilibrium.
    pub least_scale: LeastScale,
    /// What the list builder must know.
    pub lists: BuildContext,
    /// Largest radius of all particles \[m\].
    pub max_radius: f64,
    /// Volume of all particles \[m³\].
    pub solid_volume: f64,
    /// Some particle is no sphere.
    pub ellipsoids: bool,
    /// Some particle turns or can be made to turn.
    pub rotation: bool,
    /// What the user should know of laws beside these particles.
    pub cautions: Vec<String>,
    /// Instructions that the passes use.
    pub simd: Simd,
}

impl Model {
    /// Numbers per output line that hold force and torques: the widest law's.
    fn line_width(&self) -> usize {
        self.passes.iter().map(PairPass::width).max().unwrap_or(4)
    }

    /// Numbers per output line.
    #[must_use]
    pub fn line_stride(&self) -> usize {
        self.line_width() + if self.config.output.energy_ledger { LEDGER_STRIDE } else { 0 }
    }

    /// What of particles is followed beside their motion.
    #[must_use]
    pub fn extras(&self) -> Extras {
        let output = &self.config.output;
        Extras {
            orientation: output.orientations,
            ellipsoids: self.ellipsoids,
            ledger: output.energy_ledger,
            velocities: self.config.velocities,
        }
    }

    /// What ghosts bring each step. Every law may damp or rub, so they always carry velocities.
    fn ghosts(&self) -> HaloContent {
        HaloContent { velocities: true, orientations: self.ellipsoids }
    }

    /// The programme looks at the stress: it steers it or ends a stage by it.
    fn needs_stress(&self) -> bool {
        self.programme.stages.iter().any(|stage| {
            stage.until_stress.is_some() || stage.axes.iter().any(|axis| matches!(axis, AxisControl::Stress { .. }))
        })
    }

    /// Memory columns per pair of materials.
    #[must_use]
    pub fn columns(&self) -> Vec<Vec<Column>> {
        self.passes.iter().map(PairPass::columns).collect()
    }
}

/// The state of one rank.
pub struct Simulation {
    comm: Communicator,
    model: Model,
    decomposition: Decomposition,
    global: GlobalState,
    particles: Particles,
    halo: HaloPlan,
    candidates: Candidates,
    contacts: ContactList,
    lines: LineBuffers,
    reference: Reference,
    budget: ListBudget,
    ghost_wraps: Vec<(u32, [i32; 3])>,
    /// Per line, force and touch of the last look at single contacts; empty between looks.
    forces: Vec<[f64; 4]>,
    timers: Timers,
    threads: usize,
    max_stiffness: f64,
    prepared_for: Option<(u64, bool)>,
    warned_about_time_step: bool,
    warnings: Vec<String>,
}

/// Requests that ranks agree on once per step: the largest of each wins.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Requests {
    /// Non-zero: a signal asks to stop; the larger number wins.
    pub stop: f64,
    /// Non-zero: write a checkpoint now.
    pub checkpoint: f64,
}

impl Simulation {
    /// Simulation from particles on their owner ranks and the contact memory of those particles.
    ///
    /// # Errors
    /// The halo cannot be built.
    pub fn new(
        comm: Communicator,
        model: Model,
        decomposition: Decomposition,
        global: GlobalState,
        particles: Particles,
        memory: ContactMemory,
        threads: usize,
    ) -> Result<Self> {
        let lines = LineBuffers::new(model.line_width(), model.line_stride());
        let mut simulation = Self {
            comm,
            decomposition,
            global,
            particles,
            halo: HaloPlan::default(),
            candidates: Candidates::default(),
            contacts: ContactList::default(),
            lines,
            reference: Reference::default(),
            budget: ListBudget::default(),
            ghost_wraps: Vec::new(),
            forces: Vec::new(),
            timers: Timers::default(),
            threads,
            max_stiffness: 0.0,
            prepared_for: None,
            warned_about_time_step: false,
            warnings: model.cautions.clone(),
            model,
        };
        simulation.rebuild_all(memory)?;
        Ok(simulation)
    }

    /// Global state: step, time, cell, stage.
    #[must_use]
    pub fn global(&self) -> &GlobalState {
        &self.global
    }

    /// Global state, to count output.
    pub fn global_mut(&mut self) -> &mut GlobalState {
        &mut self.global
    }

    /// The communicator of the ranks that compute.
    #[must_use]
    pub fn comm(&self) -> &Communicator {
        &self.comm
    }

    /// What is constant over the run.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Time per stage so far.
    #[must_use]
    pub fn timers(&self) -> &Timers {
        &self.timers
    }

    /// Time per stage, for stages outside the step.
    pub fn timers_mut(&mut self) -> &mut Timers {
        &mut self.timers
    }

    /// Threads of this rank.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// Warnings since the last call.
    pub fn take_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    /// Listed contacts of this rank.
    #[must_use]
    pub fn listed_contacts(&self) -> usize {
        self.contacts.contacts()
    }

    /// Everything that a checkpoint holds of this rank: its particles, and the memory of the contacts
    /// whose lower id it owns.
    ///
    /// # Errors
    /// The halo exchange failed on some rank.
    pub fn export(&mut self) -> Result<(Vec<ParticleState>, ContactMemory)> {
        self.update_ghosts();
        Ok((self.particles.states(), self.memory_of_state()))
    }

    /// Enter the stage that is due; true when the run is over.
    pub fn settle_stage(&mut self) -> bool {
        self.model.programme.settle(&mut self.global, &mut self.warnings)
    }

    /// One step: contacts at the present positions, what is due at them, motion to the next ones.
    /// `report` asks for an observation of the present state, `each` is called with it before the
    /// particles move. Returns what the ranks agreed on.
    ///
    /// # Errors
    /// A lost particle, a number that is none, an overlap beyond the limit, an unstable time step: the
    /// same error on every rank.
    pub fn step(
        &mut self,
        wanted: Wanted,
        requests: Requests,
        each: impl FnOnce(&mut Self, &Report) -> Result<()>,
    ) -> Result<Requests> {
        self.prepare();
        let control = self.control_is_due();
        let looking = control || wanted.sums || wanted.samples;
        if looking {
            self.look(wanted, control, each)?;
        }
        let plan = self.model.programme.plan(&self.global, self.global.time_step);
        if self.is_quasi_static() {
            self.begin_increment();
        }
        let strain = self.global.strain;
        let motion = self.step_motion(&plan);
        let (moved, fault) = self.move_on(&plan, &motion, looking);
        if self.is_quasi_static() {
            self.after_substep(strain);
        }
        self.agree_on_step(fault, &moved, &motion, requests)
    }

    /// Observe the present state without moving on (the end of a run).
    ///
    /// # Errors
    /// None at present; the overlap limit is checked by the next step.
    pub fn observe(&mut self, wanted: Wanted) -> Result<Report> {
        self.prepare();
        self.update_ghosts();
        let observation = self.observe_contacts(wanted, false);
        self.reduce(observation, wanted)
    }

    /// What is due at the present positions: control of time step and load, reports.
    fn look(
        &mut self,
        wanted: Wanted,
        control: bool,
        each: impl FnOnce(&mut Self, &Report) -> Result<()>,
    ) -> Result<()> {
        self.timers.start(Stage::Halo);
        self.update_ghosts();
        let observe = Wanted { sums: wanted.sums || control && self.model.needs_stress(), ..wanted };
        let observation = self.observe_contacts(observe, false);
        let mut report = self.reduce(observation, observe)?;
        if control {
            self.control(&report)?;
            report.row.time_step = self.global.time_step;
        }
        if wanted.sums || wanted.samples {
            each(self, &report)?;
        }
        self.forces = Vec::new();
        Ok(())
    }

    fn control_is_due(&self) -> bool {
        !self.is_quasi_static()
            && (self.global.step.is_multiple_of(self.model.config.control_interval)
                || self.global.step == self.global.stage_start_step)
    }

    /// Present motion of the cell.
    fn cell_motion(&self) -> CellMotion {
        let sides = self.global.sides;
        let rate = LoadProgramme::side_rate(&self.global);
        let shift = ShiftTable::new(sides);
        match self.model.programme.kinematics {
            Kinematics::Bct => CellMotion {
                sides,
                shift,
                shift_velocity: ShiftTable::new([0.0; 3]),
                faces_move: false,
                gradient: [0, 1, 2].map(|k| rate[k] / sides[k]),
                wall_velocity: [0.0; 3],
            },
            Kinematics::Bc => CellMotion {
                sides,
                shift,
                shift_velocity: ShiftTable::new(rate),
                faces_move: true,
                gradient: [0.0; 3],
                wall_velocity: rate,
            },
        }
    }

    /// `next`: the time to the next evaluation, 0 if nothing is to move now \[s\].
    fn pass_input<'a>(&self, motion: &'a CellMotion, next: f64) -> PassInput<'a> {
        PassInput {
            motion,
            stride: self.lines.stride,
            ledger: self.model.config.output.energy_ledger,
            max_overlap_fraction: self.model.config.max_overlap_fraction,
            time_step: self.global.previous_time_step,
            work_time: 0.5 * (self.global.previous_time_step + next),
            simd: self.model.simd,
        }
    }

    /// Look at all contacts; the ghosts are up to date.
    fn observe_contacts(&mut self, wanted: Wanted, only_excess: bool) -> Observation {
        self.timers.start(Stage::Observe);
        let motion = self.cell_motion();
        let passes = self.model.passes_with(self.dashpots());
        let phase = Phase { passes, input: self.pass_input(&motion, 0.0), only_excess };
        let lines = if wanted.sums || wanted.samples { self.contacts.lines } else { 0 };
        self.forces = vec![[0.0; 4]; lines];
        let particles = &self.particles;
        let observation = phase.observe(&self.contacts, bodies(particles), particles.owned, wanted, &mut self.forces);
        self.timers.stop();
        observation
    }

    /// Contacts, sum and motion. While the ghosts fly, those particles move that no other rank sees. `fresh`: the
    /// ghosts are up to date.
    fn move_on(&mut self, plan: &StepPlan, motion: &StepMotion, fresh: bool) -> (StepResult, Option<PassFault>) {
        let cell = self.cell_motion();
        let input = self.pass_input(&cell, plan.time_step);
        let dashpots = self.dashpots();
        if self.contacts.strips.len() > 1 {
            workers::keep_awake();
        }
        let Self { comm, model, halo, particles, contacts, lines, reference, ghost_wraps, timers, .. } = self;
        let phase = Phase { passes: model.passes_with(dashpots), input, only_excess: false };
        let (inner, strips) = (contacts.inner, contacts.strips.len());
        let moving = if inner == strips { particles.owned } else { contacts.strips[inner].particles.start };
        let inner_part = |particles: &mut Particles,
                          contacts: &mut ContactList,
                          lines: &mut LineBuffers,
                          reference: &mut Reference,
                          timers: &mut Timers| {
            timers.start(Stage::Contacts);
            let fault = phase.kept(contacts, &[Partners::Apart, Partners::Wall], bodies(particles), lines);
            timers.start(Stage::Step);
            let (slice, _) = Slice::new(particles, reference).split(moving);
            let (result, near_fault) = phase.near(contacts, 0..inner, slice, lines, motion);
            (result, fault.or(near_fault))
        };
        let (mut result, mut fault) = if fresh {
            inner_part(particles, contacts, lines, reference, timers)
        } else {
            timers.start(Stage::Halo);
            halo.update(comm, particles, model.ghosts(), ghost_wraps, |particles| {
                let result = inner_part(particles, contacts, lines, reference, timers);
                timers.start(Stage::Halo);
                result
            })
        };
        if inner < strips {
            if !fresh {
                take_ghost_wraps(ghost_wraps, contacts, reference);
            }
            timers.start(Stage::Contacts);
            let ghost_fault = phase.kept(contacts, &[Partners::Ghost], bodies(particles), lines);
            timers.start(Stage::Step);
            let (_, slice) = Slice::new(particles, reference).split(moving);
            let (border, near_fault) = phase.near(contacts, inner..strips, slice, lines, motion);
            result.absorb(border);
            fault = fault.or(ghost_fault).or(near_fault);
        }
        for (particle, wraps) in &result.wrapped {
            self.contacts.apply_wrap(*particle as usize, *wraps);
        }
        self.account_for_crossings(&result.wrapped, motion.face_velocity);
        self.global.step += 1;
        self.global.previous_time = Some(self.global.time);
        self.global.time = plan.next_time;
        self.global.previous_time_step = plan.time_step;
        self.global.strain = plan.next_strain;
        self.global.sides = plan.next_sides;
        self.timers.stop();
        (result, fault)
    }

    fn step_motion(&self, plan: &StepPlan) -> StepMotion {
        let kinematics = self.model.programme.kinematics;
        let (old, sides) = (self.global.sides, plan.next_sides);
        let extras = self.model.extras();
        StepMotion {
            previous_time_step: self.global.previous_time_step,
            time_step: plan.time_step,
            gravity: self.model.config.gravity,
            scale: if kinematics == Kinematics::Bct { [0, 1, 2].map(|k| sides[k] / old[k]) } else { [1.0; 3] },
            previous_sides: old,
            sides,
            reference_sides: self.budget.reference_sides,
            // In the quasi-static routine the face jumps and then rests, and so does what goes through it.
            face_velocity: if kinematics == Kinematics::Bc && !self.is_quasi_static() {
                [0, 1, 2].map(|k| (sides[k] - old[k]) / plan.time_step)
            } else {
                [0.0; 3]
            },
            periodic: self.periodic(),
            rotation: self.model.rotation,
            ledger: extras.ledger,
            orientation: extras.orientation,
            velocities: extras.velocities,
            watch: self.budget.displacement.watch,
            simd: self.model.simd,
        }
    }

    /// One reduction per step: staleness of the lists, faults, requests. Rebuilds what is stale.
    fn agree_on_step(
        &mut self,
        pass_fault: Option<PassFault>,
        moved: &StepResult,
        motion: &StepMotion,
        requests: Requests,
    ) -> Result<Requests> {
        let faulty = pass_fault.is_some() || moved.lost.is_some();
        let mut values = [moved.farthest(motion), f64::from(u8::from(faulty)), requests.stop, requests.checkpoint];
        self.timers.start(Stage::Reduce);
        self.comm.max_f64(&mut values);
        self.timers.stop();
        if values[1] != 0.0 {
            self.refuse(pass_fault, moved.lost)?;
        }
        self.refresh_lists(motion, values[0])?;
        Ok(Requests { stop: values[2], checkpoint: values[3] })
    }

    fn periodic(&self) -> [bool; 3] {
        self.model.lists.walls.map(|wall| wall.is_none())
    }
}

fn bodies(particles: &Particles) -> BodyData<'_> {
    BodyData { records: &particles.record, shapes: &particles.shape }
}
