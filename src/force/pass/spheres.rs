//! The geometric stages of the contact pass between spheres: the bodies relative to each other, then the touch.

use super::{BodyData, Excess, LIST_AHEAD, PassInput, RECORDS_AHEAD, Source};
use crate::contact::section::BLOCK;
use crate::contact::shift;
use crate::force::geometry::{self, Relative};
use crate::force::lane::{Lane, for_each_group, is_far, prefetch};
#[cfg(target_arch = "x86_64")]
use crate::force::lane::{avx2::F64x4, avx512::F64x8};
use crate::force::simd::Simd;
use crate::force::touches::{BATCH, BlockTouches, Content};
use crate::state::particles::RECORD;
use std::ops::Range;

/// What happens to each batch after the geometry: gets the numbers of its blocks and their touches.
type Each<'a> = &'a mut dyn FnMut(Range<usize>, &mut [BlockTouches]);

/// Geometry of the blocks of sphere pairs, batch by batch, and the first contact that overlaps too much or is not a number.
/// `EQUAL`: all spheres have the same radius, which the touches know ([`BlockTouches::put_radius`]).
pub(super) fn geometry<const EQUAL: bool>(
    source: &Source,
    touches: &mut [BlockTouches; BATCH],
    each: Each,
) -> Excess {
    match source.input.simd {
        // SAFETY: a level is chosen only if the processor has it (`Simd::is_available`).
        #[cfg(target_arch = "x86_64")]
        Simd::Avx512 => unsafe { geometry_avx512::<EQUAL>(source, touches, each) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Simd::Avx2 => unsafe { geometry_avx2::<EQUAL>(source, touches, each) },
        _ => geometry_of::<f64, EQUAL>(source, touches, each),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn geometry_avx2<const EQUAL: bool>(source: &Source, touches: &mut [BlockTouches; BATCH], each: Each) -> Excess {
    geometry_of::<F64x4, EQUAL>(source, touches, each)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl")]
fn geometry_avx512<const EQUAL: bool>(source: &Source, touches: &mut [BlockTouches; BATCH], each: Each) -> Excess {
    geometry_of::<F64x8, EQUAL>(source, touches, each)
}

#[inline(always)]
fn geometry_of<L: Lane, const EQUAL: bool>(
    source: &Source,
    touches: &mut [BlockTouches; BATCH],
    each: Each,
) -> Excess {
    let Source { input, bodies: BodyData { records, .. }, section, content, .. } = *source;
    let far = is_far(records);
    let mut excess = None;
    let mut start = source.blocks.start;
    while start < source.blocks.end {
        let blocks = start..(start + BATCH).min(source.blocks.end);
        if far {
            let ahead = (start + LIST_AHEAD) * BLOCK;
            prefetch(&section.first, ahead, BATCH * BLOCK);
            prefetch(&section.second, ahead, BATCH * BLOCK);
            prefetch(&section.shift, ahead, BATCH * BLOCK);
        }
        let touches = &mut touches[..blocks.len()];
        let unequal = bodies_of::<L, EQUAL>(source, blocks.clone(), far, touches);
        // Most runs have no walls that move, no memory that lasts and no ledger; without the questions the loop is shorter.
        let faulty = if content.detailed || content.range != 0.0 || input.motion.faces_move {
            touches_of::<L, EQUAL, false>(source, touches, unequal)
        } else {
            touches_of::<L, EQUAL, true>(source, touches, unequal)
        };
        if faulty {
            excess = excess.or_else(|| excess_of(source, blocks.clone()));
        }
        start = blocks.end;
        each(blocks, touches);
    }
    excess
}

/// The bodies of a batch relative to each other; gives whether some are of unequal radii.
#[inline(always)]
fn bodies_of<L: Lane, const EQUAL: bool>(
    source: &Source,
    blocks: Range<usize>,
    far: bool,
    touches: &mut [BlockTouches],
) -> bool {
    let Source { input: PassInput { motion, .. }, bodies: BodyData { records, .. }, section, content, .. } = *source;
    let (first, second) = (section.first.as_chunks::<BLOCK>().0, section.second.as_chunks::<BLOCK>().0);
    let pairs = first[blocks.clone()].iter().zip(&second[blocks.clone()]);
    let codes = &section.shift.as_chunks::<BLOCK>().0[blocks.clone()];
    let numbers: &[f64] = bytemuck::cast_slice(records);
    let mut unequal = L::splat(0.0).greater(L::splat(0.0));
    for (((block, pair), codes), touches) in blocks.zip(pairs.clone()).zip(codes).zip(touches.iter_mut()) {
        let ahead = block + RECORDS_AHEAD;
        if far && let (Some(first), Some(second)) = (first.get(ahead), second.get(ahead)) {
            let later: [u32; BLOCK] = std::array::from_fn(|place| first[place].max(second[place]));
            for offset in later {
                prefetch(numbers, offset as usize, RECORD);
            }
        }
        for_each_group!(L, lane, {
            let pair = Relative::<L>::of::<EQUAL>(records, [&pair.0[lane..], &pair.1[lane..]]);
            touches.put_relative::<L, EQUAL>(lane, &pair);
            if !EQUAL {
                unequal = unequal | pair.unequal();
            }
        });
        // Away from periodic faces there is nothing to look up.
        if motion.faces_move || !shift::all_here(codes) {
            for_each_group!(L, lane, {
                let mut pair = touches.relative::<L>(lane);
                pair.enter_images(&codes[lane..], motion);
                touches.put_images(lane, &pair);
            });
        }
    }
    let unequal = L::any(unequal);
    if content.rolling || unequal {
        for (pair, touches) in pairs.zip(touches.iter_mut()) {
            for_each_group!(L, lane, {
                let spin = L::relative_spin(records, [&pair.0[lane..], &pair.1[lane..]]);
                touches.put_relative_spin(lane, &spin);
            });
        }
    }
    unequal
}

/// The first contact of some blocks that overlaps too much or is not a number.
#[cold]
fn excess_of(source: &Source, blocks: Range<usize>) -> Excess {
    let Source { input, bodies: BodyData { records, .. }, section, .. } = *source;
    (blocks.start * BLOCK..blocks.end * BLOCK).find_map(|place| {
        let pair = [&section.first[place..=place], &section.second[place..=place]];
        let pair = geometry::spheres::<f64>(records, pair, &section.shift[place..=place], input.motion);
        let (overlap, radius) = (pair.touch.overlap, pair.min_radius);
        // Written so that NaN counts as a fault.
        let within = overlap <= input.max_overlap_fraction * radius;
        (pair.touching && !within).then_some((place, overlap / radius))
    })
}

/// The touches of a batch; gives whether one overlaps too much or is not a number. `PLAIN`: there are no details,
/// faces do not move, and the law's memory ends with the touch.
#[inline(always)]
fn touches_of<L: Lane, const EQUAL: bool, const PLAIN: bool>(
    source: &Source,
    touches: &mut [BlockTouches],
    unequal: bool,
) -> bool {
    let Source { input, bodies: BodyData { records, .. }, content, .. } = *source;
    let content = if PLAIN { Content { detailed: false, range: 0.0, ..content } } else { content };
    let (motion, faces_move) = (input.motion, !PLAIN && input.motion.faces_move);
    let radius = records.first().map_or(0.0, |record| record.radius);
    let limit = input.max_overlap_fraction;
    let mut faulty = L::splat(0.0).greater(L::splat(0.0));
    for touches in touches {
        for_each_group!(L, lane, {
            let mut pair = touches.relative::<L>(lane);
            if EQUAL {
                pair.equal(radius);
            }
            pair.follow_cell(motion, faces_move);
            if content.detailed {
                // Here already, so that no register has to hold them until the touch is known.
                touches.put_details(lane, &pair.branch, &pair.imposed_velocity);
            }
            let pair = geometry::touch(&pair, !EQUAL && unequal);
            touches.put_touch::<L, EQUAL>(lane, &pair, content);
            // Written so that NaN counts as a fault.
            let beyond = (L::splat(limit) * pair.min_radius).not_at_least(pair.touch.overlap);
            faulty = faulty | pair.touching & beyond;
        });
    }
    L::any(faulty)
}
