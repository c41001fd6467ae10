//! Inputs and brute-force measures that the tests of this folder share.

use super::Packing;
use super::grid::Cell;
use crate::config::*;
use std::path::PathBuf;

pub fn species(name: &str, count: usize, radius: RadiusDistribution) -> Species {
    Species {
        name: name.into(),
        material: 0,
        radius,
        shape: ShapeConfig::Sphere,
        count,
        motion: Motion::Free,
        velocity: [0.0; 3],
        velocity_deviation: 0.0,
        spin: [0.0; 3],
    }
}

/// A periodic cell of these species, random close packed at the rate for 0.635.
pub fn config(species: Vec<Species>) -> Config {
    Config {
        seed: 1,
        cell: CellConfig { sides: None, aspect: [1.0; 3], solid_fraction: None, boundary: [Boundary::Periodic; 3] },
        materials: Vec::new(),
        species,
        pairs: Vec::new(),
        velocities: Velocities::default(),
        packing: PackingConfig::RandomClose { contraction_rate: 5e-4, max_moves_per_particle: 1e5 },
        replication: Replication::NONE,
        gravity: [0.0; 3],
        kinematics: Kinematics::Bct,
        quasi_static: QuasiStaticConfig {
            substeps: 50,
            max_blocks: 100,
            damping: Damping::Contact,
            restitution: 0.5,
            safety: 0.3,
            max_unbalanced_ratio: 1e-4,
            max_kinetic_ratio: 1e-8,
            max_displacement_ratio: 1e-5,
            touching_overlap: 1e-4,
        },
        stages: Vec::new(),
        time_step: TimeStepConfig::Automatic { safety: 0.17, reference_overlap: 1e-3 },
        control_interval: 100,
        max_overlap_fraction: 0.1,
        output: OutputConfig {
            directory: PathBuf::new(),
            history: Interval::Steps(1),
            snapshots: None,
            snapshot_contacts: false,
            dump: false,
            checkpoint_steps: 0,
            checkpoint_wall_time: None,
            checkpoints_kept: 2,
            energy_ledger: false,
            orientations: false,
            plots: false,
        },
        parallel: ParallelConfig {
            grid: None,
            threads: None,
            skin: 0.1,
            min_particles_per_rank: 1,
            simd: SimdConfig::Auto,
        },
        title: String::new(),
        resolved: String::new(),
    }
}

/// The smallest distance over sum of radii of any pair, images within two cells and own ones included.
pub fn smallest_relative_distance(positions: &[[f64; 3]], radii: &[f64], cell: &Cell) -> f64 {
    let mut smallest = f64::INFINITY;
    let range = |axis: usize| if cell.periodic[axis] { -2..=2 } else { 0..=0 };
    for i in 0..positions.len() {
        for j in i..positions.len() {
            for shift in range(0).flat_map(|x| range(1).flat_map(move |y| range(2).map(move |z| [x, y, z]))) {
                if i == j && shift == [0, 0, 0] {
                    continue;
                }
                let d = [0, 1, 2].map(|k| positions[j][k] + f64::from(shift[k]) * cell.sides[k] - positions[i][k]);
                let distance = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
                smallest = smallest.min(distance / (radii[i] + radii[j]));
            }
        }
    }
    smallest
}

/// Volume of the spheres over that of the cell.
pub fn solid_fraction(packing: &Packing) -> f64 {
    let radii: Vec<f64> = packing.particles.iter().map(|particle| particle.radius).collect();
    super::rcp::solid_volume(&radii) / (packing.sides[0] * packing.sides[1] * packing.sides[2])
}
