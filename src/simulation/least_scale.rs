//! What the quasi-static routine compares unbalanced forces and kinetic energies with where contacts are weaker still.

use crate::config::Config;
use crate::force::pass::PairPass;

/// The particles of one species that are free to move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeParticles {
    /// Their number.
    pub number: f64,
    /// Sum of their radii \[m\].
    pub radii: f64,
    /// Sum of their masses \[kg\].
    pub mass: f64,
}

/// Least force and energy that the criteria of equilibrium refer to: with less a packing just touches, and ratios of its
/// own forces mean nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastScale {
    /// Mean force at a contact \[N\].
    pub force: f64,
    /// Mean elastic energy per particle \[J\].
    pub energy: f64,
}

impl LeastScale {
    /// Means over contacts between particles drawn at random, of the mean radius of their species, that overlap by
    /// `load.quasi_static.touching_overlap`: `F = ⅔ K δ` and `E = ⅖ F δ` with δ = that share of the harmonic mean of both radii and
    /// the stiffness K there. Under gravity the force is at most the mean weight, or a bed that falls would seem to rest.
    #[must_use]
    pub fn new(config: &Config, passes: &[PairPass], species: &[FreeParticles]) -> Self {
        let total = |of: fn(&FreeParticles) -> f64| species.iter().map(of).sum::<f64>();
        let number = total(|s| s.number);
        let present = || species.iter().zip(&config.species).filter(|(free, _)| free.number > 0.0);
        let (mut force, mut energy) = (0.0, 0.0);
        for (first, a) in present() {
            for (second, b) in present() {
                let [first_radius, second_radius] = [first, second].map(|s| s.radii / s.number);
                let effective_radius = first_radius * second_radius / (first_radius + second_radius);
                let overlap = config.quasi_static.touching_overlap * 2.0 * effective_radius;
                let pass = &passes[config.pair_index(a.material, b.material)];
                let touching = 2.0 / 3.0 * pass.reference_stiffness(overlap, effective_radius) * overlap;
                let share = (first.number / number) * (second.number / number);
                force += share * touching;
                energy += share * 0.4 * touching * overlap;
            }
        }
        let acceleration = config.gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
        let weight = acceleration * total(|s| s.mass) / number;
        Self { force: if weight > 0.0 && weight < force { weight } else { force }, energy }
    }
}
