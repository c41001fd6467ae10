use super::test_input::{config, solid_fraction, species};
use super::*;
use crate::config::RadiusDistribution;

fn equal(count: usize) -> Vec<Species> {
    vec![species("a", count, RadiusDistribution::Fixed(0.25e-6))]
}

#[test]
fn a_random_packing_starts_complete_and_in_id_order() {
    let mut list = equal(40);
    list.push(species("b", 10, RadiusDistribution::Fixed(0.5e-6)));
    list[1].velocity = [1.0, 2.0, 3.0];
    list[1].spin = [4.0, 5.0, 6.0];
    list[0].velocity_deviation = 0.1;
    let packing = build(&config(list)).unwrap();
    assert_eq!(packing.particles.len(), 50);
    for (id, particle) in packing.particles.iter().enumerate() {
        assert_eq!((particle.id as usize, particle.species), (id, u32::from(id >= 40)));
        assert_eq!((particle.orientation, particle.image), ([1.0, 0.0, 0.0, 0.0], [0; 3]));
        assert!((0..3).all(|k| particle.position[k] >= 0.0 && particle.position[k] < packing.sides[k]));
    }
    let last = packing.particles[49];
    assert_eq!((last.velocity, last.spin), ([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]));
    let speeds: Vec<f64> = packing.particles[..40].iter().flat_map(|particle| particle.velocity).collect();
    let variance = speeds.iter().map(|speed| speed * speed).sum::<f64>() / 120.0;
    assert!((0.005..0.02).contains(&variance), "{variance}");
}

#[test]
fn given_sides_and_given_fractions_are_kept() {
    let mut given = config(equal(100));
    given.cell.sides = Some([2e-6, 3e-6, 4e-6]);
    assert_eq!(build(&given).unwrap().sides, [2e-6, 3e-6, 4e-6]);

    let mut given = config(equal(100));
    given.cell.solid_fraction = Some(0.5);
    given.cell.aspect = [1.0, 1.0, 3.0];
    let packing = build(&given).unwrap();
    assert!((solid_fraction(&packing) - 0.5).abs() < 1e-12);
    assert!((packing.sides[2] / packing.sides[0] - 3.0).abs() < 1e-12);
}

#[test]
fn sides_too_small_for_the_particles_are_an_error() {
    let mut given = config(equal(100));
    given.cell.sides = Some([2.1e-6; 3]);
    let message = build(&given).unwrap_err().to_string();
    assert!(message.starts_with("packing: solid fraction 0.7067 was asked for"), "{message}");
}

#[test]
fn no_particles_are_an_error() {
    assert!(build(&config(equal(0))).unwrap_err().to_string().contains("no particles"));
}

#[test]
fn a_file_gives_particles_with_the_motion_of_file_or_species() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.csv");
    std::fs::write(&path, "species,x_um,y_um,z_um,radius_um\na,0.25,0.25,0.25,0.25\na,0.25,0.25,0.75,0.25\n").unwrap();
    let mut given = config(equal(0));
    given.species[0].velocity = [0.0, 0.0, 1.0];
    given.packing = PackingConfig::File { path: path.clone() };
    let message = build(&given).unwrap_err().to_string();
    assert!(message.contains("two.csv") && message.contains("sides"), "{message}");

    given.cell.sides = Some([0.5e-6, 0.5e-6, 1e-6]);
    let packing = build(&given).unwrap();
    assert_eq!(packing.particles[1].position, [0.25e-6, 0.25e-6, 0.75e-6]);
    assert_eq!(packing.particles[1].velocity, [0.0, 0.0, 1.0]);

    given.cell.sides = Some([0.5e-6, 0.5e-6, 0.8e-6]);
    let message = build(&given).unwrap_err().to_string();
    assert!(message.contains("particles 0 and 1 overlap"), "{message}");
}

#[test]
fn a_data_file_brings_its_cell_and_must_have_the_density_of_the_material() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("one.data");
    let text =
        "title\n\n1 atoms\n1 atom types\n\n0 1 xlo xhi\n0 2 ylo yhi\n0 3 zlo zhi\n\nAtoms\n\n1 1 0.5 5000 0 0 0\n";
    std::fs::write(&path, text).unwrap();
    let mut given = config(equal(0));
    given.packing = PackingConfig::File { path };
    for (density, scaling, fits) in [(5000.0, 1e8, true), (50.0, 100.0, true), (1800.0, 1.0, false)] {
        given.materials = vec![crate::config::Material {
            name: "grain".into(),
            density,
            density_scaling: scaling,
            young_modulus: 1.0,
            poisson_ratio: 0.25,
            maxwell: Vec::new(),
            yield_stress: None,
            friction: 0.0,
            restitution: 1.0,
            rolling_friction: 0.0,
            twisting_friction: 0.0,
            surface_energy: 0.0,
        }];
        match build(&given) {
            Ok(packing) => assert!(fits && packing.sides == [1.0, 2.0, 3.0]),
            Err(error) => {
                let message = error.to_string();
                assert!(!fits && message.contains("density 5000") && message.contains("1800"), "{message}");
            }
        }
    }
}
