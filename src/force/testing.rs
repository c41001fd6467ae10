//! Helpers of the laws' tests: pairs, touches and a one-contact integrator.

use super::law::{Energies, NormalLaw, Touch};
use super::registry::{LawChoice, PairProperties, ParameterKind, ParameterValue, Role, find};
use crate::config::{MaxwellBranch, PairConfig, Velocities};

/// Polyvinylidene fluoride of W Table 1 with its one Maxwell branch.
pub fn pvdf() -> PairProperties {
    let branch = MaxwellBranch { modulus: 404.6e6, relaxation_time: 728.28e6 / 404.6e6 };
    properties(1365.9e6, 0.4314, vec![branch])
}

/// Equal materials.
pub fn properties(young_modulus: f64, poisson_ratio: f64, maxwell: Vec<MaxwellBranch>) -> PairProperties {
    PairProperties {
        names: ["left".to_owned(), "right".to_owned()],
        young_modulus: [young_modulus; 2],
        poisson_ratio: [poisson_ratio; 2],
        maxwell: [maxwell.clone(), maxwell],
        yield_stress: [None; 2],
        restitution: 0.7,
        friction: 0.4,
        rolling_friction: 0.05,
        twisting_friction: 0.02,
        surface_energy: 1e-4,
        velocities: Velocities::default(),
    }
}

/// A registered law with its defaults, but for the settings given as (key, value as in the input).
pub fn choice(role: Role, name: &str, settings: &[(&str, &str)]) -> LawChoice {
    let mut choice = find(role, name).unwrap().with_defaults();
    for (key, value) in settings {
        let index = choice.law.parameters.iter().position(|p| p.name == *key).unwrap();
        choice.values[index] = match choice.law.parameters[index].kind {
            ParameterKind::Number { .. } => ParameterValue::Number(value.parse().unwrap()),
            ParameterKind::Choice(words) => ParameterValue::Choice(words.iter().position(|w| w == value).unwrap()),
            ParameterKind::Flag => ParameterValue::Flag(value.parse().unwrap()),
        };
    }
    choice
}

/// A frictionless pair with this normal law.
pub fn pair(properties: PairProperties, normal: LawChoice) -> PairConfig {
    PairConfig { materials: [0, 0], properties, normal, tangential: None, rolling: None }
}

/// NMC of B Table 1: E = 142 GPa, ν = 0.25, Y = 7.9 GPa.
pub fn nmc() -> PairProperties {
    PairProperties { yield_stress: [Some(7.9e9); 2], ..properties(142e9, 0.25, Vec::new()) }
}

/// Rows of numbers of a reference table, without its header.
pub fn table(csv: &str) -> Vec<Vec<f64>> {
    csv.lines().skip(1).map(|line| line.split(',').map(|field| field.trim().parse().unwrap()).collect()).collect()
}

/// A touch along z without tangential motion.
pub fn touch(overlap: f64, overlap_rate: f64, effective_radius: f64, effective_mass: f64) -> Touch<f64> {
    Touch {
        overlap,
        overlap_rate,
        effective_radius,
        radius_factor: 1.0,
        overlap_factor: 1.0,
        size: 4.0 * effective_radius,
        effective_mass,
        normal: [0.0, 0.0, 1.0],
        slip_velocity: [0.0; 3],
        relative_spin: [0.0; 3],
        spin_about_normal: 0.0,
    }
}

/// Rates of dissipation added up over a path, the held energies at its end.
pub fn accumulate(total: &mut Energies<f64>, step: &Energies<f64>) {
    total.elastic = step.elastic;
    total.viscoelastic = step.viscoelastic;
    total.damping += step.damping;
    total.viscous += step.viscous;
    total.friction += step.friction;
    total.plastic += step.plastic;
}

/// Everything in the ledger but work and kinetic energy.
pub fn sum(e: &Energies<f64>) -> f64 {
    e.elastic + e.viscoelastic + e.damping + e.viscous + e.friction + e.plastic
}

/// What is left of an impact.
pub struct Impact {
    /// Exit speed over impact speed.
    pub restitution: f64,
    /// Time in contact \[s\], to first order in the time step.
    pub duration: f64,
    /// Largest difference between the ledger and the impact energy, over the impact energy.
    pub ledger_error: f64,
    /// Ledger after the contact.
    pub energies: Energies<f64>,
}

/// Head-on impact of the reduced mass, leap-frog with synchronised velocities (W 2.1–2.4).
pub fn impact<N: NormalLaw>(mut law: N, radius: f64, mass: f64, speed: f64, time_step: f64) -> Impact {
    law.prepare(time_step);
    let mut memory = vec![0.0; N::MEMORY];
    let mut energies = Energies::zero();
    let (mut overlap, mut half_step_speed, mut acceleration) = (speed * time_step, speed, 0.0);
    let mut duration = time_step;
    let kinetic = |v: f64| 0.5 * mass * v * v;
    let mut ledger_error: f64 = 0.0;
    while overlap > 0.0 {
        let rate = half_step_speed + 0.5 * acceleration * time_step;
        let response = law.evaluate(&touch(overlap, rate, radius, mass), &mut memory);
        accumulate(&mut energies, &response.energies);
        acceleration = -response.force / mass;
        let synchronised = half_step_speed + 0.5 * acceleration * time_step;
        ledger_error = ledger_error.max((kinetic(synchronised) + sum(&energies) - kinetic(speed)).abs());
        half_step_speed += acceleration * time_step;
        overlap += half_step_speed * time_step;
        duration += time_step;
    }
    // The contact ended between the last two steps.
    duration -= overlap / half_step_speed;
    Impact { restitution: -half_step_speed / speed, duration, ledger_error: ledger_error / kinetic(speed), energies }
}
