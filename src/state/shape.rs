//! Size, orientation and inertia of ellipsoids; a sphere is one with three equal semi-axes. Must not know
//! of contacts.

use bytemuck::{Pod, Zeroable};
use std::f64::consts::PI;
use std::ops::{Add, Div, Mul, Sub};

/// What the functions of rotation compute with: an `f64`, or several side by side ([`crate::force::lane::Lane`]).
pub trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// A constant.
    fn number(value: f64) -> Self;
    /// Square root.
    #[must_use]
    fn root(self) -> Self;
}

/// What the contact pass reads of an ellipsoid beside its [`super::particles::Record`]: one cache line.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct Shape {
    /// Semi-axes along the body's x, y, z \[m\].
    pub semi_axes: [f64; 3],
    /// Radius r̂ of the sphere of equal volume, `∛(a b c)` \[m\]: kept so that no contact takes a root for it.
    pub mean_radius: f64,
    /// Unit quaternion (w, x, y, z) that turns the body's axes into those of space.
    pub orientation: [f64; 4],
}

impl Shape {
    /// From semi-axes \[m\] and orientation.
    #[must_use]
    pub fn new(semi_axes: [f64; 3], orientation: [f64; 4]) -> Self {
        let [a, b, c] = semi_axes;
        Self { semi_axes, mean_radius: libm::cbrt(a * b * c), orientation }
    }
}

/// The orientation in which the body's axes are those of space.
pub const UPRIGHT: [f64; 4] = [1.0, 0.0, 0.0, 0.0];

/// Volume, `V = (4/3) π a b c` \[m³\].
#[must_use]
pub fn ellipsoid_volume(semi_axes: [f64; 3]) -> f64 {
    ellipsoid_mass(semi_axes, 1.0)
}

/// Mass, `m = (4/3) π a b c ρ` \[kg\]; for three equal semi-axes the bits of
/// [`super::particles::sphere_mass`].
#[must_use]
pub fn ellipsoid_mass(semi_axes: [f64; 3], density: f64) -> f64 {
    let [a, b, c] = semi_axes;
    4.0 / 3.0 * PI * a * b * c * density
}

/// Principal moments of inertia about the body's x, y, z: `I_x = m (b² + c²)/5` and so on \[kg m²\].
#[inline(always)]
#[must_use]
pub fn principal_moments<T: Number>(mass: T, semi_axes: [T; 3]) -> [T; 3] {
    let [a, b, c] = semi_axes;
    let (x, y, z, share) = (a * a, b * b, c * c, T::number(0.2) * mass);
    [share * (y + z), share * (z + x), share * (x + y)]
}

/// Whether the semi-axes are those of a sphere.
#[must_use]
pub fn is_sphere(semi_axes: [f64; 3]) -> bool {
    semi_axes[0] == semi_axes[1] && semi_axes[1] == semi_axes[2]
}

/// The largest semi-axis: the radius of the sphere around the body \[m\].
#[must_use]
pub fn bounding_radius(semi_axes: [f64; 3]) -> f64 {
    semi_axes.into_iter().fold(0.0, |largest, axis| if axis > largest { axis } else { largest })
}

/// The smallest semi-axis \[m\].
#[must_use]
pub fn smallest_semi_axis(semi_axes: [f64; 3]) -> f64 {
    semi_axes.into_iter().fold(f64::INFINITY, |least, axis| if axis < least { axis } else { least })
}

/// Rotation matrix of a unit quaternion, rows first: column k is the body's axis k in space, so that
/// `x_space = R x_body`.
#[inline(always)]
#[must_use]
pub fn rotation_matrix<T: Number>(orientation: [T; 4]) -> [[T; 3]; 3] {
    let [w, x, y, z] = orientation;
    let one = T::number(1.0);
    // The length is 1 but for rounding; without it momenta that turn to and fro drift.
    let two = T::number(2.0) / (w * w + x * x + y * y + z * z);
    [
        [one - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y)],
        [two * (x * y + w * z), one - two * (x * x + z * z), two * (y * z - w * x)],
        [two * (x * z - w * y), two * (y * z + w * x), one - two * (x * x + y * y)],
    ]
}

/// Components in space of a vector given along the body's axes, `R v`.
#[inline(always)]
#[must_use]
pub fn to_space<T: Number>([x, y, z]: &[[T; 3]; 3], v: [T; 3]) -> [T; 3] {
    [
        x[0] * v[0] + x[1] * v[1] + x[2] * v[2],
        y[0] * v[0] + y[1] * v[1] + y[2] * v[2],
        z[0] * v[0] + z[1] * v[1] + z[2] * v[2],
    ]
}

/// Components along the body's axes of a vector given in space, `Rᵀ v`.
#[inline(always)]
#[must_use]
pub fn to_body<T: Number>([x, y, z]: &[[T; 3]; 3], v: [T; 3]) -> [T; 3] {
    [
        x[0] * v[0] + y[0] * v[1] + z[0] * v[2],
        x[1] * v[0] + y[1] * v[1] + z[1] * v[2],
        x[2] * v[0] + y[2] * v[1] + z[2] * v[2],
    ]
}

/// Product of quaternions: turn by `q`, then by `p`, as seen from space.
#[inline(always)]
#[must_use]
pub fn product<T: Number>(p: [T; 4], q: [T; 4]) -> [T; 4] {
    [
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    ]
}

/// The same orientation with unit length.
#[inline(always)]
#[must_use]
pub fn normalised<T: Number>([w, x, y, z]: [T; 4]) -> [T; 4] {
    let norm = (w * w + x * x + y * y + z * z).root();
    [w / norm, x / norm, y / norm, z / norm]
}

/// Rotational energy `½ ω·I ω` of a body that spins with ω \[rad/s\] (components in space) \[J\].
#[must_use]
pub fn rotational_energy(mass: f64, shape: &Shape, spin: [f64; 3]) -> f64 {
    let moments = principal_moments(mass, shape.semi_axes);
    let body = to_body(&rotation_matrix(shape.orientation), spin);
    0.5 * (moments[0] * (body[0] * body[0]) + moments[1] * (body[1] * body[1]) + moments[2] * (body[2] * body[2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::particles::sphere_mass;

    #[test]
    fn a_sphere_has_the_mass_and_inertia_of_a_sphere() {
        let (radius, density) = (0.37e-6, 4750.0);
        let mass = ellipsoid_mass([radius; 3], density);
        assert_eq!(mass.to_bits(), sphere_mass(radius, density).to_bits());
        for moment in principal_moments(mass, [radius; 3]) {
            assert!((moment / (0.4 * mass * radius * radius) - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn a_quarter_turn_about_z_takes_the_bodys_x_to_the_y_of_space() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let rotation = rotation_matrix([half, 0.0, 0.0, half]);
        let turned = to_space(&rotation, [1.0, 0.0, 0.0]);
        assert!(turned.iter().zip([0.0, 1.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-15), "{turned:?}");
        assert_eq!(to_body(&rotation, turned).map(|c| (c * 1e9).round()), [1e9, 0.0, 0.0]);
    }

    #[test]
    fn a_product_turns_by_the_right_factor_first() {
        let p = normalised([0.3, -0.5, 0.7, 0.2]);
        let q = normalised([0.9, 0.1, -0.4, 0.6]);
        let v = [0.2, -1.3, 0.8];
        let both = to_space(&rotation_matrix(product(p, q)), v);
        let one_by_one = to_space(&rotation_matrix(p), to_space(&rotation_matrix(q), v));
        assert!(both.iter().zip(one_by_one).all(|(a, b)| (a - b).abs() < 1e-14), "{both:?} {one_by_one:?}");
    }

    #[test]
    fn energy_follows_the_body() {
        // Long axis along x of space after a quarter turn about z of a body long in y.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let shape = Shape::new([1.0, 3.0, 1.0], [half, 0.0, 0.0, half]);
        assert!((rotational_energy(5.0, &shape, [2.0, 0.0, 0.0]) - 0.5 * 2.0 * 4.0).abs() < 1e-12);
        assert!((rotational_energy(5.0, &shape, [0.0, 2.0, 0.0]) - 0.5 * 10.0 * 4.0).abs() < 1e-12);
    }
}
