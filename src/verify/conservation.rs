//! What a run must keep: momentum, the energy ledger, the order of the integrator.

use super::Claim;
use super::scene::{Scene, Sphere, drive, states};
use crate::error::Result;
use crate::force::observe::Wanted;
use crate::output::history::HistoryRow;
use crate::state::ParticleState;
use crate::state::particles::sphere_mass;

/// Counter-based numbers in (−1, 1), the same everywhere (the mixer of splitmix64).
fn draw(counter: u64) -> f64 {
    let mut z = counter.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

const GAS_RADIUS: f64 = 1e-3;
const GAS_DENSITY: f64 = 2500.0;

/// A gas and what its cell does.
#[derive(Clone, Copy)]
struct Gas {
    restitution: f64,
    friction: f64,
    /// Stages.
    load: &'static str,
    /// The faces of the cell move, not the particles with it (BC).
    faces_move: bool,
}

const RESTING: &str = "[[stage]]\nhold = true\nduration = 5e-3\n";
/// The cell changes its shape, with a jump of its rates on the way.
const DEFORMING: &str = "[[stage]]\nstrain_rate = [40, 10, -20]\nduration = 3e-3\n\
                      [[stage]]\nstrain_rate = [-20, 0, 30]\nduration = 2e-3\n";

/// 36 spheres of two sizes on a loose grid, with random velocities and spins.
fn gas_scene(time_step: f64, Gas { restitution, friction, load, faces_move }: Gas) -> Scene {
    let kinematics = if faces_move { "BC" } else { "BCT" };
    let spacing = 2.4 * GAS_RADIUS;
    let spheres = (0..36_u64).map(|k| {
        let number = |component: u64| draw(16 * k + component);
        Sphere {
            position: [k % 3, k / 3 % 3, k / 9].map(|index| (index as f64 + 0.3) * spacing),
            radius: if k % 2 == 0 { GAS_RADIUS } else { 0.8 * GAS_RADIUS },
            velocity: [number(0), number(1), number(2)],
            spin: [3, 4, 5].map(|component| 300.0 * number(component)),
            ..Sphere::default()
        }
    });
    Scene {
        sides: [3.0 * spacing, 3.0 * spacing, 4.0 * spacing],
        material: format!(
            "density = {GAS_DENSITY}\nyoung_modulus = \"50 MPa\"\npoisson_ratio = 0.3\nrestitution = {restitution}\n\
             friction = {friction}"
        ),
        sections: format!(
            "[contact.normal.hertz]\n[contact.tangential.mindlin]\n[time_step]\nfixed = {time_step:e}\n\
             [load]\nkinematics = \"{kinematics}\"\n{load}[output]\nenergy_ledger = true\n"
        ),
        spheres: spheres.collect(),
        ..Scene::default()
    }
}

/// Total momentum \[kg m/s\] and the sum of its magnitudes.
fn momentum(particles: &[ParticleState]) -> ([f64; 3], f64) {
    let mut total = [0.0; 3];
    let mut magnitude = 0.0;
    for particle in particles {
        let mass = sphere_mass(particle.radius, GAS_DENSITY);
        for k in 0..3 {
            total[k] += mass * particle.velocity[k];
            magnitude += mass * particle.velocity[k].abs();
        }
    }
    (total, magnitude)
}

/// Kinetic, held and dissipated energy, less the work done on the system \[J\]: constant.
fn balance(row: &HistoryRow) -> f64 {
    let [cell, body, driven, dissipated @ ..] = row.ledger;
    row.kinetic + row.elastic + row.viscoelastic + dissipated.iter().sum::<f64>() - (cell + body + driven)
}

/// What became of a gas.
struct GasRun {
    /// Largest change of momentum over the sum of magnitudes.
    momentum_drift: f64,
    /// Change of the energy balance to the end over the initial kinetic energy.
    energy_error: f64,
    /// The largest on the way.
    worst_error: f64,
}

fn gas_run(time_step: f64, gas: Gas) -> Result<GasRun> {
    let mut simulation = gas_scene(time_step, gas).start()?;
    let (before, magnitude) = momentum(&states(&mut simulation)?);
    let mut rows: Vec<HistoryRow> = Vec::new();
    drive(
        &mut simulation,
        |global| Wanted { sums: global.step % 500 == 0, ..Wanted::default() },
        |_, report| {
            rows.push(report.row);
            Ok(())
        },
    )?;
    let (after, _) = momentum(&states(&mut simulation)?);
    let momentum_drift = (0..3).map(|k| (after[k] - before[k]).abs()).fold(0.0, f64::max) / magnitude;
    let mut errors = rows.iter().map(|row| (balance(row) - balance(&rows[0])) / rows[0].kinetic);
    let worst_error = errors.clone().map(f64::abs).fold(0.0, f64::max);
    Ok(GasRun { momentum_drift, energy_error: errors.next_back().unwrap_or(f64::NAN), worst_error })
}

/// Time step of the gas \[s\]: a contact lasts some 900 of them.
const STEP: f64 = 1e-7;

/// A periodic gas over several collisions of each sphere.
pub fn gas() -> Result<Vec<Claim>> {
    let mut claims = Vec::new();
    for (name, gas, bound) in [
        ("elastic", Gas { restitution: 1.0, friction: 0.0, load: RESTING, faces_move: false }, 5e-6),
        ("frictional", Gas { restitution: 1.0, friction: 0.5, load: RESTING, faces_move: false }, 1e-5),
        ("damped", Gas { restitution: 0.7, friction: 0.5, load: RESTING, faces_move: false }, 1e-4),
        ("elastic, BCT", Gas { restitution: 1.0, friction: 0.0, load: DEFORMING, faces_move: false }, 5e-6),
        ("elastic, BC", Gas { restitution: 1.0, friction: 0.0, load: DEFORMING, faces_move: true }, 5e-6),
        ("damped, BC", Gas { restitution: 0.7, friction: 0.5, load: DEFORMING, faces_move: true }, 1e-4),
    ] {
        let fine = gas_run(STEP, gas)?;
        if !gas.faces_move {
            claims.push(Claim::bounded(format!("{name}: relative drift of momentum"), 1e-12, fine.momentum_drift));
        }
        claims.push(Claim::bounded(
            format!("{name}: worst energy balance over kinetic energy"),
            bound,
            fine.worst_error,
        ));
        let finer = gas_run(0.5 * STEP, gas)?;
        // Sliding and the clipped ends of damped contacts make it first order.
        let share = finer.worst_error / fine.worst_error;
        claims.push(Claim::bounded(format!("{name}: worst at half the step over that"), 0.6, share));
        if name == "elastic" {
            let ratio = fine.energy_error / finer.energy_error;
            claims.push(Claim::relative(format!("{name}: error over that at half the step"), 4.0, ratio, 0.05));
        }
    }
    Ok(claims)
}

/// A sphere bobbing on a wall under gravity without leaving it, at four fixed time steps, against a
/// Runge–Kutta solution of `m z̈ = 4/3 E √R (R−z)^{3/2} − m g`.
pub fn order() -> Result<Vec<Claim>> {
    const RADIUS: f64 = 5e-3;
    const GRAVITY: f64 = 9.81;
    const SPAN: f64 = 4e-3;
    const STEPS: [f64; 4] = [200.0, 400.0, 800.0, 1600.0];
    let (mass, modulus) = (sphere_mass(RADIUS, 2500.0), 1e7 / (2.0 * (1.0 - 0.09)));
    let stiffness = 4.0 / 3.0 * modulus * RADIUS.sqrt();
    let root = libm::cbrt(mass * GRAVITY / stiffness);
    // Released from 1.3 times the overlap at rest.
    let height = RADIUS - 1.3 * root * root;
    let exact = runge_kutta(height, SPAN, |z| stiffness * (RADIUS - z).sqrt() * (RADIUS - z) / mass - GRAVITY);
    let mut errors = Vec::new();
    for steps in STEPS {
        let material = "density = 2500\nyoung_modulus = \"10 MPa\"\npoisson_ratio = 0.3";
        let scene = Scene {
            sides: [8.0 * RADIUS; 3],
            wall: Some(material.to_owned()),
            material: material.to_owned(),
            sections: format!(
                "[contact.normal.hertz]\ndamping = \"none\"\n[gravity]\nz = -{GRAVITY}\n\
                 [time_step]\nfixed = {:e}\n[[stage]]\nhold = true\nduration = {SPAN:e}\n",
                SPAN / steps
            ),
            spheres: vec![Sphere {
                position: [4.0 * RADIUS, 4.0 * RADIUS, height],
                radius: RADIUS,
                ..Sphere::default()
            }],
        };
        errors.push(scene.run()?[0].position[2] - exact);
    }
    let mut claims: Vec<Claim> = errors
        .windows(2)
        .zip(STEPS)
        .map(|(pair, steps)| {
            let text = format!("error at {steps} steps over error at {} steps", 2.0 * steps);
            Claim::relative(text, 4.0, pair[0] / pair[1], 0.02)
        })
        .collect();
    let amplitude = 0.3 * root * root;
    claims.push(Claim::bounded("error at 1600 steps over amplitude", 1e-4, errors[3] / amplitude));
    Ok(claims)
}

/// Position after `span` of a body that starts at rest at `start`, classical fourth order.
fn runge_kutta(start: f64, span: f64, acceleration: impl Fn(f64) -> f64) -> f64 {
    let steps = 20_000;
    let h = span / f64::from(steps);
    let (mut z, mut v) = (start, 0.0);
    for _ in 0..steps {
        let (z1, v1) = (v, acceleration(z));
        let (z2, v2) = (v + 0.5 * h * v1, acceleration(z + 0.5 * h * z1));
        let (z3, v3) = (v + 0.5 * h * v2, acceleration(z + 0.5 * h * z2));
        let (z4, v4) = (v + h * v3, acceleration(z + h * z3));
        z += h / 6.0 * (z1 + 2.0 * z2 + 2.0 * z3 + z4);
        v += h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4);
    }
    z
}
