//! Driven particles move as prescribed, fixed ones not at all, and free ones feel both.

mod common;

use common::{Run, launch, scratch, text};
use dem_mpi::exchange::Communicator;
use dem_mpi::output::checkpoint;
use std::fs;

const INPUT: &str = r#"
[cell]
sides = "1 m"
[[material]]
name = "glass"
density = 2500
young_modulus = "20 MPa"
poisson_ratio = 0.25
restitution = 0.6
[[species]]
name = "fixed"
material = "glass"
radius = "10 mm"
motion.fixed = {}
[[species]]
name = "piston"
material = "glass"
radius = "10 mm"
motion.driven = { velocity = ["-0.5 m/s", 0, 0] }
[[species]]
name = "free"
material = "glass"
radius = "10 mm"
[contact.normal.hertz]
[packing.file]
path = "three.csv"
[[stage]]
strain_rate = 0
duration = "5 ms"
[output]
history = "10 ms"
plots = false
"#;

#[test]
fn a_piston_pushes_a_free_grain_against_a_fixed_one() {
    let folder = scratch("input");
    let rows =
        "species,x_m,y_m,z_m,radius_m\nfixed,0.5,0.5,0.5,0.01\nfree,0.5205,0.5,0.5,0.01\npiston,0.541,0.5,0.5,0.01\n";
    fs::write(folder.join("three.csv"), rows).expect("the build folder can be written");
    let config = folder.join("three.toml");
    fs::write(&config, INPUT).expect("the build folder can be written");
    let directory = scratch("run");
    let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &directory, &[]);
    assert!(output.status.success(), "{}", text(&output));
    let comm = Communicator::single();
    let latest = checkpoint::latest(&comm, &directory, None).expect("the run leaves a checkpoint");
    let state = checkpoint::read(&comm, &latest.path).expect("the checkpoint is valid");
    let x: Vec<f64> = state.particles.iter().map(|particle| particle.position[0]).collect();
    assert_eq!(x[0], 0.5, "the fixed grain stays");
    assert!((x[2] - 0.5385).abs() < 1e-9, "the piston is at {}", x[2]);
    assert!(x[1] < 0.5205 && x[1] > 0.51, "the free grain is at {}", x[1]);
}
