//! How far particles have moved since the contact list was made: as a rule a bound from how fast they are, which needs no
//! look at where they were; shortly before the bound is used up, measured.

use super::leap_frog::StepMotion;

/// What a step looks at to learn how far particles have moved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Watch {
    /// How fast particles are.
    #[default]
    Speeds,
    /// How far particles are from their reference positions.
    Displacements,
}

/// What a step brings back.
#[derive(Debug, Default)]
pub struct StepResult {
    /// Largest squared displacement since the reference positions, relative to the affine motion of the
    /// cell \[m²\]; 0 if it was not measured.
    pub max_displacement_squared: f64,
    /// Largest squared velocity at the half step along each axis \[m²/s²\]; 0 if displacements were measured.
    pub max_velocity_squared: [f64; 3],
    /// Particles that crossed a periodic face, with the number of images per axis.
    pub wrapped: Vec<(u32, [i32; 3])>,
    /// Local index of a particle that left the cell through a wall or is not a number.
    pub lost: Option<u32>,
}

impl StepResult {
    /// A squared displacement above all before, or one that is not a number; gives the largest now.
    #[cold]
    pub(super) fn take_displacement(&mut self, squared: f64, particle: u32) -> f64 {
        if squared.is_nan() {
            self.lost = Some(particle);
        } else {
            self.max_displacement_squared = squared;
        }
        self.max_displacement_squared
    }

    /// Largest squared velocities along each axis of some particles.
    pub(super) fn take_velocities(&mut self, squared: [f64; 3]) {
        for (largest, squared) in self.max_velocity_squared.iter_mut().zip(squared) {
            *largest = if squared > *largest { squared } else { *largest };
        }
    }

    /// Join with what other particles brought.
    pub fn absorb(&mut self, mut other: Self) {
        if other.max_displacement_squared > self.max_displacement_squared {
            self.max_displacement_squared = other.max_displacement_squared;
        }
        self.take_velocities(other.max_velocity_squared);
        self.wrapped.append(&mut other.wrapped);
        self.lost = self.lost.or(other.lost);
    }

    /// The largest displacement since the reference positions if it was measured, otherwise no less than what any
    /// particle's own motion added to it in this step \[m\].
    #[must_use]
    pub fn farthest(&self, motion: &StepMotion) -> f64 {
        if motion.watch == Watch::Displacements {
            return self.max_displacement_squared.sqrt();
        }
        let [x, y, z] = self.max_velocity_squared;
        largest(motion.drift()) * (x + y + z).sqrt()
    }
}

/// A bound on the displacement of every particle of all ranks since the contact list was made, relative to the affine
/// motion of the cell.
#[derive(Debug, Clone, Copy, Default)]
pub struct Displacement {
    /// No particle moved farther \[m\].
    pub bound: f64,
    /// What the last step added \[m\], or half of what the one before did if that is more.
    pub step: f64,
    /// What the next step is to look at.
    pub watch: Watch,
}

impl Displacement {
    /// A step was made. `farthest`: the largest [`StepResult::farthest`] of all ranks.
    ///
    /// With u the displacement, s the factor on positions (1 in BC), λ that on the sides and x₀ − u₀ the place that the
    /// reference position has come to with the cell, a step adds its own motion to `s u₀ + (s − λ)(x₀ − u₀)`.
    pub fn follow(&mut self, motion: &StepMotion, farthest: f64) {
        let before = self.bound;
        self.bound = if motion.watch == Watch::Displacements { farthest } else { self.carried(motion) + farthest };
        let added = self.bound - before;
        self.step = if added > 0.5 * self.step { added } else { 0.5 * self.step };
    }

    /// The bound after a step in which no particle has a motion of its own.
    fn carried(&self, motion: &StepMotion) -> f64 {
        // Particles are inside the cell or at most a radius behind a wall.
        let place = |k: usize| 2.0 * (motion.previous_sides[k] + self.bound);
        let [x, y, z] = [0, 1, 2].map(|k| (motion.scale[k] - motion.sides[k] / motion.previous_sides[k]) * place(k));
        largest(motion.scale) * self.bound + (x * x + y * y + z * z).sqrt()
    }
}

fn largest(values: [f64; 3]) -> f64 {
    values.into_iter().fold(0.0, |largest, value| if value > largest { value } else { largest })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Velocities;
    use crate::force::simd::Simd;

    const SIDES: [f64; 3] = [1.0, 2.0, 0.5];

    fn motion(scale: [f64; 3], previous_sides: [f64; 3], sides: [f64; 3]) -> StepMotion {
        StepMotion {
            previous_time_step: 1e-3,
            time_step: 1e-3,
            gravity: [0.0; 3],
            scale,
            previous_sides,
            sides,
            reference_sides: SIDES,
            face_velocity: [0.0; 3],
            periodic: [true; 3],
            rotation: false,
            ledger: false,
            orientation: false,
            velocities: Velocities::FullStep,
            watch: Watch::Speeds,
            simd: Simd::Scalar,
        }
    }

    /// Bound and largest true displacement after each of some steps of particles in a cell whose sides change by `factor` per step.
    fn follow(affine: bool, factor: [f64; 3], speed: impl Fn(usize, usize, usize) -> f64) -> Vec<[f64; 2]> {
        let places: Vec<[f64; 3]> =
            (0..40).map(|n| [0, 1, 2].map(|k| SIDES[k] * ((n * 37 + k * 11) % 40) as f64 / 39.0)).collect();
        let (mut positions, mut sides) = (places.clone(), SIDES);
        let mut displacement = Displacement::default();
        (0..200)
            .map(|step| {
                let next = [0, 1, 2].map(|k| sides[k] * factor[k]);
                let scale = if affine { [0, 1, 2].map(|k| next[k] / sides[k]) } else { [1.0; 3] };
                let motion = motion(scale, sides, next);
                let (drift, mut result) = (motion.drift(), StepResult::default());
                for (particle, position) in positions.iter_mut().enumerate() {
                    let velocity = [0, 1, 2].map(|k| speed(step, particle, k));
                    *position = [0, 1, 2].map(|k| scale[k] * position[k] + drift[k] * velocity[k]);
                    result.take_velocities(velocity.map(|v| v * v));
                }
                displacement.follow(&motion, result.farthest(&motion));
                sides = next;
                let moved = positions.iter().zip(&places).map(|(now, then)| {
                    let moved = [0, 1, 2].map(|k| now[k] - sides[k] / SIDES[k] * then[k]);
                    (moved[0] * moved[0] + moved[1] * moved[1] + moved[2] * moved[2]).sqrt()
                });
                [displacement.bound, moved.fold(0.0, f64::max)]
            })
            .collect()
    }

    #[test]
    fn nobody_moves_farther_than_the_bound_in_cells_that_shrink_and_grow() {
        let speed =
            |step: usize, particle: usize, k: usize| ((step * 7 + particle * 13 + k * 5) % 17) as f64 / 17.0 - 0.3;
        for affine in [true, false] {
            for factor in [[1.0, 1.0, 1.0], [0.9995, 1.0, 1.0002], [1.001, 0.999, 1.0005]] {
                for [bound, moved] in follow(affine, factor, speed) {
                    assert!(moved > 0.0 && moved <= bound * (1.0 + 1e-12), "{affine} {factor:?}: {moved} {bound}");
                }
            }
        }
    }

    #[test]
    fn the_bound_of_one_that_moves_straight_ahead_is_what_it_moved() {
        let ahead = |_: usize, particle: usize, k: usize| if particle == 3 && k == 1 { 0.2 } else { 0.0 };
        for [bound, moved] in follow(true, [1.0; 3], ahead) {
            assert!((bound / moved - 1.0).abs() < 1e-9, "{bound} {moved}");
        }
    }

    #[test]
    fn a_measured_step_replaces_the_bound() {
        let motion = StepMotion { watch: Watch::Displacements, ..motion([1.0; 3], SIDES, SIDES) };
        let mut result = StepResult::default();
        result.take_displacement(4e-6, 0);
        let mut displacement = Displacement { bound: 0.5, step: 1e-3, watch: motion.watch };
        displacement.follow(&motion, result.farthest(&motion));
        assert!((displacement.bound - 2e-3).abs() < 1e-15 && displacement.step == 5e-4);
    }
}
