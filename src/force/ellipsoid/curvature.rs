//! Shape of an elliptical contact from the radii tensors of the two surfaces: R_e, f_1, f_2.

use crate::force::lane::Lane;

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
        // Powers by way of logarithms: one of them for both factors, and no digits lost in the "−1".
        let log = ratio.map(libm::log);
        let factor = |inner: f64, outer: f64| {
            log.map(move |log| {
                let excess = libm::expm1(inner * log);
                if excess > 0.0 { 1.0 - libm::exp(outer * libm::log(excess)) } else { 1.0 - excess }
            })
        };
        Self {
            effective_radius: one / determinant.sqrt(),
            ratio,
            radius_factor: factor(0.0602, 1.456),
            overlap_factor: factor(0.0684, 1.531),
        }
    }
}

/// Inverse of a symmetric 2 × 2 tensor (11, 22, 12).
#[inline(always)]
fn inverse<L: Lane>(w: &[L; 3]) -> [L; 3] {
    let per_determinant = L::splat(1.0) / (w[0] * w[1] - w[2] * w[2]);
    [w[1] * per_determinant, w[0] * per_determinant, -(w[2] * per_determinant)]
}
