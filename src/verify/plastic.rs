//! Elastic–plastic contacts: force along a path of overlaps, and restitution, through the whole program.
//!
//! The cell of the path is that of W Fig. 8, as in the viscoelastic cases: two spheres touch each other
//! twice in z, so that `F = σ_zz L_x L_y`, and BCT keeps them in place.

use super::Claim;
use super::collision::head_on_with;
use super::scene::{Scene, Sphere, drive};
use super::viscoelastic::rows;
use crate::error::Result;
use crate::force::observe::Wanted;
use crate::state::particles::sphere_mass;
use std::fmt::Write as _;

const CYCLE: &str = include_str!("../../tests/data/thornton_cycle.csv");
const RESTITUTION: &str = include_str!("../../tests/data/thornton_restitution.csv");

/// Thornton's law along the overlaps of the reference: press to 12 % of the radius, release, press to 20 %, release.
pub fn path() -> Result<Vec<Claim>> {
    const RADIUS: f64 = 5e-6;
    const RATE: f64 = 1e3;
    let rows = rows(CYCLE)?;
    // Both contacts share the height 4R, so a strain gives each an overlap of 2R times it.
    let strain: Vec<f64> = rows.iter().map(|row| row[0] / (2.0 * RADIUS)).collect();
    let stages = strain.windows(2).fold(String::new(), |mut text, pair| {
        let change = pair[1] - pair[0];
        let _ = writeln!(
            text,
            "[[stage]]\nstrain_rate = {{ z = {:e} }}\nduration = {:e}",
            RATE * change.signum(),
            change.abs() / RATE
        );
        text
    });
    let sphere = |z: f64| Sphere { position: [RADIUS, RADIUS, z], radius: RADIUS, ..Sphere::default() };
    let scene = Scene {
        sides: [2.0 * RADIUS, 2.0 * RADIUS, 4.0 * RADIUS],
        material: "density = 4750\ndensity_scaling = 1e6\nyoung_modulus = \"142 GPa\"\npoisson_ratio = 0.25\n\
                   yield_stress = \"7.9 GPa\""
            .to_owned(),
        sections: format!(
            "[contact]\nmax_overlap_fraction = 0.5\n[contact.normal.thornton]\n[load]\nkinematics = \"BCT\"\n{stages}"
        ),
        spheres: vec![sphere(RADIUS), sphere(3.0 * RADIUS)],
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

/// Restitution at multiples of the yield velocity, two spheres head on.
pub fn restitution() -> Result<Vec<Claim>> {
    const RADIUS: f64 = 1e-3;
    const DENSITY: f64 = 7800.0;
    const YOUNG: f64 = 70e9;
    const YIELD: f64 = 1.2e8;
    let modulus = YOUNG / (2.0 * (1.0 - 0.09));
    let (radius, mass) = (0.5 * RADIUS, 0.5 * sphere_mass(RADIUS, DENSITY));
    let ratio = std::f64::consts::PI * 1.6 * YIELD / (2.0 * modulus);
    let overlap = ratio * ratio * radius;
    let force = 4.0 / 3.0 * modulus * (radius * overlap).sqrt() * overlap;
    let yield_speed = (0.8 * force * overlap / mass).sqrt();
    let material =
        format!("density = {DENSITY}\nyoung_modulus = {YOUNG:e}\npoisson_ratio = 0.3\nyield_stress = {YIELD:e}");
    let mut claims = Vec::new();
    for row in rows(RESTITUTION)? {
        let (times, expected) = (row[0], row[1]);
        let speed = times * yield_speed;
        // Stiffness of the plastic loading; the one of unloading is larger by c*/c_y < √(V/V_y).
        let stiffness = std::f64::consts::PI * 1.6 * YIELD * radius;
        let period = (mass / stiffness).sqrt();
        let step = 0.01 * period / times.sqrt();
        let sections = format!(
            "[contact]\nmax_overlap_fraction = 0.5\n[contact.normal.thornton]\n[time_step]\nfixed = {step:e}\n\
             [[stage]]\nhold = true\nduration = {:e}\n",
            8.0 * period
        );
        let spheres = head_on_with(RADIUS, 0.5 * speed, &material, sections).run()?;
        let got = (spheres[1].velocity[0] - spheres[0].velocity[0]) / speed;
        claims.push(Claim::relative(format!("V/V_y = {times}"), expected, got, 0.01));
    }
    Ok(claims)
}
