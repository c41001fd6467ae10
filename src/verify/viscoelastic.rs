//! Two PVDF spheres pressed together (W Figs. 8 to 10) against an independent integration of the
//! Maxwell–Zener law.
//!
//! The cell, 2R × 2R × 4R, is periodic: the spheres touch each other twice in z, once directly and once
//! through the face, and their images at the sides just touch. The two contacts share the height, so
//! `Σ F d = F L_z`, and the stress `σ_zz = F L_z/V` gives the force `F = σ_zz L_x L_y`. BCT keeps the
//! spheres in place, so that inertia has no part in it whatever the density scaling.

use super::Claim;
use super::scene::{Scene, Sphere, drive};
use crate::error::{Error, Result};
use crate::force::observe::Wanted;
use std::fmt::Write as _;

pub const RATES: &str = include_str!("../../tests/data/maxwell_zener_rates.csv");
pub const RELAXATION: &str = include_str!("../../tests/data/maxwell_zener_relaxation.csv");

const RADIUS: f64 = 5e-6;
/// The bound that the law must keep at the automatic time step.
const SHARE: f64 = 1e-3;

/// Rows of numbers below the header.
pub fn rows(csv: &str) -> Result<Vec<Vec<f64>>> {
    let row = |line: &str| {
        line.split(',').map(|field| field.trim().parse::<f64>()).collect::<std::result::Result<Vec<_>, _>>()
    };
    csv.lines()
        .skip(1)
        .map(|line| row(line).map_err(|error| Error::Input(format!("reference row {line:?}: {error}"))))
        .collect()
}

/// Forces at the ends of stages; `stages` is their text.
fn forces(stages: &str, density_scaling: f64) -> Result<Vec<f64>> {
    let sphere = |z: f64| Sphere { position: [RADIUS, RADIUS, z], radius: RADIUS, ..Sphere::default() };
    let scene = Scene {
        sides: [2.0 * RADIUS, 2.0 * RADIUS, 4.0 * RADIUS],
        material: format!(
            "density = 1800\ndensity_scaling = {density_scaling:e}\nyoung_modulus = \"1365.9 MPa\"\n\
             poisson_ratio = 0.4314\nmaxwell = [{{ modulus = \"404.6 MPa\", viscosity = \"728.28 MPa s\" }}]"
        ),
        sections: format!("[contact.normal.maxwell_zener]\n[load]\nkinematics = \"BCT\"\n{stages}"),
        spheres: vec![sphere(RADIUS), sphere(3.0 * RADIUS)],
        ..Scene::default()
    };
    let mut forces = Vec::new();
    drive(
        &mut scene.start()?,
        // The state at the end of a stage is the first of the next one, or the final one.
        |global| Wanted { sums: global.step > 0 && (global.step == global.stage_start_step), ..Wanted::default() },
        |simulation, report| {
            let sides = simulation.global().sides;
            forces.push(report.row.stress[2] * sides[0] * sides[1]);
            Ok(())
        },
    )?;
    Ok(forces)
}

/// The largest relative difference as a claim, and the last force.
fn compare(what: &str, expected: &[f64], got: &[f64]) -> Vec<Claim> {
    let worst =
        expected.iter().zip(got).map(|(e, g)| ((g - e) / e).abs()).fold(0.0_f64, |m, d| if d <= m { m } else { d });
    let last = |values: &[f64]| values.last().copied().unwrap_or(f64::NAN);
    vec![
        Claim::absolute(format!("{what}: forces compared"), expected.len() as f64, got.len() as f64, 0.0),
        Claim::bounded(format!("{what}: largest relative error"), SHARE, worst),
        Claim::relative(format!("{what}: last force, N"), last(expected), last(got), SHARE),
    ]
}

/// W Fig. 9: 2 % at strain rates of 100 to 0.01 1/s.
pub fn rates() -> Result<Vec<Claim>> {
    let rows = rows(RATES)?;
    let mut claims = Vec::new();
    let mut ends = Vec::new();
    for group in rows.chunk_by(|a, b| a[0] == b[0]) {
        let rate = group[0][0];
        let stages = group.iter().fold(String::new(), |mut text, row| {
            let _ =
                writeln!(text, "[[stage]]\nstrain_rate = {{ z = {rate:e} }}\nuntil_strain = {{ z = {:e} }}", row[1]);
            text
        });
        let expected: Vec<f64> = group.iter().map(|row| row[3]).collect();
        let got = forces(&stages, 1e6)?;
        ends.push(got.last().copied().unwrap_or(f64::NAN));
        claims.extend(compare(&format!("{rate} 1/s"), &expected, &got));
    }
    let disordered = ends.windows(2).filter(|pair| pair[0].partial_cmp(&pair[1]) != Some(std::cmp::Ordering::Greater));
    claims.push(Claim::absolute("pairs of rates whose forces are out of order", 0.0, disordered.count() as f64, 0.0));
    Ok(claims)
}

/// W Fig. 10: 2 % in 1 s, held to 20 s.
pub fn relaxation() -> Result<Vec<Claim>> {
    let rows = rows(RELAXATION)?;
    let (mut stages, mut time) = (String::new(), 0.0);
    for row in &rows {
        let rate = if row[0] <= 1.0 { 0.02 } else { 0.0 };
        let _ = writeln!(stages, "[[stage]]\nstrain_rate = {{ z = {rate:e} }}\nduration = {:e}", row[0] - time);
        time = row[0];
    }
    let expected: Vec<f64> = rows.iter().map(|row| row[1]).collect();
    // Twenty seconds: the larger of the paper's two density scalings.
    let mut claims = compare("2 % in 1 s, hold to 20 s", &expected, &forces(&stages, 1e9)?);
    // Overlap 2 % of 2R; E_eff of the long-term modulus; R_eff = R/2.
    let (overlap, modulus) = (0.04 * RADIUS, 1365.9e6 / (2.0 * (1.0 - 0.4314 * 0.4314)));
    let long_term = 4.0 / 3.0 * modulus * (0.5 * RADIUS * overlap).sqrt() * overlap;
    // What is left of the branch after 19 s with τ = 1.8 s is 1e-5 of the force.
    let last = claims.last().map_or(f64::NAN, |claim| claim.got);
    claims.push(Claim::relative("force at 20 s over long-term Hertz force", 1.0, last / long_term, SHARE));
    Ok(claims)
}
