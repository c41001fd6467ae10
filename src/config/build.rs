//! From text to the checked [`Config`]: the order in which the input is read.

use super::diagnostic::{Problem, Source, render};
use super::section::{Reader, Section};
use super::{Config, Velocities, contact, document, keys, particles, routine, settings, stages};
use crate::error::{Error, Result};
use std::path::Path;

/// Read and check the input file at `path`.
///
/// `overrides` are `key=value` texts from `--set`, with dotted keys and list entries by number
/// (`stage.0.duration=2 s`); `output` and `threads` come from the command line and outdo the file.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read, or with every problem found in it.
pub fn load(path: &Path, overrides: &[String], output: Option<&Path>, threads: Option<usize>) -> Result<Config> {
    let refused = |message: String| Error::Input(format!("{}: {message}", path.display()));
    if path.is_dir() {
        return Err(refused("is a folder, not an input file; name the .toml file in it".to_owned()));
    }
    let bytes = std::fs::read(path).map_err(|error| {
        // Without an ending it may have been meant for a command.
        let commands = if path.extension().is_none() { "; `dem-mpi --help` lists the commands" } else { "" };
        let remedy = format!("check the path, or make one with `dem-mpi init`{commands}");
        refused(format!("the input cannot be read ({error}); {remedy}"))
    })?;
    let text = String::from_utf8(bytes).map_err(|error| {
        let line = error.as_bytes()[..error.utf8_error().valid_up_to()].split(|byte| *byte == b'\n').count();
        refused(format!("line {line} is not UTF-8 text; save the file with that encoding, or name the input file"))
    })?;
    Config::parse(&text, path, overrides, output, threads)
}

impl Config {
    /// Read and check an input text; `file` names it in messages, in the title and in the default run
    /// directory, and paths in the text are relative to its folder. The rest is as for [`load`].
    ///
    /// # Errors
    /// [`Error::Input`] with every problem found.
    pub fn parse(
        text: &str,
        file: &Path,
        overrides: &[String],
        output: Option<&Path>,
        threads: Option<usize>,
    ) -> Result<Self> {
        let mut sources = vec![Source { name: file.display().to_string(), text: text.to_owned() }];
        let mut problems = Vec::new();
        let mut root = document::parse(text, &mut problems);
        if !problems.is_empty() {
            return Err(Error::Input(render(&sources, problems)));
        }
        for argument in overrides {
            document::set(&mut root, &mut sources, argument, &mut problems);
        }
        // What cannot be read has no value to check.
        if !problems.is_empty() {
            return Err(Error::Input(render(&sources, problems)));
        }
        if let Some(directory) = output {
            let value = document::Value::Text(directory.to_string_lossy().into_owned());
            document::put(&mut root, &mut sources, "command line, --output", "output.directory", value, &mut problems);
        }
        if let Some(count) = threads {
            let value = document::Value::Integer(i64::try_from(count).unwrap_or(i64::MAX));
            document::put(&mut root, &mut sources, "command line, --threads", "parallel.threads", value, &mut problems);
        }
        let reader = Reader::default();
        let config = read(&Section::root(&reader, &root, &keys::ROOT), file);
        problems.extend(reader.problems.into_inner());
        match config {
            Some(config) if problems.is_empty() => Ok(Self { resolved: reader.resolved.into_inner().text(), ..config }),
            _ => Err(Error::Input(render(&sources, checked(problems)))),
        }
    }
}

/// A reader that gives up must have said why.
fn checked(problems: Vec<Problem>) -> Vec<Problem> {
    debug_assert!(!problems.is_empty(), "the input was refused without a reason");
    problems
}

fn read(root: &Section, file: &Path) -> Option<Config> {
    let stem = file.file_stem().map_or_else(|| "run".to_owned(), |stem| stem.to_string_lossy().into_owned());
    let folder = file.parent().unwrap_or(Path::new(""));
    let title = root.text_or("title", &stem);
    let seed = root.integer("seed");
    let gravity = root.axes("gravity");
    let (names, materials) = particles::read_materials(root);
    let cell = settings::read_cell(root, &names);
    let packing = settings::read_packing(root, folder, cell.as_ref());
    let from_file = root.chooses("packing", "file");
    let species = particles::read_species(root, &names, from_file);
    let context = contact::Context {
        names: &names,
        materials: materials.as_deref(),
        species: species.as_deref(),
        cell: cell.as_ref(),
    };
    let pairs = contact::read(root, &context);
    let load = stages::read_load(root);
    let common = routine::of_load(root);
    let unstressed = match (gravity, &species, &packing) {
        (Some(gravity), Some(species), Some(packing)) => stages::begins_unstressed(gravity, species, packing),
        _ => false,
    };
    let stages = stages::read(root, &stages::Beginning { cell: cell.as_ref(), unstressed }, common);
    let quasi_static = routine::read(root);
    let time_step = settings::read_time_step(root);
    let output = settings::read_output(root, &stem);
    let parallel = settings::read_parallel(root);
    if let Some(stages) = &stages {
        routine::check(root, stages, species.as_deref());
    }
    let (cell, (packing, replication), species) = (cell?, packing?, species?);
    settings::check_cell(root, &cell, &packing, &species);
    let (mut pairs, max_overlap_fraction) = pairs?;
    let (kinematics, control_interval) = load?;
    let stages = stages?;
    let velocities = Velocities::of(&pairs, &stages);
    for pair in &mut pairs {
        pair.properties.velocities = velocities;
    }
    Some(Config {
        seed: seed?,
        cell,
        materials: materials?,
        species,
        pairs,
        velocities,
        packing,
        replication,
        gravity: gravity?,
        kinematics,
        quasi_static: quasi_static?,
        stages,
        time_step: time_step?,
        control_interval,
        max_overlap_fraction,
        output: output?,
        parallel: parallel?,
        title: title?,
        resolved: String::new(),
    })
}
