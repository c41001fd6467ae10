//! Particles that leave the cell come in again on the other side.

use super::leap_frog::StepMotion;
use crate::state::particles::Record;

/// What a particle outside the cell did.
pub(super) struct Crossing {
    /// Images crossed.
    pub wraps: [i32; 3],
    /// It went farther than it can.
    pub lost: bool,
}

/// Bring a particle back into the cell, and change its velocity with the face (BC).
pub(super) fn wrap(
    record: &mut Record,
    velocity: &mut [f64; 4],
    reference: &mut [f64; 3],
    motion: &StepMotion,
) -> Crossing {
    let mut crossing = Crossing { wraps: [0; 3], lost: false };
    for k in 0..3 {
        let (side, x) = (motion.sides[k], record.position[k]);
        if x >= 0.0 && x < side {
            continue;
        }
        if !motion.periodic[k] {
            crossing.lost |= x < -record.radius || x > side + record.radius;
            continue;
        }
        let (position, crossed) = wrapped(x, side);
        crossing.lost |= crossed.abs() > 1;
        record.position[k] = position;
        crossing.wraps[k] = crossed;
        velocity[k] -= f64::from(crossed) * motion.face_velocity[k];
        if crossed != 0 {
            reference[k] -= f64::from(crossed) * motion.reference_sides[k];
        }
    }
    crossing
}

/// Position wrapped into `[0, side)` and the images crossed (+1: left through the high face). Farther
/// than one side off, the count is 2 or −2: a fault.
#[inline]
#[must_use]
fn wrapped(x: f64, side: f64) -> (f64, i32) {
    if x >= side {
        let back = x - side;
        return if back < side { (back, 1) } else { (x, 2) };
    }
    if x < 0.0 {
        let forth = x + side;
        if forth < 0.0 {
            return (x, -2);
        }
        // A tiny negative x rounds to the side itself, which is the low face.
        return if forth < side { (forth, -1) } else { (0.0, 0) };
    }
    (x, 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapping_stays_inside_and_counts_images() {
        assert_eq!(wrapped(1.5, 1.0), (0.5, 1));
        assert_eq!(wrapped(-0.25, 1.0), (0.75, -1));
        assert_eq!(wrapped(-1e-20, 1.0), (0.0, 0));
        assert_eq!(wrapped(1.0, 1.0), (0.0, 1));
        assert_eq!(wrapped(2.5, 1.0).1, 2);
        assert_eq!(wrapped(-2.5, 1.0).1, -2);
    }
}
