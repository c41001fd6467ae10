//! Mindlin–Deresiewicz tangential law in increments, elastic or relaxing with the normal law's branches.

use super::composition::TangentialVisitor;
use super::lane::{Lane, Vector, add, dot, scale, sub};
use super::law::{Column, Energies, NormalResponse, TangentialLaw, Touch, VectorResponse};
use super::maxwell_zener::mean_decay;
use super::registry::{LawChoice, LawEntry, ParameterKind, ParameterSpec, ParameterValue, Role};
use super::shear::ShearSprings;
use super::slider::{AT_STEP, Slider, Turning, coulomb_limit, kept_share, slip_loss, step_loss, stiffness_loss};
use crate::config::{PairConfig, Velocities};

/// Registry entry.
pub const ENTRY: LawEntry = LawEntry {
    name: "mindlin",
    role: Role::Tangential,
    summary: "Mindlin increments with Coulomb friction; relaxes along with a Maxwell-Zener normal law",
    source: "W (3.4), (3.5), (3.9) with erratum",
    parameters: &[FACTOR, DAMPING],
    uses: &[],
    check: |_| Ok(()),
};

pub(super) const FACTOR: ParameterSpec = ParameterSpec {
    name: "factor",
    kind: ParameterKind::Number { min: 1e-6, max: 1.0 },
    default: ParameterValue::Number(2.0 / 3.0),
    doc: "factor on the tangential stiffness 8 G_eff a: 2/3 (W), 1 (incremental Mindlin)",
};

const DAMPING: ParameterSpec = ParameterSpec {
    name: "damping",
    kind: ParameterKind::Flag,
    default: ParameterValue::Flag(true),
    doc: "tangential dashpot with the damping ratio of the normal one",
};

/// Mindlin spring, dashpot and Coulomb slider: `ΔF = f · 8 G_eff a Δδ_t`, `|F_t| ≤ μ F_n`.
///
/// a \[m\] contact radius of the normal law, G_eff \[Pa\], Δδ_t = v_t Δt \[m\] tangential displacement of j
/// relative to i, f the parameter `factor`; F_t acts on i, −F_t on j. With a relaxing normal law the
/// spring is a set in parallel, one spring per Maxwell branch with the branch's τ_k and the long-term one:
/// `F_k ← F_k e^{−x} + f · 8 G_k a Δδ_t (1−e^{−x})/x`, x = Δt/τ_k.
///
/// - Memory: the spring vectors and the contact radius of the last step. In runs with dashpots, whose velocities are those
///   of the full step, a spring vector is *half an increment ahead* of the touch: the force at time t is the stored one plus
///   half of this step's increment (trapezoidal rule). A sticking contact then neither gains nor loses energy at first order
///   in Δt; at third order it gains, the share `(ωΔt)³/4` of its energy per radian, which dashpots outweigh. In runs without dashpots
///   velocities are those that led to the touch, increments true displacements, and nothing is ahead: no gain.
/// - The stored vectors turn with the contact ([`Turning`]); where a decreases they shrink with it, so
///   that unloading creates no energy.
/// - Slider: the spring force is cut to μ F_n, F_n after clipping (all springs by the same share), and so
///   is the sum with the dashpot.
/// - Dashpot: `c_t = c_n √(f · 8 G_eff/(2 E_eff))`, c_n the normal law's: the same damping ratio on the
///   tangential stiffness.
///
/// Energies: springs `½ F_k²/k_k`; friction is slip times the carried force, and what the springs lose as a
/// changes (micro-slip); the dashpot's is never negative (the cut is a projection on a ball).
///
/// `AHEAD`: springs are half an increment ahead, as velocities are those of the full step ([`Velocities`]).
///
/// # Source
/// W (3.4), (3.5); (3.9) with the erratum on G_eff.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mindlin<const SPRINGS: usize, const AHEAD: bool> {
    /// f · 8 G_k \[Pa\].
    modulus: [f64; SPRINGS],
    rate: [f64; SPRINGS],
    decay: [f64; SPRINGS],
    weight: [f64; SPRINGS],
    /// f · 8 G_k (1−e^{−x})/x times [`Self::advance`] \[Pa s\]: what a spring advances by, per contact radius and slip velocity.
    increment: [f64; SPRINGS],
    friction: f64,
    /// c_t/c_n, 0 without dashpot.
    dashpot_ratio: f64,
    time_step: f64,
    /// The part of Δt whose increment comes before the evaluation \[s\].
    advance: f64,
}

impl<const SPRINGS: usize, const AHEAD: bool> Mindlin<SPRINGS, AHEAD> {
    /// From the law's parameters, the shear springs that go with the normal law and the pair's Coulomb
    /// friction coefficient.
    #[must_use]
    pub fn new(choice: &LawChoice, shear: &ShearSprings<SPRINGS>, friction: f64) -> Self {
        let factor = choice.number(FACTOR.name);
        let damping = choice.flag(DAMPING.name);
        Self {
            modulus: shear.modulus.map(|modulus| factor * 8.0 * modulus),
            rate: shear.rate,
            decay: [1.0; SPRINGS],
            weight: [1.0; SPRINGS],
            increment: [0.0; SPRINGS],
            friction,
            dashpot_ratio: if damping { (4.0 * factor * shear.shear_to_young).sqrt() } else { 0.0 },
            time_step: 0.0,
            advance: 0.0,
        }
    }
}

/// Energy that a branch dissipates as it advances by `slip`: what it would hold after an elastic increment from
/// `before`, less what it holds `after`; 0 for a spring that does not relax.
#[inline(always)]
fn relaxation_loss<L: Lane>(before: Vector<L>, slip: Vector<L>, after: Vector<L>, stiffness: L) -> L {
    let elastic = add(before, scale(slip, stiffness));
    L::splat(0.5) * (dot(elastic, elastic) - dot(after, after)) / stiffness
}

/// Hands the law of a pair to the visitor; `choice` is the pair's tangential choice.
pub fn build<V: TangentialVisitor, const SPRINGS: usize>(
    pair: &PairConfig,
    choice: &LawChoice,
    shear: &ShearSprings<SPRINGS>,
    visitor: V,
) -> V::Output {
    let friction = pair.properties.friction;
    match pair.properties.velocities {
        Velocities::FullStep => visitor.visit(Mindlin::<SPRINGS, true>::new(choice, shear, friction)),
        Velocities::HalfStep => visitor.visit(Mindlin::<SPRINGS, false>::new(choice, shear, friction)),
    }
}

impl<const SPRINGS: usize, const AHEAD: bool> TangentialLaw for Mindlin<SPRINGS, AHEAD> {
    const MEMORY: usize = 3 * SPRINGS + 1;

    fn columns(&self) -> Vec<Column> {
        // Other numbers than those that are half an increment ahead: no restart may take one for the other.
        let now = if AHEAD { "" } else { AT_STEP };
        let mut columns = Vec::new();
        for (k, &rate) in self.rate.iter().enumerate() {
            let spring = if rate == 0.0 { String::new() } else { format!("branch_{}_", k + 1) };
            for axis in ["x", "y", "z"] {
                columns.push(Column { name: format!("tangential_{spring}force_{axis}{now}"), unit: "N" });
            }
        }
        columns.push(Column { name: "tangential_contact_radius".to_owned(), unit: "m" });
        columns
    }

    fn prepare(&mut self, time_step: f64) {
        self.time_step = time_step;
        self.advance = time_step * if AHEAD { 0.5 } else { 1.0 };
        for k in 0..SPRINGS {
            let x = time_step * self.rate[k];
            self.decay[k] = libm::exp(-x);
            self.weight[k] = mean_decay(x);
            self.increment[k] = self.advance * self.modulus[k] * self.weight[k];
        }
    }

    fn relax(&mut self) {
        for k in (0..SPRINGS).filter(|&k| self.rate[k] > 0.0) {
            (self.decay[k], self.weight[k], self.increment[k]) = (0.0, 0.0, 0.0);
        }
    }

    const EARLY: usize = 2 * SPRINGS;

    /// Of each spring [`Turning::early`].
    #[inline(always)]
    fn early<L: Lane>(&self, touch: &Touch<L>, normal: &NormalResponse<L>, memory: &[L], early: &mut [L]) {
        let mut stored = [[L::splat(0.0); 3]; SPRINGS];
        for (k, stored) in stored.iter_mut().enumerate() {
            *stored = [memory[3 * k], memory[3 * k + 1], memory[3 * k + 2]];
        }
        let turning = Turning::new(touch, self.time_step);
        let both = turning.early(&stored, normal.contact_radius, memory[3 * SPRINGS]);
        for (pair, both) in early.chunks_mut(2).zip(both) {
            pair.copy_from_slice(&both);
        }
    }

    #[inline(always)]
    fn complete<L: Lane>(
        &self,
        touch: &Touch<L>,
        normal: &NormalResponse<L>,
        early: &[L],
        memory: &mut [L],
    ) -> VectorResponse<L> {
        let (zero, half, one) = (L::splat(0.0), L::splat(0.5), L::splat(1.0));
        let turning = Turning::new(touch, self.time_step);
        let radius = normal.contact_radius;
        let last = memory[3 * SPRINGS];
        let limit = coulomb_limit(self.friction, normal.force);

        // Over the step the mean of the radii; one before that is larger has shrunk already, and the force with it.
        let mean_radius = if AHEAD { radius } else { half * (last.min(radius) + radius) };
        let mut advance = [[zero; 3]; SPRINGS];
        let mut trial = [[zero; 3]; SPRINGS];
        let mut carried = [[zero; 3]; SPRINGS];
        for k in 0..SPRINGS {
            let stored = [memory[3 * k], memory[3 * k + 1], memory[3 * k + 2]];
            carried[k] = scale(turning.turn(stored, early[2 * k]), early[2 * k + 1]);
            advance[k] = scale(touch.slip_velocity, L::splat(self.increment[k]) * mean_radius);
            // What is not ahead relaxes now; the last spring is the long-term one, whose decay is 1.
            let relaxes = !AHEAD && k + 1 < SPRINGS;
            let before = if relaxes { scale(carried[k], L::splat(self.decay[k])) } else { carried[k] };
            trial[k] = add(before, advance[k]);
        }
        let load = trial[1..].iter().fold(trial[0], |sum, spring| add(sum, *spring));
        let damping = scale(touch.slip_velocity, L::splat(self.dashpot_ratio) * normal.dashpot);

        let sum = add(load, damping);
        let slider = Slider::new(sum, limit);
        let (value, share) = (slider.carry(sum), slider.share);

        let mut energies = Energies::zero();
        let slip = scale(touch.slip_velocity, L::splat(self.advance));
        for k in 0..SPRINGS {
            let force = slider.carry(trial[k]);
            let relaxed = if AHEAD && k + 1 < SPRINGS { scale(force, L::splat(self.decay[k])) } else { force };
            let ahead = if AHEAD { add(relaxed, advance[k]) } else { relaxed };

            let stiffness = L::splat(self.modulus[k]) * radius;
            let stored = [memory[3 * k], memory[3 * k + 1], memory[3 * k + 2]];
            let last_stiffness = L::splat(self.modulus[k]) * last;
            let shrunk = stiffness_loss(dot(stored, stored), last_stiffness, dot(carried[k], carried[k]), stiffness);
            let (slid, relaxed) = if AHEAD {
                let relaxed = relaxation_loss(carried[k], slip, trial[k], stiffness)
                    + relaxation_loss(force, slip, ahead, stiffness);
                (slip_loss(trial[k], share, slip, stiffness), relaxed)
            } else {
                let lost = step_loss(carried[k], kept_share(radius, last), force, slip, stiffness);
                let relaxed = step_loss(carried[k], one, trial[k], slip, stiffness);
                if self.rate[k] == 0.0 { (lost, zero) } else { (lost - relaxed, relaxed) }
            };
            energies.friction = energies.friction + shrunk + slid;
            energies.viscous = energies.viscous + relaxed;
            let held = half * dot(force, force) / stiffness;
            if self.rate[k] == 0.0 {
                energies.elastic = energies.elastic + held;
            } else {
                energies.viscoelastic = energies.viscoelastic + held;
            }
            [memory[3 * k], memory[3 * k + 1], memory[3 * k + 2]] = ahead;
        }
        memory[3 * SPRINGS] = radius;
        let dissipated = sub(value, slider.carry(load));
        energies.damping = dot(dissipated, touch.slip_velocity) * L::splat(self.time_step);
        VectorResponse { value, energies }
    }
}

#[cfg(test)]
mod tests;
