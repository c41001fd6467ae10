//! Particles of one rank as a structure of arrays: owned first, then ghosts.

use super::shape::{Shape, UPRIGHT, ellipsoid_mass};
use super::{LEDGER, ParticleState};
use crate::config::Velocities;
use bytemuck::{Pod, Zeroable};

/// What the contact pass reads of a particle, packed into 96 bytes so that one contact touches two
/// short runs of memory. Velocities are those that the laws are given, see [`Velocities`].
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(32))]
pub struct Record {
    /// Wrapped position \[m\]; no component is −0, so that differences are not.
    pub position: [f64; 3],
    /// Radius; of an ellipsoid that of the sphere around it, its largest semi-axis \[m\].
    pub radius: f64,
    /// Velocity at the full step, or at the half step before \[m/s\] (BCT: peculiar, BC: absolute).
    pub velocity: [f64; 3],
    /// The radius once more \[m\]: the contact pass needs the difference of two radii and their sum.
    pub radius_again: f64,
    /// Angular velocity, of the same time as the velocity \[rad/s\].
    pub spin: [f64; 3],
    /// 1/m \[1/kg\]; 0 for driven particles.
    pub inverse_mass: f64,
}

/// Numbers of a [`Record`]: position, radius, velocity, radius, spin, 1/m.
pub const RECORD: usize = size_of::<Record>() / size_of::<f64>();

/// What is constant over all particles of a species.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeciesConstants {
    /// Density with the density scaling \[kg/m³\].
    pub density: f64,
    /// Moves as prescribed, whatever the forces.
    pub driven: bool,
}

/// Particles of one rank. Arrays marked "all" hold owned particles, then ghosts; the others owned only.
#[derive(Debug, Clone, Default)]
pub struct Particles {
    /// Number of owned particles.
    pub owned: usize,
    /// Global ids (all).
    pub id: Vec<u32>,
    /// Species (all).
    pub species: Vec<u32>,
    /// Packed records (all).
    pub record: Vec<Record>,
    /// What is followed, here and on all other ranks.
    pub extras: Extras,
    /// Semi-axes and orientations (all); empty when every particle of all ranks is a sphere.
    pub shape: Vec<Shape>,
    /// Periodic images crossed since the start (all).
    pub image: Vec<[i32; 3]>,
    /// The velocity that records do not have, as a rule that at the last half step \[m/s\]; the fourth number is 0.
    pub velocity: Vec<[f64; 4]>,
    /// The angular velocity that records do not have \[rad/s\]; the fourth number is 1/I, I = 2/5 m R² \[1/(kg m²)\], 0 for driven
    /// particles, and for ellipsoids, whose inertia is no single number.
    pub spin: Vec<[f64; 4]>,
    /// Orientations of spheres, unit quaternions (w, x, y, z); empty where they are not followed, and
    /// where `shape` holds them.
    pub orientation: Vec<[f64; 4]>,
    /// Energy ledger per particle; empty when the ledger is off.
    pub ledger: Vec<[f64; LEDGER.len()]>,
}

/// What of a particle is followed only on request, and what velocities records have.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Extras {
    /// Orientations of spheres.
    pub orientation: bool,
    /// Semi-axes and orientations: there are ellipsoids.
    pub ellipsoids: bool,
    /// Energy ledger.
    pub ledger: bool,
    /// What velocities records have.
    pub velocities: Velocities,
}

impl Particles {
    /// Owned particles from their states.
    #[must_use]
    pub fn from_states(states: &[ParticleState], species: &[SpeciesConstants], extras: Extras) -> Self {
        let mut particles = Self { owned: states.len(), extras, ..Self::default() };
        for state in states {
            let constants = species[state.species as usize];
            let (half, full) = ((state.velocity, state.spin), (state.full_velocity, state.full_spin));
            let (seen, other) = if extras.velocities == Velocities::HalfStep { (half, full) } else { (full, half) };
            particles.id.push(state.id);
            particles.species.push(state.species);
            particles.image.push(state.image);
            particles.velocity.push(padded(other.0));
            if extras.ellipsoids {
                particles.shape.push(Shape::new(state.semi_axes, state.orientation));
            } else if extras.orientation {
                particles.orientation.push(state.orientation);
            }
            if extras.ledger {
                particles.ledger.push(state.ledger);
            }
            let mass = ellipsoid_mass(state.semi_axes, constants.density);
            let turns_by_shape = constants.driven || extras.ellipsoids;
            let inverse_inertia = if turns_by_shape { 0.0 } else { 2.5 / (mass * state.radius * state.radius) };
            let [x, y, z] = other.1;
            particles.spin.push([x, y, z, inverse_inertia]);
            particles.record.push(Record {
                // Never −0.
                position: state.position.map(|x| x + 0.0),
                radius: state.radius,
                velocity: seen.0,
                inverse_mass: if constants.driven { 0.0 } else { 1.0 / mass },
                spin: seen.1,
                radius_again: state.radius,
            });
        }
        particles
    }

    /// The complete state of owned particle `index`.
    #[must_use]
    pub fn state(&self, index: usize) -> ParticleState {
        let record = &self.record[index];
        let [half, full] = self.velocities(index);
        ParticleState {
            id: self.id[index],
            species: self.species[index],
            position: record.position,
            radius: record.radius,
            semi_axes: self.semi_axes(index),
            velocity: half.0,
            full_velocity: full.0,
            spin: half.1,
            full_spin: full.1,
            orientation: self.orientation_of(index),
            ledger: self.ledger.get(index).copied().unwrap_or_default(),
            image: self.image[index],
            reserved: 0,
        }
    }

    /// Velocity \[m/s\] and angular velocity \[rad/s\] of an owned particle at the last half step and at the full step.
    #[must_use]
    pub fn velocities(&self, index: usize) -> [([f64; 3], [f64; 3]); 2] {
        let seen = (self.record[index].velocity, self.record[index].spin);
        let other = (trimmed(self.velocity[index]), trimmed(self.spin[index]));
        if self.extras.velocities == Velocities::HalfStep { [seen, other] } else { [other, seen] }
    }

    /// Semi-axes of a particle \[m\].
    #[must_use]
    pub fn semi_axes(&self, index: usize) -> [f64; 3] {
        self.shape.get(index).map_or([self.record[index].radius; 3], |shape| shape.semi_axes)
    }

    /// Orientation of an owned particle.
    #[must_use]
    pub fn orientation_of(&self, index: usize) -> [f64; 4] {
        let of_sphere = || self.orientation.get(index).copied().unwrap_or(UPRIGHT);
        self.shape.get(index).map_or_else(of_sphere, |shape| shape.orientation)
    }

    /// States of all owned particles, in local order.
    #[must_use]
    pub fn states(&self) -> Vec<ParticleState> {
        (0..self.owned).map(|index| self.state(index)).collect()
    }

    /// Owned particles and ghosts.
    #[must_use]
    pub fn len(&self) -> usize {
        self.id.len()
    }

    /// No particle at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.id.is_empty()
    }

    /// Put the owned particles into a new order (no ghosts may be there).
    pub fn reorder(&mut self, order: &[u32]) {
        fn permute<T: Copy>(values: &mut Vec<T>, order: &[u32]) {
            if !values.is_empty() {
                *values = order.iter().map(|index| values[*index as usize]).collect();
            }
        }
        debug_assert_eq!(order.len(), self.len());
        permute(&mut self.id, order);
        permute(&mut self.species, order);
        permute(&mut self.record, order);
        permute(&mut self.shape, order);
        permute(&mut self.image, order);
        permute(&mut self.velocity, order);
        permute(&mut self.spin, order);
        permute(&mut self.orientation, order);
        permute(&mut self.ledger, order);
    }

    /// Forget the ghosts.
    pub fn drop_ghosts(&mut self) {
        self.id.truncate(self.owned);
        self.species.truncate(self.owned);
        self.record.truncate(self.owned);
        self.shape.truncate(self.owned);
        self.image.truncate(self.owned);
    }
}

/// Mass of a sphere, `m = (4/3) π R³ ρ` \[kg\].
#[must_use]
pub fn sphere_mass(radius: f64, density: f64) -> f64 {
    4.0 / 3.0 * std::f64::consts::PI * radius * radius * radius * density
}

/// With a fourth number, 0.
#[must_use]
pub fn padded(vector: [f64; 3]) -> [f64; 4] {
    [vector[0], vector[1], vector[2], 0.0]
}

/// Without the fourth number.
#[must_use]
pub fn trimmed(vector: [f64; 4]) -> [f64; 3] {
    [vector[0], vector[1], vector[2]]
}
