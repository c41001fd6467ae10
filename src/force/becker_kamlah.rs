//! Becker and Kamlah's normal law for elastoplastic ellipsoids: elastic, elastic–plastic, fully plastic, and
//! elastic unloading made continuous.

use super::composition::NormalVisitor;
use super::dashpot::{CLIP, DAMPING_NONE};
use super::lane::Lane;
use super::law::{Column, NormalLaw, NormalResponse, Touch};
use super::plastic::{self, LoadingCurve, MEMORY_RANGE, Peak, Plastic, YIELD_FACTOR, Yield};
use super::registry::{LawChoice, LawEntry, ParameterKind, ParameterSpec, ParameterValue, Role};
use super::shear::ShearSprings;
use crate::config::PairConfig;

/// Registry entry.
pub const ENTRY: LawEntry = LawEntry {
    name: "becker_kamlah",
    role: Role::Normal,
    summary: "elastic, elastic-plastic and fully plastic contact of ellipsoids; constants fitted for aspect ratios 0.5 to 2",
    source: "B (2)-(50), (54), with errata",
    parameters: &[
        PRESSURE_SCALE,
        PRESSURE_DECAY,
        PRESSURE_OFFSET,
        RADIUS_SCALE,
        RADIUS_DECAY,
        RADIUS_OFFSET,
        EXPONENT,
        YIELD_FACTOR,
        MEMORY_RANGE,
        DAMPING_NONE,
        CLIP,
    ],
    uses: &["yield_stress"],
    check: plastic::check,
};

const fn number(name: &'static str, range: [f64; 2], default: f64, doc: &'static str) -> ParameterSpec {
    let [min, max] = range;
    ParameterSpec { name, kind: ParameterKind::Number { min, max }, default: ParameterValue::Number(default), doc }
}

const PRESSURE_SCALE: ParameterSpec = number(
    "pressure_scale",
    [0.0, 100.0],
    1.05,
    "lambda_max = pressure_scale exp(-pressure_decay R_e/r) + pressure_offset, r the sum of the mean radii",
);
const PRESSURE_DECAY: ParameterSpec = number("pressure_decay", [0.0, 100.0], 4.62, "see pressure_scale");
const PRESSURE_OFFSET: ParameterSpec = number("pressure_offset", [0.1, 100.0], 2.42, "see pressure_scale");
const RADIUS_SCALE: ParameterSpec = number(
    "radius_scale",
    [0.0, 100.0],
    8.19,
    "epsilon_max = radius_scale exp(-radius_decay R_e/r) + radius_offset, the contact radius over that of first yield \
     from which on the contact is fully plastic",
);
const RADIUS_DECAY: ParameterSpec = number("radius_decay", [0.0, 100.0], 6.14, "see radius_scale");
const RADIUS_OFFSET: ParameterSpec = number("radius_offset", [1.01, 100.0], 1.14, "see radius_scale");
const EXPONENT: ParameterSpec =
    number("exponent", [0.1, 10.0], 1.8, "exponent n of the growth of the contact pressure");

/// `scale · exp(−decay · R_e/r) + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Fit {
    scale: f64,
    decay: f64,
    offset: f64,
}

impl Fit {
    fn new(choice: &LawChoice, [scale, decay, offset]: [&ParameterSpec; 3]) -> Self {
        let number = |spec: &ParameterSpec| choice.number(spec.name);
        Self { scale: number(scale), decay: number(decay), offset: number(offset) }
    }

    #[inline(always)]
    fn at<L: Lane>(&self, relative_radius: L) -> L {
        let fit = *self;
        relative_radius.map(move |x| fit.scale * libm::exp(-fit.decay * x) + fit.offset)
    }
}

/// Elastoplastic contact of ellipsoids. With the equivalent contact radius `c² = R_e δ f_1²/f_2`:
///
/// 1. elastic up to c_Y ([`Plastic::yield_point`]): `F = 4/3 E_eff √R_e (δ/f_2)^{3/2}`;
/// 2. elastic–plastic up to `ε_max c_Y`, fully plastic beyond: `F = F_Y + π λ Y (c² − c_Y²)` with
///    `λ = λ_max − (λ_max − 1.6) x^n`, `x = (ε_max c_Y − c)/((ε_max − 1) c_Y)`, not below 0;
/// 3. unloading and reloading below the largest overlap δ*: [`Plastic::respond`].
///
/// `λ_max = 1.05 exp(−4.62 R_e/r̂) + 2.42` and `ε_max = 8.19 exp(−6.14 R_e/r̂) + 1.14`, r̂ \[m\] the sum of both mean
/// radii; 1.6 is the parameter `yield_factor`, Y \[Pa\] the lower yield stress of the pair, E_eff \[Pa\], F \[N\]
/// positive in compression. The constants are parameters.
///
/// - Range of validity: the constants are fitted to a lithium nickel manganese cobalt oxide (E = 142 GPa,
///   ν = 0.25, Y = 7.9 GPa) and to aspect ratios of 0.5 to 2.
/// - Memory: δ*, δ_p, the regime and the plastic work. A dent stays until the gap exceeds `memory_range` · R_e.
/// - No dashpot unless asked for; energies: [`Plastic::respond`].
///
/// # Source
/// B (2)–(50), (54) with the errata of PHYSICS.md section 2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeckerKamlah {
    plastic: Plastic,
    pressure: Fit,
    radius: Fit,
    exponent: f64,
}

impl BeckerKamlah {
    /// From the pair's constants and the normal law's parameters.
    #[must_use]
    pub fn new(pair: &PairConfig) -> Self {
        Self {
            plastic: Plastic::new(pair),
            pressure: Fit::new(&pair.normal, [&PRESSURE_SCALE, &PRESSURE_DECAY, &PRESSURE_OFFSET]),
            radius: Fit::new(&pair.normal, [&RADIUS_SCALE, &RADIUS_DECAY, &RADIUS_OFFSET]),
            exponent: pair.normal.number(EXPONENT.name),
        }
    }

    /// The loading curve beyond first yield. With `u = c/c_Y = ε − m x`, m = ε − 1, the work since first yield
    /// beside F_Y (δ − δ_Y) is
    /// `π Y c_Y² δ_Y [λ (u² − 1)²/2 − 2 (λ − 1.6) m Σ_i k_i (1 − x^{n+1+i})/(n+1+i)]`,
    /// k_i the coefficients of u³ − u as a polynomial in x.
    #[inline(always)]
    fn beyond_yield<L: Lane>(&self, touch: &Touch<L>, first: &Yield<L>, contact_radius: L) -> Peak<L> {
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let relative = touch.effective_radius / touch.size;
        let (lambda, epsilon) = (self.pressure.at(relative), self.radius.at(relative));
        let first_lambda = L::splat(self.plastic.pressure / self.plastic.yield_stress);
        let u = contact_radius / first.radius_squared.sqrt();
        let m = epsilon - one;
        let x = zero.max((epsilon - u) / m);
        let exponent = self.exponent;
        let power = x.map(|x| libm::pow(x, exponent));
        let growth = u * u - one;
        let unit = L::splat(std::f64::consts::PI * self.plastic.yield_stress) * first.radius_squared;

        let k = [
            (epsilon * epsilon - one) * epsilon,
            -m * (L::splat(3.0) * epsilon * epsilon - one),
            L::splat(3.0) * epsilon * m * m,
            -m * m * m,
        ];
        let mut sum = zero;
        let mut higher = power;
        for (i, k) in k.into_iter().enumerate() {
            higher = higher * x;
            sum = sum + k * (one - higher) / L::splat(exponent + 1.0 + i as f64);
        }
        let excess = lambda - first_lambda;
        let shape = L::splat(0.5) * lambda * growth * growth - L::splat(2.0) * excess * m * sum;
        let elastic_work = L::splat(0.4) * first.force * first.overlap;
        Peak {
            fully_plastic: u.at_least(epsilon),
            force: first.force + unit * (lambda - excess * power) * growth,
            force_at_first_yield_pressure: first.force + unit * first_lambda * growth,
            contact_radius,
            // δ − δ_Y = δ_Y (u² − 1).
            work: elastic_work + (first.force * growth + unit * shape) * first.overlap,
        }
    }
}

impl LoadingCurve for BeckerKamlah {
    #[inline(always)]
    fn loading<L: Lane>(&self, touch: &Touch<L>, overlap: L) -> Peak<L> {
        let first = self.plastic.yield_point(touch);
        let hertz_radius = Plastic::hertz_radius(touch, overlap);
        let contact_radius = touch.radius_factor * hertz_radius;
        let elastic = self.plastic.hertz_force(touch, hertz_radius, overlap);
        let yielded = overlap.greater(first.overlap);
        let elastic_peak = Peak {
            fully_plastic: yielded,
            force: elastic,
            force_at_first_yield_pressure: elastic,
            contact_radius,
            work: L::splat(0.4) * elastic * overlap,
        };
        // Lanes full of elastic contacts need no powers.
        if !L::any(yielded) {
            return elastic_peak;
        }
        let plastic = self.beyond_yield(touch, &first, contact_radius);
        Peak {
            fully_plastic: plastic.fully_plastic,
            force: L::select(yielded, plastic.force, elastic_peak.force),
            force_at_first_yield_pressure: L::select(
                yielded,
                plastic.force_at_first_yield_pressure,
                elastic_peak.force_at_first_yield_pressure,
            ),
            contact_radius,
            work: L::select(yielded, plastic.work, elastic_peak.work),
        }
    }
}

/// Largest aspect ratio of the particles to which the constants are fitted (B: 0.5 to 2).
const FITTED_ASPECT_RATIO: f64 = 2.0;

/// Warns of particles beyond the range to which the constants are fitted.
#[must_use]
pub fn caution(aspect_ratio: f64) -> Option<String> {
    (aspect_ratio > FITTED_ASPECT_RATIO * (1.0 + 1e-12)).then(|| {
        format!(
            "becker_kamlah: semi-axes of one particle differ by a factor of {aspect_ratio:.3}, and the constants are fitted \
             to ratios up to {FITTED_ASPECT_RATIO}: give your own pressure_* and radius_* or take the forces as an \
             extrapolation"
        )
    })
}

/// Hands the law of a pair to the visitor.
pub fn build<V: NormalVisitor>(pair: &PairConfig, visitor: V) -> V::Output {
    visitor.visit(BeckerKamlah::new(pair), ShearSprings::elastic(&pair.properties))
}

impl NormalLaw for BeckerKamlah {
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
