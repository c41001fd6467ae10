//! The contact of two ellipsoids at the ends of their first semi-axes, other axes aligned, from the closed
//! forms of the paper: written anew, apart from the law of the program.

use std::f64::consts::PI;

/// B Table 1: E, ν, Y of NMC \[Pa\].
const YOUNG_MODULUS: f64 = 142e9;
const POISSON_RATIO: f64 = 0.25;
pub const YIELD_STRESS: f64 = 7.9e9;

/// Pressure over Y at first yield.
const FIRST: f64 = 1.6;
/// Exponent n of (28).
const EXPONENT: f64 = 1.8;

/// Constants of one contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Theory {
    /// R_e \[m\].
    pub effective_radius: f64,
    /// 1 − (A/B)^{4/3}, what B prints as the eccentricity.
    pub eccentricity_squared: f64,
    /// f_1 and f_2 of B (4).
    factors: [f64; 2],
    /// λ_max and ε_max of B (54).
    pub lambda: f64,
    pub epsilon: f64,
    /// E_eff \[Pa\].
    modulus: f64,
    /// Overlap \[m\] and force \[N\] at first yield.
    pub yield_overlap: f64,
    pub yield_force: f64,
    /// c_Y² \[m²\].
    yield_area: f64,
}

impl Theory {
    /// From the semi-axes \[m\] of both bodies.
    pub fn new(bodies: [[f64; 3]; 2]) -> Self {
        let curvature = |axis: usize| bodies.iter().map(|body| body[0] / (body[axis] * body[axis])).sum::<f64>();
        let [first, second] = [curvature(1), curvature(2)];
        let (low, high) = if first < second { (first, second) } else { (second, first) };
        let ratio = high / low;
        let factor = |power: f64, outer: f64| 1.0 - libm::pow(libm::pow(ratio, power) - 1.0, outer);
        let factors = [factor(0.0602, 1.456), factor(0.0684, 1.531)];
        let effective_radius = 1.0 / (low * high).sqrt();
        let size: f64 = bodies.iter().map(|[a, b, c]| libm::cbrt(a * b * c)).sum();
        let relative = effective_radius / size;
        let modulus = YOUNG_MODULUS / (2.0 * (1.0 - POISSON_RATIO * POISSON_RATIO));
        let mut theory = Self {
            effective_radius,
            eccentricity_squared: 1.0 - libm::pow(low / high, 4.0 / 3.0),
            factors,
            lambda: 1.05 * libm::exp(-4.62 * relative) + 2.42,
            epsilon: 8.19 * libm::exp(-6.14 * relative) + 1.14,
            modulus,
            yield_overlap: 0.0,
            yield_force: 0.0,
            yield_area: 0.0,
        };
        // The mean pressure 2/3 · 1.6 Y of a Hertzian contact: F = 2/3 · 1.6 Y · π c².
        let mean = 2.0 / 3.0 * FIRST * YIELD_STRESS * PI;
        let per_overlap = theory.area(1.0);
        let root = mean * per_overlap / theory.hertz(1.0);
        theory.yield_overlap = root * root;
        theory.yield_force = theory.hertz(theory.yield_overlap);
        theory.yield_area = theory.area(theory.yield_overlap);
        theory
    }

    /// Square of the equivalent contact radius \[m²\] at an overlap \[m\].
    fn area(&self, overlap: f64) -> f64 {
        self.effective_radius * overlap * self.factors[0] * self.factors[0] / self.factors[1]
    }

    fn hertz(&self, overlap: f64) -> f64 {
        let reduced = overlap / self.factors[1];
        4.0 / 3.0 * self.modulus * (self.effective_radius * reduced).sqrt() * reduced
    }

    /// Force of first loading \[N\], B (25), (28).
    pub fn loading(&self, overlap: f64) -> f64 {
        if overlap <= self.yield_overlap {
            return self.hertz(overlap);
        }
        let grown = PI * YIELD_STRESS * (self.area(overlap) - self.yield_area);
        self.yield_force + self.pressure(overlap) * grown
    }

    /// λ of B (28) at an overlap beyond yield.
    pub fn pressure(&self, overlap: f64) -> f64 {
        let radius = (self.area(overlap) / self.yield_area).sqrt();
        let left = (self.epsilon - radius) / (self.epsilon - 1.0);
        let left = if left > 0.0 { left } else { 0.0 };
        self.lambda - (self.lambda - FIRST) * libm::pow(left, EXPONENT)
    }

    /// λ that a force \[N\] at an overlap means, B (51).
    pub fn pressure_of(&self, overlap: f64, force: f64) -> f64 {
        (force - self.yield_force) / (PI * YIELD_STRESS * (self.area(overlap) - self.yield_area))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::becker2021::pair::rows;

    #[test]
    fn the_first_case_has_the_constants_of_the_independent_reference() {
        let scaled = |ratios: [f64; 3]| {
            let scale = 4.675e-6 / libm::cbrt(ratios[0] * ratios[1] * ratios[2]);
            ratios.map(|ratio| scale * ratio)
        };
        let theory = Theory::new([scaled([1.0, 1.25, 1.5]), scaled([1.0, 0.5, 0.8])]);
        let table = rows(include_str!("../../../tests/data/becker_kamlah_case1_geometry.csv")).expect("numbers");
        let [radius, square, _, _, lambda, epsilon, ..] = table[0][..] else { panic!("{table:?}") };
        for (got, expected) in [
            (theory.effective_radius, radius),
            (theory.eccentricity_squared, square),
            (theory.lambda, lambda),
            (theory.epsilon, epsilon),
            (theory.yield_overlap, table[0][8]),
            (theory.yield_force, table[0][9]),
        ] {
            assert!((got / expected - 1.0).abs() < 1e-9, "{got} {expected}");
        }
    }
}
