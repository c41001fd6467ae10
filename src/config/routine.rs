//! Reads what the quasi-static routine needs: its settings and its stages.

use super::alternatives::Chosen;
use super::section::Section;
use super::stages::Ends;
use super::{AxisControl, Motion, Species, Stage};

/// How a stage proceeds (W Fig. 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Routine {
    /// In physical time, one strain increment per step.
    Dynamic,
    /// From equilibrium to equilibrium; time does not pass.
    QuasiStatic,
}

/// Artificial damping of the substeps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Damping {
    /// All velocities turn towards the forces, and stop when they go uphill.
    Fire {
        /// Mixing α after a stop.
        mixing: f64,
    },
    /// Against each velocity a share of the force.
    Local {
        /// The share.
        coefficient: f64,
    },
    /// Every velocity loses the same share.
    Viscous {
        /// The share per substep.
        share: f64,
    },
    /// Dashpots of the contact laws only.
    Contact,
}

/// Settings of the quasi-static routine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuasiStaticConfig {
    /// Substeps per block.
    pub substeps: u64,
    /// Blocks that one increment may take.
    pub max_blocks: u64,
    /// What removes the kinetic energy.
    pub damping: Damping,
    /// Restitution coefficient of the contact laws' dashpots in quasi-static stages.
    pub restitution: f64,
    /// Factor β of the pseudo time step.
    pub safety: f64,
    /// Largest mean unbalanced force over mean contact force at equilibrium.
    pub max_unbalanced_ratio: f64,
    /// Largest kinetic over elastic energy at equilibrium.
    pub max_kinetic_ratio: f64,
    /// Largest way of a particle in one more block, over the largest radius, at equilibrium.
    pub max_displacement_ratio: f64,
    /// Overlap over radius whose Hertz force is the least to which unbalanced forces are compared.
    pub touching_overlap: f64,
}

/// The routine of stages that name none.
pub(super) fn of_load(root: &Section) -> Routine {
    let chosen = root.reopened("load").and_then(|load| load.choice("routine"));
    if chosen == Some(1) { Routine::QuasiStatic } else { Routine::Dynamic }
}

/// The routine of a stage: as named, else the common one. `None`: a faulty name, reported.
pub(super) fn of_stage(section: &Section, common: Routine) -> Option<Routine> {
    if !section.given("routine") {
        return Some(common);
    }
    section.choice("routine").map(|index| [Routine::Dynamic, Routine::QuasiStatic][index])
}

/// Read `[load.quasi_static]`.
pub(super) fn read(root: &Section) -> Option<QuasiStaticConfig> {
    let section = root.reopened("load")?.table("quasi_static")?;
    let (substeps, max_blocks) = (section.integer("substeps"), section.integer("max_blocks"));
    let damping = match section.choose("damping") {
        Some(Chosen::Table("fire", table)) => table.number("mixing").map(|mixing| Damping::Fire { mixing }),
        Some(Chosen::Table("local", table)) => {
            table.number("coefficient").map(|coefficient| Damping::Local { coefficient })
        }
        Some(Chosen::Table("viscous", table)) => table.number("share").map(|share| Damping::Viscous { share }),
        Some(Chosen::Table(..)) => Some(Damping::Contact),
        _ => None,
    };
    let (restitution, safety) = (section.number("restitution"), section.number("safety"));
    let thresholds = ["max_unbalanced_ratio", "max_kinetic_ratio", "max_displacement_ratio", "touching_overlap"];
    let [unbalanced, kinetic, displacement, touching] = thresholds.map(|name| section.number(name));
    Some(QuasiStaticConfig {
        substeps: substeps?,
        max_blocks: max_blocks?,
        damping: damping?,
        restitution: restitution?,
        safety: safety?,
        max_unbalanced_ratio: unbalanced?,
        max_kinetic_ratio: kinetic?,
        max_displacement_ratio: displacement?,
        touching_overlap: touching?,
    })
}

/// Whether all keys of the stage belong to its routine; those that do not are reported.
pub(super) fn refuse_keys_of_the_other(section: &Section, routine: Routine) -> bool {
    let (keys, message, remedy): (&[&str], _, _) = match routine {
        Routine::Dynamic => (
            &["strain_increment", "increments", "relax"],
            "belongs to the quasi-static routine, and this stage is dynamic",
            "add routine = \"quasi_static\" here or in [load], or give strain_rate, stress or hold",
        ),
        Routine::QuasiStatic => (
            &["strain_rate", "stress", "hold", "duration", "steps"],
            "has no meaning in a quasi-static stage, where time does not pass",
            "give strain_increment with until_strain, until_stress or increments, or relax = true; or add \
             routine = \"dynamic\"",
        ),
    };
    let given: Vec<_> = keys.iter().filter(|key| section.given(key)).collect();
    for key in &given {
        section.problem(key, message, remedy);
    }
    given.is_empty()
}

/// Read a quasi-static stage. Its strain rates count per increment.
pub(super) fn read_stage(section: &Section, name: String, (until_strain, until_stress): Ends) -> Option<Stage> {
    let increment = section.axes("strain_increment");
    let increments = section.integer("increments");
    let relax = section.flag("relax");
    let ends = ["until_strain", "until_stress", "increments"];
    let increments = match (relax == Some(true), section.given("strain_increment")) {
        (true, true) => {
            section.problem("relax", "a relaxing cell has no strain_increment", "remove one of the two");
            return None;
        }
        (true, false) => {
            for key in ends.into_iter().filter(|key| section.given(key)) {
                section.problem(key, "has no effect beside relax = true, which ends at equilibrium", "remove it");
            }
            Some(1)
        }
        (false, false) => {
            let remedy = "give strain_increment, for example {z = 1e-4}, or relax = true";
            section.problem("strain_increment", "the quasi-static stage says nothing of its load", remedy);
            return None;
        }
        (false, true) => increments,
    };
    let increment = if relax == Some(true) { [0.0; 3] } else { increment? };
    if relax != Some(true) {
        if increment == [0.0; 3] {
            let remedy = "give a strain other than 0, or relax = true";
            section.problem("strain_increment", "is 0 on every axis", remedy);
            return None;
        }
        if !ends.iter().any(|key| section.given(key)) {
            let remedy = "give until_strain, until_stress or increments";
            section.problem("increments", "the stage has no end condition", remedy);
            return None;
        }
    }
    Some(Stage {
        name,
        routine: Routine::QuasiStatic,
        axes: increment.map(AxisControl::StrainRate),
        duration: None,
        until_strain,
        until_stress,
        steps: None,
        increments,
    })
}

/// Whether everything in the input has a meaning in quasi-static stages, or else without any.
pub(super) fn check(root: &Section, stages: &[Stage], species: Option<&[Species]>) {
    if stages.iter().all(|stage| stage.routine == Routine::Dynamic) {
        for key in ["history", "snapshots"] {
            if let Some(output) = root.reopened("output").filter(|output| output.counts_increments(key)) {
                let remedy = "give a time or a number of steps, or make a stage quasi-static";
                output.problem(key, "counts increments, which only quasi-static stages have", remedy);
            }
        }
        return;
    }
    if let Some(output) = root.reopened("output").filter(|output| output.flag("energy_ledger") == Some(true)) {
        let message = "there is no energy balance in quasi-static stages: artificial damping removes what does not fit";
        output.problem("energy_ledger", message, "remove it, or make every stage dynamic");
    }
    let moves =
        |motion: &Motion| matches!(motion, Motion::Driven { velocity, spin } if [velocity, spin] != [&[0.0; 3]; 2]);
    for species in species.unwrap_or(&[]).iter().filter(|species| moves(&species.motion)) {
        let message = format!(
            "\"{}\" is driven, and a velocity has no meaning in quasi-static stages, where time does not pass",
            species.name
        );
        root.problem("species", message, "use motion = \"fixed\", or make every stage dynamic");
    }
}
