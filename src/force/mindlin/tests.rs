//! Tests of the tangential law: stiffness, Coulomb limit, turning with the contact, energies, relaxation.

use super::*;
use crate::config::MaxwellBranch;
use crate::force::law::NormalLaw;
use crate::force::testing::{accumulate, choice, pair, properties, pvdf, sum, touch};
use crate::force::{hertz::Hertz, registry::PairProperties};

const RADIUS: f64 = 5e-3;
const MASS: f64 = 1e-2;
const OVERLAP: f64 = 1e-5;

fn constants(friction: f64) -> PairProperties {
    PairProperties { friction, ..properties(1e9, 0.3, Vec::new()) }
}

fn law(friction: f64, settings: &[(&str, &str)]) -> Mindlin<1, true> {
    let shear = ShearSprings::elastic(&constants(friction));
    Mindlin::new(&choice(Role::Tangential, "mindlin", settings), &shear, friction)
}

/// The undamped normal response at this overlap.
fn normal(touch: &Touch<f64>) -> NormalResponse<f64> {
    let choice = choice(Role::Normal, "hertz", &[("damping", "none")]);
    Hertz::new(&pair(constants(0.0), choice)).evaluate(touch, &mut [])
}

/// A touch that slides with `speed` along x at this overlap.
fn sliding(overlap: f64, speed: f64) -> Touch<f64> {
    Touch { slip_velocity: [speed, 0.0, 0.0], ..touch(overlap, 0.0, RADIUS, MASS) }
}

fn stiffness(overlap: f64) -> f64 {
    2.0 / 3.0 * 8.0 * constants(0.0).effective_shear_modulus() * (RADIUS * overlap).sqrt()
}

fn length(v: Vector<f64>) -> f64 {
    dot(v, v).sqrt()
}

#[test]
fn a_sticking_contact_has_the_stiffness_of_w_3_4_at_second_order() {
    let error = |steps: usize| {
        let step = 1.0 / steps as f64;
        let mut law = law(1e9, &[("damping", "false")]);
        law.prepare(step);
        let mut memory = [0.0; 4];
        let mut force = 0.0;
        for k in 1..=steps {
            let touch = sliding(OVERLAP, 1e-6 * k as f64 * step * k as f64 * step);
            force = law.evaluate(&touch, &normal(&touch), &mut memory).value[0];
        }
        (force / (stiffness(OVERLAP) * 1e-6 / 3.0) - 1.0).abs()
    };
    assert!(error(1000) < 1e-6, "{}", error(1000));
    assert!((3.8..4.2).contains(&(error(100) / error(200))), "{}", error(100) / error(200));
}

#[test]
fn the_force_on_i_follows_the_motion_of_j() {
    let mut law = law(0.5, &[]);
    law.prepare(1e-6);
    let touch = sliding(OVERLAP, 1e-3);
    assert!(law.evaluate(&touch, &normal(&touch), &mut [0.0; 4]).value[0] > 0.0);
}

#[test]
fn a_sliding_contact_carries_exactly_the_coulomb_force() {
    for damping in ["true", "false"] {
        let mut law = law(0.4, &[("damping", damping)]);
        law.prepare(1e-5);
        let mut memory = [0.0; 4];
        let (mut dissipated, steps, speed) = (0.0, 1000, 0.5);
        for k in 0..steps {
            let touch = sliding(OVERLAP, speed);
            let normal = NormalResponse { dashpot: 30.0, ..normal(&touch) };
            let response = law.evaluate(&touch, &normal, &mut memory);
            assert!(length(response.value) <= 0.4 * normal.force * (1.0 + 1e-15));
            if k > 100 {
                assert!((response.value[0] / (0.4 * normal.force) - 1.0).abs() < 1e-14);
                dissipated += response.energies.friction + response.energies.damping;
                let expected = 0.4 * normal.force * speed * 1e-5 * f64::from(k - 100);
                assert!((dissipated / expected - 1.0).abs() < 1e-10, "{dissipated} {expected}");
            }
        }
    }
}

#[test]
fn a_tensile_normal_force_carries_no_friction() {
    let mut law = law(0.4, &[]);
    law.prepare(1e-5);
    let touch = sliding(OVERLAP, 0.5);
    let normal = NormalResponse { force: -1.0, ..normal(&touch) };
    assert_eq!(length(law.evaluate(&touch, &normal, &mut [0.0; 4]).value), 0.0);
}

#[test]
fn the_stored_force_turns_rigidly_with_a_rolling_and_spinning_contact() {
    let mut law = law(1e9, &[("damping", "false")]);
    law.prepare(1e-3);
    let mut memory = [0.0; 4];
    let start = sliding(OVERLAP, 1e-3);
    law.evaluate(&start, &normal(&start), &mut memory);
    let before = length([memory[0], memory[1], memory[2]]);
    // A quarter turn of the normal from z to x, about y.
    for k in 1..=1000 {
        let angle = std::f64::consts::FRAC_PI_2 * f64::from(k) / 1000.0;
        let normal_vector = [libm::sin(angle), 0.0, libm::cos(angle)];
        let touch = Touch { normal: normal_vector, slip_velocity: [0.0; 3], ..start };
        let force = law.evaluate(&touch, &normal(&touch), &mut memory).value;
        assert!((length(force) / before - 1.0).abs() < 1e-12);
        assert!(dot(force, normal_vector).abs() < 1e-14 * before);
    }
    assert!((memory[2] / before + 1.0).abs() < 1e-12, "{memory:?}");
    // A quarter turn about the normal x: from −z to +y.
    let spin = std::f64::consts::FRAC_PI_2;
    for _ in 0..1000 {
        let touch = Touch { normal: [1.0, 0.0, 0.0], slip_velocity: [0.0; 3], spin_about_normal: spin, ..start };
        law.evaluate(&touch, &normal(&touch), &mut memory);
    }
    assert!((memory[1] / before - 1.0).abs() < 1e-11, "{memory:?}");
    assert!(memory[2].abs() < 1e-5 * before, "{memory:?}");
}

/// Work of the tangential force along a path of (overlap, displacement), and the ledger at its end.
fn work_along(
    law: &mut Mindlin<1, true>,
    duration: f64,
    steps: usize,
    path: impl Fn(f64) -> (f64, f64),
) -> (f64, f64, Energies<f64>) {
    let step = duration / steps as f64;
    law.prepare(step);
    let (mut memory, mut energies) = ([0.0; 4], Energies::zero());
    let (mut work, mut scale) = (0.0, 0.0);
    for k in 1..=steps {
        let time = k as f64 * step;
        let speed = (path(time + 0.5 * step).1 - path(time - 0.5 * step).1) / step;
        let touch = sliding(path(time).0, speed);
        let response = law.evaluate(&touch, &normal(&touch), &mut memory);
        work += response.value[0] * speed * step;
        scale = f64::max(scale, work);
        accumulate(&mut energies, &response.energies);
    }
    (work, scale, energies)
}

#[test]
fn unloading_creates_no_energy_over_a_closed_cycle() {
    // Shear while compressed, decompress, shear back, compress again; never slipping.
    let circle = |t: f64| {
        let phase = 2.0 * std::f64::consts::PI * t;
        (OVERLAP * (0.55 + 0.45 * libm::cos(phase + 1.0)), 1e-7 * (1.0 - libm::cos(phase)))
    };
    for direction in [1.0, -1.0] {
        let mut law = law(1e9, &[("damping", "false")]);
        let (work, scale, energies) = work_along(&mut law, 4.0, 40_000, |t| circle(direction * t));
        assert!(work > 0.0 && energies.friction > 0.0, "{work}");
        assert!((work - sum(&energies)).abs() < 1e-4 * scale, "{work} {}", sum(&energies));
    }
}

#[test]
fn the_ledger_closes_over_stick_slip_with_damping_and_varying_overlap() {
    let path = |t: f64| {
        let phase = 2.0 * std::f64::consts::PI * t;
        (OVERLAP * (0.6 + 0.3 * libm::sin(1.7 * phase)), 4e-6 * (1.0 - libm::cos(phase)))
    };
    let error = |steps| {
        let (work, scale, energies) = work_along(&mut law(0.3, &[]), 3.0, steps, path);
        assert!(energies.friction > 0.1 * scale, "slides");
        (work - sum(&energies)).abs() / scale
    };
    assert!(error(1000) < 1e-12, "{}", error(1000));
    assert!(error(16_000) < 1e-12, "{}", error(16_000));
}

#[test]
fn a_spring_whose_limit_falls_in_one_step_loses_what_it_held() {
    let mut law = law(0.3, &[("damping", "false")]);
    law.prepare(1e-3);
    let mut memory = [0.0; 4];
    let mut energies = Energies::zero();
    let mut at = |speed: f64, share: f64, energies: &mut Energies<f64>| {
        let touch = sliding(OVERLAP, speed);
        let whole = normal(&touch);
        let response = law.evaluate(&touch, &NormalResponse { force: share * whole.force, ..whole }, &mut memory);
        accumulate(energies, &response.energies);
    };
    let speed = 0.2 * 0.3 * normal(&sliding(OVERLAP, 0.0)).force / stiffness(OVERLAP) / 1e-3;
    at(speed, 1.0, &mut energies);
    at(speed, 1.0, &mut energies);
    at(0.0, 1.0, &mut energies);
    let (held, friction) = (energies.elastic, energies.friction);
    assert!(held > 0.0 && friction.abs() < 1e-12 * held, "sticks");
    for (share, left) in [(0.1, 0.1 / 0.4), (0.0, 0.0)] {
        at(0.0, share, &mut energies);
        assert!((energies.elastic / held - left * left).abs() < 1e-12, "{share}: {}", energies.elastic / held);
        assert!(
            (energies.friction / held - (1.0 - left * left)).abs() < 1e-12,
            "{share}: {}",
            energies.friction / held
        );
    }
}

/// The share by which the largest speed of a body on a sticking, undamped contact grows over 100 radians at
/// Δt = relative/ω.
fn growth<const AHEAD: bool>(relative: f64) -> f64 {
    let step = relative * (MASS / stiffness(OVERLAP)).sqrt();
    let steps = (100.0 / relative) as usize;
    let shear = ShearSprings::elastic(&constants(1e9));
    let choice = choice(Role::Tangential, "mindlin", &[("damping", "false")]);
    let mut law = Mindlin::<1, AHEAD>::new(&choice, &shear, 1e9);
    law.prepare(step);
    let (mut memory, mut half_step_speed, mut acceleration) = ([0.0; 4], 1e-3, 0.0);
    let (mut early, mut late) = (0.0_f64, 0.0_f64);
    for k in 0..steps {
        let extrapolated = half_step_speed + 0.5 * acceleration * step;
        let touch = sliding(OVERLAP, if AHEAD { extrapolated } else { half_step_speed });
        acceleration = -law.evaluate(&touch, &normal(&touch), &mut memory).value[0] / MASS;
        half_step_speed += acceleration * step;
        if (k as f64) * relative < 7.0 {
            early = early.max(half_step_speed.abs());
        }
        if (steps - k) as f64 * relative < 7.0 {
            late = late.max(half_step_speed.abs());
        }
    }
    late / early - 1.0
}

#[test]
fn a_sticking_oscillator_gains_at_third_order_with_extrapolated_velocities() {
    // Per step the amplitude grows by (ωΔt)⁴/8. Increments taken at the end of the step would lose it all instead.
    for relative in [0.1, 0.17, 0.25] {
        let expected = libm::exp(93.0 * (relative * relative * relative) / 8.0) - 1.0;
        let found = growth::<true>(relative);
        assert!((found / expected - 1.0).abs() < 0.15, "{relative}: {found} {expected}");
    }
}

#[test]
fn a_sticking_oscillator_keeps_its_energy_with_the_velocities_of_half_steps() {
    for relative in [0.02, 0.17, 0.5, 1.0] {
        let found = growth::<false>(relative);
        assert!(found.abs() < 1e-2, "{relative}: {found}");
    }
    assert!(growth::<false>(0.02).abs() < 1e-4);
}

#[test]
fn with_velocities_of_half_steps_a_growing_contact_stiffens_at_second_order() {
    // Overlap grows as t², so that the radius goes as t: at slip velocity v the force is ½ f 8 G a v t.
    let error = |steps: usize| {
        let step = 1.0 / steps as f64;
        let shear = ShearSprings::elastic(&constants(1e9));
        let mut law = Mindlin::<1, false>::new(&choice(Role::Tangential, "mindlin", &[]), &shear, 1e9);
        law.prepare(step);
        let (mut memory, mut force) = ([0.0; 4], 0.0);
        for k in 1..=steps {
            let time = k as f64 * step;
            // Slip velocity (t − ½Δt)², at the half step before.
            let half_time = time - 0.5 * step;
            let touch = sliding(OVERLAP * time * time, 1e-6 * half_time * half_time);
            force = law.evaluate(&touch, &normal(&touch), &mut memory).value[0];
        }
        (force / (stiffness(OVERLAP) * 1e-6 / 4.0) - 1.0).abs()
    };
    assert!(error(1000) < 1e-6, "{}", error(1000));
    assert!((3.8..4.2).contains(&(error(100) / error(200))), "{}", error(100) / error(200));
}

#[test]
fn the_dashpot_never_gives_energy() {
    let mut law = law(0.3, &[]);
    law.prepare(1e-5);
    let mut memory = [0.0; 4];
    for k in 0..2000 {
        let time = f64::from(k) * 1e-5;
        let mut touch = sliding(OVERLAP, 2e-2 * libm::sin(900.0 * time));
        touch.slip_velocity[1] = 1e-2 * libm::cos(400.0 * time);
        let normal = NormalResponse { dashpot: 30.0, ..normal(&touch) };
        let response = law.evaluate(&touch, &normal, &mut memory);
        assert!(response.energies.damping >= -1e-18, "{:?}", response.energies);
        assert!(response.energies.friction >= -1e-18, "{:?}", response.energies);
    }
}

#[test]
fn the_spring_relaxes_with_the_branches_of_the_normal_law() {
    let branches =
        [(4e8, 0.05), (8e8, 0.6)].map(|(modulus, relaxation_time)| MaxwellBranch { modulus, relaxation_time });
    let constants = PairProperties { maxwell: [branches.to_vec(), branches.to_vec()], ..constants(1e9) };
    let shear = ShearSprings::<3>::relaxing(&constants);
    let mut law = Mindlin::<3, true>::new(&choice(Role::Tangential, "mindlin", &[("damping", "false")]), &shear, 1e9);
    let (steps, step, push) = (2000, 1e-3, 0.2);
    law.prepare(step);
    let (mut memory, mut energies, mut work) = ([0.0; 10], Energies::zero(), 0.0);
    let mut force = 0.0;
    for k in 1..=steps {
        let time = f64::from(k) * step;
        let speed = if time < push { 1e-6 * libm::sin(std::f64::consts::PI * time / push) } else { 0.0 };
        let touch = sliding(OVERLAP, speed);
        let response = law.evaluate(&touch, &normal(&touch), &mut memory);
        force = response.value[0];
        work += force * speed * step;
        accumulate(&mut energies, &response.energies);
    }
    // Hereditary integral of G_k exp(−(t−s)/τ_k) v(s), by the midpoint rule.
    let mut expected = 0.0;
    for k in 0..3 {
        let points = 100_000;
        let h = push / f64::from(points);
        let integrand =
            |s: f64| libm::exp(-(2.0 - s) * shear.rate[k]) * 1e-6 * libm::sin(std::f64::consts::PI * s / push);
        let slip = h * (0..points).map(|j| integrand((f64::from(j) + 0.5) * h)).sum::<f64>();
        expected += 2.0 / 3.0 * 8.0 * shear.modulus[k] * (RADIUS * OVERLAP).sqrt() * slip;
    }
    assert!((force / expected - 1.0).abs() < 1e-4, "{force} {expected}");
    assert!(energies.viscous > 0.0 && (work / sum(&energies) - 1.0).abs() < 1e-3, "{work} {energies:?}");
}

#[test]
fn shear_moduli_of_branches_and_spring_add_up_to_the_spontaneous_one() {
    let shear = ShearSprings::<2>::relaxing(&pvdf());
    let nu = pvdf().poisson_ratio[0];
    let spontaneous = (404.6e6 + 1365.9e6) / (4.0 * (1.0 + nu) * (2.0 - nu));
    assert!(((shear.modulus[0] + shear.modulus[1]) / spontaneous - 1.0).abs() < 1e-14);
    assert_eq!(shear.rate[1], 0.0);
}
