//! The geometric stage of the contact pass at walls, one contact at a time.

use super::{Excess, Source};
use crate::contact::section::BLOCK;
use crate::force::ellipsoid::touch;
use crate::force::geometry;
use crate::force::touches::{BATCH, BlockTouches};

/// Touches of some blocks of contacts with walls, and the first that overlaps too much or is not a number.
pub(super) fn geometry(source: &Source, touches: &mut [BlockTouches; BATCH]) -> Excess {
    let Source { input, bodies, section, ref blocks, content, .. } = *source;
    let mut excess = None;
    for (block, touches) in blocks.clone().zip(touches) {
        touches.put_none();
        for place in block * BLOCK..((block + 1) * BLOCK).min(section.count) {
            let (first, wall, lane) = (section.first_of(place) - section.origin, section.wall_of(place), place % BLOCK);
            let record = &bodies.records[first];
            if bodies.shapes.is_empty() {
                touches.put_any(lane, &geometry::wall(record, wall, input.motion), content.range);
            } else {
                let touch = touch::wall(record, &bodies.shapes[first], wall, input.motion);
                touches.put_any(lane, &touch.pair, content.range);
                touches.put_arm_vectors(lane, &touch.arms);
            }
        }
        let found = || touches.excess(input.max_overlap_fraction);
        excess = excess.or_else(|| found().map(|(lane, ratio)| (block * BLOCK + lane, ratio)));
    }
    excess
}
