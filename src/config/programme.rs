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
    /// Certainly nothing has come under stress so far.
    pub unstressed: bool,
}

impl Default for Progress {
    fn default() -> Self {
        Self {
            time: 0.0,
            increments: 0.0,
            complete: true,
            steps: 0.0,
            countable: true,
            strain: [Some(0.0); 3],
            unstressed: false,
        }
    }
}

impl Progress {
    /// Nothing is known any more.
    pub fn lose_track(&mut self) {
        self.complete = false;
        self.countable = false;
        self.strain = [None; 3];
        self.unstressed = false;
    }
}

impl Stage {
    /// Whether no side of the cell becomes shorter.
    #[must_use]
    pub fn only_expands(&self) -> bool {
        self.axes.iter().all(|axis| matches!(axis, AxisControl::StrainRate(rate) if *rate <= 0.0))
    }

    /// Whether some side of the cell becomes shorter, and none longer.
    #[must_use]
    pub fn only_compresses(&self) -> bool {
        let compresses = |axis: &AxisControl| matches!(axis, AxisControl::StrainRate(rate) if *rate >= 0.0);
        self.axes.iter().all(compresses) && !self.only_expands()
    }

    /// Whether a compressive stress alone ends the stage, and no side of the cell becomes shorter.
    #[must_use]
    pub fn only_expands_towards_stress(&self) -> bool {
        let other = self.duration.is_some() || self.until_strain.is_some() || self.steps.is_some();
        let alone = !other && self.increments.is_none();
        alone && self.only_expands() && self.until_stress.is_some_and(|(_, target)| target > 0.0)
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
    progress.unstressed &= stage.only_expands();
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

/// Time of all stages \[s\] if they are dynamic and end by time or strain alone.
#[must_use]
pub fn time_of_all(stages: &[Stage]) -> Option<f64> {
    let progress = along(stages);
    let dynamic = stages.iter().all(|stage| stage.routine == Routine::Dynamic);
    (dynamic && progress.complete && progress.time > 0.0).then_some(progress.time)
}

/// Steps of all stages if they end by a number of steps alone.
#[must_use]
pub fn steps_of_all(stages: &[Stage]) -> Option<f64> {
    let progress = along(stages);
    (progress.countable && progress.time == 0.0 && progress.steps > 0.0).then_some(progress.steps)
}

fn along(stages: &[Stage]) -> Progress {
    let mut progress = Progress::default();
    stages.iter().for_each(|stage| advance(&mut progress, stage));
    progress
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage(rate: f64, duration: Option<f64>, until_strain: Option<f64>, until_stress: Option<f64>) -> Stage {
        Stage {
            name: String::new(),
            routine: Routine::Dynamic,
            axes: [0.0, 0.0, rate].map(AxisControl::StrainRate),
            duration,
            until_strain: until_strain.map(|strain| (2, strain)),
            until_stress: until_stress.map(|stress| (2, stress)),
            steps: None,
            increments: None,
        }
    }

    #[test]
    fn the_time_of_all_stages_follows_the_strain_and_ends_where_a_stress_decides() {
        let there_and_back = [stage(1.0, None, Some(0.02), None), stage(-0.5, None, Some(0.01), None)];
        assert!((time_of_all(&there_and_back).unwrap() - 0.04).abs() < 1e-15);
        let with_stress = [there_and_back[0].clone(), stage(1.0, None, None, Some(1e6))];
        assert_eq!(time_of_all(&with_stress), None);
        assert_eq!(steps_of_all(&with_stress), None);
        let counted = Stage { steps: Some(7), ..stage(1.0, None, None, None) };
        assert_eq!(steps_of_all(&[counted.clone(), counted]), Some(14.0));
    }

    #[test]
    fn a_stage_that_only_expands_waits_for_a_stress_in_vain_if_nothing_else_ends_it() {
        assert!(stage(-1.0, None, None, Some(1e3)).only_expands_towards_stress());
        for other in [
            stage(1.0, None, None, Some(1e3)),
            stage(-1.0, Some(1.0), None, Some(1e3)),
            stage(-1.0, None, None, Some(-1e3)),
            stage(-1.0, None, None, None),
        ] {
            assert!(!other.only_expands_towards_stress());
        }
    }
}
