//! Follows the load programme on paper: how long stages last and where the strain is after them,
//! as far as this is known without running.

use super::{AxisControl, Routine, Stage};

/// Time and strain at some point of the programme.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Progress {
    /// Time of the stages whose length is known \[s\].
    pub time: f64,
    /// Increments of the quasi-static stages whose length is known.
    pub increments: f64,
    /// All stages so far have a known length.
    pub complete: bool,
    /// Steps of the stages that end by a number of steps alone.
    pub steps: f64,
    /// All stages so far have a known length or number of steps.
    pub countable: bool,
    /// Strain per axis; `None` once a servo or an unknown length made it unknown.
    pub strain: [Option<f64>; 3],
}

impl Default for Progress {
    fn default() -> Self {
        Self { time: 0.0, increments: 0.0, complete: true, steps: 0.0, countable: true, strain: [Some(0.0); 3] }
    }
}

impl Progress {
    /// Nothing is known any more.
    pub fn lose_track(&mut self) {
        self.complete = false;
        self.countable = false;
        self.strain = [None; 3];
    }
}

/// Length of a stage that starts at these strains, in seconds or in increments, if that, time or strain end it.
/// A stress or a number of steps may end it sooner.
pub(super) fn stage_duration(strain: [Option<f64>; 3], stage: &Stage) -> Option<f64> {
    let by_strain = stage.until_strain.and_then(|(axis, target)| match stage.axes[axis] {
        AxisControl::StrainRate(rate) if rate != 0.0 => strain[axis].map(|start| (target - start) / rate),
        _ => None,
    });
    let counted = stage.increments.map(|count| count as f64);
    let candidates = [stage.duration, counted, by_strain.filter(|time| *time > 0.0)];
    candidates.into_iter().flatten().reduce(f64::min)
}

/// Go on to the end of a stage.
pub(super) fn advance(progress: &mut Progress, stage: &Stage) {
    let duration = stage_duration(progress.strain, stage);
    let certain = stage.until_stress.is_none() && stage.steps.is_none();
    match stage.routine {
        Routine::Dynamic => progress.time += duration.unwrap_or(0.0),
        Routine::QuasiStatic => progress.increments += duration.unwrap_or(0.0).ceil(),
    }
    progress.complete &= duration.is_some() && certain;
    let counted = stage.steps.filter(|_| duration.is_none());
    progress.steps += counted.map_or(0.0, |steps| steps as f64);
    progress.countable &= stage.until_stress.is_none() && (counted.is_some() || duration.is_some() && certain);
    for (strain, control) in progress.strain.iter_mut().zip(stage.axes) {
        *strain = match (control, duration) {
            (AxisControl::StrainRate(0.0), _) => *strain,
            (AxisControl::StrainRate(rate), Some(duration)) if certain => strain.map(|start| start + rate * duration),
            _ => None,
        };
    }
}
