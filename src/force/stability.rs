//! What dashpots ask of the time step: forces follow velocities that are extrapolated from the step before, and where a
//! dashpot brakes a motion by more than there is within a step it drives it instead.

use super::dashpot::damping_ratio;
use super::mindlin::FACTOR;
use super::rolling::DAMPING_RATIO;
use crate::config::{Config, PairConfig};

/// Contacts of a particle in the motions that are braked most, of spheres and of ellipsoids: a little more than the mean
/// of dense packings. With the first the onset of vibrations lies where packings of 200 spheres were seen to begin (see tests).
const COORDINATION: [f64; 2] = [6.4, 9.5];

/// Most that dashpots may brake in a step, γ Δt; at 1 packings vibrate.
const MOST_DAMPING: f64 = 0.8;

/// The same for the quasi-static routine, whose dashpots brake the motion of the substep before; at 2, less what springs
/// take, packings vibrate.
const MOST_LAGGING_DAMPING: f64 = 1.7;

impl Config {
    /// Largest factor β of the time step that the dashpots allow; infinite without any.
    #[must_use]
    pub fn damped_safety(&self, ellipsoids: bool) -> f64 {
        MOST_DAMPING / largest_rate(self.pairs.iter(), ellipsoids)
    }

    /// The factor β of the pseudo time step, lowered where the artificial dashpots ask for it.
    #[must_use]
    pub fn quasi_static_safety(&self, ellipsoids: bool) -> f64 {
        let settings = &self.quasi_static;
        let pairs: Vec<_> = self.pairs.iter().map(|pair| pair.artificially_damped(settings.restitution)).collect();
        settings.safety.min(MOST_LAGGING_DAMPING / largest_rate(pairs.iter(), ellipsoids))
    }
}

fn largest_rate<'a>(pairs: impl Iterator<Item = &'a PairConfig>, ellipsoids: bool) -> f64 {
    pairs.map(|pair| pair.damping_rate(COORDINATION[usize::from(ellipsoids)])).fold(0.0, f64::max)
}

impl PairConfig {
    /// The pair with every dashpot that its laws have, at this restitution coefficient: the artificial damping of the
    /// quasi-static routine. Laws and memory are the same.
    #[must_use]
    pub fn artificially_damped(&self, restitution: f64) -> Self {
        let mut pair = self.clone();
        pair.properties.restitution = restitution;
        for choice in [Some(&mut pair.normal), pair.tangential.as_mut(), pair.rolling.as_mut()].into_iter().flatten() {
            choice.damp();
        }
        pair
    }

    /// The largest rate γ at which the dashpots of a dense packing of equal particles brake a motion, times √(m/K), K the
    /// stiffness of one contact and m the mass of one particle; 0 without dashpots.
    ///
    /// With Z contacts per particle and `c_n = 2 ζ √(½ m K)`, neighbours moving against each other are braked at
    /// `(2 Z/3)(c_n + 2 c_t)/m`, and particles turning alike at `2 Z (5/3) c_t/m`, as their inertia is `2/5 m R²`. Rolling
    /// dashpots brake particles turning against their neighbours at `(4 Z/3) c_r/(2/5 m R²)`. A motion is stable while
    /// `γ Δt < 1`.
    #[must_use]
    pub fn damping_rate(&self, coordination: f64) -> f64 {
        let b = damping_ratio(self.properties.restitution);
        let ratio = match self.normal.dashpot() {
            Some("tsuji") => (5.0_f64 / 6.0).sqrt() * b,
            Some("wahn") => (2.0_f64 / 3.0).sqrt() * b,
            None if self.normal.damps() => b,
            _ => 0.0,
        };
        let along = 2.0 * ratio * 0.5_f64.sqrt();
        // (k_t/k_n)/f.
        let shear = 4.0 * self.properties.effective_shear_modulus() / self.properties.effective_young_modulus();
        let tangential = self.tangential.as_ref().filter(|law| self.properties.friction > 0.0 && law.damps());
        let across = tangential.map_or(0.0, |law| along * (law.number(FACTOR.name) * shear).sqrt());
        let rolling = self.rolling.as_ref().map_or(0.0, |law| {
            // c_r = 2 ζ_r √(I K_r) with I = 2/5 (½ m)(½ R)² and K_r = (k_t/f) (½ R)², over the inertia of a particle.
            2.0 * law.number(DAMPING_RATIO.name) * (shear / (32.0 * 0.4)).sqrt()
        });
        let rates = [2.0 / 3.0 * (along + 2.0 * across), 10.0 / 3.0 * across, 4.0 / 3.0 * rolling];
        coordination * rates.into_iter().fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force::registry::Role;
    use crate::force::testing::{choice, pair, properties};

    /// β = Δt √(K/m) at which γ Δt is 1.
    fn onset(restitution: f64, factor: &str, damping: &str) -> f64 {
        let mut constants = properties(1365.9e6, 0.4314, Vec::new());
        constants.restitution = restitution;
        let mut pair = pair(constants, choice(Role::Normal, "hertz", &[("damping", damping)]));
        pair.tangential = Some(choice(Role::Tangential, "mindlin", &[("factor", factor)]));
        1.0 / pair.damping_rate(COORDINATION[0])
    }

    #[test]
    fn vibrations_begin_where_packings_were_seen_to_vibrate() {
        // Stable and unstable β of 200 spheres after compression, by the unbalanced force at rest.
        const TWO_THIRDS: &str = "0.6666666666666666";
        for (restitution, factor, damping, stable, unstable) in [
            (0.3, TWO_THIRDS, "tsuji", 0.14, 0.15),
            (0.35, TWO_THIRDS, "tsuji", 0.0, 0.17),
            (0.4, TWO_THIRDS, "tsuji", 0.17, 1.0),
            (0.1, TWO_THIRDS, "tsuji", 0.0, 0.1),
            (0.3, TWO_THIRDS, "wahn", 0.0, 0.17),
            (0.4, "1", "tsuji", 0.0, 0.17),
        ] {
            let onset = onset(restitution, factor, damping);
            assert!(stable < onset && onset < unstable, "{restitution} {factor} {damping}: {onset}");
        }
    }

    #[test]
    fn quasi_static_packings_vibrate_where_they_were_seen_to() {
        // Restitution, with β of 250 spheres of NMC that came to rest and that did not (configs/quasi_static.toml).
        for (restitution, stable, unstable) in [(0.5, 0.4, 0.45), (0.2, 0.2, 0.25)] {
            let mut pair =
                pair(properties(142e9, 0.25, Vec::new()), choice(Role::Normal, "hertz", &[("damping", "none")]));
            pair.tangential = Some(choice(Role::Tangential, "mindlin", &[]));
            assert_eq!(pair.damping_rate(COORDINATION[0]), 0.0);
            let most = MOST_LAGGING_DAMPING / pair.artificially_damped(restitution).damping_rate(COORDINATION[0]);
            assert!(most < stable && 1.3 * most > stable && most < unstable, "{restitution}: {most}");
        }
    }

    #[test]
    fn without_dashpots_nothing_bounds_the_step() {
        assert_eq!(onset(0.3, "1", "none"), f64::INFINITY);
        assert_eq!(onset(1.0, "1", "tsuji"), f64::INFINITY);
    }
}
