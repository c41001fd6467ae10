//! A sphere on a wall under gravity: sliding, rolling, coming to rest.

use super::Claim;
use super::scene::{Scene, Sphere, drive, states};
use crate::error::Result;
use crate::force::observe::Wanted;
use crate::state::ParticleState;
use crate::state::particles::sphere_mass;

const RADIUS: f64 = 5e-3;
const DENSITY: f64 = 2500.0;
const YOUNG: f64 = 1e9;
const POISSON: f64 = 0.3;
const GRAVITY: f64 = 9.81;
const FRICTION: f64 = 0.3;
/// The springs' give and δ/R are of order 1e-4, the step over the sliding time is 4e-4.
const SHARE: f64 = 1e-3;
const STEP: f64 = 2e-5;

/// Overlap under the sphere's own weight \[m\].
fn settled_overlap() -> f64 {
    let modulus = YOUNG / (2.0 * (1.0 - POISSON * POISSON));
    let weight = sphere_mass(RADIUS, DENSITY) * GRAVITY;
    let root = libm::cbrt(weight / (4.0 / 3.0 * modulus * RADIUS.sqrt()));
    root * root
}

/// A settled sphere that starts along x with this velocity \[m/s\] and spin about y \[rad/s\].
fn scene(velocity: f64, spin: f64, rolling_friction: f64, duration: f64) -> Scene {
    let sphere = Sphere {
        position: [0.1 * RADIUS, 4.0 * RADIUS, RADIUS - settled_overlap()],
        radius: RADIUS,
        velocity: [velocity, 0.0, 0.0],
        spin: [0.0, spin, 0.0],
        ..Sphere::default()
    };
    let rolling = if rolling_friction > 0.0 { "[contact.rolling.spring_slider]\n" } else { "" };
    let material = format!(
        "density = {DENSITY}\nyoung_modulus = {YOUNG:e}\npoisson_ratio = {POISSON}\nrestitution = 0.5\n\
         friction = {FRICTION}\nrolling_friction = {rolling_friction}"
    );
    Scene {
        sides: [400.0 * RADIUS, 8.0 * RADIUS, 8.0 * RADIUS],
        wall: Some(material.clone()),
        material,
        sections: format!(
            "[contact.normal.hertz]\n[contact.tangential.mindlin]\n{rolling}[gravity]\nz = -{GRAVITY}\n\
             [time_step]\nfixed = {STEP:e}\n[[stage]]\nhold = true\nduration = {duration:e}\n"
        ),
        spheres: vec![sphere],
    }
}

/// Time \[s\] of the first state for which `reached`, and the final state.
fn watch(scene: &Scene, reached: impl Fn(&ParticleState) -> bool) -> Result<(f64, ParticleState)> {
    let mut simulation = scene.start()?;
    let mut time = f64::NAN;
    drive(
        &mut simulation,
        |_| Wanted { samples: true, ..Wanted::default() },
        |simulation, _| {
            if time.is_nan() && reached(&states(simulation)?[0]) {
                time = simulation.global().time;
            }
            Ok(())
        },
    )?;
    Ok((time, states(&mut simulation)?[0]))
}

/// The three cases.
pub fn to_rest() -> Result<Vec<Claim>> {
    let mut claims = slide_then_roll()?;
    claims.extend(roll_to_rest()?);
    claims.extend(slide_to_rest()?);
    Ok(claims)
}

/// Sliding ends after `2 v_0/(7 μ g)`; angular momentum about the contact leaves `5/7 v_0`.
fn slide_then_roll() -> Result<Vec<Claim>> {
    let start = 0.5;
    let expected = 2.0 * start / (7.0 * FRICTION * GRAVITY);
    let arm = RADIUS - settled_overlap();
    let (time, state) = watch(&scene(start, 0.0, 0.0, 2.0 * expected), |s| s.velocity[0] <= arm * s.spin[1])?;
    let rolling = 5.0 / 7.0 * start;
    Ok(vec![
        Claim::relative("slides until 2 v/(7 mu g), s", expected, time, SHARE),
        Claim::relative("then rolls at 5/7 v, m/s", rolling, state.velocity[0], SHARE),
        Claim::relative("without slip: spin, rad/s", rolling / RADIUS, state.spin[1], SHARE),
    ])
}

/// The moment `μ_r R m g` against rolling without slip: `(m + I/R²) a = −μ_r m g`, so `a = −5/7 μ_r g`
/// and the way is `7 v²/(10 μ_r g)`.
fn roll_to_rest() -> Result<Vec<Claim>> {
    let (start, rolling_friction) = (0.1, 0.02);
    let time = 7.0 * start / (5.0 * rolling_friction * GRAVITY);
    let scene = scene(start, start / RADIUS, rolling_friction, 1.5 * time);
    let state = scene.run()?[0];
    let way = state.position[0] - scene.spheres[0].position[0];
    Ok(vec![
        Claim::relative("rolls to rest in 7 v^2/(10 mu_r g), m", 0.5 * start * time, way, SHARE),
        Claim::bounded("and stays there: velocity, m/s", 1e-9, state.velocity[0]),
    ])
}

/// Rolling friction above the sliding one keeps the sphere from turning: a block, with the deceleration
/// `μ g`.
fn slide_to_rest() -> Result<Vec<Claim>> {
    let start = 0.5;
    let time = start / (FRICTION * GRAVITY);
    let scene = scene(start, 0.0, 2.0 * FRICTION, 1.5 * time);
    let state = scene.run()?[0];
    let way = state.position[0] - scene.spheres[0].position[0];
    Ok(vec![
        Claim::relative("block slides to rest in v^2/(2 mu g), m", 0.5 * start * time, way, SHARE),
        Claim::bounded("and stays there: velocity, m/s", 1e-9, state.velocity[0]),
    ])
}
