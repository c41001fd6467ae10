//! Claims about the sheet.

use super::*;
use std::path::Path;

fn config(file: &str, overrides: &[&str]) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(file);
    let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    super::super::load(&path, &overrides, None, None).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_time_step_of_two_spheres_at_two_percent_is_that_of_the_tangent_stiffness() {
    let config = config("two_spheres.toml", &[]);
    let estimate = Estimate::new(&config);
    let overlap = estimate.largest_overlap(&config).0;
    assert!((overlap - 0.04).abs() < 1e-12);
    let step = automatic_step(&config, 0.17, |_| overlap).unwrap().time;
    assert!((step - 1.3e-4).abs() < 0.05e-4, "{step}");
}

#[test]
fn inertia_and_an_overlap_out_of_bounds_are_warned_of() {
    let calm = sheet(&config("quickstart.toml", &[]));
    assert!(!calm.contains("warning"), "{calm}");
    let fast = sheet(&config("quickstart.toml", &["stage.0.strain_rate={z=0.2}", "time_step=\"1 s\""]));
    for part in ["lower density_scaling", "contact.max_overlap_fraction", "larger than the automatic one", "unstable"] {
        assert!(fast.contains(part), "{fast}");
    }
}

#[test]
fn steps_are_counted_as_far_as_they_are_known() {
    let steps = |overrides: &[&str]| {
        let sheet = sheet(&config("two_spheres.toml", overrides));
        let line = sheet.lines().find(|line| line.trim_start().starts_with("steps ")).unwrap().to_owned();
        line.split_whitespace().skip(1).collect::<Vec<_>>().join(" ")
    };
    assert_eq!(steps(&["stage=[{hold=true, steps=3000}, {hold=true, steps=500}]"]), "3.50e3");
    // 0.001 strain in steps of at most 1e-5.
    assert_eq!(steps(&["stage=[{strain_rate={z=1e6}, until_strain={z=0.001}}]"]), "1.00e2 to 1.00e2");
}

#[test]
fn a_stiff_pair_is_not_given_the_overlap_of_a_soft_one() {
    // The binder is a hundred times softer than the active material, and stress alone presses them.
    let stage = "stage=[{stress={z={target=1e5, max_rate=0.1}}, duration=1}]";
    let config = config("mixed.toml", &[stage]);
    let estimate = Estimate::new(&config);
    let overlaps: Vec<f64> = Meeting::all(&config).map(|meeting| estimate.overlap_of(&meeting).0).collect();
    assert!(overlaps[0] < 0.1 * overlaps[2], "{overlaps:?}");
    let limit = automatic_step(&config, 0.17, |meeting| estimate.overlap_of(meeting).0).unwrap();
    assert!(limit.overlap < estimate.largest_overlap(&config).0, "{}", limit.overlap);
}

#[test]
fn the_memory_of_few_particles_is_that_of_the_program() {
    let sheet = sheet(&config("quickstart.toml", &[]));
    assert!(sheet.contains("25.0 MB for each rank and 0.1 MB for all particles"), "{sheet}");
}

#[test]
fn constants_that_no_law_reads_are_warned_of() {
    let idle = |overrides: &[&str]| super::super::idle::warnings(&config("quickstart.toml", overrides));
    assert!(idle(&[]).is_empty(), "{:?}", idle(&[]));
    let all = ["contact.normal=hertz", "material.0.surface_energy=0.1", "material.0.yield_stress=1e6"];
    let warnings = idle(&all);
    for (warning, start) in warnings.iter().zip(["maxwell of", "yield_stress of", "surface_energy of"]) {
        assert!(warning.starts_with(start) && warning.contains("has no effect"), "{warnings:?}");
    }
    assert_eq!(warnings.len(), 3, "{warnings:?}");
    assert!(warnings[0].contains("(maxwell_zener)") && warnings[2].contains("(thornton_ning)"), "{warnings:?}");
    assert_eq!(sheet(&config("quickstart.toml", &all)).matches("warning: ").count(), 3);
}
