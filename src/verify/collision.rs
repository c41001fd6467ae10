//! Head-on impacts: the elastic Hertz solution and restitution.

use super::Claim;
use super::scene::{Scene, Sphere, drive};
use crate::error::Result;
use crate::force::observe::Wanted;
use crate::state::particles::sphere_mass;

/// Steps in one elastic contact: the contact time is known to one step.
const STEPS_PER_CONTACT: f64 = 8000.0;

/// The elastic impact of two bodies: effective modulus \[Pa\], radius \[m\], mass \[kg\] and relative
/// speed \[m/s\].
#[derive(Debug, Clone, Copy)]
pub struct Impact {
    pub modulus: f64,
    pub radius: f64,
    pub mass: f64,
    pub speed: f64,
}

impl Impact {
    /// Largest overlap \[m\]: `½ m v² = (8/15) E √R δ^{5/2}`.
    pub fn overlap(&self) -> f64 {
        let energy = 0.5 * self.mass * self.speed * self.speed;
        libm::pow(15.0 / 8.0 * energy / (self.modulus * self.radius.sqrt()), 0.4)
    }

    /// Largest force \[N\], `4/3 E √R δ^{3/2}`.
    pub fn force(&self) -> f64 {
        let overlap = self.overlap();
        4.0 / 3.0 * self.modulus * (self.radius * overlap).sqrt() * overlap
    }

    /// Contact time \[s\], `t = 2 (δ/v) ∫₀¹ ds/√(1 − s^{5/2})`; the integral is
    /// `√π Γ(7/5)/Γ(9/10)`.
    pub fn duration(&self) -> f64 {
        let integral = std::f64::consts::PI.sqrt() * libm::tgamma(1.4) / libm::tgamma(0.9);
        2.0 * integral * self.overlap() / self.speed
    }
}

/// What a contact did, as observed at every step.
#[derive(Debug, Clone, Copy, Default)]
struct Peaks {
    force: f64,
    overlap: f64,
    steps: f64,
}

fn observe(scene: &Scene) -> Result<Peaks> {
    let mut peaks = Peaks::default();
    let wanted = Wanted { samples: true, ..Wanted::default() };
    drive(
        &mut scene.start()?,
        |_| wanted,
        |_, report| {
            for sample in &report.samples {
                peaks.force = peaks.force.max(sample.normal_force);
                peaks.overlap = peaks.overlap.max(sample.overlap);
                peaks.steps += 1.0;
            }
            Ok(())
        },
    )?;
    Ok(peaks)
}

/// Sections of a collision that lasts about `duration` \[s\]: `laws` from the elastic touch, some time to
/// part again.
pub fn sections(laws: &str, duration: f64) -> String {
    let step = duration / STEPS_PER_CONTACT;
    format!("{laws}\n[time_step]\nfixed = {step:e}\n[[stage]]\nhold = true\nduration = {:e}\n", 2.5 * duration)
}

const ELASTIC: &str = "[contact.normal.hertz]\ndamping = \"none\"\n";

/// Two spheres at ± `speed` along x, a hair apart; `laws` and the time for a contact of this duration.
fn head_on(radius: f64, speed: f64, material: &str, laws: &str, duration: f64) -> Scene {
    head_on_with(radius, speed, material, sections(laws, duration))
}

/// Two spheres at ± `speed` along x, a hair apart, and all other sections of the input.
pub fn head_on_with(radius: f64, speed: f64, material: &str, sections: String) -> Scene {
    let gap = radius * (1.0 + 1e-9);
    let sphere = |sign: f64| Sphere {
        position: [4.0 * radius - sign * gap, 4.0 * radius, 4.0 * radius],
        radius,
        velocity: [sign * speed, 0.0, 0.0],
        ..Sphere::default()
    };
    Scene {
        sides: [8.0 * radius; 3],
        material: material.to_owned(),
        sections,
        spheres: vec![sphere(1.0), sphere(-1.0)],
        ..Scene::default()
    }
}

/// A sphere falling on the low z wall at `speed`.
fn on_wall(radius: f64, speed: f64, material: &str, wall: &str, laws: &str, duration: f64) -> Scene {
    let sphere = Sphere {
        position: [4.0 * radius, 4.0 * radius, radius * (1.0 + 1e-9)],
        radius,
        velocity: [0.0, 0.0, -speed],
        ..Sphere::default()
    };
    Scene {
        sides: [8.0 * radius; 3],
        wall: Some(wall.to_owned()),
        material: material.to_owned(),
        sections: sections(laws, duration),
        spheres: vec![sphere],
    }
}

/// Chung & Ooi 2011 (doi:10.1007/s10035-011-0277-0), test 1: glass spheres, R = 10 mm, ± 10 m/s. Their
/// numbers are right to the last digit printed.
pub fn spheres() -> Result<Vec<Claim>> {
    let (radius, speed) = (0.01, 10.0);
    let impact = Impact {
        modulus: 48e9 / (2.0 * (1.0 - 0.2 * 0.2)),
        radius: 0.5 * radius,
        mass: 0.5 * sphere_mass(radius, 2800.0),
        speed: 2.0 * speed,
    };
    let material = "density = 2800\nyoung_modulus = \"48 GPa\"\npoisson_ratio = 0.2";
    let scene = head_on(radius, speed, material, ELASTIC, impact.duration());
    let peaks = observe(&scene)?;
    let time = peaks.steps * impact.duration() / STEPS_PER_CONTACT;
    Ok(vec![
        Claim::absolute("peak force, N", 10697.0, peaks.force, 0.5),
        Claim::absolute("peak overlap, mm", 0.274, 1e3 * peaks.overlap, 5e-4),
        Claim::absolute("contact time, us", 40.3, 1e6 * time, 0.05),
        Claim::relative("peak force, closed form, N", impact.force(), peaks.force, 1e-5),
        Claim::relative("peak overlap, closed form, mm", 1e3 * impact.overlap(), 1e3 * peaks.overlap, 1e-5),
        Claim::relative("contact time, closed form, us", 1e6 * impact.duration(), 1e6 * time, 2.0 / STEPS_PER_CONTACT),
    ])
}

/// Chung & Ooi 2011, test 2: a sphere of aluminium alloy, R = 0.1 m, at 0.2 m/s on a rigid wall, here of
/// a material 10⁶ times stiffer; against the closed form.
pub fn rigid_wall() -> Result<Vec<Claim>> {
    let (radius, speed) = (0.1, 0.2);
    let impact = Impact { modulus: 70e9 / (1.0 - 0.33 * 0.33), radius, mass: sphere_mass(radius, 2699.0), speed };
    let material = "density = 2699\nyoung_modulus = \"70 GPa\"\npoisson_ratio = 0.33";
    let wall = "density = 2699\nyoung_modulus = 7e16\npoisson_ratio = 0.33";
    let scene = on_wall(radius, speed, material, wall, ELASTIC, impact.duration());
    let peaks = observe(&scene)?;
    let time = peaks.steps * impact.duration() / STEPS_PER_CONTACT;
    Ok(vec![
        Claim::relative("peak force, N", impact.force(), peaks.force, 1e-5),
        Claim::relative("peak overlap, um", 1e6 * impact.overlap(), 1e6 * peaks.overlap, 1e-5),
        Claim::relative("contact time, us", 1e6 * impact.duration(), 1e6 * time, 2.0 / STEPS_PER_CONTACT),
    ])
}

/// Restitution out of restitution in, for two spheres and for a sphere on a wall.
pub fn restitution() -> Result<Vec<Claim>> {
    const RADIUS: f64 = 5e-3;
    const SPEED: f64 = 0.5;
    let mut claims = Vec::new();
    let unclipped = [0.2, 0.5, 0.9].map(|e| ("tsuji", false, e, e));
    // Values with clipping: PHYSICS.md section 2.
    let clipped = [
        ("tsuji", true, 0.5, 0.550),
        ("tsuji", true, 0.3, 0.397),
        ("wahn", true, 0.5, 0.582),
        ("wahn", true, 0.3, 0.431),
    ];
    for (damping, clip, given, expected) in unclipped.into_iter().chain(clipped) {
        let material = format!("density = 2500\nyoung_modulus = \"1 GPa\"\npoisson_ratio = 0.3\nrestitution = {given}");
        let laws = format!("[contact.normal.hertz]\ndamping = \"{damping}\"\nclip = {clip}\n");
        let mass = sphere_mass(RADIUS, 2500.0);
        let modulus = 1e9 / (2.0 * (1.0 - 0.09));
        let pair = Impact { modulus, radius: 0.5 * RADIUS, mass: 0.5 * mass, speed: 2.0 * SPEED };
        let plane = Impact { modulus, radius: RADIUS, mass, speed: SPEED };
        let spheres = head_on(RADIUS, SPEED, &material, &laws, pair.duration()).run()?;
        let wall = on_wall(RADIUS, SPEED, &material, &material, &laws, plane.duration()).run()?;
        let between = (spheres[1].velocity[0] - spheres[0].velocity[0]) / (2.0 * SPEED);
        let name = format!("{damping} {}, {given} in", if clip { "clipped" } else { "unclipped" });
        // Half of the last digit of the expected values, and the first order of the dashpot in the step.
        claims.push(Claim::absolute(format!("{name}, two spheres"), expected, between, 1e-3));
        claims.push(Claim::absolute(format!("{name}, wall"), expected, wall[0].velocity[2] / SPEED, 1e-3));
    }
    Ok(claims)
}
