//! The common normal of two ellipsoids: the unit vector n that minimises the overlap along it.

use super::{Symmetric, radii_tensor, support, tangents};
use crate::force::lane::{Lane, Vector, add, dot, scale, sub};

/// Most iterations of one start. Two to four are usual; the pairs of the tests need at most about thirty.
pub const MAX_ITERATIONS: usize = 100;

/// A step \[rad\] below which Newton's quadratic convergence leaves nothing to gain.
const LAST_STEP: f64 = 3e-7;

/// A step \[rad\] so short that surface points follow it to rounding by their first derivative, and curvatures stay.
const SETTLED_STEP: f64 = 1e-9;

/// Longest step \[rad\].
const LONGEST_STEP: f64 = 0.5;

/// Product of the curvatures over their squared sum below which Newton's step is not taken unexamined.
const FLATTEST: f64 = 1e-9;

/// Shortest step \[rad\] along a direction in which the overlap has a maximum.
const KICK: f64 = 0.05;

/// Two ellipsoids: tensors \[m²\] and the branch vector d from the first's centre to the second's \[m\].
#[derive(Debug, Clone, Copy)]
pub struct Ellipsoids<L> {
    /// M of both.
    pub tensors: [Symmetric<L>; 2],
    /// d.
    pub branch: Vector<L>,
}

/// What is known at one direction.
#[derive(Debug, Clone, Copy)]
pub struct Found<L> {
    /// Unit normal n from the first to the second.
    pub normal: Vector<L>,
    /// Overlap along n \[m\]; at the minimum the overlap δ of the pair, negative for a gap.
    pub overlap: L,
    /// Point of the first's surface whose outer normal is n, from the first's centre \[m\].
    pub first_point: Vector<L>,
    /// Point of the second's surface whose outer normal is −n, from the second's centre \[m\].
    pub second_point: Vector<L>,
    /// Tangents at n.
    pub tangents: [Vector<L>; 2],
    /// Radii tensors W of both at n: 11, 22, 12 in the tangents \[m\].
    pub radii: [[L; 3]; 2],
}

/// Where a search ended.
#[derive(Debug, Clone, Copy)]
pub struct Search<L: Lane> {
    /// The last direction.
    pub found: Found<L>,
    /// Lanes that neither converged nor fell below the bound.
    pub failed: L::Mask,
    /// Evaluations of the longest lane.
    pub evaluations: usize,
}

impl<L: Lane> Ellipsoids<L> {
    /// Overlap `o(n) = h_i(n) + h_j(n) − n·d` with its surface points and curvatures.
    #[inline(always)]
    #[must_use]
    pub fn along(&self, normal: Vector<L>) -> Found<L> {
        let [a, b] = &self.tensors;
        let (first_distance, first_point) = support(a, normal);
        let (second_distance, opposite) = support(b, normal);
        let tangents = tangents(normal);
        Found {
            normal,
            overlap: first_distance + second_distance - dot(normal, self.branch),
            first_point,
            second_point: [-opposite[0], -opposite[1], -opposite[2]],
            tangents,
            radii: [
                radii_tensor(a, first_distance, first_point, &tangents),
                radii_tensor(b, second_distance, opposite, &tangents),
            ],
        }
    }

    /// Minimise o(n) over the unit sphere from `start`, by Newton's method on the sphere with the Hessian
    /// `W_i + W_j − o I`. Where it is not clearly positive the step is `−g/(|λ| + μ)` in each of its two principal
    /// directions, so that it goes down also where the curvature λ is negative. μ grows where the overlap did not fall and
    /// shrinks where it did. A last step that is short enough is taken by first derivatives, without another evaluation.
    ///
    /// A lane stops when it has converged or when its overlap is at most `bound` (then n separates the bodies by
    /// as much), and moves no more.
    ///
    /// # Source
    /// PHYSICS.md "Ellipsoid geometry"; saddle-free Newton steps as in Dauphin et al. 2014 (arXiv:1406.2572).
    #[inline(always)]
    #[must_use]
    pub fn search(&self, start: Vector<L>, bound: L) -> Search<L> {
        let zero = L::splat(0.0);
        let mut now = self.along(start);
        let mut damping = zero;
        // NaN never converges but must end the search.
        let mut active = now.overlap.greater(bound);
        let mut evaluations = 1;
        while L::any(active) && evaluations < MAX_ITERATIONS {
            let step = Step::new(&now, self.branch, damping, active);
            let settled = active & step.convex & L::splat(SETTLED_STEP * SETTLED_STEP).at_least(step.square);
            if L::any(settled) {
                now = Found::select(settled, &now.settled(&step), &now);
                active = active & !settled;
                if !L::any(active) {
                    break;
                }
            }
            let turned =
                add(now.normal, add(scale(now.tangents[0], step.along[0]), scale(now.tangents[1], step.along[1])));
            let next = self.along(scale(turned, L::splat(1.0) / dot(turned, turned).sqrt()));
            evaluations += 1;
            let small = L::splat(LAST_STEP * LAST_STEP).at_least(step.square);
            let falls = (now.overlap - L::splat(1e-4) * step.gain).at_least(next.overlap);
            // Below rounding the overlap can no longer tell; the gradient can.
            let accepted = falls | (small & step.convex);
            let converged = small & step.convex;
            let grown = damping * L::splat(4.0) + L::splat(0.1) * step.stiffness;
            let shrunk = damping * L::splat(0.1);
            let negligible = (L::splat(1e-3) * step.stiffness).greater(shrunk);
            let kept = L::select(accepted, L::select(negligible, zero, shrunk), grown);
            damping = L::select(active, kept, damping);
            now = Found::select(active & accepted, &next, &now);
            active = active & !converged & now.overlap.greater(bound);
        }
        Search { found: now, failed: active, evaluations }
    }
}

impl<L: Lane> Ellipsoids<L> {
    /// The common normal of a pair: from the `stored` normal of its last touch where there is one (not the zero
    /// vector), else from the cold starts d/|d| and `(M_i + M_j)⁻¹ d`, of which the lower overlap counts: deep
    /// overlaps have several minima. Overlaps of at most `bound` \[m\] are not pursued: where the plane across the `hint`
    /// (a unit vector or zero) parts the two by as much, there is no cold start.
    #[inline(always)]
    #[must_use]
    pub fn common_normal(&self, stored: Vector<L>, hint: Vector<L>, bound: L) -> Search<L> {
        let half = L::splat(0.5);
        let warm = dot(stored, stored).greater(half);
        let straight = unit(self.branch);
        let other = choose(dot(hint, hint).greater(half), &hint, &straight);
        // Lanes that need no search are below this bound from the outset.
        let never = L::splat(f64::INFINITY);
        let mut best = self.search(choose(warm, &stored, &other), L::select(warm, bound, never));
        // With room for rounding: whether a pair is near enough must not hang on the hint.
        let parted = bound - L::splat(1e-12) * dot(self.branch, self.branch).sqrt();
        let cold = !warm & best.found.overlap.greater(parted);
        if L::any(cold) {
            let first = self.search(straight, L::select(cold, bound, never));
            let again = cold & first.found.overlap.greater(bound);
            let mut found = first.found;
            let mut failed = first.failed;
            best.evaluations += first.evaluations;
            if L::any(again) {
                let second = self.search(self.pulled_back(), L::select(again, bound, never));
                let lower = again & first.found.overlap.greater(second.found.overlap);
                found = Found::select(lower, &second.found, &found);
                failed = (failed & !lower) | (second.failed & lower);
                best.evaluations += second.evaluations;
            }
            best.found = Found::select(cold, &found, &best.found);
            best.failed = (best.failed & !cold) | (failed & cold);
        }
        best
    }

    /// `(M_i + M_j)⁻¹ d` as a unit vector: the normal of an ellipsoid of the summed tensors in the direction d.
    #[inline(always)]
    fn pulled_back(&self) -> Vector<L> {
        let [a, b] = &self.tensors;
        let [xx, yy, zz] = [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        let [xy, xz, yz] = [a[3] + b[3], a[4] + b[4], a[5] + b[5]];
        let adjugate = [
            yy * zz - yz * yz,
            xx * zz - xz * xz,
            xx * yy - xy * xy,
            xz * yz - xy * zz,
            xy * yz - xz * yy,
            xy * xz - xx * yz,
        ];
        unit(super::apply(&adjugate, self.branch))
    }
}

#[inline(always)]
fn unit<L: Lane>(v: Vector<L>) -> Vector<L> {
    scale(v, L::splat(1.0) / dot(v, v).sqrt())
}

/// A step on the tangent plane.
struct Step<L: Lane> {
    along: [L; 2],
    /// Squared length.
    square: L,
    /// Fall of the overlap that the gradient promises, ≥ 0.
    gain: L,
    /// Both curvatures are positive and undamped.
    convex: L::Mask,
    /// Larger curvature, or the sum of both where both are positive.
    stiffness: L,
}

impl<L: Lane> Step<L> {
    /// The step of the `active` lanes. Where both curvatures are positive and undamped it is Newton's, which needs no
    /// principal directions; by lane, so that a pair's bits do not hang on the pairs beside it.
    #[inline(always)]
    fn new(now: &Found<L>, branch: Vector<L>, damping: L, active: L::Mask) -> Self {
        let zero = L::splat(0.0);
        let rest = sub(sub(now.first_point, now.second_point), branch);
        let gradient = [dot(now.tangents[0], rest), dot(now.tangents[1], rest)];
        let [wi, wj] = &now.radii;
        let hessian = [wi[0] + wj[0] - now.overlap, wi[1] + wj[1] - now.overlap, wi[2] + wj[2]];
        let [h11, h22, h12] = hessian;
        let (trace, determinant) = (h11 + h22, h11 * h22 - h12 * h12);
        let inverse = L::splat(1.0) / determinant;
        let along =
            [(h12 * gradient[1] - h22 * gradient[0]) * inverse, (h12 * gradient[0] - h11 * gradient[1]) * inverse];
        let square = along[0] * along[0] + along[1] * along[1];
        let convex = h11.greater(zero)
            & determinant.greater(L::splat(FLATTEST) * (trace * trace))
            & zero.at_least(damping)
            & L::splat(LONGEST_STEP * LONGEST_STEP).at_least(square);
        let gain = -(along[0] * gradient[0] + along[1] * gradient[1]);
        let newton = Self { along, square, gain, convex, stiffness: trace };
        if !L::any(active & !convex) {
            return newton;
        }
        let other = Self::along_principal(gradient, hessian, damping);
        Self {
            along: [
                L::select(convex, newton.along[0], other.along[0]),
                L::select(convex, newton.along[1], other.along[1]),
            ],
            square: L::select(convex, newton.square, other.square),
            gain: L::select(convex, newton.gain, other.gain),
            convex: convex | other.convex,
            stiffness: L::select(convex, newton.stiffness, other.stiffness),
        }
    }

    /// The step `−g/(|λ| + μ)` in each principal direction, no longer than [`LONGEST_STEP`].
    #[inline(always)]
    fn along_principal(gradient: [L; 2], [h11, h22, h12]: [L; 3], damping: L) -> Self {
        let (zero, one, half) = (L::splat(0.0), L::splat(1.0), L::splat(0.5));
        // Principal directions: of the two formulas for the same vector the longer one.
        let (mean, difference) = (half * (h11 + h22), half * (h11 - h22));
        let radius = (difference * difference + h12 * h12).sqrt();
        let leans = difference.less(zero);
        let long = L::select(leans, radius - difference, radius + difference);
        let raw = [L::select(leans, h12, long), L::select(leans, long, h12)];
        let square = dot([raw[0], raw[1], zero], [raw[0], raw[1], zero]);
        let inverse = one / square.sqrt();
        let round = !square.greater(zero);
        let stiff = [L::select(round, one, raw[0] * inverse), L::select(round, zero, raw[1] * inverse)];
        let soft = [-stiff[1], stiff[0]];
        let (high, low) = (mean + radius, mean - radius);
        let stiffness = magnitude(high).max(magnitude(low));
        // A curvature of nearly nothing must not throw the step off the sphere.
        let floor = L::splat(1e-9) * stiffness;
        // At a maximum the slope may be zero: leave it all the same, by less the more often it failed.
        let kick = L::splat(KICK) * stiffness / (stiffness + L::splat(10.0) * damping);
        let slope = |direction: [L; 2]| direction[0] * gradient[0] + direction[1] * gradient[1];
        let (soft_slope, stiff_slope) = (slope(soft), slope(stiff));
        let soft_step = along_one(soft_slope, low, magnitude(low).max(floor) + damping, kick);
        let stiff_step = along_one(stiff_slope, high, magnitude(high).max(floor) + damping, kick);
        let length = (soft_step * soft_step + stiff_step * stiff_step).sqrt();
        let factor = one.min(L::splat(LONGEST_STEP) / length);
        let (soft_step, stiff_step) = (soft_step * factor, stiff_step * factor);
        Self {
            along: [soft[0] * soft_step + stiff[0] * stiff_step, soft[1] * soft_step + stiff[1] * stiff_step],
            square: soft_step * soft_step + stiff_step * stiff_step,
            gain: -(soft_slope * soft_step + stiff_slope * stiff_step),
            convex: low.greater(zero) & zero.at_least(damping),
            stiffness,
        }
    }
}

#[inline(always)]
fn magnitude<L: Lane>(x: L) -> L {
    x.max(-x)
}

/// The step in one principal direction: Newton's, at least `kick` where the curvature is negative.
#[inline(always)]
fn along_one<L: Lane>(slope: L, curvature: L, resistance: L, kick: L) -> L {
    let zero = L::splat(0.0);
    let newton = -slope / resistance;
    let kicked = L::select(slope.greater(zero), newton.min(-kick), newton.max(kick));
    L::select(curvature.less(zero), kicked, newton)
}

// Functions and not closures: these are inlined wherever they stand, and with them the vector instructions.
#[inline(always)]
fn choose<L: Lane>(mask: L::Mask, yes: &[L; 3], no: &[L; 3]) -> [L; 3] {
    [L::select(mask, yes[0], no[0]), L::select(mask, yes[1], no[1]), L::select(mask, yes[2], no[2])]
}

impl<L: Lane> Found<L> {
    /// After a step too short for another evaluation: `n + t`, `p ± W t`, o less half of what the gradient promises.
    #[inline(always)]
    fn settled(&self, step: &Step<L>) -> Self {
        let half = L::splat(0.5);
        let [x, y] = step.along;
        let [first, second] = [self.radii[0], self.radii[1]];
        let turned = add(self.normal, self.on_surface(step.along));
        Self {
            // One step of Newton's for the length, which is 1 but for rounding.
            normal: scale(turned, L::splat(1.5) - half * dot(turned, turned)),
            overlap: self.overlap - half * step.gain,
            first_point: add(
                self.first_point,
                self.on_surface([first[0] * x + first[2] * y, first[2] * x + first[1] * y]),
            ),
            second_point: sub(
                self.second_point,
                self.on_surface([second[0] * x + second[2] * y, second[2] * x + second[1] * y]),
            ),
            ..*self
        }
    }

    /// From its components along the tangents to a vector.
    #[inline(always)]
    fn on_surface(&self, along: [L; 2]) -> Vector<L> {
        add(scale(self.tangents[0], along[0]), scale(self.tangents[1], along[1]))
    }

    /// Lane by lane `yes` or `no`.
    #[inline(always)]
    #[must_use]
    pub fn select(mask: L::Mask, yes: &Self, no: &Self) -> Self {
        let [a, b] = [&yes.tangents, &no.tangents];
        let [r, s] = [&yes.radii, &no.radii];
        Self {
            normal: choose(mask, &yes.normal, &no.normal),
            overlap: L::select(mask, yes.overlap, no.overlap),
            first_point: choose(mask, &yes.first_point, &no.first_point),
            second_point: choose(mask, &yes.second_point, &no.second_point),
            tangents: [choose(mask, &a[0], &b[0]), choose(mask, &a[1], &b[1])],
            radii: [choose(mask, &r[0], &s[0]), choose(mask, &r[1], &s[1])],
        }
    }
}
