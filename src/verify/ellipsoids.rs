//! Ellipsoids through the whole program: a force path, conservation over an off-centre impact, and spheres that
//! are treated as ellipsoids.

use super::Claim;
use super::scene::{Scene, Sphere, drive, states};
use super::viscoelastic::rows;
use crate::error::Result;
use crate::force::observe::Wanted;
use crate::state::ParticleState;
use crate::state::shape::{ellipsoid_mass, principal_moments, rotation_matrix, to_body, to_space};
use std::fmt::Write as _;

const CASE: &str = include_str!("../../tests/data/becker_kamlah_case1.csv");

/// B Table 3: two NMC ellipsoids of r̂ = 4.675 µm, 1 : 1.25 : 1.5 and 1 : 0.5 : 0.8, vertex to vertex along their
/// first axis, pressed by 4.5 % and by 10 % of r̂_ij; twice in z, so that `F = σ_zz L_x L_y`.
pub fn path() -> Result<Vec<Claim>> {
    const MEAN: f64 = 4.675e-6;
    const RATE: f64 = 1e3;
    let rows = rows(CASE)?;
    // The first axis along z.
    let axes = |[a, b, c]: [f64; 3]| {
        let unit = MEAN / libm::cbrt(a * b * c);
        [b * unit, c * unit, a * unit]
    };
    let (first, second) = (axes([1.0, 1.25, 1.5]), axes([1.0, 0.5, 0.8]));
    let height = first[2] + second[2];
    let stages = rows.windows(2).fold(String::new(), |mut text, pair| {
        // Both contacts share the height 2 (a_i + a_j): a strain gives each an overlap of a_i + a_j times it.
        let change = (pair[1][0] - pair[0][0]) / height;
        let _ = writeln!(
            text,
            "[[stage]]\nstrain_rate = {{ z = {:e} }}\nduration = {:e}",
            RATE * change.signum(),
            change.abs() / RATE
        );
        text
    });
    let side = 4.0 * first[1];
    let ellipsoid = |z: f64, semi_axes: [f64; 3]| {
        Sphere { position: [0.5 * side, 0.5 * side, z], ..Sphere::default() }
            .with_semi_axes(semi_axes, [1.0, 0.0, 0.0, 0.0])
    };
    let scene = Scene {
        sides: [side, side, 2.0 * height],
        material: "density = 4750\ndensity_scaling = 1e6\nyoung_modulus = \"142 GPa\"\npoisson_ratio = 0.25\n\
                   yield_stress = \"7.9 GPa\""
            .to_owned(),
        sections: format!(
            "[contact]\nmax_overlap_fraction = 0.5\n[contact.normal.becker_kamlah]\n[load]\nkinematics = \"BCT\"\n\
             {stages}"
        ),
        spheres: vec![ellipsoid(first[2], first), ellipsoid(first[2] + height, second)],
        ..Scene::default()
    };
    let mut forces = Vec::new();
    drive(
        &mut scene.start()?,
        |global| Wanted { sums: global.step > 0 && global.step == global.stage_start_step, ..Wanted::default() },
        |simulation, report| {
            let sides = simulation.global().sides;
            forces.push(report.row.stress[2] * sides[0] * sides[1]);
            Ok(())
        },
    )?;
    let largest = rows.iter().fold(0.0_f64, |m, row| m.max(row[1]));
    let off = rows[1..].iter().zip(&forces).map(|(row, force)| (force - row[1]).abs() / largest);
    let worst = off.fold(0.0_f64, |m, d| if d <= m { m } else { d });
    Ok(vec![
        Claim::absolute("forces compared", (rows.len() - 1) as f64, forces.len() as f64, 0.0),
        Claim::bounded("largest error over the largest force", 1e-4, worst),
    ])
}

const DENSITY: f64 = 2500.0;
const MATERIAL: &str = "density = 2500\nyoung_modulus = \"50 MPa\"\npoisson_ratio = 0.3\nrestitution = 0.7";

/// Two tri-axial ellipsoids that meet off their centres, spinning.
fn impact(time_step: f64, sections: &str, material: &str) -> Scene {
    let body = |position, velocity, spin| Sphere { position, velocity, spin, radius: 0.0, ..Sphere::default() };
    Scene {
        sides: [2e-2; 3],
        material: material.to_owned(),
        sections: format!("{sections}\n[time_step]\nfixed = {time_step:e}\n[[stage]]\nhold = true\nduration = 3e-3\n"),
        spheres: vec![
            body([7.9e-3, 1e-2, 1e-2], [1.0, 0.1, 0.0], [60.0, -20.0, 90.0])
                .with_semi_axes([1.5e-3, 1.0e-3, 0.6e-3], [0.8, 0.0, 0.36, 0.48]),
            body([11.9e-3, 1.04e-2, 0.97e-2], [-1.0, 0.0, 0.2], [-40.0, 70.0, 10.0])
                .with_semi_axes([0.7e-3, 1.2e-3, 1.3e-3], [0.6, 0.64, 0.0, -0.48]),
        ],
        ..Scene::default()
    }
}

/// Momentum, angular momentum about the origin, kinetic energy.
fn totals(particles: &[ParticleState]) -> ([f64; 3], [f64; 3], f64) {
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let (mut momentum, mut angular, mut energy) = ([0.0; 3], [0.0; 3], 0.0);
    for particle in particles {
        let mass = ellipsoid_mass(particle.semi_axes, DENSITY);
        let rotation = rotation_matrix(particle.orientation);
        let moments = principal_moments(mass, particle.semi_axes);
        let body = to_body(&rotation, particle.full_spin);
        let own = to_space(&rotation, [0, 1, 2].map(|k| moments[k] * body[k]));
        let orbital = cross(particle.position, particle.full_velocity);
        for k in 0..3 {
            momentum[k] += mass * particle.full_velocity[k];
            angular[k] += mass * orbital[k] + own[k];
            energy += 0.5 * mass * particle.full_velocity[k] * particle.full_velocity[k];
            energy += 0.5 * moments[k] * body[k] * body[k];
        }
    }
    (momentum, angular, energy)
}

/// Drift of momentum and of angular momentum over that of one body at the start, change of energy over the initial
/// one, and the share of the energy that went from one body to the other or into rotation.
fn drifts(scene: &Scene) -> Result<([f64; 2], f64, f64)> {
    let mut simulation = scene.start()?;
    let before = states(&mut simulation)?;
    drive(&mut simulation, |_| Wanted::default(), |_, _| Ok(()))?;
    let after = states(&mut simulation)?;
    let (p, l, e) = totals(&before);
    let (q, m, f) = totals(&after);
    let (p1, l1, e1) = totals(&before[..1]);
    let (_, _, f1) = totals(&after[..1]);
    let size = |v: [f64; 3]| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    let change = |a: [f64; 3], b: [f64; 3]| size([0, 1, 2].map(|k| a[k] - b[k]));
    Ok(([change(p, q) / size(p1), change(l, m) / size(l1)], f / e - 1.0, (f1 - e1).abs() / e))
}

/// An off-centre impact keeps momentum and angular momentum to rounding. It keeps energy only as far as the contact
/// stays where it is: Hertz's force between ellipsoids has no potential while the contact rolls to places of other
/// curvature, so the change of energy does not depend on the time step and goes with the length of the contact, to
/// nothing for stiff bodies.
pub fn conservation() -> Result<Vec<Claim>> {
    const ELASTIC: &str = "[contact.normal.hertz]\ndamping = \"none\"";
    const ROUGH: &str = "[contact.normal.hertz]\n[contact.tangential.mindlin]\n[contact.rolling.spring_slider]";
    let rough = format!("{MATERIAL}\nfriction = 0.4\nrolling_friction = 0.1\ntwisting_friction = 0.1");
    let mut claims = Vec::new();
    for (name, laws, material) in [("elastic", ELASTIC, MATERIAL), ("rough", ROUGH, rough.as_str())] {
        let (drift, energy, exchanged) = drifts(&impact(5e-7, laws, material))?;
        claims.push(Claim::bounded(format!("{name}: drift of momentum"), 1e-11, drift[0]));
        claims.push(Claim::bounded(format!("{name}: drift of angular momentum"), 1e-11, drift[1]));
        claims.push(Claim::absolute(format!("{name}: the bodies met (1)"), 1.0, f64::from(exchanged > 0.01), 0.0));
        if name == "elastic" {
            claims.push(Claim::bounded("elastic: change of energy", 1e-2, energy));
            // The contact lasts as the modulus to the power −2/5.
            let stiffer = material.replace("50 MPa", "50 GPa");
            let stiff = drifts(&impact(5e-7 / 16.0, laws, &stiffer))?.1;
            claims.push(Claim::bounded("elastic, 1000 times stiffer: change of energy", 5e-4, stiff));
        } else {
            claims.push(Claim::absolute("rough: energy is lost (1)", 1.0, f64::from(energy < -0.01), 0.0));
        }
    }
    Ok(claims)
}

/// Two equal spheres that rub and roll, alone and in a run with an ellipsoid far away, where every contact goes
/// through the pass of ellipsoids.
pub fn spheres() -> Result<Vec<Claim>> {
    const RADIUS: f64 = 1e-3;
    let material = format!("{MATERIAL}\nfriction = 0.4\nrolling_friction = 0.1\ntwisting_friction = 0.1");
    let scene = |far: Sphere| Scene {
        sides: [2e-2; 3],
        material: material.clone(),
        sections: "[contact.normal.hertz]\n[contact.tangential.mindlin]\n[contact.rolling.spring_slider]\n\
                   [time_step]\nfixed = 5e-7\n[[stage]]\nhold = true\nduration = 1e-3\n"
            .to_owned(),
        spheres: vec![
            Sphere {
                position: [9.0e-3, 1e-2, 1e-2],
                radius: RADIUS,
                velocity: [1.0, 0.3, 0.0],
                spin: [50.0, -20.0, 300.0],
                ..Sphere::default()
            },
            Sphere {
                position: [11.05e-3, 1.03e-2, 1e-2],
                radius: RADIUS,
                velocity: [-1.0, 0.0, 0.1],
                spin: [0.0, 80.0, 10.0],
                ..Sphere::default()
            },
            far,
        ],
        ..Scene::default()
    };
    let far = Sphere { position: [3e-3; 3], radius: RADIUS, ..Sphere::default() };
    let plain = scene(far).run()?;
    let general = scene(far.with_semi_axes([RADIUS, 0.8 * RADIUS, 0.9 * RADIUS], [1.0, 0.0, 0.0, 0.0])).run()?;
    let mut worst = [0.0_f64; 3];
    for (a, b) in plain.iter().zip(&general).take(2) {
        let pairs = [
            (a.position, b.position, RADIUS),
            (a.full_velocity, b.full_velocity, 1.0),
            (a.full_spin, b.full_spin, 300.0),
        ];
        for (worst, (a, b, scale)) in worst.iter_mut().zip(pairs) {
            for k in 0..3 {
                let off = (a[k] - b[k]).abs() / scale;
                *worst = if off <= *worst { *worst } else { off };
            }
        }
    }
    Ok(vec![
        Claim::bounded("difference of positions over the radius", 1e-10, worst[0]),
        Claim::bounded("difference of velocities over 1 m/s", 1e-10, worst[1]),
        Claim::bounded("difference of spins over 300 rad/s", 1e-10, worst[2]),
    ])
}
