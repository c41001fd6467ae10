//! The generalised Maxwell contact, several branches beside the long-term spring, against a quadrature of
//! the hereditary integral: loaded, held, unloaded and loaded again, so that `δ^{3/2}` is linear in time
//! nowhere and every branch is caught at another stage of its relaxation.
//!
//! The cell is that of `viscoelastic`: two contacts in z share its height, `F = σ_zz L_x L_y`, and the overlap
//! is 2R times the strain.

use super::Claim;
use super::scene::{Scene, Sphere, drive};
use crate::error::Result;
use crate::force::observe::Wanted;
use std::fmt::Write as _;

const RADIUS: f64 = 5e-6;
const LONG_TERM: f64 = 1365.9e6;
const POISSON: f64 = 0.4314;

/// Modulus \[Pa\] and relaxation time \[s\] of each branch.
type Branches = &'static [(f64, f64)];
const THREE: Branches = &[(404.6e6, 0.02), (300e6, 0.2), (600e6, 2.0)];
const FIVE: Branches = &[(200e6, 0.01), (300e6, 0.04), (400e6, 0.15), (250e6, 0.6), (350e6, 2.5)];

/// Strain rate \[1/s\] and duration \[s\]: to 0.2 %, hold, back to 0.1 %, on to 0.25 %. At this rate no step is
/// cut short by the largest strain of one step.
const PATH: [(f64, f64); 4] = [(0.005, 0.4), (0.0, 0.2), (-0.005, 0.2), (0.005, 0.3)];
const SAMPLE_INTERVAL: f64 = 0.05;
const LONGEST_STEP: f64 = 2e-3;

/// Times and forces at every sampling interval, from a run with this step.
fn computed(branches: Branches, scheme: &str, time_step: f64) -> Result<Vec<(f64, f64)>> {
    let sphere = |z: f64| Sphere { position: [RADIUS, RADIUS, z], radius: RADIUS, ..Sphere::default() };
    let material = branches.iter().fold(
        format!("density = 1800\ndensity_scaling = 1e12\nyoung_modulus = {LONG_TERM:e}\npoisson_ratio = {POISSON}\n"),
        |mut text, (modulus, time)| {
            let _ = writeln!(text, "[[material.maxwell]]\nmodulus = {modulus:e}\nrelaxation_time = {time:e}");
            text
        },
    );
    let steps = |duration: f64| libm::round(duration / time_step) as u64;
    let stages = PATH.iter().fold(String::new(), |mut text, (rate, duration)| {
        let _ = writeln!(text, "[[stage]]\nstrain_rate = {{ z = {rate:e} }}\nsteps = {}", steps(*duration));
        text
    });
    let scene = Scene {
        sides: [2.0 * RADIUS, 2.0 * RADIUS, 4.0 * RADIUS],
        material,
        sections: format!(
            "[time_step]\nfixed = {time_step:e}\n[contact.normal.maxwell_zener]\nscheme = \"{scheme}\"\n{stages}"
        ),
        spheres: vec![sphere(RADIUS), sphere(3.0 * RADIUS)],
        ..Scene::default()
    };
    let every = steps(SAMPLE_INTERVAL);
    let mut samples = Vec::new();
    drive(
        &mut scene.start()?,
        |global| Wanted { sums: global.step > 0 && global.step.is_multiple_of(every), ..Wanted::default() },
        |simulation, report| {
            let global = simulation.global();
            samples.push((global.time, report.row.stress[2] * global.sides[0] * global.sides[1]));
            Ok(())
        },
    )?;
    Ok(samples)
}

/// The force at `time`, `√R_eff/(1−ν²) Σ_k E_k ∫ exp(−(t−s)/τ_k) √δ δ̇ ds`, by Gauss's quadrature over √δ,
/// in which the integrand is smooth from the first touch on.
fn quadrature(branches: Branches, time: f64) -> f64 {
    const PANELS: u32 = 400;
    /// Nodes and weights on (−1, 1), the other two nodes by symmetry.
    const RULE: [(f64, f64); 3] = [
        (0.0, 128.0 / 225.0),
        (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
        (0.906_179_845_938_664, 0.236_926_885_056_189_1),
    ];
    let mut sum = 0.0;
    let (mut begin, mut strain) = (0.0, 0.0);
    for (rate, duration) in PATH {
        let length = (time - begin).clamp(0.0, duration);
        let [first, last] = [strain, strain + rate * length].map(|strain| 2.0 * RADIUS * strain);
        if last != first {
            // s as a function of u = √δ; √δ dδ = 2 u² du.
            let memory = |u: f64| {
                let age = time - (begin + (u * u - first) / (2.0 * RADIUS * rate));
                branches.iter().fold(LONG_TERM, |sum, (modulus, tau)| sum + modulus * libm::exp(-age / tau))
            };
            let half = 0.5 * (last.sqrt() - first.sqrt()) / f64::from(PANELS);
            for panel in 0..PANELS {
                let middle = first.sqrt() + half * f64::from(2 * panel + 1);
                for (node, weight) in RULE {
                    let both = if node == 0.0 { &[0.0][..] } else { &[-node, node][..] };
                    for x in both {
                        let u = middle + half * x;
                        sum += weight * half * 2.0 * u * u * memory(u);
                    }
                }
            }
        }
        (begin, strain) = (begin + duration, strain + rate * duration);
    }
    (0.5 * RADIUS).sqrt() / (1.0 - POISSON * POISSON) * sum
}

/// The largest error over the largest force, and the number of samples.
fn error(branches: Branches, scheme: &str, time_step: f64) -> Result<(f64, usize)> {
    let samples = computed(branches, scheme, time_step)?;
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for (time, force) in &samples {
        let expected = quadrature(branches, *time);
        let off = (force - expected).abs();
        worst = if off <= worst { worst } else { off };
        largest = largest.max(expected);
    }
    Ok((worst / largest, samples.len()))
}

/// What a law and a scheme must attain.
struct Expected {
    what: &'static str,
    branches: Branches,
    scheme: &'static str,
    /// Largest error over the largest force at the longest step and at a quarter of it.
    errors: [f64; 2],
    order: f64,
    off_order: f64,
}

/// Error and order in Δt.
pub fn branches() -> Result<Vec<Claim>> {
    let exact = Expected {
        what: "3 branches",
        branches: THREE,
        scheme: "exact",
        errors: [2e-6, 1.25e-7],
        order: 2.0,
        off_order: 0.05,
    };
    let more = Expected { what: "5 branches", branches: FIVE, ..exact };
    // The midpoint rule meets √δ at the first touch: an error of order 3/2 that the long-term spring keeps.
    let midpoint = Expected {
        what: "3 branches, midpoint",
        scheme: "midpoint",
        errors: [4e-5, 5e-6],
        order: 1.5,
        off_order: 0.15,
        ..exact
    };
    let mut claims = Vec::new();
    for expected in [&exact, &more, &midpoint] {
        claims.extend(compare(expected)?);
    }
    Ok(claims)
}

fn compare(expected: &Expected) -> Result<Vec<Claim>> {
    let Expected { what, branches, scheme, errors, order, off_order } = expected;
    let (coarse, samples) = error(branches, scheme, LONGEST_STEP)?;
    let (middle, _) = error(branches, scheme, 0.5 * LONGEST_STEP)?;
    let (fine, _) = error(branches, scheme, 0.25 * LONGEST_STEP)?;
    let observed = |coarse: f64, fine: f64| libm::log2(coarse / fine);
    Ok(vec![
        Claim::absolute(format!("{what}: forces compared"), 22.0, samples as f64, 0.0),
        Claim::bounded(format!("{what}: error over largest force, Δt = 2 ms"), errors[0], coarse),
        Claim::bounded(format!("{what}: error over largest force, Δt = 0.5 ms"), errors[1], fine),
        Claim::absolute(format!("{what}: order, 2 ms to 1 ms"), *order, observed(coarse, middle), *off_order),
        Claim::absolute(format!("{what}: order, 1 ms to 0.5 ms"), *order, observed(middle, fine), *off_order),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quadrature_has_the_closed_forms_of_springs_and_of_a_held_branch() {
        const SPRING: Branches = &[];
        const BRANCH: Branches = &[(404.6e6, 0.2)];
        let hertz = |strain: f64| {
            let overlap = 2.0 * RADIUS * strain;
            2.0 / 3.0 * LONG_TERM / (1.0 - POISSON * POISSON) * (0.5 * RADIUS * overlap).sqrt() * overlap
        };
        for (time, strain) in [(0.2, 0.001), (0.4, 0.002), (0.6, 0.002), (0.8, 0.001), (1.1, 0.0025)] {
            let relative = quadrature(SPRING, time) / hertz(strain) - 1.0;
            assert!(relative.abs() < 1e-12, "{time}: {relative}");
        }
        let of_branch = |time: f64| quadrature(BRANCH, time) - quadrature(SPRING, time);
        let decay = of_branch(0.6) / of_branch(0.4) / libm::exp(-1.0) - 1.0;
        assert!(decay.abs() < 1e-12, "{decay}");
    }
}
