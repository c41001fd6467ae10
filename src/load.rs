//! The load programme: which stage runs, what each axis does, how the cell changes in a step.

mod quasi_static;

use crate::config::{AxisControl, Kinematics, MAX_STRAIN_PER_STEP, Routine, Stage};
use crate::state::{GlobalState, StageStart};
use quasi_static::{enter_quasi_static, is_over_quasi_static, next_equilibrium_strain};

/// What one step does to time and cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepPlan {
    /// Δt \[s\], cut so that a stage ends at its end.
    pub time_step: f64,
    /// Time after the step \[s\].
    pub next_time: f64,
    /// Strain after the step.
    pub next_strain: [f64; 3],
    /// Cell sides after the step \[m\], `L = L_0 (1 − ε)`.
    pub next_sides: [f64; 3],
}

/// The stages with their kinematics.
#[derive(Debug, Clone)]
pub struct LoadProgramme {
    /// Stages in order.
    pub stages: Vec<Stage>,
    /// BCT or BC.
    pub kinematics: Kinematics,
}

impl LoadProgramme {
    /// The running stage; `None` when the run is over.
    #[must_use]
    pub fn stage(&self, global: &GlobalState) -> Option<&Stage> {
        self.stages.get(global.stage)
    }

    /// Enter the next stage while the current one is over. Returns true when the run is over. Warns of stages that
    /// were over when they began.
    pub fn settle(&self, global: &mut GlobalState, warnings: &mut Vec<String>) -> bool {
        while let Some(stage) = self.stage(global) {
            if !is_over(stage, global) {
                return false;
            }
            if global.step == global.stage_start_step || began_beyond_stress(stage, global) {
                let (number, name) = (global.stage, &stage.name);
                warnings.push(format!("stage {number} (\"{name}\") ended at once: its end was passed before"));
            }
            global.previous_stage = Some(StageStart {
                time: global.stage_start_time,
                step: global.stage_start_step,
                strain: global.stage_start_strain,
                stress: global.stage_start_stress,
            });
            global.stage += 1;
            global.stage_start_time = global.time;
            global.stage_start_step = global.step;
            global.stage_start_strain = global.strain;
            global.stage_start_stress = global.measured_stress;
            self.enter(global);
        }
        true
    }

    /// Set the strain rates with which the current stage begins; a servo begins at rest.
    pub fn enter(&self, global: &mut GlobalState) {
        let Some(stage) = self.stage(global) else { return };
        if stage.routine == Routine::QuasiStatic {
            enter_quasi_static(global);
            return;
        }
        global.strain_rate = stage.axes.map(|axis| match axis {
            AxisControl::StrainRate(rate) => rate,
            AxisControl::Stress { .. } => 0.0,
        });
    }

    /// The end of a run taken back into its last stage; `None` if that stage is over there, or where it began is unknown.
    #[must_use]
    pub fn reopened(&self, global: &GlobalState) -> Option<GlobalState> {
        let (index, start) = (global.stage.checked_sub(1)?, global.previous_stage?);
        let reopened = GlobalState {
            stage: index,
            stage_start_time: start.time,
            stage_start_step: start.step,
            stage_start_strain: start.strain,
            stage_start_stress: start.stress,
            previous_stage: None,
            ..global.clone()
        };
        self.stages.get(index).filter(|stage| !is_over(stage, &reopened)).map(|_| reopened)
    }

    /// The last step was as long as wanted, not cut so that a stage ended with it.
    #[must_use]
    pub fn last_step_was_whole(global: &GlobalState) -> bool {
        global.previous_time_step == global.time_step
            && global.previous_time.is_some_and(|before| before + global.time_step == global.time)
    }

    /// The running stage if it is quasi-static.
    #[must_use]
    pub fn quasi_static_stage(&self, global: &GlobalState) -> Option<&Stage> {
        self.stage(global).filter(|stage| stage.routine == Routine::QuasiStatic)
    }

    /// Servo: new strain rates of the stress-controlled axes from the measured stress. `modulus` is an
    /// estimate of ∂σ/∂ε \[Pa\], `interval` the time to the next measurement \[s\].
    ///
    /// The rate is proportional to the missing stress, at most `max_rate`, and at most what would close
    /// half of the gap until the next measurement.
    pub fn control(&self, global: &mut GlobalState, modulus: f64, interval: f64) {
        let Some(stage) = self.stage(global) else { return };
        for (axis, control) in stage.axes.iter().enumerate() {
            if let AxisControl::Stress { target, max_rate } = *control {
                let missing = target - global.measured_stress[axis];
                let soft = 0.5 * missing / (modulus * interval);
                let proportional = max_rate * missing / (0.1 * target.abs() + 1e-9 * modulus);
                let wanted = if soft.abs() < proportional.abs() { soft } else { proportional };
                global.strain_rate[axis] = wanted.clamp(-max_rate, max_rate);
            }
        }
    }

    /// Largest time step that the strain rates allow \[s\].
    #[must_use]
    pub fn time_step_limit(global: &GlobalState) -> f64 {
        let fastest = global.strain_rate.iter().fold(0.0_f64, |m, r| if r.abs() > m { r.abs() } else { m });
        if fastest > 0.0 { MAX_STRAIN_PER_STEP / fastest } else { f64::INFINITY }
    }

    /// Whether the stage waits in vain for a larger stress: the cell only expands, and has become longer by half without
    /// anything that touches, or by its own length.
    #[must_use]
    pub fn waits_in_vain(&self, global: &GlobalState, contacts: u64) -> bool {
        let Some(stage) = self.stage(global).filter(|stage| stage.only_expands_towards_stress()) else { return false };
        let upwards = stage.until_stress.is_some_and(|(axis, target)| target > global.stage_start_stress[axis]);
        let longer = |k: usize| global.stage_start_strain[k] - global.strain[k];
        let longest = [0, 1, 2].map(longer).into_iter().fold(0.0, f64::max);
        upwards && !passed_stress(stage, global) && (longest > 1.0 || longest > 0.5 && contacts == 0)
    }

    /// What the next step does.
    #[must_use]
    pub fn plan(&self, global: &GlobalState, wanted_time_step: f64) -> StepPlan {
        if let Some(stage) = self.quasi_static_stage(global) {
            let next_strain = next_equilibrium_strain(stage, global).unwrap_or(global.strain);
            let next_sides = [0, 1, 2].map(|k| global.initial_sides[k] * (1.0 - next_strain[k]));
            return StepPlan { time_step: wanted_time_step, next_time: global.time, next_strain, next_sides };
        }
        let end = self.stage(global).and_then(|stage| end_time(stage, global));
        let (time_step, next_time) = match end {
            // A remainder that is a hair longer than the step is taken whole.
            Some(end) if end - global.time <= wanted_time_step * (1.0 + 1e-6) => (end - global.time, end),
            _ => (wanted_time_step, global.time + wanted_time_step),
        };
        let next_strain = [0, 1, 2].map(|k| match self.stage(global).map(|stage| stage.axes[k]) {
            // From the stage's start, so that no rounding adds up.
            Some(AxisControl::StrainRate(rate)) => {
                global.stage_start_strain[k] + rate * (next_time - global.stage_start_time)
            }
            _ => global.strain[k] + global.strain_rate[k] * time_step,
        });
        let next_sides = [0, 1, 2].map(|k| global.initial_sides[k] * (1.0 - next_strain[k]));
        StepPlan { time_step, next_time, next_strain, next_sides }
    }

    /// Rate of change of the cell sides, `L̇ = −ε̇ L_0` \[m/s\].
    #[must_use]
    pub fn side_rate(global: &GlobalState) -> [f64; 3] {
        [0, 1, 2].map(|k| -global.strain_rate[k] * global.initial_sides[k])
    }
}

/// Time at which the stage ends, as far as it is known beforehand.
fn end_time(stage: &Stage, global: &GlobalState) -> Option<f64> {
    let by_duration = stage.duration.map(|duration| global.stage_start_time + duration);
    let by_strain = stage.until_strain.and_then(|(axis, target)| match stage.axes[axis] {
        AxisControl::StrainRate(rate) if rate != 0.0 => {
            Some(global.stage_start_time + (target - global.stage_start_strain[axis]) / rate)
        }
        _ => None,
    });
    match (by_duration, by_strain) {
        (Some(a), Some(b)) => Some(if a < b { a } else { b }),
        (a, b) => a.or(b),
    }
}

fn is_over(stage: &Stage, global: &GlobalState) -> bool {
    if stage.routine == Routine::QuasiStatic {
        return is_over_quasi_static(stage, global);
    }
    end_time(stage, global).is_some_and(|end| global.time >= end)
        || stage.steps.is_some_and(|steps| global.step - global.stage_start_step >= steps)
        || stage.until_strain.is_some_and(|(axis, target)| {
            matches!(stage.axes[axis], AxisControl::Stress { .. })
                && passed(global.stage_start_strain[axis], global.strain[axis], target)
        })
        || passed_stress(stage, global)
}

/// The stress that ends the stage is passed, from the side where the stage began; while the cell is only compressed a
/// compressive one from below. Both are measured before the first step of the stage.
fn passed_stress(stage: &Stage, global: &GlobalState) -> bool {
    global.step > global.stage_start_step
        && stage
            .until_stress
            .is_some_and(|(axis, target)| passed(global.stage_start_stress[axis], global.measured_stress[axis], target))
        || began_beyond_stress(stage, global)
}

/// A stage that only compresses the cell has begun with more than the compressive stress that ends it.
fn began_beyond_stress(stage: &Stage, global: &GlobalState) -> bool {
    let beyond = |(axis, target): (usize, f64)| target >= 0.0 && global.stage_start_stress[axis] > target;
    global.step > global.stage_start_step && stage.only_compresses() && stage.until_stress.is_some_and(beyond)
}

/// A value that began on one side of the target has come to it or to the other.
#[must_use]
pub fn passed(start: f64, now: f64, target: f64) -> bool {
    if target >= start { now >= target } else { now <= target }
}
