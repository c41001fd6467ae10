//! Whether two ellipsoids overlap, and how far they must shrink until they just touch: the contact
//! function of Perram and Wertheim.

use crate::state::shape::rotation_matrix;

/// A symmetric 3 × 3 matrix: xx, yy, zz, xy, xz, yz.
pub type Symmetric = [f64; 6];

/// Newton steps stop when the place of the maximum is known to this; the error of the maximum is of the
/// order of its square.
const TOLERANCE: f64 = 1e-9;

/// Steps after which the search ends whatever it found; Newton needs three or four.
const MAX_STEPS: usize = 60;

/// `M = R diag(a², b², c²) Rᵀ` of an ellipsoid \[m²\]: its surface is `{x : xᵀ M⁻¹ x = 1}`.
#[must_use]
pub fn squared_axes(semi_axes: [f64; 3], orientation: [f64; 4]) -> Symmetric {
    let rotation = rotation_matrix(orientation);
    let squares = semi_axes.map(|axis| axis * axis);
    let entry = |i: usize, j: usize| {
        let term = |k: usize| squares[k] * rotation[i][k] * rotation[j][k];
        term(0) + term(1) + term(2)
    };
    [entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)]
}

/// An overlap of two ellipsoids.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// μ: both ellipsoids, scaled by it about their centres, just touch; below 1.
    pub scale: f64,
    /// `∂μ/∂d`, along the common normal from the first to the second \[1/m\].
    pub gradient: [f64; 3],
    /// `∂μ/∂θ` for a turn of the first by a small rotation vector.
    pub turn_first: [f64; 3],
    /// `∂μ/∂θ` for a turn of the second.
    pub turn_second: [f64; 3],
    /// Where the maximum was, to start from the next time.
    pub place: f64,
}

/// The overlap of two ellipsoids with the matrices [`squared_axes`], d from the centre of the first to
/// that of the second; `None` if they do not overlap. `place`, in (0, 1), is where the search begins.
///
/// ```text
/// μ² = max_λ λ(1−λ) d·n,   C n = d,   C = (1−λ) M_first + λ M_second
/// ```
///
/// The function of λ is concave. Wherever it exceeds 1 the ellipsoids are apart, which ends most searches
/// at once. The place of the maximum does not enter the derivatives.
///
/// # Source
/// Perram, Wertheim 1985 (doi:10.1016/0021-9991(85)90171-8).
#[must_use]
pub fn overlap(first: &Symmetric, second: &Symmetric, d: [f64; 3], place: f64) -> Option<Overlap> {
    let (mut low, mut high, mut place) = (0.0, 1.0, place);
    let mut found = Trial::at(first, second, d, place)?;
    for _ in 0..MAX_STEPS {
        if found.slope > 0.0 {
            low = place;
        } else {
            high = place;
        }
        let newton = place - found.slope / found.curvature(first, second);
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        let step = (next - place).abs();
        place = next;
        found = Trial::at(first, second, d, place)?;
        if step < TOLERANCE {
            break;
        }
    }
    let scale = found.square.sqrt();
    // dμ = dμ²/(2 μ)
    let weight = place * (1.0 - place) / scale;
    let turn = |of: [f64; 3], share: f64| cross(of, found.n).map(|component| -weight * share * component);
    Some(Overlap {
        scale,
        gradient: found.n.map(|component| weight * component),
        turn_first: turn(found.first, 1.0 - place),
        turn_second: turn(found.second, place),
        place,
    })
}

/// The function at one λ.
struct Trial {
    lambda: f64,
    /// C⁻¹ and n = C⁻¹ d.
    inverse: Symmetric,
    n: [f64; 3],
    /// M_first n and M_second n.
    first: [f64; 3],
    second: [f64; 3],
    dot: f64,
    square: f64,
    slope: f64,
}

impl Trial {
    /// `None` where the function shows that the ellipsoids are apart.
    #[inline(always)]
    fn at(first: &Symmetric, second: &Symmetric, d: [f64; 3], lambda: f64) -> Option<Self> {
        let mixed = [0, 1, 2, 3, 4, 5].map(|k| (1.0 - lambda) * first[k] + lambda * second[k]);
        let inverse = inverse(&mixed);
        let n = times(&inverse, d);
        let dot = scalar(n, d);
        let square = lambda * (1.0 - lambda) * dot;
        if square >= 1.0 {
            return None;
        }
        let (first, second) = (times(first, n), times(second, n));
        let slope = (1.0 - lambda) * (1.0 - lambda) * scalar(n, first) - lambda * lambda * scalar(n, second);
        Some(Self { lambda, inverse, n, first, second, dot, square, slope })
    }

    /// The second derivative.
    #[inline(always)]
    fn curvature(&self, first: &Symmetric, second: &Symmetric) -> f64 {
        let difference = [0, 1, 2].map(|k| self.second[k] - self.first[k]);
        let change = times(&self.inverse, difference);
        let (a, b) = (times(first, change), times(second, change));
        let (rest, lambda) = (1.0 - self.lambda, self.lambda);
        -2.0 * self.dot - 2.0 * (rest * rest * scalar(a, self.n) - lambda * lambda * scalar(b, self.n))
    }
}

#[inline(always)]
fn times(m: &Symmetric, v: [f64; 3]) -> [f64; 3] {
    [
        m[0] * v[0] + m[3] * v[1] + m[4] * v[2],
        m[3] * v[0] + m[1] * v[1] + m[5] * v[2],
        m[4] * v[0] + m[5] * v[1] + m[2] * v[2],
    ]
}

#[inline(always)]
fn inverse(m: &Symmetric) -> Symmetric {
    let [xx, yy, zz, xy, xz, yz] = *m;
    let (a, b, c) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let over = 1.0 / (xx * a + xy * b + xz * c);
    [a, xx * zz - xz * xz, xx * yy - xy * xy, b, c, xy * xz - xx * yz].map(|cofactor| cofactor * over)
}

#[inline(always)]
fn scalar(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::shape::{normalised, product};

    const AXES: [[f64; 3]; 2] = [[1.25, 1.0, 0.8], [0.9, 1.7, 0.6]];
    const TURNS: [[f64; 4]; 2] = [[0.3, -0.5, 0.7, 0.2], [0.9, 0.1, -0.4, 0.6]];
    const D: [f64; 3] = [0.9, -0.6, 1.1];

    fn overlap_of(d: [f64; 3], turns: [[f64; 4]; 2], place: f64) -> Option<Overlap> {
        let [first, second] = [0, 1].map(|k| squared_axes(AXES[k], normalised(turns[k])));
        overlap(&first, &second, d, place)
    }

    #[test]
    fn spheres_overlap_by_their_distance() {
        let [first, second] = [2.0, 0.5].map(|radius| squared_axes([radius; 3], TURNS[0].map(|q| q)));
        let found = overlap(&first, &second, [2.0, 0.0, 0.0], 0.5).expect("they overlap");
        assert!((found.scale - 0.8).abs() < 1e-14 && (found.place - 0.8).abs() < 1e-8, "{found:?}");
        assert!((found.gradient[0] - 0.4).abs() < 1e-13);
        assert!(overlap(&first, &second, [2.5001, 0.0, 0.0], 0.5).is_none());
    }

    #[test]
    fn scaled_ellipsoids_touch_from_outside() {
        // Scaled by slightly less than μ they are apart, by slightly more they overlap.
        let found = overlap_of(D, TURNS, 0.5).expect("they overlap");
        for (factor, apart) in [(1.0 - 1e-9, true), (1.0 + 1e-9, false)] {
            let scaled = D.map(|component| component / (found.scale * factor));
            assert_eq!(overlap_of(scaled, TURNS, 0.3).is_none(), apart, "{factor}");
        }
    }

    #[test]
    fn where_the_search_begins_does_not_matter() {
        let found = [0.01, 0.5, 0.99].map(|place| overlap_of(D, TURNS, place).expect("they overlap"));
        for other in &found[1..] {
            assert!((other.scale - found[0].scale).abs() < 1e-14, "{found:?}");
        }
    }

    #[test]
    fn derivatives_are_those_of_finite_differences() {
        let found = overlap_of(D, TURNS, 0.5).expect("they overlap");
        let step = 1e-6;
        for axis in 0..3 {
            let along = |sign: f64| {
                let mut d = D;
                d[axis] += sign * step;
                overlap_of(d, TURNS, 0.5).expect("they overlap").scale
            };
            let slope = (along(1.0) - along(-1.0)) / (2.0 * step);
            assert!((slope - found.gradient[axis]).abs() < 1e-8, "{slope} {found:?}");
            for (body, expected) in [found.turn_first, found.turn_second].into_iter().enumerate() {
                let turned = |sign: f64| {
                    let mut turn = [1.0, 0.0, 0.0, 0.0];
                    turn[1 + axis] = 0.5 * sign * step;
                    let mut turns = TURNS;
                    turns[body] = product(turn, turns[body]);
                    overlap_of(D, turns, 0.5).expect("they overlap").scale
                };
                let slope = (turned(1.0) - turned(-1.0)) / (2.0 * step);
                assert!((slope - expected[axis]).abs() < 1e-8, "{slope} {found:?}");
            }
        }
    }
}
