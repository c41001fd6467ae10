//! Random particles that every rank can compute for itself.

use dem_mpi::config::Velocities;
use dem_mpi::exchange::{Communicator, Decomposition, MigrationSetting};
use dem_mpi::state::ParticleState;
use dem_mpi::state::particles::{Extras, SpeciesConstants};

pub const SPECIES: [SpeciesConstants; 2] =
    [SpeciesConstants { density: 1000.0, driven: false }, SpeciesConstants { density: 2500.0, driven: true }];
pub const ALL: Extras = Extras { orientation: false, ellipsoids: true, ledger: true, velocities: Velocities::FullStep };

/// A number in 0 … 1 that depends on its keys alone.
pub fn random(keys: [u64; 3]) -> f64 {
    let mut state = 0_u64;
    for key in keys {
        // splitmix64
        state = state.wrapping_add(key).wrapping_add(0x9e37_79b9_7f4a_7c15);
        state = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        state = (state ^ state >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        state ^= state >> 31;
    }
    (state >> 11) as f64 / (1_u64 << 53) as f64
}

/// A cell with particles.
#[derive(Debug, Clone, Copy)]
pub struct Scene {
    pub particles: u32,
    pub sides: [f64; 3],
    pub periodic: [bool; 3],
    pub max_radius: f64,
    pub skin: f64,
}

impl Scene {
    /// Particle `id` at `time`; its position is new at each time.
    pub fn state(&self, id: u32, time: u64) -> ParticleState {
        let draw = |what: u64| random([u64::from(id), time, what]);
        let vector = |start: u64| [0, 1, 2].map(|k| draw(start + k) - 0.5);
        let position = [0, 1, 2].map(|k| {
            if self.periodic[k] {
                draw(k as u64) * self.sides[k]
            } else {
                (draw(k as u64) * 1.1 - 0.05) * self.sides[k]
            }
        });
        let radius = self.max_radius * (0.5 + 0.5 * random([u64::from(id), 0, 99]));
        ParticleState {
            id,
            species: id % 2,
            position,
            radius,
            semi_axes: [radius, radius * random([u64::from(id), 0, 98]), radius * random([u64::from(id), 0, 97])],
            velocity: vector(10),
            full_velocity: vector(20),
            spin: vector(30),
            full_spin: vector(40),
            orientation: [1.0, draw(50), draw(51), draw(52)],
            ledger: [0, 1, 2, 3, 4, 5, 6].map(|k| draw(60 + k)),
            image: [0, 1, 2].map(|k| (draw(70 + k) * 3.0) as i32 - 1),
            reserved: 0,
        }
    }

    /// The states that this rank passes to the initial distribution.
    pub fn share(&self, comm: &Communicator, time: u64) -> Vec<ParticleState> {
        let mine = |id: &u32| (*id as usize * 7 + 3) % comm.size() == comm.rank();
        (0..self.particles).filter(mine).map(|id| self.state(id, time)).collect()
    }

    pub fn setting<'a>(&self, decomposition: &'a Decomposition) -> MigrationSetting<'a> {
        MigrationSetting {
            decomposition,
            species: &SPECIES,
            sides: self.sides,
            extras: ALL,
            particles_total: u64::from(self.particles),
            step: 0,
        }
    }

    /// The automatic grid, and slabs along each axis: as thin as can be.
    pub fn grids(&self, ranks: usize) -> [Decomposition; 4] {
        let automatic = Decomposition::automatic(ranks, u64::from(self.particles), 0, self.sides);
        assert_eq!(automatic.ranks(), ranks);
        let slabs = [[ranks, 1, 1], [1, ranks, 1], [1, 1, ranks]];
        let [x, y, z] = slabs.map(|grid| Decomposition::explicit(grid, ranks).expect("a grid that fits"));
        [automatic, x, y, z]
    }
}

/// Thick boxes; slabs thinner than the reach; a periodic cell of about one diameter; walls on two axes.
pub const SCENES: [Scene; 4] = [
    Scene { particles: 600, sides: [1.0, 1.2, 0.8], periodic: [true; 3], max_radius: 0.02, skin: 0.01 },
    Scene { particles: 150, sides: [1.0, 0.5, 0.6], periodic: [true; 3], max_radius: 0.11, skin: 0.03 },
    Scene { particles: 9, sides: [1.0, 1.1, 0.7], periodic: [true; 3], max_radius: 0.5, skin: 0.3 },
    Scene { particles: 300, sides: [1.0, 2.0, 1.0], periodic: [false, true, false], max_radius: 0.06, skin: 0.02 },
];
