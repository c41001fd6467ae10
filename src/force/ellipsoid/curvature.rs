//! Shape of an elliptical contact from the radii tensors of the two surfaces: R_e, f_1, f_2.

use crate::force::lane::Lane;
use crate::force::lane::elementary::{exp, ln, polynomial};

/// Shape of the gap between two surfaces near the point where they touch, `A x² + B y²`, A ≤ B.
#[derive(Debug, Clone, Copy)]
pub struct Ellipse<L> {
    /// `R_e = 1/(2 √(A B))` \[m\].
    pub effective_radius: L,
    /// B/A ≥ 1.
    pub ratio: L,
    /// f_1: the contact radius of equal area over `√(R_e δ/f_2)`.
    pub radius_factor: L,
    /// f_2: divides the overlap.
    pub overlap_factor: L,
}

impl<L: Lane> Ellipse<L> {
    /// From the radii tensors W of both surfaces in one basis of the tangent plane (11, 22, 12) \[m\].
    ///
    /// The sum of the two inverse tensors has the eigenvalues 2A and 2B, which is B (5) without angles.
    /// `f_1 = 1 − [(B/A)^{0.0602} − 1]^{1.456}`, `f_2 = 1 − [(B/A)^{0.0684} − 1]^{1.531}`.
    ///
    /// # Source
    /// B (3)–(7) with the errata of PHYSICS.md: f_1, f_2 with the "−1" that the print lacks, A ≤ B.
    #[inline(always)]
    #[must_use]
    pub fn new(radii: &[[L; 3]; 2]) -> Self {
        let (a, b) = (inverse(&radii[0]), inverse(&radii[1]));
        Self::of_curvatures([a[0] + b[0], a[1] + b[1], a[2] + b[2]])
    }

    /// Of one surface before a plane.
    #[inline(always)]
    #[must_use]
    pub fn before_plane(radii: &[L; 3]) -> Self {
        Self::of_curvatures(inverse(radii))
    }

    #[inline(always)]
    fn of_curvatures(sum: [L; 3]) -> Self {
        let (one, half) = (L::splat(1.0), L::splat(0.5));
        let mean = half * (sum[0] + sum[1]);
        let difference = half * (sum[0] - sum[1]);
        let larger = mean + (difference * difference + sum[2] * sum[2]).sqrt();
        let determinant = sum[0] * sum[1] - sum[2] * sum[2];
        // 4 A B is the determinant; the larger eigenvalue suffers no cancellation. Rounding must not make B < A.
        let ratio = one.max(larger * larger / determinant);
        // Equal curvatures: 1 − 0, without the logarithm of 0.
        let log = ln(ratio).max(L::splat(f64::MIN_POSITIVE));
        let log_log = ln(log);
        Self {
            effective_radius: one / determinant.sqrt(),
            ratio,
            radius_factor: factor(log, log_log, [0.0602, -2.810_082_926_667_362], 1.456),
            overlap_factor: factor(log, log_log, [0.0684, -2.682_382_454_353_632], 1.531),
        }
    }
}

/// `1 − (r^p − 1)^q` from `log = ln r`, `ln ln r`, p with its logarithm, and q.
///
/// With `t = p ln r`, `ln(e^t − 1) = ln t + t/2 + t²/24 − t⁴/2880 + …`, so that no digits are lost where r is near 1. The
/// series is below 10⁻¹³ off up to t = 1, r = 10⁶.
#[inline(always)]
fn factor<L: Lane>(log: L, log_log: L, [inner, log_inner]: [f64; 2], outer: f64) -> L {
    /// Of t², t⁴, …: B_n/(n n!), B_n the Bernoulli numbers.
    const SERIES: [f64; 7] = [
        1.0 / 24.0,
        -1.0 / 2880.0,
        1.0 / 181_440.0,
        -1.0 / 9_676_800.0,
        1.0 / 479_001_600.0,
        -691.0 / 15_692_092_416_000.0,
        1.0 / 1_046_139_494_400.0,
    ];
    let t = L::splat(inner) * log;
    let square = t * t;
    let series = square * polynomial(square, &SERIES);
    let log_excess = log_log + (L::splat(log_inner) + (L::splat(0.5) * t + series));
    L::splat(1.0) - exp((L::splat(outer) * log_excess).max(L::splat(-700.0)))
}

/// Inverse of a symmetric 2 × 2 tensor (11, 22, 12).
#[inline(always)]
fn inverse<L: Lane>(w: &[L; 3]) -> [L; 3] {
    let per_determinant = L::splat(1.0) / (w[0] * w[1] - w[2] * w[2]);
    [w[1] * per_determinant, w[0] * per_determinant, -(w[2] * per_determinant)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factors_are_their_powers() {
        for k in 0..4000 {
            let log = libm::pow(10.0, -14.0 + 15.0 * f64::from(k) / 4000.0);
            let got = [(0.0602, 1.456), (0.0684, 1.531)].map(|(inner, outer)| {
                let expected = 1.0 - libm::pow(libm::expm1(inner * log), outer);
                let got = factor(log, ln(log), [inner, libm::log(inner)], outer);
                (got, expected)
            });
            for (got, expected) in got {
                assert!((got - expected).abs() <= 1e-13 * (1.0 + expected.abs()), "{log:e}: {got} {expected}");
            }
        }
    }

    #[test]
    fn equal_curvatures_have_factors_of_one() {
        let sphere = Ellipse::before_plane(&[2.0, 2.0, 0.0]);
        assert_eq!([sphere.effective_radius, sphere.ratio], [2.0, 1.0]);
        assert_eq!([sphere.radius_factor, sphere.overlap_factor], [1.0; 2]);
    }
}
