//! Homogenisation: from the observation of one state to the numbers that the history shows.

use super::affine::affine_energy;
use super::{Simulation, Stage};
use crate::config::{MAX_STRAIN_PER_STEP, TimeStepConfig};
use crate::error::{Error, Result};
use crate::exchange::ExactSum;
use crate::exchange::exact_sum;
use crate::force::observe::{CONTACT_LEDGER, Observation, SUMS, Sample, Sum, Wanted};
use crate::integrate::time_step::Measured;
use crate::load::LoadProgramme;
use crate::output::history::HistoryRow;
use crate::state::LEDGER;
use crate::state::shape::{ellipsoid_mass, rotational_energy};

/// Particles with fewer contacts than this carry no load in three dimensions (rattlers).
const RATTLER_CONTACTS: u32 = 4;

/// Places of the particle sums behind the contact sums.
#[derive(Debug, Clone, Copy)]
#[repr(usize)]
enum ParticleSum {
    Kinetic = SUMS,
    KineticStress = SUMS + 1,
    NetForce = SUMS + 4,
    Rattlers = SUMS + 5,
    RattlerContacts = SUMS + 6,
    Free = SUMS + 7,
    Ledger = SUMS + 8,
}

const ALL_SUMS: usize = SUMS + 8 + LEDGER.len();

/// One observed state.
#[derive(Debug, Clone)]
pub struct Report {
    /// The row of the history table.
    pub row: HistoryRow,
    /// Touching contacts of this rank, if wanted.
    pub samples: Vec<Sample>,
    /// Normal force on each wall \[N\].
    pub wall_force: [f64; 6],
    /// For the time step.
    pub measured: Measured,
    /// Mean of the net forces on free particles \[N\].
    pub mean_net_force: f64,
    /// Mean contact force \[N\]; 0 before anything touches.
    pub mean_contact_force: f64,
}

impl Simulation {
    /// Add the particles' part, reduce over ranks, and turn sums into stress, energies, fabric.
    ///
    /// # Errors
    /// A stress or energy is no number; the same on every rank.
    pub(super) fn reduce(&mut self, mut observation: Observation, wanted: Wanted) -> Result<Report> {
        self.timers.start(Stage::Reduce);
        observation.sums.resize(ALL_SUMS, ExactSum::new());
        let max_speed = self.add_particle_sums(&mut observation, wanted);
        if wanted.sums {
            exact_sum::reduce(&self.comm, &mut observation.sums);
        }
        let mut largest = [observation.max_stiffness, observation.max_overlap_ratio, max_speed];
        self.comm.max_f64(&mut largest);
        let values: Vec<f64> = observation.sums.iter().map(ExactSum::value).collect();
        let volume = self.global.sides[0] * self.global.sides[1] * self.global.sides[2];
        let six = |from: usize, divisor: f64| std::array::from_fn(|k| values[from + k] / divisor);
        let stress: [f64; 6] = six(Sum::Virial as usize, volume);
        self.max_stiffness = largest[0];
        let contacts = values[Sum::Contacts as usize];
        let wall_contacts = values[Sum::WallContacts as usize];
        let particles = self.global.particles as f64;
        let ends = 2.0 * contacts + wall_contacts;
        let bearing = particles - values[ParticleSum::Rattlers as usize];
        let free = values[ParticleSum::Free as usize];
        let mean = |sum: f64, count: f64| if count > 0.0 { sum / count } else { 0.0 };
        let mut ledger = std::array::from_fn(|k| values[ParticleSum::Ledger as usize + k]);
        for (k, entry) in CONTACT_LEDGER.into_iter().enumerate() {
            ledger[entry] += values[Sum::LastStep as usize + k];
        }
        let row = HistoryRow {
            step: self.global.step,
            time: self.global.time,
            time_step: self.global.time_step,
            strain: self.global.strain,
            stress,
            kinetic_stress: std::array::from_fn(|k| values[ParticleSum::KineticStress as usize + k] / volume),
            solid_fraction: self.model.solid_volume / volume,
            coordination: ends / particles,
            coordination_without_rattlers: if bearing > 0.0 {
                (ends - values[ParticleSum::RattlerContacts as usize]) / bearing
            } else {
                0.0
            },
            rattlers: values[ParticleSum::Rattlers as usize] as u64,
            contacts: (contacts + wall_contacts) as u64,
            kinetic: values[ParticleSum::Kinetic as usize],
            elastic: values[Sum::Elastic as usize],
            viscoelastic: values[Sum::Viscoelastic as usize],
            ledger,
            unbalanced_ratio: (values[ParticleSum::NetForce as usize] / free)
                / (values[Sum::ForceMagnitude as usize] / (contacts + wall_contacts)),
            max_overlap_ratio: largest[1],
            fabric: six(Sum::Fabric as usize, contacts),
            increment: self.global.quasi_static.map_or(0, |state| state.increments),
            inertial_number: self.inertial_number((stress[0] + stress[1] + stress[2]) / 3.0),
        };
        self.timers.stop();
        self.check_finite(&row)?;
        Ok(Report {
            row,
            samples: observation.samples,
            wall_force: std::array::from_fn(|k| values[Sum::WallForce as usize + k]),
            measured: Measured { max_stiffness: largest[0], max_speed: largest[2] },
            mean_net_force: mean(values[ParticleSum::NetForce as usize], free),
            mean_contact_force: mean(values[Sum::ForceMagnitude as usize], contacts + wall_contacts),
        })
    }

    fn check_finite(&self, row: &HistoryRow) -> Result<()> {
        let energies = [("kinetic energy", row.kinetic), ("elastic energy", row.elastic)].into_iter();
        let mut numbers =
            energies.chain(row.stress.iter().chain(&row.kinetic_stress).map(|stress| ("stress", *stress)));
        numbers.find(|(_, value)| !value.is_finite()).map_or(Ok(()), |(name, value)| {
            let step = self.global.step;
            let message =
                format!("the {name} is {value}; look at the units of radii, densities, velocities and moduli");
            Err(Error::Simulation { step, message })
        })
    }

    /// Sums over owned particles; returns the largest speed. Particle by particle quantities only, so
    /// that no distribution over ranks shows.
    fn add_particle_sums(&self, observation: &mut Observation, wanted: Wanted) -> f64 {
        let sums = &mut observation.sums;
        let mut max_speed = 0.0;
        let gradient = self.peculiar_gradient();
        for index in 0..self.particles.owned {
            let record = &self.particles.record[index];
            let [_, (velocity, spin)] = self.particles.velocities(index);
            let dot = |a: [f64; 3]| a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
            // Peculiar velocity: relative to the affine flow of the cell.
            let absolute = velocity;
            let velocity = [0, 1, 2].map(|k| absolute[k] - gradient[k] * record.position[k]);
            let squared = dot(velocity);
            if record.inverse_mass > 0.0 && squared > max_speed {
                max_speed = squared;
            }
            if !wanted.sums {
                continue;
            }
            let mass = self.mass(index);
            let kinetic = match self.particles.shape.get(index) {
                Some(shape) => 0.5 * mass * squared + rotational_energy(mass, shape, spin),
                None => 0.5 * (mass * squared + 0.4 * mass * (record.radius * record.radius) * dot(spin)),
            };
            sums[ParticleSum::Kinetic as usize].add(kinetic);
            for k in 0..3 {
                sums[ParticleSum::KineticStress as usize + k].add(mass * (velocity[k] * velocity[k]));
            }
            if record.inverse_mass > 0.0 {
                sums[ParticleSum::Free as usize].add(1.0);
                sums[ParticleSum::NetForce as usize].add(dot(self.net_force(index)).sqrt());
            }
            let touching = self.touching(index);
            if touching < RATTLER_CONTACTS {
                sums[ParticleSum::Rattlers as usize].add(1.0);
                sums[ParticleSum::RattlerContacts as usize].add(f64::from(touching));
            }
            if let Some(ledger) = self.particles.ledger.get(index) {
                let mut add = |entry: usize, value| sums[ParticleSum::Ledger as usize + entry].add(value);
                for (k, value) in ledger.iter().enumerate() {
                    add(k, *value);
                }
                add(0, -affine_energy(mass, absolute, record.position, gradient));
                let (entry, work) = self.latest_work(index, absolute);
                add(entry, work);
            }
        }
        max_speed.sqrt()
    }

    /// `I = ε̇ d √(ρ/p)` with the largest strain rate, diameter and density: 0 at rest, NaN without pressure.
    fn inertial_number(&self, pressure: f64) -> f64 {
        let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |m, v| if v > m { v } else { m });
        let rate = largest(&mut self.global.strain_rate.iter().map(|rate| rate.abs()));
        if rate == 0.0 {
            return 0.0;
        }
        if pressure <= 0.0 {
            return f64::NAN;
        }
        let density = largest(&mut self.model.species.iter().map(|species| species.density));
        rate * (2.0 * self.model.max_radius) * (density / pressure).sqrt()
    }

    /// Which entry of a particle's ledger lacks what work \[J\]: of gravity or of what drives it, by the half of the last step
    /// that the trapezoidal rule gives to the present state. What turns a driven particle is not known here.
    fn latest_work(&self, index: usize, velocity: [f64; 3]) -> (usize, f64) {
        let half = 0.5 * self.global.previous_time_step;
        let power = |force: [f64; 3]| force[0] * velocity[0] + force[1] * velocity[1] + force[2] * velocity[2];
        if self.particles.record[index].inverse_mass > 0.0 {
            let mass = self.mass(index);
            (1, power(self.model.config.gravity.map(|g| mass * g)) * half)
        } else {
            (2, -power(self.plus_contact_forces([0.0; 3], index)) * half)
        }
    }

    /// Number of touching contacts of an owned particle at the last look at single contacts.
    pub(super) fn touching(&self, particle: usize) -> u32 {
        self.contacts.lines_of(particle).filter(|(line, _)| self.forces[*line][3] > 0.0).count() as u32
    }

    pub(super) fn mass(&self, particle: usize) -> f64 {
        let species = self.model.species[self.particles.species[particle] as usize];
        ellipsoid_mass(self.particles.semi_axes(particle), species.density)
    }

    /// Sum of all forces on an owned particle at the last look at single contacts \[N\].
    fn net_force(&self, particle: usize) -> [f64; 3] {
        let mass = self.mass(particle);
        self.plus_contact_forces(self.model.config.gravity.map(|g| mass * g), particle)
    }

    /// A force and its contact forces after it \[N\].
    fn plus_contact_forces(&self, mut sum: [f64; 3], particle: usize) -> [f64; 3] {
        for (line, is_second) in self.contacts.lines_of(particle) {
            let sign = if is_second { -1.0 } else { 1.0 };
            for (total, force) in sum.iter_mut().zip(self.forces[line]) {
                *total += sign * force;
            }
        }
        sum
    }

    /// Refuse a fixed time step that the present state makes unstable, if the first step is one that looks.
    ///
    /// # Errors
    /// As [`crate::integrate::time_step::TimeStepControl::choose`]; the same on every rank.
    pub fn check_fixed_time_step(&mut self) -> Result<()> {
        if !self.control_is_due() || !matches!(self.model.config.time_step, TimeStepConfig::Fixed(_)) {
            return Ok(());
        }
        let measured = self.observe(Wanted::default())?.measured;
        self.model.time_step.choose(measured, self.global.step).map(|_| ())
    }

    /// The stress that ends stages and steers them, and the one with which a stage begins.
    pub(super) fn take_stress(&mut self, report: &Report) {
        self.global.measured_stress = [report.row.stress[0], report.row.stress[1], report.row.stress[2]];
        if self.global.step == self.global.stage_start_step {
            self.global.stage_start_stress = self.global.measured_stress;
        }
    }

    /// Refuse to expand the cell for ever while a stage waits for a stress that cannot come any more.
    pub(super) fn refuse_vain_wait(&self, report: &Report) -> Result<()> {
        if !self.model.programme.waits_in_vain(&self.global, report.row.contacts) {
            return Ok(());
        }
        Err(Error::Simulation {
            step: self.global.step,
            message: format!(
                "stage {} waits for the stress of until_stress while the cell only expands, to the strain {:?} so far, and \
                 the stress of {:?} Pa does not rise; give the stage a positive strain (compression) or another end",
                self.global.stage, self.global.strain, self.global.measured_stress
            ),
        })
    }

    /// Time step and servo from what was measured at a control step.
    pub(super) fn control(&mut self, report: &Report) -> Result<()> {
        if self.model.needs_stress() {
            self.take_stress(report);
        }
        self.refuse_vain_wait(report)?;
        let interval = self.global.time_step * self.model.config.control_interval as f64;
        let stiffness = if self.max_stiffness > self.model.time_step.reference_stiffness {
            self.max_stiffness
        } else {
            self.model.time_step.reference_stiffness
        };
        if interval > 0.0 {
            self.model.programme.control(&mut self.global, stiffness / self.model.max_radius, interval);
        }
        let (chosen, warning) = self.model.time_step.choose(report.measured, self.global.step)?;
        let limit = LoadProgramme::time_step_limit(&self.global);
        self.global.time_step = if chosen < limit { chosen } else { limit };
        let shortened = match self.model.config.time_step {
            TimeStepConfig::Fixed(fixed) if limit < fixed => Some(format!(
                "the time step is {limit:.3e} s instead of the fixed {fixed:.3e} s, as a step may strain the cell by at most \
                 {MAX_STRAIN_PER_STEP:e}"
            )),
            _ => None,
        };
        if !self.warned_about_time_step {
            let before = self.warnings.len();
            self.warnings.extend(warning.into_iter().chain(shortened));
            self.warned_about_time_step = self.warnings.len() > before;
        }
        if self.global.time_step.is_finite() {
            return Ok(());
        }
        Err(Error::Simulation {
            step: self.global.step,
            message: "no particle is free to move, so no automatic time step exists; set time_step.fixed".into(),
        })
    }
}
