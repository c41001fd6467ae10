//! Output lines of the contact pass, see [`LineRing`].

use super::laws::LawBatch;
use super::{Bodies, LEDGER_STRIDE};
use crate::contact::section::BLOCK;
use crate::force::lane::{Lane, Vector, add, align_stack, cross, dot, for_each_group, scale, sub};
#[cfg(target_arch = "x86_64")]
use crate::force::lane::{avx2::F64x4, avx512::F64x8};
use crate::force::simd::Simd;
use crate::force::touches::BlockTouches;

/// Numbers of a line with a force and one torque.
pub const NARROW_LINE: usize = 6;

/// Where the output lines of some blocks go: line `n` to place `n mod capacity` of the buffer.
#[derive(Debug)]
pub struct LineRing<'a> {
    /// Lines, `stride` numbers each: `{F, 0}`, F the force on the first, without torques; `{F, T}`, T the torque on each
    /// of two spheres of equal radii; otherwise `{F, 0, T_first, 0, T_second, 0}`; then the ledger's
    /// `{cell, driven, damping, viscous, friction, plastic, 0, 0}`.
    pub values: &'a mut [f64],
    /// Number of the first block's first line, a multiple of eight.
    pub first: usize,
    /// Capacity less one, all ones in binary; `usize::MAX` for a buffer that never wraps.
    pub mask: usize,
}

impl LineRing<'_> {
    /// The lines of a block, counted from the first; `stride` numbers each.
    #[inline(always)]
    pub fn block(&mut self, block: usize, stride: usize) -> &mut [f64] {
        let slot = ((self.first + block * BLOCK) & self.mask) * stride;
        &mut self.values[slot..slot + BLOCK * stride]
    }
}

/// Where the lines of a batch go and what they hold.
#[derive(Debug)]
pub struct Output<'a> {
    /// Lines.
    pub lines: LineRing<'a>,
    /// What they hold.
    pub form: LineForm,
}

/// What lines hold.
#[derive(Debug, Clone, Copy)]
pub struct LineForm {
    /// Numbers per line.
    pub stride: usize,
    /// Write the ledger's numbers.
    pub ledger: bool,
    /// As [`super::PassInput::work_time`] \[s\].
    pub work_time: f64,
    /// What the bodies are; at walls not [`Bodies::EqualSpheres`], as the arms of both differ.
    pub bodies: Bodies,
    /// There is a rolling law.
    pub rolling: bool,
    /// The second bodies are walls.
    pub walls: bool,
}

/// What the lines of some pairs of spheres are made of beside arms and moments.
pub struct SphereLines<L: Lane> {
    /// Lanes whose law was asked.
    pub alive: L::Mask,
    /// Unit normals.
    pub normal: Vector<L>,
    /// Normal forces \[N\].
    pub normal_force: L,
    /// Tangential forces on the first \[N\].
    pub tangential_force: Vector<L>,
}

impl<L: Lane> SphereLines<L> {
    /// Forces on the firsts \[N\], and tangential forces, 0 where no law was asked.
    #[inline(always)]
    fn forces(&self) -> [Vector<L>; 2] {
        // Normals and arms are numbers in every lane, so that what they multiply may be blended before.
        let tangential = only(self.alive, self.tangential_force);
        let normal_force = self.normal_force.only(self.alive);
        [sub(tangential, scale(self.normal, normal_force)), tangential]
    }

    /// Lines of `L::WIDTH` pairs of equal spheres from `lane` of their block on, where [`LineForm::is_narrow`].
    #[inline(always)]
    pub fn write_narrow(&self, rows: &mut [f64], touches: &BlockTouches, lane: usize) {
        let [[fx, fy, fz], tangential] = self.forces();
        let [tx, ty, tz] = scale(cross(self.normal, tangential), touches.arms::<L>(lane, true)[0]);
        const { assert!(NARROW_LINE == 6) };
        L::scatter_six([fx, fy, fz, tx, ty, tz], rows);
    }
}

impl LineForm {
    /// Lines hold a force and one torque, nothing else.
    #[must_use]
    pub fn is_narrow(&self) -> bool {
        self.stride == NARROW_LINE
    }

    /// Forces and torques of `L::WIDTH` pairs of spheres from `lane` of their block on; gives the forces.
    #[inline(always)]
    pub fn write_spheres<L: Lane>(
        &self,
        rows: &mut [f64],
        of: &SphereLines<L>,
        touches: &BlockTouches,
        lane: usize,
    ) -> Vector<L> {
        let zero = L::splat(0.0);
        let (stride, own) = (self.stride, self.width());
        let [force, tangential] = of.forces();
        if own == 4 {
            L::scatter([force[0], force[1], force[2], zero], rows, stride, 0);
            return force;
        }
        let turning = cross(of.normal, tangential);
        let arms = touches.arms::<L>(lane, self.bodies == Bodies::EqualSpheres);
        let mut first = scale(turning, arms[0]);
        if own == NARROW_LINE {
            L::scatter([force[0], force[1], force[2], first[0]], rows, stride, 0);
            L::scatter([force[2], first[0], first[1], first[2]], rows, stride, 2);
            return force;
        }
        let mut second = scale(turning, arms[1]);
        if self.rolling {
            let moment = only(of.alive, touches.rolling::<L>(lane).value);
            (first, second) = (add(first, moment), sub(second, moment));
        }
        L::scatter([force[0], force[1], force[2], zero], rows, stride, 0);
        L::scatter([first[0], first[1], first[2], zero], rows, stride, 4);
        L::scatter([second[0], second[1], second[2], zero], rows, stride, 8);
        force
    }

    /// Numbers per line without the ledger's.
    #[inline(always)]
    fn width(&self) -> usize {
        if self.ledger { self.stride - LEDGER_STRIDE } else { self.stride }
    }

    /// Forces and torques where there are ellipsoids; gives the forces.
    #[inline(always)]
    fn write_ellipsoids<L: Lane>(&self, rows: &mut [f64], touches: &BlockTouches, lane: usize) -> Vector<L> {
        let zero = L::splat(0.0);
        let (alive, response) = (touches.alive::<L>(lane), touches.response::<L>(lane));
        let normal = touches.touch::<L, true>(lane).normal;
        let moment = if self.rolling { touches.rolling::<L>(lane).value } else { [zero; 3] };
        let arms = touches.arm_vectors::<L>(lane);
        let stride = self.stride;
        let force = sub(response.tangential_force, scale(normal, response.normal_force));
        let first = only(alive, add(cross(arms[0], force), moment));
        let second = only(alive, add(cross(arms[1], force), moment));
        let force = only(alive, force);
        L::scatter([force[0], force[1], force[2], zero], rows, stride, 0);
        L::scatter([first[0], first[1], first[2], zero], rows, stride, 4);
        L::scatter([-second[0], -second[1], -second[2], zero], rows, stride, 8);
        force
    }

    /// What contacts with these forces on the firsts \[N\] put into the ledger in this step, in the order of
    /// [`crate::force::observe::CONTACT_LEDGER`] \[J\].
    #[inline(always)]
    pub fn ledger_entries<L: Lane>(&self, force: &Vector<L>, touches: &BlockTouches, lane: usize) -> [L; 6] {
        let zero = L::splat(0.0);
        let alive = touches.alive::<L>(lane);
        // The cell puts in −F_second · v_imposed per time; at a moving wall the same work is the wall's.
        let work = dot(*force, touches.imposed_velocity(lane)) * L::splat(self.work_time);
        let work = work.only(alive);
        let (cell, driven) = if self.walls { (zero, work) } else { (work, zero) };
        let e = touches.response::<L>(lane).energies;
        let [damping, viscous, friction] = only(alive, [e.damping, e.viscous, e.friction]);
        [cell, driven, damping, viscous, friction, e.plastic.only(alive)]
    }

    #[inline(always)]
    fn write_ledger<L: Lane>(&self, rows: &mut [f64], force: &Vector<L>, touches: &BlockTouches, lane: usize) {
        let zero = L::splat(0.0);
        let [cell, driven, damping, viscous, friction, plastic] = self.ledger_entries(force, touches, lane);
        let (stride, own) = (self.stride, self.width());
        L::scatter([cell, driven, damping, viscous], rows, stride, own);
        L::scatter([friction, plastic, zero, zero], rows, stride, own + 4);
    }
}

impl Output<'_> {
    /// The lines of some blocks whose touches hold details. Of ellipsoids the normals of the contacts whose law was
    /// asked go to three memory columns, from `normals` on.
    pub fn write(&mut self, batch: &mut LawBatch, normals: usize) {
        match batch.simd {
            // SAFETY: a level is chosen only if the processor has it (`Simd::is_available`).
            #[cfg(target_arch = "x86_64")]
            Simd::Avx512 => unsafe { self.write_avx512(batch, normals) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Simd::Avx2 => unsafe { self.write_avx2(batch, normals) },
            _ => self.write_lanes::<f64>(batch, normals),
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn write_avx2(&mut self, batch: &mut LawBatch, normals: usize) {
        self.write_lanes::<F64x4>(batch, normals);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512vl")]
    fn write_avx512(&mut self, batch: &mut LawBatch, normals: usize) {
        self.write_lanes::<F64x8>(batch, normals);
    }

    #[inline(always)]
    fn write_lanes<L: Lane>(&mut self, batch: &mut LawBatch, normals: usize) {
        align_stack();
        let Self { lines, form } = self;
        for (block, touches) in batch.touches.iter().enumerate() {
            let rows = lines.block(block, form.stride);
            for_each_group!(L, lane, {
                let rows = &mut rows[lane * form.stride..];
                let force = if form.bodies == Bodies::Ellipsoids {
                    let stored = &mut batch.memory[block * batch.columns + normals..][..3];
                    let normal = touches.touch::<L, true>(lane).normal;
                    for (column, part) in stored.iter_mut().zip(only(touches.alive::<L>(lane), normal)) {
                        part.store(&mut column.0[lane..]);
                    }
                    form.write_ellipsoids::<L>(rows, touches, lane)
                } else {
                    let response = touches.response::<L>(lane);
                    let spheres = SphereLines {
                        alive: touches.alive::<L>(lane),
                        normal: touches.touch::<L, true>(lane).normal,
                        normal_force: response.normal_force,
                        tangential_force: response.tangential_force,
                    };
                    form.write_spheres(rows, &spheres, touches, lane)
                };
                if form.ledger {
                    form.write_ledger(rows, &force, touches, lane);
                }
            });
        }
    }
}

/// A vector where `mask` holds, 0 elsewhere.
#[inline(always)]
fn only<L: Lane>(mask: L::Mask, v: Vector<L>) -> Vector<L> {
    [v[0].only(mask), v[1].only(mask), v[2].only(mask)]
}
