//! Energy of the cell's motion where velocities are absolute (BC).
//!
//! Kinetic energy is that of peculiar velocities, while a particle that goes through a moving face changes its absolute
//! one. Ledgers therefore keep the work that changes the energy of absolute velocities (contacts with moved images, see
//! [`crate::force::pass`], and crossings), beginning with the [`affine_energy`] of the first state; the history shows it
//! less the affine energy of the present one, which leaves the work that changes the energy of peculiar velocities.

use super::Simulation;

/// Kinetic energy with the absolute velocity v less that with the peculiar one `v − Gx`, `m (v·Gx − ½ |Gx|²)` \[J\].
///
/// `mass` \[kg\], `velocity` v \[m/s\], `position` x \[m\], `gradient` the diagonal of G, `L̇/L` per axis \[1/s\].
#[must_use]
pub fn affine_energy(mass: f64, velocity: [f64; 3], position: [f64; 3], gradient: [f64; 3]) -> f64 {
    let parts: [f64; 3] = std::array::from_fn(|k| {
        let affine = gradient[k] * position[k];
        affine * (velocity[k] - 0.5 * affine)
    });
    mass * (parts[0] + parts[1] + parts[2])
}

impl Simulation {
    /// L̇/L where velocities are absolute (BC), zero where they are peculiar (BCT).
    pub(super) fn peculiar_gradient(&self) -> [f64; 3] {
        let motion = self.cell_motion();
        // BC carries the cell's motion in the shift velocity: one image per side length.
        let per_image = motion.wall_velocity;
        [0, 1, 2].map(|k| per_image[k] / motion.sides[k])
    }

    /// Put into the ledgers the kinetic energy that particles gained by crossing faces that move so fast \[m/s\]: at the
    /// half step, as the work of contacts at the new positions is already that with the new images and velocities.
    pub(super) fn account_for_crossings(&mut self, crossed: &[(u32, [i32; 3])], face_velocity: [f64; 3]) {
        if !self.model.config.output.energy_ledger || face_velocity == [0.0; 3] {
            return;
        }
        for (particle, images) in crossed {
            let index = *particle as usize;
            let [(velocity, _), _] = self.particles.velocities(index);
            let gains: [f64; 3] = std::array::from_fn(|k| {
                let change = f64::from(images[k]) * face_velocity[k];
                -change * (velocity[k] + 0.5 * change)
            });
            self.particles.ledger[index][0] += self.mass(index) * (gains[0] + gains[1] + gains[2]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::affine_energy;

    #[test]
    fn absolute_less_peculiar_energy() {
        let (mass, velocity, position, gradient) = (2.0, [3.0, -1.0, 0.5], [0.5, 2.0, 1.0], [-0.25, 0.0, 4.0]);
        let energy = |v: [f64; 3]| 0.5 * mass * v.iter().map(|v| v * v).sum::<f64>();
        let peculiar = std::array::from_fn(|k| velocity[k] - gradient[k] * position[k]);
        let expected = energy(velocity) - energy(peculiar);
        assert!((affine_energy(mass, velocity, position, gradient) - expected).abs() < 1e-12, "{expected}");
        assert_eq!(affine_energy(mass, velocity, position, [0.0; 3]), 0.0);
    }
}
