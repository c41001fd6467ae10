use super::super::test_input::smallest_relative_distance;
use super::*;

fn cubic(radii: &[f64], seed: u64) -> Request<'_> {
    Request {
        radii,
        shape: Cell { sides: [1.0; 3], periodic: [true; 3] },
        solid_fraction: None,
        seed,
        contraction_rate: 5e-4,
        max_moves_per_particle: 1e5,
    }
}

/// Spheres touch (one pair exactly), and none overlaps, counted over all images.
fn assert_just_touching(request: &Request) -> RandomPacking {
    let packing = pack(request).unwrap();
    let cell = Cell { sides: packing.sides, ..request.shape };
    let smallest = smallest_relative_distance(&packing.positions, request.radii, &cell);
    assert!((smallest - 1.0).abs() < 1e-12, "{smallest}");
    assert_within(&packing, request);
    let fraction = solid_volume(request.radii) / cell.volume();
    assert!((fraction - packing.solid_fraction).abs() < 1e-12);
    packing
}

fn assert_within(packing: &RandomPacking, request: &Request) {
    for (position, radius) in packing.positions.iter().zip(request.radii) {
        for k in 0..3 {
            assert!(position[k] >= 0.0 && position[k] < packing.sides[k]);
            if !request.shape.periodic[k] {
                let gap = position[k].min(packing.sides[k] - position[k]);
                assert!(gap >= radius * (1.0 - 1e-12), "{gap} {radius}");
            }
        }
    }
}

/// Radii from 1 to `ratio`, many small and few large ones.
fn graded(count: usize, ratio: f64) -> Vec<f64> {
    (0..count)
        .map(|id| {
            let uniform = Draws::new(5, Purpose::Radius, id as u64).uniform();
            1.0 / (1.0 - uniform * (1.0 - 1.0 / ratio))
        })
        .collect()
}

#[test]
fn equal_spheres_reach_0_635_for_ten_seeds() {
    for seed in 0..10 {
        let packing = assert_just_touching(&cubic(&[0.25e-6; 250], seed));
        assert!((packing.solid_fraction - 0.635).abs() < 0.005, "seed {seed}: {}", packing.solid_fraction);
    }
}

#[test]
fn slower_contraction_packs_denser() {
    let fraction = |rate| pack(&Request { contraction_rate: rate, ..cubic(&[1.0; 250], 0) }).unwrap().solid_fraction;
    let fractions = [0.02, 0.005, 0.001].map(fraction);
    assert!(fractions[0] < fractions[1] && fractions[1] < fractions[2], "{fractions:?}");
}

#[test]
fn the_seed_decides_every_bit() {
    let bits = |seed| {
        let packing = pack(&Request { contraction_rate: 0.005, ..cubic(&[1.0; 100], seed) }).unwrap();
        packing.positions.concat().iter().map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(bits(1), bits(1));
    let digest = xxhash_rust::xxh3::xxh3_64(bytemuck::cast_slice(&bits(1)));
    assert_eq!(digest, 368_043_315_042_909_356, "packings of old inputs have changed");
    assert_ne!(bits(1), bits(2));
}

#[test]
fn the_unit_of_length_does_not_matter() {
    let fraction =
        |radius| pack(&Request { contraction_rate: 0.005, ..cubic(&[radius; 100], 3) }).unwrap().solid_fraction;
    assert!((fraction(1.0) - fraction(0.25e-6)).abs() < 0.02);
}

#[test]
fn polydisperse_spheres_just_touch() {
    for ratio in [1.2, 3.0, 10.0] {
        let radii = graded(300, ratio);
        let packing = assert_just_touching(&Request { contraction_rate: 0.002, ..cubic(&radii, 0) });
        assert!((0.60..0.85).contains(&packing.solid_fraction), "ratio {ratio}: {}", packing.solid_fraction);
    }
}

#[test]
fn small_cells_with_several_images_of_one_partner_work() {
    for count in 1..=20 {
        for seed in 0..3 {
            let radii = vec![1.0; count];
            assert_just_touching(&cubic(&radii, seed));
        }
    }
}

#[test]
fn cells_of_unequal_sides_keep_their_proportions() {
    let shape = Cell { sides: [1.0, 2.0, 5.0], periodic: [true; 3] };
    let radii = graded(200, 2.0);
    let packing = assert_just_touching(&Request { shape, contraction_rate: 0.002, ..cubic(&radii, 0) });
    assert!((packing.sides[1] / packing.sides[0] - 2.0).abs() < 1e-12);
    assert!((packing.sides[2] / packing.sides[0] - 5.0).abs() < 1e-12);
}

#[test]
fn walls_have_no_images_and_keep_their_distance() {
    let shape = Cell { sides: [1.0, 1.0, 1.5], periodic: [true, true, false] };
    assert_just_touching(&Request { shape, contraction_rate: 0.002, ..cubic(&[1.0; 200], 0) });
    let box_of_walls = Cell { sides: [1.0; 3], periodic: [false; 3] };
    for count in [1, 2, 9] {
        let packing = pack(&Request { shape: box_of_walls, ..cubic(&vec![1.0; count], 0) }).unwrap();
        assert_within(&packing, &Request { shape: box_of_walls, ..cubic(&vec![1.0; count], 0) });
    }
}

#[test]
fn a_lower_fraction_is_met_exactly_without_overlaps() {
    for fraction in [0.05, 0.3, 0.6] {
        let radii = graded(200, 2.0);
        let request = Request { solid_fraction: Some(fraction), ..cubic(&radii, 0) };
        let packing = pack(&request).unwrap();
        let cell = Cell { sides: packing.sides, ..request.shape };
        assert!((solid_volume(&radii) / cell.volume() - fraction).abs() < 1e-12);
        assert!(smallest_relative_distance(&packing.positions, &radii, &cell) >= 1.0 - 1e-12);
        assert_within(&packing, &request);
    }
}

#[test]
fn a_fraction_just_above_that_of_the_rate_is_reached_by_a_slower_one() {
    for seed in 0..5 {
        let request = Request { solid_fraction: Some(0.64), ..cubic(&[1.0; 250], seed) };
        assert!((pack(&request).unwrap().solid_fraction - 0.64).abs() < 1e-12);
    }
}

#[test]
fn an_impossible_fraction_is_an_error_with_both_values() {
    let radii = [1.0; 100];
    let request = Request { solid_fraction: Some(0.7), ..cubic(&radii, 0) };
    let message = pack(&request).unwrap_err().to_string();
    assert!(message.contains("0.7000 was asked for") && message.contains("attained 0.6"), "{message}");

    let alone = Request { solid_fraction: Some(0.6), ..cubic(&radii[..1], 0) };
    let message = pack(&alone).unwrap_err().to_string();
    assert!(message.contains("own image") && message.contains("0.5236"), "{message}");
}

#[test]
fn too_few_moves_are_an_error_with_the_remedy() {
    let message = pack(&Request { max_moves_per_particle: 1.0, ..cubic(&[1.0; 100], 0) }).unwrap_err().to_string();
    assert!(message.contains("1 moves per particle") && message.contains("raise"), "{message}");
}

#[test]
fn wrapping_never_returns_the_side_itself() {
    for (coordinate, expected) in
        [(-1e-20, 0.0), (1.0, 0.0), (0.25, 0.25), (-0.25, 0.75), (7.25, 0.25), (-7.25, 0.75), (2.0, 0.0), (-0.0, 0.0)]
    {
        assert_eq!(wrap(coordinate, 1.0), expected, "{coordinate}");
    }
    let side = 3.0_f64.sqrt();
    for coordinate in [side, -side, 1e9 * side, -1e-17, side * (1.0 - f64::EPSILON / 2.0)] {
        let wrapped = wrap(coordinate, side);
        assert!(wrapped >= 0.0 && wrapped < side, "{coordinate} {wrapped}");
    }
}
