//! Lanes in plain loops: what a processor without vector instructions runs, and the reference in tests.

use super::{Lane, SHAPE};
use crate::contact::section::BlockPairs;
use crate::state::particles::{RECORD, Record};
use crate::state::shape::Shape;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// `N` numbers side by side; no intrinsics, so it runs anywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Portable<const N: usize>(pub [f64; N]);

/// Result of comparisons of [`Portable`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PortableMask<const N: usize>(pub [bool; N]);

impl<const N: usize> Portable<N> {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self(std::array::from_fn(|k| f(self.0[k], other.0[k])))
    }
    #[inline(always)]
    fn compare(self, other: Self, f: impl Fn(f64, f64) -> bool) -> PortableMask<N> {
        PortableMask(std::array::from_fn(|k| f(self.0[k], other.0[k])))
    }
}

impl<const N: usize> Add for Portable<N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl<const N: usize> Sub for Portable<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl<const N: usize> Mul for Portable<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl<const N: usize> Div for Portable<N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
}

impl<const N: usize> Neg for Portable<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|a| -a))
    }
}

impl<const N: usize> BitAnd for PortableMask<N> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] & other.0[k]))
    }
}

impl<const N: usize> BitOr for PortableMask<N> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] | other.0[k]))
    }
}

impl<const N: usize> Not for PortableMask<N> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(self.0.map(|a| !a))
    }
}

impl<const N: usize> Lane for Portable<N> {
    type Mask = PortableMask<N>;
    const WIDTH: usize = N;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([value; N])
    }
    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        let values = &values[..N];
        Self(std::array::from_fn(|k| values[k]))
    }
    #[inline(always)]
    fn store(self, values: &mut [f64]) {
        values[..N].copy_from_slice(&self.0);
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f64::sqrt))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn less(self, other: Self) -> PortableMask<N> {
        self.compare(other, |a, b| a < b)
    }
    #[inline(always)]
    fn greater(self, other: Self) -> PortableMask<N> {
        self.compare(other, |a, b| a > b)
    }
    #[inline(always)]
    fn select(mask: PortableMask<N>, yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|k| if mask.0[k] { yes.0[k] } else { no.0[k] }))
    }
    #[inline(always)]
    fn at_least(self, other: Self) -> PortableMask<N> {
        self.compare(other, |a, b| a >= b)
    }
    #[inline(always)]
    fn any(mask: PortableMask<N>) -> bool {
        mask.0.contains(&true)
    }
    #[inline(always)]
    fn lane(mask: PortableMask<N>, lane: usize) -> bool {
        mask.0[lane]
    }
    #[inline(always)]
    fn gather(records: &[Record], offsets: &[u32]) -> [Self; RECORD] {
        let rows: [_; N] = std::array::from_fn(|k| f64::gather(records, &offsets[k..]));
        std::array::from_fn(|c| Self(std::array::from_fn(|k| rows[k][c])))
    }
    #[inline(always)]
    fn relative<const EQUAL: bool>(pairs: &BlockPairs, place: usize) -> [[Self; 4]; 3] {
        let rows: [_; N] = std::array::from_fn(|k| f64::relative::<EQUAL>(pairs, place + k));
        std::array::from_fn(|group| std::array::from_fn(|c| Self(std::array::from_fn(|k| rows[k][group][c]))))
    }
    #[inline(always)]
    fn relative_spin(pairs: &BlockPairs, place: usize) -> [Self; 3] {
        let rows: [_; N] = std::array::from_fn(|k| f64::relative_spin(pairs, place + k));
        std::array::from_fn(|c| Self(std::array::from_fn(|k| rows[k][c])))
    }
    #[inline(always)]
    fn scatter(values: [Self; 4], rows: &mut [f64], stride: usize, offset: usize) {
        for k in 0..N {
            rows[k * stride + offset..][..4].copy_from_slice(&values.map(|v| v.0[k]));
        }
    }
    #[inline(always)]
    fn gather_shapes(shapes: &[Shape], offsets: &[u32]) -> [Self; SHAPE] {
        let rows: [_; N] = std::array::from_fn(|k| f64::gather_shapes(shapes, &offsets[k..]));
        std::array::from_fn(|c| Self(std::array::from_fn(|k| rows[k][c])))
    }
    #[inline(always)]
    fn significand(self) -> Self {
        Self(self.0.map(f64::significand))
    }
    #[inline(always)]
    fn exponent(self) -> Self {
        Self(self.0.map(f64::exponent))
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        Self(self.0.map(f64::power_of_two))
    }
    #[inline(always)]
    fn look_up(table: &[f64; 8], codes: &[u16], bits: u32) -> Self {
        Self(std::array::from_fn(|k| table[usize::from((codes[k] >> bits) & 7)]))
    }
}
