//! Eight lanes in one AVX-512 register.
//!
//! Every function compiles to instructions that need AVX-512 F and VL: they run only inside the pass that
//! [`super::super::simd`] has chosen after asking the processor, and are inlined there.

use super::avx2::relative_rows;
use super::{BIAS, Lane, ONE, SHAPE, SIGNIFICAND, SIGNIFICAND_BITS, WHOLE};
use crate::contact::section::BlockPairs;
use crate::state::particles::{RECORD, Record};
use crate::state::shape::Shape;
#[allow(clippy::wildcard_imports, reason = "the intrinsics")]
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// Eight `f64`.
#[derive(Debug, Clone, Copy)]
pub struct F64x8(__m512d);

/// Result of comparisons of [`F64x8`], one bit a lane.
#[derive(Debug, Clone, Copy)]
pub struct Mask8(__mmask8);

macro_rules! operator {
    ($trait:ident, $name:ident, $intrinsic:ident) => {
        impl $trait for F64x8 {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                // SAFETY: the processor has AVX-512 (head of this file).
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}
operator!(Add, add, _mm512_add_pd);
operator!(Sub, sub, _mm512_sub_pd);
operator!(Mul, mul, _mm512_mul_pd);
operator!(Div, div, _mm512_div_pd);

impl Neg for F64x8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: the processor has AVX-512 (head of this file). Flips the sign bit, as scalar negation.
        unsafe {
            let sign = _mm512_set1_epi64(i64::MIN);
            Self(_mm512_castsi512_pd(_mm512_xor_si512(_mm512_castpd_si512(self.0), sign)))
        }
    }
}

impl BitAnd for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl BitOr for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl Not for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0)
    }
}

/// The four columns of eight rows of four numbers: `rows[0]` holds rows 0 and 2 one after the other, `rows[1]`
/// rows 1 and 3, `rows[2]` rows 4 and 6, `rows[3]` rows 5 and 7.
///
/// # Safety
/// The processor has AVX-512 F.
#[inline(always)]
unsafe fn columns(rows: [__m512d; 4]) -> [__m512d; 4] {
    // SAFETY: as the function's.
    unsafe {
        let (low, high) = (_mm512_unpacklo_pd(rows[0], rows[1]), _mm512_unpacklo_pd(rows[2], rows[3]));
        let (low_odd, high_odd) = (_mm512_unpackhi_pd(rows[0], rows[1]), _mm512_unpackhi_pd(rows[2], rows[3]));
        [
            _mm512_shuffle_f64x2::<0b10_00_10_00>(low, high),
            _mm512_shuffle_f64x2::<0b10_00_10_00>(low_odd, high_odd),
            _mm512_shuffle_f64x2::<0b11_01_11_01>(low, high),
            _mm512_shuffle_f64x2::<0b11_01_11_01>(low_odd, high_odd),
        ]
    }
}

/// Eight rows of four numbers from their columns: entry `k` holds rows `k` and `k + 4` one after the other.
///
/// # Safety
/// The processor has AVX-512 F.
#[inline(always)]
unsafe fn rows(columns: [__m512d; 4]) -> [__m512d; 4] {
    // SAFETY: as the function's.
    unsafe {
        let low = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13);
        let high = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
        let even = [_mm512_unpacklo_pd(columns[0], columns[1]), _mm512_unpacklo_pd(columns[2], columns[3])];
        let odd = [_mm512_unpackhi_pd(columns[0], columns[1]), _mm512_unpackhi_pd(columns[2], columns[3])];
        [
            _mm512_permutex2var_pd(even[0], low, even[1]),
            _mm512_permutex2var_pd(odd[0], low, odd[1]),
            _mm512_permutex2var_pd(even[0], high, even[1]),
            _mm512_permutex2var_pd(odd[0], high, odd[1]),
        ]
    }
}

/// Four numbers of one row below four of another.
///
/// # Safety
/// The processor has AVX-512 F; four numbers can be read at `from` of both rows.
#[inline(always)]
unsafe fn two_rows(low: *const f64, high: *const f64, from: usize) -> __m512d {
    // SAFETY: as the function's.
    unsafe {
        let low = _mm512_castpd256_pd512(_mm256_loadu_pd(low.add(from)));
        _mm512_insertf64x4::<1>(low, _mm256_loadu_pd(high.add(from)))
    }
}

#[repr(C, packed)]
struct Unaligned(__m256i);

/// Where the records of eight offsets begin.
#[inline(always)]
fn rows_of(records: &[Record], offsets: &[u32]) -> [*const f64; 8] {
    let offsets: &[u32; 8] = offsets[..8].try_into().expect("eight offsets");
    let count = u32::try_from(records.len() * RECORD).unwrap_or(u32::MAX);
    // SAFETY: the processor has AVX-512 (head of this file), with VL. Volatile, so that the scalar loads of the same
    // offsets below stay loads: taking them out of the vector costs more.
    let inside = unsafe {
        let last = _mm256_set1_epi32(count.saturating_sub(RECORD as u32).cast_signed());
        _mm256_cmple_epu32_mask(offsets.as_ptr().cast::<Unaligned>().read_volatile().0, last)
    };
    assert!(inside == u8::MAX && count > 0, "no record begins at some offset");
    let start: *const f64 = records.as_ptr().cast();
    // SAFETY: a whole record follows each of the eight.
    let row = |k: usize| unsafe { start.add(offsets[k] as usize) };
    [row(0), row(1), row(2), row(3), row(4), row(5), row(6), row(7)]
}

impl Lane for F64x8 {
    type Mask = Mask8;
    const WIDTH: usize = 8;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        // SAFETY: the processor has AVX-512 (head of this file).
        Self(unsafe { _mm512_set1_pd(value) })
    }
    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        let values = &values[..8];
        // SAFETY: the processor has AVX-512 (head of this file); the slice holds eight numbers.
        Self(unsafe { _mm512_loadu_pd(values.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, values: &mut [f64]) {
        let values = &mut values[..8];
        // SAFETY: the processor has AVX-512 (head of this file); the slice holds eight numbers.
        unsafe { _mm512_storeu_pd(values.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: the processor has AVX-512 (head of this file).
        Self(unsafe { _mm512_sqrt_pd(self.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: the processor has AVX-512 (head of this file). The instruction gives the second operand
        // unless the first is greater.
        Self(unsafe { _mm512_max_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: as `max`, with less.
        Self(unsafe { _mm512_min_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn less(self, other: Self) -> Mask8 {
        // SAFETY: the processor has AVX-512 (head of this file).
        Mask8(unsafe { _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn greater(self, other: Self) -> Mask8 {
        // SAFETY: the processor has AVX-512 (head of this file).
        Mask8(unsafe { _mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn at_least(self, other: Self) -> Mask8 {
        // SAFETY: the processor has AVX-512 (head of this file).
        Mask8(unsafe { _mm512_cmp_pd_mask::<_CMP_GE_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn not_at_least(self, other: Self) -> Mask8 {
        // SAFETY: the processor has AVX-512 (head of this file).
        Mask8(unsafe { _mm512_cmp_pd_mask::<_CMP_NGE_UQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn select(mask: Mask8, yes: Self, no: Self) -> Self {
        // SAFETY: the processor has AVX-512 (head of this file).
        Self(unsafe { _mm512_mask_blend_pd(mask.0, no.0, yes.0) })
    }
    #[inline(always)]
    fn any(mask: Mask8) -> bool {
        mask.0 != 0
    }
    #[inline(always)]
    fn lane(mask: Mask8, lane: usize) -> bool {
        mask.0 >> lane & 1 == 1
    }
    #[inline(always)]
    fn gather(records: &[Record], offsets: &[u32]) -> [Self; RECORD] {
        let row = rows_of(records, offsets);
        let mut columns = [Self::splat(0.0); RECORD];
        for group in 0..RECORD / 4 {
            // SAFETY: the processor has AVX-512 (head of this file); each row points at the twelve numbers of
            // a record, of which four are read from 4·group on.
            let [x, y, z, w] = unsafe {
                self::columns([
                    two_rows(row[0], row[2], 4 * group),
                    two_rows(row[1], row[3], 4 * group),
                    two_rows(row[4], row[6], 4 * group),
                    two_rows(row[5], row[7], 4 * group),
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
        let [first, second] = pairs.starts::<8>(place);
        let mut result = [[Self::splat(0.0); 4]; 3];
        // SAFETY: the processor has AVX-512 (head of this file); `BlockPairs` points at records.
        unsafe {
            let mut rows = [[_mm512_setzero_pd(); 4]; 3];
            for (k, (low, high)) in [(0, 2), (1, 3), (4, 6), (5, 7)].into_iter().enumerate() {
                let rows_of_pair = |k: usize| relative_rows::<EQUAL>(first[k], second[k]);
                let (low, high) = (rows_of_pair(low), rows_of_pair(high));
                for group in 0..3 {
                    rows[group][k] = _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(low[group]), high[group]);
                }
            }
            for group in 0..3 {
                let [x, y, z, w] = columns(rows[group]);
                result[group] = [Self(x), Self(y), Self(z), Self(w)];
            }
        }
        result
    }
    #[inline(always)]
    fn relative_spin(pairs: &BlockPairs, place: usize) -> [Self; 3] {
        let [first, second] = pairs.starts::<8>(place);
        // SAFETY: the processor has AVX-512 (head of this file); `BlockPairs` points at records, whose spins are the numbers
        // from 8 on.
        let [x, y, z, _] = unsafe {
            let rows = |low: usize, high: usize| {
                _mm512_sub_pd(two_rows(second[low], second[high], 8), two_rows(first[low], first[high], 8))
            };
            columns([rows(0, 2), rows(1, 3), rows(4, 6), rows(5, 7)])
        };
        [Self(x), Self(y), Self(z)]
    }
    #[inline(always)]
    fn scatter(values: [Self; 4], rows: &mut [f64], stride: usize, offset: usize) {
        assert!(rows.len() >= 7 * stride + offset + 4);
        let start = rows.as_mut_ptr();
        // SAFETY: the processor has AVX-512 (head of this file); the last of the four numbers written per
        // row, at 7·stride + offset + 3, lies inside the slice.
        unsafe {
            let lines = self::rows([values[0].0, values[1].0, values[2].0, values[3].0]);
            for k in 0..4 {
                _mm256_storeu_pd(start.add(k * stride + offset), _mm512_castpd512_pd256(lines[k]));
                _mm256_storeu_pd(start.add((k + 4) * stride + offset), _mm512_extractf64x4_pd::<1>(lines[k]));
            }
        }
    }
    #[inline(always)]
    fn gather_shapes(shapes: &[Shape], offsets: &[u32]) -> [Self; SHAPE] {
        let offsets = &offsets[..8];
        let row = |k: usize| (&raw const shapes[offsets[k] as usize / RECORD]).cast::<f64>();
        let rows = [row(0), row(1), row(2), row(3), row(4), row(5), row(6), row(7)];
        let mut result = [Self::splat(0.0); SHAPE];
        for group in 0..SHAPE / 4 {
            // SAFETY: the processor has AVX-512 (head of this file); each row points at the eight numbers of a
            // shape, of which four are read from 4·group on.
            let [x, y, z, w] = unsafe {
                columns([
                    two_rows(rows[0], rows[2], 4 * group),
                    two_rows(rows[1], rows[3], 4 * group),
                    two_rows(rows[4], rows[6], 4 * group),
                    two_rows(rows[5], rows[7], 4 * group),
                ])
            };
            result[4 * group..4 * group + 4].copy_from_slice(&[Self(x), Self(y), Self(z), Self(w)]);
        }
        result
    }
    #[inline(always)]
    fn significand(self) -> Self {
        // SAFETY: the processor has AVX-512 (head of this file).
        unsafe {
            let bits = _mm512_and_si512(_mm512_castpd_si512(self.0), _mm512_set1_epi64(SIGNIFICAND.cast_signed()));
            Self(_mm512_castsi512_pd(_mm512_or_si512(bits, _mm512_set1_epi64(ONE.cast_signed()))))
        }
    }
    #[inline(always)]
    fn exponent(self) -> Self {
        // SAFETY: the processor has AVX-512 (head of this file).
        unsafe {
            let bits = _mm512_srli_epi64::<SIGNIFICAND_BITS>(_mm512_castpd_si512(self.0));
            let whole = _mm512_castpd_si512(_mm512_set1_pd(WHOLE));
            Self(_mm512_castsi512_pd(_mm512_or_si512(bits, whole))) - Self::splat(WHOLE + BIAS)
        }
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        let sum = self + Self::splat(WHOLE + BIAS);
        // SAFETY: the processor has AVX-512 (head of this file).
        unsafe {
            let bits = _mm512_slli_epi64::<SIGNIFICAND_BITS>(_mm512_castpd_si512(sum.0));
            Self(_mm512_castsi512_pd(bits))
        }
    }
    #[inline(always)]
    fn look_up(table: &[f64; 8], codes: &[u16], bits: u32) -> Self {
        let codes: &[u16; 8] = codes[..8].try_into().expect("eight codes");
        // SAFETY: the processor has AVX-512 (head of this file); table and codes hold eight entries each. The
        // instruction uses the lowest three bits of each index.
        unsafe {
            let wide = _mm512_cvtepu16_epi64(_mm_loadu_si128(codes.as_ptr().cast()));
            let index = _mm512_srl_epi64(wide, _mm_cvtsi32_si128(bits.cast_signed()));
            Self(_mm512_permutexvar_pd(index, _mm512_loadu_pd(table.as_ptr())))
        }
    }
}
