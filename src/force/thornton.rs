//! Thornton's normal law: Hertz, then a contact pressure that grows no further, elastic unloading.

use super::composition::NormalVisitor;
use super::dashpot::{CLIP, DAMPING_NONE};
use super::lane::Lane;
use super::law::{Column, NormalLaw, NormalResponse, Touch};
use super::plastic::{self, LoadingCurve, MEMORY_RANGE, Peak, Plastic, YIELD_FACTOR};
use super::registry::{LawEntry, Role};
use super::shear::ShearSprings;
use crate::config::PairConfig;

/// Registry entry.
pub const ENTRY: LawEntry = LawEntry {
    name: "thornton",
    role: Role::Normal,
    summary: "elastic, then perfectly plastic, with elastic unloading",
    source: "Thornton 1997; D (2)",
    parameters: &[YIELD_FACTOR, MEMORY_RANGE, DAMPING_NONE, CLIP],
    uses: &["yield_stress"],
    check: plastic::check,
};

/// Elastic–perfectly plastic contact: Hertz up to `δ_y = (π p_y/(2 E_eff))² R_eff`, then
/// `F = F_y + π p_y R_eff (δ − δ_y)`; unloading from the largest overlap δ* and loading up to it again is Hertzian
/// with `R_p = 4 E_eff/(3 F*) · ((2 F* + F_y)/(2 π p_y))^{3/2}` and the residual overlap
/// `δ_p = δ* − (3 F*/(4 E_eff √R_p))^{2/3}`.
///
/// p_y \[Pa\] is `yield_factor` (1.6) times the lower yield stress of the pair, E_eff \[Pa\], R_eff \[m\], F \[N\]
/// positive in compression. The contact radius is `√(R_eff δ)` while loading, `√(R_p (δ − δ_p))` below δ*. With the
/// two identities `(2 F* + F_y)/(2 π p_y) = R_eff δ*` and `R_p (δ* − δ_p) = R_eff δ*` no power is needed.
/// Between ellipsoids R_e, f_1, f_2 of the elliptical contact take the place of R_eff, which makes this
/// Becker–Kamlah with a contact pressure that does not grow.
///
/// Memory: δ*, δ_p, the regime and the plastic work. A dent stays until the gap exceeds `memory_range` · R_eff.
/// No dashpot unless asked for; energies: [`Plastic::respond`].
///
/// # Source
/// Thornton 1997 (doi:10.1115/1.2787319); D (2); PHYSICS.md section 2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thornton {
    plastic: Plastic,
}

impl Thornton {
    /// From the pair's constants and the normal law's parameters.
    #[must_use]
    pub fn new(pair: &PairConfig) -> Self {
        Self { plastic: Plastic::new(pair) }
    }
}

impl LoadingCurve for Thornton {
    #[inline(always)]
    fn loading<L: Lane>(&self, touch: &Touch<L>, overlap: L) -> Peak<L> {
        let first = self.plastic.yield_point(touch);
        let yielded = overlap.greater(first.overlap);
        let hertz_radius = Plastic::hertz_radius(touch, overlap);
        let contact_radius = touch.radius_factor * hertz_radius;
        let elastic = self.plastic.hertz_force(touch, hertz_radius, overlap);
        // π p_y (c² − c_Y²), the growth since first yield.
        let beyond = overlap - first.overlap;
        let slope = L::splat(std::f64::consts::PI * self.plastic.pressure) * first.radius_squared / first.overlap;
        let force = L::select(yielded, first.force + slope * beyond, elastic);
        let elastic_work = L::splat(0.4) * first.force * first.overlap;
        let work = elastic_work + (first.force + L::splat(0.5) * slope * beyond) * beyond;
        Peak {
            fully_plastic: yielded,
            force,
            force_at_first_yield_pressure: force,
            contact_radius,
            work: L::select(yielded, work, L::splat(0.4) * elastic * overlap),
        }
    }
}

/// Hands the law of a pair to the visitor.
pub fn build<V: NormalVisitor>(pair: &PairConfig, visitor: V) -> V::Output {
    visitor.visit(Thornton::new(pair), ShearSprings::elastic(&pair.properties))
}

impl NormalLaw for Thornton {
    const MEMORY: usize = plastic::MEMORY;
    const LASTS: bool = true;

    fn columns(&self) -> Vec<Column> {
        plastic::columns()
    }

    fn range(&self) -> f64 {
        self.plastic.range()
    }

    fn prepare(&mut self, time_step: f64) {
        self.plastic.prepare(time_step);
    }

    #[inline(always)]
    fn evaluate<L: Lane>(&self, touch: &Touch<L>, memory: &mut [L]) -> NormalResponse<L> {
        self.plastic.respond(touch, memory, self)
    }
}

#[cfg(test)]
mod tests;
