//! The simulation of one rank: all state and the step that moves it, in the order of ARCHITECTURE.md.
//! Only this module and `setup` see all stages.

mod contacts;
mod fault;
mod lists;
mod report;
mod snapshot;
mod timers;
mod traffic;

pub use report::Report;
pub use timers::{STAGES, Stage, Timers};

use crate::config::{Config, Kinematics};
use crate::contact::build::BuildContext;
use crate::contact::list::{ContactList, Partners};
use crate::contact::shift::ShiftTable;
use crate::error::Result;
use crate::exchange::{Communicator, Decomposition, HaloContent, HaloPlan, agree};
use crate::force::geometry::CellMotion;
use crate::force::law::Column;
use crate::force::observe::Wanted;
use crate::force::pass::PairPass;
use crate::integrate::gather::Lines;
use crate::integrate::leap_frog::{self, Reference, StepMotion, StepResult};
use crate::integrate::time_step::TimeStepControl;
use crate::load::{LoadProgramme, StepPlan};
use crate::neighbour::verlet::Candidate;
use crate::state::particles::{Particles, SpeciesConstants};
use crate::state::{ContactMemory, GlobalState, ParticleState};
use contacts::{ContactPhase, PassFault, Passed};
use lists::ListBudget;
use std::sync::Arc;

/// Below this many contacts per rank threads cost more than they give.
const PARALLEL_CONTACTS: usize = 8192;

/// Every law may damp or rub, so ghosts always carry velocities.
const GHOSTS: HaloContent = HaloContent { velocities: true };

/// What is constant over a run.
pub struct Model {
    /// The checked input.
    pub config: Arc<Config>,
    /// Constants per species.
    pub species: Vec<SpeciesConstants>,
    /// One contact pass per pair of materials.
    pub passes: Vec<Box<dyn PairPass>>,
    /// Stages and kinematics.
    pub programme: LoadProgramme,
    /// Bounds of the time step.
    pub time_step: TimeStepControl,
    /// What the list builder must know.
    pub lists: BuildContext,
    /// Largest radius of all particles \[m\].
    pub max_radius: f64,
    /// Volume of all particles \[m³\].
    pub solid_volume: f64,
    /// Some particle turns or can be made to turn.
    pub rotation: bool,
}

impl Model {
    /// Numbers per output line: the widest law's.
    #[must_use]
    pub fn stride(&self) -> usize {
        self.passes.iter().map(|pass| pass.stride()).max().unwrap_or(4)
    }

    /// Memory columns per pair of materials.
    #[must_use]
    pub fn columns(&self) -> Vec<Vec<Column>> {
        self.passes.iter().map(|pass| pass.columns()).collect()
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
    candidates: Vec<Candidate>,
    contacts: ContactList,
    lines: Lines,
    reference: Reference,
    budget: ListBudget,
    ghost_wraps: Vec<(u32, [i32; 3])>,
    timers: Timers,
    threads: usize,
    max_stiffness: f64,
    prepared_for: f64,
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
        let contacts = model.lists.empty_list();
        let lines = Lines { stride: model.stride(), ..Lines::default() };
        let mut simulation = Self {
            comm,
            decomposition,
            global,
            particles,
            halo: HaloPlan::default(),
            candidates: Vec::new(),
            contacts,
            lines,
            reference: Reference::default(),
            budget: ListBudget::default(),
            ghost_wraps: Vec::new(),
            timers: Timers::default(),
            threads,
            max_stiffness: 0.0,
            prepared_for: f64::NAN,
            warned_about_time_step: false,
            warnings: Vec::new(),
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
        Ok((self.particles.states(), self.model.lists.collect_memory(&self.contacts, &self.particles, true)))
    }

    /// Enter the stage that is due; true when the run is over.
    pub fn settle_stage(&mut self) -> bool {
        self.model.programme.settle(&mut self.global)
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
        let control = self.control_is_due();
        let observe = Wanted {
            sums: wanted.sums || control,
            samples: wanted.samples,
            ledger: self.model.config.output.energy_ledger,
        };
        let passed = self.contact_pass(observe);
        let fault = passed.fault;
        if observe.sums || observe.samples {
            let mut report = self.reduce(passed.observation.unwrap_or_default(), wanted);
            if control {
                self.control(&report)?;
                report.row.time_step = self.global.time_step;
            }
            if wanted.sums || wanted.samples {
                each(self, &report)?;
            }
        }
        let plan = self.model.programme.plan(&self.global, self.global.time_step);
        let moved = self.move_particles(&plan);
        self.agree_on_step(fault, &moved, requests)
    }

    /// Observe the present state without moving on (the end of a run).
    ///
    /// # Errors
    /// An overlap beyond the limit, the same error on every rank.
    pub fn observe(&mut self, wanted: Wanted) -> Result<Report> {
        let passed = self.contact_pass(wanted);
        let faults = self.describe_pass_fault(passed.fault);
        agree(&self.comm, faults)?;
        Ok(self.reduce(passed.observation.unwrap_or_default(), wanted))
    }

    fn control_is_due(&self) -> bool {
        self.global.step.is_multiple_of(self.model.config.control_interval)
            || self.global.step == self.global.stage_start_step
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
                gradient: [0, 1, 2].map(|k| rate[k] / sides[k]),
                wall_velocity: [0.0; 3],
            },
            Kinematics::Bc => CellMotion {
                sides,
                shift,
                shift_velocity: ShiftTable::new(rate),
                gradient: [0.0; 3],
                wall_velocity: rate,
            },
        }
    }

    /// Send and receive ghosts, and adjust the contacts of ghosts that wrapped.
    fn update_ghosts(&mut self) {
        self.ghost_wraps.clear();
        self.halo.update(&self.comm, &mut self.particles, GHOSTS, &mut self.ghost_wraps, |_| ());
        for (ghost, wraps) in &self.ghost_wraps {
            self.contacts.apply_wrap(*ghost as usize, *wraps);
        }
    }

    /// Halo exchange over the contacts of owned particles, then the contacts with ghosts.
    fn contact_pass(&mut self, wanted: Wanted) -> Passed {
        let elapsed = self.global.previous_time_step;
        if elapsed.to_bits() != self.prepared_for.to_bits() {
            self.prepared_for = elapsed;
            for pass in &mut self.model.passes {
                pass.prepare(elapsed);
            }
        }
        let motion = self.cell_motion();
        let phase = ContactPhase {
            passes: &self.model.passes,
            motion: &motion,
            owned: self.particles.owned,
            max_overlap_fraction: self.model.config.max_overlap_fraction,
            time_step: elapsed,
            wanted: (wanted.sums || wanted.samples || wanted.ledger).then_some(wanted),
            parallel: self.parallel(),
        };
        self.ghost_wraps.clear();
        let first_ghost = self.contacts.sections.partition_point(|s| s.partners != Partners::Ghost);
        self.timers.start(Stage::Halo);
        let mut passed =
            self.halo.update(&self.comm, &mut self.particles, GHOSTS, &mut self.ghost_wraps, |particles| {
                self.timers.start(Stage::Contacts);
                let sections = &mut self.contacts.sections[..first_ghost];
                let passed = phase.run(particles, sections, 0, &mut self.lines);
                self.timers.start(Stage::Halo);
                passed
            });
        for (ghost, wraps) in &self.ghost_wraps {
            self.contacts.apply_wrap(*ghost as usize, *wraps);
        }
        self.timers.start(Stage::Contacts);
        let sections = &mut self.contacts.sections[first_ghost..];
        passed.absorb(phase.run(&self.particles, sections, first_ghost, &mut self.lines));
        self.timers.stop();
        passed
    }

    fn parallel(&self) -> bool {
        self.threads > 1 && self.contacts.lines > PARALLEL_CONTACTS
    }

    /// Sum the forces, move the particles and the cell.
    fn move_particles(&mut self, plan: &StepPlan) -> StepResult {
        let kinematics = self.model.programme.kinematics;
        let sides = plan.next_sides;
        let old = self.global.sides;
        let motion = StepMotion {
            previous_time_step: self.global.previous_time_step,
            time_step: plan.time_step,
            gravity: self.model.config.gravity,
            scale: if kinematics == Kinematics::Bct { [0, 1, 2].map(|k| sides[k] / old[k]) } else { [1.0; 3] },
            sides,
            reference_sides: self.budget.reference_sides,
            face_velocity: if kinematics == Kinematics::Bc {
                [0, 1, 2].map(|k| (sides[k] - old[k]) / plan.time_step)
            } else {
                [0.0; 3]
            },
            periodic: self.periodic(),
            rotation: self.model.rotation,
            ledger: self.model.config.output.energy_ledger,
            parallel: self.parallel(),
        };
        self.timers.start(Stage::Integrate);
        let result = leap_frog::advance(&mut self.particles, &mut self.reference, &self.contacts, &self.lines, &motion);
        for (particle, wraps) in &result.wrapped {
            self.contacts.apply_wrap(*particle as usize, *wraps);
        }
        self.global.step += 1;
        self.global.time = plan.next_time;
        self.global.previous_time_step = plan.time_step;
        self.global.strain = plan.next_strain;
        self.global.sides = sides;
        self.timers.stop();
        result
    }

    /// One reduction per step: staleness of the lists, faults, requests. Rebuilds what is stale.
    fn agree_on_step(
        &mut self,
        pass_fault: Option<PassFault>,
        moved: &StepResult,
        requests: Requests,
    ) -> Result<Requests> {
        let faulty = pass_fault.is_some() || moved.lost.is_some();
        let mut values =
            [moved.max_displacement_squared, f64::from(u8::from(faulty)), requests.stop, requests.checkpoint];
        self.timers.start(Stage::Reduce);
        self.comm.max_f64(&mut values);
        self.timers.stop();
        if values[1] != 0.0 {
            let mine = self.describe_pass_fault(pass_fault).and_then(|()| self.describe_lost(moved.lost));
            agree(&self.comm, mine)?;
        }
        self.refresh_lists(values[0].sqrt())?;
        Ok(Requests { stop: values[2], checkpoint: values[3] })
    }

    fn periodic(&self) -> [bool; 3] {
        self.model.lists.walls.map(|wall| wall.is_none())
    }
}
