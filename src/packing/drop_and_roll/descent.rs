//! Which contacts carry a sphere, and whether they hold it.

use super::roll::Contact;
use super::{cross, dot, minus};

/// How a sphere goes on.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Descent {
    /// It rests on three contacts.
    Rest,
    /// It rolls on these two or one, or falls.
    On(Vec<Contact>),
}

/// Pushes and approaches within this count as none.
const ROUNDING: f64 = 1e-12;

/// The steepest descent of a sphere at `position` among the spheres that it touches.
///
/// With n_a the direction from contact a to the sphere, the sphere may move along v with `n_a·v ≥ 0` for all
/// a. The steepest such direction is `v = −z + Σ N_a n_a` with pushes `N_a ≥ 0` of those contacts, at most
/// three, for which `n_a·v = 0`. It is zero, and the sphere at rest, if three contacts balance the
/// weight: then `Σ N_a n_a = z`, whose horizontal part says that the centre lies inside the triangle of the
/// contacts' centres seen from above (W Fig. 3).
pub(super) fn descent(position: [f64; 3], touching: &[Contact]) -> Descent {
    let normals: Vec<[f64; 3]> =
        touching.iter().map(|contact| minus(position, contact.centre).map(|x| x / contact.reach)).collect();
    let count = normals.len();
    for a in 0..count {
        for b in a + 1..count {
            for c in b + 1..count {
                if balances([normals[a], normals[b], normals[c]]) {
                    return Descent::Rest;
                }
            }
        }
    }
    // Without rounding exactly one set violates nothing; the least violated is that one.
    let mut best = (violation(&normals, [0.0, 0.0, -1.0], 0.0), Vec::new());
    let mut consider = |velocity, least_push, set: &[usize]| {
        let violated = violation(&normals, velocity, least_push);
        if violated < best.0 {
            best = (violated, set.to_vec());
        }
    };
    for (a, normal) in normals.iter().enumerate() {
        let push = normal[2];
        consider([push * normal[0], push * normal[1], push * normal[2] - 1.0], push, &[a]);
        for (b, other) in normals.iter().enumerate().skip(a + 1) {
            let cosine = dot(*normal, *other);
            let pushes = [normal[2] - cosine * other[2], other[2] - cosine * normal[2]];
            let [on_a, on_b] = pushes.map(|push| push / (1.0 - cosine * cosine));
            let sum = [0, 1, 2].map(|k| on_a * normal[k] + on_b * other[k]);
            consider([sum[0], sum[1], sum[2] - 1.0], on_a.min(on_b), &[a, b]);
        }
    }
    Descent::On(best.1.into_iter().map(|a| touching[a]).collect())
}

/// How much a motion that needs no push below `least_push` approaches a contact, or pulls at one.
fn violation(normals: &[[f64; 3]], velocity: [f64; 3], least_push: f64) -> f64 {
    let worst = normals.iter().map(|normal| -dot(*normal, velocity)).fold(-least_push, f64::max);
    // A set that is no set (parallel normals) is none to choose.
    if worst.is_nan() || least_push.is_nan() { f64::INFINITY } else { worst.max(0.0) }
}

/// Whether three contacts along these normals balance the weight: z = Σ N_a n_a, N_a ≥ 0.
fn balances(normals: [[f64; 3]; 3]) -> bool {
    let [a, b, c] = normals;
    let volume = dot(a, cross(b, c));
    if volume.abs() < ROUNDING {
        return false;
    }
    [cross(b, c)[2], cross(c, a)[2], cross(a, b)[2]].iter().all(|push| push / volume >= -ROUNDING)
}
