//! What the sheet says of quasi-static stages.

use super::{Estimate, Limit, Meeting, Table, contact_time, ellipsoids, quantity};
use crate::config::{AxisControl, Config, Damping, Routine, Stage};

/// Stages of the quasi-static routine.
fn stages(config: &Config) -> impl Iterator<Item = &Stage> {
    config.stages.iter().filter(|stage| stage.routine == Routine::QuasiStatic)
}

/// Rows about increments, substeps and the pseudo time step; none without quasi-static stages.
pub(super) fn rows(table: &mut Table, config: &Config, estimate: &Estimate) {
    let count = stages(config).count();
    if count == 0 {
        return;
    }
    let settings = &config.quasi_static;
    let known = if stages(config).any(|stage| stage.until_stress.is_some()) { " at most or unknown" } else { "" };
    table.row(
        "quasi-static increments",
        format!(
            "{:.0}{known}, tested for equilibrium every {} substeps",
            estimate.progress.increments, settings.substeps
        ),
    );
    let damping = match settings.damping {
        Damping::Fire { mixing } => format!("fire (mixing {mixing})"),
        Damping::Local { coefficient } => format!("local (coefficient {coefficient})"),
        Damping::Viscous { share } => format!("viscous (share {share} per substep)"),
        Damping::Contact => "dashpots of the contact laws only".to_owned(),
    };
    table.row("artificial damping", damping);
    let largest = stages(config).flat_map(|stage| stage.axes).fold(0.0_f64, |most, axis| match axis {
        AxisControl::StrainRate(increment) => most.max(increment.abs()),
        AxisControl::Stress { .. } => most,
    });
    table.row("largest strain increment", format!("{largest:.1e}"));
    let overlap = |meeting: &Meeting| estimate.overlap_of(meeting).0.max(2.0 * largest);
    if let Some(Limit { time, pair, .. }) = contact_time(config, overlap) {
        let step = config.quasi_static_safety(ellipsoids(config)) * time;
        let text =
            format!("{} at the expected overlap, limited by {pair}; it has no physical meaning", quantity(step, "s"));
        table.row("pseudo time step", text);
    }
    for material in config.materials.iter().filter(|material| !material.maxwell.is_empty()) {
        let text = "taken as relaxed in quasi-static stages: the long-term modulus alone";
        table.row(format!("Maxwell branches of {}", material.name), text);
    }
}
