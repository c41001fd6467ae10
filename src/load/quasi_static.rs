//! Increments of quasi-static stages: the strain of each and which is the last. Strain rates of these stages
//! count per increment.

use super::passed_stress;
use crate::config::{AxisControl, Stage};
use crate::state::{GlobalState, QuasiStaticState};

/// A cell at rest, before the strain of the first increment.
pub(super) fn enter_quasi_static(global: &mut GlobalState) {
    let increments = global.quasi_static.map_or(0, |state| state.increments);
    global.strain_rate = [0.0; 3];
    global.quasi_static =
        Some(QuasiStaticState { increments, stage_start_increments: increments, substep: 0, mixing: 0.0, downhill: 0 });
}

/// Increments of the current stage that have reached equilibrium.
fn increments_of_stage(global: &GlobalState) -> u64 {
    global.quasi_static.map_or(0, |state| state.increments - state.stage_start_increments)
}

/// Axis and strain that end the stage, and the number of increments from its start; the last one may be a part.
fn increments_to_strain(stage: &Stage, global: &GlobalState) -> Option<(usize, f64, f64)> {
    let (axis, target) = stage.until_strain?;
    match stage.axes[axis] {
        AxisControl::StrainRate(increment) if increment != 0.0 => {
            Some((axis, target, (target - global.stage_start_strain[axis]) / increment))
        }
        _ => None,
    }
}

/// Strain to which the cell jumps in the next substep; `None` while an increment is being equilibrated.
pub(super) fn next_equilibrium_strain(stage: &Stage, global: &GlobalState) -> Option<[f64; 3]> {
    if global.quasi_static.is_some_and(|state| state.substep > 0) {
        return None;
    }
    let next = (increments_of_stage(global) + 1) as f64;
    let last = increments_to_strain(stage, global).filter(|(_, _, count)| *count <= next * (1.0 + 1e-9));
    let count = last.map_or(next, |(_, _, count)| count);
    // From the stage's start, so that no rounding adds up.
    let mut strain = [0, 1, 2].map(|k| match stage.axes[k] {
        AxisControl::StrainRate(increment) => global.stage_start_strain[k] + increment * count,
        AxisControl::Stress { .. } => global.strain[k],
    });
    if let Some((axis, target, _)) = last {
        strain[axis] = target;
    }
    Some(strain)
}

/// Whether the stage ends with the equilibrium just found.
pub(super) fn is_over_quasi_static(stage: &Stage, global: &GlobalState) -> bool {
    let done = increments_of_stage(global);
    global.quasi_static.is_some_and(|state| state.substep == 0)
        && (stage.increments.is_some_and(|increments| done >= increments)
            || increments_to_strain(stage, global).is_some_and(|(_, _, count)| done as f64 >= count * (1.0 - 1e-9))
            || done > 0 && passed_stress(stage, global))
}
