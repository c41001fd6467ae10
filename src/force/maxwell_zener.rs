//! The nonlinear Maxwell–Zener normal law: Maxwell branches beside a long-term Hertz spring.

use super::composition::NormalVisitor;
use super::dashpot::{CLIP, DAMPING_NONE, Dashpot, force_floor};
use super::lane::Lane;
use super::law::{Column, Energies, NormalLaw, NormalResponse, Touch};
use super::registry::{LawEntry, PairProperties, ParameterKind, ParameterSpec, ParameterValue, Role};
use super::shear::ShearSprings;
use crate::config::{MaxwellBranch, PairConfig};

/// Most Maxwell branches that a material may have.
pub const MAX_BRANCHES: usize = 8;

/// Registry entry.
pub const ENTRY: LawEntry = LawEntry {
    name: "maxwell_zener",
    role: Role::Normal,
    summary: "1 to 8 Maxwell branches beside a long-term Hertz spring, between equal materials",
    source: "W (3.7), (3.11)-(3.14) with errata",
    parameters: &[SCHEME, DAMPING_NONE, CLIP],
    uses: &["maxwell"],
    check,
};

const SCHEME: ParameterSpec = ParameterSpec {
    name: "scheme",
    kind: ParameterKind::Choice(&["exact", "midpoint"]),
    default: ParameterValue::Choice(0),
    doc: "time integration: exact for overlap^(3/2) linear over the step, or the midpoint rule of W (3.13), (3.14)",
};

fn check(properties: &PairProperties) -> Result<(), String> {
    let [first, second] = &properties.names;
    let equal = properties.young_modulus[0] == properties.young_modulus[1]
        && properties.poisson_ratio[0] == properties.poisson_ratio[1]
        && properties.maxwell[0] == properties.maxwell[1];
    let branches = properties.maxwell[0].len();
    if !equal {
        return Err(format!(
            "maxwell_zener holds between equal materials only, and {first} and {second} differ in Young's modulus, \
             Poisson's ratio or Maxwell branches; name another normal law for this pair, for example hertz"
        ));
    }
    if branches == 0 {
        return Err(format!(
            "maxwell_zener needs at least one Maxwell branch, and {first} has none; \
             give the material a branch (modulus, relaxation time) or choose the normal law hertz"
        ));
    }
    if branches > MAX_BRANCHES {
        return Err(format!(
            "maxwell_zener takes at most {MAX_BRANCHES} Maxwell branches, and {first} has {branches}; \
             merge branches with neighbouring relaxation times"
        ));
    }
    Ok(())
}

/// The branches with the last one split into equal ones of the same relaxation time, `count` in all: the
/// same material, carried by one of the few branch numbers that are compiled.
#[must_use]
pub fn split_last_branch(branches: &[MaxwellBranch], count: usize) -> Vec<MaxwellBranch> {
    let Some((last, others)) = branches.split_last() else { return Vec::new() };
    let parts = count.saturating_sub(others.len()).max(1);
    let part = MaxwellBranch { modulus: last.modulus / parts as f64, ..*last };
    others.iter().copied().chain(std::iter::repeat_n(part, parts)).collect()
}

/// Maxwell–Zener contact: `F(t) = √R_eff/(1−ν²) · Σ_k E_k ∫ exp(−(t−s)/τ_k) √δ δ̇ ds`, the sum over the
/// Maxwell branches and the long-term spring (τ = ∞).
///
/// R_eff \[m\], E_k \[Pa\], ν, τ_k \[s\], δ \[m\] overlap; F \[N\] positive in compression. With
/// `C_k = 2/3 E_k √R_eff/(1−ν²)` the schemes are
///
/// - `exact`: the long-term spring `C_∞ δ^{3/2}` in closed form; each branch
///   `F_k ← F_k e^{−x} + C_k Δ(δ^{3/2}) (1−e^{−x})/x`, x = Δt/τ_k: exact for δ^{3/2} linear over the step;
/// - `midpoint`: W (3.13), (3.14): `F_k ← F_k e^{−x} + 3/2 C_k e^{−x/2} √δ_mid Δδ`, the long-term spring being
///   the branch that never relaxes (it drifts by rounding and by the midpoint rule's error).
///
/// The fast limit is Hertz with Σ E_k, the slow one Hertz with E_∞. Memory: what the next increment starts from, √R_eff
/// δ^{3/2} (`exact`) or the overlap (`midpoint`), and every branch's force, unclipped; only the total is clipped.
///
/// Energies: branch k holds `F_k δ − 3/5 C_k δ^{5/2}` and dissipates at the rate `F_k δ/τ_k`, whose integral
/// over a step is `δ_mid (C_k Δ(δ^{3/2}) − ΔF_k)`, with δ_mid = δ − ½ δ̇ Δt: the ledger closes to second order in Δt however
/// short τ_k is. The energy held is counted from the state that vanishes with the overlap, so it is negative in a
/// relaxed contact, and the dissipation may be negative on unloading: Radok's superposition holds
/// for growing contacts. What clipping takes out counts as damping, of either sign.
///
/// Between ellipsoids δ/f_2 and R_e of the elliptical contact take the places of δ and R_eff, as in Hertz's law: the
/// force keeps both elastic limits. This is an extension of W, which treats spheres. Where a contact rolls to places of
/// other curvature, `exact` counts the change of √R_e (δ/f_2)^{3/2} with the increment and `midpoint` does not; the energies
/// are those of the present curvature.
///
/// # Source
/// W (3.7), (3.11)–(3.14); prefactor by the errata (√R_eff/(1−ν²) throughout).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaxwellZener<const BRANCHES: usize, const MIDPOINT: bool> {
    /// 2/3 E_∞/(1−ν²) \[Pa\] of the closed-form spring, 0 when the last branch stands for it.
    spring: f64,
    /// 2/3 E_k/(1−ν²) \[Pa\].
    coefficient: [f64; BRANCHES],
    /// 1/τ_k \[1/s\], 0 for the long-term spring.
    rate: [f64; BRANCHES],
    /// e^{−x}.
    decay: [f64; BRANCHES],
    /// What multiplies the step's increment.
    gain: [f64; BRANCHES],
    spontaneous: f64,
    dashpot: Dashpot,
    floor: f64,
    time_step: f64,
}

impl<const BRANCHES: usize, const MIDPOINT: bool> MaxwellZener<BRANCHES, MIDPOINT> {
    /// From the pair's constants and the normal law's parameters. `BRANCHES` is at least the number of
    /// the material's Maxwell branches (`exact`) or one more than that (`midpoint`).
    #[must_use]
    pub fn new(pair: &PairConfig) -> Self {
        let properties = &pair.properties;
        let per_young = 2.0 / 3.0 / (1.0 - properties.poisson_ratio[0] * properties.poisson_ratio[0]);
        let long_term = per_young * properties.young_modulus[0];
        let branches = split_last_branch(&properties.maxwell[0], if MIDPOINT { BRANCHES - 1 } else { BRANCHES });
        let coefficient =
            std::array::from_fn(|k| branches.get(k).map_or(long_term, |branch| branch.modulus * per_young));
        let spring = if MIDPOINT { 0.0 } else { long_term };
        let spontaneous = coefficient.iter().fold(spring, |sum, c| sum + c);
        Self {
            spring,
            coefficient,
            rate: std::array::from_fn(|k| branches.get(k).map_or(0.0, |branch| 1.0 / branch.relaxation_time)),
            decay: [1.0; BRANCHES],
            gain: coefficient,
            spontaneous,
            // The spontaneous spring is 4/3 E_eff √R_eff δ^{3/2}.
            dashpot: Dashpot::new(&pair.normal, 0.75 * spontaneous, properties.restitution),
            floor: force_floor(&pair.normal),
            time_step: 0.0,
        }
    }
}

/// Mean of e^{−s} over 0 ≤ s ≤ x, `(1 − e^{−x})/x`, with full precision at small x.
#[must_use]
pub fn mean_decay(x: f64) -> f64 {
    if x > 0.0 { -libm::expm1(-x) / x } else { 1.0 }
}

/// Hands the law of a pair to the visitor. Compiled are 1, 2, 4 and 8 branches; a number between is
/// carried by the next one (see [`split_last_branch`]).
pub fn build<V: NormalVisitor>(pair: &PairConfig, visitor: V) -> V::Output {
    let properties = &pair.properties;
    let branches = properties.maxwell[0].len();
    macro_rules! law {
        ($branches:literal, $springs:literal, $midpoint:literal) => {
            visitor
                .visit(MaxwellZener::<$branches, $midpoint>::new(pair), ShearSprings::<$springs>::relaxing(properties))
        };
    }
    match (branches, pair.normal.word(SCHEME.name) == "midpoint") {
        (1, false) => law!(1, 2, false),
        (2, false) => law!(2, 3, false),
        (3..=4, false) => law!(4, 5, false),
        (5..=8, false) => law!(8, 9, false),
        (1, true) => law!(2, 2, true),
        (2, true) => law!(3, 3, true),
        (3..=4, true) => law!(5, 5, true),
        (5..=8, true) => law!(9, 9, true),
        _ => panic!("maxwell_zener built with {branches} branches, which its check refuses"),
    }
}

impl<const BRANCHES: usize, const MIDPOINT: bool> NormalLaw for MaxwellZener<BRANCHES, MIDPOINT> {
    const MEMORY: usize = 1 + BRANCHES;

    fn columns(&self) -> Vec<Column> {
        let forces = self.rate.iter().enumerate().map(|(k, &rate)| Column {
            name: if rate == 0.0 { "long_term_force".to_owned() } else { format!("branch_{}_force", k + 1) },
            unit: "N",
        });
        let (name, unit) = if MIDPOINT { ("overlap", "m") } else { ("hertzian", "m^2") };
        std::iter::once(Column { name: name.to_owned(), unit }).chain(forces).collect()
    }

    fn prepare(&mut self, time_step: f64) {
        self.time_step = time_step;
        for k in 0..BRANCHES {
            let x = time_step * self.rate[k];
            self.decay[k] = libm::exp(-x);
            self.gain[k] = self.coefficient[k] * if MIDPOINT { 1.5 * libm::exp(-0.5 * x) } else { mean_decay(x) };
        }
    }

    /// The limit Δt/τ → ∞: no branch holds anything, Hertz with E_∞ is left.
    fn relax(&mut self) {
        for k in (0..BRANCHES).filter(|&k| self.rate[k] > 0.0) {
            (self.decay[k], self.gain[k]) = (0.0, 0.0);
        }
    }

    #[inline(always)]
    fn evaluate<L: Lane>(&self, touch: &Touch<L>, memory: &mut [L]) -> NormalResponse<L> {
        let (radius, overlap, last) = (touch.effective_radius, touch.overlap, memory[0]);
        let factor = touch.overlap_factor;
        let scaled = overlap / factor;
        let hertz_radius = (radius * scaled).sqrt();
        // √R_eff δ^{3/2}.
        let hertzian = hertz_radius * scaled;
        // Overlap in the middle of the step, change of √R_eff δ^{3/2} over it, and what the branches get.
        let (mean, change, increment) = if MIDPOINT {
            let scaled_last = last / factor;
            let mean = L::splat(0.5) * (overlap + last);
            let change = hertzian - (radius * scaled_last).sqrt() * scaled_last;
            (mean, change, (radius * (mean / factor)).sqrt() * (scaled - scaled_last))
        } else {
            let change = hertzian - last;
            (overlap - L::splat(0.5 * self.time_step) * touch.overlap_rate, change, change)
        };

        let spring = L::splat(self.spring) * hertzian;
        let mut held = spring;
        let mut energies = Energies { elastic: L::splat(0.4) * spring * overlap, ..Energies::zero() };
        for k in 0..BRANCHES {
            let before = memory[1 + k];
            let force = before * L::splat(self.decay[k]) + L::splat(self.gain[k]) * increment;
            memory[1 + k] = force;
            held = held + force;
            let coefficient = L::splat(self.coefficient[k]);
            let energy = (force - L::splat(0.6) * coefficient * hertzian) * overlap;
            if self.rate[k] == 0.0 {
                energies.elastic = energies.elastic + energy;
            } else {
                energies.viscoelastic = energies.viscoelastic + energy;
            }
            energies.viscous = energies.viscous + mean * (coefficient * change - (force - before));
        }
        memory[0] = if MIDPOINT { overlap } else { hertzian };

        let radius_per_factor = hertz_radius / factor;
        let dashpot = self.dashpot.coefficient(radius_per_factor, touch.effective_mass);
        let force = L::splat(self.floor).max(held + dashpot * touch.overlap_rate);
        energies.damping = (force - held) * touch.overlap_rate * L::splat(self.time_step);
        NormalResponse {
            force,
            contact_radius: touch.radius_factor * hertz_radius,
            stiffness: L::splat(1.5 * self.spontaneous) * radius_per_factor,
            dashpot,
            energies,
        }
    }
}

#[cfg(test)]
mod tests;
