//! Hertz spring with a dashpot: the elastic normal law.

use super::composition::NormalVisitor;
use super::dashpot::{CLIP, DAMPING_TSUJI, Dashpot, force_floor};
use super::lane::Lane;
use super::law::{Column, Energies, NormalLaw, NormalResponse, Touch};
use super::registry::{LawEntry, Role};
use super::shear::ShearSprings;
use crate::config::PairConfig;

/// Registry entry.
pub const ENTRY: LawEntry = LawEntry {
    name: "hertz",
    role: Role::Normal,
    summary: "Hertz spring with a viscous dashpot",
    source: "W (3.1), (3.3); Tsuji et al. 1992",
    parameters: &[DAMPING_TSUJI, CLIP],
    uses: &[],
    check: |_| Ok(()),
};

/// Hertz spring and dashpot: `F = 4/3 E_eff √R_eff δ^{3/2} + c δ̇`, c of [`Dashpot`].
///
/// E_eff \[Pa\] effective Young's modulus, R_eff \[m\], δ \[m\] overlap, δ̇ \[m/s\] positive while
/// approaching, F \[N\] positive in compression. With `clip` (the default) the total is never below 0,
/// which raises the restitution (tsuji: 0.5 in gives 0.550 out); the default damping is `tsuji`, for
/// which restitution comes out as put in when clipping is off. No memory.
///
/// Between ellipsoids `F = 4/3 E_eff √R_e (δ/f_2)^{3/2}` with the equivalent contact radius `f_1 √(R_e δ/f_2)`; the
/// dashpot's E_eff a is then that of the tangent stiffness.
///
/// Energies: spring `2/5 F_el δ`; damping `(F − F_el) δ̇ Δt`, so the part that clipping takes out of the
/// dashpot is not counted twice.
///
/// # Source
/// W (3.1), (3.3); elliptical contact: B (1)–(7) with the errata of PHYSICS.md.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hertz {
    effective_modulus: f64,
    dashpot: Dashpot,
    floor: f64,
    time_step: f64,
}

impl Hertz {
    /// From the pair's constants and the normal law's parameters.
    #[must_use]
    pub fn new(pair: &PairConfig) -> Self {
        let effective_modulus = pair.properties.effective_young_modulus();
        Self {
            effective_modulus,
            dashpot: Dashpot::new(&pair.normal, effective_modulus, pair.properties.restitution),
            floor: force_floor(&pair.normal),
            time_step: 0.0,
        }
    }
}

/// Hands the law of a pair to the visitor.
pub fn build<V: NormalVisitor>(pair: &PairConfig, visitor: V) -> V::Output {
    visitor.visit(Hertz::new(pair), ShearSprings::elastic(&pair.properties))
}

impl NormalLaw for Hertz {
    const MEMORY: usize = 0;

    fn columns(&self) -> Vec<Column> {
        Vec::new()
    }

    fn prepare(&mut self, time_step: f64) {
        self.time_step = time_step;
    }

    #[inline(always)]
    fn evaluate<L: Lane>(&self, touch: &Touch<L>, _memory: &mut [L]) -> NormalResponse<L> {
        let overlap = touch.overlap / touch.overlap_factor;
        let radius = (touch.effective_radius * overlap).sqrt();
        let spring = L::splat(4.0 / 3.0 * self.effective_modulus) * radius * overlap;
        let radius_per_factor = radius / touch.overlap_factor;
        let dashpot = self.dashpot.coefficient(radius_per_factor, touch.effective_mass);
        // The floor comes first: a comparison with NaN is false, so a NaN stays visible.
        let force = L::splat(self.floor).max(spring + dashpot * touch.overlap_rate);
        let energies = Energies {
            elastic: L::splat(0.4) * spring * touch.overlap,
            damping: (force - spring) * touch.overlap_rate * L::splat(self.time_step),
            ..Energies::zero()
        };
        NormalResponse {
            force,
            contact_radius: touch.radius_factor * radius,
            stiffness: L::splat(2.0 * self.effective_modulus) * radius_per_factor,
            dashpot,
            energies,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force::testing::{Impact, choice, impact, nmc, pair, properties, table, touch};

    const RADIUS: f64 = 5e-3;
    const MASS: f64 = 1e-2;

    fn law(damping: &str, clip: &str, restitution: f64) -> Hertz {
        let mut constants = properties(1e9, 0.3, Vec::new());
        constants.restitution = restitution;
        Hertz::new(&pair(constants, choice(Role::Normal, "hertz", &[("damping", damping), ("clip", clip)])))
    }

    /// Impact at 1 m/s in about `steps` steps.
    fn hit(damping: &str, clip: &str, restitution: f64, steps: f64) -> Impact {
        impact(law(damping, clip, restitution), RADIUS, MASS, 1.0, 4e-4 / steps)
    }

    #[test]
    fn restitution_comes_out_as_put_in_with_tsuji_damping_and_no_clipping() {
        for e in [0.3, 0.5, 0.8, 0.95] {
            let error = |steps| (hit("tsuji", "false", e, steps).restitution - e).abs();
            assert!(error(4000.0) < 1e-3, "e = {e}: {}", error(4000.0));
            assert!(error(64000.0) < 0.25 * error(4000.0), "e = {e}: {} {}", error(4000.0), error(64000.0));
        }
    }

    #[test]
    fn clipping_raises_restitution_to_the_known_values() {
        for (damping, e, expected) in
            [("tsuji", 0.5, 0.550), ("tsuji", 0.3, 0.397), ("wahn", 0.5, 0.582), ("wahn", 0.3, 0.431)]
        {
            let got = hit(damping, "true", e, 8000.0).restitution;
            assert!((got - expected).abs() < 0.002, "{damping} {e}: {got}, expected {expected}");
        }
    }

    #[test]
    fn energy_is_conserved_without_damping_at_second_order() {
        let error = |steps| hit("none", "true", 0.5, steps).ledger_error;
        assert!(error(400.0) < 1e-3, "{}", error(400.0));
        assert!(error(400.0) / error(1600.0) > 12.0, "{} {}", error(400.0), error(1600.0));
        assert!((hit("none", "true", 0.5, 4000.0).restitution - 1.0).abs() < 1e-4);
    }

    #[test]
    fn an_elastic_impact_lasts_as_long_as_hertz_says() {
        // 2.9433 δ_max/v with δ_max = (15 m v²/(16 E √R))^{2/5}.
        let modulus = 1e9 / (2.0 * (1.0 - 0.3 * 0.3));
        let expected = 2.943275 * libm::pow(15.0 * MASS / (16.0 * modulus * RADIUS.sqrt()), 0.4);
        let got = hit("none", "true", 0.5, 8000.0).duration;
        assert!((got / expected - 1.0).abs() < 1e-3, "{got} s, expected {expected} s");
    }

    #[test]
    fn the_ledger_closes_with_damping_and_clipping() {
        for damping in ["tsuji", "wahn"] {
            let hit = hit(damping, "true", 0.3, 8000.0);
            assert!(hit.ledger_error < 1e-3, "{damping}: {}", hit.ledger_error);
            assert!(hit.energies.damping > 0.0);
        }
    }

    #[test]
    fn stiffness_is_the_slope_of_the_spring() {
        let law = law("none", "true", 0.5);
        let force = |overlap| law.evaluate(&touch(overlap, 0.0, RADIUS, MASS), &mut []).force;
        let (overlap, h) = (1e-5, 1e-9);
        let slope = (force(overlap + h) - force(overlap - h)) / (2.0 * h);
        let stiffness = law.evaluate(&touch(overlap, 0.0, RADIUS, MASS), &mut []).stiffness;
        assert!((stiffness / slope - 1.0).abs() < 1e-6, "{stiffness} {slope}");
    }

    #[test]
    fn a_pulling_dashpot_is_clipped_and_a_nan_is_not_hidden() {
        let law = law("tsuji", "true", 0.3);
        assert_eq!(law.evaluate(&touch(1e-6, -10.0, RADIUS, MASS), &mut []).force, 0.0);
        assert!(law.evaluate(&touch(1e-6, f64::NAN, RADIUS, MASS), &mut []).force.is_nan());
    }

    #[test]
    fn an_elliptical_contact_has_the_force_of_the_reference() {
        // Becker and Kamlah's first case, below yield, is Hertz between ellipsoids.
        let g = &table(include_str!("../../tests/data/becker_kamlah_case1_geometry.csv"))[0];
        let law = Hertz::new(&pair(nmc(), choice(Role::Normal, "hertz", &[])));
        let rows = table(include_str!("../../tests/data/becker_kamlah_case1.csv"));
        for row in rows[1..].iter().take_while(|row| row[0] < g[8]) {
            let touch = Touch { radius_factor: g[2], overlap_factor: g[3], ..touch(row[0], 0.0, g[0], MASS) };
            let response = law.evaluate(&touch, &mut []);
            assert!((response.force / row[1] - 1.0).abs() < 1e-12, "{} {}", response.force, row[1]);
            let radius = (g[0] * row[0] / g[3]).sqrt() * g[2];
            assert!((response.contact_radius / radius - 1.0).abs() < 1e-14);
        }
    }
}
