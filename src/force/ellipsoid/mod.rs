//! Contact geometry of ellipsoids: common normal, overlap, surface points and curvatures, from support
//! functions. Knows no law, no list, no cell.
//!
//! An ellipsoid is the tensor `M = Q diag(a², b², c²) Qᵀ`; its support function `h(n) = √(nᵀ M n)` is the distance of
//! the tangent plane with outer normal n from the centre, `M n/h` the point where that plane touches. All of it
//! is smooth, whatever the semi-axes, and a sphere is no special case.

pub mod curvature;
pub mod normal;
pub mod touch;

use super::lane::{Lane, Vector, dot};

/// Symmetric tensor: xx, yy, zz, xy, xz, yz.
pub type Symmetric<L> = [L; 6];

/// `M = Q diag(a², b², c²) Qᵀ` \[m²\] from the semi-axes \[m\] and the orientation, a unit quaternion (w, x, y, z) that
/// turns body axes into space axes.
#[inline(always)]
#[must_use]
pub fn shape_tensor<L: Lane>(semi_axes: Vector<L>, orientation: [L; 4]) -> Symmetric<L> {
    let [w, x, y, z] = orientation;
    let two = L::splat(2.0);
    let one = L::splat(1.0);
    let columns = [
        [one - two * (y * y + z * z), two * (x * y + w * z), two * (x * z - w * y)],
        [two * (x * y - w * z), one - two * (x * x + z * z), two * (y * z + w * x)],
        [two * (x * z + w * y), two * (y * z - w * x), one - two * (x * x + y * y)],
    ];
    let [a, b, c] = semi_axes;
    let squares = [a * a, b * b, c * c];
    let mut entries = [L::splat(0.0); 6];
    for (entry, (i, k)) in entries.iter_mut().zip([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]) {
        *entry = squares[0] * columns[0][i] * columns[0][k]
            + squares[1] * columns[1][i] * columns[1][k]
            + squares[2] * columns[2][i] * columns[2][k];
    }
    entries
}

/// `M = R² I` of a sphere.
#[inline(always)]
#[must_use]
pub fn sphere_tensor<L: Lane>(radius: L) -> Symmetric<L> {
    let (zero, square) = (L::splat(0.0), radius * radius);
    [square, square, square, zero, zero, zero]
}

/// Tensor times vector.
#[inline(always)]
#[must_use]
pub fn apply<L: Lane>(m: &Symmetric<L>, v: Vector<L>) -> Vector<L> {
    [
        m[0] * v[0] + m[3] * v[1] + m[4] * v[2],
        m[3] * v[0] + m[1] * v[1] + m[5] * v[2],
        m[4] * v[0] + m[5] * v[1] + m[2] * v[2],
    ]
}

/// Support distance h \[m\] and the point `M n/h` of the surface \[m\], from the centre.
#[inline(always)]
#[must_use]
pub fn support<L: Lane>(m: &Symmetric<L>, n: Vector<L>) -> (L, Vector<L>) {
    let image = apply(m, n);
    let distance = dot(n, image).sqrt();
    let inverse = L::splat(1.0) / distance;
    (distance, [image[0] * inverse, image[1] * inverse, image[2] * inverse])
}

/// Two unit vectors orthogonal to the unit vector n and to each other, smooth but where n_z changes sign.
///
/// # Source
/// Duff et al. 2017, Journal of Computer Graphics Techniques 6(1).
#[inline(always)]
#[must_use]
pub fn tangents<L: Lane>(n: Vector<L>) -> [Vector<L>; 2] {
    let one = L::splat(1.0);
    let sign = L::select(n[2].less(L::splat(0.0)), -one, one);
    let a = -(one / (sign + n[2]));
    let b = n[0] * n[1] * a;
    [[one + sign * n[0] * n[0] * a, sign * b, -(sign * n[0])], [b, sign + n[1] * n[1] * a, -n[1]]]
}

/// The tensor of principal radii of curvature on the tangent plane, `W = M/h − (M n)(M n)ᵀ/h³`, in the basis `t`: 11,
/// 22, 12 \[m\]; `point` is `M n/h`.
#[inline(always)]
#[must_use]
pub fn radii_tensor<L: Lane>(m: &Symmetric<L>, distance: L, point: Vector<L>, t: &[Vector<L>; 2]) -> [L; 3] {
    let inverse = L::splat(1.0) / distance;
    let images = [apply(m, t[0]), apply(m, t[1])];
    let along = [dot(t[0], point), dot(t[1], point)];
    let entry = |i: usize, k: usize| (dot(t[i], images[k]) - along[i] * along[k]) * inverse;
    [entry(0, 0), entry(1, 1), entry(0, 1)]
}

#[cfg(test)]
mod tests;
