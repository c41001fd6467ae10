//! Oblique impacts that slide all the way: the impulses of rigid bodies.
//!
//! Sphere of Chung & Ooi 2011, tests 4 and 5 (Kharaz et al. 2001): aluminium oxide, R = 2.5 mm,
//! E = 380 GPa, ν = 0.23, ρ = 4000 kg/m³, μ = 0.092, e = 0.98.

use super::Claim;
use super::collision::{Impact, sections};
use super::scene::{Scene, Sphere};
use crate::error::Result;
use crate::state::ParticleState;
use crate::state::particles::sphere_mass;

const RADIUS: f64 = 2.5e-3;
const DENSITY: f64 = 4000.0;
const MODULUS: f64 = 380e9 / (2.0 * (1.0 - 0.23 * 0.23));
const FRICTION: f64 = 0.092;
/// Impact speed on the wall \[m/s\].
const SPEED: f64 = 3.9;
/// Spheres meet a thousand times slower: while they touch, the normal turns by an angle that falls with
/// the speed as v^{4/5}, here 2e-5, and the rigid limit knows none.
const SLOW: f64 = 3.9e-3;
/// Error of the impulses with 8000 steps in a contact, and of the rigid limit at the slow speed.
const SHARE: f64 = 1e-4;

/// Name of a law and its damping.
const LAWS: [(&str, &str); 2] = [("elastic", "none"), ("e = 0.98", "tsuji")];

fn scene(damping: &str, duration: f64, wall: bool, spheres: Vec<Sphere>) -> Scene {
    let material = format!(
        "density = {DENSITY}\nyoung_modulus = \"380 GPa\"\npoisson_ratio = 0.23\nfriction = {FRICTION}\nrestitution = 0.98"
    );
    let laws = format!("[contact.normal.hertz]\ndamping = \"{damping}\"\n[contact.tangential.mindlin]\n");
    Scene {
        sides: [16.0 * RADIUS; 3],
        wall: wall.then(|| material.clone()),
        material,
        sections: sections(&laws, duration),
        spheres,
    }
}

/// A sphere on the low z wall. While it slides the tangential impulse is μ times the normal one, so with
/// the impact angle θ from the normal, `e_t = v_t'/v_t = 1 − μ(1+e)/tan θ`, and the spin becomes
/// `ω' = (5/2) μ(1+e) v_n r/R²`; e is the restitution that the run shows, r the [`mean_arm`] (R for rigid
/// bodies).
pub fn wall() -> Result<Vec<Claim>> {
    let mut claims = Vec::new();
    for (name, damping) in LAWS {
        for degrees in [45.0, 60.0, 75.0] {
            let angle = f64::to_radians(degrees);
            let (along, down) = (SPEED * libm::sin(angle), SPEED * libm::cos(angle));
            let mass = sphere_mass(RADIUS, DENSITY);
            let impact = Impact { modulus: MODULUS, radius: RADIUS, mass, speed: down };
            let sphere = Sphere {
                position: [8.0 * RADIUS, 8.0 * RADIUS, RADIUS * (1.0 + 1e-9)],
                radius: RADIUS,
                velocity: [along, 0.0, -down],
                ..Sphere::default()
            };
            let after = scene(damping, impact.duration(), true, vec![sphere]).run()?[0];
            let gained = FRICTION * (after.velocity[2] + down);
            let what = format!("{name}, {degrees} deg");
            let ratio = after.velocity[0] / along;
            claims.push(Claim::relative(format!("{what}: tangential restitution"), 1.0 - gained / along, ratio, SHARE));
            let spin = 2.5 * gained * mean_arm(&impact) / (RADIUS * RADIUS);
            claims.push(Claim::relative(format!("{what}: spin, rad/s"), spin, after.spin[1], SHARE));
        }
    }
    claims.extend(spinning_on_wall()?);
    Ok(claims)
}

/// Distance of a wall from the centre \[m\], weighted with the force over an elastic impact:
/// `R − δ_max ½ B(7/5, 1/2)`, from `∫ F δ dt/∫ F dt` with `dt ∝ ds/√(1 − s^{5/2})`, s = δ/δ_max.
fn mean_arm(impact: &Impact) -> f64 {
    let beta = libm::tgamma(1.4) * std::f64::consts::PI.sqrt() / libm::tgamma(1.9);
    RADIUS - 0.5 * beta * impact.overlap()
}

/// A sphere that falls straight but spins: `v_t' = μ(1+e) v_n`, against the slip.
fn spinning_on_wall() -> Result<Vec<Claim>> {
    let (speed, spin) = (0.2, 500.0);
    let impact = Impact { modulus: MODULUS, radius: RADIUS, mass: sphere_mass(RADIUS, DENSITY), speed };
    let sphere = Sphere {
        position: [8.0 * RADIUS, 8.0 * RADIUS, RADIUS * (1.0 + 1e-9)],
        radius: RADIUS,
        velocity: [0.0, 0.0, -speed],
        spin: [0.0, spin, 0.0],
        ..Sphere::default()
    };
    let after = scene("none", impact.duration(), true, vec![sphere]).run()?[0];
    let gained = 2.0 * FRICTION * speed;
    let lost = 2.5 * gained * mean_arm(&impact) / (RADIUS * RADIUS);
    Ok(vec![
        Claim::relative("spinning at 500 rad/s: tangential velocity, m/s", gained, after.velocity[0], SHARE),
        Claim::relative("spinning at 500 rad/s: spin lost, rad/s", lost, spin - after.spin[1], SHARE),
    ])
}

/// Two equal spheres meeting at an angle. The relative normal speed `v_n` gives each the impulse
/// `m v_n (1+e)/2`, μ times that along the slip, and the spin `(5/2) μ (1+e) v_n/(2R)`.
pub fn spheres() -> Result<Vec<Claim>> {
    let mut claims = Vec::new();
    for (name, damping) in LAWS {
        for degrees in [45.0, 75.0] {
            let angle = f64::to_radians(degrees);
            let (across, towards) = (0.5 * SLOW * libm::sin(angle), 0.5 * SLOW * libm::cos(angle));
            let mass = sphere_mass(RADIUS, DENSITY);
            let impact = Impact { modulus: MODULUS, radius: 0.5 * RADIUS, mass: 0.5 * mass, speed: 2.0 * towards };
            let sphere = |sign: f64| Sphere {
                position: [8.0 * RADIUS - sign * RADIUS * (1.0 + 1e-9), 8.0 * RADIUS, 8.0 * RADIUS],
                radius: RADIUS,
                velocity: [sign * towards, sign * across, 0.0],
                ..Sphere::default()
            };
            let before = [sphere(1.0), sphere(-1.0)];
            let after = scene(damping, impact.duration(), false, before.to_vec()).run()?;
            let what = format!("{name}, {degrees} deg");
            claims.extend(pair_claims(&what, &before, &after));
        }
    }
    Ok(claims)
}

fn pair_claims(what: &str, before: &[Sphere; 2], after: &[ParticleState]) -> Vec<Claim> {
    let [vx, vy, _] = before[0].velocity;
    let gained = FRICTION * (vx - after[0].velocity[0]);
    let ratio = after[0].velocity[1] / vy;
    let momentum = (0..2).map(|k| angular_momentum(after[k].position, after[k].velocity, after[k].spin)).sum::<f64>();
    let initial = before.iter().map(|s| angular_momentum(s.position, s.velocity, s.spin)).sum::<f64>();
    let drift = (momentum - initial) / initial;
    vec![
        Claim::relative(format!("{what}: tangential restitution"), 1.0 - gained / vy, ratio, SHARE),
        Claim::relative(format!("{what}: spin, rad/s"), -2.5 * gained / RADIUS, after[0].spin[2], SHARE),
        Claim::absolute(format!("{what}: spin of the other over it"), 1.0, after[1].spin[2] / after[0].spin[2], 1e-9),
        Claim::bounded(format!("{what}: angular momentum, relative drift"), 1e-11, drift),
    ]
}

/// Angular momentum about the z axis through the middle of the cell, per mass \[m²/s\].
fn angular_momentum(position: [f64; 3], velocity: [f64; 3], spin: [f64; 3]) -> f64 {
    let [x, y] = [position[0] - 8.0 * RADIUS, position[1] - 8.0 * RADIUS];
    x * velocity[1] - y * velocity[0] + 0.4 * RADIUS * RADIUS * spin[2]
}
