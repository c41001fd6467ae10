//! What a user should know of a law beside these particles: the particles are seen only once they are made, so
//! these are warnings of the run and not of the input.

use super::registry::LawChoice;
use super::{becker_kamlah, thornton_ning};
use crate::config::{Config, PairConfig, Routine, Velocities, idle};

/// Sizes of all particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sizes {
    /// Smallest semi-axis \[m\].
    pub smallest: f64,
    /// Largest ratio of two semi-axes of a particle.
    pub aspect_ratio: f64,
}

/// All warnings, none twice.
#[must_use]
pub fn of_run(config: &Config, sizes: Sizes) -> Vec<String> {
    let own = config.pairs.iter().flat_map(|pair| of_pair(pair, sizes));
    let idle = idle::warnings(config);
    let mut cautions: Vec<String> = own.chain(of_dashpots(config)).chain(config.scaled_weights()).chain(idle).collect();
    cautions.dedup();
    cautions
}

/// Springs of a pair without dashpots that are given extrapolated velocities for the sake of others.
fn of_dashpots(config: &Config) -> Option<String> {
    let moves = config.stages.iter().any(|stage| stage.routine == Routine::Dynamic);
    if config.velocities == Velocities::HalfStep || !moves {
        return None;
    }
    let undamped = |pair: &&PairConfig| {
        let rubs = pair.properties.friction > 0.0 && pair.tangential.is_some();
        rubs && !(pair.damps() && pair.tangential.as_ref().is_some_and(LawChoice::damps))
    };
    let names = |pair: &PairConfig| pair.properties.names.clone().map(|name| format!("\"{name}\"")).join(" with ");
    let mut pairs: Vec<String> = config.pairs.iter().filter(undamped).map(names).collect();
    // Pairs that never meet are copies of one that does.
    pairs.sort();
    pairs.dedup();
    (!pairs.is_empty()).then(|| {
        format!(
            "{} rub without a tangential dashpot in a run that has other dashpots or quasi-static stages: where they stick they \
             gain energy at third order in the time step; give them dashpots (restitution below 1, damping of the normal \
             and the tangential law), or take the dashpots from all pairs",
            pairs.join(", ")
        )
    })
}

/// Warnings on one pair of materials.
fn of_pair(pair: &PairConfig, sizes: Sizes) -> Vec<String> {
    let name = pair.normal.law.name;
    if name == becker_kamlah::ENTRY.name {
        becker_kamlah::caution(sizes.aspect_ratio).into_iter().collect()
    } else if name == thornton_ning::ENTRY.name {
        thornton_ning::cautions(pair, sizes.smallest)
    } else {
        Vec::new()
    }
}
