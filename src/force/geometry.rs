//! Geometry and relative motion of touching spheres and walls, from packed records.

use super::lane::{Lane, Vector, add, cross, dot, scale, sub};
use super::law::Touch;
use crate::contact::section::BlockPairs;
use crate::contact::shift::{self, ShiftTable};
use crate::state::particles::Record;

/// A contact exists where δ exceeds this fraction of R_i + R_j: image pairs that just touch (W Fig. 8)
/// sit at δ = 0 up to rounding and must not flicker.
pub const TOUCH_TOLERANCE: f64 = 1e-12;

/// The cell as the contact pass needs it at one step.
#[derive(Debug, Clone, Copy)]
pub struct CellMotion {
    /// Cell sides \[m\].
    pub sides: [f64; 3],
    /// S·L for each image shift S \[m\].
    pub shift: ShiftTable,
    /// S·L̇ for each image shift (BC; zero in BCT) \[m/s\].
    pub shift_velocity: ShiftTable,
    /// The faces move past the particles (BC): only then `shift_velocity` is looked up.
    pub faces_move: bool,
    /// L̇/L per axis (BCT; zero in BC) \[1/s\]: the affine part of the relative velocity per branch vector.
    pub gradient: [f64; 3],
    /// Absolute velocity of the high walls (BC; zero in BCT, where `gradient` holds it) \[m/s\].
    pub wall_velocity: [f64; 3],
}

/// A touch with what the output line needs beside the law's view.
#[derive(Debug, Clone, Copy)]
pub struct PairTouch<L: Lane> {
    /// Lanes that touch; what the others hold means nothing.
    pub touching: L::Mask,
    /// The law's view.
    pub touch: Touch<L>,
    /// Branch vector d from first to second \[m\] (wall: to the wall plane).
    pub branch: Vector<L>,
    /// The part of the relative velocity that the cell's motion imposes \[m/s\].
    pub imposed_velocity: Vector<L>,
    /// Distance of the contact point from the first's centre along n \[m\].
    pub arm_first: L,
    /// Distance of the contact point from the second's centre \[m\].
    pub arm_second: L,
    /// Smaller radius \[m\].
    pub min_radius: L,
}

/// `S·factor` of some packed shifts.
#[inline(always)]
#[must_use]
pub fn image<L: Lane>(table: &ShiftTable, codes: &[u16]) -> Vector<L> {
    [L::look_up(&table.axes[0], codes, 0), L::look_up(&table.axes[1], codes, 3), L::look_up(&table.axes[2], codes, 6)]
}

/// Two spheres relative to each other, before any root or division.
#[derive(Debug, Clone, Copy)]
pub struct Relative<L> {
    /// Branch vector d from first to second \[m\].
    pub branch: Vector<L>,
    /// Velocity of the second relative to the first, with what the cell imposes \[m/s\].
    pub velocity: Vector<L>,
    /// The part of it that the cell's motion imposes \[m/s\].
    pub imposed_velocity: Vector<L>,
    /// ω_i + ω_j \[rad/s\].
    pub spin_sum: Vector<L>,
    /// ω_j − ω_i \[rad/s\]; not set by [`Relative::of`].
    pub relative_spin: Vector<L>,
    /// R_j − R_i \[m\].
    pub radius_difference: L,
    /// R_i + R_j \[m\].
    pub radius_sum: L,
    /// 1/m_i + 1/m_j \[1/kg\].
    pub inverse_masses: L,
}

impl<L: Lane> Relative<L> {
    /// Pairs of unequal radii.
    #[inline(always)]
    #[must_use]
    pub fn unequal(&self) -> L::Mask {
        let zero = L::splat(0.0);
        self.radius_difference.greater(zero) | zero.greater(self.radius_difference)
    }
}

impl<L: Lane> PairTouch<L> {
    /// Lanes whose law is asked: those that touch, and those near enough for a memory that lasts; `range` is the
    /// law's, 0 for a memory that ends with the touch.
    #[inline(always)]
    #[must_use]
    pub fn alive(&self, range: f64) -> L::Mask {
        if range == 0.0 {
            return self.touching;
        }
        // The effective radius of flat ellipsoids has no bound; that of spheres is below the smaller radius.
        let reach = L::splat(-range) * self.touch.effective_radius.min(self.min_radius);
        self.touching | self.touch.overlap.greater(reach)
    }
}

impl<L: Lane> Relative<L> {
    /// Pairs of spheres from `lane` of a block on, in no image yet and without what the cell imposes; without
    /// `relative_spin`, which between equal spheres only rolling laws need. `EQUAL`: all radii are, and those of the
    /// pair mean nothing, see [`Self::equal`].
    ///
    /// # Source
    /// PHYSICS.md section 1.
    #[inline(always)]
    #[must_use]
    pub fn of<const EQUAL: bool>(pairs: &BlockPairs, lane: usize) -> Self {
        let [[x, y, z, radius_difference], [vx, vy, vz, radius_sum], [wx, wy, wz, inverse_masses]] =
            L::relative::<EQUAL>(pairs, lane);
        Self {
            branch: [x, y, z],
            velocity: [vx, vy, vz],
            imposed_velocity: [L::splat(0.0); 3],
            spin_sum: [wx, wy, wz],
            relative_spin: [L::splat(0.0); 3],
            radius_difference,
            radius_sum,
            inverse_masses,
        }
    }

    /// Distance of the centres \[m\] and its reciprocal.
    #[inline(always)]
    #[must_use]
    pub fn distance(&self) -> [L; 2] {
        let distance = dot(self.branch, self.branch).sqrt();
        [distance, L::splat(1.0) / distance]
    }

    /// Both of this radius.
    #[inline(always)]
    pub fn equal(&mut self, radius: f64) {
        self.radius_difference = L::splat(0.0);
        self.radius_sum = L::splat(radius + radius);
    }

    /// Bring the second ones into the images of their packed shifts. Where all are 0 this changes nothing (no component
    /// of a branch vector is −0), unless the faces move.
    #[inline(always)]
    pub fn enter_images(&mut self, codes: &[u16], motion: &CellMotion) {
        self.branch = add(self.branch, image(&motion.shift, codes));
        if motion.faces_move {
            self.imposed_velocity = image(&motion.shift_velocity, codes);
        }
    }

    /// Add to the velocity what the cell's motion imposes; `faces_move` as in `motion`.
    #[inline(always)]
    pub fn follow_cell(&mut self, motion: &CellMotion, faces_move: bool) {
        let [gx, gy, gz] = motion.gradient;
        let affine = [L::splat(gx) * self.branch[0], L::splat(gy) * self.branch[1], L::splat(gz) * self.branch[2]];
        self.imposed_velocity = if faces_move { add(affine, self.imposed_velocity) } else { affine };
        self.velocity = add(self.velocity, self.imposed_velocity);
    }
}

/// The touch of two spheres. The contact point lies on the line of centres in the middle of the overlap, at
/// `a_i = R_i − δ/2 = ½ (d − (R_j − R_i))` from i, d the distance. NaN counts as touching, so that it is found.
///
/// The surfaces turn past each other with `(a_i ω_i + a_j ω_j) × n = ½ (ω_i + ω_j) × d n + ½ (R_j − R_i)(ω_j − ω_i) × n`.
///
/// Gets the pair's [`Relative::distance`]; `mixed`: some pairs may have unequal radii.
#[inline(always)]
#[must_use]
pub fn touch<L: Lane>(pair: &Relative<L>, [distance, reciprocal]: [L; 2], mixed: bool) -> PairTouch<L> {
    let (branch, sum, difference, half) = (pair.branch, pair.radius_sum, pair.radius_difference, L::splat(0.5));
    let overlap = sum - distance;
    let normal = scale(branch, reciprocal);
    let approach = dot(pair.velocity, normal);
    let mean_spin = scale(pair.spin_sum, half);
    let mut turning = cross(mean_spin, branch);
    let mut reduced = sum;
    let mut arms = [half * distance; 2];
    let mut min_radius = half * sum;
    let unequal = pair.unequal();
    if mixed && L::any(unequal) {
        // By lane, so that a pair's bits do not hang on the pairs beside it.
        let more = scale(cross(pair.relative_spin, normal), half * difference);
        for k in 0..3 {
            turning[k] = L::select(unequal, turning[k] + more[k], turning[k]);
        }
        arms = [half * (distance - difference), half * (distance + difference)];
        min_radius = half * (sum - difference.max(-difference));
        reduced = sum - difference * difference / sum;
    }
    let touch = Touch {
        overlap,
        overlap_rate: -approach,
        effective_radius: L::splat(0.25) * reduced,
        radius_factor: L::splat(1.0),
        overlap_factor: L::splat(1.0),
        size: sum,
        effective_mass: L::splat(1.0) / pair.inverse_masses,
        normal,
        slip_velocity: sub(sub(pair.velocity, scale(normal, approach)), turning),
        relative_spin: pair.relative_spin,
        spin_about_normal: dot(mean_spin, normal),
    };
    PairTouch {
        touching: (L::splat(TOUCH_TOLERANCE) * sum).not_at_least(overlap),
        touch,
        branch,
        imposed_velocity: pair.imposed_velocity,
        arm_first: arms[0],
        arm_second: arms[1],
        min_radius,
    }
}

/// Pairs of spheres from `lane` of a block on, the second ones in the images of their packed shifts, with what the cell
/// imposes.
#[inline(always)]
#[must_use]
pub fn relative<L: Lane>(pairs: &BlockPairs, lane: usize, motion: &CellMotion) -> Relative<L> {
    let mut pair = Relative { relative_spin: L::relative_spin(pairs, lane), ..Relative::of::<false>(pairs, lane) };
    let codes = &pairs.codes()[lane..];
    // Away from periodic faces there is nothing to look up.
    if motion.faces_move || !shift::all_here(&codes[..L::WIDTH]) {
        pair.enter_images(codes, motion);
    }
    pair.follow_cell(motion, motion.faces_move);
    pair
}

/// Touches of pairs of spheres, see [`relative`].
#[inline(always)]
#[must_use]
pub fn spheres<L: Lane>(pairs: &BlockPairs, lane: usize, motion: &CellMotion) -> PairTouch<L> {
    let pair = relative(pairs, lane, motion);
    touch(&pair, pair.distance(), true)
}

/// Touch of a sphere and a plane wall (2·axis + side). The wall has infinite mass and no curvature; it moves
/// with the cell face and does not turn.
#[inline(always)]
#[must_use]
pub fn wall(a: &Record, wall: u32, motion: &CellMotion) -> PairTouch<f64> {
    let axis = (wall / 2) as usize;
    let high = wall % 2 == 1;
    let (gap, sign) = if high { (motion.sides[axis] - a.position[axis], 1.0) } else { (a.position[axis], -1.0) };
    let overlap = a.radius - gap;
    let unit = [0, 1, 2].map(|k| if k == axis { sign } else { 0.0 });
    let branch = scale(unit, gap);
    let moving = if high { motion.wall_velocity[axis] } else { 0.0 };
    let along = motion.gradient[axis] * branch[axis] + moving;
    let imposed = [0, 1, 2].map(|k| if k == axis { along } else { 0.0 });
    let velocity = sub(imposed, a.velocity);
    let approach = dot(velocity, unit);
    let turning = cross(scale(a.spin, gap), unit);
    let touch = Touch {
        overlap,
        overlap_rate: -approach,
        effective_radius: a.radius,
        radius_factor: 1.0,
        overlap_factor: 1.0,
        size: 2.0 * a.radius,
        effective_mass: 1.0 / a.inverse_mass,
        normal: unit,
        slip_velocity: sub(sub(velocity, scale(unit, approach)), turning),
        relative_spin: scale(a.spin, -1.0),
        spin_about_normal: 0.5 * dot(a.spin, unit),
    };
    PairTouch {
        touching: (TOUCH_TOLERANCE * a.radius).not_at_least(overlap),
        touch,
        branch,
        imposed_velocity: imposed,
        arm_first: gap,
        arm_second: 0.0,
        min_radius: a.radius,
    }
}
