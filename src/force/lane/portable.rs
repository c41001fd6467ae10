//! Eight lanes in plain loops: the reference that any machine can run in tests.

use super::{Lane, RECORD};
use crate::state::particles::Record;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// Eight `f64` side by side in plain loops: no intrinsics, so it runs anywhere, and it proves in tests
/// that a law written over [`Lane`] gives each lane the scalar bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Portable8(pub [f64; 8]);

/// Result of comparisons of [`Portable8`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PortableMask8(pub [bool; 8]);

impl Portable8 {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self(std::array::from_fn(|k| f(self.0[k], other.0[k])))
    }
    #[inline(always)]
    fn compare(self, other: Self, f: impl Fn(f64, f64) -> bool) -> PortableMask8 {
        PortableMask8(std::array::from_fn(|k| f(self.0[k], other.0[k])))
    }
}

impl Add for Portable8 {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Portable8 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Portable8 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl Div for Portable8 {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
}

impl Neg for Portable8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|a| -a))
    }
}

impl BitAnd for PortableMask8 {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] & other.0[k]))
    }
}

impl BitOr for PortableMask8 {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] | other.0[k]))
    }
}

impl Not for PortableMask8 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(self.0.map(|a| !a))
    }
}

impl Lane for Portable8 {
    type Mask = PortableMask8;
    const WIDTH: usize = 8;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([value; 8])
    }
    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        let values = &values[..8];
        Self(std::array::from_fn(|k| values[k]))
    }
    #[inline(always)]
    fn store(self, values: &mut [f64]) {
        values[..8].copy_from_slice(&self.0);
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
    fn less(self, other: Self) -> PortableMask8 {
        self.compare(other, |a, b| a < b)
    }
    #[inline(always)]
    fn greater(self, other: Self) -> PortableMask8 {
        self.compare(other, |a, b| a > b)
    }
    #[inline(always)]
    fn select(mask: PortableMask8, yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|k| if mask.0[k] { yes.0[k] } else { no.0[k] }))
    }
    #[inline(always)]
    fn at_least(self, other: Self) -> PortableMask8 {
        self.compare(other, |a, b| a >= b)
    }
    #[inline(always)]
    fn any(mask: PortableMask8) -> bool {
        mask.0.contains(&true)
    }
    #[inline(always)]
    fn lane(mask: PortableMask8, lane: usize) -> bool {
        mask.0[lane]
    }
    #[inline(always)]
    fn gather(records: &[Record], index: &[u32]) -> [Self; RECORD] {
        let rows: [[f64; RECORD]; 8] = std::array::from_fn(|k| bytemuck::cast(records[index[k] as usize]));
        std::array::from_fn(|c| Self(std::array::from_fn(|k| rows[k][c])))
    }
    #[inline(always)]
    fn scatter(values: [Self; 4], rows: &mut [f64], stride: usize, offset: usize) {
        for k in 0..8 {
            rows[k * stride + offset..][..4].copy_from_slice(&values.map(|v| v.0[k]));
        }
    }
    #[inline(always)]
    fn look_up(table: &[f64; 8], codes: &[u16], bits: u32) -> Self {
        Self(std::array::from_fn(|k| table[usize::from((codes[k] >> bits) & 7)]))
    }
}
