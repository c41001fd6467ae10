//! `dem-mpi verify becker2021`: recomputes figures of the elastoplastic ellipsoid paper (B) from
//! `configs/becker2021`, draws them, and compares with the closed forms and an independent integration.

mod assembly;
mod pair;
mod theory;

use super::scene::drive;
use super::wahn2022::check::{Check, Verdict};
use crate::config::Config;
use crate::error::{Error, Result};
use crate::exchange::Communicator;
use crate::force::observe::Wanted;
use crate::output::files::{create_folder, write_atomically};
use crate::output::plot::{Panel, draw_panel};
use crate::setup;
use crate::simulation::{Report, Simulation};
use crate::state::GlobalState;
use clap::Args;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Options of `dem-mpi verify becker2021`.
#[derive(Debug, Clone, Args)]
pub struct Becker2021Options {
    /// Folder for inputs, pictures and the table.
    #[arg(long, value_name = "DIR", default_value = "runs/becker2021")]
    output: PathBuf,
    /// Only the figures with this in their title, for example "Fig. 13".
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
}

/// What a figure came to.
struct Figure {
    title: &'static str,
    checks: Vec<Check>,
    /// Pictures with their names.
    panels: Vec<(&'static str, Panel)>,
}

/// Title, as far as `--only` needs it, and what makes the figure.
type Maker = (&'static str, fn(&Path) -> Result<Figure>);

const FIGURES: [Maker; 4] = [
    ("Fig. 10, Fig. 11", pair::transition),
    ("Fig. 13", pair::two_cycles),
    ("Fig. 15", pair::without_transition),
    ("Assembly", assembly::regimes),
];

/// The inputs, as they stand in the repository.
const INPUTS: [(&str, &str); 9] = [
    ("fig10.toml", include_str!("../../../configs/becker2021/fig10.toml")),
    ("fig10.csv", include_str!("../../../configs/becker2021/fig10.csv")),
    ("fig13.toml", include_str!("../../../configs/becker2021/fig13.toml")),
    ("fig13.csv", include_str!("../../../configs/becker2021/fig13.csv")),
    ("fig13_spheres.toml", include_str!("../../../configs/becker2021/fig13_spheres.toml")),
    ("fig13_spheres.csv", include_str!("../../../configs/becker2021/fig13_spheres.csv")),
    ("fig15.toml", include_str!("../../../configs/becker2021/fig15.toml")),
    ("fig15.csv", include_str!("../../../configs/becker2021/fig15.csv")),
    ("assembly.toml", include_str!("../../../configs/becker2021/assembly.toml")),
];

/// Make the figures; 0 if every check holds or is a finding, else 1.
///
/// # Errors
/// `--only` fits no figure; a run fails; the output folder cannot be written.
pub fn main(options: &Becker2021Options) -> Result<i32> {
    let started = Instant::now();
    let wanted = options.only.clone().unwrap_or_default().to_lowercase();
    let chosen: Vec<&Maker> = FIGURES.iter().filter(|(title, _)| title.to_lowercase().contains(&wanted)).collect();
    if chosen.is_empty() {
        let known: Vec<&str> = FIGURES.iter().map(|(title, _)| *title).collect();
        return Err(Error::Input(format!("--only {wanted}: there is no such figure; there are {}", known.join(", "))));
    }
    let output = &options.output;
    create_folder(&output.join("configs"))?;
    for (name, text) in INPUTS {
        write_atomically(&output.join("configs").join(name), text.as_bytes())?;
    }
    let mut figures = Vec::new();
    for (_, make) in chosen {
        let figure = make(output)?;
        say!("\n{}", figure.title);
        for check in &figure.checks {
            say!("  {:<72} {:>18}  {:<32} {}", check.claim, check.expected, check.got, check.verdict.word());
            if let Some(note) = check.note {
                say!("      {note}");
            }
        }
        for (name, panel) in &figure.panels {
            for ending in ["svg", "png"] {
                draw_panel(&output.join(format!("{name}.{ending}")), panel)?;
            }
        }
        figures.push(figure);
    }
    let seconds = started.elapsed().as_secs_f64();
    write_atomically(&output.join("becker2021.md"), document(&figures, seconds).as_bytes())?;
    let number = |verdict| figures.iter().flat_map(|f| &f.checks).filter(|check| check.verdict == verdict).count();
    let [passed, findings, failed] = [Verdict::Pass, Verdict::Finding, Verdict::Fail].map(number);
    say!("\n{passed} passed, {findings} findings, {failed} failed, {seconds:.1} s");
    say!("table in {}", output.join("becker2021.md").display());
    Ok(i32::from(failed > 0))
}

fn document(figures: &[Figure], seconds: f64) -> String {
    let mut text = format!(
        "# Becker, Kamlah 2021: what we reproduce, and how well\n\n\
         Written by `dem-mpi verify becker2021`, which makes every run, draws every picture and fills in every number below\n\
         ({seconds:.0} s). B is *A theoretical model for the normal contact force of two elastoplastic ellipsoidal bodies*;\n\
         its finite element points are not recomputed: that needs a finite element code.\n"
    );
    for figure in figures {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "\n## {}\n", figure.title);
        for (name, panel) in &figure.panels {
            let _ = writeln!(text, "![{}]({name}.png)\n", panel.title);
        }
        let _ = writeln!(text, "| must show | expected | came out | |\n| --- | --- | --- | --- |");
        for check in &figure.checks {
            let _ =
                writeln!(text, "| {} | {} | {} | {} |", check.claim, check.expected, check.got, check.verdict.word());
        }
        for (check, note) in figure.checks.iter().filter_map(|check| check.note.map(|note| (check, note))) {
            let _ = writeln!(text, "\n*{}*: {note}.", check.claim);
        }
    }
    text
}

/// Run a configuration to its end in this process.
fn run(
    output: &Path,
    name: &str,
    sets: &[&str],
    wanted: impl FnMut(&GlobalState) -> Wanted,
    each: impl FnMut(&mut Simulation, &Report) -> Result<()>,
) -> Result<()> {
    let path = output.join("configs").join(format!("{name}.toml"));
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    let config = Arc::new(crate::config::load(&path, &sets, Some(output), None)?);
    simulate(&config, wanted, each)
}

fn simulate(
    config: &Arc<Config>,
    wanted: impl FnMut(&GlobalState) -> Wanted,
    each: impl FnMut(&mut Simulation, &Report) -> Result<()>,
) -> Result<()> {
    let comm = Communicator::single();
    let initial = setup::from_packing(&comm, config)?;
    let decomposition = setup::decomposition(&comm, config, &initial.global)?;
    let mut simulation = setup::simulation(comm, config, decomposition, initial, 1)?;
    drive(&mut simulation, wanted, each)
}
