//! The velocities that the laws of a run are given.

use super::{PairConfig, Routine, Stage};
use crate::force::registry::LawChoice;

/// The velocities that laws are given.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Velocities {
    /// At the full step, extrapolated with the last acceleration (W 2.3): what dashpots need.
    #[default]
    FullStep,
    /// At the half step before: what led to the present positions. Without dashpots springs need nothing else, and with
    /// increments that are true displacements they neither gain nor lose energy, up to Δt = 2/ω.
    HalfStep,
}

impl Velocities {
    /// Velocities of the half step where no contact has a dashpot. The quasi-static routine adds dashpots of its own.
    pub(super) fn of(pairs: &[PairConfig], stages: &[Stage]) -> Velocities {
        let rolling = |pair: &PairConfig| pair.rolling.as_ref().is_some_and(LawChoice::damps);
        let quasi_static = stages.iter().any(|stage| stage.routine == Routine::QuasiStatic);
        if quasi_static || pairs.iter().any(|pair| pair.damps() || rolling(pair)) {
            Velocities::FullStep
        } else {
            Velocities::HalfStep
        }
    }

    /// The share of a step's increment `velocity · Δt` that a stored force takes in before it is evaluated; the rest comes
    /// after. With full-step velocities the trapezoidal rule.
    #[must_use]
    pub fn share_before(self) -> f64 {
        match self {
            Self::FullStep => 0.5,
            Self::HalfStep => 1.0,
        }
    }
}
