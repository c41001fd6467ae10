//! The laws' stages of the contact pass: the normal law of some blocks, then the other laws and the output lines.

use super::{LEDGER_STRIDE, LineRing};
use crate::contact::section::{BLOCK, CacheLine};
use crate::force::composition::MAX_MEMORY;
use crate::force::geometry::PairTouch;
use crate::force::lane::{Lane, add, cross, dot, for_each_group, scale, sub};
#[cfg(target_arch = "x86_64")]
use crate::force::lane::{avx2::F64x4, avx512::F64x8};
use crate::force::law::{ContactLaw, ContactResponse, MAX_EARLY};
use crate::force::touches::{BlockTouches, LawTouch};

/// A law in the loop over the touches of some blocks.
pub(super) struct Laws<'a, C> {
    pub law: &'a C,
    pub stride: usize,
    pub time_step: f64,
    /// All spheres have the same radius.
    pub equal: bool,
}

impl<C: ContactLaw> Laws<'_, C> {
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    pub fn avx2<const LEDGER: bool>(
        &self,
        touches: &mut [BlockTouches],
        memory: &mut [CacheLine],
        lines: &mut LineRing,
    ) {
        self.blocks::<F64x4, LEDGER>(touches, memory, lines);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512vl")]
    pub fn avx512<const LEDGER: bool>(
        &self,
        touches: &mut [BlockTouches],
        memory: &mut [CacheLine],
        lines: &mut LineRing,
    ) {
        self.blocks::<F64x8, LEDGER>(touches, memory, lines);
    }

    /// Law and output of some blocks. No closure here holds what works on lanes: the compiler does not always fit one into
    /// a function for vector instructions, and outside each of these would be a call (`tests/vector_code.rs`).
    #[inline(always)]
    pub fn blocks<L: Lane, const LEDGER: bool>(
        &self,
        touches: &mut [BlockTouches],
        memory: &mut [CacheLine],
        lines: &mut LineRing,
    ) {
        let zero = L::splat(0.0);
        let of = |block: usize| block * C::MEMORY..(block + 1) * C::MEMORY;
        for (block, touches) in touches.iter_mut().enumerate() {
            for_each_group!(L, lane, {
                let pair = touches.touch::<L>(lane);
                let own = &mut memory[of(block)][..C::NORMAL_MEMORY];
                let mut values = [zero; MAX_MEMORY];
                let values = &mut values[..C::NORMAL_MEMORY];
                load(values, own, lane);
                let normal = self.law.normal(&pair.touch, values);
                keep(values, own, lane, pair.alive);
                touches.put_normal(lane, &normal, LEDGER);
                if C::EARLY > 0 {
                    let (mut values, mut early) = ([zero; MAX_MEMORY], [zero; MAX_EARLY]);
                    let rest = &mut values[..C::MEMORY - C::NORMAL_MEMORY];
                    load(rest, &memory[of(block)][C::NORMAL_MEMORY..], lane);
                    self.law.early(&pair.touch, &normal, rest, &mut early[..C::EARLY]);
                    touches.put_early(lane, &early[..C::EARLY]);
                }
            });
        }
        for (block, touches) in touches.iter().enumerate() {
            let slot = ((lines.first + block * BLOCK) & lines.mask) * self.stride;
            let rows = &mut lines.values[slot..slot + BLOCK * self.stride];
            for_each_group!(L, lane, {
                let rows = &mut rows[lane * self.stride..];
                let (pair, normal) = (touches.touch::<L>(lane), touches.normal(lane));
                let mut early = [zero; MAX_EARLY];
                touches.early(lane, &mut early[..C::EARLY]);
                let rest = &mut memory[of(block)][C::NORMAL_MEMORY..C::MEMORY];
                let mut values = [zero; MAX_MEMORY];
                let values = &mut values[..C::MEMORY - C::NORMAL_MEMORY];
                load(values, rest, lane);
                let response = self.law.complete(&pair.touch, &normal, &early[..C::EARLY], values);
                keep(values, rest, lane, pair.alive);
                self.write::<L, LEDGER>(&pair, &response, rows, false);
            });
        }
    }

    /// Law and output of a wall contact.
    pub fn wall<const LEDGER: bool>(
        &self,
        pair: &PairTouch<f64>,
        memory: &mut [CacheLine],
        lane: usize,
        rows: &mut [f64],
    ) {
        let pair = LawTouch::new(pair, if C::LASTS { self.law.range() } else { 0.0 });
        let mut values = [0.0; MAX_MEMORY];
        let values = &mut values[..C::MEMORY];
        load(values, memory, lane);
        let response = self.law.evaluate(&pair.touch, values);
        keep(values, memory, lane, pair.alive);
        self.write::<f64, LEDGER>(&pair, &response, rows, true);
    }

    /// Output of `L::WIDTH` contacts.
    #[inline(always)]
    fn write<L: Lane, const LEDGER: bool>(
        &self,
        pair: &LawTouch<L>,
        response: &ContactResponse<L>,
        rows: &mut [f64],
        wall: bool,
    ) {
        let zero = L::splat(0.0);
        let kept = |value: L| L::select(pair.alive, value, zero);
        // Normals and arms are numbers in every lane, so that what they multiply may be blended before.
        let tangential = response.tangential_force.map(kept);
        let force = sub(tangential, scale(pair.touch.normal, kept(response.normal_force)));
        let stride = self.stride;
        L::scatter([force[0], force[1], force[2], zero], rows, stride, 0);
        let own = if LEDGER { stride - LEDGER_STRIDE } else { stride };
        if own >= 8 {
            let turning = cross(pair.touch.normal, tangential);
            let mut first = scale(turning, pair.arm_first);
            let mut second = scale(turning, if self.equal { pair.arm_first } else { pair.arm_second });
            if C::ROLLING {
                let moment = response.moment.map(kept);
                (first, second) = (add(first, moment), sub(second, moment));
            }
            L::scatter([first[0], first[1], first[2], zero], rows, stride, 4);
            if own >= 12 {
                L::scatter([second[0], second[1], second[2], zero], rows, stride, 8);
            }
        }
        if LEDGER {
            // The cell puts in −F_second · v_imposed Δt; at a moving wall the same work is the wall's.
            let work = kept(dot(force, pair.imposed_velocity) * L::splat(self.time_step));
            let (cell, driven) = if wall { (zero, work) } else { (work, zero) };
            let e = &response.energies;
            L::scatter([cell, driven, kept(e.damping), kept(e.viscous)], rows, stride, own);
            L::scatter([kept(e.friction), kept(e.plastic), zero, zero], rows, stride, own + 4);
        }
    }
}

/// Some memory columns of the lanes from `lane` on.
#[inline(always)]
fn load<L: Lane>(values: &mut [L], memory: &[CacheLine], lane: usize) {
    for (value, column) in values.iter_mut().zip(memory) {
        *value = L::load(&column.0[lane..]);
    }
}

/// Some memory columns of the lanes from `lane` on get these values; those whose law is not asked forget.
#[inline(always)]
fn keep<L: Lane>(values: &[L], memory: &mut [CacheLine], lane: usize, alive: L::Mask) {
    for (value, column) in values.iter().zip(memory) {
        L::select(alive, *value, L::splat(0.0)).store(&mut column.0[lane..]);
    }
}
