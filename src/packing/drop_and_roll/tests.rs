use super::super::Packing;
use super::super::radii::draw_radii;
use super::super::test_input::{config, smallest_relative_distance, solid_fraction, species};
use super::*;
use crate::config::{Boundary, Config, DropAndRollConfig, PackingConfig, RadiusDistribution, Species};

fn drop_equal(count: usize, side: f64, seed: u64) -> DroppedBed {
    drop_all(&Request { radii: &vec![1.0; count], floor: [side; 2], seed }).unwrap()
}

/// All images of spheres that touch this one, by brute force; panics if one overlaps it.
fn touched(bed: &DroppedBed, radii: &[f64], floor: [f64; 2], id: usize) -> Vec<[f64; 3]> {
    let own = bed.positions[id];
    let mut found = Vec::new();
    for (other, position) in bed.positions.iter().enumerate() {
        for shift in [-2, -1, 0, 1, 2].into_iter().flat_map(|x| [-2, -1, 0, 1, 2].map(move |y| [x, y])) {
            let centre = [
                position[0] + f64::from(shift[0]) * floor[0],
                position[1] + f64::from(shift[1]) * floor[1],
                position[2],
            ];
            let d = minus(centre, own);
            let (distance, sum) = (dot(d, d).sqrt(), radii[id] + radii[other]);
            if other == id && shift == [0, 0] {
                continue;
            }
            assert!(distance > sum * (1.0 - 1e-9), "{id} and {other} overlap: {distance} {sum}");
            if distance < sum * (1.0 + 1e-9) {
                found.push(centre);
            }
        }
    }
    found
}

/// Whether the point lies inside the triangle, seen from above.
fn inside(point: [f64; 3], corners: [[f64; 3]; 3], slack: f64) -> bool {
    let side = |a: [f64; 3], b: [f64; 3]| {
        let (edge, to) = (minus(b, a), minus(point, a));
        edge[0] * to[1] - edge[1] * to[0]
    };
    let [a, b, c] = corners;
    let sides = [side(a, b), side(b, c), side(c, a)];
    sides.iter().all(|s| *s >= -slack) || sides.iter().all(|s| *s <= slack)
}

/// Every sphere lies on the floor, or its centre inside the triangle of three that it touches.
fn assert_at_rest(bed: &DroppedBed, radii: &[f64], floor: [f64; 2]) {
    for (id, position) in bed.positions.iter().enumerate() {
        let contacts = touched(bed, radii, floor, id);
        assert!(position[2] >= radii[id], "{id} is below the floor");
        if position[2] == radii[id] {
            continue;
        }
        let count = contacts.len();
        let held = (0..count)
            .flat_map(|a| (a + 1..count).flat_map(move |b| (b + 1..count).map(move |c| [a, b, c])))
            .any(|triple| inside(*position, triple.map(|t| contacts[t]), 1e-9 * radii[id] * radii[id]));
        assert!(held, "{id} at {position:?} rests on {count} contacts that do not hold it");
    }
}

#[test]
fn every_sphere_rests_on_the_floor_or_on_three_that_hold_it() {
    for seed in 0..4 {
        let bed = drop_equal(400, 11.0, seed);
        assert_at_rest(&bed, &[1.0; 400], [11.0; 2]);
    }
    // Cells of less than two diameters, where images of one sphere hold another.
    for side in [2.0, 2.5, 3.1, 3.9] {
        let bed = drop_equal(60, side, 1);
        assert_at_rest(&bed, &[1.0; 60], [side; 2]);
    }
}

#[test]
fn spheres_of_unequal_size_rest_too() {
    for sigma in [0.2, 0.8] {
        let sizes = RadiusDistribution::Lognormal { median: 1.0, sigma, min: 0.2, max: 4.0 };
        let radii: Vec<f64> =
            draw_radii(3, &[species("a", 500, sizes)]).unwrap().iter().map(|one| one.radius).collect();
        let floor = [12.0, 17.0];
        let bed = drop_all(&Request { radii: &radii, floor, seed: 2 }).unwrap();
        assert_at_rest(&bed, &radii, floor);
    }
}

/// One sphere at rest at (10, 10), and where one of another radius that starts beside its top ends.
fn roll_off(at_rest: f64, radius: f64) -> [f64; 3] {
    let balls = [Ball { position: [10.0, 10.0, at_rest], radius: at_rest }];
    let grid = Grid::new(slab([20.0; 2], 20.0), &balls, 1.0);
    let bed = Bed { balls: &balls, grid: &grid, top: 2.0 * at_rest, largest: at_rest.max(radius) };
    bed.settle(radius, [10.3, 10.4], 0.0).unwrap().0
}

#[test]
fn a_sphere_rolls_off_another_one_along_its_meridian() {
    // A larger one reaches the floor before the equator, a smaller one falls from there.
    for (at_rest, radius, distance) in [(1.0, 2.25, 3.0), (1.0, 1.0, 2.0), (2.0, 0.5, 2.5)] {
        let end = roll_off(at_rest, radius);
        let expected = [10.0 + 0.6 * distance, 10.0 + 0.8 * distance, radius];
        assert!((0..3).all(|k| (end[k] - expected[k]).abs() < 1e-12), "{end:?} {expected:?}");
    }
}

#[test]
fn a_sphere_settles_in_the_pocket_of_three() {
    let corners = [[9.0, 9.0, 1.0], [11.0, 9.0, 1.0], [10.0, 9.0 + 3.0_f64.sqrt(), 1.0]];
    let balls = corners.map(|position| Ball { position, radius: 1.0 });
    let grid = Grid::new(slab([20.0; 2], 20.0), &balls, 1.0);
    let bed = Bed { balls: &balls, grid: &grid, top: 2.0, largest: 1.0 };
    let pocket = [10.0, 9.0 + (1.0_f64 / 3.0).sqrt(), 1.0 + (8.0_f64 / 3.0).sqrt()];
    for start in [[10.0, 9.4], [9.3, 9.2], [10.9, 9.1], [10.1, 10.4], pocket[..2].try_into().unwrap()] {
        let (end, _) = bed.settle(1.0, start, 0.3).unwrap();
        assert!((0..3).all(|k| (end[k] - pocket[k]).abs() < 1e-12), "from {start:?}: {end:?}");
    }
    // Over the outer side it rolls down to the floor.
    assert_eq!(bed.settle(1.0, [10.0, 8.9], 0.3).unwrap().0[2], 1.0);
}

/// Drop and roll with the defaults of the input, periodic in all directions.
fn given(list: Vec<Species>) -> Config {
    let settings = DropAndRollConfig { margin: 4.0, remaining_overlap: 1e-6 };
    Config { packing: PackingConfig::DropAndRoll(settings), ..config(list) }
}

fn equal(count: usize) -> Vec<Species> {
    vec![species("a", count, RadiusDistribution::Fixed(2.5e-6))]
}

/// The packing of this input; no two of its spheres overlap by more than the input allows.
fn packed(given: &Config) -> Packing {
    let packing = super::super::build(given).unwrap();
    let positions: Vec<[f64; 3]> = packing.particles.iter().map(|particle| particle.position).collect();
    let radii: Vec<f64> = packing.particles.iter().map(|particle| particle.radius).collect();
    let cell = Cell { sides: packing.sides, periodic: super::super::periodic_axes(&given.cell) };
    let smallest = smallest_relative_distance(&positions, &radii, &cell);
    assert!(smallest > 1.0 - 1e-6, "{smallest}");
    for (id, particle) in packing.particles.iter().enumerate() {
        assert_eq!(particle.id as usize, id);
        assert!((0..3).all(|k| particle.position[k] >= 0.0 && particle.position[k] < packing.sides[k]));
    }
    packing
}

#[test]
fn equal_spheres_fill_0_58_of_a_periodic_cell_for_ten_seeds() {
    let mut sum = 0.0;
    for seed in 0..10 {
        let packing = packed(&Config { seed, ..given(equal(226)) });
        assert_eq!(packing.particles.len(), 226);
        let fraction = solid_fraction(&packing);
        assert!((fraction - 0.58).abs() < 0.015, "seed {seed}: {fraction}");
        assert!((packing.sides[2] / packing.sides[0] - 1.0).abs() < 0.03, "{:?}", packing.sides);
        sum += fraction;
    }
    assert!((sum / 10.0 - 0.58).abs() < 0.005, "{}", sum / 10.0);
}

#[test]
fn species_are_mixed_over_the_height_in_their_proportions() {
    let sizes = RadiusDistribution::Lognormal { median: 1e-6, sigma: 0.2, min: 0.6e-6, max: 1.6e-6 };
    let mut list = vec![species("few", 200, RadiusDistribution::Fixed(2e-6)), species("many", 600, sizes)];
    list.insert(1, species("none", 0, RadiusDistribution::Fixed(9e-6)));
    let packing = packed(&given(list));
    assert_eq!(packing.particles.len(), 800);
    assert!(packing.particles.is_sorted_by_key(|particle| particle.species));
    let few: Vec<_> = packing.particles.iter().filter(|particle| particle.species == 0).collect();
    assert!((170..230).contains(&few.len()), "{}", few.len());
    let lower = few.iter().filter(|particle| particle.position[2] < 0.5 * packing.sides[2]).count();
    let share = lower as f64 / few.len() as f64;
    assert!((0.35..0.65).contains(&share), "{share}");
}

#[test]
fn the_seed_decides_every_bit() {
    let digest = |seed| {
        let packing = packed(&Config { seed, ..given(equal(100)) });
        let bits: Vec<u64> = packing.particles.iter().flat_map(|p| p.position.map(f64::to_bits)).collect();
        xxhash_rust::xxh3::xxh3_64(bytemuck::cast_slice(&bits))
    };
    assert_eq!(digest(1), digest(1));
    assert_ne!(digest(1), digest(2));
    assert_eq!(digest(1), PINNED, "packings of old inputs have changed");
}

const PINNED: u64 = 15_593_773_702_287_650_422;

#[test]
fn between_walls_the_bed_lies_on_the_floor_and_touches_the_lid() {
    let mut walled = given(equal(100));
    walled.cell.boundary[2] = Boundary::Walls { material: 0 };
    let packing = packed(&walled);
    let heights = || packing.particles.iter().map(|particle| particle.position[2]);
    assert_eq!(heights().fold(f64::INFINITY, f64::min), 2.5e-6);
    assert_eq!(heights().fold(0.0, f64::max) + 2.5e-6, packing.sides[2]);

    let [x, y, z] = packing.sides;
    walled.cell.sides = Some([x, y, 2.0 * z]);
    assert_eq!(packed(&walled).particles, packing.particles);
    walled.cell.sides = Some([x, y, 0.9 * z]);
    let message = super::super::build(&walled).unwrap_err().to_string();
    assert!(
        message.contains("the bed of 100 dropped particles is") && message.contains("higher or wider"),
        "{message}"
    );
}

#[test]
fn impossible_floors_and_heights_are_errors() {
    let message = |aspect, count| {
        let mut given = given(equal(count));
        given.cell.aspect = aspect;
        super::super::build(&given).unwrap_err().to_string()
    };
    let narrow = message([1.0, 1.0, 100.0], 20);
    assert!(
        narrow.starts_with("packing: the floor of drop and roll is") && narrow.contains("wide along x"),
        "{narrow}"
    );
    let flat = message([10.0, 10.0, 1.0], 20);
    assert!(flat.contains("fill a height of") && flat.contains("higher in z"), "{flat}");
    let endless = message([1e13, 1e13, 1.0], 20);
    assert!(endless.contains("more than ids can number"), "{endless}");
    assert!(message([1.0; 3], 0).contains("no particles to drop"));
}
