//! The geometric stages of the contact pass between spheres: the bodies relative to each other, then the touch.

use super::{Excess, PassInput, RECORDS_AHEAD, first_excess};
use crate::contact::section::{BLOCK, Section};
use crate::contact::shift;
use crate::force::geometry::{self, PairTouch, Relative};
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
    let lanes = || (0..BLOCK / L::WIDTH).map(|group| group * L::WIDTH);
    let (first, second) = (section.first.as_chunks::<BLOCK>().0, section.second.as_chunks::<BLOCK>().0);
    let pairs = first[blocks.clone()].iter().zip(&second[blocks.clone()]);
    let codes = &section.shift.as_chunks::<BLOCK>().0[blocks.clone()];
    let numbers: &[f64] = bytemuck::cast_slice(records);
    let (motion, far) = (input.motion, is_far(records));
    let never = L::splat(0.0).greater(L::splat(0.0));
    let mut unequal = never;
    for (((block, pair), codes), touches) in blocks.clone().zip(pairs.clone()).zip(codes).zip(touches.iter_mut()) {
        let ahead = block + RECORDS_AHEAD;
        if far && let (Some(first), Some(second)) = (first.get(ahead), second.get(ahead)) {
            for (first, second) in first.iter().zip(second) {
                prefetch(numbers, (*first).max(*second) as usize, RECORD);
            }
        }
        for lane in lanes() {
            let pair = Relative::<L>::of(records, [&pair.0[lane..], &pair.1[lane..]]);
            touches.put_relative(lane, &pair);
            unequal = unequal | pair.unequal();
        }
        // Away from periodic faces there is nothing to look up.
        if motion.faces_move || !shift::all_here(codes) {
            for lane in lanes() {
                let mut pair = touches.relative::<L>(lane);
                pair.enter_images(&codes[lane..], motion);
                touches.put_images(lane, &pair);
            }
        }
    }
    let unequal = L::any(unequal);
    if content.rolling || unequal {
        for (pair, touches) in pairs.zip(touches.iter_mut()) {
            for lane in lanes() {
                let spin = L::relative_spin(records, [&pair.0[lane..], &pair.1[lane..]]);
                touches.put_relative_spin(lane, &spin);
            }
        }
    }
    let touch = |touches: &BlockTouches, lane: usize| {
        let mut pair = touches.relative::<L>(lane);
        pair.follow_cell(motion);
        geometry::touch(&pair, unequal)
    };
    // Written so that NaN counts as a fault.
    let limit = L::splat(input.max_overlap_fraction);
    let beyond = |pair: &PairTouch<L>| pair.touching & !(limit * pair.min_radius).at_least(pair.touch.overlap);
    let mut faulty = never;
    let touches = &mut touches[..blocks.len()];
    for touches in &mut *touches {
        for lane in lanes() {
            let pair = touch(touches, lane);
            touches.put_touch(lane, &pair, content);
            faulty = faulty | beyond(&pair);
        }
    }
    if !L::any(faulty) {
        return None;
    }
    blocks.zip(touches).find_map(|(block, touches)| {
        lanes().find_map(|lane| {
            let pair = touch(touches, lane);
            let (overlap, place) = (pair.touch.overlap, block * BLOCK + lane);
            first_excess(pair.touching, overlap, pair.min_radius, input.max_overlap_fraction, place)
        })
    })
}
