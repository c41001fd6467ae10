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
    let square = s * s;
    let mut series = L::splat(1.0 / 21.0);
    for k in (0..10).rev() {
        series = series * square + L::splat(1.0 / f64::from(2 * k + 1));
    }
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
    let mut series = L::splat(1.0);
    for n in (1..14).rev() {
        series = series * (r * L::splat(1.0 / f64::from(n))) + L::splat(1.0);
    }
    series * k.power_of_two()
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
