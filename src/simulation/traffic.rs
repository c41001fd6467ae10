//! What this rank tells others per step, counted and expected.

use super::Simulation;
use crate::exchange::model::{HaloGeometry, Traffic};

impl Simulation {
    /// Ghosts, messages and bytes per step with the present lists.
    #[must_use]
    pub fn traffic(&self) -> Traffic {
        Traffic {
            ghosts: self.halo.ghosts() as f64,
            messages: self.halo.messages() as f64,
            bytes: self.halo.bytes(self.model.ghosts()) as f64,
        }
    }

    /// What the communication model expects, averaged over ranks; radii count with their mean volume.
    #[must_use]
    pub fn expected_traffic(&self) -> Traffic {
        let particles = self.global.particles as f64;
        let radius = libm::cbrt(0.75 * self.model.solid_volume / (std::f64::consts::PI * particles));
        let geometry = HaloGeometry {
            grid: self.decomposition.grid,
            sides: self.global.sides,
            periodic: self.periodic(),
            margin: radius + self.model.max_radius + self.model.outer_skin(),
            particles,
        };
        geometry.expected(self.model.ghosts().bytes() as f64)
    }
}
