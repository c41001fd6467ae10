//! What the spring–slider laws share: a stored vector that follows the contact, and the Coulomb limit.

use super::lane::{Lane, Vector, add, cross, dot, scale, sub};
use super::law::Touch;

/// Ends the names of memory columns that hold a force or moment as it was at the last step, without the half increment ahead.
pub const AT_STEP: &str = "_at_step";

/// How a vector stored with a contact follows it over one step: projected on the new tangent plane,
/// turned about n by the pair's mean spin, its length kept.
#[derive(Debug, Clone, Copy)]
pub struct Turning<L> {
    normal: Vector<L>,
    angle: L,
}

impl<L: Lane> Turning<L> {
    /// The turning of one touch over `time_step` \[s\].
    #[inline(always)]
    #[must_use]
    pub fn new(touch: &Touch<L>, time_step: f64) -> Self {
        Self { normal: touch.normal, angle: touch.spin_about_normal * L::splat(time_step) }
    }

    /// The vector after the step.
    #[inline(always)]
    #[must_use]
    pub fn apply(&self, stored: Vector<L>, stiffness: L, last: L) -> Vector<L> {
        let [[along, share]] = self.early(&[stored], stiffness, last);
        scale(self.turn(stored, along), share)
    }

    /// The vector projected on the new tangent plane and turned, not yet of the right length; `along` is its part along
    /// n. The angle φ about n is taken as arctan φ (third order in Δt).
    #[inline(always)]
    #[must_use]
    pub fn turn(&self, stored: Vector<L>, along: L) -> Vector<L> {
        add(sub(stored, scale(self.normal, along)), cross(scale(self.normal, self.angle), stored))
    }

    /// The parts of some vectors along n, and what brings each turned vector to the length that it has after the step.
    ///
    /// It shrinks with the stiffness: a spring keeps `min(1, stiffness/last stiffness)` of its force, so that
    /// unloading creates no energy. At first touch, without a last stiffness, a vector must be zero.
    ///
    /// Projection and turn leave the share `1 − w = (1 − t)(1 + φ²)` of the squared length, t the squared cosine between
    /// vector and n. What restores it, `1/√(1 − w)`, is a series without a root, up to w³: where a step turns the
    /// contact by the angle θ, w ≈ θ² and the error is `35/128 w⁴`, 2·10⁻¹³ for θ = 0.03. It is an error to the low side,
    /// so that a vector that turns too fast shrinks.
    #[inline(always)]
    #[must_use]
    pub fn early<const N: usize>(&self, stored: &[Vector<L>; N], stiffness: L, last: L) -> [[L; 2]; N] {
        let (half, one, least) = (L::splat(0.5), L::splat(1.0), L::splat(LEAST));
        let last = least.max(last);
        let turned = half * (self.angle * self.angle);
        let weight = (half + turned) * last;
        let mut early = [[one; 2]; N];
        // One division for all: by the last stiffness and the squared lengths of two vectors.
        for (pair, early) in stored.chunks(2).zip(early.chunks_mut(2)) {
            let mut squares = [one; 2];
            for (square, stored) in squares.iter_mut().zip(pair) {
                *square = least.max(dot(*stored, *stored));
            }
            let product = squares[0] * squares[1];
            let inverse = one / (product * last);
            let kept = (stiffness * (product * inverse)).min(one);
            for (k, (stored, early)) in pair.iter().zip(early).enumerate() {
                let along = dot(*stored, self.normal);
                // w/2.
                let lost = (along * along * (squares[1 - k] * weight) * inverse - turned).max(-half);
                let stretch = (one + lost) + lost * lost * (L::splat(1.5) + L::splat(2.5) * lost);
                *early = [along, stretch * kept];
            }
        }
        early
    }
}

/// In place of smaller squared lengths and last stiffnesses: products of three of them are still above the smallest numbers.
const LEAST: f64 = 1e-100;

/// Coulomb limit `coefficient × F_n × arm`, 0 under a tensile force (clipping off).
#[inline(always)]
#[must_use]
pub fn coulomb_limit<L: Lane>(coefficient: f64, normal_force: L) -> L {
    L::splat(0.0).max(L::splat(coefficient) * normal_force)
}

/// The share in \[0, 1\] of a load of this magnitude that a slider with this limit carries.
#[inline(always)]
#[must_use]
pub fn carried_share<L: Lane>(magnitude: L, limit: L) -> L {
    // A comparison with NaN (0/0) is false, which leaves 1.
    (limit / magnitude).min(L::splat(1.0))
}

/// A slider under a load, with a limit.
#[derive(Debug, Clone, Copy)]
pub struct Slider<L> {
    /// The share in \[0, 1\] of the load that it carries.
    pub share: L,
    /// Some lane slides.
    slides: bool,
}

impl<L: Lane> Slider<L> {
    /// A slider of this limit under this load.
    #[inline(always)]
    #[must_use]
    pub fn new(load: Vector<L>, limit: L) -> Self {
        let one = L::splat(1.0);
        let square = dot(load, load);
        // False with NaN, which leaves 1.
        let slides = square.greater(limit * limit);
        // Most contacts stick; whole lanes of them need no root.
        if L::any(slides) {
            Self { share: L::select(slides, limit / square.sqrt(), one), slides: true }
        } else {
            Self { share: one, slides: false }
        }
    }

    /// What of a part of the load is carried.
    #[inline(always)]
    #[must_use]
    pub fn carry(&self, part: Vector<L>) -> Vector<L> {
        // A share of 1 changes no bit.
        if self.slides { scale(part, self.share) } else { part }
    }
}

/// The share of a spring's force that a shrinking contact keeps, `min(1, stiffness/last stiffness)`, so
/// that unloading creates no energy; 1 at first touch.
#[inline(always)]
#[must_use]
pub fn kept_share<L: Lane>(stiffness: L, last: L) -> L {
    (stiffness / last).min(L::splat(1.0))
}

/// Energy `½ f²/k` that a spring loses when its force goes from `before` (squared, at stiffness `last`) to
/// `after` (squared, at `stiffness`) without motion; 0 at first touch.
#[inline(always)]
#[must_use]
pub fn stiffness_loss<L: Lane>(before: L, last: L, after: L, stiffness: L) -> L {
    let zero = L::splat(0.0);
    let loss = L::splat(0.5) * (before / last - after / stiffness);
    loss.only(last.greater(zero))
}

/// Energy that sliding takes from a spring of which only a `share` s of the force f is carried, f having grown by `slip` d, half
/// of the step's: what the spring holds less than f would, `½ (1 − s²) f²/k`, less the work that is not done for it,
/// `(1 − s) f·d`.
#[inline(always)]
#[must_use]
pub fn slip_loss<L: Lane>(force: Vector<L>, share: L, slip: Vector<L>, stiffness: L) -> L {
    let (half, one) = (L::splat(0.5), L::splat(1.0));
    (one - share) * (half * (one + share) * dot(force, force) / stiffness - dot(force, slip))
}

/// Energy that a spring with its slider dissipates in a step along `slip`, with the velocities of the half step: the work of the
/// mean of the forces before and after, and what the spring held before, less what it holds after. `carried` is the force
/// before, turned, and shrunk by the factor `shrinkage` ≤ 1 that [`kept_share`] gives.
#[inline(always)]
#[must_use]
pub fn step_loss<L: Lane>(carried: Vector<L>, shrinkage: L, force: Vector<L>, slip: Vector<L>, stiffness: L) -> L {
    let work = dot(carried, slip) / shrinkage + dot(force, slip);
    L::splat(0.5) * (work + (dot(carried, carried) - dot(force, force)) / stiffness)
}
