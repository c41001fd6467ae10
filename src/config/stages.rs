//! Reads the load programme and checks that every stage can end.

use super::programme::{Progress, advance};
use super::routine::{self, Routine};
use super::section::Section;
use super::{AxisControl, Boundary, CellConfig, Kinematics, Motion, PackingConfig, Replication, Species, Stage};

const AXES: [&str; 3] = ["x", "y", "z"];

/// What all stages share: load type and control interval.
pub(super) fn read_load(root: &Section) -> Option<(Kinematics, u64)> {
    let section = root.table("load")?;
    let kinematics = section.choice("kinematics").map(|index| [Kinematics::Bct, Kinematics::Bc][index]);
    let interval = section.integer("control_interval");
    Some((kinematics?, interval?))
}

/// What stages need to know of the rest of the input.
pub(super) struct Beginning<'a> {
    /// The cell, if it is right.
    pub cell: Option<&'a CellConfig>,
    /// At first nothing moves and particles just touch.
    pub unstressed: bool,
}

/// Whether the run begins without stress: particles at rest in a packing that ends with them just touching.
pub(super) fn begins_unstressed(
    gravity: [f64; 3],
    species: &[Species],
    (packing, replication): &(PackingConfig, Replication),
) -> bool {
    let touching = matches!(packing, PackingConfig::RandomClose { .. } | PackingConfig::DropAndRoll(_));
    let at_rest = |one: &Species| match one.motion {
        Motion::Free => one.velocity == [0.0; 3] && one.velocity_deviation == 0.0 && one.spin == [0.0; 3],
        Motion::Driven { velocity, spin } => velocity == [0.0; 3] && spin == [0.0; 3],
    };
    touching && replication.perturbation == 0.0 && gravity == [0.0; 3] && species.iter().all(at_rest)
}

/// Read `[[stage]]`, cycles written out.
pub(super) fn read(root: &Section, beginning: &Beginning, routine: Routine) -> Option<Vec<Stage>> {
    let cell = beginning.cell;
    let mut stages: Vec<Option<Stage>> = Vec::new();
    let mut progress = Progress { unstressed: beginning.unstressed, ..Progress::default() };
    for (index, section) in root.list("stage").iter().enumerate() {
        let name = section.text_or("name", &format!("stage {}", index + 1)).unwrap_or_default();
        let cycles = section.integer("cycles");
        let parts = section.list("part");
        if !section.given("cycles") && !section.given("part") {
            let stage = read_stage(section, name, cell, routine);
            push(section, &mut stages, &mut progress, stage);
            continue;
        }
        refuse_own_load(section);
        if section.is_empty_list("part") {
            section.problem("part", "is an empty list", "say what one cycle consists of, in [[stage.part]] sections");
        }
        let parts: Vec<(Option<Stage>, Section)> = parts
            .into_iter()
            .enumerate()
            .map(|(k, part)| {
                let name = part.text_or("name", &format!("part {}", k + 1)).unwrap_or_default();
                (read_stage(&part, name, cell, routine), part)
            })
            .collect();
        let cycles = cycles.unwrap_or(1);
        if cycles.saturating_mul(parts.len().max(1) as u64) > MAX_STAGES {
            section.problem(
                "cycles",
                format!("{cycles} cycles of {} parts", parts.len()),
                "at most 100000 stages in all",
            );
            return None;
        }
        for cycle in 1..=cycles {
            for (part, part_section) in &parts {
                let stage = part.clone().map(|s| Stage { name: format!("{name} {cycle}/{cycles}: {}", s.name), ..s });
                push(part_section, &mut stages, &mut progress, stage);
            }
        }
    }
    stages.into_iter().collect()
}

const MAX_STAGES: u64 = 100_000;

/// Keys of a stage that say what it does.
const OWN_LOAD: [&str; 11] = [
    "strain_rate",
    "stress",
    "hold",
    "duration",
    "until_strain",
    "until_stress",
    "steps",
    "routine",
    "strain_increment",
    "increments",
    "relax",
];

fn refuse_own_load(section: &Section) {
    if !section.given("part") {
        section.problem("part", "missing", "say what one cycle consists of, in [[stage.part]] sections");
    }
    if !section.given("cycles") {
        section.problem("cycles", "missing", "say how often the parts are run, for example cycles = 3");
    }
    for key in OWN_LOAD.into_iter().filter(|key| section.given(key)) {
        section.problem(key, "has no effect beside [[stage.part]]", "move it into a [[stage.part]]");
    }
}

fn read_stage(section: &Section, name: String, cell: Option<&CellConfig>, common: Routine) -> Option<Stage> {
    let routine = routine::of_stage(section, common)?;
    if !routine::refuse_keys_of_the_other(section, routine) {
        return None;
    }
    let ends = (one_axis(section, "until_strain"), one_axis(section, "until_stress"));
    match routine {
        Routine::Dynamic => read_dynamic(section, name, cell, ends),
        Routine::QuasiStatic => routine::read_stage(section, name, ends),
    }
}

/// Ends of a stage by strain and by stress: axis and value.
pub(super) type Ends = (Option<(usize, f64)>, Option<(usize, f64)>);

fn read_dynamic(
    section: &Section,
    name: String,
    cell: Option<&CellConfig>,
    (until_strain, until_stress): Ends,
) -> Option<Stage> {
    let rates = section.axes("strain_rate");
    let hold = section.flag("hold");
    let servos = read_servos(section, cell);
    let duration = section.number("duration");
    let steps = section.integer("steps");
    let given = ["strain_rate", "stress", "hold"].map(|key| section.given(key));
    if given == [false; 3] || hold == Some(false) && !given[0] && !given[1] {
        section.problem(
            "strain_rate",
            "the stage says nothing of its load",
            "give `strain_rate`, `stress`, or hold = true",
        );
        return None;
    }
    if hold == Some(true) && (given[0] || given[1]) {
        section.problem("hold", "a held cell has no strain_rate or stress", "remove hold, or the other key");
        return None;
    }
    if !["duration", "steps", "until_strain", "until_stress"].iter().any(|key| section.given(key)) {
        section.problem(
            "duration",
            "the stage has no end condition",
            "give duration, until_strain, until_stress or steps",
        );
        return None;
    }
    let rates = if given[0] { rates? } else { [0.0; 3] };
    let servos = servos?;
    for axis in 0..3 {
        if servos[axis].is_some() && rates[axis] != 0.0 {
            let message = format!("the {} axis has a strain rate and a stress", AXES[axis]);
            section.problem("strain_rate", message, "give each axis one of them, for example strain_rate = {z = …}");
            return None;
        }
    }
    let axes = [0, 1, 2].map(|axis| servos[axis].unwrap_or(AxisControl::StrainRate(rates[axis])));
    let routine = Routine::Dynamic;
    Some(Stage { name, routine, axes, duration, until_strain, until_stress, steps, increments: None })
}

fn read_servos(section: &Section, cell: Option<&CellConfig>) -> Option<[Option<AxisControl>; 3]> {
    let Some(stress) = section.table("stress") else { return Some([None; 3]) };
    let mut faulty = false;
    let servos = [0, 1, 2].map(|axis| {
        let servo = stress.table(AXES[axis])?;
        if cell.is_some_and(|cell| cell.boundary[axis] != Boundary::Periodic) {
            let message =
                format!("the {} axis has walls, and the servo holds the stress of periodic axes only", AXES[axis]);
            stress.problem(AXES[axis], message, "use boundary = \"periodic\" on this axis, or a strain_rate");
            faulty = true;
        }
        let (target, max_rate) = (servo.number("target"), servo.number("max_rate"));
        let control = target.zip(max_rate).map(|(target, max_rate)| AxisControl::Stress { target, max_rate });
        faulty |= control.is_none();
        control
    });
    if servos == [None; 3] && !faulty {
        section.problem(
            "stress",
            "no axis is given",
            "write, for example, stress = {z = {target = \"1 MPa\", max_rate = \"0.1 1/s\"}}",
        );
        return None;
    }
    (!faulty).then_some(servos)
}

/// The single axis of `until_strain` or `until_stress` and its value.
fn one_axis(section: &Section, name: &str) -> Option<(usize, f64)> {
    let table = section.table(name)?;
    let values = AXES.map(|axis| table.number(axis));
    let given: Vec<usize> = (0..3).filter(|axis| table.given(AXES[*axis])).collect();
    if given.is_empty() && !table.is_empty() {
        return None; // unknown axes, reported as such
    }
    let [axis] = given[..] else {
        section.problem(
            name,
            format!("{} axes are given", given.len()),
            format!("give one axis, for example {name} = {{z = …}}"),
        );
        return None;
    };
    Some((axis, values[axis]?))
}

/// Append a stage if it can end, following the strain as far as it is known.
fn push(section: &Section, stages: &mut Vec<Option<Stage>>, progress: &mut Progress, stage: Option<Stage>) {
    let Some(stage) = stage else {
        progress.lose_track();
        stages.push(None);
        return;
    };
    let only_strain =
        stage.duration.is_none() && stage.steps.is_none() && stage.increments.is_none() && stage.until_stress.is_none();
    if let Some((axis, target)) = stage.until_strain
        && let AxisControl::StrainRate(rate) = stage.axes[axis]
    {
        let start = progress.strain[axis];
        // What lies behind would end the stage before its first step, whatever else may end it.
        let behind = rate != 0.0 && start.is_some_and(|start| (target - start) * rate <= 0.0);
        if behind || rate == 0.0 {
            let start = start.map_or_else(String::new, |start| format!(" from strain {start}"));
            let (what, sign, end) = match stage.routine {
                Routine::Dynamic => (format!("at strain rate {rate} 1/s"), "strain rate's", "duration"),
                Routine::QuasiStatic => (format!("in increments of {rate}"), "increment's", "increments"),
            };
            let message = format!("never reached{start} {what} of the {} axis", AXES[axis]);
            let other = if only_strain { format!("end by {end}") } else { "remove it".to_owned() };
            let mend =
                if rate == 0.0 { "strain the axis".to_owned() } else { format!("change the value, the {sign} sign") };
            section.problem("until_strain", message, format!("{mend}, or {other}"));
            progress.lose_track();
            stages.push(None);
            return;
        }
    }
    if progress.unstressed && stage.only_expands_towards_stress() {
        let rates = if stage.routine == Routine::Dynamic { "strain rate" } else { "strain increment" };
        let message = "never reached: nothing is stressed so far, and the cell only expands".to_owned();
        section.problem("until_stress", message, format!("give a positive {rates} (compression), or another end"));
        progress.lose_track();
        stages.push(None);
        return;
    }
    advance(progress, &stage);
    for axis in 0..3 {
        if progress.strain[axis].is_some_and(|strain| strain >= 1.0) {
            let message = format!("the {} axis reaches a strain of 1 or more: the cell collapses", AXES[axis]);
            let (key, slower) = match stage.routine {
                Routine::Dynamic => ("strain_rate", "strain more slowly"),
                Routine::QuasiStatic => ("strain_increment", "strain less per increment"),
            };
            section.problem(key, message, format!("end the stage earlier, or {slower} (compression is positive)"));
            progress.lose_track();
            stages.push(None);
            return;
        }
    }
    stages.push(Some(stage));
}
