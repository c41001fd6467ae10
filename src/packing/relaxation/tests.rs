use super::*;
use crate::packing::ellipsoids::{Body, worst_overlap};

fn packed(count: usize, proportions: [f64; 3], fraction: Option<f64>, seed: u64) -> (Packed, f64) {
    let semi_axes = vec![proportions.map(|axis| 2e-6 * axis); count];
    let orientations: Vec<_> =
        (0..count as u64).map(|id| Draws::new(seed, Purpose::Orientation, id).rotation()).collect();
    let request = Request {
        semi_axes: &semi_axes,
        orientations: &orientations,
        aspect: [1.0, 1.0, 1.5],
        solid_fraction: fraction,
        seed,
        tolerance: 0.03,
        max_steps: 20_000,
    };
    let packed = pack(&request).expect("it packs");
    let bodies: Vec<Body> =
        (0..count).map(|id| Body::new(packed.positions[id], semi_axes[id], packed.orientations[id])).collect();
    let worst = worst_overlap(&bodies, packed.sides);
    assert!(worst.is_none_or(|worst| worst.fraction < 1e-9), "{worst:?}");
    let inside = |x: &[f64; 3]| (0..3).all(|k| (0.0..packed.sides[k]).contains(&x[k]));
    assert!(packed.positions.iter().all(inside));
    let solid = count as f64 * ellipsoid_volume(semi_axes[0]) / (packed.sides[0] * packed.sides[1] * packed.sides[2]);
    (packed, solid)
}

#[test]
fn mildly_aspherical_ellipsoids_pack_denser_than_spheres() {
    // Donev et al. 2004: 0.64 for spheres, up to 0.735 for 1.25 : 1 : 0.8; between them prolate ones.
    let fraction = |axes| packed(150, axes, None, 5).1;
    let [spheres, slight, prolate, triaxial] =
        [[1.0; 3], [1.05, 1.0, 0.95], [1.5, 1.0, 1.0], [1.25, 1.0, 0.8]].map(fraction);
    assert!((0.625..0.65).contains(&spheres), "{spheres}");
    assert!((0.64..0.69).contains(&slight), "{slight}");
    assert!((0.69..0.72).contains(&prolate), "{prolate}");
    assert!((0.715..0.74).contains(&triaxial), "{triaxial}");
    assert!(spheres < slight && slight < prolate && prolate < triaxial);
}

#[test]
fn a_looser_packing_has_the_solid_fraction_asked_for() {
    let (_, solid) = packed(150, [1.5, 1.0, 0.7], Some(0.6), 2);
    assert!((solid - 0.6).abs() < 1e-12, "{solid}");
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_one_another_packing() {
    let of = |seed| packed(60, [1.3, 1.0, 0.9], None, seed).0;
    assert_eq!(of(7), of(7));
    assert_ne!(of(7), of(8));
}

#[test]
fn a_fraction_beyond_jamming_is_an_error_that_names_both() {
    let semi_axes = [[1.0; 3]; 40];
    let request = Request {
        semi_axes: &semi_axes,
        orientations: &[[1.0, 0.0, 0.0, 0.0]; 40],
        aspect: [1.0; 3],
        solid_fraction: Some(0.73),
        seed: 1,
        tolerance: 0.1,
        max_steps: 5000,
    };
    let message = pack(&request).unwrap_err().to_string();
    assert!(message.contains("jam at") && message.contains("0.7300"), "{message}");
}
