//! Becker–Kamlah against an independent computation, against Thornton's law, and at its changes of regime.

use super::*;
use crate::force::law::Energies;
use crate::force::testing::{accumulate, choice, nmc, pair, sum, table, touch};
use crate::force::thornton::Thornton;

const CASE: &str = include_str!("../../../tests/data/becker_kamlah_case1.csv");
const GEOMETRY: &str = include_str!("../../../tests/data/becker_kamlah_case1_geometry.csv");
const RADIUS: f64 = 2.5e-6;

fn law(settings: &[(&str, &str)]) -> BeckerKamlah {
    BeckerKamlah::new(&pair(nmc(), choice(Role::Normal, "becker_kamlah", settings)))
}

/// The contact of B Table 3 at an overlap, its geometry as in the reference table.
fn table_3(overlap: f64) -> Touch<f64> {
    let g = &table(GEOMETRY)[0];
    Touch { radius_factor: g[2], overlap_factor: g[3], size: 9.35e-6, ..touch(overlap, 0.0, g[0], 1e-12) }
}

#[test]
fn loading_and_unloading_follow_the_reference_path() {
    let law = law(&[]);
    let mut memory = [0.0; plastic::MEMORY];
    let mut largest: f64 = 0.0;
    for row in table(CASE) {
        largest = largest.max(row[1]);
        let force = law.evaluate(&table_3(row[0]), &mut memory).force;
        assert!((force - row[1]).abs() <= 1e-11 * largest, "overlap {}: {force}, expected {}", row[0], row[1]);
    }
}

#[test]
fn first_yield_and_the_fits_are_those_of_table_3() {
    let (law, g) = (law(&[]), &table(GEOMETRY)[0]);
    let first = law.plastic.yield_point(&table_3(0.0));
    let relative = g[0] / 9.35e-6;
    let pairs = [
        (first.overlap, g[8]),
        (first.force, g[9]),
        (first.radius_squared.sqrt(), g[7]),
        (law.pressure.at(relative), g[4]),
        (law.radius.at(relative), g[5]),
    ];
    for (got, expected) in pairs {
        assert!((got / expected - 1.0).abs() < 1e-12, "{got} {expected}");
    }
}

#[test]
fn spheres_with_a_constant_contact_pressure_are_thorntons() {
    let flat = law(&[("pressure_scale", "0"), ("pressure_offset", "1.6")]);
    let thornton = Thornton::new(&pair(nmc(), choice(Role::Normal, "thornton", &[])));
    let mut memory = [[0.0; plastic::MEMORY]; 2];
    let mut largest: f64 = 0.0;
    for depth in (0..400).chain((0..400).rev()).chain(0..600).chain((0..600).rev()) {
        let touch = touch(2e-9 * f64::from(depth), 0.0, RADIUS, 1e-12);
        let a = flat.evaluate(&touch, &mut memory[0]);
        let b = thornton.evaluate(&touch, &mut memory[1]);
        largest = largest.max(b.force);
        assert!((a.force - b.force).abs() <= 1e-13 * largest, "{depth}: {} {}", a.force, b.force);
        assert!((a.contact_radius - b.contact_radius).abs() <= 1e-12 * RADIUS);
    }
    assert!((memory[0][3] / memory[1][3] - 1.0).abs() < 1e-10, "{memory:?}");
}

/// Force at overlaps a hair to both sides of a change of regime, each reached by first loading.
fn jump(law: &BeckerKamlah, at: f64) -> f64 {
    let force = |overlap| law.evaluate(&table_3(overlap), &mut [0.0; plastic::MEMORY]).force;
    let h = 1e-9 * at;
    (force(at + h) - force(at - h)).abs() / force(at)
}

#[test]
fn the_force_is_continuous_at_every_change_of_regime() {
    let law = law(&[]);
    let g = &table(GEOMETRY)[0];
    let (first, full) = (g[8], g[8] * g[5] * g[5]);
    for at in [first, full] {
        assert!(jump(&law, at) < 1e-8, "{at}: {}", jump(&law, at));
    }
    // From loading into unloading, back, and into the gap of the dent.
    for top in [0.5 * full, full, 1.5 * full] {
        let mut memory = [0.0; plastic::MEMORY];
        let mut at = |overlap| law.evaluate(&table_3(overlap), &mut memory).force;
        let peak = at(top);
        let h = 1e-9 * top;
        assert!((at(top - h) / peak - 1.0).abs() < 1e-7);
        assert!((at(top + h) / peak - 1.0).abs() < 1e-7);
        let residual = {
            law.evaluate(&table_3(top), &mut memory.clone());
            memory[1]
        };
        let mut at = |overlap| law.evaluate(&table_3(overlap), &mut memory).force;
        assert!(at(residual + h) < 1e-9 * peak);
        assert_eq!(at(residual - h), 0.0);
    }
}

#[test]
fn memory_names_all_regimes() {
    let law = law(&[]);
    let g = &table(GEOMETRY)[0];
    let (first, full) = (g[8], g[8] * g[5] * g[5]);
    let mut memory = [0.0; plastic::MEMORY];
    let regimes =
        [0.9 * first, 1.1 * first, 0.9 * full, 1.1 * full, 1.05 * full, 1.2 * full, 0.1 * first].map(|overlap| {
            law.evaluate(&table_3(overlap), &mut memory);
            memory[2]
        });
    assert_eq!(regimes, [1.0, 2.0, 2.0, 3.0, 4.0, 3.0, 0.0]);
}

#[test]
fn the_plastic_ledger_is_the_area_of_the_loop() {
    let law = law(&[]);
    let g = &table(GEOMETRY)[0];
    for top in [1.5, 8.0, 20.0] {
        let mut memory = [0.0; plastic::MEMORY];
        let mut energies = Energies::zero();
        let (mut work, mut last, mut before) = (0.0, 0.0, 0.0);
        let steps: i32 = 20_000;
        for step in 0..=2 * steps {
            let depth = top * g[8] * f64::from(steps - (step - steps).abs()) / f64::from(steps);
            let response = law.evaluate(&table_3(depth), &mut memory);
            accumulate(&mut energies, &response.energies);
            work += 0.5 * (response.force + before) * (depth - last);
            (last, before) = (depth, response.force);
        }
        assert!((sum(&energies) / work - 1.0).abs() < 1e-5, "{top}: {} {work}", sum(&energies));
    }
}

#[test]
fn a_nan_is_not_hidden() {
    let mut memory = [0.0; plastic::MEMORY];
    law(&[]).evaluate(&table_3(1e-6), &mut memory);
    assert!(law(&[]).evaluate(&table_3(f64::NAN), &mut memory).force.is_nan());
}

#[test]
fn particles_beyond_the_fitted_range_are_warned_of() {
    assert_eq!(caution(2.0), None);
    assert!(caution(2.5).unwrap().contains("2.5"));
}
