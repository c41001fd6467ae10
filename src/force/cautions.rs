//! What a user should know of a law beside these particles: the particles are seen only once they are made, so
//! these are warnings of the run and not of the input.

use super::{becker_kamlah, thornton_ning};
use crate::config::PairConfig;

/// Sizes of all particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sizes {
    /// Smallest semi-axis \[m\].
    pub smallest: f64,
    /// Largest ratio of two semi-axes of a particle.
    pub aspect_ratio: f64,
}

/// Warnings on one pair of materials.
#[must_use]
pub fn of_pair(pair: &PairConfig, sizes: Sizes) -> Option<String> {
    let name = pair.normal.law.name;
    if name == becker_kamlah::ENTRY.name {
        becker_kamlah::caution(sizes.aspect_ratio)
    } else if name == thornton_ning::ENTRY.name {
        thornton_ning::caution(pair, sizes.smallest)
    } else {
        None
    }
}
