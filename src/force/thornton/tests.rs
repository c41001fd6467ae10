//! Thornton's law against an independent computation and his closed form of restitution.

use super::*;
use crate::force::composition::{self, MAX_MEMORY};
use crate::force::law::Energies;
use crate::force::law::{ContactLaw, LawVisitor};
use crate::force::testing::{accumulate, choice, impact, nmc, pair, sum, table, touch};

const CYCLE: &str = include_str!("../../../tests/data/thornton_cycle.csv");
const RESTITUTION: &str = include_str!("../../../tests/data/thornton_restitution.csv");

/// R_eff of two spheres of 5 µm.
const RADIUS: f64 = 2.5e-6;
const MASS: f64 = 1e-12;

fn law() -> Thornton {
    Thornton::new(&pair(nmc(), choice(Role::Normal, "thornton", &[])))
}

/// δ_y, F_y.
fn first_yield() -> (f64, f64) {
    let modulus = 142e9 / (2.0 * (1.0 - 0.0625));
    let ratio = std::f64::consts::PI * 1.6 * 7.9e9 / (2.0 * modulus);
    let overlap = ratio * ratio * RADIUS;
    (overlap, 4.0 / 3.0 * modulus * (RADIUS * overlap).sqrt() * overlap)
}

#[test]
fn loading_and_unloading_follow_the_reference_path() {
    let law = law();
    let mut memory = [0.0; plastic::MEMORY];
    let mut largest: f64 = 0.0;
    for row in table(CYCLE) {
        largest = largest.max(row[1]);
        let force = law.evaluate(&touch(row[0], 0.0, RADIUS, MASS), &mut memory).force;
        assert!((force - row[1]).abs() <= 1e-12 * largest, "overlap {}: {force}, expected {}", row[0], row[1]);
    }
}

#[test]
fn restitution_is_that_of_the_closed_form_from_once_to_a_thousand_times_the_yield_velocity() {
    let (overlap, force) = first_yield();
    let yield_speed = (0.8 * force * overlap / MASS).sqrt();
    let mut plastic_loading_stiffness = force / overlap;
    for row in table(RESTITUTION) {
        let speed = row[0] * yield_speed;
        // The unloading stiffness at the largest overlap bounds the time step.
        plastic_loading_stiffness = plastic_loading_stiffness.max(row[0].sqrt() * force / overlap);
        let step = 2e-3 * (MASS / (4.0 * plastic_loading_stiffness)).sqrt();
        let hit = impact(law(), RADIUS, MASS, speed, step);
        assert!((hit.restitution / row[1] - 1.0).abs() < 1e-3, "{}: {} expected {}", row[0], hit.restitution, row[1]);
        assert!(hit.ledger_error < 1e-3, "{}: {}", row[0], hit.ledger_error);
        let lost = 1.0 - hit.restitution * hit.restitution;
        let share = hit.energies.plastic / (0.5 * MASS * speed * speed);
        assert!((share - lost).abs() < 1e-3, "{}: plastic share {share}, lost {lost}", row[0]);
    }
}

#[test]
fn the_plastic_ledger_is_the_area_of_the_loop() {
    let law = law();
    let (overlap, _) = first_yield();
    let mut memory = [0.0; plastic::MEMORY];
    let mut energies = Energies::zero();
    let (mut work, mut last) = (0.0, 0.0);
    let steps: i32 = 20_000;
    for step in 0..=2 * steps {
        let depth = 8.0 * overlap * f64::from(steps - (step - steps).abs()) / f64::from(steps);
        let response = law.evaluate(&touch(depth, 0.0, RADIUS, MASS), &mut memory);
        accumulate(&mut energies, &response.energies);
        work += response.force * (depth - last);
        last = depth;
    }
    // The first-order quadrature of the loop, both ways, is good to one step.
    assert!((sum(&energies) / work - 1.0).abs() < 1e-3, "{} {work}", sum(&energies));
    assert_eq!(energies.elastic, 0.0);
}

#[test]
fn a_dent_stays_when_the_spheres_part_and_an_elastic_touch_leaves_nothing() {
    let law = law();
    let (overlap, _) = first_yield();
    let mut memory = [0.0; plastic::MEMORY];
    let mut at = |depth| law.evaluate(&touch(depth, 0.0, RADIUS, MASS), &mut memory).force;
    let peak = at(5.0 * overlap);
    assert_eq!(at(-0.5 * overlap), 0.0);
    assert_eq!(at(0.5 * overlap), 0.0);
    assert!((at(5.0 * overlap) / peak - 1.0).abs() < 1e-14);
    let mut elastic = [0.0; plastic::MEMORY];
    law.evaluate(&touch(0.9 * overlap, 0.0, RADIUS, MASS), &mut elastic);
    assert_eq!(elastic[..3], [0.9 * overlap, 0.0, 1.0]);
    law.evaluate(&touch(-0.1 * overlap, 0.0, RADIUS, MASS), &mut elastic);
    assert_eq!(elastic, [0.0; plastic::MEMORY]);
}

#[test]
fn stiffness_is_the_slope_of_unloading_and_a_nan_is_not_hidden() {
    let law = law();
    let (overlap, _) = first_yield();
    let mut memory = [0.0; plastic::MEMORY];
    law.evaluate(&touch(5.0 * overlap, 0.0, RADIUS, MASS), &mut memory);
    let mut at = |depth| law.evaluate(&touch(depth, 0.0, RADIUS, MASS), &mut memory);
    let (depth, h) = (4.9 * overlap, 1e-6 * overlap);
    let slope = (at(depth + h).force - at(depth - h).force) / (2.0 * h);
    assert!((at(depth).stiffness / slope - 1.0).abs() < 1e-6, "{} {slope}", at(depth).stiffness);
    assert!(at(f64::NAN).force.is_nan());
}

#[test]
fn memory_names_the_regime_and_the_plastic_overlap() {
    let law = law();
    let (overlap, _) = first_yield();
    let mut memory = [0.0; plastic::MEMORY];
    let mut at = |depth| {
        law.evaluate(&touch(depth, 0.0, RADIUS, MASS), &mut memory);
        (memory[1], memory[2])
    };
    assert_eq!(at(0.5 * overlap), (0.0, 1.0));
    let (plastic_overlap, regime) = at(9.0 * overlap);
    assert_eq!(regime, 3.0);
    assert!(plastic_overlap > overlap && plastic_overlap < 9.0 * overlap);
    assert_eq!(at(8.9 * overlap), (plastic_overlap, 4.0));
    assert_eq!(at(0.99 * plastic_overlap), (plastic_overlap, 0.0));
    assert_eq!(at(9.0 * overlap), (plastic_overlap, 3.0));
}

/// Friction of a contact that parts from its dent and is pressed together again.
struct PartAndReturn;

impl LawVisitor for PartAndReturn {
    type Output = Vec<[f64; 3]>;
    fn visit<C: ContactLaw>(self, mut law: C) -> Self::Output {
        law.prepare(1e-9);
        let (overlap, _) = first_yield();
        let mut memory = [0.0; MAX_MEMORY];
        let path = [(6.0, 1e-2), (6.0, 1e-2), (0.1, 1e-2), (6.0, 0.0), (6.0, 0.0)];
        let step = |(depth, speed): (f64, f64)| {
            let touch = Touch { slip_velocity: [speed, 0.0, 0.0], ..touch(depth * overlap, 0.0, RADIUS, MASS) };
            law.evaluate(&touch, &mut memory[..C::MEMORY]).tangential_force
        };
        path.map(step).to_vec()
    }
}

#[test]
fn friction_ends_where_the_contact_circle_closes_though_the_dent_stays() {
    let mut pair = pair(nmc(), choice(Role::Normal, "thornton", &[]));
    pair.tangential = Some(choice(Role::Tangential, "mindlin", &[("damping", "false")]));
    let forces = composition::visit(&pair, PartAndReturn);
    assert!(forces[1][0] > forces[0][0] && forces[0][0] > 0.0);
    assert_eq!(forces[2..], [[0.0; 3]; 3]);
}

#[test]
fn a_pair_of_which_nothing_yields_is_refused() {
    let mut properties = nmc();
    properties.yield_stress = [None, Some(1e9)];
    assert!(plastic::check(&properties).is_ok());
    properties.yield_stress = [None; 2];
    assert!(plastic::check(&properties).unwrap_err().contains("yield_stress"));
}
