//! Numbers that the laws compute with: one `f64` or several lanes of it, the same operations in each.

use crate::contact::section::{BlockPairs, CacheLine};
use crate::state::particles::{RECORD, Record};
use crate::state::shape::{Number, Shape};
use std::mem::MaybeUninit;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

#[cfg(target_arch = "x86_64")]
pub mod avx2;
#[cfg(target_arch = "x86_64")]
pub mod avx512;
pub mod elementary;
pub mod portable;

/// Numbers of a [`Shape`].
pub const SHAPE: usize = size_of::<Shape>() / size_of::<f64>();

/// Bits of an `f64` after its exponent.
const SIGNIFICAND_BITS: u32 = f64::MANTISSA_DIGITS - 1;
const SIGNIFICAND: u64 = (1 << SIGNIFICAND_BITS) - 1;
const ONE: u64 = 1.0_f64.to_bits();
const BIAS: f64 = 1023.0;
/// 2^52: whole numbers added to it are the lowest bits of the sum.
const WHOLE: f64 = (1_u64 << SIGNIFICAND_BITS) as f64;

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
    /// `self >= other`.
    fn at_least(self, other: Self) -> Self::Mask;
    /// `!(self >= other)`: less or not a number.
    #[inline(always)]
    fn not_at_least(self, other: Self) -> Self::Mask {
        !self.at_least(other)
    }
    /// Lane by lane: `if mask { yes } else { no }` (a blend, never a product).
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Lane by lane: `if mask { self } else { 0 }`.
    #[inline(always)]
    #[must_use]
    fn only(self, mask: Self::Mask) -> Self {
        Self::select(mask, self, Self::splat(0.0))
    }
    /// True in some lane.
    fn any(mask: Self::Mask) -> bool;
    /// Value of a mask in one lane.
    fn lane(mask: Self::Mask, lane: usize) -> bool;
    /// The records of `WIDTH` particles that begin at these numbers of the slice (index times [`RECORD`]),
    /// transposed: entry `c` holds number `c` of each record.
    fn gather(records: &[Record], offsets: &[u32]) -> [Self; RECORD];
    /// What `WIDTH` pairs from `place` of their block on need of their records, transposed: position and radius, second
    /// minus first; velocity, second minus first, and radius, both together; spin and 1/m, both together. `EQUAL`: all
    /// radii are, and what stands in the place of radii means nothing.
    fn relative<const EQUAL: bool>(pairs: &BlockPairs, place: usize) -> [[Self; 4]; 3];
    /// Spin of the second less that of the first, of `WIDTH` pairs from `place` of their block on.
    fn relative_spin(pairs: &BlockPairs, place: usize) -> [Self; 3];
    /// Transposed store: lane `k` of the four values goes to `rows[k * stride + offset ..][..4]`.
    fn scatter(values: [Self; 4], rows: &mut [f64], stride: usize, offset: usize);
    /// Transposed store to rows of six, one right behind the other: lane `k` of the values goes to `rows[6 * k..][..6]`.
    #[inline(always)]
    fn scatter_six([a, b, c, d, e, f]: [Self; 6], rows: &mut [f64]) {
        Self::scatter([a, b, c, d], rows, 6, 0);
        Self::scatter([c, d, e, f], rows, 6, 2);
    }
    /// The shapes of `WIDTH` particles, transposed: semi-axes, mean radius, orientation; at the offsets of their
    /// records.
    fn gather_shapes(shapes: &[Shape], offsets: &[u32]) -> [Self; SHAPE];
    /// m of `x = m 2^e`, 1 ≤ m < 2, for positive normal x.
    #[must_use]
    fn significand(self) -> Self;
    /// e of `x = m 2^e`, 1 ≤ m < 2, for positive normal x.
    #[must_use]
    fn exponent(self) -> Self;
    /// 2^x for whole x from −1022 to 1023.
    #[must_use]
    fn power_of_two(self) -> Self;
    /// `table[(code >> bits) & 7]` for the first `WIDTH` codes.
    fn look_up(table: &[f64; 8], codes: &[u16], bits: u32) -> Self;
    /// `function` of each lane by itself, such as one of `libm`: the scalar bits whatever the width.
    #[inline(always)]
    #[must_use]
    fn map(self, function: impl Fn(f64) -> f64) -> Self {
        let mut values = [0.0; 8];
        self.store(&mut values);
        for value in &mut values[..Self::WIDTH] {
            *value = function(*value);
        }
        Self::load(&values)
    }
}

impl<L: Lane> Number for L {
    #[inline(always)]
    fn number(value: f64) -> Self {
        L::splat(value)
    }
    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }
}

/// Ask for the cache lines of `count` values from place `index` on to be brought into the second cache, there or not.
/// Changes nothing. Not into the first: the few places where it waits for memory are better left to what is needed now.
#[inline(always)]
pub fn prefetch<T>(values: &[T], index: usize, count: usize) {
    #[cfg(target_arch = "x86_64")]
    for offset in (0..count * size_of::<T>()).step_by(64) {
        avx2::prefetch_at(values.as_ptr().wrapping_add(index).addr() + offset);
    }
}

/// Run a block of code for every group of lanes of a block of eight, `lane` being the place of the group's first; written
/// out, as the compiler leaves loops over two long ones alone. (A function that takes a closure would not always be
/// compiled for the vector instructions of its caller.)
macro_rules! for_each_group {
    ($lanes:ident, $lane:ident, $body:block) => {
        match $lanes::WIDTH {
            8 => {
                let $lane = 0;
                $body
            }
            4 => {
                {
                    let $lane = 0;
                    $body
                }
                let $lane = 4;
                $body
            }
            width => {
                for $lane in (0..8).step_by(width) {
                    $body
                }
            }
        }
    };
}
pub(crate) use for_each_group;

/// Has the compiler align the stack of the function that this is fitted into to cache lines. Vectors for which registers are too
/// few are kept there; without, it would not know in time that it has to, and such a vector may lie across two lines or two
/// memory pages, which can cost half of a loop's time.
#[inline(always)]
pub fn align_stack() {
    let line = MaybeUninit::<CacheLine>::uninit();
    std::hint::black_box(line.as_ptr());
}

/// Whether these values have outgrown the nearest caches, so that asking ahead pays.
#[inline(always)]
#[must_use]
pub fn is_far<T>(values: &[T]) -> bool {
    size_of_val(values) > 1 << 18
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
    fn at_least(self, other: Self) -> bool {
        self >= other
    }
    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
    #[inline(always)]
    fn any(mask: bool) -> bool {
        mask
    }
    #[inline(always)]
    fn lane(mask: bool, _lane: usize) -> bool {
        mask
    }
    #[inline(always)]
    fn gather(records: &[Record], offsets: &[u32]) -> [Self; RECORD] {
        bytemuck::cast(records[offsets[0] as usize / RECORD])
    }
    #[inline(always)]
    fn relative<const EQUAL: bool>(pairs: &BlockPairs, place: usize) -> [[Self; 4]; 3] {
        let [a, b] = pairs.records(place);
        let ([x, y, z], [vx, vy, vz]) = (sub(b.position, a.position), sub(b.velocity, a.velocity));
        let [wx, wy, wz] = add(b.spin, a.spin);
        [
            [x, y, z, b.radius - a.radius],
            [vx, vy, vz, b.radius_again + a.radius_again],
            [wx, wy, wz, b.inverse_mass + a.inverse_mass],
        ]
    }
    #[inline(always)]
    fn relative_spin(pairs: &BlockPairs, place: usize) -> [Self; 3] {
        let [a, b] = pairs.records(place);
        sub(b.spin, a.spin)
    }
    #[inline(always)]
    fn scatter(values: [Self; 4], rows: &mut [f64], _stride: usize, offset: usize) {
        rows[offset..offset + 4].copy_from_slice(&values);
    }
    #[inline(always)]
    fn gather_shapes(shapes: &[Shape], offsets: &[u32]) -> [Self; SHAPE] {
        bytemuck::cast(shapes[offsets[0] as usize / RECORD])
    }
    #[inline(always)]
    fn significand(self) -> Self {
        f64::from_bits(self.to_bits() & SIGNIFICAND | ONE)
    }
    #[inline(always)]
    fn exponent(self) -> Self {
        f64::from_bits(self.to_bits() >> SIGNIFICAND_BITS | WHOLE.to_bits()) - (WHOLE + BIAS)
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        f64::from_bits((self + (WHOLE + BIAS)).to_bits() << SIGNIFICAND_BITS)
    }
    #[inline(always)]
    fn look_up(table: &[f64; 8], codes: &[u16], bits: u32) -> Self {
        table[usize::from((codes[0] >> bits) & 7)]
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
