//! The geometric stages of the contact pass between spheres: the bodies relative to each other, then the touch.

use super::{BodyData, Excess, LIST_AHEAD, RECORDS_AHEAD, Source};
use crate::contact::section::{BLOCK, Pairs};
use crate::contact::shift;
use crate::force::geometry::{self, Relative};
use crate::force::lane::{Lane, align_stack, for_each_group, is_far, prefetch};
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
pub(super) fn geometry<const EQUAL: bool>(source: &Source, touches: &mut [BlockTouches; BATCH], each: Each) -> Excess {
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
fn geometry_of<L: Lane, const EQUAL: bool>(source: &Source, touches: &mut [BlockTouches; BATCH], each: Each) -> Excess {
    align_stack();
    let Source { input, bodies: BodyData { records, .. }, section, content, ref blocks, .. } = *source;
    let (pairs, far) = (section.pairs(records), is_far(records));
    let mut excess = None;
    let mut start = blocks.start;
    while start < blocks.end {
        let blocks = start..(start + BATCH).min(blocks.end);
        if far {
            let ahead = (start + LIST_AHEAD) * BLOCK;
            for offsets in section.offsets() {
                prefetch(offsets, ahead, BATCH * BLOCK);
            }
            prefetch(&section.shift, ahead, BATCH * BLOCK);
        }
        let touches = &mut touches[..blocks.len()];
        let unequal = bodies_of::<L, EQUAL>(source, &pairs, blocks.clone(), touches);
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

/// The bodies of a batch relative to each other, `all` being the section's pairs; gives whether some are of unequal radii.
#[inline(always)]
fn bodies_of<L: Lane, const EQUAL: bool>(
    source: &Source,
    all: &Pairs,
    blocks: Range<usize>,
    touches: &mut [BlockTouches],
) -> bool {
    let far = is_far(source.bodies.records);
    let batch = all.part(blocks.clone());
    let motion = source.input.motion;
    let mut unequal = L::splat(0.0).greater(L::splat(0.0));
    for ((block, pairs), touches) in blocks.zip(batch.blocks()).zip(touches.iter_mut()) {
        // With each block a few: many requests at once would wait for each other.
        if far && let Some(offsets) = all.farther(block + RECORDS_AHEAD) {
            for offset in offsets {
                prefetch(all.numbers(), offset as usize, RECORD);
            }
        }
        // Away from periodic faces there is nothing to look up.
        let images = motion.faces_move || !shift::all_here(pairs.codes());
        for_each_group!(L, lane, {
            let pair = Relative::<L>::of::<EQUAL>(&pairs, lane);
            touches.put_relative::<L, EQUAL>(lane, &pair);
            // Here and not with the touch, as there is enough to do meanwhile.
            if !images {
                touches.put_distance(lane, &pair.distance());
            }
            if !EQUAL {
                unequal = unequal | pair.unequal();
            }
        });
        if images {
            for_each_group!(L, lane, {
                let mut pair = touches.relative::<L>(lane);
                pair.enter_images(&pairs.codes()[lane..], motion);
                touches.put_images(lane, &pair);
                touches.put_distance(lane, &pair.distance());
            });
        }
    }
    let unequal = L::any(unequal);
    if source.content.rolling || unequal {
        for (pairs, touches) in batch.blocks().zip(touches.iter_mut()) {
            for_each_group!(L, lane, {
                let spin = L::relative_spin(&pairs, lane);
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
    let places = blocks.start * BLOCK..blocks.end * BLOCK;
    let pairs = section.pairs(records).part(blocks);
    let lanes = pairs.blocks().flat_map(|pairs| (0..BLOCK).map(move |lane| (pairs, lane)));
    places.zip(lanes).find_map(|(place, (pairs, lane))| {
        let pair = geometry::spheres::<f64>(&pairs, lane, input.motion);
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
            let pair = geometry::touch(&pair, touches.distance(lane), !EQUAL && unequal);
            touches.put_touch::<L, EQUAL>(lane, &pair, content);
            // Written so that NaN counts as a fault.
            let beyond = (L::splat(limit) * pair.min_radius).not_at_least(pair.touch.overlap);
            faulty = faulty | pair.touching & beyond;
        });
    }
    L::any(faulty)
}
