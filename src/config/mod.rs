//! The checked input in SI units: what every later stage reads. Built by [`load`] from a TOML file;
//! knows nothing of ranks or of the simulation's state.

mod alternatives;
mod build;
mod contact;
mod diagnostic;
mod document;
pub mod idle;
pub mod keys;
mod particles;
pub mod programme;
mod radius;
mod reference;
mod resolved;
mod routine;
pub mod schema;
mod section;
mod settings;
mod shape;
pub mod sheet;
mod stages;
mod values;
mod velocities;

pub use build::load;
pub use reference::{example, reference_markdown};
pub use routine::{Damping, QuasiStaticConfig, Routine};
pub use settings::MOST_DIAMETERS;
pub use shape::ShapeConfig;
pub use velocities::Velocities;

use crate::force::registry::{LawChoice, PairProperties};
use std::path::PathBuf;

/// The whole checked input, SI units throughout.
#[derive(Debug, Clone)]
pub struct Config {
    /// Seed of every random draw (packing, radii, initial velocities).
    pub seed: u64,
    /// The cell and its three axes.
    pub cell: CellConfig,
    /// Materials in input order; indices refer to this list.
    pub materials: Vec<Material>,
    /// Particle species in input order; [`crate::state::ParticleState::species`] is the index.
    pub species: Vec<Species>,
    /// Contact laws, one per unordered pair of materials, see [`Config::pair_index`].
    pub pairs: Vec<PairConfig>,
    /// How the initial positions are made.
    pub packing: PackingConfig,
    /// The velocities that the laws of all pairs are given.
    pub velocities: Velocities,
    /// What becomes of that packing before the run starts.
    pub replication: Replication,
    /// Uniform body acceleration \[m/s²\].
    pub gravity: [f64; 3],
    /// BCT or BC (PHYSICS.md section 5).
    pub kinematics: Kinematics,
    /// How quasi-static stages find their equilibria.
    pub quasi_static: QuasiStaticConfig,
    /// What follows what; at least one stage.
    pub stages: Vec<Stage>,
    /// The time step.
    pub time_step: TimeStepConfig,
    /// Evaluate global values (automatic time step, servo) every this many steps.
    pub control_interval: u64,
    /// A contact whose overlap exceeds this fraction of the smaller radius stops the run.
    pub max_overlap_fraction: f64,
    /// What is written, where and how often.
    pub output: OutputConfig,
    /// Ranks, threads, skin.
    pub parallel: ParallelConfig,
    /// `name` of the run, used in titles.
    pub title: String,
    /// The input as resolved TOML text, every default spelled out, SI numbers; reruns the same.
    pub resolved: String,
}

impl Config {
    /// Index into [`Config::pairs`] for materials `a`, `b` in either order: row-wise upper triangle,
    /// `(0,0), (0,1), …, (0,n−1), (1,1), …`.
    #[must_use]
    pub fn pair_index(&self, a: usize, b: usize) -> usize {
        let (low, high) = if a < b { (a, b) } else { (b, a) };
        low * self.materials.len() - low * (low + 1) / 2 + high
    }

    /// A warning of density scaling under gravity.
    #[must_use]
    pub fn scaled_weights(&self) -> Option<String> {
        let scaled = self.materials.iter().find(|material| material.density_scaling != 1.0);
        scaled.filter(|_| self.gravity != [0.0; 3]).map(|material| {
            format!(
                "density_scaling multiplies weights too: \"{}\" presses {:e} times as hard on what is below; for its true \
                 weight divide gravity by that number",
                material.name, material.density_scaling
            )
        })
    }
}

/// One axis of the cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Boundary {
    /// Periodic: images on both sides.
    Periodic,
    /// Plane walls of this material at the low and the high face (they move with the cell face).
    Walls {
        /// Index into [`Config::materials`].
        material: usize,
    },
}

/// The cell: a box with its low corner at the origin.
#[derive(Debug, Clone)]
pub struct CellConfig {
    /// Sides \[m\]; `None`: a box with proportions `aspect` sized from `solid_fraction`, or that of the file.
    pub sides: Option<[f64; 3]>,
    /// Proportions when the sides follow from the solid fraction.
    pub aspect: [f64; 3],
    /// Target solid fraction when `sides` is `None` (RCP: the packing's own jamming fraction if `None`).
    pub solid_fraction: Option<f64>,
    /// Boundary per axis.
    pub boundary: [Boundary; 3],
}

/// One Maxwell branch: a spring and a dashpot in series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaxwellBranch {
    /// Spring modulus E_k \[Pa\].
    pub modulus: f64,
    /// Relaxation time τ_k = η_k/E_k \[s\].
    pub relaxation_time: f64,
}

/// A material.
#[derive(Debug, Clone)]
pub struct Material {
    /// Name used in the input.
    pub name: String,
    /// Physical density \[kg/m³\].
    pub density: f64,
    /// Factor on the density (PHYSICS.md section 5), 1 by default.
    pub density_scaling: f64,
    /// Young's modulus \[Pa\]; with Maxwell branches the long-term modulus E_∞.
    pub young_modulus: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Maxwell branches, empty for elastic materials.
    pub maxwell: Vec<MaxwellBranch>,
    /// Yield stress \[Pa\].
    pub yield_stress: Option<f64>,
    /// Coulomb friction coefficient.
    pub friction: f64,
    /// Coefficient of restitution, in (0, 1].
    pub restitution: f64,
    /// Rolling friction coefficient μ_r.
    pub rolling_friction: f64,
    /// Twisting friction coefficient μ_tw.
    pub twisting_friction: f64,
    /// Work of adhesion between two surfaces of this material \[J/m²\].
    pub surface_energy: f64,
}

/// The distribution of radii of a species.
#[derive(Debug, Clone, PartialEq)]
pub enum RadiusDistribution {
    /// All equal \[m\].
    Fixed(f64),
    /// Normal, cut to \[min, max\] \[m\].
    Normal {
        /// Mean \[m\].
        mean: f64,
        /// Standard deviation \[m\].
        deviation: f64,
        /// Smallest radius \[m\].
        min: f64,
        /// Largest radius \[m\].
        max: f64,
    },
    /// Lognormal: `median` \[m\] and the deviation of ln R, cut to \[min, max\].
    Lognormal {
        /// Median \[m\].
        median: f64,
        /// Standard deviation of ln R.
        sigma: f64,
        /// Smallest radius \[m\].
        min: f64,
        /// Largest radius \[m\].
        max: f64,
    },
    /// Radii \[m\] with number weights.
    Tabulated {
        /// Radii \[m\].
        radius: Vec<f64>,
        /// Number weight of each radius.
        weight: Vec<f64>,
    },
}

/// How a species moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// Forces move it.
    Free,
    /// Prescribed velocity \[m/s\] and spin \[rad/s\], whatever the forces (fixed: both zero).
    Driven {
        /// Velocity \[m/s\].
        velocity: [f64; 3],
        /// Angular velocity \[rad/s\].
        spin: [f64; 3],
    },
}

/// A particle species.
#[derive(Debug, Clone)]
pub struct Species {
    /// Name used in the input.
    pub name: String,
    /// Index into [`Config::materials`].
    pub material: usize,
    /// Radii; of ellipsoids those of spheres of equal volume.
    pub radius: RadiusDistribution,
    /// Semi-axes.
    pub shape: ShapeConfig,
    /// Number of particles (0 when a file gives the particles).
    pub count: usize,
    /// How it moves.
    pub motion: Motion,
    /// Initial velocity \[m/s\] of every particle.
    pub velocity: [f64; 3],
    /// Deviation of a random normal part added per component \[m/s\] (counter-based draw per id).
    pub velocity_deviation: f64,
    /// Initial spin \[rad/s\].
    pub spin: [f64; 3],
}

/// Contact laws of one pair of materials.
#[derive(Debug, Clone)]
pub struct PairConfig {
    /// The two materials, low index first.
    pub materials: [usize; 2],
    /// Constants that the laws read.
    pub properties: PairProperties,
    /// Normal law and its parameters.
    pub normal: LawChoice,
    /// Tangential law; `None`: frictionless.
    pub tangential: Option<LawChoice>,
    /// Rolling and twisting resistance; `None`: none.
    pub rolling: Option<LawChoice>,
}

impl PairConfig {
    /// The normal and, with its share, the tangential dashpot act: both come from the restitution coefficient.
    #[must_use]
    pub fn damps(&self) -> bool {
        self.normal.damps() && self.properties.restitution < 1.0
    }
}

/// How the initial positions are made.
#[derive(Debug, Clone)]
pub enum PackingConfig {
    /// Jodrey–Tory random close packing.
    RandomClose {
        /// Contraction rate k of the outer diameter.
        contraction_rate: f64,
        /// Give up after this many moves per particle.
        max_moves_per_particle: f64,
    },
    /// Relaxation of overlaps under a falling pressure; also for ellipsoids.
    Relaxation {
        /// Residual force over mean contact force at which a pressure counts as balanced.
        tolerance: f64,
        /// Give up after this many steps at one pressure.
        max_steps: usize,
    },
    /// Spheres dropped one after the other.
    DropAndRoll(DropAndRollConfig),
    /// From a CSV, HDF5 or LAMMPS data file.
    File {
        /// Path as resolved against the configuration's folder.
        path: PathBuf,
    },
}

/// Drop and roll, and how the cell is cut out of the bed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DropAndRollConfig {
    /// Height cut off above the floor and below the surface, over the largest diameter.
    pub margin: f64,
    /// Largest overlap that the relaxation of the cut leaves, over the smaller radius.
    pub remaining_overlap: f64,
}

/// Copies of the packing side by side, and the random displacement of every particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Replication {
    /// Copies per axis, at least 1; 1 along walled axes.
    pub copies: [usize; 3],
    /// Largest displacement over radius.
    pub perturbation: f64,
}

impl Replication {
    /// The packing as it is.
    pub const NONE: Self = Self { copies: [1; 3], perturbation: 0.0 };

    /// Number of copies; saturates.
    #[must_use]
    pub fn number(&self) -> u64 {
        self.copies.iter().fold(1, |product, &copies| product.saturating_mul(copies as u64))
    }

    /// Sides of the whole cell from those of one copy \[m\].
    #[must_use]
    pub fn whole(&self, sides: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| sides[k] * self.copies[k] as f64)
    }
}

/// Load type (W Sec. 2.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kinematics {
    /// Every particle moves with the strain increment; velocities are peculiar.
    Bct,
    /// Only the cell changes; velocities are absolute.
    Bc,
}

/// Control of one axis within a stage. Compression positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AxisControl {
    /// Nominal strain rate \[1/s\] (0: hold).
    StrainRate(f64),
    /// Servo to this stress \[Pa\] with at most this strain rate \[1/s\].
    Stress {
        /// Stress to reach and to keep \[Pa\].
        target: f64,
        /// Largest strain rate that the servo may use \[1/s\].
        max_rate: f64,
    },
}

/// One stage of the load programme; it ends at the first end condition met.
#[derive(Debug, Clone)]
pub struct Stage {
    /// Name shown in the log.
    pub name: String,
    /// Dynamic or quasi-static.
    pub routine: Routine,
    /// Control per axis. In a quasi-static stage strain rates count per increment.
    pub axes: [AxisControl; 3],
    /// Ends after this time \[s\] since its start.
    pub duration: Option<f64>,
    /// Ends when the strain of the axis passes the value (from below or above): (axis, strain since time 0).
    pub until_strain: Option<(usize, f64)>,
    /// Ends when the stress of the axis passes the value: (axis, stress \[Pa\]); checked every control interval.
    pub until_stress: Option<(usize, f64)>,
    /// Number of steps; mostly for tests and benches.
    pub steps: Option<u64>,
    /// Number of increments of a quasi-static stage.
    pub increments: Option<u64>,
}

/// The time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TimeStepConfig {
    /// Δt = β √(m_min/K_max), re-evaluated every control interval; floor of K at `reference_overlap` × R.
    Automatic {
        /// Safety factor β.
        safety: f64,
        /// Overlap over radius at which the floor of K is taken.
        reference_overlap: f64,
    },
    /// A fixed step \[s\].
    Fixed(f64),
}

/// What is written.
#[derive(Debug, Clone)]
#[allow(clippy::struct_excessive_bools, reason = "one switch each")]
pub struct OutputConfig {
    /// The run directory.
    pub directory: PathBuf,
    /// History row every this much time \[s\] or steps.
    pub history: Interval,
    /// Snapshots, if any.
    pub snapshots: Option<Interval>,
    /// Also write the contacts as lines with force and memory.
    pub snapshot_contacts: bool,
    /// Write each snapshot also as a LAMMPS text dump.
    pub dump: bool,
    /// Checkpoint every this many steps (0: none but the last).
    pub checkpoint_steps: u64,
    /// Checkpoint every this much wall time \[s\].
    pub checkpoint_wall_time: Option<f64>,
    /// Number of checkpoints kept.
    pub checkpoints_kept: usize,
    /// Keep the energy ledger (work, dissipation by cause); costs some speed.
    pub energy_ledger: bool,
    /// Follow the orientations of spheres.
    pub orientations: bool,
    /// Draw plots at the end.
    pub plots: bool,
}

/// When something repeats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Interval {
    /// Every so many steps.
    Steps(u64),
    /// At the first step at or after each multiple of this time \[s\].
    Time(f64),
    /// Every so many equilibria of quasi-static stages.
    Increments(u64),
}

/// Largest change of nominal strain per step: the contacts must follow the load in small increments.
pub const MAX_STRAIN_PER_STEP: f64 = 1e-5;

/// Most threads that a rank may have.
pub const MAX_THREADS: u16 = 1024;

/// Ranks, threads, lists.
#[derive(Debug, Clone)]
pub struct ParallelConfig {
    /// Ranks per axis; `None`: chosen to minimise the surface.
    pub grid: Option<[usize; 3]>,
    /// Threads per rank; `None`: automatic.
    pub threads: Option<usize>,
    /// Skin of the Verlet list as a fraction of the largest diameter.
    pub skin: f64,
    /// The automatic grid gives no rank fewer particles than this.
    pub min_particles_per_rank: usize,
    /// Vector instructions.
    pub simd: SimdConfig,
}

/// Which vector instructions the contact passes use; no effect on results.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SimdConfig {
    /// The widest that the processor has.
    Auto,
    /// None: one contact at a time.
    Scalar,
    /// AVX2: four contacts at a time.
    Avx2,
    /// AVX-512: eight contacts at a time.
    Avx512,
}
