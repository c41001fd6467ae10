//! The time step: `Δt = β √(m_min/K_max)`, W (2.8), with K the largest contact stiffness now or soon, and β lowered where
//! dashpots ask for it.

use crate::config::TimeStepConfig;
use crate::error::{Error, Result};

/// What bounds the time step, constant over a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeStepControl {
    /// Automatic or fixed.
    pub config: TimeStepConfig,
    /// Smallest mass of a free particle \[kg\]; infinite if none is free.
    pub min_mass: f64,
    /// Largest mass of a free particle \[kg\].
    pub max_mass: f64,
    /// Overlap at which `reference_stiffness` is taken \[m\].
    pub reference_overlap: f64,
    /// Stiffness of the stiffest pair at the reference overlap \[N/m\]: the floor of K.
    pub reference_stiffness: f64,
    /// Largest β that the dashpots allow ([`crate::config::Config::damped_safety`]).
    pub damped_safety: f64,
    /// β of quasi-static stages ([`crate::config::Config::quasi_static_safety`]).
    pub quasi_static_safety: f64,
}

/// What is measured at a control step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Largest contact stiffness \[N/m\].
    pub max_stiffness: f64,
    /// Largest particle speed \[m/s\].
    pub max_speed: f64,
}

impl TimeStepControl {
    /// Stiffness that the fastest particles can reach in a head-on impact: with `K = K_r √(δ/δ_r)`
    /// the spring takes up `½ m v²` at `δ^{5/2} = (15/8) m v² √δ_r/K_r`.
    #[must_use]
    pub fn impact_stiffness(&self, speed: f64) -> f64 {
        if speed == 0.0 || !self.max_mass.is_finite() || self.reference_stiffness == 0.0 {
            return 0.0;
        }
        // Two equal particles at ±v: m_eff = m/2, relative speed 2v.
        let energy = 0.5 * self.max_mass * 4.0 * speed * speed;
        let per_root = self.reference_stiffness / self.reference_overlap.sqrt();
        let overlap = libm::pow(15.0 / 8.0 * energy / per_root, 0.4);
        per_root * overlap.sqrt()
    }

    /// The automatic time step \[s\]; infinite when nothing is free to move.
    #[must_use]
    pub fn automatic(&self, measured: Measured) -> f64 {
        let safety = match self.config {
            TimeStepConfig::Automatic { safety, .. } => safety,
            TimeStepConfig::Fixed(_) => 0.17,
        };
        safety.min(self.damped_safety) * self.of_stiffness(measured)
    }

    /// √(m_min/K_max) \[s\].
    fn of_stiffness(&self, measured: Measured) -> f64 {
        let mut stiffness = self.reference_stiffness;
        for other in [measured.max_stiffness, self.impact_stiffness(measured.max_speed)] {
            if other > stiffness {
                stiffness = other;
            }
        }
        (self.min_mass / stiffness).sqrt()
    }

    /// The step to use until the next control step \[s\], and a warning about a large fixed one.
    ///
    /// # Errors
    /// A fixed step beyond the stability limit `2 √(m_min/K_max)` of one contact, W (2.7); a speed or stiffness so large
    /// that no time step is left.
    pub fn choose(&self, measured: Measured, step: u64) -> Result<(f64, Option<String>)> {
        let automatic = self.automatic(measured);
        if automatic == 0.0 {
            let Measured { max_stiffness, max_speed } = measured;
            return Err(Error::Simulation {
                step,
                message: format!(
                    "no time step is small enough for the largest speed, {max_speed:e} m/s, and contact stiffness, \
                     {max_stiffness:e} N/m; look at the units of radii, densities, velocities and moduli"
                ),
            });
        }
        let TimeStepConfig::Fixed(fixed) = self.config else { return Ok((automatic, None)) };
        let limit = 2.0 * self.of_stiffness(measured);
        if fixed > limit {
            return Err(Error::Simulation {
                step,
                message: format!(
                    "the time step of {fixed:.3e} s is unstable: the limit of one contact is {limit:.3e} s (W 2.7); \
                     use time_step.automatic or at most {automatic:.3e} s"
                ),
            });
        }
        let warning = (fixed > automatic).then(|| {
            format!(
                "step {step}: the time step of {fixed:.3e} s is larger than the recommended {automatic:.3e} s (W 2.8)"
            )
        });
        Ok((fixed, warning))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_that_leaves_no_time_step_is_an_error() {
        let config = TimeStepConfig::Automatic { safety: 0.17, reference_overlap: 1e-3 };
        let control = TimeStepControl {
            config,
            min_mass: 1e-9,
            max_mass: 1e-9,
            reference_overlap: 1e-8,
            reference_stiffness: 1e4,
            damped_safety: f64::INFINITY,
            quasi_static_safety: 0.3,
        };
        let at = |max_speed| control.choose(Measured { max_stiffness: 0.0, max_speed }, 0);
        assert!(at(1.0).is_ok_and(|(step, _)| step > 0.0));
        assert!(at(f64::INFINITY).unwrap_err().to_string().contains("no time step is small enough"));
    }
}
