//! The geometric stages of the contact pass between spheres: the bodies relative to each other, then the touch.

use super::{Excess, PassInput, RECORDS_AHEAD, first_excess};
use crate::contact::section::{BLOCK, Section};
use crate::force::geometry;
use crate::force::lane::{Lane, is_far, prefetch};
#[cfg(target_arch = "x86_64")]
use crate::force::lane::{avx2::F64x4, avx512::F64x8};
use crate::force::simd::Simd;
use crate::force::touches::{BATCH, BlockTouches, Content};
use crate::state::particles::{RECORD, Record};
use std::ops::Range;

/// Geometry of some blocks of sphere pairs, and the first contact that overlaps too much or is not a number.
pub(super) fn geometry(
    input: &PassInput,
    records: &[Record],
    section: &Section,
    blocks: Range<usize>,
    content: Content,
    touches: &mut [BlockTouches; BATCH],
) -> Excess {
    match input.simd {
        // SAFETY: a level is chosen only if the processor has it (`Simd::is_available`).
        #[cfg(target_arch = "x86_64")]
        Simd::Avx512 => unsafe { geometry_avx512(input, records, section, blocks, content, touches) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Simd::Avx2 => unsafe { geometry_avx2(input, records, section, blocks, content, touches) },
        _ => geometry_of::<f64>(input, records, section, blocks, content, touches),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn geometry_avx2(
    input: &PassInput,
    records: &[Record],
    section: &Section,
    blocks: Range<usize>,
    content: Content,
    touches: &mut [BlockTouches; BATCH],
) -> Excess {
    geometry_of::<F64x4>(input, records, section, blocks, content, touches)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl")]
fn geometry_avx512(
    input: &PassInput,
    records: &[Record],
    section: &Section,
    blocks: Range<usize>,
    content: Content,
    touches: &mut [BlockTouches; BATCH],
) -> Excess {
    geometry_of::<F64x8>(input, records, section, blocks, content, touches)
}

#[inline(always)]
fn geometry_of<L: Lane>(
    input: &PassInput,
    records: &[Record],
    section: &Section,
    blocks: Range<usize>,
    content: Content,
    touches: &mut [BlockTouches; BATCH],
) -> Excess {
    let mut excess = None;
    let zero = L::splat(0.0);
    let limit = L::splat(input.max_overlap_fraction);
    let lanes = || (0..BLOCK / L::WIDTH).map(|group| group * L::WIDTH);
    let (first, second) = (section.first.as_chunks::<BLOCK>().0, section.second.as_chunks::<BLOCK>().0);
    let shifts = section.shift.as_chunks::<BLOCK>().0;
    let listed = first[blocks.clone()].iter().zip(&second[blocks.clone()]);
    let numbers: &[f64] = bytemuck::cast_slice(records);
    let far = is_far(records);
    let mut unequal = zero.greater(zero);
    let listed_shifts = listed.clone().zip(&shifts[blocks.clone()]);
    for ((block, ((first_of, second_of), shifts)), touches) in blocks.clone().zip(listed_shifts).zip(touches.iter_mut())
    {
        let ahead = block + RECORDS_AHEAD;
        if far && let (Some(first), Some(second)) = (first.get(ahead), second.get(ahead)) {
            for (first, second) in first.iter().zip(second) {
                prefetch(numbers, (*first).max(*second) as usize, RECORD);
            }
        }
        for lane in lanes() {
            let pair = geometry::relative::<L>(
                records,
                [&first_of[lane..], &second_of[lane..]],
                &shifts[lane..],
                input.motion,
            );
            touches.put_relative(lane, &pair, content);
            unequal = unequal | pair.unequal();
        }
    }
    if content.rolling || L::any(unequal) {
        for ((first, second), touches) in listed.zip(touches.iter_mut()) {
            for lane in lanes() {
                touches.put_relative_spin(lane, &L::relative_spin(records, [&first[lane..], &second[lane..]]));
            }
        }
    }
    for (block, touches) in blocks.zip(touches) {
        for lane in lanes() {
            let pair = geometry::touch(&touches.relative::<L>(lane));
            touches.put_touch(lane, &pair, content.range);
            // Written so that NaN counts as a fault.
            let within = (limit * pair.min_radius).at_least(pair.touch.overlap);
            if excess.is_none() && L::any(pair.touching & !within) {
                let (fraction, place) = (input.max_overlap_fraction, block * BLOCK + lane);
                excess = first_excess(pair.touching, pair.touch.overlap, pair.min_radius, fraction, place);
            }
        }
    }
    excess
}
