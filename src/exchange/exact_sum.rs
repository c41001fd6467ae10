//! Sums whose bits do not depend on the order of their terms, and so neither on ranks nor threads.

use super::Communicator;

/// Digits of 32 bits that cover 2⁻¹⁰⁷⁴ … 2¹⁰²³ with room for 2⁶⁴ terms above.
const DIGITS: usize = 68;
/// Bits per digit; the rest of each 64-bit limb takes carries until they are passed on.
const DIGIT_BITS: u32 = 32;
const DIGIT_MASK: i64 = (1 << DIGIT_BITS) - 1;
/// Terms that a limb can take between two carries: each adds less than 2³².
const MAX_PENDING: u32 = 1 << 30;

/// An exact accumulator of `f64`: a fixed-point number as wide as the whole range, of which
/// [`ExactSum::value`] is the correctly rounded value. Infinities and NaN make the sum NaN.
#[derive(Debug, Clone)]
pub struct ExactSum {
    /// Signed digits, weight of digit k: 2^(32 k − 1074).
    limbs: [i64; DIGITS],
    /// Bound on the terms in each limb since the last carry.
    pending: u32,
    /// Number of terms that were not finite.
    not_finite: i64,
}

impl Default for ExactSum {
    fn default() -> Self {
        Self { limbs: [0; DIGITS], pending: 0, not_finite: 0 }
    }
}

impl ExactSum {
    /// Zero.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Add one term, exactly.
    #[inline]
    pub fn add(&mut self, term: f64) {
        let bits = term.to_bits();
        let exponent = (bits >> 52 & 0x7ff) as u32;
        let fraction = bits & ((1 << 52) - 1);
        if exponent == 0x7ff {
            self.not_finite += 1;
            return;
        }
        let significand = fraction | u64::from(exponent != 0) << 52;
        let shift = exponent.saturating_sub(1);
        let digit = (shift / DIGIT_BITS) as usize;
        let wide = u128::from(significand) << (shift % DIGIT_BITS);
        // All ones for negative terms: x ^ sign − sign is then −x.
        let sign = bits as i64 >> 63;
        for (k, limb) in self.limbs[digit..digit + 3].iter_mut().enumerate() {
            let part = (wide >> (k as u32 * DIGIT_BITS)) as i64 & DIGIT_MASK;
            *limb += (part ^ sign) - sign;
        }
        self.pending += 1;
        if self.pending >= MAX_PENDING {
            self.carry();
        }
    }

    /// Add all terms of another sum.
    pub fn merge(&mut self, other: &ExactSum) {
        if self.pending + other.pending >= MAX_PENDING - 2 {
            self.carry();
        }
        let carried;
        let other = if self.pending + other.pending >= MAX_PENDING - 2 {
            carried = other.clone().carried();
            &carried
        } else {
            other
        };
        for (limb, more) in self.limbs.iter_mut().zip(&other.limbs) {
            *limb += more;
        }
        self.pending += other.pending + 1;
        self.not_finite += other.not_finite;
    }

    /// Bring all digits but the highest to 0 … 2³² − 1; the highest keeps the sign.
    fn carry(&mut self) {
        let mut over = 0;
        for limb in &mut self.limbs[..DIGITS - 1] {
            let total = *limb + over;
            *limb = total & DIGIT_MASK;
            over = total >> DIGIT_BITS;
        }
        self.limbs[DIGITS - 1] += over;
        self.pending = 1;
    }

    fn carried(mut self) -> Self {
        self.carry();
        self
    }

    /// The sum, rounded to the nearest `f64`, ties to even; an exact zero is +0.
    #[must_use]
    pub fn value(&self) -> f64 {
        if self.not_finite != 0 {
            return f64::NAN;
        }
        let mut sum = self.clone().carried();
        let negative = sum.limbs[DIGITS - 1] < 0;
        if negative {
            for limb in &mut sum.limbs {
                *limb = -*limb;
            }
            sum.carry();
        }
        let magnitude = sum.round_magnitude();
        if negative { -magnitude } else { magnitude }
    }

    /// Nearest `f64` of a carried sum that is not negative.
    fn round_magnitude(&self) -> f64 {
        let Some(top) = self.limbs.iter().rposition(|&limb| limb != 0) else {
            return 0.0;
        };
        let highest_bit = top as u32 * DIGIT_BITS + self.limbs[top].ilog2();
        // The lowest bit kept; in units of it the significand has at most 53 bits.
        let lowest = highest_bit.saturating_sub(52);
        let mut significand = (0..53).rev().fold(0_u64, |bits, k| bits << 1 | self.bit(lowest + k));
        if lowest > 0 && self.bit(lowest - 1) == 1 {
            let above_half = (0..lowest - 1).any(|k| self.bit(k) == 1);
            significand += u64::from(above_half) | (significand & 1);
        }
        // The leading bit of the significand adds one to the exponent field, as does a carry of the rounding.
        let bits = (u64::from(lowest) << 52) + significand;
        if bits >= f64::INFINITY.to_bits() { f64::INFINITY } else { f64::from_bits(bits) }
    }

    /// Bit `index` of a carried sum; the highest digit may hold more than 32.
    fn bit(&self, index: u32) -> u64 {
        let digit = ((index / DIGIT_BITS) as usize).min(DIGITS - 1);
        (self.limbs[digit] >> (index - digit as u32 * DIGIT_BITS).min(63)) as u64 & 1
    }
}

/// Sum each entry over the ranks, exactly; all ranks then hold the same. Collective; the number of
/// entries is the same on all ranks, of which there may be up to 2²⁰.
pub fn reduce(comm: &Communicator, sums: &mut [ExactSum]) {
    if comm.size() == 1 {
        return;
    }
    const WORDS: usize = DIGITS + 1;
    let mut words = Vec::with_capacity(sums.len() * WORDS);
    for sum in sums.iter_mut() {
        sum.carry();
        words.extend_from_slice(&sum.limbs);
        words.push(sum.not_finite);
    }
    comm.sum_i64(&mut words);
    for (sum, words) in sums.iter_mut().zip(words.chunks_exact(WORDS)) {
        sum.limbs.copy_from_slice(&words[..DIGITS]);
        sum.not_finite = words[DIGITS];
        sum.carry();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sum(terms: &[f64]) -> f64 {
        let mut sum = ExactSum::new();
        terms.iter().for_each(|&term| sum.add(term));
        sum.value()
    }

    #[test]
    fn what_cancels_leaves_no_trace() {
        assert_eq!(sum(&[1e308, 1.0, -1e308]), 1.0);
        assert_eq!(sum(&[1e300, 5e-324, -1e300]), 5e-324);
        assert_eq!(sum(&[1.0, -1.0]).to_bits(), 0.0_f64.to_bits());
        assert_eq!(sum(&[f64::MAX, f64::MAX, -f64::MAX]), f64::MAX);
        assert_eq!(sum(&[f64::MAX, f64::MAX]), f64::INFINITY);
        assert_eq!(sum(&[-f64::MAX, -f64::MAX]), f64::NEG_INFINITY);
    }

    #[test]
    fn rounds_half_to_even() {
        let half_unit = f64::EPSILON / 2.0;
        assert_eq!(sum(&[1.0, half_unit]), 1.0);
        assert_eq!(sum(&[1.0, half_unit, 5e-324]), 1.0 + f64::EPSILON);
        assert_eq!(sum(&[1.0 + f64::EPSILON, half_unit]), 1.0 + 2.0 * f64::EPSILON);
        assert_eq!(sum(&[-1.0 - f64::EPSILON, -half_unit]), -1.0 - 2.0 * f64::EPSILON);
        assert_eq!(sum(&[2.0 - f64::EPSILON, half_unit]), 2.0);
    }

    #[test]
    fn what_is_not_finite_makes_the_sum_nan() {
        assert!(sum(&[1.0, f64::INFINITY]).is_nan());
        assert!(sum(&[f64::NAN]).is_nan());
    }

    #[test]
    fn many_equal_terms_sum_exactly_through_carries() {
        let mut total = ExactSum::new();
        let mut block = ExactSum::new();
        (0..1 << 12).for_each(|_| block.add(0.1));
        for _ in 0..30 {
            let copy = block.clone();
            block.merge(&copy);
        }
        total.merge(&block);
        assert_eq!(total.value(), 0.1 * (1_u64 << 42) as f64);
    }

    proptest! {
        #[test]
        fn one_or_two_terms_agree_with_the_rounded_hardware_sum(a in any::<f64>(), b in any::<f64>()) {
            prop_assume!(a.is_finite() && b.is_finite());
            prop_assert_eq!(sum(&[a]), a);
            prop_assert_eq!(sum(&[a, b]), a + b);
        }

        #[test]
        fn small_integers_times_a_power_of_two_agree_with_integer_arithmetic(
            terms in prop::collection::vec(any::<i32>(), 0..100), power in -1074_i32..900
        ) {
            let unit = if power < -1022 { f64::from_bits(1 << (power + 1074)) }
                else { f64::from_bits(((power + 1023) as u64) << 52) };
            let exact: i64 = terms.iter().map(|&t| i64::from(t)).sum();
            prop_assert_eq!(sum(&terms.iter().map(|&t| f64::from(t) * unit).collect::<Vec<_>>()), exact as f64 * unit);
        }

        #[test]
        fn order_and_grouping_do_not_matter(terms in prop::collection::vec(any::<f64>(), 1..60), cut in 0_usize..60) {
            let terms: Vec<f64> = terms.into_iter().filter(|t| t.is_finite()).collect();
            let cut = cut.min(terms.len());
            let (mut low, mut high) = (ExactSum::new(), ExactSum::new());
            terms[..cut].iter().for_each(|&t| low.add(t));
            terms[cut..].iter().rev().for_each(|&t| high.add(t));
            high.merge(&low);
            prop_assert_eq!(high.value().to_bits(), sum(&terms).to_bits());
        }
    }
}
