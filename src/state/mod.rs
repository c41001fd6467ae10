//! What a particle and a contact are: the data that migration, checkpoint and digest carry.

pub mod particles;
pub mod shape;

use bytemuck::{Pod, Zeroable};

/// Everything that one particle is, as it travels between ranks and into checkpoints.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ParticleState {
    /// Global id, 0 … N−1.
    pub id: u32,
    /// Index into [`crate::config::Config::species`].
    pub species: u32,
    /// Position, wrapped into the cell \[m\].
    pub position: [f64; 3],
    /// Radius of a sphere, largest semi-axis of an ellipsoid \[m\].
    pub radius: f64,
    /// Semi-axes along the body's x, y, z \[m\]; the radius three times for a sphere.
    pub semi_axes: [f64; 3],
    /// Velocity at the last half step \[m/s\].
    pub velocity: [f64; 3],
    /// Velocity at the full step, extrapolated with the last acceleration, W (2.3) \[m/s\].
    pub full_velocity: [f64; 3],
    /// Angular velocity at the last half step \[rad/s\]. Of an ellipsoid: what the angular momentum of that
    /// half step gives in the present orientation.
    pub spin: [f64; 3],
    /// Angular velocity at the full step \[rad/s\].
    pub full_spin: [f64; 3],
    /// Orientation, unit quaternion (w, x, y, z); from body to space; (1, 0, 0, 0) where
    /// orientations are not followed.
    pub orientation: [f64; 4],
    /// Energy ledger of this particle \[J\], see [`LEDGER`]; zero when the ledger is off.
    pub ledger: [f64; LEDGER.len()],
    /// Periodic images crossed since the start, per axis.
    pub image: [i32; 3],
    /// Keeps the layout free of hidden padding; zero.
    pub reserved: i32,
}

/// Names of the entries of [`ParticleState::ledger`]: energy put in by the cell, by gravity and by
/// driven particles or walls, and energy dissipated by each cause \[J\].
pub const LEDGER: [&str; 7] = ["work_cell", "work_body", "work_driven", "damping", "viscous", "friction", "plastic"];

/// Identity of a contact: the pair of global ids, low first, and the integer image shift S of the
/// high one, d = x_high + S·L − x_low. Walls have ids N, N+1, … and shift 0. For own-image contacts
/// `low == high` and S is lexicographically positive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
#[repr(C)]
pub struct ContactKey {
    /// Lower global id.
    pub low: u32,
    /// Higher global id.
    pub high: u32,
    /// Image shift; the fourth entry is zero.
    pub shift: [i32; 4],
}

/// Contact memory apart from any list: keys and rows of equal width (the widest law's; narrower
/// ones leave trailing zeros).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ContactMemory {
    /// Identity of each row.
    pub keys: Vec<ContactKey>,
    /// Numbers per row.
    pub width: usize,
    /// Row-major values, `keys.len() × width`.
    pub values: Vec<f64>,
}

impl ContactMemory {
    /// An empty store with this row width.
    #[must_use]
    pub fn new(width: usize) -> Self {
        Self { keys: Vec::new(), width, values: Vec::new() }
    }

    /// Append one row.
    pub fn push(&mut self, key: ContactKey, row: &[f64]) {
        debug_assert_eq!(row.len(), self.width);
        self.keys.push(key);
        self.values.extend_from_slice(row);
    }

    /// Sorted by key, with equal keys (copies of one contact) once.
    #[must_use]
    pub fn sorted_without_copies(&self) -> Self {
        let mut order: Vec<u32> = (0..self.keys.len() as u32).collect();
        order.sort_unstable_by_key(|row| self.keys[*row as usize]);
        order.dedup_by_key(|row| self.keys[*row as usize]);
        let mut sorted = Self::new(self.width);
        for row in order {
            sorted.push(self.keys[row as usize], self.row(row as usize));
        }
        sorted
    }

    /// Row `index`.
    #[must_use]
    pub fn row(&self, index: usize) -> &[f64] {
        &self.values[index * self.width..(index + 1) * self.width]
    }
}

/// Global state beside particles and contacts; part of checkpoint and digest. JSON in the checkpoint.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct GlobalState {
    /// Steps done.
    pub step: u64,
    /// Time \[s\].
    pub time: f64,
    /// Current time step \[s\].
    pub time_step: f64,
    /// Time step of the previous step \[s\] (leap-frog with changing Δt needs both).
    pub previous_time_step: f64,
    /// Cell sides at time 0 \[m\].
    pub initial_sides: [f64; 3],
    /// Cell sides \[m\].
    pub sides: [f64; 3],
    /// Nominal strain per axis, compression positive.
    pub strain: [f64; 3],
    /// Strain rate in force per axis \[1/s\].
    pub strain_rate: [f64; 3],
    /// Index of the current stage.
    pub stage: usize,
    /// Time at which the current stage began \[s\].
    pub stage_start_time: f64,
    /// Strain at which the current stage began.
    pub stage_start_strain: [f64; 3],
    /// Step at which the current stage began.
    pub stage_start_step: u64,
    /// Stress measured before the first step of the current stage \[Pa\].
    pub stage_start_stress: [f64; 3],
    /// Number of history rows written.
    pub history_rows: u64,
    /// Number of snapshots written.
    pub snapshots: u64,
    /// Last measured stress per axis \[Pa\] (servo and end conditions).
    pub measured_stress: [f64; 3],
    /// Number of particles.
    pub particles: u64,
    /// Progress of the quasi-static routine; absent until a quasi-static stage begins.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quasi_static: Option<QuasiStaticState>,
    /// Time before the last step \[s\]; absent before the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub previous_time: Option<f64>,
    /// Where the stage before the current one began; absent in the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub previous_stage: Option<StageStart>,
}

/// Where a stage began.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct StageStart {
    /// Time \[s\].
    pub time: f64,
    /// Step.
    pub step: u64,
    /// Strain.
    pub strain: [f64; 3],
    /// Measured stress \[Pa\].
    pub stress: [f64; 3],
}

/// Where the quasi-static routine is.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct QuasiStaticState {
    /// Increments that have reached equilibrium since the start of the run.
    pub increments: u64,
    /// Increments when the current stage began.
    pub stage_start_increments: u64,
    /// Substeps of the running increment; 0: its strain is not applied yet.
    pub substep: u64,
    /// Present mixing of velocities and forces (FIRE).
    pub mixing: f64,
    /// Substeps since the last uphill motion (FIRE).
    pub downhill: u64,
}
