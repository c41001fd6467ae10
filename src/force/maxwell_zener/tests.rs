//! Tests of the Maxwell–Zener law against tables, limits and direct quadrature.

use super::*;
use crate::config::MaxwellBranch;
use crate::force::testing::{accumulate, choice, impact, pair, properties, pvdf, sum, table, touch};

/// Two spheres of 5 µm, as in W Figs. 9 and 10.
const RADIUS: f64 = 2.5e-6;
const TOP: f64 = 2e-7;
/// The automatic time step of those spheres with a thousandfold density \[s\].
const TIME_STEP: f64 = 4e-6;

fn law<const BRANCHES: usize>(properties: PairProperties, settings: &[(&str, &str)]) -> MaxwellZener<BRANCHES, false> {
    MaxwellZener::new(&pair(properties, choice(Role::Normal, "maxwell_zener", settings)))
}

fn exact() -> MaxwellZener<1, false> {
    law(pvdf(), &[])
}

fn midpoint() -> MaxwellZener<2, true> {
    MaxwellZener::new(&pair(pvdf(), choice(Role::Normal, "maxwell_zener", &[("scheme", "midpoint")])))
}

fn hertz(modulus: f64, overlap: f64) -> f64 {
    let nu = pvdf().poisson_ratio[0];
    2.0 / 3.0 * modulus / (1.0 - nu * nu) * RADIUS.sqrt() * overlap * overlap.sqrt()
}

/// Force after each of `steps` steps along `path(t)`.
fn follow<const B: usize, const MIDPOINT: bool>(
    mut law: MaxwellZener<B, MIDPOINT>,
    duration: f64,
    steps: usize,
    path: impl Fn(f64) -> f64,
) -> Vec<f64> {
    let step = duration / steps as f64;
    law.prepare(step);
    let mut memory = vec![0.0; B + 1];
    (1..=steps).map(|k| law.evaluate(&touch(path(k as f64 * step), 0.0, RADIUS, 1e-12), &mut memory).force).collect()
}

fn relative(got: f64, expected: f64) -> f64 {
    (got / expected - 1.0).abs()
}

/// Largest deviation from the table of strain rates (20 rows per rate, evenly spaced in time).
fn rate_table_error<const B: usize>(law: MaxwellZener<B, false>) -> f64 {
    let rows = table(include_str!("../../../tests/data/maxwell_zener_rates.csv"));
    let mut error: f64 = 0.0;
    for rows in rows.chunks(20) {
        let duration = 0.02 / rows[0][0];
        let per_row = (duration / TIME_STEP / 20.0).ceil() as usize;
        let forces = follow(law, duration, 20 * per_row, |t| TOP * t / duration);
        for (k, row) in rows.iter().enumerate() {
            error = error.max(relative(forces[(k + 1) * per_row - 1], row[3]));
        }
    }
    error
}

#[test]
fn reproduces_the_table_of_strain_rates() {
    assert!(rate_table_error(exact()) < 1e-6, "{}", rate_table_error(exact()));
}

#[test]
fn the_midpoint_scheme_reproduces_the_table_where_a_row_is_many_steps() {
    // At 100 /s the table has rows after three steps, where the midpoint rule on √δ is off by a percent.
    let rows = table(include_str!("../../../tests/data/maxwell_zener_rates.csv"));
    for rows in rows.chunks(20).skip(1) {
        let duration = 0.02 / rows[0][0];
        let per_row = (duration / TIME_STEP / 20.0).ceil() as usize;
        let forces = follow(midpoint(), duration, 20 * per_row, |t| TOP * t / duration);
        for (k, row) in rows.iter().enumerate() {
            let error = relative(forces[(k + 1) * per_row - 1], row[3]);
            assert!(error < 1e-3, "rate {} strain {}: {error}", row[0], row[1]);
        }
    }
}

#[test]
fn relaxes_to_the_long_term_hertz_force_as_the_table_says() {
    let rows = table(include_str!("../../../tests/data/maxwell_zener_relaxation.csv"));
    let forces = follow(exact(), 20.0, 200_000, |t| TOP * t.min(1.0));
    for row in &rows {
        let index = (row[0] * 10_000.0).round() as usize - 1;
        assert!(relative(forces[index], row[1]) < 1e-6, "t = {}: {} {}", row[0], forces[index], row[1]);
    }
    let last = forces[forces.len() - 1];
    assert!(relative(last, hertz(1365.9e6, TOP)) < 1e-5);
}

#[test]
fn fast_loading_is_hertz_with_the_spontaneous_modulus_and_slow_loading_with_the_long_term_one() {
    let fast = follow(exact(), 1e-9, 100, |t| TOP * t / 1e-9);
    assert!(relative(fast[99], hertz(1365.9e6 + 404.6e6, TOP)) < 1e-8);
    let slow = follow(exact(), 1e9, 1000, |t| TOP * t / 1e9);
    assert!(relative(slow[999], hertz(1365.9e6, TOP)) < 1e-7);
}

#[test]
fn both_schemes_converge_at_second_order() {
    let path = |t: f64| TOP * t * t;
    let reference = follow(exact(), 1.0, 400_000, path)[399_999];
    let exact = |n: usize| relative(follow(exact(), 1.0, n, path)[n - 1], reference);
    let midpoint = |n: usize| relative(follow(midpoint(), 1.0, n, path)[n - 1], reference);
    for error in [&exact as &dyn Fn(usize) -> f64, &midpoint] {
        let ratio = error(100) / error(200);
        assert!((3.7..4.3).contains(&ratio), "{ratio}");
    }
    assert!(exact(100) < 1e-5, "{}", exact(100));
}

#[test]
fn several_branches_match_the_hereditary_integral() {
    let branches = [(3e8, 0.03), (5e8, 0.4), (2e8, 7.0)];
    let maxwell = branches.map(|(modulus, relaxation_time)| MaxwellBranch { modulus, relaxation_time }).to_vec();
    let constants = properties(1e9, 0.3, maxwell);
    // Loads and unloads part of the way.
    let path = |t: f64| TOP * t * t * (3.0 - 2.0 * t);
    let slope = |t: f64| TOP * 6.0 * t * (1.0 - t);
    let end = 1.2;
    let mut expected = 1e9 * 2.0 / 3.0 * path(end) * path(end).sqrt();
    let points = 100_000;
    for (modulus, tau) in branches {
        let h = end / f64::from(points);
        let integrand = |s: f64| libm::exp(-(end - s) / tau) * path(s).sqrt() * slope(s);
        expected += modulus * h * (0..points).map(|k| integrand((f64::from(k) + 0.5) * h)).sum::<f64>();
    }
    expected *= RADIUS.sqrt() / (1.0 - 0.09);
    let forces = follow(law::<3>(constants, &[]), end, 12_000, path);
    assert!(relative(forces[11_999], expected) < 1e-6, "{} {expected}", forces[11_999]);
}

#[test]
fn splitting_the_last_branch_leaves_the_force_as_it_is() {
    let maxwell = [(3e8, 0.03), (5e8, 0.4), (2e8, 7.0)]
        .map(|(modulus, relaxation_time)| MaxwellBranch { modulus, relaxation_time });
    assert_eq!(split_last_branch(&maxwell, 3), maxwell);
    let constants = properties(1e9, 0.3, maxwell.to_vec());
    let path = |t: f64| TOP * t * (2.0 - t);
    let three = follow(law::<3>(constants.clone(), &[]), 1.5, 500, path);
    let eight = follow(law::<8>(constants, &[]), 1.5, 500, path);
    assert!(relative(eight[499], three[499]) < 1e-13);
}

#[test]
fn mean_decay_keeps_its_digits_at_small_and_large_arguments() {
    assert_eq!(mean_decay(0.0), 1.0);
    for x in [1e-17, 1e-12, 1e-8, 1e-5] {
        let series = 1.0 - x / 2.0 + x * x / 6.0;
        assert!((mean_decay(x) - series).abs() <= 2.3e-16, "{x}");
    }
    assert!((mean_decay(1e3) - 1e-3).abs() < 1e-18);
}

#[test]
fn only_the_total_is_clipped() {
    // Loaded, relaxed, then pulled back fast: the branch pulls, the total would too.
    let path = |t: f64| if t <= 0.999 { TOP } else { 0.05 * TOP };
    let run = |clip| {
        let mut law = law::<1>(pvdf(), &[("clip", clip)]);
        law.prepare(0.1);
        let mut memory = [0.0; 2];
        for _ in 0..300 {
            law.evaluate(&touch(TOP, 0.0, RADIUS, 1e-12), &mut memory);
        }
        law.prepare(1e-3);
        (law.evaluate(&touch(path(1.0), 0.0, RADIUS, 1e-12), &mut memory).force, memory[1])
    };
    let (clipped, branch) = run("true");
    let (free, same_branch) = run("false");
    assert_eq!(clipped, 0.0);
    assert!(free < 0.0 && branch < free);
    assert_eq!(branch.to_bits(), same_branch.to_bits());
}

#[test]
fn the_ledger_closes_at_second_order_even_for_branches_faster_than_the_step() {
    let branches =
        [(3e8, 1e-4), (5e8, 0.2)].map(|(modulus, relaxation_time)| MaxwellBranch { modulus, relaxation_time });
    let path = |t: f64| TOP * t * t * (2.0 - t) * (2.0 - t);
    let rate = |t: f64| TOP * 4.0 * t * (1.0 - t) * (2.0 - t);
    let error = |steps: usize| {
        let mut law = law::<2>(properties(1e9, 0.3, branches.to_vec()), &[("clip", "false")]);
        let step = 1.8 / steps as f64;
        law.prepare(step);
        let (mut memory, mut energies) = ([0.0; 3], Energies::zero());
        let (mut work, mut last, mut scale) = (0.0, 0.0, 0.0);
        for k in 1..=steps {
            let (before, now) = ((k - 1) as f64 * step, k as f64 * step);
            let change = path(now) - path(before);
            let response = law.evaluate(&touch(path(now), rate(now), RADIUS, 1e-12), &mut memory);
            work += 0.5 * (last + response.force) * change;
            scale = f64::max(scale, work);
            last = response.force;
            accumulate(&mut energies, &response.energies);
        }
        assert!(energies.viscous != 0.0 && energies.viscoelastic != 0.0);
        (work - sum(&energies)).abs() / scale
    };
    assert!(error(200) < 1e-4, "{}", error(200));
    assert!((3.0..5.0).contains(&(error(200) / error(400))), "{} {}", error(200), error(400));
}

#[test]
fn the_ledger_closes_over_an_impact_with_damping_and_clipping() {
    let constants = properties(1e9, 0.3, vec![MaxwellBranch { modulus: 1e9, relaxation_time: 1e-4 }]);
    for settings in [&[("damping", "none")], &[("damping", "tsuji")]] {
        let error = |step| impact(law::<1>(constants.clone(), settings), 5e-3, 1e-2, 1.0, step).ledger_error;
        assert!(error(5e-8) < 2e-3, "{}", error(5e-8));
        assert!(error(5e-8) < 0.5 * error(2e-7), "{} {}", error(5e-8), error(2e-7));
    }
}

#[test]
fn unequal_materials_and_missing_branches_are_refused_with_a_remedy() {
    assert!(check(&pvdf()).is_ok());
    let mut unequal = pvdf();
    unequal.young_modulus[1] *= 2.0;
    let message = check(&unequal).unwrap_err();
    assert!(message.contains("left") && message.contains("right") && message.contains("hertz"), "{message}");
    assert!(check(&properties(1e9, 0.3, Vec::new())).unwrap_err().contains("at least one Maxwell branch"));
    let nine = vec![MaxwellBranch { modulus: 1e8, relaxation_time: 1.0 }; 9];
    assert!(check(&properties(1e9, 0.3, nine)).unwrap_err().contains("at most 8"));
}

#[test]
fn between_ellipsoids_fast_and_slow_loading_are_hertz_with_the_elliptical_geometry() {
    let (f1, f2) = (0.98, 0.95);
    let hertz = |modulus: f64, overlap: f64| hertz(modulus, overlap / f2);
    let end = |duration: f64, steps: usize| {
        let mut law = exact();
        let step = duration / steps as f64;
        law.prepare(step);
        let mut memory = [0.0; 2];
        let mut response = None;
        for k in 1..=steps {
            let overlap = TOP * k as f64 / steps as f64;
            let touch = Touch { radius_factor: f1, overlap_factor: f2, ..touch(overlap, 0.0, RADIUS, 1e-12) };
            response = Some(law.evaluate(&touch, &mut memory));
        }
        response.unwrap()
    };
    let fast = end(1e-6, 1000);
    assert!(relative(fast.force, hertz(1365.9e6 + 404.6e6, TOP)) < 1e-5, "{}", fast.force);
    assert!(relative(fast.contact_radius, f1 * (RADIUS * TOP / f2).sqrt()) < 1e-14);
    let slow = end(1e5, 100_000);
    assert!(relative(slow.force, hertz(1365.9e6, TOP)) < 1e-4, "{}", slow.force);
}
