//! What a batch of blocks passes on from one stage of the contact pass to the next: the bodies relative to each
//! other, then the touch, then the laws' answers. Several short loops in place of a long one keep more
//! blocks under way at a time within the processor; and geometry, rolling laws, output and observation are compiled
//! once, whatever the number of laws.

use super::geometry::{PairTouch, Relative};
use super::lane::{Lane, Vector, scale, sub};
use super::law::{ContactResponse, Energies, MAX_EARLY, NormalResponse, Touch, VectorResponse};
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
    /// What the energy ledger and an observer need beside forces, and the factors of elliptical contacts.
    pub detailed: bool,
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

impl Numbers<6> {
    #[inline(always)]
    fn put_energies<L: Lane>(&mut self, lane: usize, e: &Energies<L>) {
        self.put(0, lane, &[e.elastic, e.viscoelastic, e.damping, e.viscous, e.friction, e.plastic]);
    }

    #[inline(always)]
    fn energies<L: Lane>(&self, lane: usize) -> Energies<L> {
        Energies {
            elastic: self.one(0, lane),
            viscoelastic: self.one(1, lane),
            damping: self.one(2, lane),
            viscous: self.one(3, lane),
            friction: self.one(4, lane),
            plastic: self.one(5, lane),
        }
    }
}

/// The contacts of one block between the stages.
#[derive(Debug, Clone, Copy, Zeroable)]
pub struct BlockTouches {
    /// The bodies; then, in their place, the touch.
    numbers: Numbers<12>,
    /// The distance and its reciprocal.
    distance: Numbers<2>,
    arms: Numbers<2>,
    normal: Numbers<3>,
    /// What the tangential law hands on.
    early: Numbers<MAX_EARLY>,
    /// Relative spin, if there is rolling or radii are unequal.
    relative_spin: Numbers<3>,
    /// Moment of the rolling law, if there is one.
    moment: Numbers<3>,
    /// Imposed velocity, if faces move or details are wanted.
    imposed_velocity: Numbers<3>,
    /// This and what follows where details are wanted.
    branch: Numbers<3>,
    min_radius: Numbers<1>,
    /// Factors of elliptical contacts.
    factors: Numbers<2>,
    /// From the centres to the contact point, where there are ellipsoids.
    arm_vectors: Numbers<6>,
    stiffness: Numbers<1>,
    tangential: Numbers<3>,
    energies: Numbers<6>,
    rolling_energies: Numbers<6>,
    /// Keeps the same numbers of neighbouring blocks apart in the nearest cache, see [`APART`].
    _apart: Numbers<10>,
}

/// Lines by which the same number of two neighbouring blocks lies apart, modulo the 64 places of the nearest cache: more
/// than the twelve that the geometric stages read and write.
const APART: usize = size_of::<BlockTouches>() / size_of::<CacheLine>() % 64;
const _: () = assert!(APART > 16 && APART < 64 - 16);

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

    /// Take in distances and reciprocals of the lanes from `lane` on.
    #[inline(always)]
    pub fn put_distance<L: Lane>(&mut self, lane: usize, distance: &[L; 2]) {
        self.distance.put(0, lane, distance);
    }

    /// Distances \[m\] and reciprocals of the lanes from `lane` on.
    #[inline(always)]
    #[must_use]
    pub fn distance<L: Lane>(&self, lane: usize) -> [L; 2] {
        [self.distance.one(0, lane), self.distance.one(1, lane)]
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

    /// Take in the touches of spheres in the lanes from `lane` on, of which the relative spin and [`Self::put_details`]
    /// are there where needed. `EQUAL`: without the effective radius and the second arm, which is the first.
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
        if content.detailed {
            self.min_radius.put(0, lane, &[pair.min_radius]);
            self.factors.put(0, lane, &[touch.radius_factor, touch.overlap_factor]);
        }
    }

    /// Take in all of the touches of any bodies in the lanes from `lane` on, for a law of this range.
    #[inline(always)]
    pub fn put_any<L: Lane>(&mut self, lane: usize, pair: &PairTouch<L>, range: f64) {
        self.put_touch::<L, false>(lane, pair, Content { rolling: true, detailed: true, range });
        self.numbers.put(10, lane, &[pair.touch.size]);
        self.put_relative_spin(lane, &pair.touch.relative_spin);
        self.put_details(lane, &pair.branch, &pair.imposed_velocity);
    }

    /// Take in branch vectors and imposed velocities of the lanes from `lane` on, for where details are wanted.
    #[inline(always)]
    pub fn put_details<L: Lane>(&mut self, lane: usize, branch: &Vector<L>, imposed_velocity: &Vector<L>) {
        self.branch.put(0, lane, branch);
        self.imposed_velocity.put(0, lane, imposed_velocity);
    }

    /// Take in the vectors from the two centres to the contact points of the lanes from `lane` on \[m\].
    #[inline(always)]
    pub fn put_arm_vectors<L: Lane>(&mut self, lane: usize, arms: &[Vector<L>; 2]) {
        self.arm_vectors.put(0, lane, &arms[0]);
        self.arm_vectors.put(3, lane, &arms[1]);
    }

    /// No contacts.
    pub fn put_none(&mut self) {
        self.numbers.0[6].0.fill(DEAD);
    }

    /// Lanes from `lane` on whose law is asked. NaN is alive.
    #[inline(always)]
    #[must_use]
    pub fn alive<L: Lane>(&self, lane: usize) -> L::Mask {
        L::splat(DEAD).not_at_least(self.numbers.one(6, lane))
    }

    /// The law's view of the touches of the lanes from `lane` on; what is not passed on means nothing. `DETAILED`: as
    /// where [`Content::detailed`] was asked for; without, the contacts are those of spheres.
    #[inline(always)]
    #[must_use]
    pub fn touch<L: Lane, const DETAILED: bool>(&self, lane: usize) -> Touch<L> {
        let one = L::splat(1.0);
        Touch {
            overlap: self.numbers.one(6, lane),
            overlap_rate: self.numbers.one(7, lane),
            effective_radius: self.numbers.one(11, lane),
            radius_factor: if DETAILED { self.factors.one(0, lane) } else { one },
            overlap_factor: if DETAILED { self.factors.one(1, lane) } else { one },
            size: self.numbers.one(10, lane),
            effective_mass: self.numbers.one(9, lane),
            normal: self.numbers.vector(0, lane),
            slip_velocity: self.numbers.vector(3, lane),
            spin_about_normal: self.numbers.one(8, lane),
            relative_spin: self.relative_spin.vector(0, lane),
        }
    }

    /// Distances of the contact points from the centres along n of the lanes from `lane` on \[m\]. `equal`: both are the
    /// first.
    #[inline(always)]
    #[must_use]
    pub fn arms<L: Lane>(&self, lane: usize, equal: bool) -> [L; 2] {
        let first = self.arms.one(0, lane);
        [first, if equal { first } else { self.arms.one(1, lane) }]
    }

    /// See [`Self::put_arm_vectors`].
    #[inline(always)]
    #[must_use]
    pub fn arm_vectors<L: Lane>(&self, lane: usize) -> [Vector<L>; 2] {
        [self.arm_vectors.vector(0, lane), self.arm_vectors.vector(3, lane)]
    }

    /// The parts of the relative velocities that the cell's motion imposes \[m/s\].
    #[inline(always)]
    #[must_use]
    pub fn imposed_velocity<L: Lane>(&self, lane: usize) -> Vector<L> {
        self.imposed_velocity.vector(0, lane)
    }

    /// Take in the normal law's answer. `DETAILED`: with its stiffness and, if wanted, its energies.
    #[inline(always)]
    pub fn put_normal<L: Lane, const DETAILED: bool>(
        &mut self,
        lane: usize,
        normal: &NormalResponse<L>,
        energies: bool,
    ) {
        self.normal.put(0, lane, &[normal.force, normal.contact_radius, normal.dashpot]);
        if DETAILED {
            self.stiffness.put(0, lane, &[normal.stiffness]);
        }
        if DETAILED && energies {
            self.put_energies(lane, &normal.energies);
        }
    }

    /// The normal law's answer as the other laws get it; energies only if they were taken in.
    #[inline(always)]
    #[must_use]
    pub fn normal<L: Lane>(&self, lane: usize) -> NormalResponse<L> {
        NormalResponse {
            force: self.normal.one(0, lane),
            contact_radius: self.normal.one(1, lane),
            dashpot: self.normal.one(2, lane),
            stiffness: L::splat(f64::NAN),
            energies: self.energies.energies(lane),
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

    /// Take in the rolling law's answer. `DETAILED`: with its energies, if wanted.
    #[inline(always)]
    pub fn put_rolling<L: Lane, const DETAILED: bool>(
        &mut self,
        lane: usize,
        rolling: &VectorResponse<L>,
        energies: bool,
    ) {
        self.moment.put(0, lane, &rolling.value);
        if DETAILED && energies {
            self.rolling_energies.put_energies(lane, &rolling.energies);
        }
    }

    /// The rolling law's answer; energies only if they were taken in.
    #[inline(always)]
    #[must_use]
    pub fn rolling<L: Lane>(&self, lane: usize) -> VectorResponse<L> {
        VectorResponse { value: self.moment.vector(0, lane), energies: self.rolling_energies.energies(lane) }
    }

    /// Take in the tangential force.
    #[inline(always)]
    pub fn put_tangential<L: Lane>(&mut self, lane: usize, force: &Vector<L>) {
        self.tangential.put(0, lane, force);
    }

    /// Take in the energies of all laws up to here.
    #[inline(always)]
    pub fn put_energies<L: Lane>(&mut self, lane: usize, energies: &Energies<L>) {
        self.energies.put_energies(lane, energies);
    }

    /// What normal and tangential law answer together, with the energies of all laws if they were taken in.
    #[inline(always)]
    #[must_use]
    pub fn response<L: Lane>(&self, lane: usize) -> ContactResponse<L> {
        let normal = self.normal(lane);
        ContactResponse {
            joined: normal.joined(),
            normal_force: normal.force,
            tangential_force: self.tangential.vector(0, lane),
            stiffness: self.stiffness.one(0, lane),
            energies: normal.energies,
        }
    }

    /// Force of one contact on the first \[N\].
    #[must_use]
    pub fn force_on_first(&self, lane: usize) -> Vector<f64> {
        let response = self.response::<f64>(lane);
        sub(response.tangential_force, scale(self.touch::<f64, true>(lane).normal, response.normal_force))
    }

    /// The branch vector of one contact \[m\].
    #[must_use]
    pub fn branch(&self, lane: usize) -> Vector<f64> {
        self.branch.vector(0, lane)
    }

    /// Overlap of one contact over the smaller radius.
    #[must_use]
    pub fn overlap_ratio(&self, lane: usize) -> f64 {
        self.numbers.0[6].0[lane] / self.min_radius.0[0].0[lane]
    }

    /// Raise the largest stiffness \[N/m\] and the largest overlap over the smaller radius, lane by lane.
    pub fn raise(&self, stiffness: &mut [f64; BLOCK], ratio: &mut [f64; BLOCK]) {
        let [overlaps, radii, of_normal] = [&self.numbers.0[6], &self.min_radius.0[0], &self.stiffness.0[0]];
        for lane in 0..BLOCK {
            let (own, overlap) = (of_normal.0[lane], overlaps.0[lane]);
            let own = if overlap > DEAD { own } else { 0.0 };
            let own_ratio = overlap / radii.0[lane];
            stiffness[lane] = if own > stiffness[lane] { own } else { stiffness[lane] };
            ratio[lane] = if own_ratio > ratio[lane] { own_ratio } else { ratio[lane] };
        }
    }

    /// The first contact that overlaps too much or is not a number, with its overlap ratio; `limit` is the largest allowed.
    #[must_use]
    pub fn excess(&self, limit: f64) -> Option<(usize, f64)> {
        // Written so that NaN counts as a fault.
        let within = |lane: usize| self.numbers.0[6].0[lane] <= limit * self.min_radius.0[0].0[lane];
        if (0..BLOCK).fold(true, |all, lane| all & within(lane)) {
            return None;
        }
        (0..BLOCK).find(|&lane| !within(lane)).map(|lane| (lane, self.overlap_ratio(lane)))
    }

    /// The normals of the whole block.
    #[must_use]
    pub fn normals(&self) -> [CacheLine; 3] {
        [self.numbers.0[0], self.numbers.0[1], self.numbers.0[2]]
    }
}
