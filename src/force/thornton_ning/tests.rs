//! Adhesion against closed forms: JKR's curve and pull-off, the velocity below which spheres stick, the stiffness of
//! Thornton and Ning, and Thornton's law without adhesion.

use super::*;
use crate::force::testing::{accumulate, choice, pair, properties, sum, touch};
use crate::force::thornton::Thornton;
use std::f64::consts::PI;

const RADIUS: f64 = 2.5e-6;
const MASS: f64 = 1e-12;
const YOUNG: f64 = 1e9;
const ENERGY: f64 = 0.2;

fn modulus() -> f64 {
    YOUNG / (2.0 * (1.0 - 0.09))
}

fn constants(surface_energy: f64, yield_stress: f64) -> PairProperties {
    let mut constants = properties(YOUNG, 0.3, Vec::new());
    constants.surface_energy = surface_energy;
    constants.yield_stress = [Some(yield_stress); 2];
    constants
}

fn law(surface_energy: f64, yield_stress: f64) -> ThorntonNing {
    let settings = [("memory_range", "0.5")];
    ThorntonNing::new(&pair(constants(surface_energy, yield_stress), choice(Role::Normal, "thornton_ning", &settings)))
}

const NEVER: f64 = 1e15;

/// JKR's overlap and force at a contact radius.
fn jkr(a: f64, radius: f64) -> (f64, f64) {
    let overlap = a * a / radius - (2.0 * PI * ENERGY * a / modulus()).sqrt();
    (overlap, 4.0 * modulus() * a * a * a / (3.0 * radius) - (8.0 * PI * ENERGY * modulus() * a * a * a).sqrt())
}

#[test]
fn the_elastic_curve_and_its_pull_off_are_those_of_johnson_kendall_and_roberts() {
    let law = law(ENERGY, NEVER);
    let scale = libm::cbrt(2.0 * PI * ENERGY * RADIUS * RADIUS / modulus());
    let mut memory = [0.0; 5];
    law.evaluate(&touch(1e-9, 0.0, RADIUS, MASS), &mut memory);
    let mut least: f64 = 0.0;
    // Down to 0.40 of the scale; the neck breaks at 0.397.
    for k in (400..4000).rev() {
        let a = scale * f64::from(k) / 1000.0;
        let (overlap, force) = jkr(a, RADIUS);
        let response = law.evaluate(&touch(overlap, 0.0, RADIUS, MASS), &mut memory);
        let error = (response.force - force).abs() / (2.0 * PI * ENERGY * RADIUS);
        assert!(error < 1e-6, "a/a_s = 0.001 · {k}: {} {force}", response.force);
        assert!((response.contact_radius / a - 1.0).abs() < 1e-5);
        least = least.min(response.force);
    }
    assert!((least / (-1.5 * PI * ENERGY * RADIUS) - 1.0).abs() < 1e-5, "{least}");
    // At δ = 0 the force is 8/9 of the pull-off force.
    let at_zero = law.evaluate(&touch(0.0, 0.0, RADIUS, MASS), &mut memory).force;
    assert!((at_zero / (-4.0 / 3.0 * PI * ENERGY * RADIUS) - 1.0).abs() < 1e-12);
}

#[test]
fn a_neck_breaks_at_pull_off_and_forms_again_only_on_touch() {
    let law = law(ENERGY, NEVER);
    let scale = libm::cbrt(2.0 * PI * ENERGY * RADIUS * RADIUS / modulus());
    let gap = -(27.0_f64 / 256.0).cbrt_libm() * scale * scale / RADIUS;
    let mut memory = [0.0; 5];
    let mut at = |overlap: f64| law.evaluate(&touch(overlap, 0.0, RADIUS, MASS), &mut memory);
    assert_eq!(at(0.5 * gap).force, 0.0);
    assert!(at(1e-12).force < 0.0);
    assert!(at(0.999 * gap).force < 0.0);
    let broken = at(1.001 * gap);
    assert_eq!((broken.force, broken.contact_radius), (0.0, 0.0));
    // 7.09 (Γ⁵ R⁴/E²)^{1/3}.
    let expected = 7.09 * libm::cbrt(libm::pow(ENERGY, 5.0) * libm::pow(RADIUS, 4.0) / (modulus() * modulus()));
    assert!((broken.energies.damping / expected - 1.0).abs() < 1e-3, "{} {expected}", broken.energies.damping);
    assert_eq!(at(0.5 * gap).force, 0.0);
    assert_eq!(memory, [0.0; 5]);
}

trait Cbrt {
    fn cbrt_libm(self) -> f64;
}

impl Cbrt for f64 {
    fn cbrt_libm(self) -> f64 {
        libm::cbrt(self)
    }
}

/// Speed after an impact over the speed before, 0 when stuck; largest error of the energy ledger over the impact energy.
fn hit(law: &ThorntonNing, speed: f64, time_step: f64) -> (f64, f64) {
    let mut law = *law;
    law.prepare(time_step);
    let mut memory = [0.0; 5];
    let mut energies = Energies::zero();
    let kinetic = |v: f64| 0.5 * MASS * v * v;
    let (mut overlap, mut half) = (0.0, speed);
    let (mut error, mut steps): (f64, u32) = (0.0, 0);
    loop {
        let response = law.evaluate(&touch(overlap, half, RADIUS, MASS), &mut memory);
        accumulate(&mut energies, &response.energies);
        let synchronised = half - 0.5 * response.force / MASS * time_step;
        error = error.max((kinetic(synchronised) + sum(&energies) - kinetic(speed)).abs() / kinetic(speed));
        half -= response.force / MASS * time_step;
        if response.contact_radius == 0.0 {
            return (-half / speed, error);
        }
        overlap += half * time_step;
        steps += 1;
        if steps > 400_000 {
            return (0.0, error);
        }
    }
}

#[test]
fn elastic_spheres_stick_below_the_velocity_of_thornton_and_ning_and_lose_as_much_above_it() {
    let law = law(ENERGY, NEVER);
    let lost = 7.09 * libm::cbrt(libm::pow(ENERGY, 5.0) * libm::pow(RADIUS, 4.0) / (modulus() * modulus()));
    let sticking = (2.0 * lost / MASS).sqrt();
    for ratio in [1.1, 1.5, 3.0] {
        let expected = (1.0 - 1.0 / (ratio * ratio)).sqrt();
        let (restitution, error) = hit(&law, ratio * sticking, 1e-10);
        assert!((restitution - expected).abs() < 0.01, "{ratio}: {restitution}, expected {expected}");
        assert!(error < 0.01, "{ratio}: {error}");
    }
    assert_eq!(hit(&law, 0.9 * sticking, 1e-10).0, 0.0);
}

#[test]
fn plastic_loading_has_the_stiffness_of_thornton_and_ning() {
    let yield_stress = 3e7;
    let pressure = 1.6 * yield_stress;
    let law = law(ENERGY, yield_stress);
    let mut memory = [0.0; 5];
    for k in 1..20 {
        let overlap = 3e-8 + 2e-8 * f64::from(k);
        let h = 1e-6 * overlap;
        let low = law.evaluate(&touch(overlap - h, 0.0, RADIUS, MASS), &mut memory);
        let high = law.evaluate(&touch(overlap + h, 0.0, RADIUS, MASS), &mut memory);
        assert_eq!(memory[2], Regime::Plastic.number());
        let a = 0.5 * (low.contact_radius + high.contact_radius);
        let (first, pull_off) = (4.0 * modulus() * a * a * a / (3.0 * RADIUS), 1.5 * PI * ENERGY * RADIUS);
        let expected = (3.0 * PI * RADIUS * pressure * first.sqrt() - 2.0 * modulus() * a * pull_off.sqrt())
            / (3.0 * first.sqrt() - pull_off.sqrt());
        let slope = (high.force - low.force) / (2.0 * h);
        assert!((slope / expected - 1.0).abs() < 1e-5, "{overlap}: {slope}, expected {expected}");
    }
}

#[test]
fn unloading_follows_the_curve_of_the_larger_radius_and_pulls_harder() {
    let law = law(ENERGY, 3e7);
    let mut memory = [0.0; 5];
    let top = 4e-7;
    let peak = law.evaluate(&touch(top, 0.0, RADIUS, MASS), &mut memory);
    let a = peak.contact_radius;
    let radius =
        4.0 * modulus() * a * a * a / (3.0 * (peak.force + (8.0 * PI * ENERGY * modulus() * a * a * a).sqrt()));
    assert!(radius > 1.2 * RADIUS);
    let shift = top - jkr(a, radius).0;
    assert!((memory[1] / shift - 1.0).abs() < 1e-9, "{} {shift}", memory[1]);
    let mut least: f64 = 0.0;
    let scale = libm::cbrt(2.0 * PI * ENERGY * radius * radius / modulus());
    for k in (400..1000).rev() {
        let now = scale * f64::from(k) / 1000.0;
        if now > a {
            continue;
        }
        let (overlap, force) = jkr(now, radius);
        let response = law.evaluate(&touch(overlap + shift, 0.0, RADIUS, MASS), &mut memory);
        assert!((response.force - force).abs() < 1e-5 * PI * ENERGY * radius, "{} {force}", response.force);
        least = least.min(response.force);
    }
    assert!((least / (-1.5 * PI * ENERGY * radius) - 1.0).abs() < 1e-4);
}

#[test]
fn with_little_adhesion_it_is_thorntons_law() {
    let yield_stress = 1e7;
    let adhesive = law(1e-9, yield_stress);
    let plain = Thornton::new(&pair(constants(0.0, yield_stress), choice(Role::Normal, "thornton", &[])));
    let (mut with, mut without) = ([0.0; 5], [0.0; 4]);
    let mut largest: f64 = 0.0;
    for k in (0..200).chain((0..200).rev()).chain(0..300) {
        let touch = touch(1e-9 * f64::from(k), 0.0, RADIUS, MASS);
        let (a, b) = (adhesive.evaluate(&touch, &mut with).force, plain.evaluate(&touch, &mut without).force);
        largest = largest.max(b);
        assert!((a - b).abs() < 1e-3 * largest + 1e-12, "{k}: {a} {b}");
    }
    assert!((with[3] / without[3] - 1.0).abs() < 1e-3, "{with:?} {without:?}");
}

#[test]
fn the_ledger_closes_over_a_plastic_bounce() {
    let law = law(0.02, 1e7);
    let (restitution, error) = hit(&law, 0.5, 2e-10);
    assert!(restitution > 0.1 && restitution < 0.9, "{restitution}");
    assert!(error < 0.01, "{error}");
}

#[test]
fn a_pair_without_surface_energy_is_refused_and_a_nan_is_not_hidden() {
    assert!(check(&constants(0.0, 1e7)).unwrap_err().contains("surface_energy"));
    assert!(check(&constants(0.1, 1e7)).is_ok());
    let mut memory = [0.0; 5];
    let law = law(ENERGY, 1e7);
    law.evaluate(&touch(1e-8, 0.0, RADIUS, MASS), &mut memory);
    assert!(law.evaluate(&touch(f64::NAN, 0.0, RADIUS, MASS), &mut memory).force.is_nan());
}

/// With a yield pressure that adhesion alone exceeds where the surfaces meet.
#[test]
fn surfaces_that_adhesion_makes_yield_meet_like_others_and_lose_nothing_before() {
    let scale = libm::cbrt(2.0 * PI * ENERGY * RADIUS * RADIUS / modulus());
    let kappa = |yield_stress: f64| PI * 1.6 * yield_stress * RADIUS / (2.0 * modulus() * scale);
    for yield_stress in [2e6, 5e6, 1e7] {
        assert!(kappa(yield_stress) < 0.5, "{}", kappa(yield_stress));
        let law = law(ENERGY, yield_stress);
        let mut memory = [0.0; 5];
        let mut at = |overlap: f64| law.evaluate(&touch(overlap, 0.0, RADIUS, MASS), &mut memory);
        let before = at(-1e-9);
        assert_eq!((before.force, before.contact_radius, sum(&before.energies)), (0.0, 0.0, 0.0));
        let formed = at(0.0);
        assert!((formed.force / (-4.0 / 3.0 * PI * ENERGY * RADIUS) - 1.0).abs() < 1e-12, "{}", formed.force);
        assert!(sum(&formed.energies).abs() < 1e-12 * ENERGY * RADIUS * RADIUS);
        assert!((at(1e-14).contact_radius / scale - 1.0).abs() < 1e-3);
        assert!(law.evaluate(&touch(1e-3 * RADIUS, 0.0, RADIUS, MASS), &mut [0.0; 5]).stiffness > 0.0);
        for speed in [0.5, 2.0] {
            let (_, error) = hit(&law, speed, 1e-10);
            let (_, finer) = hit(&law, speed, 2.5e-11);
            assert!(error < 0.01 && finer < 0.5 * error, "{yield_stress}, {speed}: {error} {finer}");
        }
    }
}

#[test]
fn necks_that_outreach_the_memory_range_are_warned_of() {
    let warning = |range: &str| {
        let law = choice(Role::Normal, "thornton_ning", &[("memory_range", range)]);
        cautions(&pair(constants(ENERGY, NEVER), law), 2.0 * RADIUS).pop()
    };
    assert!(warning("0.001").unwrap().contains("memory_range 0.001"));
    let scale = libm::cbrt(2.0 * PI * ENERGY / (modulus() * RADIUS));
    let needed = 0.472_470_4 * scale * scale;
    assert!(warning(&format!("{}", 1.0001 * needed)).is_none());
    assert!(warning(&format!("{}", 0.9999 * needed)).is_some());
    let of_yield = |yield_stress: f64| {
        let law = choice(Role::Normal, "thornton_ning", &[("memory_range", "0.5")]);
        cautions(&pair(constants(ENERGY, yield_stress), law), 2.0 * RADIUS)
    };
    let least = modulus() * scale / (PI * 1.6);
    assert!(of_yield(1.0001 * least).is_empty());
    assert!(of_yield(0.9999 * least)[0].contains("yield_stress"));
}
