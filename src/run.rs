//! A run from input to final digest: outer loop over steps, what is written when, signals, restart.

mod directory;
mod efforts;
mod inertia;
mod lock;
mod output;
mod signals;

use crate::config::{Config, Interval, Routine};
use crate::error::{Error, Result};
use crate::exchange::{Communicator, agree};
use crate::force::observe::Wanted;
use crate::output::checkpoint::{self, Checkpoint};
use crate::output::digest::{self, Digest};
use crate::setup::{self, Ends, Initial};
use crate::simulation::{Requests, Simulation, Stage};
use efforts::Efforts;
pub use efforts::{available_bytes, peak_bytes, ranks_here, resident_bytes};
use output::{DYNAMIC_HISTORY, RunOutput, is_due};
pub use signals::{Signals, hold_back, let_through};
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

/// Run a configuration on the ranks of `comm`; ranks that the grid has no use for stay idle. Every rank listens to signals,
/// idle ones too, as mpirun forwards them to all.
///
/// # Errors
/// Whatever went wrong, the same error on every rank that computes.
pub fn run(comm: &Communicator, config: &Arc<Config>, options: &RunOptions, signals: Signals) -> Result<Outcome> {
    let threads = set_up_threads(comm, config);
    let mut efforts = Efforts::begin();
    let started = Instant::now();
    let (initial, checkpoint) = match &options.restart {
        Some(path) => {
            let restart = from_checkpoint(comm, config, path)?;
            if is_finished(comm, config, &restart) {
                signals.heed();
                if comm.rank() == 0 {
                    say_nothing_to_do(restart.initial.global.step);
                    say!("digest {}", restart.digest);
                }
                return Ok(Outcome::Finished);
            }
            (restart.initial, Some(restart.file))
        }
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
        0 => directory::prepare(config, checkpoint.as_deref(), simulation.global()).map(Some),
        _ => Ok(None),
    };
    // Until the last file is written.
    let _lock = agree(simulation.comm(), prepared)?;
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

/// What a restart begins with.
struct Restart {
    file: PathBuf,
    digest: Digest,
    initial: Initial,
}

fn from_checkpoint(comm: &Communicator, config: &Config, path: &Path) -> Result<Restart> {
    let (file, read) = fitting_checkpoint(comm, config, path)?;
    if comm.rank() == 0 {
        eprintln!(
            "dem-mpi: restart from {} (step {}, time {:.6e} s)",
            file.display(),
            read.global.step,
            read.global.time
        );
    }
    let digest = read.digest;
    Ok(Restart { file, digest, initial: agree(comm, setup::from_checkpoint(config, read))? })
}

/// The checkpoint given, or the newest of a run directory that leads to the ends of stages that the input names.
fn fitting_checkpoint(comm: &Communicator, config: &Config, path: &Path) -> Result<(PathBuf, Checkpoint)> {
    let mut file = path.to_path_buf();
    let (mut passed_over, mut number): (Option<(u64, Error)>, usize) = (None, 0);
    loop {
        if path.is_dir() {
            let latest =
                match (checkpoint::latest(comm, path, passed_over.as_ref().map(|(step, _)| *step)), passed_over) {
                    (Err(_), Some((_, reason))) => return Err(reason),
                    (latest, _) => latest?,
                };
            for warning in latest.warnings.iter().filter(|_| comm.rank() == 0) {
                eprintln!("dem-mpi: warning: {warning}");
            }
            file = latest.path;
        }
        let mut read = checkpoint::read(comm, &file)?;
        let step = read.global.step;
        let refused = |changes: &str, older: &str| {
            Error::Input(format!(
                "the checkpoint {} does not fit this input: {changes}, for which step {step} is too late: {older}put the \
                 end back and add a stage that goes on from there, or begin anew without --restart",
                file.display()
            ))
        };
        match agree(comm, setup::compare_ends(config, &mut read))? {
            Ends::Kept => {
                if number > 0 && comm.rank() == 0 {
                    eprintln!("dem-mpi: newer checkpoints passed over, as they are too late for another end: {number}");
                }
                return Ok((file, read));
            }
            Ends::PutOff(changes) if path.is_dir() => {
                number += 1;
                passed_over = Some((step, refused(&changes, "no older checkpoint is left; ")));
            }
            Ends::PutOff(changes) | Ends::Changed(changes) => {
                return Err(refused(&changes, "give a checkpoint file from before that end, "));
            }
        }
    }
}

/// Whether nothing is left to do in the run directory. Collective.
fn is_finished(comm: &Communicator, config: &Config, restart: &Restart) -> bool {
    let finished = comm.rank() == 0
        && restart.initial.global.stage >= config.stages.len()
        && directory::is_finished(config, &restart.file, &restart.initial.global, restart.digest);
    let mut ranks = [i64::from(finished)];
    comm.max_i64(&mut ranks);
    ranks[0] != 0
}

fn say_nothing_to_do(step: u64) {
    eprintln!(
        "dem-mpi: all stages ended with step {step}: nothing to do; to go on, let the last stage of the input end later or \
         add one"
    );
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
            say_nothing_to_do(step);
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
