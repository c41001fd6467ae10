//! Every file in `configs/` is a valid input, and its resolved text gives the same run.

use dem_mpi::config::{Config, load};
use std::path::{Path, PathBuf};

fn files() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let entries = [folder.clone(), folder.join("wahn2022")].map(|folder| std::fs::read_dir(folder).unwrap());
    let paths = entries.into_iter().flatten().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = paths.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    files
}

#[test]
fn every_configuration_loads_and_its_resolved_text_reruns_the_same() {
    let mut failures = String::new();
    for file in files() {
        match load(&file, &[], None, None) {
            Ok(config) => {
                let again = Config::parse(&config.resolved, &file, &[], None, None);
                let again = again.unwrap_or_else(|error| panic!("{}:\n{error}\n{}", file.display(), config.resolved));
                assert_eq!(format!("{config:?}"), format!("{again:?}"), "{}", file.display());
                let sheet = dem_mpi::config::sheet::sheet(&config);
                assert!(!sheet.contains("NaN") && !sheet.contains("inf"), "{sheet}");
                println!("{sheet}");
            }
            Err(error) => failures.push_str(&format!("{error}\n")),
        }
    }
    assert!(failures.is_empty(), "{failures}");
}

#[test]
fn the_command_line_outdoes_the_file() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/quickstart.toml");
    let overrides = ["stage.0.duration=2 s", "species.0.count = 10", "time_step.fixed=1e-6", "parallel.grid=[2,1,1]"];
    let config = load(&file, &overrides.map(str::to_owned), Some(Path::new("elsewhere")), Some(3)).unwrap();
    assert_eq!(config.stages[0].duration, Some(2.0));
    assert_eq!(config.species[0].count, 10);
    assert_eq!(config.time_step, dem_mpi::config::TimeStepConfig::Fixed(1e-6));
    assert_eq!(config.parallel.grid, Some([2, 1, 1]));
    assert_eq!(config.output.directory, Path::new("elsewhere"));
    assert_eq!(config.parallel.threads, Some(3));
}
