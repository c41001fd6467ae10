//! Rolling and twisting resistance: two spring–dashpot–sliders.

use super::composition::RollingVisitor;
use super::lane::{Lane, add, dot, scale, sub};
use super::law::{Column, Energies, NormalResponse, RollingLaw, Touch, VectorResponse};
use super::registry::{LawChoice, LawEntry, PairProperties, ParameterKind, ParameterSpec, ParameterValue, Role};
use super::slider::{
    AT_STEP, Slider, Turning, carried_share, coulomb_limit, kept_share, slip_loss, step_loss, stiffness_loss,
};
use crate::config::{PairConfig, Velocities};

/// Registry entry.
pub const ENTRY: LawEntry = LawEntry {
    name: "spring_slider",
    role: Role::Rolling,
    summary: "spring-dashpot-slider against rolling and twisting",
    source: "W Sec. 1 (the four modes)",
    parameters: &[TWISTING_LIMIT, DAMPING_RATIO],
    uses: &[],
    check: |_| Ok(()),
};

const TWISTING_LIMIT: ParameterSpec = ParameterSpec {
    name: "twisting_limit",
    kind: ParameterKind::Choice(&["effective_radius", "contact_radius"]),
    default: ParameterValue::Choice(0),
    doc: "twisting moment at most mu_tw R_eff F_n (effective_radius) or (2/3) a mu F_n (contact_radius)",
};

pub(super) const DAMPING_RATIO: ParameterSpec = ParameterSpec {
    name: "damping_ratio",
    kind: ParameterKind::Number { min: 0.0, max: 2.0 },
    default: ParameterValue::Number(0.3),
    doc: "damping ratio of the rolling and twisting dashpots (0: none, 1: critical against a wall)",
};

/// Resistance to rolling and twisting: `ΔM_r = K_t R_eff² Δθ_r`, `|M_r| ≤ μ_r R_eff F_n` and
/// `ΔM_tw = ½ K_t a² Δθ_tw`, `|M_tw| ≤ μ_tw R_eff F_n` or `(2/3) a μ F_n`, with `K_t = 8 G_eff a`.
///
/// θ_r and θ_tw: tangential and normal part of the rotation of j relative to i (ω_j − ω_i integrated),
/// a \[m\] contact radius, G_eff \[Pa\] (long-term with Maxwell branches), M \[N m\]. The moment on i is +M,
/// on j −M: i is dragged along by j's relative rotation.
///
/// As in the tangential law, in runs with dashpots the stored moments are half an increment ahead of the touch; they turn with the
/// contact and shrink with the stiffness when a decreases. The dashpots have `c = 2 ζ √(I K)` with
/// `I = 2/5 m_eff R_eff²` (a sphere against a wall; between equal spheres the damping ratio is ζ/2) and act
/// within the same limits. Memory: rolling moment vector, twisting moment, contact radius of the last step.
///
/// # Source
/// W Sec. 1 names the four modes of motion; stiffnesses and limits are this program's convention.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpringSlider {
    /// 8 G_eff \[Pa\].
    modulus: f64,
    rolling_friction: f64,
    twisting: TwistingLimit,
    damping_ratio: f64,
    velocities: Velocities,
    time_step: f64,
}

/// What bounds the twisting moment.
#[derive(Debug, Clone, Copy, PartialEq)]
enum TwistingLimit {
    /// μ_tw R_eff F_n.
    EffectiveRadius(f64),
    /// (2/3) a μ F_n.
    ContactRadius(f64),
}

impl SpringSlider {
    /// From the law's parameters and the pair's constants.
    #[must_use]
    pub fn new(choice: &LawChoice, properties: &PairProperties) -> Self {
        Self {
            modulus: 8.0 * properties.effective_shear_modulus(),
            rolling_friction: properties.rolling_friction,
            twisting: match choice.word(TWISTING_LIMIT.name) {
                "contact_radius" => TwistingLimit::ContactRadius(2.0 / 3.0 * properties.friction),
                _ => TwistingLimit::EffectiveRadius(properties.twisting_friction),
            },
            damping_ratio: choice.number(DAMPING_RATIO.name),
            velocities: properties.velocities,
            time_step: 0.0,
        }
    }

    /// Dashpot coefficient `2 ζ √(I K)` \[N m s\].
    #[inline(always)]
    fn dashpot<L: Lane>(&self, inertia: L, stiffness: L) -> L {
        if self.damping_ratio == 0.0 {
            L::splat(0.0)
        } else {
            L::splat(2.0 * self.damping_ratio) * (inertia * stiffness).sqrt()
        }
    }

    #[inline(always)]
    fn twisting_limit<L: Lane>(&self, touch: &Touch<L>, normal: &NormalResponse<L>) -> L {
        match self.twisting {
            TwistingLimit::EffectiveRadius(friction) => coulomb_limit(friction, normal.force) * touch.effective_radius,
            TwistingLimit::ContactRadius(friction) => coulomb_limit(friction, normal.force) * normal.contact_radius,
        }
    }
}

/// Hands the law of a pair to the visitor; `choice` is the pair's rolling choice.
pub fn build<V: RollingVisitor>(pair: &PairConfig, choice: &LawChoice, visitor: V) -> V::Output {
    visitor.visit(SpringSlider::new(choice, &pair.properties))
}

impl RollingLaw for SpringSlider {
    const MEMORY: usize = 5;

    fn columns(&self) -> Vec<Column> {
        let now = if self.velocities == Velocities::FullStep { "" } else { AT_STEP };
        let mut columns: Vec<Column> = ["rolling_moment_x", "rolling_moment_y", "rolling_moment_z", "twisting_moment"]
            .map(|name| Column { name: format!("{name}{now}"), unit: "N m" })
            .into();
        columns.push(Column { name: "rolling_contact_radius".to_owned(), unit: "m" });
        columns
    }

    fn prepare(&mut self, time_step: f64) {
        self.time_step = time_step;
    }

    #[inline(always)]
    fn evaluate<L: Lane>(&self, touch: &Touch<L>, normal: &NormalResponse<L>, memory: &mut [L]) -> VectorResponse<L> {
        let half = L::splat(0.5);
        let step = L::splat(self.time_step);
        let (full, share) = (self.velocities == Velocities::FullStep, self.velocities.share_before());
        let (before, ahead) = (L::splat(share * self.time_step), L::splat((1.0 - share) * self.time_step));
        let (a, last) = (normal.contact_radius, memory[4]);
        let square = touch.effective_radius * touch.effective_radius;
        let inertia = L::splat(0.4) * touch.effective_mass * square;
        let twist_rate = dot(touch.relative_spin, touch.normal);
        let roll_rate = sub(touch.relative_spin, scale(touch.normal, twist_rate));
        let mut energies = Energies::zero();

        // Rolling.
        let modulus = L::splat(self.modulus);
        let stiffness = modulus * a * square;
        let stored = [memory[0], memory[1], memory[2]];
        let carried = Turning::new(touch, self.time_step).apply(stored, a, last);
        // Over the step the mean of the stiffnesses, see Mindlin's law.
        let mean = |now: L, last: L| if full { now } else { half * (last.min(now) + now) };
        let last_stiffness = modulus * last * square;
        let trial = add(carried, scale(roll_rate, before * mean(stiffness, last_stiffness)));
        let limit = coulomb_limit(self.rolling_friction, normal.force) * touch.effective_radius;
        let slider = Slider::new(trial, limit);
        let (spring, share) = (slider.carry(trial), slider.share);
        let damped = add(spring, scale(roll_rate, self.dashpot(inertia, stiffness)));
        let rolling = Slider::new(damped, limit).carry(damped);
        [memory[0], memory[1], memory[2]] = add(spring, scale(roll_rate, ahead * stiffness));
        energies.elastic = half * dot(spring, spring) / stiffness;
        let slid = if full {
            slip_loss(trial, share, scale(roll_rate, before), stiffness)
        } else {
            step_loss(carried, kept_share(a, last), spring, scale(roll_rate, step), stiffness)
        };
        energies.friction =
            slid + stiffness_loss(dot(stored, stored), last_stiffness, dot(carried, carried), stiffness);
        energies.damping = dot(sub(rolling, spring), roll_rate) * step;

        // Twisting, a scalar along n.
        let stiffness = half * modulus * a * a * a;
        let last_stiffness = half * modulus * last * last * last;
        let stored = memory[3];
        let kept = kept_share(stiffness, last_stiffness);
        let carried = stored * kept;
        let trial = carried + twist_rate * before * mean(stiffness, last_stiffness);
        let limit = self.twisting_limit(touch, normal);
        let share = carried_share((trial * trial).sqrt(), limit);
        let spring = trial * share;
        let damped = spring + twist_rate * self.dashpot(inertia, stiffness);
        let twisting = damped * carried_share((damped * damped).sqrt(), limit);
        memory[3] = spring + twist_rate * ahead * stiffness;
        memory[4] = a;
        energies.elastic = energies.elastic + half * spring * spring / stiffness;
        let alone = |value: L| [value, L::splat(0.0), L::splat(0.0)];
        let slid = if full {
            slip_loss(alone(trial), share, alone(twist_rate * before), stiffness)
        } else {
            step_loss(alone(carried), kept, alone(spring), alone(twist_rate * step), stiffness)
        };
        energies.friction =
            energies.friction + slid + stiffness_loss(stored * stored, last_stiffness, carried * carried, stiffness);
        energies.damping = energies.damping + (twisting - spring) * twist_rate * step;

        VectorResponse { value: add(rolling, scale(touch.normal, twisting)), energies }
    }
}

#[cfg(test)]
mod tests;
