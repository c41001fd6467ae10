//! Logarithm and exponential in lanes, from exactly rounded operations only: the same bits at every width.

use super::Lane;
use std::f64::consts::{LOG2_E, SQRT_2};

/// ln 2 in two parts; the first ends in 21 zero bits, so that its product with a whole exponent is exact.
const LN_2_HIGH: f64 = 0.693_147_180_369_123_8;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// `ln x` for positive normal x, within a few units in the last place.
///
/// `x = m 2^e` with m near 1, `ln m = 2 artanh s`, `s = (m − 1)/(m + 1)`, by its series.
#[inline(always)]
#[must_use]
pub fn ln<L: Lane>(x: L) -> L {
    let (one, half) = (L::splat(1.0), L::splat(0.5));
    let (m, e) = (x.significand(), x.exponent());
    let large = m.greater(L::splat(SQRT_2));
    let m = L::select(large, half * m, m);
    let e = L::select(large, e + one, e);
    let s = (m - one) / (m + one);
    let series = polynomial(s * s, &ARTANH);
    e * L::splat(LN_2_HIGH) + (e * L::splat(LN_2_LOW) + (s + s) * series)
}

/// `e^x` for |x| ≤ 700, within a few units in the last place.
///
/// `e^x = 2^k e^r`, |r| ≤ ½ ln 2, by its series.
#[inline(always)]
#[must_use]
pub fn exp<L: Lane>(x: L) -> L {
    // Added to a number of moderate size it leaves the nearest whole number.
    let round = L::splat(1.5 * super::WHOLE);
    let k = (x * L::splat(LOG2_E) + round) - round;
    let r = (x - k * L::splat(LN_2_HIGH)) - k * L::splat(LN_2_LOW);
    polynomial(r, &EXPONENTIAL) * k.power_of_two()
}

/// Of `artanh(s)/s` in powers of s²: `1/(2k + 1)`.
const ARTANH: [f64; 11] = {
    let (mut series, mut k) = ([0.0; 11], 0);
    while k < series.len() {
        series[k] = 1.0 / (2 * k + 1) as f64;
        k += 1;
    }
    series
};

/// Of `e^r`: `1/k!`.
const EXPONENTIAL: [f64; 14] = {
    let (mut series, mut k) = ([1.0; 14], 1);
    while k < series.len() {
        series[k] = series[k - 1] / k as f64;
        k += 1;
    }
    series
};

/// `c_0 + c_1 x + c_2 x² + …` of at most sixteen terms, neighbours joined first (Estrin's scheme): the shortest chain of
/// operations that wait for each other.
#[inline(always)]
#[must_use]
pub fn polynomial<L: Lane, const N: usize>(x: L, coefficients: &[f64; N]) -> L {
    const { assert!(N <= 16) };
    let mut terms = [L::splat(0.0); 16];
    for (term, coefficient) in terms.iter_mut().zip(coefficients) {
        *term = L::splat(*coefficient);
    }
    let square = x * x;
    let fourth = square * square;
    let terms: [L; 8] = joined(&terms, N, x);
    let terms: [L; 4] = joined(&terms, N.div_ceil(2), square);
    let terms: [L; 2] = joined(&terms, N.div_ceil(4), fourth);
    let terms: [L; 1] = joined(&terms, N.div_ceil(8), fourth * fourth);
    terms[0]
}

/// Each two of the first `count` terms as one, `t_{2k} + t_{2k+1} power`.
#[inline(always)]
fn joined<L: Lane, const HALF: usize>(terms: &[L], count: usize, power: L) -> [L; HALF] {
    let mut pairs = [L::splat(0.0); HALF];
    for (k, pair) in pairs.iter_mut().enumerate() {
        if 2 * k + 1 < count {
            *pair = terms[2 * k] + terms[2 * k + 1] * power;
        } else if 2 * k < count {
            *pair = terms[2 * k];
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers over the whole range that the contact laws use.
    fn numbers() -> impl Iterator<Item = f64> {
        let steps = (0..20_000).map(|k| f64::from(k) / 20_000.0);
        steps.flat_map(|t| [libm::exp(1400.0 * (t - 0.5)), 1.0 + t * t * t * t, 1.0 - 0.5 * t * t * t])
    }

    #[test]
    fn the_logarithm_is_that_of_the_library() {
        assert_eq!(ln(1.0), 0.0);
        for x in numbers() {
            let (got, expected) = (ln(x), libm::log(x));
            assert!((got - expected).abs() <= 1e-15 * expected.abs(), "{x:e}: {got:e}, expected {expected:e}");
        }
    }

    #[test]
    fn the_exponential_is_that_of_the_library() {
        for x in numbers().map(libm::log) {
            let (got, expected) = (exp(x), libm::exp(x));
            assert!((got / expected - 1.0).abs() <= 1e-15, "{x:e}: {got:e}, expected {expected:e}");
        }
    }
}
