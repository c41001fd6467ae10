//! What a batch of blocks passes on from one stage of the contact pass to the next: the bodies relative to each
//! other, then the touch, then the normal law's answer. Several short loops in place of a long one keep more
//! blocks under way at a time within the processor; and geometry is compiled once, whatever the number of laws.

use super::geometry::{PairTouch, Relative};
use super::lane::{Lane, Vector};
use super::law::{Energies, MAX_EARLY, NormalResponse, Touch};
use crate::contact::section::{BLOCK, CacheLine};
use bytemuck::Zeroable;

/// Blocks in a batch: few, so that they stay in the nearest cache.
pub const BATCH: usize = 4;

/// Stands for the overlap of lanes whose law is not asked.
const DEAD: f64 = f64::NEG_INFINITY;

/// What is passed on only where it is used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Content {
    /// Relative spins even between equal spheres, for rolling laws.
    pub rolling: bool,
    /// Imposed velocities and energies, for the energy ledger.
    pub ledger: bool,
    /// The normal law's [`super::law::NormalLaw::range`], 0 if its memory ends with the touch.
    pub range: f64,
}

/// Some numbers of each contact of a block.
#[derive(Debug, Clone, Copy, Zeroable)]
#[repr(transparent)]
struct Numbers<const N: usize>([CacheLine; N]);

impl<const N: usize> Numbers<N> {
    #[inline(always)]
    fn put<L: Lane>(&mut self, number: usize, lane: usize, values: &[L]) {
        for (line, value) in self.0[number..].iter_mut().zip(values) {
            value.store(&mut line.0[lane..]);
        }
    }

    #[inline(always)]
    fn one<L: Lane>(&self, number: usize, lane: usize) -> L {
        L::load(&self.0[number].0[lane..])
    }

    #[inline(always)]
    fn vector<L: Lane>(&self, number: usize, lane: usize) -> Vector<L> {
        [self.one(number, lane), self.one(number + 1, lane), self.one(number + 2, lane)]
    }
}

/// The contacts of one block between the stages.
#[derive(Debug, Clone, Copy, Zeroable)]
pub struct BlockTouches {
    /// The bodies; then, in their place, the touch.
    numbers: Numbers<12>,
    arms: Numbers<2>,
    normal: Numbers<3>,
    /// What the tangential law hands on.
    early: Numbers<MAX_EARLY>,
    /// Relative spin, if there is rolling or radii are unequal.
    relative_spin: Numbers<3>,
    /// Imposed velocity, if faces move or there is a ledger.
    imposed_velocity: Numbers<3>,
    /// Energies of the normal law, if there is a ledger.
    energies: Numbers<4>,
}

impl BlockTouches {
    /// Take in the bodies of the lanes from `lane` on, without what the cell imposes. `EQUAL`: without the radii.
    #[inline(always)]
    pub fn put_relative<L: Lane, const EQUAL: bool>(&mut self, lane: usize, pair: &Relative<L>) {
        self.numbers.put(0, lane, &pair.branch);
        self.numbers.put(3, lane, &pair.velocity);
        self.numbers.put(6, lane, &pair.spin_sum);
        self.numbers.put(9, lane, &[pair.inverse_masses]);
        if !EQUAL {
            self.numbers.put(10, lane, &[pair.radius_sum, pair.radius_difference]);
        }
    }

    /// Take in what `EQUAL` leaves out: all spheres have this radius.
    pub fn put_radius(&mut self, radius: f64) {
        self.numbers.0[10].0 = [radius + radius; BLOCK];
        self.numbers.0[11].0 = [0.25 * (radius + radius); BLOCK];
    }

    /// Take in the branch vectors of the lanes from `lane` on again, and the imposed velocity.
    #[inline(always)]
    pub fn put_images<L: Lane>(&mut self, lane: usize, pair: &Relative<L>) {
        self.numbers.put(0, lane, &pair.branch);
        self.imposed_velocity.put(0, lane, &pair.imposed_velocity);
    }

    /// Take in ω_j − ω_i \[rad/s\] of the lanes from `lane` on.
    #[inline(always)]
    pub fn put_relative_spin<L: Lane>(&mut self, lane: usize, relative_spin: &Vector<L>) {
        self.relative_spin.put(0, lane, relative_spin);
    }

    /// The bodies of the lanes from `lane` on; what is not passed on means nothing.
    #[inline(always)]
    #[must_use]
    pub fn relative<L: Lane>(&self, lane: usize) -> Relative<L> {
        Relative {
            branch: self.numbers.vector(0, lane),
            velocity: self.numbers.vector(3, lane),
            spin_sum: self.numbers.vector(6, lane),
            inverse_masses: self.numbers.one(9, lane),
            radius_sum: self.numbers.one(10, lane),
            radius_difference: self.numbers.one(11, lane),
            relative_spin: self.relative_spin.vector(0, lane),
            imposed_velocity: self.imposed_velocity.vector(0, lane),
        }
    }

    /// Take in the touches of the lanes from `lane` on. `EQUAL`: without the effective radius and the second arm,
    /// which is the first.
    #[inline(always)]
    pub fn put_touch<L: Lane, const EQUAL: bool>(&mut self, lane: usize, pair: &PairTouch<L>, content: Content) {
        let touch = &pair.touch;
        let overlap = L::select(pair.alive(content.range), touch.overlap, L::splat(DEAD));
        self.numbers.put(0, lane, &touch.normal);
        self.numbers.put(3, lane, &touch.slip_velocity);
        self.numbers.put(6, lane, &[overlap, touch.overlap_rate, touch.spin_about_normal, touch.effective_mass]);
        self.arms.put(0, lane, &[pair.arm_first]);
        if !EQUAL {
            self.numbers.put(11, lane, &[touch.effective_radius]);
            self.arms.put(1, lane, &[pair.arm_second]);
        }
        if content.ledger {
            self.imposed_velocity.put(0, lane, &pair.imposed_velocity);
        }
    }

    /// The touches of the lanes from `lane` on; what is not passed on means nothing.
    #[inline(always)]
    #[must_use]
    pub fn touch<L: Lane>(&self, lane: usize) -> LawTouch<L> {
        let overlap = self.numbers.one(6, lane);
        LawTouch {
            // NaN is alive.
            alive: L::splat(DEAD).not_at_least(overlap),
            touch: Touch {
                overlap,
                overlap_rate: self.numbers.one(7, lane),
                effective_radius: self.numbers.one(11, lane),
                radius_factor: L::splat(1.0),
                overlap_factor: L::splat(1.0),
                size: self.numbers.one(10, lane),
                effective_mass: self.numbers.one(9, lane),
                normal: self.numbers.vector(0, lane),
                slip_velocity: self.numbers.vector(3, lane),
                spin_about_normal: self.numbers.one(8, lane),
                relative_spin: self.relative_spin.vector(0, lane),
            },
            arm_first: self.arms.one(0, lane),
            arm_second: self.arms.one(1, lane),
            imposed_velocity: self.imposed_velocity.vector(0, lane),
        }
    }

    /// Take in the normal law's answer.
    #[inline(always)]
    pub fn put_normal<L: Lane>(&mut self, lane: usize, normal: &NormalResponse<L>, ledger: bool) {
        self.normal.put(0, lane, &[normal.force, normal.contact_radius, normal.dashpot]);
        if ledger {
            let e = &normal.energies;
            self.energies.put(0, lane, &[e.damping, e.viscous, e.friction, e.plastic]);
        }
    }

    /// Take in what the tangential law hands on.
    #[inline(always)]
    pub fn put_early<L: Lane>(&mut self, lane: usize, early: &[L]) {
        self.early.put(0, lane, early);
    }

    /// What the tangential law hands on, as many numbers as there is room for.
    #[inline(always)]
    pub fn early<L: Lane>(&self, lane: usize, early: &mut [L]) {
        for (number, value) in early.iter_mut().enumerate() {
            *value = self.early.one(number, lane);
        }
    }

    /// The normal law's answer, without stiffness and held energies.
    #[inline(always)]
    #[must_use]
    pub fn normal<L: Lane>(&self, lane: usize) -> NormalResponse<L> {
        NormalResponse {
            force: self.normal.one(0, lane),
            contact_radius: self.normal.one(1, lane),
            dashpot: self.normal.one(2, lane),
            stiffness: L::splat(0.0),
            energies: Energies {
                damping: self.energies.one(0, lane),
                viscous: self.energies.one(1, lane),
                friction: self.energies.one(2, lane),
                plastic: self.energies.one(3, lane),
                ..Energies::zero()
            },
        }
    }
}

/// What the laws' loops need of some touches.
#[derive(Debug, Clone, Copy)]
pub struct LawTouch<L: Lane> {
    /// Lanes whose law is asked.
    pub alive: L::Mask,
    /// The law's view.
    pub touch: Touch<L>,
    /// Distance of the contact point from the first's centre along n \[m\].
    pub arm_first: L,
    /// Distance of the contact point from the second's centre \[m\].
    pub arm_second: L,
    /// The part of the relative velocity that the cell's motion imposes \[m/s\].
    pub imposed_velocity: Vector<L>,
}

impl<L: Lane> LawTouch<L> {
    /// Straight from geometry, for a law of this range.
    #[inline(always)]
    #[must_use]
    pub fn new(pair: &PairTouch<L>, range: f64) -> Self {
        Self {
            alive: pair.alive(range),
            touch: pair.touch,
            arm_first: pair.arm_first,
            arm_second: pair.arm_second,
            imposed_velocity: pair.imposed_velocity,
        }
    }
}
