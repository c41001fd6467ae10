//! Rotation of ellipsoids in step with the leap-frog motion of their centres. Must not know where the
//! torque comes from.

use crate::state::shape::{Number, normalised, principal_moments, product, rotation_matrix, to_body, to_space};

/// Times of one step.
#[derive(Debug, Clone, Copy)]
pub struct Rotation {
    /// From the last half step to the next one \[s\].
    pub kick: f64,
    /// From the present orientation to the next one \[s\].
    pub time_step: f64,
}

/// Ellipsoids as they turn, one or several side by side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body<T> {
    /// Semi-axes along the body's x, y, z \[m\].
    pub semi_axes: [T; 3],
    /// 1/m \[1/kg\], not 0.
    pub inverse_mass: T,
    /// Unit quaternion (w, x, y, z), body to space.
    pub orientation: [T; 4],
    /// Angular velocity of the last half step \[rad/s\].
    pub spin: [T; 3],
    /// Torque about the centre \[N m\].
    pub torque: [T; 3],
}

/// Angular velocities after a step \[rad/s\], components in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spins<T> {
    /// Of the half step passed.
    pub half: [T; 3],
    /// At the full step reached, extrapolated with the last torque as W (2.3) does for velocities.
    pub full: [T; 3],
}

impl Rotation {
    /// Turn a free ellipsoid by one step: its new orientation and angular velocities.
    ///
    /// ```text
    /// L(t+Δt/2) = L(t−Δt/2) + kick T(t)            angular momentum, components in space
    /// dL_b/dt = L_b × I_b⁻¹ L_b, dq/dt = ½ q ω_b   Euler's equations and orientation, T = 0, over Δt
    /// ```
    ///
    /// T \[N m\] torque about the centre, I_b \[kg m²\] the principal moments, q the orientation (body to
    /// space), ω_b = I_b⁻¹ L_b. The spin of the last half step is expressed as
    /// `I(q)⁻¹ L(t−Δt/2)` with the present orientation; so is the one returned, with the new orientation.
    /// For three equal semi-axes this is the leap-frog of spheres.
    ///
    /// The free rotation is split into turns about the body's axes x, y, z, y, x; L stays as it is in space
    /// and q is multiplied by the quaternion of each turn. The scheme is symplectic and symmetric in time:
    /// second order, energy without drift, L and the length of q kept to rounding.
    ///
    /// # Source
    /// Multiplication of quaternions instead of an integration of their components: Zhao, van Wachem 2013
    /// (doi:10.1007/s00707-013-0914-2); the splitting: Dullweber, Leimkuhler, McLachlan 1997
    /// (doi:10.1063/1.474310).
    #[inline(always)]
    #[must_use]
    pub fn advance<T: Number>(&self, body: &Body<T>) -> ([T; 4], Spins<T>) {
        // All per mass: the numbers stay far from underflow for small particles.
        let moments = principal_moments(T::number(1.0), body.semi_axes);
        let acceleration = scaled(body.torque, body.inverse_mass);
        let rotation = rotation_matrix(body.orientation);
        let [x, y, z] = to_body(&rotation, body.spin);
        let before = to_space(&rotation, [moments[0] * x, moments[1] * y, moments[2] * z]);
        let momentum = kicked(before, acceleration, self.kick);

        let turn = free_turn(to_body(&rotation, momentum), moments, T::number(self.time_step));
        let orientation = normalised(product(body.orientation, turn));

        let rotation = rotation_matrix(orientation);
        let half = spin_of(momentum, &rotation, moments);
        let full = spin_of(kicked(momentum, acceleration, 0.5 * self.time_step), &rotation, moments);
        (orientation, Spins { half, full })
    }

    /// Orientation of a body after a step at a prescribed angular velocity \[rad/s\], constant in space.
    #[inline]
    #[must_use]
    pub fn advance_driven(&self, orientation: [f64; 4], spin: [f64; 3]) -> [f64; 4] {
        let speed = (spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2]).sqrt();
        if speed > 0.0 {
            let [w, along] = half_angle(speed * self.time_step);
            let [x, y, z] = spin.map(|component| along * (component / speed));
            normalised(product([w, x, y, z], orientation))
        } else {
            orientation
        }
    }
}

#[inline(always)]
fn scaled<T: Number>([x, y, z]: [T; 3], factor: T) -> [T; 3] {
    [x * factor, y * factor, z * factor]
}

/// Momentum after a time under an acceleration.
#[inline(always)]
fn kicked<T: Number>([x, y, z]: [T; 3], acceleration: [T; 3], time: f64) -> [T; 3] {
    let kick = T::number(time);
    [x + kick * acceleration[0], y + kick * acceleration[1], z + kick * acceleration[2]]
}

/// Angular velocity of a momentum, both in space.
#[inline(always)]
fn spin_of<T: Number>(momentum: [T; 3], rotation: &[[T; 3]; 3], moments: [T; 3]) -> [T; 3] {
    let [x, y, z] = to_body(rotation, momentum);
    to_space(rotation, [x / moments[0], y / moments[1], z / moments[2]])
}

/// The turn of a free body over a time, as a quaternion in the body's axes, from its angular momentum in
/// them and its principal moments.
#[inline(always)]
fn free_turn<T: Number>(momentum: [T; 3], moments: [T; 3], time: T) -> [T; 4] {
    let mut momentum = momentum;
    let (zero, one) = (T::number(0.0), T::number(1.0));
    let mut turn = [one, zero, zero, zero];
    let times = [time / moments[0], time / moments[1], time / moments[2]];
    for (axis, share) in [(0, 0.5), (1, 0.5), (2, 1.0), (1, 0.5), (0, 0.5)] {
        let [cos, sin] = half_angle(T::number(share) * momentum[axis] * times[axis]);
        let mut part = [cos, zero, zero, zero];
        part[1 + axis] = sin;
        turn = product(turn, part);
        // The momentum stands still in space: in the body's axes it turns back.
        let (c, s) = (cos * cos - sin * sin, T::number(2.0) * sin * cos);
        let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
        let [p, q] = [momentum[next], momentum[last]];
        momentum[next] = c * p + s * q;
        momentum[last] = c * q - s * p;
    }
    turn
}

/// Cosine and sine of half an angle, from the tangent of its quarter to the third order: exactly on the
/// unit circle, the angle to the fifth order. A turn about one axis by any odd function of the momentum
/// along that axis leaves the scheme symplectic and symmetric.
#[inline(always)]
fn half_angle<T: Number>(angle: T) -> [T; 2] {
    let one = T::number(1.0);
    let quarter = T::number(0.25) * angle;
    let tangent = quarter + quarter * quarter * quarter * T::number(1.0 / 3.0);
    let square = tangent * tangent;
    let inverse = one / (one + square);
    [(one - square) * inverse, T::number(2.0) * tangent * inverse]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::shape::{Shape, UPRIGHT, rotational_energy};

    const MASS: f64 = 5.0;

    fn body(semi_axes: [f64; 3]) -> Shape {
        Shape::new(semi_axes, UPRIGHT)
    }

    fn angular_momentum(shape: &Shape, spin: [f64; 3]) -> [f64; 3] {
        let rotation = rotation_matrix(shape.orientation);
        let moments = principal_moments(MASS, shape.semi_axes);
        let body = to_body(&rotation, spin);
        to_space(&rotation, [0, 1, 2].map(|k| moments[k] * body[k]))
    }

    impl Rotation {
        fn turn(&self, shape: &mut Shape, spin: [f64; 3], torque: [f64; 3]) -> Spins<f64> {
            let Shape { semi_axes, orientation, .. } = *shape;
            let (orientation, spins) =
                self.advance(&Body { semi_axes, inverse_mass: 1.0 / MASS, orientation, spin, torque });
            shape.orientation = orientation;
            spins
        }
    }

    /// A free body after `steps` steps.
    fn free(semi_axes: [f64; 3], spin: [f64; 3], time: f64, steps: u32) -> (Shape, [f64; 3]) {
        let step = Rotation { kick: 0.0, time_step: time / f64::from(steps) };
        let (mut shape, mut spin) = (body(semi_axes), spin);
        for _ in 0..steps {
            spin = step.turn(&mut shape, spin, [0.0; 3]).half;
        }
        (shape, spin)
    }

    /// sn, cn, dn of the parameter m = k² by the arithmetic-geometric mean (Abramowitz and Stegun 16.4).
    fn jacobi(u: f64, m: f64) -> [f64; 3] {
        let mut means = vec![(1.0, m.sqrt())];
        let mut b = (1.0 - m).sqrt();
        while let Some(&(a, c)) = means.last().filter(|(_, c)| *c > 1e-15) {
            let _ = c;
            means.push((0.5 * (a + b), 0.5 * (a - b)));
            b = (a * b).sqrt();
        }
        let levels = means.len() - 1;
        let mut phase = means[levels].0 * u * f64::from(1_u32 << levels);
        for (a, c) in means[1..].iter().rev() {
            phase = 0.5 * (phase + libm::asin(c / a * libm::sin(phase)));
        }
        let (sn, cn) = (libm::sin(phase), libm::cos(phase));
        [sn, cn, (1.0 - m * sn * sn).sqrt()]
    }

    /// Spin along the axes of a free body with moments I₁ < I₂ < I₃, from (ω₁, 0, ω₃) at time 0 and
    /// L² > 2 E I₂ (Landau and Lifshitz, Mechanics, §37).
    fn euler_top(moments: [f64; 3], start: [f64; 2], time: f64) -> [f64; 3] {
        let [i1, i2, i3] = moments;
        let twice_energy = i1 * start[0] * start[0] + i3 * start[1] * start[1];
        let momentum = (i1 * start[0]) * (i1 * start[0]) + (i3 * start[1]) * (i3 * start[1]);
        let (low, high) = (twice_energy * i3 - momentum, momentum - twice_energy * i1);
        let u = time * ((i3 - i2) * high / (i1 * i2 * i3)).sqrt();
        let [sn, cn, dn] = jacobi(u, (i2 - i1) * low / ((i3 - i2) * high));
        [
            (low / (i1 * (i3 - i1))).sqrt() * cn,
            (low / (i2 * (i3 - i2))).sqrt() * sn,
            (high / (i3 * (i3 - i1))).sqrt() * dn,
        ]
    }

    fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
        [0, 1, 2].map(|k| (a[k] - b[k]) * (a[k] - b[k])).iter().sum::<f64>().sqrt()
    }

    #[test]
    fn a_tri_axial_top_follows_eulers_solution_to_second_order() {
        let (axes, start, time) = ([3.0, 2.0, 1.0], [0.7, 1.1], 20.0);
        let expected = euler_top(principal_moments(MASS, axes), start, time);
        let error = |steps| {
            let (shape, spin) = free(axes, [start[0], 0.0, start[1]], time, steps);
            distance(to_body(&rotation_matrix(shape.orientation), spin), expected)
        };
        let [coarse, middle, fine] = [1000, 2000, 4000].map(error);
        assert!(fine < 1e-4, "{fine}");
        for ratio in [coarse / middle, middle / fine] {
            assert!((3.8..4.2).contains(&ratio), "second order: {coarse} {middle} {fine}");
        }
    }

    #[test]
    fn the_axis_of_a_symmetric_top_precesses_about_its_angular_momentum() {
        // About L at the rate |L|/I₁, whatever the spin about the axis itself.
        let (axes, spin, time) = ([1.0, 1.0, 2.0], [0.6, 0.0, 0.9], 7.0);
        let momentum = angular_momentum(&body(axes), spin);
        let length = distance(momentum, [0.0; 3]);
        let [x, y, z] = momentum.map(|component| component / length);
        let angle = length / principal_moments(MASS, axes)[0] * time;
        let (c, s) = (libm::cos(angle), libm::sin(angle));
        let expected = [z * x * (1.0 - c) + y * s, z * y * (1.0 - c) - x * s, c + z * z * (1.0 - c)];
        let error = |steps| {
            let (shape, _) = free(axes, spin, time, steps);
            distance(to_space(&rotation_matrix(shape.orientation), [0.0, 0.0, 1.0]), expected)
        };
        let [coarse, fine] = [400, 800].map(error);
        assert!(fine < 1e-4 && (3.8..4.2).contains(&(coarse / fine)), "{coarse} {fine}");
    }

    #[test]
    fn a_million_steps_leave_no_drift() {
        // About the middle axis, where rotation is unstable: the body tumbles over and over.
        let (axes, spin) = ([1.25, 1.0, 0.8], [0.01, 0.02, 1.0]);
        let axes = [axes[0], axes[2], axes[1]];
        let step = Rotation { kick: 0.0, time_step: 0.02 };
        let (mut shape, mut now) = (body(axes), spin);
        let (energy, momentum) = (rotational_energy(MASS, &shape, spin), angular_momentum(&shape, spin));
        let mut largest = [0.0_f64; 2];
        for count in 0..1_000_000_u32 {
            now = step.turn(&mut shape, now, [0.0; 3]).half;
            let late = usize::from(count >= 500_000);
            largest[late] = largest[late].max((rotational_energy(MASS, &shape, now) / energy - 1.0).abs());
        }
        assert!(largest[0] < 2e-5, "energy: {largest:?}");
        assert!((largest[1] / largest[0] - 1.0).abs() < 1e-3, "the error of the energy grows: {largest:?}");
        let moved = distance(angular_momentum(&shape, now), momentum) / distance(momentum, [0.0; 3]);
        // Rounding alone: some 1e-16 per step after a million steps.
        assert!(moved < 2e-10, "angular momentum: {moved:e}");
        let square: f64 = shape.orientation.iter().map(|c| c * c).sum();
        assert!((square - 1.0).abs() < 4.0 * f64::EPSILON, "{square}");
    }

    #[test]
    fn the_energy_error_is_of_second_order() {
        let (axes, spin) = ([3.0, 2.0, 1.0], [0.7, 0.3, 1.1]);
        let energy = rotational_energy(MASS, &body(axes), spin);
        let error = |steps: u32| {
            let step = Rotation { kick: 0.0, time_step: 30.0 / f64::from(steps) };
            let (mut shape, mut now, mut largest) = (body(axes), spin, 0.0_f64);
            for _ in 0..steps {
                now = step.turn(&mut shape, now, [0.0; 3]).half;
                largest = largest.max((rotational_energy(MASS, &shape, now) / energy - 1.0).abs());
            }
            largest
        };
        let [coarse, fine] = [1000, 4000].map(error);
        assert!((14.0..18.0).contains(&(coarse / fine)), "{coarse} {fine}");
    }

    #[test]
    fn a_torque_changes_the_angular_momentum_at_its_rate() {
        let step = Rotation { kick: 0.01, time_step: 0.01 };
        let (mut shape, torque) = (body([3.0, 2.0, 1.0]), [1.0, -2.0, 0.5]);
        let mut spins = Spins { half: [0.0; 3], full: [0.0; 3] };
        for _ in 0..200 {
            spins = step.turn(&mut shape, spins.half, torque);
        }
        let expected = torque.map(|component| 2.0 * component);
        assert!(distance(angular_momentum(&shape, spins.half), expected) < 1e-13);
        let full = torque.map(|component| 2.005 * component);
        assert!(distance(angular_momentum(&shape, spins.full), full) < 1e-13);
    }

    #[test]
    fn a_driven_body_turns_by_the_prescribed_angle() {
        let step = Rotation { kick: 0.0, time_step: 1e-3 };
        let mut shape = body([3.0, 2.0, 1.0]);
        for _ in 0..1000 {
            shape.orientation = step.advance_driven(shape.orientation, [0.0, 0.3, 0.4]);
        }
        let [w, s] = [libm::cos(0.25), libm::sin(0.25)];
        let expected = [w, 0.0, 0.6 * s, 0.8 * s];
        assert!(shape.orientation.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-13), "{:?}", shape.orientation);
    }
}
