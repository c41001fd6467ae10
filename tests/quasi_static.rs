//! The quasi-static routine: its equilibria against closed forms, its independence of numerical settings, the same
//! bits over ranks, threads and restarts, and what it says when it fails.

mod common;

use common::{Run, data, digest_of, history_of, launch, root, scratch, text};
use dem_mpi::output::history::{self, HistoryRow};
use std::path::{Path, PathBuf};
use std::process::Output;

const RADIUS: f64 = 1e-3;
/// Hard and soft: Young's modulus \[Pa\] and Poisson's ratio.
const HARD: (f64, f64) = (70e9, 0.25);
const SOFT: (f64, f64) = (2e9, 0.4);

/// An input with materials, a column of touching spheres in a cell as wide as they are, and this end.
fn column(folder: &Path, materials: &[&str], end: &str) -> PathBuf {
    let mut table = "species,x_m,y_m,z_m,radius_m\n".to_owned();
    for (index, name) in materials.iter().enumerate() {
        let z = RADIUS * (2.0 * index as f64 + 0.5);
        table += &format!("{name},{RADIUS:e},{RADIUS:e},{z:e},{RADIUS:e}\n");
    }
    std::fs::write(folder.join("column.csv"), table).unwrap();
    let height = 2.0 * RADIUS * materials.len() as f64;
    // Wider than the spheres, so that they touch along z only.
    let mut input = format!("[cell]\nsides = [{:e}, {:e}, {height:e}]\n", 3.0 * RADIUS, 3.0 * RADIUS);
    for (name, (young, poisson)) in [("hard", HARD), ("soft", SOFT)] {
        input += &format!(
            "[[material]]\nname = \"{name}\"\ndensity = 2500\nyoung_modulus = {young:e}\npoisson_ratio = {poisson}\n\
             restitution = 0.5\n\
             [[species]]\nname = \"{name}\"\nmaterial = \"{name}\"\nradius = {RADIUS:e}\n"
        );
    }
    input += &format!(
        "[contact.normal.hertz]\n[packing.file]\npath = \"column.csv\"\n[output]\nplots = false\n\
         history = \"1 increments\"\n[load]\nroutine = \"quasi_static\"\n{end}\n"
    );
    let path = folder.join("column.toml");
    std::fs::write(&path, input).unwrap();
    path
}

fn go(config: &Path, folder: &Path, extra: &[&str]) -> Output {
    launch(&Run { config, ranks: 1, threads: 1 }, folder, extra)
}

fn rows(config: &Path, folder: &Path, extra: &[&str]) -> Vec<HistoryRow> {
    let output = go(config, folder, extra);
    assert!(output.status.success(), "{}", text(&output));
    history::read(folder).unwrap()
}

/// 4/3 E_eff √R_eff of two of these spheres.
fn hertz(a: (f64, f64), b: (f64, f64)) -> f64 {
    let compliance = |(young, poisson): (f64, f64)| (1.0 - poisson * poisson) / young;
    4.0 / 3.0 / (compliance(a) + compliance(b)) * (0.5 * RADIUS).sqrt()
}

/// Force in a column of spheres with these contact coefficients that is shortened by `way`.
fn column_force(coefficients: &[f64], way: f64) -> f64 {
    let compliance: f64 = coefficients.iter().map(|c| libm::pow(*c, -2.0 / 3.0)).sum();
    libm::pow(way / compliance, 1.5)
}

/// Force in the column, from the stress on its cross-section.
fn force(row: &HistoryRow) -> f64 {
    row.stress[2] * 9.0 * RADIUS * RADIUS
}

#[test]
fn a_column_of_unequal_contacts_carries_one_force_in_each() {
    let contacts = [hertz(HARD, HARD), hertz(HARD, SOFT), hertz(SOFT, SOFT), hertz(SOFT, HARD)];
    for kinematics in ["BCT", "BC"] {
        let folder = scratch(kinematics);
        let stage = "[[stage]]\nstrain_increment = { z = 3e-4 }\nuntil_strain = { z = 0.005 }";
        let config = column(&folder, &["hard", "hard", "soft", "soft"], stage);
        let kinematics = format!("load.kinematics={kinematics}");
        let rows = rows(&config, &folder, &["--set", &kinematics]);
        // 16 whole increments and a part of one.
        assert_eq!(rows.len(), 18);
        assert_eq!((rows[17].increment, rows[17].strain[2]), (17, 0.005));
        for row in &rows[1..] {
            let exact = column_force(&contacts, row.strain[2] * 8.0 * RADIUS);
            let error = (force(row) / exact - 1.0).abs();
            assert!(error < 1e-3, "{kinematics}, strain {}: {:e} instead of {exact:e}", row.strain[2], force(row));
            assert_eq!(row.time, 0.0);
        }
    }
}

#[test]
fn unloading_returns_along_the_same_forces_and_ends_without_any() {
    let folder = scratch("cycle");
    let stages = "[[stage]]\ncycles = 2\n\
                  [[stage.part]]\nstrain_increment = { z = 1e-3 }\nincrements = 4\n\
                  [[stage.part]]\nstrain_increment = { z = -1e-3 }\nincrements = 5";
    let config = column(&folder, &["hard", "soft"], stages);
    let rows = rows(&config, &folder, &[]);
    let contacts = [hertz(HARD, SOFT); 2];
    assert_eq!(rows.len(), 19);
    for row in &rows {
        let way = row.strain[2].max(0.0) * 4.0 * RADIUS;
        let (exact, largest) = (column_force(&contacts, way), column_force(&contacts, 4e-3 * 4.0 * RADIUS));
        assert!((force(row) - exact).abs() < 1e-3 * largest, "{}: {:e}, {exact:e}", row.strain[2], force(row));
    }
}

#[test]
fn a_stress_ends_a_stage_at_the_first_equilibrium_beyond_it() {
    let folder = scratch("stress");
    let stages = "[[stage]]\nstrain_increment = { z = 1e-3 }\nuntil_stress = { z = \"5 MPa\" }";
    let config = column(&folder, &["hard", "soft"], stages);
    let rows = rows(&config, &folder, &[]);
    let [.., before, last] = &rows[..] else { panic!("{} rows", rows.len()) };
    assert!(before.stress[2] < 5e6 && last.stress[2] >= 5e6, "{} {}", before.stress[2], last.stress[2]);
}

#[test]
fn a_stress_is_awaited_from_the_side_on_which_its_stage_begins() {
    // The first stage begins with stress, as the cell is shorter than the column.
    let pressed = format!("cell.sides=[{:e}, {:e}, {:e}]", 3.0 * RADIUS, 3.0 * RADIUS, 4.0 * RADIUS * 0.995);
    for (kind, towards, ends) in [
        ("strain_increment = { z = -1e-4 }", "0.1 MPa", "below"),
        ("strain_increment = { z = 1e-4 }", "0.1 MPa", "at once"),
        ("strain_rate = { z = -100 }", "0.1 MPa", "below"),
        ("strain_rate = { z = 100 }", "0.1 MPa", "at once"),
    ] {
        let folder = scratch("side");
        let routine = if kind.contains("rate") { "routine = \"dynamic\"\n" } else { "" };
        let config = column(
            &folder,
            &["hard", "soft"],
            &format!("[[stage]]\n{routine}{kind}\nuntil_stress = {{ z = \"{towards}\" }}"),
        );
        let history = if routine.is_empty() { "output.history=1 increments" } else { "output.history=10 steps" };
        let extra = ["--set", &pressed, "--set", "load.control_interval=1", "--set", history];
        let output = go(&config, &folder, &extra);
        assert!(output.status.success(), "{kind}: {}", text(&output));
        let rows = history::read(&folder).unwrap();
        let [first, .., last] = &rows[..] else { panic!("{kind}: {} rows", rows.len()) };
        assert!(first.stress[2] > 2e5, "{kind}: {}", first.stress[2]);
        if ends == "below" {
            assert!(last.stress[2] <= 1e5 && last.step > 5, "{kind}: {} at {}", last.stress[2], last.step);
        } else {
            assert!(text(&output).contains("ended at once: its end was passed before"), "{kind}: {}", text(&output));
        }
    }
}

#[test]
fn viscoelastic_contacts_answer_with_their_long_term_modulus() {
    let stage = "[[stage]]\nstrain_increment = { z = 1e-3 }\nuntil_strain = { z = 0.01 }";
    let [elastic, viscoelastic] = [false, true].map(|branches| {
        let folder = scratch(if branches { "viscoelastic" } else { "elastic" });
        let config = column(&folder, &["soft", "soft"], stage);
        let law = ["--set", "contact.normal=\"maxwell_zener\"", "--set", "species.0.material=soft"];
        let branch = ["--set", "material.1.maxwell=[{ modulus = \"3 GPa\", relaxation_time = \"1 s\" }]"];
        let extra: Vec<&str> = if branches { law.into_iter().chain(branch).collect() } else { Vec::new() };
        rows(&config, &folder, &extra)
    });
    assert_eq!(elastic.len(), viscoelastic.len());
    for (a, b) in elastic.iter().zip(&viscoelastic).skip(1) {
        assert!((a.stress[2] / b.stress[2] - 1.0).abs() < 1e-3, "{} {}", a.stress[2], b.stress[2]);
    }
}

#[test]
fn a_packing_that_just_touches_is_in_equilibrium_at_once() {
    let folder = scratch("touching");
    let config = column(&folder, &["hard", "soft"], "[[stage]]\nrelax = true");
    let rows = rows(&config, &folder, &["--set", "load.quasi_static.substeps=7"]);
    assert_eq!(rows.iter().map(|row| row.step).collect::<Vec<_>>(), [0, 7]);
    assert_eq!(force(&rows[1]), 0.0);
}

#[test]
fn rattlers_do_not_keep_an_increment_from_its_equilibrium() {
    // Far below jamming every particle is a rattler in the end; contact dashpots alone would never stop them.
    let config = data("quasi_static.toml");
    for damping in ["fire", "contact", "viscous"] {
        let folder = scratch(damping);
        let damping = format!("load.quasi_static.damping={damping}");
        let extra = ["--set", &damping, "--set", "cell.solid_fraction=0.5", "--set", "stage.1.until_strain={z=0.1}"];
        let increment = ["--set", "stage.1.strain_increment={z=5e-3}", "--set", "species.0.velocity=[0, 0, \"1 m/s\"]"];
        let rows = rows(&config, &folder, &[&extra[..], &increment].concat());
        assert_eq!(rows.last().unwrap().increment, 21, "{damping}");
        assert!(rows.iter().any(|row| row.rattlers == 120 && row.contacts > 0), "{damping}");
    }
}

#[test]
fn stress_depends_neither_on_the_substeps_of_a_block_nor_on_the_pseudo_time_step() {
    let config = root().join("configs/quasi_static.toml");
    let stress = |set: &str| {
        let extra = ["--set", "stage.0.until_strain={z=0.003}", "--set", "output.plots=false", "--set", set];
        let rows = rows(&config, &scratch("independent"), &extra);
        [10, 20, 30].map(|increment| rows[increment].stress[2])
    };
    let reference = stress("load.quasi_static.substeps=50");
    for set in ["substeps=15", "substeps=150", "safety=0.15", "safety=0.4"] {
        let other = stress(&format!("load.quasi_static.{set}"));
        for (a, b) in reference.iter().zip(other) {
            assert!((b / a - 1.0).abs() < 0.01, "{set}: {b:e} instead of {a:e} Pa");
        }
    }
}

#[test]
fn among_unequal_spheres_stress_does_not_depend_on_dashpots_and_pseudo_time_step_either() {
    // The jump of an increment, taken for a motion in time, lets the dashpots of the large ones pull: −5 %.
    let config = data("quasi_static_sizes.toml");
    let stress = |set: &str| {
        let rows = rows(&config, &scratch("sizes"), &["--set", &format!("load.quasi_static.{set}")]);
        rows.last().unwrap().stress[2]
    };
    let reference = stress("substeps=50");
    for set in ["restitution=0.2", "safety=0.1"] {
        let other = stress(set);
        assert!((other / reference - 1.0).abs() < 3e-3, "{set}: {other:e} instead of {reference:e} Pa");
    }
}

#[test]
fn strong_dashpots_shorten_the_pseudo_time_step_and_do_not_keep_a_packing_in_motion() {
    let config = root().join("configs/quasi_static.toml");
    let extra = ["--set", "stage.0.until_strain={z=0.0005}", "--set", "load.quasi_static.restitution=0.2"];
    let rows = rows(&config, &scratch("strong"), &[&extra[..], &["--set", "output.plots=false"]].concat());
    assert_eq!(rows.last().unwrap().increment, 5);
}

#[test]
fn a_few_stiff_particles_do_not_let_a_soft_packing_pass_for_settled() {
    // Measured against touching contacts of the stiff ones, its forces would seem to balance: +47 % of stress.
    let rows = rows(&data("quasi_static_soft.toml"), &scratch("soft"), &[]);
    let last = rows.last().unwrap();
    assert!(last.coordination > 4.5 && last.unbalanced_ratio < 1e-3, "{last:?}");
}

#[test]
fn a_sphere_that_falls_is_not_in_equilibrium_until_the_floor_carries_its_weight() {
    let folder = scratch("falling");
    let centre = 1.001 * RADIUS;
    let table = format!("species,x_m,y_m,z_m,radius_m\nhard,{RADIUS:e},{RADIUS:e},{centre:e},{RADIUS:e}\n");
    let config = column(&folder, &["hard"], "[[stage]]\nrelax = true");
    std::fs::write(folder.join("column.csv"), table).unwrap();
    let fall = ["--set", "gravity=[0, 0, -9.81]", "--set", "cell={sides=[3e-3, 3e-3, 4e-3], boundary={z=\"walls\"}}"];
    let floor = ["--set", "cell.wall_material=hard"];
    let settled = rows(&config, &folder, &[&fall[..], &floor].concat());
    let weight = 2500.0 * 4.0 / 3.0 * std::f64::consts::PI * RADIUS * RADIUS * RADIUS * 9.81;
    let carried = settled.last().unwrap().stress[2] * 3.0 * 3.0 * 4.0 * RADIUS * RADIUS;
    assert!((carried / weight - 1.0).abs() < 2e-3, "{carried:e} instead of {weight:e} N");
    let few = ["--set", "load.quasi_static.max_blocks=2"];
    let output = go(&config, &folder, &[&fall[..], &floor, &few].concat());
    assert!(!output.status.success() && text(&output).contains("settle in a dynamic stage"), "{}", text(&output));
}

#[test]
fn same_bits_over_ranks_threads_skins_and_restarts() {
    let config = data("quasi_static.toml");
    let outcome = |name: &str, ranks: usize, threads: usize, extra: &[&str]| {
        let folder = scratch(name);
        let output = launch(&Run { config: &config, ranks, threads }, &folder, extra);
        assert!(output.status.success(), "{}", text(&output));
        (digest_of(&output), history_of(&folder))
    };
    let reference = outcome("reference", 1, 1, &[]);
    for (ranks, threads, skin) in [(1, 2, "0.05"), (2, 1, "0.2"), (3, 2, "0.1"), (4, 1, "0.05")] {
        let skin = format!("parallel.skin={skin}");
        assert_eq!(outcome("layout", ranks, threads, &["--set", &skin]), reference, "{ranks} × {threads}, {skin}");
    }
    let folder = scratch("restarted");
    assert!(launch(&Run { config: &config, ranks: 2, threads: 1 }, &folder, &[]).status.success());
    // In the middle of a block, of an increment, and at the end of a block.
    for (step, ranks) in [(700, 1), (2100, 3), (2800, 2)] {
        let again = scratch("again");
        let checkpoint = folder.join(format!("checkpoint-{step:012}.h5"));
        let restart = ["--restart", checkpoint.to_str().unwrap()];
        let output = launch(&Run { config: &config, ranks, threads: 1 }, &again, &restart);
        assert!(output.status.success(), "{}", text(&output));
        assert_eq!((digest_of(&output), history_of(&again)), reference, "step {step} on {ranks} ranks");
    }
}

#[test]
fn without_equilibrium_the_run_stops_and_names_residual_increment_threshold_and_remedy() {
    let config = data("quasi_static.toml");
    let tight = ["--set", "load.quasi_static.max_blocks=3", "--set", "load.quasi_static.max_unbalanced_ratio=1e-15"];
    for ranks in [1, 2] {
        let output = launch(&Run { config: &config, ranks, threads: 1 }, &scratch("tight"), &tight);
        assert_eq!(output.status.code(), Some(1), "{}", text(&output));
        let said = text(&output);
        for part in [
            "increment 2 (strain [-0.000100, 0.000000, 0.000200]) has not reached equilibrium in 3 blocks of 40 substeps",
            "mean unbalanced force over mean contact force is ",
            "above max_unbalanced_ratio = 1e-15",
            "raise load.quasi_static.max_blocks",
        ] {
            assert!(said.contains(part), "{part} in {said}");
        }
    }
}
