//! Touches where there are ellipsoids, a block at a time, from packed records and shapes; blocks of spheres alone
//! need no search for the common normal.

use super::curvature::Ellipse;
use super::normal::{Ellipsoids, Found};
use super::{radii_tensor, shape_tensor, support, tangents};
use crate::contact::section::{BLOCK, CacheLine, Pairs, Section};
use crate::force::geometry::{self, CellMotion, PairTouch, Relative, TOUCH_TOLERANCE};
use crate::force::lane::{Lane, Vector, add, align_stack, cross, dot, scale, sub};
#[cfg(target_arch = "x86_64")]
use crate::force::lane::{avx2::F64x4, avx512::F64x8};
use crate::force::law::Touch;
use crate::force::simd::Simd;
use crate::force::touches::BlockTouches;
use crate::state::particles::Record;
use crate::state::shape::{Shape, smallest_semi_axis};

/// A touch of ellipsoids with the arms of its contact point.
#[derive(Clone, Copy)]
pub struct EllipsoidTouch<L: Lane> {
    /// As between spheres; `arm_first` and `arm_second` are the arms' parts along the normal.
    pub pair: PairTouch<L>,
    /// From the two centres to the contact point \[m\].
    pub arms: [Vector<L>; 2],
}

/// What all touches of a pass share.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    /// Cell.
    pub motion: &'a CellMotion,
    /// Gap over the smallest semi-axis of a pair beyond which nothing more is asked of it.
    pub range: f64,
    /// Instructions to use.
    pub simd: Simd,
}

/// Numbers of an [`EllipsoidTouch`].
const NUMBERS: usize = 33;

/// Where the touches of a block come from.
pub struct BlockSource<'a> {
    /// What is the same for all.
    pub surroundings: &'a Surroundings<'a>,
    /// The section's pairs.
    pub pairs: &'a Pairs<'a>,
    /// Shapes from the section's origin on.
    pub shapes: &'a [Shape],
    /// The section.
    pub section: &'a Section,
    /// Number of the block.
    pub block: usize,
    /// From which of the section's memory columns on the stored normals are.
    pub normals: usize,
}

impl BlockSource<'_> {
    /// Put the touches of the block in place.
    pub fn fill(&self, touches: &mut BlockTouches) {
        match self.surroundings.simd {
            // SAFETY: a level is chosen only if the processor has it (`Simd::is_available`).
            #[cfg(target_arch = "x86_64")]
            Simd::Avx512 => unsafe { self.fill_avx512(touches) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Simd::Avx2 => unsafe { self.fill_avx2(touches) },
            _ => self.fill_lanes::<f64>(touches),
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn fill_avx2(&self, touches: &mut BlockTouches) {
        self.fill_lanes::<F64x4>(touches);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512vl")]
    fn fill_avx512(&self, touches: &mut BlockTouches) {
        self.fill_lanes::<F64x8>(touches);
    }

    #[inline(always)]
    fn fill_lanes<L: Lane>(&self, touches: &mut BlockTouches) {
        align_stack();
        for lane in (0..BLOCK).step_by(L::WIDTH) {
            let touch = self.touch::<L>(lane);
            touches.put_any(lane, &touch.pair, self.surroundings.range);
            touches.put_arm_vectors(lane, &touch.arms);
        }
    }

    #[inline(always)]
    fn touch<L: Lane>(&self, lane: usize) -> EllipsoidTouch<L> {
        let pairs = self.pairs.block(self.block);
        let [first, second] = pairs.offsets();
        let shapes = [Shapes::<L>::gather(self.shapes, &first[lane..]), Shapes::gather(self.shapes, &second[lane..])];
        let bodies = geometry::relative(&pairs, lane, self.surroundings.motion);
        let round = shapes[0].is_sphere() & shapes[1].is_sphere();
        if !L::any(!round) {
            return EllipsoidTouch::of_spheres(geometry::touch(&bodies, bodies.distance(), true));
        }
        let memory = self.block * self.section.columns + self.normals;
        let stored = vector_at(&self.section.memory[memory..memory + 3], lane);
        let hint = self.section.hints.get(self.block).map_or([L::splat(0.0); 3], |hint| vector_at(hint, lane));
        let touch = ellipsoids(&bodies, &shapes, [stored, hint], self.surroundings.range);
        if !L::any(round) {
            return touch;
        }
        let of_spheres = EllipsoidTouch::of_spheres(geometry::touch(&bodies, bodies.distance(), true));
        // By lane and not by block: a pair's bits must not hang on the pairs beside it.
        let mut numbers = touch.numbers();
        for (number, of_spheres) in numbers.iter_mut().zip(of_spheres.numbers()) {
            *number = L::select(round, of_spheres, *number);
        }
        EllipsoidTouch::from_numbers(numbers)
    }
}

#[inline(always)]
fn vector_at<L: Lane>(columns: &[CacheLine], lane: usize) -> Vector<L> {
    [L::load(&columns[0].0[lane..]), L::load(&columns[1].0[lane..]), L::load(&columns[2].0[lane..])]
}

/// Semi-axes and orientations of some particles, transposed.
#[derive(Debug, Clone, Copy)]
pub struct Shapes<L> {
    /// Semi-axes \[m\].
    pub semi_axes: Vector<L>,
    /// Radii of the spheres of equal volume \[m\].
    pub mean_radius: L,
    /// Unit quaternions.
    pub orientation: [L; 4],
}

impl<L: Lane> Shapes<L> {
    /// The shapes at these offsets of records.
    #[inline(always)]
    fn gather(shapes: &[Shape], offsets: &[u32]) -> Self {
        let [a, b, c, mean_radius, w, x, y, z] = L::gather_shapes(shapes, offsets);
        Self { semi_axes: [a, b, c], mean_radius, orientation: [w, x, y, z] }
    }

    #[inline(always)]
    fn smallest(&self) -> L {
        self.semi_axes[0].min(self.semi_axes[1]).min(self.semi_axes[2])
    }

    /// All semi-axes are equal.
    #[inline(always)]
    fn is_sphere(&self) -> L::Mask {
        let [a, b, c] = self.semi_axes;
        a.at_least(b) & b.at_least(a) & b.at_least(c) & c.at_least(b)
    }
}

/// Touch of two ellipsoids, warm from the stored normal or, to see that they do not touch, from a hint
/// ([`Ellipsoids::common_normal`]); `range` as in [`Surroundings`]. The contact point is the midpoint of the two surface
/// points p_i, p_j. δ̇ and the slip velocity are those of the material points there; m_eff is that of the centres. NaN
/// counts as touching, so that it is found.
///
/// With `r_i = ½ (d + p_i + p_j)` the bodies turn past each other at the contact point with
/// `ω_j × (r_i − d) − ω_i × r_i = ½ [(ω_j − ω_i) × (p_i + p_j) − (ω_i + ω_j) × d]`.
///
/// # Source
/// PHYSICS.md "Ellipsoid geometry" and section 1.
#[inline(always)]
#[must_use]
pub fn ellipsoids<L: Lane>(
    bodies: &Relative<L>,
    shapes: &[Shapes<L>; 2],
    [stored, hint]: [Vector<L>; 2],
    range: f64,
) -> EllipsoidTouch<L> {
    let branch = bodies.branch;
    let min_radius = shapes[0].smallest().min(shapes[1].smallest());
    let [one, other] = shapes;
    let tensors = [shape_tensor(one.semi_axes, one.orientation), shape_tensor(other.semi_axes, other.orientation)];
    let bound = L::splat(-range) * min_radius;
    let found: Found<L> = Ellipsoids { tensors, branch }.common_normal(stored, hint, bound).found;
    let (normal, overlap) = (found.normal, found.overlap);
    let heights = dot(normal, sub(found.first_point, found.second_point));
    let ellipse = Ellipse::new(&found.radii);

    let half = L::splat(0.5);
    let points = add(found.first_point, found.second_point);
    let arms = [scale(add(points, branch), half), scale(sub(points, branch), half)];
    let turning = scale(sub(cross(bodies.relative_spin, points), cross(bodies.spin_sum, branch)), half);
    let velocity = add(bodies.velocity, turning);
    let approach = dot(velocity, normal);
    let touch = Touch {
        overlap,
        overlap_rate: -approach,
        effective_radius: ellipse.effective_radius,
        radius_factor: ellipse.radius_factor,
        overlap_factor: ellipse.overlap_factor,
        size: shapes[0].mean_radius + shapes[1].mean_radius,
        effective_mass: L::splat(1.0) / bodies.inverse_masses,
        normal,
        slip_velocity: sub(velocity, scale(normal, approach)),
        relative_spin: bodies.relative_spin,
        spin_about_normal: half * dot(bodies.spin_sum, normal),
    };
    let pair = PairTouch {
        touching: (L::splat(TOUCH_TOLERANCE) * heights).not_at_least(overlap),
        touch,
        branch,
        imposed_velocity: bodies.imposed_velocity,
        arm_first: dot(arms[0], normal),
        arm_second: -dot(arms[1], normal),
        min_radius,
    };
    EllipsoidTouch { pair, arms }
}

/// Touch of an ellipsoid and a plane wall (2·axis + side); the contact point lies in the wall.
#[must_use]
pub fn wall(a: &Record, shape: &Shape, wall: u32, motion: &CellMotion) -> EllipsoidTouch<f64> {
    // What of the wall does not depend on the shape.
    let PairTouch { touch: plane, branch, imposed_velocity, arm_first: gap, .. } = geometry::wall(a, wall, motion);
    let normal = plane.normal;
    let tensor = shape_tensor(shape.semi_axes, shape.orientation);
    let (height, point) = support(&tensor, normal);
    let basis = tangents(normal);
    let ellipse = Ellipse::before_plane(&radii_tensor(&tensor, height, point, &basis));
    let overlap = height - gap;
    let arm = sub(point, scale(normal, overlap));
    let velocity = sub(sub(imposed_velocity, a.velocity), cross(a.spin, arm));
    let approach = dot(velocity, normal);
    let touch = Touch {
        overlap,
        overlap_rate: -approach,
        effective_radius: ellipse.effective_radius,
        radius_factor: ellipse.radius_factor,
        overlap_factor: ellipse.overlap_factor,
        size: 2.0 * shape.mean_radius,
        slip_velocity: sub(velocity, scale(normal, approach)),
        ..plane
    };
    let pair = PairTouch {
        touching: (TOUCH_TOLERANCE * height).not_at_least(overlap),
        touch,
        branch,
        imposed_velocity,
        arm_first: gap,
        arm_second: 0.0,
        min_radius: smallest_semi_axis(shape.semi_axes),
    };
    EllipsoidTouch { pair, arms: [arm, [0.0; 3]] }
}

impl<L: Lane> EllipsoidTouch<L> {
    /// Two spheres as a pair of this kind.
    #[inline(always)]
    fn of_spheres(pair: PairTouch<L>) -> Self {
        let normal = pair.touch.normal;
        Self { pair, arms: [scale(normal, pair.arm_first), scale(normal, -pair.arm_second)] }
    }

    #[inline(always)]
    fn numbers(&self) -> [L; NUMBERS] {
        let PairTouch { touching, touch: t, branch, imposed_velocity: v, arm_first, arm_second, min_radius } =
            self.pair;
        let flag = L::splat(1.0).only(touching);
        let [r, s] = self.arms;
        let (n, slip, spin) = (t.normal, t.slip_velocity, t.relative_spin);
        #[rustfmt::skip]
        let numbers = [
            flag, t.overlap, t.overlap_rate, t.effective_radius, t.radius_factor, t.overlap_factor, t.size,
            t.effective_mass, n[0], n[1], n[2], slip[0], slip[1], slip[2], spin[0], spin[1], spin[2],
            t.spin_about_normal, branch[0], branch[1], branch[2], v[0], v[1], v[2],
            arm_first, arm_second, min_radius, r[0], r[1], r[2], s[0], s[1], s[2],
        ];
        numbers
    }

    #[inline(always)]
    fn from_numbers(x: [L; NUMBERS]) -> Self {
        let vector = |k: usize| [x[k], x[k + 1], x[k + 2]];
        let touch = Touch {
            overlap: x[1],
            overlap_rate: x[2],
            effective_radius: x[3],
            radius_factor: x[4],
            overlap_factor: x[5],
            size: x[6],
            effective_mass: x[7],
            normal: vector(8),
            slip_velocity: vector(11),
            relative_spin: vector(14),
            spin_about_normal: x[17],
        };
        let pair = PairTouch {
            touching: x[0].greater(L::splat(0.5)),
            touch,
            branch: vector(18),
            imposed_velocity: vector(21),
            arm_first: x[24],
            arm_second: x[25],
            min_radius: x[26],
        };
        Self { pair, arms: [vector(27), vector(30)] }
    }
}
