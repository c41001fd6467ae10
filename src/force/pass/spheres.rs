//! The geometric stages of the contact pass between spheres: the bodies relative to each other, then the touch.

use super::{Excess, PREFETCH, PassInput, first_excess};
use crate::contact::section::{BLOCK, Section};
use crate::force::geometry::{self, Bodies};
use crate::force::lane::{Lane, prefetch};
#[cfg(target_arch = "x86_64")]
use crate::force::lane::{avx2::F64x4, avx512::F64x8};
use crate::force::simd::Simd;
use crate::force::touches::{BATCH, BlockTouches, Content};
use crate::state::particles::Record;
use std::ops::Range;

/// Bytes of records that need no asking ahead.
const NEAREST_CACHES: usize = 1 << 20;

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
    let limit = L::splat(input.max_overlap_fraction);
    let lanes = || (0..BLOCK).step_by(L::WIDTH);
    let far = size_of_val(records) > NEAREST_CACHES;
    for (block, touches) in blocks.clone().zip(touches.iter_mut()) {
        for lane in lanes() {
            let places = block * BLOCK + lane..block * BLOCK + lane + L::WIDTH;
            if far && places.end + PREFETCH * BLOCK <= section.second.len() {
                for place in places.start + PREFETCH * BLOCK..places.end + PREFETCH * BLOCK {
                    let (first, second) = (section.first[place], section.second[place]);
                    prefetch(records, if first < second { second } else { first } as usize, 1);
                }
            }
            let a = Bodies::<L>::gather(records, &section.first[places.clone()]);
            let b = Bodies::<L>::gather(records, &section.second[places.clone()]);
            touches.put_relative(lane, &geometry::relative(&a, &b, &section.shift[places], input.motion), content);
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
