//! The elastic–plastic law with adhesion of Thornton and Ning: spheres that stick or bounce.

use super::composition::NormalVisitor;
use super::dashpot::{DAMPING_NONE, Dashpot};
use super::lane::Lane;
use super::law::{Column, Energies, NormalLaw, NormalResponse, Touch};
use super::plastic::{self, MEMORY_RANGE, Regime, YIELD_FACTOR, lower_yield_stress};
use super::registry::{LawEntry, PairProperties, Role};
use super::shear::ShearSprings;
use crate::config::PairConfig;

/// Registry entry.
pub const ENTRY: LawEntry = LawEntry {
    name: "thornton_ning",
    role: Role::Normal,
    summary: "elastic, then perfectly plastic, with adhesion (Johnson-Kendall-Roberts): stick or bounce",
    source: "Thornton and Ning 1998; D (2)",
    parameters: &[YIELD_FACTOR, MEMORY_RANGE, DAMPING_NONE],
    uses: &["yield_stress", "surface_energy"],
    check,
};

fn check(properties: &PairProperties) -> Result<(), String> {
    if properties.surface_energy > 0.0 {
        return plastic::check(properties);
    }
    let [first, second] = &properties.names;
    Err(format!(
        "thornton_ning needs a surface energy, and {first} with {second} has none; give surface_energy = \"… N/m\" to the \
         material, or choose thornton"
    ))
}

/// Newton steps of the two scalar equations: quadratic convergence from above but for the last 10⁻³ before pull-off,
/// where it is slower.
const NEWTON_STEPS: usize = 24;

/// y at pull-off, where `y⁴ − y` has its minimum: `y³ = 1/4`.
const LAST_Y: f64 = 0.629_960_524_947_436_6;

/// Energy at y = 1, where a contact forms: the zero of [`energy`].
const FORMED: f64 = 8.0 / 15.0 - 4.0 / 3.0 + 0.5;

/// Adhesive contact: elastic after Johnson, Kendall and Roberts (JKR) until the pressure in the centre reaches p_y,
/// then plastic with p_y as limit, unloading again after JKR with a larger radius R_p.
///
/// With the scales `a_s³ = 2 π Γ R_eff²/E_eff`, `δ_s = a_s²/R_eff`, `F_s = 2 π Γ R_eff` and the contact radius
/// `a = a_s y²`:
///
/// - JKR: `δ = δ_s (y⁴ − y)`, `F = F_s (4/3 y⁶ − 2 y³)`; pull-off force `3/2 π Γ R_eff`;
/// - first yield where `2 y² − 1/y = π p_y R_eff/(E_eff a_s)`, but not before the surfaces meet at y = 1: where the right
///   side is below 1, adhesion alone makes them yield from there on;
/// - plastic loading: `F = F_y + π p_y (a² − a_y²) − 2/3 √(2 π Γ E_eff) (a^{3/2} − a_y^{3/2})`, the integral of
///   Thornton and Ning's stiffness; δ(a) stays JKR's;
/// - unloading from the largest overlap δ* (radius a*, force F*): JKR with
///   `R_p = 4 E_eff a*³/(3 (F* + √(8 π Γ E_eff a*³)))`, shifted so that it begins there.
///
/// Γ \[J/m²\] is the `surface_energy` of the pair (work of adhesion), p_y \[Pa\] `yield_factor` times the lower yield
/// stress, F \[N\] positive in compression. A neck forms where the (dented) surfaces meet and breaks at pull-off, which
/// takes the energy `7.09 (Γ⁵ R⁴/E²)^{1/3}`. It breaks at the latest where the gap exceeds `memory_range` · R_eff: soft
/// and small spheres need a larger `memory_range` than the default.
///
/// Between ellipsoids R_e and δ/f_2 stand for R_eff and δ; f_1 is left out. A tangential law takes its limit from F
/// alone: a contact under tension carries no friction.
///
/// Memory: δ*, δ_p, the regime, the plastic work and whether a neck is there. Energies: held `∫ F dδ` along the present
/// branch from where it forms; plastic as in the laws without adhesion; the breaking of necks counts as damping, to
/// first order in the step.
///
/// # Source
/// Thornton, Ning 1998 (doi:10.1016/S0032-5910(98)00099-0); Johnson, Kendall, Roberts 1971
/// (doi:10.1098/rspa.1971.0141).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThorntonNing {
    /// E_eff \[Pa\].
    effective_modulus: f64,
    /// Γ \[J/m²\].
    surface_energy: f64,
    /// p_y \[Pa\].
    pressure: f64,
    range: f64,
    dashpot: Dashpot,
    time_step: f64,
}

impl ThorntonNing {
    /// From the pair's constants and the normal law's parameters.
    #[must_use]
    pub fn new(pair: &PairConfig) -> Self {
        let effective_modulus = pair.properties.effective_young_modulus();
        Self {
            effective_modulus,
            surface_energy: pair.properties.surface_energy,
            pressure: pair.normal.number(YIELD_FACTOR.name) * lower_yield_stress(&pair.properties),
            range: pair.normal.number(MEMORY_RANGE.name),
            dashpot: Dashpot::new(&pair.normal, effective_modulus, pair.properties.restitution),
            time_step: 0.0,
        }
    }
}

/// The larger root of `y⁴ − y = depth`, by Newton's method from above.
#[inline(always)]
fn neck<L: Lane>(depth: L) -> L {
    let (one, four) = (L::splat(1.0), L::splat(4.0));
    let mut y = one + L::splat(0.0).max(depth).sqrt().sqrt();
    for _ in 0..NEWTON_STEPS {
        let cube = y * y * y;
        let next = y - (y * cube - y - depth) / (four * cube - one);
        // Rounding must not throw the root on the minimum, where the slope is nothing.
        let least = L::splat(LAST_Y * (1.0 + 1e-8));
        y = L::select(next.less(least), least, next);
    }
    y
}

/// The positive root of `2 y³ − 2 κ y − 1 = 0` (first yield), by Newton's method from above.
#[inline(always)]
fn first_yield<L: Lane>(kappa: L) -> L {
    let one = L::splat(1.0);
    let mut y = one + kappa.sqrt();
    for _ in 0..NEWTON_STEPS {
        y = y - (y * y * y - kappa * y - L::splat(0.5)) / (L::splat(3.0) * y * y - kappa);
    }
    y
}

/// JKR force over its scale, `4/3 y⁶ − 2 y³`.
#[inline(always)]
fn force<L: Lane>(y: L) -> L {
    let cube = y * y * y;
    (L::splat(4.0 / 3.0) * cube - L::splat(2.0)) * cube
}

/// `∫ F dδ` of JKR from where the contact forms, over its scale.
#[inline(always)]
fn energy<L: Lane>(y: L) -> L {
    let square = y * y;
    let fourth = square * square;
    let cube = square * y;
    (L::splat(8.0 / 15.0) * cube * cube - L::splat(4.0 / 3.0) * cube + L::splat(0.5)) * fourth - L::splat(FORMED)
}

/// Plastic loading over its scales: force and the indefinite integral `∫ F dδ`, from first yield at `yield_y` with the
/// pressure κ.
#[inline(always)]
fn plastic_loading<L: Lane>(y: L, yield_y: L, kappa: L) -> [L; 2] {
    let number = L::splat;
    let cube = |y: L| y * y * y;
    let fourth = |y: L| y * y * y * y;
    let at_zero = force(yield_y) - number(2.0) * kappa * fourth(yield_y) + number(2.0 / 3.0) * cube(yield_y);
    let force = at_zero + number(2.0) * kappa * fourth(y) - number(2.0 / 3.0) * cube(y);
    let work = at_zero * (fourth(y) - y) + kappa * (fourth(y) * fourth(y) - number(0.4) * fourth(y) * y)
        - number(2.0 / 3.0) * (number(4.0 / 7.0) * fourth(y) * cube(y) - number(0.25) * fourth(y));
    [force, work]
}

/// Warns of two things in the smallest particles, spheres of equal size: necks that `memory_range` breaks before they
/// reach pull-off, at the gap `(27/256)^{1/3} a_s²/R_eff`; and surfaces that yield as they meet, `π p_y R_eff/(E_eff a_s)`
/// below 1.
#[must_use]
pub fn cautions(pair: &PairConfig, smallest: f64) -> Vec<String> {
    let law = ThorntonNing::new(pair);
    let pi = std::f64::consts::PI;
    // a_s/R_eff.
    let scale = libm::cbrt(4.0 * pi * law.surface_energy / (law.effective_modulus * smallest));
    let needed = libm::cbrt(27.0 / 256.0) * scale * scale;
    let yielding = pi * law.pressure / (law.effective_modulus * scale);
    let breaks = (needed > law.range).then(|| {
        format!(
            "thornton_ning: necks between particles of {smallest:.3e} m reach to a gap of {needed:.3} R_eff, and \
             memory_range {} breaks them before: raise it",
            law.range
        )
    });
    let yields = (yielding < 1.0).then(|| {
        format!(
            "thornton_ning: between particles of {smallest:.3e} m adhesion alone exceeds the yield pressure as they meet \
             (pi p_y R_eff/(E_eff a_s) = {yielding:.3}, below 1): the law then yields from the first touch on, beyond what \
             it was made for; raise yield_stress, or lower surface_energy"
        )
    });
    breaks.into_iter().chain(yields).collect()
}

/// Hands the law of a pair to the visitor.
pub fn build<V: NormalVisitor>(pair: &PairConfig, visitor: V) -> V::Output {
    visitor.visit(ThorntonNing::new(pair), ShearSprings::elastic(&pair.properties))
}

impl NormalLaw for ThorntonNing {
    const MEMORY: usize = plastic::MEMORY + 1;
    const LASTS: bool = true;

    fn columns(&self) -> Vec<Column> {
        let mut columns = plastic::columns();
        columns.push(Column { name: "neck".to_owned(), unit: "1" });
        columns
    }

    fn range(&self) -> f64 {
        self.range
    }

    fn prepare(&mut self, time_step: f64) {
        self.time_step = time_step;
    }

    #[inline(always)]
    fn evaluate<L: Lane>(&self, touch: &Touch<L>, memory: &mut [L]) -> NormalResponse<L> {
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let pi = std::f64::consts::PI;
        let radius = touch.effective_radius;
        let work_of_adhesion = 2.0 * pi * self.surface_energy;
        let radius_scale = (L::splat(work_of_adhesion / self.effective_modulus) * radius * radius).map(libm::cbrt);
        let overlap_scale = radius_scale * radius_scale / radius;
        let force_scale = L::splat(work_of_adhesion) * radius;
        let per_factor = one / touch.overlap_factor;
        let overlap = touch.overlap * per_factor;

        // Where the loading curve stands. The memory comes first: a comparison with NaN is false, so a NaN stays visible.
        let largest = memory[0].max(touch.overlap);
        let top = largest * per_factor;
        let kappa = L::splat(pi * self.pressure / (2.0 * self.effective_modulus)) * radius / radius_scale;
        // A contact forms at y = 1, possibly beyond first yield: then it yields from there on.
        let yield_y = one.max(first_yield(kappa));
        let top_y = neck(top / overlap_scale);
        let yielded = top_y.greater(yield_y);
        let [plastic_force, plastic_work] = plastic_loading(top_y, yield_y, kappa);
        let work = energy(yield_y) + plastic_work - plastic_loading(yield_y, yield_y, kappa)[1];

        // The branch of unloading: its radius, and its scales over those of the first.
        let cube = top_y * top_y * top_y;
        let stretch = L::splat(4.0 / 3.0) * cube * cube / (plastic_force + L::splat(2.0) * cube);
        let root = L::select(yielded, stretch.map(libm::cbrt), one);
        let stretch = L::select(yielded, stretch, one);
        let branch_y = top_y / root;
        let recovery = overlap_scale * root * (branch_y * branch_y * branch_y * branch_y - branch_y);
        let plastic_overlap = (top - recovery).only(yielded);
        let energy_scale = force_scale * overlap_scale * stretch * root * touch.overlap_factor;

        // The neck now.
        let depth = (overlap - plastic_overlap) / (overlap_scale * root);
        let last_depth = L::splat(LAST_Y * LAST_Y * LAST_Y * LAST_Y - LAST_Y);
        let was_joined = memory[4].greater(L::splat(0.5));
        let apart = zero.greater(depth) & (!was_joined | last_depth.at_least(depth));
        let joined = |value| L::select(apart, zero, value);
        let y = neck(depth);
        let spring = joined(force_scale * stretch * force(y));
        let contact_radius = joined(radius_scale * root * root * y * y);
        let held = joined(energy_scale * energy(y));
        let broken = (energy_scale * energy(L::splat(LAST_Y))).only(was_joined & apart);

        let dissipated = force_scale * overlap_scale * touch.overlap_factor * work - energy_scale * energy(branch_y);
        let plastic_work = dissipated.only(yielded);
        let regime = |regime: Regime| L::splat(regime.number());
        let beyond = L::select(touch.overlap.at_least(memory[0]), regime(Regime::Plastic), regime(Regime::Unloading));
        let before = memory[3];
        // An elastic contact leaves nothing behind.
        let over = apart & !yielded;
        memory[0] = L::select(over, zero, largest);
        memory[1] = plastic_overlap * touch.overlap_factor;
        memory[2] = L::select(apart, regime(Regime::Apart), L::select(yielded, beyond, regime(Regime::Elastic)));
        memory[3] = plastic_work;
        memory[4] = joined(one);

        let dashpot = self.dashpot.coefficient(contact_radius, touch.effective_mass);
        let damped = dashpot * touch.overlap_rate;
        let energies = Energies {
            elastic: held,
            damping: damped * touch.overlap_rate * L::splat(self.time_step) + broken,
            plastic: plastic_work - before,
            ..Energies::zero()
        };
        NormalResponse {
            force: spring + damped,
            contact_radius,
            stiffness: L::splat(2.0 * self.effective_modulus) * contact_radius / touch.overlap_factor,
            dashpot,
            energies,
        }
    }
}

#[cfg(test)]
mod tests;
