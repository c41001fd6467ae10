//! The quasi-static routine (W Fig. 1, left): artificial damping after each substep, and the test for
//! equilibrium between blocks of substeps. A substep is a step like any other in which time does not pass; its
//! pseudo time step has no meaning beside stability.

use super::{Model, Report, Simulation};
use crate::config::{AxisControl, Damping, Kinematics, QuasiStaticConfig};
use crate::error::{Error, Result};
use crate::exchange::{ExactSum, exact_sum};
use crate::force::observe::Wanted;
use crate::force::pass::PairPass;
use crate::integrate::time_step::Measured;
use crate::state::QuasiStaticState;

/// Smallest overlap over radius at which the stiffness for the pseudo time step is taken.
const SOFTEST: f64 = 1e-5;
/// Substeps downhill before the mixing of FIRE shrinks, and the factor then.
const DOWNHILL: (u64, f64) = (5, 0.99);
/// Restitution of the artificial dashpots above which friction was seen to keep packings in motion.
const WEAK_DASHPOTS: f64 = 0.7;

/// How far from equilibrium: value and threshold of each criterion.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Residuals([(&'static str, f64, f64, &'static str); 3]);

impl Residuals {
    fn met(&self) -> bool {
        // A value that is not a number meets nothing.
        self.0.iter().all(|(_, value, threshold, _)| value <= threshold)
    }

    /// The criterion that is farthest from its threshold.
    fn worst(&self) -> (&'static str, f64, f64, &'static str) {
        let excess = |r: &(&str, f64, f64, &str)| r.1 / r.2;
        self.0.into_iter().fold(self.0[0], |worst, other| if excess(&other) > excess(&worst) { other } else { worst })
    }
}

/// The dashpots of an evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dashpots {
    /// Dynamic stages.
    OfMaterials,
    /// Substeps of the quasi-static routine.
    Artificial,
    /// The evaluation that sees the jump of an increment: it is no motion in time, and dashpots would oppose it, or pull, with
    /// forces that grow with the inverse of the pseudo time step; where they pull, springs would slide without limit.
    Off,
}

impl Model {
    /// The contact passes with this damping.
    #[must_use]
    pub fn passes_with(&self, damping: Dashpots) -> &[PairPass] {
        match damping {
            Dashpots::OfMaterials => &self.passes,
            Dashpots::Artificial => &self.static_passes[0],
            Dashpots::Off => &self.static_passes[1],
        }
    }
}

impl Simulation {
    /// Let the laws know the time since the last evaluation.
    pub(super) fn prepare(&mut self) {
        let (elapsed, relaxed) = (self.global.previous_time_step, self.is_quasi_static());
        if self.prepared_for != Some((elapsed.to_bits(), relaxed)) {
            self.prepared_for = Some((elapsed.to_bits(), relaxed));
            let Model { passes, static_passes: [damped, undamped], .. } = &mut self.model;
            for pass in if relaxed { damped.iter_mut().chain(undamped) } else { passes.iter_mut().chain(&mut []) } {
                pass.prepare(elapsed, relaxed);
            }
        }
    }

    /// The dashpots of the next evaluation.
    pub(super) fn dashpots(&self) -> Dashpots {
        match self.global.quasi_static {
            _ if !self.is_quasi_static() => Dashpots::OfMaterials,
            Some(QuasiStaticState { substep: 1, .. }) => Dashpots::Off,
            _ => Dashpots::Artificial,
        }
    }

    /// The running stage is quasi-static.
    #[must_use]
    pub fn is_quasi_static(&self) -> bool {
        self.model.programme.quasi_static_stage(&self.global).is_some()
    }

    fn relaxation(&self) -> QuasiStaticState {
        self.global.quasi_static.expect("a quasi-static stage has been entered")
    }

    /// Between two substeps of a quasi-static stage: at its start, and after each block, look at the state. Returns
    /// the report at the start and when the increment has reached equilibrium; the next one is then
    /// due. Collective.
    ///
    /// # Errors
    /// No equilibrium after all blocks that one increment may take.
    pub fn test_equilibrium(&mut self) -> Result<Option<Report>> {
        let settings = self.model.config.quasi_static;
        let state = self.relaxation();
        let starts = state.substep == 0 && self.global.step == self.global.stage_start_step;
        let block_ends = state.substep > 0 && state.substep.is_multiple_of(settings.substeps);
        if !starts && !block_ends {
            return Ok(None);
        }
        let mut report = self.observe(Wanted { sums: true, samples: false })?;
        self.take_stress(&report);
        self.refuse_vain_wait(&report)?;
        let residuals = self.residuals(&report, &settings);
        let settled = block_ends && residuals.met();
        if settled {
            let increments = state.increments + 1;
            self.global.quasi_static = Some(QuasiStaticState { increments, substep: 0, ..state });
            report.row.increment = increments;
        } else if block_ends && state.substep >= settings.substeps.saturating_mul(settings.max_blocks) {
            return Err(self.no_equilibrium(&residuals, &settings));
        }
        self.choose_pseudo_time_step(&report)?;
        Ok((settled || starts).then_some(report))
    }

    /// # Source
    /// W Sec. 2.3: kinetic energy, contact forces, displacements.
    fn residuals(&self, report: &Report, settings: &QuasiStaticConfig) -> Residuals {
        let least = self.model.least_scale;
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        let row = &report.row;
        let unbalanced = report.mean_net_force / larger(report.mean_contact_force, least.force);
        let kinetic = row.kinetic / larger(row.elastic, least.energy * self.global.particles as f64);
        let way = report.measured.max_speed * self.global.previous_time_step * settings.substeps as f64;
        Residuals([
            ("mean unbalanced force over mean contact force", unbalanced, settings.max_unbalanced_ratio, "unbalanced"),
            ("kinetic over elastic energy", kinetic, settings.max_kinetic_ratio, "kinetic"),
            (
                "largest displacement in a block over radius",
                way / self.model.max_radius,
                settings.max_displacement_ratio,
                "displacement",
            ),
        ])
    }

    fn no_equilibrium(&self, residuals: &Residuals, settings: &QuasiStaticConfig) -> Error {
        let (name, value, threshold, key) = residuals.worst();
        let increment = self.relaxation().increments + 1;
        let strain = self.global.strain;
        let mut hints = String::new();
        if settings.restitution > WEAK_DASHPOTS {
            let restitution = settings.restitution;
            hints += &format!(
                "; with load.quasi_static.restitution = {restitution} dashpots are weak and friction may keep a packing in \
                 motion: try 0.5"
            );
        }
        if self.model.config.gravity != [0.0; 3] {
            hints += "; a bed that falls takes very many substeps: let it settle in a dynamic stage before";
        }
        Error::Simulation {
            step: self.global.step,
            message: format!(
                "increment {increment} (strain [{:.6}, {:.6}, {:.6}]) has not reached equilibrium in {} blocks of {} \
                 substeps: {name} is {value:.3e}, above max_{key}_ratio = {threshold:e}; raise \
                 load.quasi_static.max_blocks or that threshold, or use a smaller strain_increment{hints}",
                strain[0], strain[1], strain[2], settings.max_blocks, settings.substeps
            ),
        }
    }

    /// β √(m_min/K), K the largest stiffness now, or at the overlap to which the next increment may bring contacts.
    fn choose_pseudo_time_step(&mut self, report: &Report) -> Result<()> {
        let bound = self.model.time_step;
        let radius = self.model.max_radius;
        let mut overlap = report.row.max_overlap_ratio * radius;
        if self.relaxation().substep == 0 {
            overlap += self.jump();
        }
        overlap = if overlap > SOFTEST * radius { overlap } else { SOFTEST * radius };
        let expected = bound.reference_stiffness * (overlap / bound.reference_overlap).sqrt();
        let Measured { max_stiffness, max_speed } = report.measured;
        let mut stiffness = bound.impact_stiffness(max_speed);
        for other in [expected, max_stiffness] {
            stiffness = if other > stiffness { other } else { stiffness };
        }
        self.global.time_step = bound.quasi_static_safety * (bound.min_mass / stiffness).sqrt();
        if self.global.time_step.is_finite() {
            return Ok(());
        }
        Err(Error::Simulation {
            step: self.global.step,
            message: "no particle is free to move, so there is no equilibrium to look for; use the dynamic routine"
                .into(),
        })
    }

    /// Overlap that one increment adds at most before anything gives way \[m\].
    fn jump(&self) -> f64 {
        let Some(stage) = self.model.programme.quasi_static_stage(&self.global) else { return 0.0 };
        let along = |axis: usize| match (stage.axes[axis], self.model.programme.kinematics) {
            (AxisControl::StrainRate(increment), Kinematics::Bct) => increment * 2.0 * self.model.max_radius,
            (AxisControl::StrainRate(increment), Kinematics::Bc) => increment * self.global.initial_sides[axis],
            (AxisControl::Stress { .. }, _) => 0.0,
        };
        [0, 1, 2].map(along).into_iter().fold(0.0, |most, jump| if jump > most { jump } else { most })
    }

    /// An increment begins from equilibrium: every free particle is at rest.
    pub(super) fn begin_increment(&mut self) {
        if self.relaxation().substep > 0 {
            return;
        }
        let particles = &mut self.particles;
        for index in 0..particles.owned {
            if particles.record[index].inverse_mass > 0.0 {
                particles.velocity[index] = [0.0; 4];
                particles.spin[index][..3].fill(0.0);
                particles.record[index].velocity = [0.0; 3];
                particles.record[index].spin = [0.0; 3];
            }
        }
    }

    /// After a substep from `strain`: damp the motion, and let the laws know in their next evaluation what
    /// the cell has done in this one.
    pub(super) fn after_substep(&mut self, strain: [f64; 3]) {
        let time_step = self.global.previous_time_step;
        let mut state = self.relaxation();
        self.global.strain_rate = [0, 1, 2].map(|k| (self.global.strain[k] - strain[k]) / time_step);
        match self.model.config.quasi_static.damping {
            Damping::Fire { mixing } => {
                if state.substep == 0 {
                    (state.mixing, state.downhill) = (mixing, 0);
                }
                self.steer_downhill(&mut state, mixing, time_step);
            }
            Damping::Local { coefficient } => {
                self.damp(|v, a| v - coefficient * a.abs() * time_step * if v > 0.0 { 1.0 } else { -1.0 });
            }
            Damping::Viscous { share } => self.damp(|v, _| (1.0 - share) * v),
            Damping::Contact => self.damp(|v, _| v),
        }
        state.substep += 1;
        self.global.quasi_static = Some(state);
    }

    /// Fast inertial relaxation with masses and moments of inertia as metric: `P = Σ F·v`; uphill (P < 0) all
    /// stop, else `v ← (1−α) v + α a √(Σ m v²/Σ m a²)`, and α shrinks after some substeps. The sums are exact, so
    /// that the bits do not depend on ranks and threads.
    ///
    /// # Source
    /// Bitzek et al. 2006 (doi:10.1103/PhysRevLett.97.170201), at a constant time step: the stiffness is known here.
    fn steer_downhill(&mut self, state: &mut QuasiStaticState, mixing: f64, time_step: f64) {
        let mut sums: [ExactSum; 3] = std::array::from_fn(|_| ExactSum::new());
        let (particles, rotation) = (&self.particles, self.model.rotation);
        for index in 0..particles.owned {
            let record = &particles.record[index];
            if record.inverse_mass == 0.0 {
                continue;
            }
            let mut own = parts(&particles.velocity[index], &record.velocity, record.inverse_mass, time_step);
            if rotation {
                let turning = parts(&particles.spin[index], &record.spin, particles.spin[index][3], time_step);
                own = [0, 1, 2].map(|k| own[k] + turning[k]);
            }
            for (sum, part) in sums.iter_mut().zip(own) {
                sum.add(part);
            }
        }
        exact_sum::reduce(&self.comm, &mut sums);
        let [power, motion, force] = sums.each_ref().map(ExactSum::value);
        if power < 0.0 {
            (state.mixing, state.downhill) = (mixing, 0);
            self.damp(|_, _| 0.0);
            return;
        }
        let (alpha, turned) = (state.mixing, if force > 0.0 { (motion / force).sqrt() } else { 0.0 });
        self.damp(|v, a| (1.0 - alpha) * v + alpha * turned * a);
        state.downhill += 1;
        if state.downhill > DOWNHILL.0 {
            state.mixing *= DOWNHILL.1;
        }
    }

    /// Change the half-step velocities and spins of the free particles, component by component, given the last
    /// acceleration. Whatever no force acts on rests: nothing else would ever stop a rattler.
    ///
    /// The full-step velocities become those with which the particles have moved, so that the tangential
    /// increments of the next evaluation are the true displacements, however strong the damping.
    fn damp(&mut self, change: impl Fn(f64, f64) -> f64) {
        let time_step = self.global.previous_time_step;
        let rotation = self.model.rotation;
        let particles = &mut self.particles;
        let damped = |half: &mut [f64; 4], full: &mut [f64; 3]| {
            let forced = (0..3).any(|k| full[k] != half[k]);
            for k in 0..3 {
                let v = half[k];
                half[k] = if forced { change(v, acceleration(full[k], v, time_step)) } else { 0.0 };
                full[k] = v;
            }
        };
        for index in 0..particles.owned {
            let record = &mut particles.record[index];
            if record.inverse_mass == 0.0 {
                continue;
            }
            damped(&mut particles.velocity[index], &mut record.velocity);
            if rotation {
                damped(&mut particles.spin[index], &mut record.spin);
            }
        }
    }
}

/// Parts of one particle in `Σ F·v`, `Σ m v²` and `Σ m a²`, from its half-step and full-step velocities.
fn parts(half: &[f64; 4], full: &[f64; 3], inverse_inertia: f64, time_step: f64) -> [f64; 3] {
    let mut parts = [0.0; 3];
    for k in 0..3 {
        let a = acceleration(full[k], half[k], time_step);
        parts[0] += a * (half[k] - 0.5 * time_step * a);
        parts[1] += half[k] * half[k];
        parts[2] += a * a;
    }
    parts.map(|part| part / inverse_inertia)
}

/// The acceleration that the full-step velocity was extrapolated with, W (2.3).
fn acceleration(full: f64, half: f64, time_step: f64) -> f64 {
    (full - half) / (0.5 * time_step)
}
