//! The laws' stages of the contact pass: the normal law of some blocks with the start of the tangential one, the rolling
//! law, then the rest of the tangential one. Without details the last stage writes the output lines at once.
//!
//! No closure here holds what works on lanes: the compiler does not always fit one into a function for vector
//! instructions, and outside each of these would be a call (`tests/vector_code.rs`).

use super::output::{NARROW_LINE, Output, SphereLines};
use crate::contact::section::CacheLine;
use crate::force::composition::MAX_MEMORY;
use crate::force::lane::{Lane, align_stack, for_each_group};
#[cfg(target_arch = "x86_64")]
use crate::force::lane::{avx2::F64x4, avx512::F64x8};
use crate::force::law::{Column, ContactLaw, MAX_EARLY, RollingLaw};
use crate::force::simd::Simd;
use crate::force::touches::BlockTouches;

/// Some blocks between geometry and output.
pub struct LawBatch<'a> {
    /// Instructions to use.
    pub simd: Simd,
    /// Contacts may be elliptical, or more is wanted than lines between spheres.
    pub detailed: bool,
    /// Energies are wanted; only with details.
    pub energies: bool,
    /// Touches.
    pub touches: &'a mut [BlockTouches],
    /// Their memory, block by block.
    pub memory: &'a mut [CacheLine],
    /// Memory columns of a block: normal, tangential, rolling law, and what else a contact remembers.
    pub columns: usize,
}

/// The loops of a normal and a tangential law over some blocks.
pub trait LawStages: Send + Sync {
    /// Memory columns of both.
    fn columns(&self) -> Vec<Column>;
    /// There is a tangential law.
    fn is_tangential(&self) -> bool;
    /// The normal law's memory outlives the touch.
    fn lasts(&self) -> bool;
    /// Gap over the effective radius up to which the memory lasts, 0 if it ends with the touch.
    fn range(&self) -> f64;
    /// Recompute what depends on the time step \[s\]; `relaxed`: in the limit of infinitely slow processes.
    fn prepare(&mut self, time_step: f64, relaxed: bool);
    /// The normal law with the first part of the tangential one, the rolling law if there is one, and the rest. Without
    /// details, in a batch of spheres, `output` gets the lines. No `output`: the normal law alone.
    fn evaluate(&self, batch: &mut LawBatch, rolling: Option<&dyn RollingStage>, output: Option<&mut Output>);
}

/// The loop of a rolling law over some blocks, between those of the others.
pub trait RollingStage: Send + Sync {
    /// Memory columns.
    fn columns(&self) -> Vec<Column>;
    /// Recompute what depends on the time step \[s\].
    fn prepare(&mut self, time_step: f64);
    /// The rolling law; its memory begins at column `first` of each block. `lasts`: see [`LawStages::lasts`].
    fn evaluate(&self, batch: &mut LawBatch, first: usize, lasts: bool);
}

/// The method `run`, which calls the method `lanes` compiled for the level and the details that the batch asks for.
macro_rules! stage {
    ($($arg:ident: $type:ty),*) => {
        fn run(&self, batch: &mut LawBatch, $($arg: $type),*) {
            match (batch.simd, batch.detailed) {
                // SAFETY: a level is chosen only if the processor has it (`Simd::is_available`).
                #[cfg(target_arch = "x86_64")]
                (Simd::Avx512, false) => unsafe { self.avx512::<false>(batch, $($arg),*) },
                // SAFETY: as above.
                #[cfg(target_arch = "x86_64")]
                (Simd::Avx512, true) => unsafe { self.avx512::<true>(batch, $($arg),*) },
                // SAFETY: as above.
                #[cfg(target_arch = "x86_64")]
                (Simd::Avx2, false) => unsafe { self.avx2::<false>(batch, $($arg),*) },
                // SAFETY: as above.
                #[cfg(target_arch = "x86_64")]
                (Simd::Avx2, true) => unsafe { self.avx2::<true>(batch, $($arg),*) },
                (_, false) => self.lanes::<f64, false>(batch, $($arg),*),
                (_, true) => self.lanes::<f64, true>(batch, $($arg),*),
            }
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2")]
        fn avx2<const DETAILED: bool>(&self, batch: &mut LawBatch, $($arg: $type),*) {
            self.lanes::<F64x4, DETAILED>(batch, $($arg),*);
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx512vl")]
        fn avx512<const DETAILED: bool>(&self, batch: &mut LawBatch, $($arg: $type),*) {
            self.lanes::<F64x8, DETAILED>(batch, $($arg),*);
        }
    };
}

/// The stages of a composition.
pub(super) struct Stages<C>(pub C);

impl<C: ContactLaw> Stages<C> {
    stage!(rolling: Option<&dyn RollingStage>, output: Option<&mut Output>);

    #[inline(always)]
    fn lanes<L: Lane, const DETAILED: bool>(
        &self,
        batch: &mut LawBatch,
        rolling: Option<&dyn RollingStage>,
        output: Option<&mut Output>,
    ) {
        align_stack();
        self.normal::<L, DETAILED>(batch);
        if let Some(output) = output {
            if let Some(rolling) = rolling {
                rolling.evaluate(batch, C::MEMORY, C::LASTS);
            }
            if !DETAILED && output.form.is_narrow() {
                self.complete::<L, DETAILED, true>(batch, output);
            } else {
                self.complete::<L, DETAILED, false>(batch, output);
            }
        }
    }

    #[inline(always)]
    fn normal<L: Lane, const DETAILED: bool>(&self, batch: &mut LawBatch) {
        let zero = L::splat(0.0);
        for (block, touches) in batch.touches.iter_mut().enumerate() {
            let memory = &mut batch.memory[block * batch.columns..][..C::MEMORY];
            let (own, rest) = memory.split_at_mut(C::NORMAL_MEMORY);
            for_each_group!(L, lane, {
                let alive = touches.alive::<L>(lane);
                if DETAILED && !L::any(alive) {
                    forget::<L>(own, lane);
                    forget::<L>(rest, lane);
                } else {
                    let touch = touches.touch::<L, DETAILED>(lane);
                    let mut values = [zero; MAX_MEMORY];
                    let values = &mut values[..C::NORMAL_MEMORY];
                    load(values, own, lane);
                    let normal = self.0.normal(&touch, values);
                    keep(values, own, lane, alive);
                    touches.put_normal::<L, DETAILED>(lane, &normal, batch.energies);
                    if C::EARLY > 0 {
                        let (mut values, mut early) = ([zero; MAX_MEMORY], [zero; MAX_EARLY]);
                        let values = &mut values[..C::MEMORY - C::NORMAL_MEMORY];
                        load(values, rest, lane);
                        self.0.early(&touch, &normal, values, &mut early[..C::EARLY]);
                        touches.put_early(lane, &early[..C::EARLY]);
                    }
                }
            });
        }
    }

    /// `NARROW`: see [`super::output::LineForm::is_narrow`].
    #[inline(always)]
    fn complete<L: Lane, const DETAILED: bool, const NARROW: bool>(&self, batch: &mut LawBatch, output: &mut Output) {
        let zero = L::splat(0.0);
        let Output { lines, form } = output;
        for (block, touches) in batch.touches.iter_mut().enumerate() {
            let own = &mut batch.memory[block * batch.columns..][C::NORMAL_MEMORY..C::MEMORY];
            let stride = if NARROW { NARROW_LINE } else { form.stride };
            let rows = if DETAILED { &mut [] } else { lines.block(block, stride) };
            for_each_group!(L, lane, {
                let alive = touches.alive::<L>(lane);
                if !DETAILED || L::any(alive) {
                    let (touch, normal) = (touches.touch::<L, DETAILED>(lane), touches.normal(lane));
                    let mut early = [zero; MAX_EARLY];
                    touches.early(lane, &mut early[..C::EARLY]);
                    let mut values = [zero; MAX_MEMORY];
                    let values = &mut values[..C::MEMORY - C::NORMAL_MEMORY];
                    load(values, own, lane);
                    let mut response = self.0.complete(&touch, &normal, &early[..C::EARLY], values);
                    keep(values, own, lane, alive);
                    if DETAILED {
                        touches.put_tangential(lane, &response.tangential_force);
                        if batch.energies {
                            if form.rolling {
                                response.energies = response.energies.plus(touches.rolling::<L>(lane).energies);
                            }
                            touches.put_energies(lane, &response.energies);
                        }
                    } else {
                        let spheres = SphereLines {
                            alive,
                            normal: touch.normal,
                            normal_force: response.normal_force,
                            tangential_force: response.tangential_force,
                        };
                        let rows = &mut rows[lane * stride..];
                        if NARROW {
                            spheres.write_narrow(rows, touches, lane);
                        } else {
                            form.write_spheres(rows, &spheres, touches, lane);
                        }
                    }
                }
            });
        }
    }
}

impl<C: ContactLaw> LawStages for Stages<C> {
    fn columns(&self) -> Vec<Column> {
        self.0.columns()
    }
    fn is_tangential(&self) -> bool {
        C::TANGENTIAL
    }
    fn lasts(&self) -> bool {
        C::LASTS
    }
    fn range(&self) -> f64 {
        if C::LASTS { self.0.range() } else { 0.0 }
    }
    fn prepare(&mut self, time_step: f64, relaxed: bool) {
        self.0.prepare(time_step);
        if relaxed {
            self.0.relax();
        }
    }
    fn evaluate(&self, batch: &mut LawBatch, rolling: Option<&dyn RollingStage>, output: Option<&mut Output>) {
        self.run(batch, rolling, output);
    }
}

/// The stage of a rolling law.
pub(super) struct Rolling<R>(pub R);

impl<R: RollingLaw> Rolling<R> {
    stage!(first: usize, lasts: bool);

    #[inline(always)]
    fn lanes<L: Lane, const DETAILED: bool>(&self, batch: &mut LawBatch, first: usize, lasts: bool) {
        const { assert!(R::MEMORY <= MAX_MEMORY, "a rolling law has more memory columns than the loop holds") };
        align_stack();
        let zero = L::splat(0.0);
        for (block, touches) in batch.touches.iter_mut().enumerate() {
            let own = &mut batch.memory[block * batch.columns + first..][..R::MEMORY];
            for_each_group!(L, lane, {
                let mut resisting = touches.alive::<L>(lane);
                if DETAILED && !L::any(resisting) {
                    forget::<L>(own, lane);
                } else {
                    let (touch, normal) = (touches.touch::<L, DETAILED>(lane), touches.normal(lane));
                    let mut values = [zero; MAX_MEMORY];
                    let values = &mut values[..R::MEMORY];
                    load(values, own, lane);
                    let response = self.0.evaluate(&touch, &normal, values);
                    if lasts {
                        // The resistance ends with the contact circle, though the normal law's memory goes on.
                        resisting = resisting & normal.joined();
                    }
                    keep(values, own, lane, resisting);
                    touches.put_rolling::<L, DETAILED>(lane, &response.only(resisting), batch.energies);
                }
            });
        }
    }
}

impl<R: RollingLaw> RollingStage for Rolling<R> {
    fn columns(&self) -> Vec<Column> {
        self.0.columns()
    }
    fn prepare(&mut self, time_step: f64) {
        self.0.prepare(time_step);
    }
    fn evaluate(&self, batch: &mut LawBatch, first: usize, lasts: bool) {
        self.run(batch, first, lasts);
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
        value.only(alive).store(&mut column.0[lane..]);
    }
}

/// Some memory columns of the lanes from `lane` on forget.
#[inline(always)]
fn forget<L: Lane>(memory: &mut [CacheLine], lane: usize) {
    for column in memory {
        L::splat(0.0).store(&mut column.0[lane..]);
    }
}
