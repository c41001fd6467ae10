//! Where a state lies beside the ends of its stage, as a resolved input has them.

use crate::load::passed;
use crate::state::GlobalState;
use std::cmp::Ordering;
use toml::{Table, Value};

/// Keys that end a stage.
pub const OF_END: [&str; 5] = ["duration", "until_strain", "until_stress", "steps", "increments"];

/// Some stage is steered or ended by a stress, so that the run measures it.
pub fn need_stress(stages: &[(String, Table)]) -> bool {
    stages.iter().any(|(_, stage)| ["stress", "until_stress"].iter().any(|key| stage.contains_key(*key)))
}

/// Whether the state lies before every end of the stage in which it is, at one of them or beyond one.
pub fn position(stage: &Table, global: &GlobalState) -> Ordering {
    let end = |key: &str| stage.get(key).and_then(number);
    let order = |now: f64, end: f64| now.total_cmp(&end);
    let of_steps = end("steps").map(|steps| order((global.step - global.stage_start_step) as f64, steps));
    let of_time = end("duration").map(|duration| order(global.time, global.stage_start_time + duration));
    let of_increments = end("increments").zip(global.quasi_static).map(|(increments, state)| {
        // One that has begun lies beyond the equilibrium before.
        let begun = if state.substep > 0 { 0.5 } else { 0.0 };
        order((state.increments - state.stage_start_increments) as f64 + begun, increments)
    });
    let positions = [of_steps, of_time, of_increments, of_strain(stage, global), of_stress(stage, global)];
    positions.into_iter().flatten().max().unwrap_or(Ordering::Less)
}

fn of_strain(stage: &Table, global: &GlobalState) -> Option<Ordering> {
    let (axis, target) = axis_of(stage, "until_strain")?;
    let (start, now) = (global.stage_start_strain[axis], global.strain[axis]);
    Some(match rates(stage)[axis] {
        rate if rate != 0.0 && global.quasi_static.is_some() && stage.contains_key("strain_increment") => {
            (rate.signum() * (now - target)).total_cmp(&0.0)
        }
        rate if rate != 0.0 => global.time.total_cmp(&(global.stage_start_time + (target - start) / rate)),
        _ => of_passing(passed(start, now, target)),
    })
}

fn of_stress(stage: &Table, global: &GlobalState) -> Option<Ordering> {
    let (axis, target) = axis_of(stage, "until_stress")?;
    let (start, now) = (global.stage_start_stress[axis], global.measured_stress[axis]);
    Some(of_passing(passed(start, now, target)))
}

fn of_passing(passed: bool) -> Ordering {
    if passed { Ordering::Greater } else { Ordering::Less }
}

/// Strain rates or increments per axis.
fn rates(stage: &Table) -> [f64; 3] {
    let given = ["strain_rate", "strain_increment"].iter().find_map(|key| stage.get(*key)).and_then(Value::as_array);
    std::array::from_fn(|axis| given.and_then(|rates| rates.get(axis)).and_then(number).unwrap_or(0.0))
}

fn axis_of(stage: &Table, key: &str) -> Option<(usize, f64)> {
    let end = stage.get(key)?;
    ["x", "y", "z"].iter().enumerate().find_map(|(axis, name)| Some((axis, number(end.get(name)?)?)))
}

fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}
