//! What a restart cannot change: what a run begins with, and the strain of stages that have begun.

mod ends;

use crate::error::{Error, Result};
use crate::load::LoadProgramme;
use crate::state::GlobalState;
use ends::{OF_END, need_stress, position};
use std::cmp::Ordering;
use toml::{Table, Value};

/// Keys of a species that say how its particles begin, the material whose laws their contacts' memory belongs to, and the
/// motion that driven ones have had since.
const OF_SPECIES: [&str; 9] =
    ["material", "count", "radius", "semi_axes", "aspect_ratios", "velocity", "velocity_deviation", "spin", "motion"];
/// The same of the cell, and its faces.
const OF_CELL: [&str; 4] = ["sides", "aspect", "solid_fraction", "boundary"];
/// Keys of a stage from which its strain follows, counted from where it began; without them the cell stays as it is.
const OF_STRAIN: [&str; 2] = ["strain_rate", "strain_increment"];

/// Changed ends of stages that have acted already.
pub struct PassedEnds {
    /// What has changed.
    pub changes: Vec<String>,
    /// The run was complete, and only its last stage ends otherwise.
    pub last_of_complete: bool,
    /// The state lies beyond a new end, or the old one has cut its last step or increment, or whether the stress that now
    /// ends the stage has been passed was not measured: only older states lead to the new ends.
    pub too_late: bool,
}

/// Compare the ends of stages that are over or have begun with those that the checkpoint's input has, both resolved. That
/// the running stage ends later, or sooner but not yet, is no change.
///
/// # Errors
/// An input cannot be read.
pub fn passed_ends(before: &str, now: &str, global: &GlobalState) -> Result<PassedEnds> {
    let (before, now) = (stages(&read(before)?), stages(&read(now)?));
    let mut changes = Changes(Vec::new());
    let mut last_of_complete = global.stage == before.len();
    for (index, (old, (_, new))) in before.iter().zip(&now).enumerate().take(global.stage) {
        let known = changes.0.len();
        changes.of_ends(old, new);
        last_of_complete &= index + 1 == before.len() || changes.0.len() == known;
    }
    let unmeasured = |stage: &Table| stage.contains_key("until_stress") && !relaxes(stage) && !need_stress(&before);
    if last_of_complete {
        let too_late = !changes.0.is_empty() && now.get(before.len() - 1).is_some_and(|(_, last)| unmeasured(last));
        return Ok(PassedEnds { last_of_complete, too_late, changes: changes.0 });
    }
    let begun = global.step != global.stage_start_step && changes.0.is_empty();
    let mut too_late = false;
    if let (true, Some(old), Some((_, new))) = (begun, before.get(global.stage), now.get(global.stage)) {
        changes.of_ends(old, new);
        let cut = global.quasi_static.is_some_and(|_| old.1.contains_key("strain_increment"))
            || !LoadProgramme::last_step_was_whole(global);
        too_late = !changes.0.is_empty()
            && (position(new, global) == Ordering::Greater
                || unmeasured(new)
                || cut && position(&old.1, global) != Ordering::Less);
        if !too_late {
            changes.0.clear();
        }
    }
    Ok(PassedEnds { last_of_complete, too_late, changes: changes.0 })
}

/// Keys that only quasi-static stages have.
fn relaxes(stage: &Table) -> bool {
    ["strain_increment", "relax"].iter().any(|key| stage.contains_key(*key))
}

/// The routine of a stage of this input.
fn routine(stage: &Table, root: &Table) -> String {
    if relaxes(stage) {
        return "quasi_static".to_owned();
    }
    let given = stage.get("routine").or_else(|| root.get("load").and_then(|load| load.get("routine")));
    given.and_then(Value::as_str).unwrap_or("dynamic").to_owned()
}

fn read(text: &str) -> Result<Table> {
    text.parse::<Table>().map_err(|error| Error::Input(format!("the resolved input: {error}")))
}

/// The tables of a list with their paths.
fn list(of: &Table, name: &str) -> Vec<(String, Table)> {
    let tables = of.get(name).and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_table);
    tables.enumerate().map(|(index, table)| (format!("{name}.{index}"), table.clone())).collect()
}

/// The stages as they follow each other, cycles written out.
fn stages(of: &Table) -> Vec<(String, Table)> {
    let mut stages = Vec::new();
    for (path, stage) in list(of, "stage") {
        let parts = list(&stage, "part");
        let cycles = stage.get("cycles").and_then(Value::as_integer).unwrap_or(1);
        if parts.is_empty() {
            stages.push((path, stage));
        } else {
            let one = || parts.iter().map(|(part, table)| (format!("{path}.{part}"), table.clone()));
            (0..cycles).for_each(|_| stages.extend(one()));
        }
    }
    stages
}

/// Compare the input of a restart with the one that the checkpoint holds, both resolved. Whether the run has kept an
/// energy ledger.
///
/// # Errors
/// The input changes what no longer acts, or not as it says: the particles' beginning, what velocities mean, or the strain
/// of a stage that has begun.
pub fn check(before: &str, now: &str, global: &GlobalState) -> Result<bool> {
    let (before, now) = (read(before)?, read(now)?);
    let mut changes = Changes(Vec::new());
    changes.of_keys("", &before, &now, &["seed", "packing"]);
    changes.of_tables("cell", &before, &now, &OF_CELL);
    changes.of_tables("load", &before, &now, &["kinematics"]);
    if changes.keeps_names(&before, &now) {
        changes.of_lists(&list(&before, "species"), &list(&now, "species"), &OF_SPECIES);
    }
    if !changes.0.is_empty() {
        return Err(changes.refused(
            "a restart takes particles and cell from the checkpoint, so that these keys would do nothing, or not what they \
             say: put the values back (config.resolved.toml beside the checkpoint has them), or begin anew without --restart",
        ));
    }
    // A stage that is just being entered may still change.
    let begun = global.stage + usize::from(global.step != global.stage_start_step);
    let (mut old, new) = (stages(&before), stages(&now));
    old.truncate(begun);
    changes.of_strains(&old, &new, [&before, &now]);
    changes.of_controls(&old, &new);
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
    /// Cycles would say the same again.
    fn note(&mut self, line: String) {
        if !self.0.contains(&line) {
            self.0.push(line);
        }
    }

    /// Ends of a stage that have changed, are gone or new.
    fn of_ends(&mut self, (label, old): &(String, Table), new: &Table) {
        self.of_keys(&format!("{label}."), old, new, &OF_END);
        for key in OF_END.iter().filter(|key| !old.contains_key(**key)) {
            if let Some(new) = new.get(*key) {
                self.note(format!("{label}.{key} is {new} and was not there"));
            }
        }
    }

    /// Routines and strains of stages that have begun.
    fn of_strains(&mut self, before: &[(String, Table)], now: &[(String, Table)], roots: [&Table; 2]) {
        let none = Value::Array(vec![Value::Float(0.0); 3]);
        for (index, (path, old)) in before.iter().enumerate() {
            let Some((_, new)) = now.get(index) else {
                self.note(format!("{path}, which has begun, is gone"));
                continue;
            };
            for key in OF_STRAIN {
                let [old, new] = [old, new].map(|stage| stage.get(key).unwrap_or(&none));
                self.compare(&format!("{path}.{key}"), old, Some(new));
            }
            let [old, new] = [(old, roots[0]), (new, roots[1])].map(|(stage, root)| routine(stage, root));
            if old != new {
                self.note(format!("{path} is {new} and was {old}"));
            }
        }
    }

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
            (_, Some(new)) => self.note(format!("{path} is {new} and was {old}")),
            (_, None) => self.note(format!("{path} is gone and was {old}")),
        }
    }

    fn of_tables(&mut self, name: &str, before: &Table, now: &Table, keys: &[&str]) {
        let table = |of: &Table| of.get(name).and_then(Value::as_table).cloned().unwrap_or_default();
        self.of_keys(&format!("{name}."), &table(before), &table(now), keys);
    }

    /// Which species there are, and in which order: particles know theirs by its number.
    fn keeps_names(&mut self, before: &Table, now: &Table) -> bool {
        let names = |of: &Table| -> Vec<String> {
            let name = |(_, species): (String, Table)| species.get("name").map_or_else(String::new, Value::to_string);
            list(of, "species").into_iter().map(name).collect()
        };
        let (old, new) = (names(before), names(now));
        if old != new {
            self.note(format!("the species are {} and were {}", new.join(", "), old.join(", ")));
        }
        old == new
    }

    /// Which axes of stages a stress steers; its target and largest rate are free.
    fn of_controls(&mut self, before: &[(String, Table)], now: &[(String, Table)]) {
        let steered = |stage: Option<&(String, Table)>| -> Vec<String> {
            let stress = stage.and_then(|(_, stage)| stage.get("stress")).and_then(Value::as_table);
            stress.into_iter().flat_map(Table::keys).cloned().collect()
        };
        for (index, stage) in before.iter().enumerate() {
            let (old, new) = (steered(Some(stage)), steered(now.get(index)));
            if old != new {
                self.note(format!("{}.stress steers the axes {new:?} and steered {old:?}", stage.0));
            }
        }
    }

    /// Tables of lists.
    fn of_lists(&mut self, before: &[(String, Table)], now: &[(String, Table)], keys: &[&str]) {
        let empty = Table::new();
        for (index, (path, old)) in before.iter().enumerate() {
            let new = now.get(index).map_or(&empty, |(_, table)| table);
            self.of_keys(&format!("{path}."), old, new, keys);
        }
    }

    fn refused(&self, why: &str) -> Error {
        Error::Input(format!("the checkpoint does not fit this input: {}; {why}", self.0.join(", ")))
    }
}

#[cfg(test)]
mod tests;
