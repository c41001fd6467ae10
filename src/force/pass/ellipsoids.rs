//! The geometric stage of the contact pass where there are ellipsoids.

use super::{BodyData, Excess, RECORDS_AHEAD, Source};
use crate::contact::section::BLOCK;
use crate::force::ellipsoid::touch::{BlockSource, Surroundings};
use crate::force::lane::{is_far, prefetch};
use crate::force::law::Column;
use crate::force::touches::{BATCH, BlockTouches};
use crate::state::particles::RECORD;

/// The stored normal, behind the laws' own memory: where the search for the common normal starts in the next step.
pub fn normal_columns() -> impl Iterator<Item = Column> {
    ["x", "y", "z"].into_iter().map(|axis| Column { name: format!("contact_normal_{axis}"), unit: "1" })
}

/// Touches of some blocks, and the first that overlaps too much or is not a number.
pub(super) fn geometry(source: &Source, touches: &mut [BlockTouches; BATCH]) -> Excess {
    let Source { input, bodies: BodyData { records, shapes }, section, ref blocks, content, normals } = *source;
    let surroundings = Surroundings { motion: input.motion, range: content.range, simd: input.simd };
    let (pairs, far) = (section.pairs(records), is_far(records));
    let mut excess = None;
    for (block, touches) in blocks.clone().zip(touches) {
        if far && let Some(offsets) = pairs.farther(block + RECORDS_AHEAD) {
            for offset in offsets {
                let body = offset as usize / RECORD;
                prefetch(records, body, 1);
                prefetch(shapes, body, 1);
            }
        }
        BlockSource { surroundings: &surroundings, pairs: &pairs, shapes, section, block, normals }.fill(touches);
        let found = || touches.excess(input.max_overlap_fraction);
        excess = excess.or_else(|| found().map(|(lane, ratio)| (block * BLOCK + lane, ratio)));
    }
    excess
}
