//! What a run writes while it goes: history, snapshots, the terminal, the tables at its end.

use super::efforts::{Efforts, resident_bytes};
use super::inertia::Inertia;
use crate::config::programme::{steps_of_all, time_of_all};
use crate::config::{self, Config, Interval};
use crate::error::{Error, Result};
use crate::exchange::agree;
use crate::force::observe::Wanted;
use crate::output::digest::Digest;
use crate::output::files::write_atomically;
use crate::output::history::HistoryWriter;
use crate::output::log::{Log, RunSize, StageTimes, cost_table};
use crate::output::plot;
use crate::output::ranks::{effort_table, rank_table};
use crate::output::snapshot::{Moment, SnapshotSeries, Style};
use crate::simulation::{Report, Simulation, Stage, Timers};
use crate::state::GlobalState;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Steps between looks at the progress bar.
const PROGRESS_STEPS: u64 = 256;

/// Rows of dynamic stages where the history counts increments.
pub const DYNAMIC_HISTORY: Interval = Interval::Steps(1000);

/// Open output of a run on one rank.
pub struct RunOutput {
    config: Arc<Config>,
    history: Option<HistoryWriter>,
    snapshots: Option<SnapshotSeries>,
    log: Option<Log>,
    inertia: Inertia,
    efforts: Efforts,
    /// Steps of the last row and the last snapshot that this process wrote.
    last: [Option<u64>; 2],
}

impl RunOutput {
    /// Open history and snapshots: new, or cut to what the state has counted (restart); then write the resolved input.
    /// Collective.
    ///
    /// # Errors
    /// Files cannot be made, or hold less than the checkpoint counts.
    pub fn new(simulation: &Simulation, config: &Arc<Config>, efforts: Efforts) -> Result<Self> {
        let (comm, global) = (simulation.comm(), simulation.global());
        let directory = &config.output.directory;
        let first = comm.rank() == 0;
        let opened = match (first, global.history_rows) {
            (false, _) => Ok(None),
            (true, 0) => HistoryWriter::create(directory).map(Some),
            (true, rows) => HistoryWriter::resume(directory, rows).map(Some),
        };
        let history = agree(comm, opened)?;
        let snapshots = match config.output.snapshots {
            Some(_) => {
                let style = Style { ellipsoids: simulation.model().ellipsoids, dump: config.output.dump };
                Some(SnapshotSeries::resume(comm, directory, global.snapshots, style)?)
            }
            None => None,
        };
        // Last, so that after a kill the input is not newer than the table beside it.
        let resolved = directory.join("config.resolved.toml");
        let written = if first { write_atomically(&resolved, config.resolved.as_bytes()) } else { Ok(()) };
        agree(comm, written)?;
        Ok(Self {
            config: Arc::clone(config),
            history,
            snapshots,
            log: first.then(Log::new),
            inertia: Inertia::default(),
            efforts,
            last: [None; 2],
        })
    }

    /// Steps of the last row and the last snapshot that this process wrote.
    #[must_use]
    pub fn last_steps(&self) -> [Option<u64>; 2] {
        self.last
    }

    /// Write what was wanted of a report. Collective.
    ///
    /// # Errors
    /// The disk does not take it; the same error on every rank.
    pub fn write(&mut self, simulation: &mut Simulation, report: &Report, wanted: Wanted) -> Result<()> {
        simulation.timers_mut().start(Stage::Output);
        for warning in simulation.take_warnings() {
            if let Some(log) = &self.log {
                log.line(&format!("warning: {warning}"));
            }
        }
        if wanted.sums {
            let written = self.history.as_mut().map_or(Ok(()), |history| history.write(&report.row));
            agree(simulation.comm(), written)?;
            let done = progress(&self.config, simulation.global());
            if let Some(log) = &mut self.log {
                for line in self.inertia.follow(&self.config, simulation.global().stage, &report.row) {
                    log.line(&line);
                }
                log.row(&report.row, done);
            }
            self.last[0] = Some(simulation.global().step);
            simulation.global_mut().history_rows += 1;
        }
        if let Some(series) = self.snapshots.as_mut().filter(|_| wanted.samples) {
            let global = simulation.global();
            let moment = Moment { step: global.step, time: global.time, sides: global.sides };
            let total = global.particles;
            let contacts = self.config.output.snapshot_contacts.then(|| simulation.snapshot_contacts(&report.samples));
            let started = Instant::now();
            let path = series.write(&moment, total, simulation.snapshot_particles(&report.samples), contacts)?;
            self.efforts.snapshot(&path, started.elapsed().as_secs_f64());
            self.last[1] = Some(moment.step);
            simulation.global_mut().snapshots += 1;
        }
        simulation.timers_mut().stop();
        Ok(())
    }

    /// A checkpoint was written.
    pub fn count_checkpoint(&mut self, path: &Path, seconds: f64) {
        self.efforts.checkpoint(path, seconds);
    }

    /// Move the progress bar now and then.
    pub fn progress(&mut self, simulation: &Simulation) {
        let global = simulation.global();
        if let Some(log) = self.log.as_ref().filter(|_| global.step.is_multiple_of(PROGRESS_STEPS)) {
            let name = self.config.stages.get(global.stage).map_or("", |stage| stage.name.as_str());
            log.progress(progress(&self.config, global), name);
        }
    }

    /// A signal ended the run: say so, and leave a status file for the jobscript.
    ///
    /// # Errors
    /// The status file cannot be written.
    pub fn stopped(&mut self, simulation: &Simulation, checkpoint: &Path, requeue: bool) -> Result<()> {
        let mut written = Ok(());
        if let Some(log) = &mut self.log {
            log.finish();
            let state = if requeue { "requeue" } else { "stopped" };
            say!(
                "stopped by a signal at step {}; go on with --restart {directory} --output {directory}",
                simulation.global().step,
                directory = self.config.output.directory.display()
            );
            written = self.status(state, &format!("checkpoint = {:?}\n", checkpoint.display().to_string()));
        }
        agree(simulation.comm(), written)
    }

    fn status(&self, state: &str, more: &str) -> Result<()> {
        let path = self.config.output.directory.join("status.toml");
        fs::write(&path, format!("state = \"{state}\"\n{more}")).map_err(|error| Error::File {
            path,
            message: format!("cannot write the status file ({error}); free the disk"),
        })
    }

    /// The end of a run: digest, cost table, plots, status. Collective.
    ///
    /// # Errors
    /// The plots or the status file cannot be written.
    pub fn finish(&mut self, simulation: &Simulation, digest: &Digest, wall: Duration, steps: u64) -> Result<()> {
        if let Some(log) = &mut self.log {
            log.finish();
        }
        let size = RunSize {
            particles: simulation.global().particles,
            steps,
            threads: simulation.threads(),
            bytes: resident_bytes(),
        };
        let table = cost_table(simulation.comm(), &stage_times(simulation.timers(), wall), &size);
        let ranks = rank_table(simulation.comm(), &self.efforts.per_rank(simulation));
        let mut written = Ok(());
        if simulation.comm().rank() == 0 {
            let started = Instant::now();
            say!("\n{table}\n{ranks}\n{}", effort_table(&self.efforts.rows()));
            say!("digest {digest}");
            written = self.status("finished", &format!("digest = \"{digest}\"\n"));
            if self.config.output.plots && written.is_ok() {
                written = plot::plot_run(&self.config.output.directory).map(|_| ());
            }
            say!(
                "results in {} (plots took {:.1} s)",
                self.config.output.directory.display(),
                started.elapsed().as_secs_f64()
            );
        }
        agree(simulation.comm(), written)
    }
}

/// Share of the run that is done: of its time or its steps where the stages tell them all, else one stage counts like
/// another.
fn progress(config: &Config, global: &GlobalState) -> f64 {
    let stages = &config.stages;
    if let Some(time) = time_of_all(stages) {
        return (global.time / time).min(1.0);
    }
    if let Some(steps) = steps_of_all(stages) {
        return (global.step as f64 / steps).min(1.0);
    }
    let current = stages.get(global.stage).map_or(0.0, |stage| progress_of(stage, global));
    (global.stage as f64 + current) / stages.len() as f64
}

/// Share of one stage that is done: that of the end condition which is nearest.
fn progress_of(stage: &config::Stage, global: &GlobalState) -> f64 {
    let share = |start: f64, now: f64, target: f64| (now - start) / (target - start);
    let by_time = stage.duration.map(|duration| (global.time - global.stage_start_time) / duration);
    let by_strain =
        stage.until_strain.map(|(axis, target)| share(global.stage_start_strain[axis], global.strain[axis], target));
    let by_stress = stage
        .until_stress
        .map(|(axis, target)| share(global.stage_start_stress[axis], global.measured_stress[axis], target));
    let by_steps = stage.steps.map(|steps| (global.step - global.stage_start_step) as f64 / steps as f64);
    let done = global.quasi_static.map_or(0, |state| state.increments - state.stage_start_increments);
    let by_increments = stage.increments.map(|increments| done as f64 / increments as f64);
    let ends = [by_time, by_strain, by_stress, by_steps, by_increments];
    ends.into_iter().flatten().fold(0.0, f64::max).clamp(0.0, 1.0)
}

fn stage_times(timers: &Timers, wall: Duration) -> StageTimes {
    let [neighbours, contacts, step, observe, halo, reduce, output] = timers.seconds();
    StageTimes { neighbours, contacts, step, observe, halo, reduce, output, total: wall.as_secs_f64() }
}

/// Whether the state is the first of all, or a multiple of the interval lies within the last `steps` steps (for times the
/// last one).
#[must_use]
pub fn is_due(every: Interval, global: &GlobalState, steps: u64) -> bool {
    if global.step == 0 {
        return true;
    }
    // Checkpoints of older versions do not know the time before.
    let previous = global.previous_time.unwrap_or(global.time - global.previous_time_step);
    match every {
        Interval::Steps(every) => global.step / every > global.step.saturating_sub(steps) / every,
        Interval::Time(every) => {
            // A hair early, so that rounding of the time does not cost a step.
            let intervals = |time: f64| (time / (every * (1.0 - 1e-9))).floor();
            intervals(global.time) > intervals(previous)
        }
        // Equilibria are counted elsewhere.
        Interval::Increments(_) => false,
    }
}
