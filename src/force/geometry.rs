//! Geometry and relative motion of touching spheres and walls, from packed records.

use super::lane::{add, cross, dot, scale, sub};
use super::law::Touch;
use crate::contact::shift::ShiftTable;
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
    /// L̇/L per axis (BCT; zero in BC) \[1/s\]: the affine part of the relative velocity per branch vector.
    pub gradient: [f64; 3],
    /// Absolute velocity of the high walls (BC; zero in BCT, where `gradient` holds it) \[m/s\].
    pub wall_velocity: [f64; 3],
}

/// A touch with what the output line needs beside the law's view.
#[derive(Debug, Clone, Copy)]
pub struct PairTouch {
    /// The law's view.
    pub touch: Touch<f64>,
    /// Branch vector d from first to second \[m\] (wall: to the wall plane).
    pub branch: [f64; 3],
    /// The part of the relative velocity that the cell's motion imposes \[m/s\].
    pub imposed_velocity: [f64; 3],
    /// Distance of the contact point from the first's centre along n \[m\].
    pub arm_first: f64,
    /// Distance of the contact point from the second's centre \[m\].
    pub arm_second: f64,
    /// Smaller radius \[m\].
    pub min_radius: f64,
}

/// Touch of two spheres; `None` if they do not touch. The contact point lies on the line of centres at
/// `R_i − δ R_j/(R_i+R_j)` from i.
///
/// # Source
/// PHYSICS.md section 1.
#[inline(always)]
#[must_use]
pub fn spheres(a: &Record, b: &Record, code: u16, motion: &CellMotion) -> Option<PairTouch> {
    let branch = sub(add(b.position, motion.shift.vector(code)), a.position);
    let distance_squared = dot(branch, branch);
    let sum = a.radius + b.radius;
    // Cheap exclusion first; what passes by rounding is caught by the tolerance below.
    if distance_squared >= sum * sum {
        return None;
    }
    let distance = distance_squared.sqrt();
    let overlap = sum - distance;
    if overlap <= TOUCH_TOLERANCE * sum {
        return None;
    }
    let normal = scale(branch, 1.0 / distance);
    let imposed = add(motion.shift_velocity.vector(code), [0, 1, 2].map(|k| motion.gradient[k] * branch[k]));
    let velocity = add(sub(b.velocity, a.velocity), imposed);
    let share = overlap / sum;
    let (arm_first, arm_second) = (a.radius - share * b.radius, b.radius - share * a.radius);
    let approach = dot(velocity, normal);
    let turning = cross(add(scale(a.spin, arm_first), scale(b.spin, arm_second)), normal);
    let touch = Touch {
        overlap,
        overlap_rate: -approach,
        effective_radius: a.radius * b.radius / sum,
        effective_mass: 1.0 / (a.inverse_mass + b.inverse_mass),
        normal,
        slip_velocity: sub(sub(velocity, scale(normal, approach)), turning),
        relative_spin: sub(b.spin, a.spin),
        mean_spin: scale(add(a.spin, b.spin), 0.5),
    };
    let min_radius = if a.radius < b.radius { a.radius } else { b.radius };
    Some(PairTouch { touch, branch, imposed_velocity: imposed, arm_first, arm_second, min_radius })
}

/// Touch of a sphere and a plane wall (2·axis + side); `None` if they do not touch. The wall has
/// infinite mass and no curvature; it moves with the cell face and does not turn.
#[inline(always)]
#[must_use]
pub fn wall(a: &Record, wall: u32, motion: &CellMotion) -> Option<PairTouch> {
    let axis = (wall / 2) as usize;
    let high = wall % 2 == 1;
    let (gap, sign) = if high { (motion.sides[axis] - a.position[axis], 1.0) } else { (a.position[axis], -1.0) };
    let overlap = a.radius - gap;
    if overlap <= TOUCH_TOLERANCE * a.radius {
        return None;
    }
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
        effective_mass: 1.0 / a.inverse_mass,
        normal: unit,
        slip_velocity: sub(sub(velocity, scale(unit, approach)), turning),
        relative_spin: scale(a.spin, -1.0),
        mean_spin: scale(a.spin, 0.5),
    };
    Some(PairTouch { touch, branch, imposed_velocity: imposed, arm_first: gap, arm_second: 0.0, min_radius: a.radius })
}
