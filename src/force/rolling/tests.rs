//! Tests of rolling and twisting resistance: stiffness, limits, signs, turning, energies.

use super::*;
use crate::force::law::NormalLaw;
use crate::force::testing::{accumulate, choice, pair, properties, sum, touch};
use crate::force::{hertz::Hertz, lane::Vector};

const RADIUS: f64 = 5e-3;
const MASS: f64 = 1e-2;
const OVERLAP: f64 = 1e-5;

fn constants(resistance: f64) -> PairProperties {
    PairProperties {
        rolling_friction: 0.1 * resistance,
        twisting_friction: 0.02 * resistance,
        ..properties(1e9, 0.3, Vec::new())
    }
}

fn law(resistance: f64, settings: &[(&str, &str)]) -> SpringSlider {
    SpringSlider::new(&choice(Role::Rolling, "spring_slider", settings), &constants(resistance))
}

fn normal(touch: &Touch<f64>) -> NormalResponse<f64> {
    let choice = choice(Role::Normal, "hertz", &[("damping", "none")]);
    Hertz::new(&pair(constants(1.0), choice)).evaluate(touch, &mut [])
}

fn spinning(overlap: f64, relative_spin: Vector<f64>) -> Touch<f64> {
    Touch { relative_spin, ..touch(overlap, 0.0, RADIUS, MASS) }
}

fn length(v: Vector<f64>) -> f64 {
    dot(v, v).sqrt()
}

#[test]
fn stiffnesses_are_those_of_the_tangential_spring_times_the_squared_arms() {
    let (steps, step) = (1000, 1e-6);
    let touch = spinning(OVERLAP, [0.3, 0.0, 0.7]);
    let normal = normal(&touch);
    let tangential = 8.0 * constants(1.0).effective_shear_modulus() * normal.contact_radius;
    // Half an increment less at the start: with velocities of the full step as the trapezoidal rule has it, with those of
    // the half step as there was no stiffness before.
    let elapsed = f64::from(steps) - 0.5;
    for velocities in [Velocities::FullStep, Velocities::HalfStep] {
        let choice = choice(Role::Rolling, "spring_slider", &[("damping_ratio", "0")]);
        let mut law = SpringSlider::new(&choice, &PairProperties { velocities, ..constants(1e9) });
        law.prepare(step);
        let (mut memory, mut moment) = ([0.0; 5], [0.0; 3]);
        for _ in 0..steps {
            moment = law.evaluate(&touch, &normal, &mut memory).value;
        }
        let rolling = tangential * RADIUS * RADIUS * 0.3 * elapsed * step;
        let twisting = 0.5 * tangential * normal.contact_radius * normal.contact_radius * 0.7 * elapsed * step;
        assert!((moment[0] / rolling - 1.0).abs() < 1e-12, "{moment:?} {rolling}");
        assert!((moment[2] / twisting - 1.0).abs() < 1e-12, "{moment:?} {twisting}");
    }
}

#[test]
fn moments_reach_their_limits_exactly_and_never_pass_them() {
    for (word, arm) in
        [("effective_radius", 0.02 * RADIUS), ("contact_radius", 2.0 / 3.0 * 0.4 * (RADIUS * OVERLAP).sqrt())]
    {
        let mut law = law(1.0, &[("twisting_limit", word)]);
        law.prepare(1e-5);
        let mut memory = [0.0; 5];
        let touch = spinning(OVERLAP, [30.0, -40.0, -500.0]);
        let normal = normal(&touch);
        for k in 0..3000 {
            let moment = law.evaluate(&touch, &normal, &mut memory).value;
            let (rolling, twisting) = (length([moment[0], moment[1], 0.0]), moment[2]);
            let (rolling, twisting) = (rolling / (0.1 * RADIUS * normal.force), twisting / (arm * normal.force));
            assert!(rolling <= 1.0 + 1e-15 && twisting >= -1.0 - 1e-15);
            if k > 2000 {
                assert!((rolling - 1.0).abs() < 1e-14, "{word}: {rolling}");
                assert!((twisting + 1.0).abs() < 1e-14, "{word}: {twisting}");
                assert!(moment[0] > 0.0 && moment[1] < 0.0, "the moment on i follows the spin of j");
            }
        }
    }
}

#[test]
fn the_rolling_moment_turns_rigidly_with_the_contact() {
    let mut law = law(1e9, &[("damping_ratio", "0")]);
    law.prepare(1e-3);
    let mut memory = [0.0; 5];
    let start = spinning(OVERLAP, [1e-3, 0.0, 0.0]);
    law.evaluate(&start, &normal(&start), &mut memory);
    let before = length([memory[0], memory[1], memory[2]]);
    for k in 1..=1000 {
        let angle = std::f64::consts::FRAC_PI_2 * f64::from(k) / 1000.0;
        let direction = [libm::sin(angle), 0.0, libm::cos(angle)];
        let touch = Touch { normal: direction, relative_spin: [0.0; 3], ..start };
        let moment = law.evaluate(&touch, &normal(&touch), &mut memory).value;
        assert!((length(moment) / before - 1.0).abs() < 1e-12);
        assert!(dot(moment, direction).abs() < 1e-14 * before);
    }
    assert!((memory[2] / before + 1.0).abs() < 1e-12, "{memory:?}");
}

#[test]
fn the_ledger_closes_and_a_closed_cycle_gives_no_energy() {
    for (resistance, ratio) in [(1e9, "0"), (1.0, "0.3")] {
        let mut law = law(resistance, &[("damping_ratio", ratio)]);
        let (steps, step) = (60_000, 5e-5);
        law.prepare(step);
        let (mut memory, mut energies, mut work, mut scale) = ([0.0; 5], Energies::zero(), 0.0, 0.0);
        for k in 1..=steps {
            let phase = 2.0 * std::f64::consts::PI * f64::from(k) * step;
            let rate = 2e-2 * libm::sin(phase);
            let touch = spinning(OVERLAP * (0.6 + 0.3 * libm::sin(phase + 1.0)), [rate, 0.0, 20.0 * rate]);
            let response = law.evaluate(&touch, &normal(&touch), &mut memory);
            work += dot(response.value, touch.relative_spin) * step;
            scale = f64::max(scale, work);
            accumulate(&mut energies, &response.energies);
        }
        assert!(work > 0.0 && energies.friction > 0.0);
        assert!((work - sum(&energies)).abs() < 1e-3 * scale, "{work} {}", sum(&energies));
    }
}
