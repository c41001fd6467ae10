//! Four lanes in one AVX2 register; as in the file beside this one, the functions run only where the
//! processor has been asked.

use super::{BIAS, Lane, ONE, SHAPE, SIGNIFICAND, SIGNIFICAND_BITS, WHOLE};
use crate::contact::section::BlockPairs;
use crate::state::particles::{RECORD, Record};
use crate::state::shape::Shape;
#[allow(clippy::wildcard_imports, reason = "the intrinsics")]
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// Four `f64`.
#[derive(Debug, Clone, Copy)]
pub struct F64x4(__m256d);

/// Result of comparisons of [`F64x4`]: all bits of a lane set or none.
#[derive(Debug, Clone, Copy)]
pub struct Mask4(__m256d);

macro_rules! operator {
    ($type:ident, $trait:ident, $name:ident, $intrinsic:ident) => {
        impl $trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                // SAFETY: the processor has AVX2 (head of this file).
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}
operator!(F64x4, Add, add, _mm256_add_pd);
operator!(F64x4, Sub, sub, _mm256_sub_pd);
operator!(F64x4, Mul, mul, _mm256_mul_pd);
operator!(F64x4, Div, div, _mm256_div_pd);
operator!(Mask4, BitAnd, bitand, _mm256_and_pd);
operator!(Mask4, BitOr, bitor, _mm256_or_pd);

impl Neg for F64x4 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: the processor has AVX2 (head of this file). Flips the sign bit, as scalar negation.
        Self(unsafe { _mm256_xor_pd(self.0, _mm256_set1_pd(-0.0)) })
    }
}

impl Not for Mask4 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        // SAFETY: the processor has AVX2 (head of this file).
        Self(unsafe { _mm256_xor_pd(self.0, _mm256_castsi256_pd(_mm256_set1_epi64x(-1))) })
    }
}

/// Transposes four rows of four.
///
/// # Safety
/// The processor has AVX2.
#[inline(always)]
unsafe fn transpose(rows: [__m256d; 4]) -> [__m256d; 4] {
    // SAFETY: as the function's.
    unsafe {
        let even = [_mm256_unpacklo_pd(rows[0], rows[1]), _mm256_unpacklo_pd(rows[2], rows[3])];
        let odd = [_mm256_unpackhi_pd(rows[0], rows[1]), _mm256_unpackhi_pd(rows[2], rows[3])];
        [
            _mm256_permute2f128_pd::<0x20>(even[0], even[1]),
            _mm256_permute2f128_pd::<0x20>(odd[0], odd[1]),
            _mm256_permute2f128_pd::<0x31>(even[0], even[1]),
            _mm256_permute2f128_pd::<0x31>(odd[0], odd[1]),
        ]
    }
}

/// What one pair needs of its two records, see [`Lane::relative`].
///
/// # Safety
/// The processor has AVX2; `a` and `b` point at records.
#[inline(always)]
pub(super) unsafe fn relative_rows<const EQUAL: bool>(a: *const f64, b: *const f64) -> [__m256d; 3] {
    // SAFETY: as the function's: twelve numbers lie at each address. b + a is b − (−a).
    unsafe {
        let fourth = _mm256_setr_pd(0.0, 0.0, 0.0, -0.0);
        let from = |numbers: *const f64, group: usize| _mm256_loadu_pd(numbers.add(4 * group));
        [
            _mm256_sub_pd(from(b, 0), from(a, 0)),
            _mm256_sub_pd(from(b, 1), if EQUAL { from(a, 1) } else { _mm256_xor_pd(from(a, 1), fourth) }),
            _mm256_add_pd(from(b, 2), from(a, 2)),
        ]
    }
}

#[repr(C, packed)]
struct Unaligned(__m128i);

/// Where the records of four offsets begin.
#[inline(always)]
fn rows_of(records: &[Record], offsets: &[u32]) -> [*const f64; 4] {
    let offsets: &[u32; 4] = offsets[..4].try_into().expect("four offsets");
    let count = u32::try_from(records.len() * RECORD).unwrap_or(u32::MAX);
    // SAFETY: the processor has AVX2 (head of this file). Volatile, so that the scalar loads of the same offsets below
    // stay loads: taking them out of the vector costs more.
    let inside = unsafe {
        let last = _mm_set1_epi32(count.saturating_sub(RECORD as u32).cast_signed());
        let beyond = _mm_max_epu32(offsets.as_ptr().cast::<Unaligned>().read_volatile().0, last);
        _mm_movemask_epi8(_mm_cmpeq_epi32(beyond, last))
    };
    assert!(inside == 0xffff && count > 0, "no record begins at some offset");
    let start: *const f64 = records.as_ptr().cast();
    // SAFETY: a whole record follows each of the four.
    let row = |k: usize| unsafe { start.add(offsets[k] as usize) };
    [row(0), row(1), row(2), row(3)]
}

/// Ask for the cache line at an address.
#[inline(always)]
pub fn prefetch_at(address: usize) {
    // SAFETY: a prefetch is a hint that every x86-64 processor knows; it never faults, whatever the address.
    unsafe { _mm_prefetch::<_MM_HINT_T1>(std::ptr::without_provenance(address)) };
}

impl Lane for F64x4 {
    type Mask = Mask4;
    const WIDTH: usize = 4;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        // SAFETY: the processor has AVX2 (head of this file).
        Self(unsafe { _mm256_set1_pd(value) })
    }
    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        let values = &values[..4];
        // SAFETY: the processor has AVX2 (head of this file); the slice holds four numbers.
        Self(unsafe { _mm256_loadu_pd(values.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, values: &mut [f64]) {
        let values = &mut values[..4];
        // SAFETY: the processor has AVX2 (head of this file); the slice holds four numbers.
        unsafe { _mm256_storeu_pd(values.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: the processor has AVX2 (head of this file).
        Self(unsafe { _mm256_sqrt_pd(self.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: the processor has AVX2 (head of this file). The instruction gives the second operand unless
        // the first is greater.
        Self(unsafe { _mm256_max_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: as `max`, with less.
        Self(unsafe { _mm256_min_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn less(self, other: Self) -> Mask4 {
        // SAFETY: the processor has AVX2 (head of this file).
        Mask4(unsafe { _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn greater(self, other: Self) -> Mask4 {
        // SAFETY: the processor has AVX2 (head of this file).
        Mask4(unsafe { _mm256_cmp_pd::<_CMP_GT_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn at_least(self, other: Self) -> Mask4 {
        // SAFETY: the processor has AVX2 (head of this file).
        Mask4(unsafe { _mm256_cmp_pd::<_CMP_GE_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn not_at_least(self, other: Self) -> Mask4 {
        // SAFETY: the processor has AVX2 (head of this file).
        Mask4(unsafe { _mm256_cmp_pd::<_CMP_NGE_UQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn select(mask: Mask4, yes: Self, no: Self) -> Self {
        // SAFETY: the processor has AVX2 (head of this file).
        Self(unsafe { _mm256_blendv_pd(no.0, yes.0, mask.0) })
    }
    #[inline(always)]
    fn only(self, mask: Mask4) -> Self {
        // SAFETY: the processor has AVX2 (head of this file). Masks are all ones or all zeros in each lane.
        Self(unsafe { _mm256_and_pd(self.0, mask.0) })
    }
    #[inline(always)]
    fn any(mask: Mask4) -> bool {
        // SAFETY: the processor has AVX2 (head of this file).
        unsafe { _mm256_movemask_pd(mask.0) != 0 }
    }
    #[inline(always)]
    fn lane(mask: Mask4, lane: usize) -> bool {
        // SAFETY: the processor has AVX2 (head of this file).
        unsafe { _mm256_movemask_pd(mask.0) >> lane & 1 == 1 }
    }
    #[inline(always)]
    fn gather(records: &[Record], offsets: &[u32]) -> [Self; RECORD] {
        let row = rows_of(records, offsets);
        let mut columns = [Self::splat(0.0); RECORD];
        for group in 0..RECORD / 4 {
            // SAFETY: the processor has AVX2 (head of this file); each row points at the twelve numbers of a
            // record, of which four are read from 4·group on.
            let [x, y, z, w] = unsafe {
                transpose([
                    _mm256_loadu_pd(row[0].add(4 * group)),
                    _mm256_loadu_pd(row[1].add(4 * group)),
                    _mm256_loadu_pd(row[2].add(4 * group)),
                    _mm256_loadu_pd(row[3].add(4 * group)),
                ])
            };
            columns[4 * group] = Self(x);
            columns[4 * group + 1] = Self(y);
            columns[4 * group + 2] = Self(z);
            columns[4 * group + 3] = Self(w);
        }
        columns
    }
    #[inline(always)]
    fn relative<const EQUAL: bool>(pairs: &BlockPairs, place: usize) -> [[Self; 4]; 3] {
        let [first, second] = pairs.starts::<4>(place);
        let mut rows = [[Self::splat(0.0).0; 4]; 3];
        for k in 0..4 {
            // SAFETY: the processor has AVX2 (head of this file); `BlockPairs` points at records.
            [rows[0][k], rows[1][k], rows[2][k]] = unsafe { relative_rows::<EQUAL>(first[k], second[k]) };
        }
        let mut columns = [[Self::splat(0.0); 4]; 3];
        for group in 0..3 {
            // SAFETY: the processor has AVX2 (head of this file).
            columns[group] = unsafe { transpose(rows[group]) }.map(Self);
        }
        columns
    }
    #[inline(always)]
    fn relative_spin(pairs: &BlockPairs, place: usize) -> [Self; 3] {
        let [first, second] = pairs.starts::<4>(place);
        // SAFETY: the processor has AVX2 (head of this file); `BlockPairs` points at records, whose spins are the numbers
        // from 8 on.
        let [x, y, z, _] = unsafe {
            let row = |k: usize| _mm256_sub_pd(_mm256_loadu_pd(second[k].add(8)), _mm256_loadu_pd(first[k].add(8)));
            transpose([row(0), row(1), row(2), row(3)])
        };
        [Self(x), Self(y), Self(z)]
    }
    #[inline(always)]
    fn scatter(values: [Self; 4], rows: &mut [f64], stride: usize, offset: usize) {
        assert!(rows.len() >= 3 * stride + offset + 4);
        let start = rows.as_mut_ptr();
        // SAFETY: the processor has AVX2 (head of this file); the last of the four numbers written per row,
        // at 3·stride + offset + 3, lies inside the slice.
        unsafe {
            let lines = transpose([values[0].0, values[1].0, values[2].0, values[3].0]);
            for k in 0..4 {
                _mm256_storeu_pd(start.add(k * stride + offset), lines[k]);
            }
        }
    }
    #[inline(always)]
    fn scatter_six([a, b, c, d, e, f]: [Self; 6], rows: &mut [f64]) {
        // The four rows are one run of 24 numbers.
        let rows = &mut rows[..24];
        // SAFETY: the processor has AVX2 (head of this file); the slice holds 24 numbers.
        unsafe {
            let [low, high] = [
                [_mm256_unpacklo_pd(a.0, b.0), _mm256_unpacklo_pd(c.0, d.0), _mm256_unpacklo_pd(e.0, f.0)],
                [_mm256_unpackhi_pd(a.0, b.0), _mm256_unpackhi_pd(c.0, d.0), _mm256_unpackhi_pd(e.0, f.0)],
            ];
            let pairs = [[low[0], low[1]], [low[2], high[0]], [high[1], high[2]]];
            for (k, [first, second]) in pairs.into_iter().enumerate() {
                let start = rows.as_mut_ptr().add(4 * k);
                _mm256_storeu_pd(start, _mm256_permute2f128_pd::<0x20>(first, second));
                _mm256_storeu_pd(start.add(12), _mm256_permute2f128_pd::<0x31>(first, second));
            }
        }
    }
    #[inline(always)]
    fn gather_shapes(shapes: &[Shape], offsets: &[u32]) -> [Self; SHAPE] {
        let offsets = &offsets[..4];
        let row = |k: usize| -> &[f64; SHAPE] { bytemuck::cast_ref(&shapes[offsets[k] as usize / RECORD]) };
        let rows = [row(0), row(1), row(2), row(3)];
        let mut columns = [Self::splat(0.0); SHAPE];
        for group in 0..SHAPE / 4 {
            let one = |k: usize| Self::load(&rows[k][4 * group..]).0;
            // SAFETY: the processor has AVX2 (head of this file).
            let [x, y, z, w] = unsafe { transpose([one(0), one(1), one(2), one(3)]) };
            columns[4 * group..4 * group + 4].copy_from_slice(&[Self(x), Self(y), Self(z), Self(w)]);
        }
        columns
    }
    #[inline(always)]
    fn significand(self) -> Self {
        // SAFETY: the processor has AVX2 (head of this file).
        unsafe {
            let bits = _mm256_and_si256(_mm256_castpd_si256(self.0), _mm256_set1_epi64x(SIGNIFICAND.cast_signed()));
            Self(_mm256_castsi256_pd(_mm256_or_si256(bits, _mm256_set1_epi64x(ONE.cast_signed()))))
        }
    }
    #[inline(always)]
    fn exponent(self) -> Self {
        // SAFETY: the processor has AVX2 (head of this file).
        unsafe {
            let bits = _mm256_srli_epi64::<{ SIGNIFICAND_BITS.cast_signed() }>(_mm256_castpd_si256(self.0));
            let whole = _mm256_castpd_si256(_mm256_set1_pd(WHOLE));
            Self(_mm256_castsi256_pd(_mm256_or_si256(bits, whole))) - Self::splat(WHOLE + BIAS)
        }
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        let sum = self + Self::splat(WHOLE + BIAS);
        // SAFETY: the processor has AVX2 (head of this file).
        unsafe {
            let bits = _mm256_slli_epi64::<{ SIGNIFICAND_BITS.cast_signed() }>(_mm256_castpd_si256(sum.0));
            Self(_mm256_castsi256_pd(bits))
        }
    }
    #[inline(always)]
    fn look_up(table: &[f64; 8], codes: &[u16], bits: u32) -> Self {
        let values: [f64; 4] = std::array::from_fn(|k| table[usize::from((codes[k] >> bits) & 7)]);
        Self::load(&values)
    }
}
