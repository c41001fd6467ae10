//! What a restart cannot change: what a run begins with, and the strain of stages that have begun.

use crate::error::{Error, Result};
use crate::state::GlobalState;
use toml::{Table, Value};

/// Keys of a species that say how its particles begin, the material whose laws their contacts' memory belongs to, and the
/// motion that driven ones have had since.
const OF_SPECIES: [&str; 9] =
    ["material", "count", "radius", "semi_axes", "aspect_ratios", "velocity", "velocity_deviation", "spin", "motion"];
/// The same of the cell, and its faces.
const OF_CELL: [&str; 4] = ["sides", "aspect", "solid_fraction", "boundary"];
/// Keys of a stage from which its strain follows, counted from where it began.
const OF_STAGE: [&str; 3] = ["routine", "strain_rate", "strain_increment"];

/// Compare the input of a restart with the one that the checkpoint holds, both resolved. Whether the run has kept an
/// energy ledger.
///
/// # Errors
/// The input changes what no longer acts, or not as it says: the particles' beginning, what velocities mean, or the strain
/// of a stage that has begun.
pub fn check(before: &str, now: &str, global: &GlobalState) -> Result<bool> {
    let read = |text: &str| text.parse::<Table>().map_err(|error| Error::Input(format!("the resolved input: {error}")));
    let (before, now) = (read(before)?, read(now)?);
    let mut changes = Changes(Vec::new());
    changes.of_keys("", &before, &now, &["seed", "packing"]);
    changes.of_tables("cell", &before, &now, &OF_CELL);
    changes.of_tables("load", &before, &now, &["kinematics"]);
    if changes.keeps_names(&before, &now) {
        changes.of_lists("species", &before, &now, &OF_SPECIES, usize::MAX);
    }
    if !changes.0.is_empty() {
        return Err(changes.refused(
            "a restart takes particles and cell from the checkpoint, so that these keys would do nothing, or not what they \
             say: put the values back (config.resolved.toml beside the checkpoint has them), or begin anew without --restart",
        ));
    }
    // A stage that is just being entered may still change.
    let begun = global.stage + usize::from(global.step != global.stage_start_step);
    changes.of_lists("stage", &before, &now, &OF_STAGE, begun);
    changes.of_controls(&before, &now, begun);
    if !changes.0.is_empty() {
        return Err(changes.refused(
            "the strain of a stage counts from where it began, so that it cannot strain otherwise on the way: put the \
             values back, end the stage where it is (duration, steps, until_strain) and add another one after it",
        ));
    }
    let ledger = before.get("output").and_then(|output| output.get("energy_ledger"));
    Ok(ledger.and_then(Value::as_bool) == Some(true))
}

/// Lines that say what has changed.
struct Changes(Vec<String>);

impl Changes {
    /// Keys of a table that have changed or are gone; what a newer program adds is no change.
    fn of_keys(&mut self, place: &str, before: &Table, now: &Table, keys: &[&str]) {
        for key in keys {
            let Some(old) = before.get(*key) else { continue };
            self.compare(&format!("{place}{key}"), old, now.get(*key));
        }
    }

    fn compare(&mut self, path: &str, old: &Value, new: Option<&Value>) {
        match (old, new) {
            // Where a file lies may change.
            _ if path.ends_with(".path") => {}
            (Value::Table(old), Some(Value::Table(new))) => {
                for (key, value) in old {
                    self.compare(&format!("{path}.{key}"), value, new.get(key));
                }
            }
            (_, Some(new)) if old == new => {}
            (_, Some(new)) => self.0.push(format!("{path} is {new} and was {old}")),
            (_, None) => self.0.push(format!("{path} is gone and was {old}")),
        }
    }

    fn of_tables(&mut self, name: &str, before: &Table, now: &Table, keys: &[&str]) {
        let table = |of: &Table| of.get(name).and_then(Value::as_table).cloned().unwrap_or_default();
        self.of_keys(&format!("{name}."), &table(before), &table(now), keys);
    }

    /// Which species there are, and in which order: particles know theirs by its number.
    fn keeps_names(&mut self, before: &Table, now: &Table) -> bool {
        let names = |of: &Table| -> Vec<String> {
            let species = of.get("species").and_then(Value::as_array).into_iter().flatten();
            species.map(|one| one.get("name").map_or_else(String::new, ToString::to_string)).collect()
        };
        let (old, new) = (names(before), names(now));
        if old != new {
            self.0.push(format!("the species are {} and were {}", new.join(", "), old.join(", ")));
        }
        old == new
    }

    /// Which axes of the first `count` stages a stress steers; its target and largest rate are free.
    fn of_controls(&mut self, before: &Table, now: &Table, count: usize) {
        let steered = |stage: Option<&Value>| -> Vec<String> {
            let stress = stage.and_then(|stage| stage.get("stress")).and_then(Value::as_table);
            stress.into_iter().flat_map(Table::keys).cloned().collect()
        };
        let stages = |of: &Table| of.get("stage").and_then(Value::as_array).cloned().unwrap_or_default();
        let (before, now) = (stages(before), stages(now));
        for (index, old) in before.iter().enumerate().take(count) {
            let (old, new) = (steered(Some(old)), steered(now.get(index)));
            if old != new {
                self.0.push(format!("stage.{index}.stress steers the axes {new:?} and steered {old:?}"));
            }
        }
    }

    /// The first `count` tables of a list.
    fn of_lists(&mut self, name: &str, before: &Table, now: &Table, keys: &[&str], count: usize) {
        let list = |of: &Table| of.get(name).and_then(Value::as_array).cloned().unwrap_or_default();
        let (before, now) = (list(before), list(now));
        for (index, old) in before.iter().enumerate().take(count) {
            let empty = Table::new();
            let [old, new] = [Some(old), now.get(index)].map(|v| v.and_then(Value::as_table).unwrap_or(&empty));
            self.of_keys(&format!("{name}.{index}."), old, new, keys);
        }
    }

    fn refused(&self, why: &str) -> Error {
        Error::Input(format!("the checkpoint does not fit this input: {}; {why}", self.0.join(", ")))
    }
}

#[cfg(test)]
mod tests;
