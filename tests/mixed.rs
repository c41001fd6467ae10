//! The packing of two materials, configs/mixed.toml, at smaller size and larger inertia: each pair of
//! materials follows its own law to the end of the run.

mod common;

use common::{Run, history_of, launch, root, scratch, text};
use dem_mpi::output::hdf5_file::Reader;
use std::collections::BTreeMap;
use std::path::Path;

// As in the configuration.
const NMC: (f64, f64) = (142e9, 0.25);
const PVDF: (f64, f64) = (1365.9e6, 0.4314);
const BRANCH: f64 = 404.6e6;
const RELAXATION_TIME: f64 = 728.28e6 / BRANCH;

/// A contact of a snapshot.
struct Contact {
    species: [u32; 2],
    /// √R_eff δ^{3/2}.
    hertzian: f64,
    force: f64,
}

/// Contacts by particles and image.
fn contacts(directory: &Path, number: usize) -> BTreeMap<(u32, u32, Vec<i32>), Contact> {
    let open = |kind: &str| Reader::open(&directory.join(format!("snapshots/{kind}-{number:06}.vtkhdf"))).unwrap();
    let (particles, file) = (open("particles"), open("contacts"));
    let count = particles.rows("VTKHDF/PointData/id").unwrap();
    let species = particles.read::<u32>("VTKHDF/PointData/species", 0, count).unwrap();
    let radius = particles.read::<f64>("VTKHDF/PointData/radius", 0, count).unwrap();
    let count = file.rows("VTKHDF/CellData/low").unwrap();
    let ids = |name: &str| file.read::<u32>(&format!("VTKHDF/CellData/{name}"), 0, count).unwrap();
    let numbers = |name: &str| file.read::<f64>(&format!("VTKHDF/CellData/{name}"), 0, count).unwrap();
    let shifts = file.read::<i32>("VTKHDF/CellData/shift", 0, count).unwrap();
    let (low, high, force, overlap) = (ids("low"), ids("high"), numbers("normal_force"), numbers("overlap"));
    let of = |row: usize| {
        let pair = [low[row] as usize, high[row] as usize];
        let [a, b] = pair.map(|id| radius[id]);
        let hertzian = (a * b / (a + b) * overlap[row]).sqrt() * overlap[row];
        let key = (low[row], high[row], shifts[3 * row..3 * row + 3].to_vec());
        (key, Contact { species: pair.map(|id| species[id]), hertzian, force: force[row] })
    };
    (0..low.len()).map(of).filter(|(_, contact)| contact.hertzian > 0.0).collect()
}

/// Rows of the named columns of a history.
fn columns<const N: usize>(directory: &Path, names: [&str; N]) -> Vec<[f64; N]> {
    let text = String::from_utf8(history_of(directory)).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let places = names.map(|name| header.iter().position(|column| *column == name).unwrap());
    lines.map(|row| places.map(|place| row[place].parse().unwrap())).collect()
}

#[test]
fn maxwell_zener_pairs_relax_where_hertz_pairs_do_not() {
    let directory = scratch("mixed");
    let config = root().join("configs/mixed.toml");
    let extra = [
        "particles=80",
        "material.0.density_scaling=1e11",
        "material.1.density_scaling=1e11",
        "stage.0.strain_rate={z=0.005}",
        "stage.0.until_strain={z=0.005}",
        "stage.1.duration=1",
        "output.snapshots=\"0.5 s\"",
    ];
    let extra: Vec<&str> = extra.iter().flat_map(|setting| ["--set", setting]).collect();
    let output = launch(&Run { config: &config, ranks: 1, threads: 1 }, &directory, &extra);
    assert!(output.status.success(), "{}", text(&output));

    // Compressed in one second, the stress rises; held, it falls, and the branches dissipate.
    let rows = columns(&directory, ["time_s", "stress_zz_Pa", "viscous_J"]);
    let at = |time: f64| *rows.iter().find(|row| row[0] > time - 1e-6).unwrap();
    let stress = [0.25, 0.5, 0.75, 1.0].map(|time| at(time)[1]);
    assert!(stress[0] > 0.0 && stress.windows(2).all(|pair| pair[1] > 1.5 * pair[0]), "{stress:?}");
    let held: Vec<f64> = (1..=10).map(|tenth| at(1.0 + 0.1 * f64::from(tenth))[1]).collect();
    assert!(held.windows(2).all(|pair| pair[1] < pair[0]) && held[9] > 0.9 * stress[3], "{held:?}");
    assert!(at(2.0)[2] > at(1.1)[2], "{:?}", at(2.0));

    // Half a second within the hold.
    let (before, after) = (contacts(&directory, 3), contacts(&directory, 4));
    let reduced = |(modulus, ratio): (f64, f64)| (1.0 - ratio * ratio) / modulus;
    let long_term = 2.0 / 3.0 / reduced(PVDF);
    let of_branch = long_term * BRANCH / PVDF.0;
    let x = 0.5 / RELAXATION_TIME;
    // The weakest contacts still swing a little, and feel their dashpots.
    let swing = 1e-3 * after.values().map(|contact| contact.force).sum::<f64>() / after.len() as f64;
    let mut counts = [0; 3];
    let mut branches = [0.0; 2];
    for (key, now) in &after {
        let Some(earlier) = before.get(key) else { continue };
        let kind = now.species.iter().sum::<u32>() as usize;
        counts[kind] += 1;
        if kind == 2 {
            // The overlaps still change a little, evenly enough for the closed form of δ^{3/2} linear in time.
            let [old, new] = [earlier, now].map(|contact| contact.force - long_term * contact.hertzian);
            let grown = of_branch * (now.hertzian - earlier.hertzian);
            let expected = old * libm::exp(-x) + grown * -libm::expm1(-x) / x;
            assert!((new - expected).abs() < 1e-3 * now.force + swing, "{key:?}: {new:e} {expected:e} {:e}", now.force);
            branches = [branches[0] + old, branches[1] + new];
        } else {
            let modulus = 4.0 / 3.0 / (reduced(NMC) + if kind == 0 { reduced(NMC) } else { reduced(PVDF) });
            for contact in [earlier, now] {
                let hertz = modulus * contact.hertzian;
                assert!((contact.force - hertz).abs() < 1e-3 * hertz + swing, "{key:?}: {:e} {hertz:e}", contact.force);
            }
        }
    }
    let left = branches[1] / branches[0];
    assert!((left / libm::exp(-x) - 1.0).abs() < 0.05, "{left} of the branches' forces is left");
    assert!(counts.iter().all(|count| *count >= 10), "{counts:?} contacts of NMC, of both, of PVDF");
}
