//! A run from input to final digest: outer loop over steps, what is written when, signals, restart.

mod efforts;
mod inertia;
mod output;
mod signals;

use crate::config::{Config, Interval, Routine};
use crate::error::Result;
use crate::exchange::{Communicator, agree};
use crate::force::observe::Wanted;
use crate::output::checkpoint;
use crate::output::digest;
use crate::setup::{self, Initial};
use crate::simulation::{Requests, Simulation, Stage};
use crate::state::GlobalState;
use efforts::Efforts;
pub use efforts::{available_bytes, peak_bytes, ranks_here, resident_bytes};
use output::{DYNAMIC_HISTORY, RunOutput, is_due};
use signals::Signals;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// How a run is started beside its input.
#[derive(Debug, Clone, Default)]
pub struct RunOptions {
    /// Checkpoint file or run directory to go on from.
    pub restart: Option<PathBuf>,
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// All stages are done.
    Finished,
    /// SIGUSR1: a checkpoint is written, queue the run again.
    Requeue,
    /// SIGINT or SIGTERM (the number): a checkpoint is written.
    Stopped(i32),
}

/// Run a configuration on the ranks of `comm`; ranks that the grid has no use for stay idle.
///
/// # Errors
/// Whatever went wrong, the same error on every rank that computes.
pub fn run(comm: &Communicator, config: &Arc<Config>, options: &RunOptions) -> Result<Outcome> {
    // First of all, and on idle ranks too: mpirun forwards signals to every rank, and an unheard one kills.
    let signals = agree(comm, Signals::listen())?;
    let threads = set_up_threads(comm, config);
    let mut efforts = Efforts::begin();
    let started = Instant::now();
    let (initial, checkpoint) = match &options.restart {
        Some(path) => from_checkpoint(comm, config, path).map(|(initial, file)| (initial, Some(file)))?,
        None => (setup::from_packing(comm, config)?, None),
    };
    efforts.set_up(if checkpoint.is_some() { "checkpoint read" } else { "packing" }, started.elapsed().as_secs_f64());
    let decomposition = agree(comm, setup::decomposition(comm, config, &initial.global))?;
    let ranks = decomposition.ranks();
    if ranks < comm.size() && comm.rank() == 0 {
        eprintln!(
            "dem-mpi: {} particles on {ranks} of {} ranks (grid {:?}), the others stay idle; set parallel.grid or \
             parallel.min_particles_per_rank to use more",
            initial.global.particles,
            comm.size(),
            decomposition.grid
        );
    }
    // What idle ranks hold so far (id blocks of a checkpoint) goes to those that compute.
    let initial = setup::onto_first(comm, ranks, initial)?;
    let Some(active) = comm.first(ranks) else {
        signals.heed();
        return Ok(Outcome::Finished);
    };
    let (mut simulation, report) = setup::timed_simulation(active, config, decomposition, initial, threads)?;
    simulation.check_fixed_time_step()?;
    efforts.report(&report);
    if let Some(worst) = report.overlap.filter(|_| simulation.comm().rank() == 0) {
        let ([low, high], fraction) = (worst.ids, worst.fraction);
        say!("packing: largest overlap {fraction:.1e} of the smaller radius (particles {low} and {high})");
    }
    // Only now that nothing speaks against the run does it touch what lies in its directory.
    signals.heed();
    let prepared = match simulation.comm().rank() {
        0 => prepare(config, checkpoint.as_deref(), simulation.global()),
        _ => Ok(()),
    };
    agree(simulation.comm(), prepared)?;
    Run::new(simulation, Arc::clone(config), signals, efforts)?.drive()
}

/// Threads of this rank: as given, else the cores that this rank may use. Enters rayon's pool from the
/// main thread, so that handing it work costs little.
#[must_use]
pub fn set_up_threads(comm: &Communicator, config: &Config) -> usize {
    let threads = config.parallel.threads.unwrap_or_else(|| automatic_threads(comm.size()));
    // A second call in one process (tests, verify) keeps the first pool.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).use_current_thread().build_global();
    rayon::current_num_threads()
}

fn automatic_threads(ranks: usize) -> usize {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    (cores / ranks_here(ranks)).max(1)
}

fn from_checkpoint(comm: &Communicator, config: &Config, path: &Path) -> Result<(Initial, PathBuf)> {
    let mut file = path.to_path_buf();
    if path.is_dir() {
        let latest = checkpoint::latest(comm, path)?;
        for warning in latest.warnings.iter().filter(|_| comm.rank() == 0) {
            eprintln!("dem-mpi: warning: {warning}");
        }
        file = latest.path;
    }
    let read = checkpoint::read(comm, &file)?;
    if comm.rank() == 0 {
        eprintln!(
            "dem-mpi: restart from {} (step {}, time {:.6e} s)",
            file.display(),
            read.global.step,
            read.global.time
        );
    }
    Ok((agree(comm, setup::from_checkpoint(config, read))?, file))
}

fn prepare(config: &Config, checkpoint: Option<&Path>, global: &GlobalState) -> Result<()> {
    if let Some(file) = checkpoint {
        output::check_directory(config, file)?;
        output::make_directory(config)?;
        output::take_over(config, file)?;
        output::check_beginning(config, global)?;
    } else {
        output::make_directory(config)?;
    }
    output::clear_future(config, global)
}

/// A run in progress on one rank.
struct Run {
    simulation: Simulation,
    config: Arc<Config>,
    output: RunOutput,
    signals: Signals,
    started: Instant,
    first_step: u64,
    last_checkpoint: Instant,
}

impl Run {
    fn new(simulation: Simulation, config: Arc<Config>, signals: Signals, efforts: Efforts) -> Result<Self> {
        let output = RunOutput::new(&simulation, &config, efforts)?;
        let first_step = simulation.global().step;
        Ok(Self {
            simulation,
            config,
            output,
            signals,
            started: Instant::now(),
            first_step,
            last_checkpoint: Instant::now(),
        })
    }

    fn drive(mut self) -> Result<Outcome> {
        while !self.simulation.settle_stage() {
            let agreed = if self.simulation.is_quasi_static() {
                let Some(agreed) = self.substep()? else { continue };
                agreed
            } else {
                self.dynamic_step()?
            };
            let step = self.simulation.global().step;
            let every = self.config.output.checkpoint_steps;
            if agreed.stop != 0.0 {
                return self.stop(agreed.stop as i32);
            }
            if agreed.checkpoint != 0.0 || (every != 0 && step.is_multiple_of(every)) {
                self.checkpoint()?;
            }
            self.output.progress(&self.simulation);
        }
        let step = self.simulation.global().step;
        if step > 0 && step == self.first_step && self.simulation.comm().rank() == 0 {
            eprintln!("dem-mpi: all stages ended with step {step}: nothing to do; to go on, add a stage to the input");
        }
        self.finish()
    }

    /// Dynamic routine (W Fig. 1, right): report what is due, one increment of strain and time.
    fn dynamic_step(&mut self) -> Result<Requests> {
        let wanted = self.wanted();
        let requests = self.requests();
        let Self { simulation, output, .. } = self;
        simulation.step(wanted, requests, |simulation, report| output.write(simulation, report, wanted))
    }

    /// Quasi-static routine (W Fig. 1, left): report each equilibrium, then a substep of the next increment or of
    /// the running one. `None`: the stage is over.
    fn substep(&mut self) -> Result<Option<Requests>> {
        let (before, increments) = (self.simulation.global().stage, self.increments());
        let substeps = self.simulation.global().quasi_static.map_or(0, |state| state.substep);
        if let Some(mut report) = self.simulation.test_equilibrium()? {
            let over = self.simulation.settle_stage();
            let reached = self.increments() > increments;
            let wanted = if reached { self.due_at_equilibrium(substeps) } else { self.wanted() };
            // The last state of all is reported when the run ends.
            if !over && (wanted.sums || wanted.samples) {
                if wanted.samples {
                    report.samples = self.simulation.observe(wanted)?.samples;
                }
                self.output.write(&mut self.simulation, &report, wanted)?;
            }
            if over || self.simulation.global().stage != before {
                return Ok(None);
            }
        }
        let requests = self.requests();
        self.simulation.step(Wanted::default(), requests, |_, _| Ok(())).map(Some)
    }

    fn increments(&self) -> u64 {
        self.simulation.global().quasi_static.map_or(0, |state| state.increments)
    }

    /// What is due at an equilibrium so many substeps after the one before.
    fn due_at_equilibrium(&self, substeps: u64) -> Wanted {
        let (global, increments) = (self.simulation.global(), self.increments());
        let counted = |every: u64| increments.is_multiple_of(every);
        let sums = match self.config.output.history {
            Interval::Increments(every) => counted(every),
            // Time stands still, and rows between equilibria would mean nothing.
            Interval::Steps(_) | Interval::Time(_) => true,
        };
        let samples = match self.config.output.snapshots {
            Some(Interval::Increments(every)) => counted(every),
            Some(every) => is_due(every, global, substeps),
            None => false,
        };
        Wanted { sums, samples }
    }

    /// What is due at a state that a dynamic step has led to.
    fn due_after_a_step(&self) -> Wanted {
        let global = self.simulation.global();
        let sums = match self.config.output.history {
            Interval::Increments(_) => is_due(DYNAMIC_HISTORY, global, 1),
            every => is_due(every, global, 1),
        };
        Wanted { sums, samples: self.config.output.snapshots.is_some_and(|every| is_due(every, global, 1)) }
    }

    /// What is due at the present state, which begins a stage or is one of a dynamic stage: by the routine that led to it,
    /// unless it is written already.
    fn wanted(&self) -> Wanted {
        let global = self.simulation.global();
        let led_here =
            if global.step == global.stage_start_step { global.stage.checked_sub(1) } else { Some(global.stage) };
        let relaxed = led_here.is_some_and(|stage| self.config.stages[stage].routine == Routine::QuasiStatic);
        let due = if relaxed { self.due_at_equilibrium(0) } else { self.due_after_a_step() };
        let [row, shown] = self.output.last_steps().map(|last| last == Some(global.step));
        Wanted { sums: due.sums && !row, samples: due.samples && !shown }
    }

    fn requests(&self) -> Requests {
        let wall = self.config.output.checkpoint_wall_time;
        let due = self.simulation.comm().rank() == 0
            && wall.is_some_and(|seconds| self.last_checkpoint.elapsed().as_secs_f64() >= seconds);
        Requests { stop: f64::from(self.signals.pending()), checkpoint: f64::from(u8::from(due)) }
    }

    fn checkpoint(&mut self) -> Result<PathBuf> {
        self.simulation.timers_mut().start(Stage::Output);
        let started = Instant::now();
        let (particles, memory) = self.simulation.export()?;
        let columns = self.simulation.model().columns();
        let written = checkpoint::write(
            self.simulation.comm(),
            &self.config.output.directory,
            &self.config.resolved,
            &columns,
            self.simulation.global(),
            particles,
            memory,
            self.config.output.checkpoints_kept,
        );
        self.simulation.timers_mut().stop();
        self.last_checkpoint = Instant::now();
        let path = written?;
        self.output.count_checkpoint(&path, started.elapsed().as_secs_f64());
        Ok(path)
    }

    fn stop(mut self, signal: i32) -> Result<Outcome> {
        let path = self.checkpoint()?;
        let requeue = signal == signals::USR1;
        self.output.stopped(&self.simulation, &path, requeue)?;
        Ok(if requeue { Outcome::Requeue } else { Outcome::Stopped(signal) })
    }

    /// Final checkpoint, then the last row and snapshot, digest and table.
    fn finish(mut self) -> Result<Outcome> {
        self.checkpoint()?;
        let (particles, memory) = self.simulation.export()?;
        let digest = digest::digest(self.simulation.comm(), self.simulation.global(), &particles, &memory);
        let wanted = Wanted { sums: true, samples: self.config.output.snapshots.is_some() };
        let report = self.simulation.observe(wanted)?;
        self.output.write(&mut self.simulation, &report, wanted)?;
        let steps = self.simulation.global().step - self.first_step;
        self.output.finish(&self.simulation, &digest, self.started.elapsed(), steps)?;
        Ok(Outcome::Finished)
    }
}
