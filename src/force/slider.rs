//! What the spring–slider laws share: a stored vector that follows the contact, and the Coulomb limit.

use super::lane::{Lane, Vector, add, cross, dot, scale, sub};
use super::law::Touch;

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

    /// The vector after the step. The angle φ about n is taken as arctan φ (third order in Δt).
    ///
    /// It shrinks with the stiffness: a spring keeps `min(1, stiffness/last stiffness)` of its force, so that
    /// unloading creates no energy. A vector without a last stiffness (first touch) is zero.
    #[inline(always)]
    #[must_use]
    pub fn apply(&self, stored: Vector<L>, stiffness: L, last: L) -> Vector<L> {
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let along = dot(stored, self.normal);
        let turned = add(sub(stored, scale(self.normal, along)), scale(cross(self.normal, stored), self.angle));
        let square = dot(turned, turned);
        // One division for two: |stored|²/|turned|² and stiffness/last.
        let both = square * last;
        let inverse = one / both;
        let stretch = root_near_one(dot(stored, stored) * last * inverse);
        let kept = (stiffness * square * inverse).min(one);
        scale(turned, L::select(both.greater(zero), stretch * kept, zero))
    }
}

/// `√r` for r near 1 without a root: the series in u = r − 1 up to u³, whose error is below `5/128 u⁴`. The
/// squared length that a turn by the angle θ takes from a vector by projection is u ≈ θ², so that a turn of 0.03
/// in one step leaves 10⁻¹⁴. u is cut at 1/8 (a turn of 19° in one step); a vector that turns faster shrinks.
#[inline(always)]
fn root_near_one<L: Lane>(ratio: L) -> L {
    let u = (ratio - L::splat(1.0)).min(L::splat(0.125));
    L::splat(1.0) + u * (L::splat(0.5) + u * (L::splat(0.0625) * u - L::splat(0.125)))
}

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

/// Like [`carried_share`] for a vector.
#[inline(always)]
#[must_use]
pub fn carried_share_of_vector<L: Lane>(load: Vector<L>, limit: L) -> L {
    let one = L::splat(1.0);
    let square = dot(load, load);
    // False with NaN, which leaves 1.
    let slides = square.greater(limit * limit);
    // Most contacts stick; whole lanes of them need no root.
    if L::any(slides) { L::select(slides, limit / square.sqrt(), one) } else { one }
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
    L::select(last.greater(zero), loss, zero)
}
