//! Numbers that the laws compute with: one `f64` or several lanes of it, the same operations in each.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// One or several `f64` side by side. Every operation is the IEEE one per lane, so that any width
/// gives the bits of the scalar one. No fused multiply-add.
pub trait Lane:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Send
    + Sync
    + 'static
{
    /// Result of comparisons.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask> + Not<Output = Self::Mask>;
    /// Number of lanes.
    const WIDTH: usize;
    /// The same value in each lane.
    fn splat(value: f64) -> Self;
    /// The first `WIDTH` values of a slice.
    fn load(values: &[f64]) -> Self;
    /// Write the lanes to the first `WIDTH` places of a slice.
    fn store(self, values: &mut [f64]);
    /// Square root.
    #[must_use]
    fn sqrt(self) -> Self;
    /// `if self > other { self } else { other }`.
    #[must_use]
    fn max(self, other: Self) -> Self;
    /// `if self < other { self } else { other }`.
    #[must_use]
    fn min(self, other: Self) -> Self;
    /// `self < other`.
    fn less(self, other: Self) -> Self::Mask;
    /// `self > other`.
    fn greater(self, other: Self) -> Self::Mask;
    /// Lane by lane: `if mask { yes } else { no }` (a blend, never a product).
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
}

impl Lane for f64 {
    type Mask = bool;
    const WIDTH: usize = 1;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        values[0]
    }
    #[inline(always)]
    fn store(self, values: &mut [f64]) {
        values[0] = self;
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn less(self, other: Self) -> bool {
        self < other
    }
    #[inline(always)]
    fn greater(self, other: Self) -> bool {
        self > other
    }
    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}

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
}

/// Three-vectors of lanes.
pub type Vector<L> = [L; 3];

/// Dot product, summed as (x + y) + z.
#[inline(always)]
pub fn dot<L: Lane>(a: Vector<L>, b: Vector<L>) -> L {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Cross product.
#[inline(always)]
pub fn cross<L: Lane>(a: Vector<L>, b: Vector<L>) -> Vector<L> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Sum of two vectors.
#[inline(always)]
pub fn add<L: Lane>(a: Vector<L>, b: Vector<L>) -> Vector<L> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Difference of two vectors.
#[inline(always)]
pub fn sub<L: Lane>(a: Vector<L>, b: Vector<L>) -> Vector<L> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// A vector times a scalar.
#[inline(always)]
pub fn scale<L: Lane>(a: Vector<L>, factor: L) -> Vector<L> {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}
