//! The automatic time step follows the contacts as they stiffen, W (2.8).

mod common;

use common::{Run, launch, root, scratch, text};
use dem_mpi::config::load;
use dem_mpi::output::history;

#[test]
fn the_automatic_time_step_shrinks_with_the_stiffness_of_the_deepest_contact() {
    let config = root().join("configs/two_spheres.toml");
    let folder = scratch("stiffening");
    // A row per control step, so that each shows the step chosen at its overlap.
    let extra = ["--set", "output.history=50 steps", "--set", "output.plots=false", "--set", "stage.1.duration=1 ms"];
    let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &folder, &extra);
    assert!(output.status.success(), "{}", text(&output));
    let input = load(&config, &[], None, None).unwrap();
    let material = &input.materials[0];
    let modulus = material.young_modulus + material.maxwell.iter().map(|branch| branch.modulus).sum::<f64>();
    let effective = 0.5 * modulus / (1.0 - material.poisson_ratio * material.poisson_ratio);
    let radius = input.species[0].radius.max();
    let volume = 4.0 / 3.0 * std::f64::consts::PI * radius * radius * radius;
    let mass = volume * material.density * material.density_scaling;
    let rows = history::read(&folder).unwrap();
    // Below the reference overlap of 1e-3 R the floor holds.
    let stiffening: Vec<_> =
        rows.iter().filter(|row| row.step.is_multiple_of(50) && row.max_overlap_ratio > 1e-3).collect();
    assert!(stiffening.len() > 20, "{}", stiffening.len());
    for row in &stiffening {
        let stiffness = 2.0 * effective * (0.5 * radius * row.max_overlap_ratio * radius).sqrt();
        let expected = 0.17 * (mass / stiffness).sqrt();
        assert!((row.time_step / expected - 1.0).abs() < 1e-9, "step {}: {:e}, {expected:e}", row.step, row.time_step);
    }
    let [first, .., last] = &stiffening[..] else { unreachable!("more than twenty") };
    assert!(last.time_step < 0.6 * first.time_step, "{:e} after {:e}", last.time_step, first.time_step);
}

#[test]
fn a_packing_with_friction_and_low_restitution_comes_to_rest() {
    // With a time step that looked at stiffness alone its dashpots drove it: unbalanced ratio 0.28, for ever.
    let directory = scratch("rest");
    let config = directory.join("rest.toml");
    let input = "[[material]]\nname = \"m\"\ndensity = \"1800 kg/m3\"\ndensity_scaling = 1e8\nyoung_modulus = \"1.4 GPa\"\n\
                 poisson_ratio = 0.43\nrestitution = 0.3\nfriction = 0.5\n[[species]]\nname = \"s\"\nmaterial = \"m\"\n\
                 radius = \"0.25 um\"\ncount = 100\n[contact.normal.hertz]\n[contact.tangential.mindlin]\n\
                 [[stage]]\nstrain_rate = \"0.02 1/s\"\nduration = \"0.1 s\"\n[[stage]]\nhold = true\nduration = \"0.06 s\"\n\
                 [output]\nhistory = \"1000 steps\"\nplots = false\n";
    std::fs::write(&config, input).expect("the build folder can be written");
    let run_directory = directory.join("run");
    let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &run_directory, &[]);
    assert!(output.status.success(), "{}", text(&output));
    let rows = history::read(&run_directory).expect("a history");
    let rest = rows[rows.len() - 2];
    assert!(rest.mean_stress() > 0.0 && rest.unbalanced_ratio < 1e-6, "{}", rest.unbalanced_ratio);
}

#[test]
fn a_fixed_time_step_that_strains_the_cell_too_far_is_shortened_and_said_so() {
    let config = root().join("configs/quickstart.toml");
    let extra = ["--set", "time_step=1e-6", "--set", "output.plots=false", "--set"];
    for (rate, expected) in [("100", 1e-7), ("1", 1e-6)] {
        let stage = format!("stage=[{{strain_rate={{z={rate}}}, steps=5}}]");
        let folder = scratch("shortened");
        let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &folder, &[&extra[..], &[&stage]].concat());
        assert!(output.status.success(), "{}", text(&output));
        let said = text(&output).contains("1.000e-7 s instead of the fixed 1.000e-6 s");
        assert_eq!(said, expected < 1e-6, "{}", text(&output));
        let row = history::read(&folder).unwrap()[0];
        assert!((row.time_step / expected - 1.0).abs() < 1e-12, "{:e}", row.time_step);
    }
}
