//! `dem-mpi verify wahn2022`: recomputes the figures of the viscoelastic paper (W) from `configs/wahn2022`,
//! draws them, and compares with what they must show. Each run is a call of this program, as a user would make
//! it; the figures know run directories only.

mod assembly;
pub(super) mod check;
mod curves;
mod density;
mod job;
mod loose;
mod nmc;
mod rates;
mod relaxation;
mod report;
mod two_spheres;

use crate::error::{Error, Result};
use crate::output::files::create_folder;
use crate::output::plot::{Panel, draw_panel};
use check::Check;
use clap::Args;
use job::{Job, Runs, Workshop};
use report::Chapter;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Instant;

/// Options of `dem-mpi verify wahn2022`.
#[derive(Debug, Clone, Args)]
pub struct Wahn2022Options {
    /// Folder for inputs, run directories, pictures and the table.
    #[arg(long, value_name = "DIR", default_value = "runs/wahn2022")]
    output: PathBuf,
    /// Packings per curve of Figs. 13 to 16.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=100))]
    seeds: u32,
    /// Only these figures, for example 9,10,12.
    #[arg(long, value_name = "FIGURES", value_delimiter = ',')]
    only: Vec<u32>,
    /// Processes at a time; by itself one per core.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    workers: Option<u16>,
    /// Small packings of one seed, to try the command; single checks of Figs. 13 to 15 may fail then.
    #[arg(long)]
    quick: bool,
    /// Take over finished runs of the output folder that had the same input; only sensible with the same program.
    #[arg(long)]
    reuse: bool,
}

/// How much is run.
#[derive(Debug, Clone)]
pub struct Extent {
    /// Seeds of the packings.
    seeds: Vec<u32>,
    /// Small packings.
    quick: bool,
}

/// A result, or the reason why a figure could not be judged.
type Judged<T> = std::result::Result<T, String>;

/// What a figure came to.
pub struct Judgement {
    checks: Vec<Check>,
    /// Pictures with their names.
    panels: Vec<(String, Panel)>,
}

/// A figure of the paper.
struct Figure {
    number: u32,
    title: &'static str,
    setting: &'static str,
    plan: fn(&Extent) -> Vec<Job>,
    judge: fn(&Runs, &Extent) -> Judged<Judgement>,
}

const FIGURES: &[Figure] = &[
    Figure {
        number: 9,
        title: "two PVDF spheres at several strain rates",
        setting: "Two spheres of 5 µm in a periodic cell, 2 % (BCT), input `configs/wahn2022/fig09.toml`. Density: the \
                  physical one\ntimes 10⁹ (W's time step fits no other reading); it has no effect on these forces.",
        plan: two_spheres::plan_rates,
        judge: two_spheres::judge_rates,
    },
    Figure {
        number: 10,
        title: "relaxation of two PVDF spheres",
        setting: "As Fig. 9; 2 % in 1 s, then held to 20 s. Input `configs/wahn2022/fig10.toml`.",
        plan: two_spheres::plan_relaxation,
        judge: two_spheres::judge_relaxation,
    },
    Figure {
        number: 12,
        title: "two PVDF spheres at the rates of W's finite element runs",
        setting: "As Fig. 9, input `configs/wahn2022/fig12.toml`. W's finite element curves, which lie 5.4 % above at \
                  2 %, are\nnot recomputed: that needs a finite element code.",
        plan: two_spheres::plan_finite_elements,
        judge: two_spheres::judge_finite_elements,
    },
    Figure {
        number: 13,
        title: "a loose packing bears nothing until it is dense enough",
        setting: "226 PVDF spheres of 2.5 µm, dropped and rolled, then compressed by 10 % quasi-statically; dashed: \
                  dynamic from\n7 % on. Input `configs/wahn2022/fig13.toml`. W gives no friction: 0.01 \
                  brings the onset to W's 7 %.",
        plan: loose::plan,
        judge: loose::judge,
    },
    Figure {
        number: 14,
        title: "250 NMC spheres, quasi-static and dynamic",
        setting: "Random close packings of 0.635, 1 %, input `configs/wahn2022/fig14.toml`. Dynamic runs keep strain rate \
                  squared times\ndensity scaling at 10⁴ s⁻², except those *with W's inertia* (HSD over 1 s with 10⁹ × the \
                  physical density, 10⁵ s⁻²).",
        plan: nmc::plan,
        judge: nmc::judge,
    },
    Figure {
        number: 15,
        title: "250 PVDF spheres at several strain rates",
        setting: "Random close packings of 0.635, 0.5 % (BCT), input `configs/wahn2022/fig15.toml`. First with strain rate \
                  squared times\ndensity scaling at 10⁴ s⁻², between *dynamic elastic* runs of the same kinematics, at \
                  W's rates and slower ones\ndown to the soft limit; then with W's own inertia (10⁶ to 10⁸ s⁻², no dashpot \
                  beside the branch), each beside the\nelastic run with the same inertia; last, at 1 /s, the physical density itself.",
        plan: rates::plan,
        judge: rates::judge,
    },
    Figure {
        number: 16,
        title: "relaxation of 250 PVDF spheres",
        setting: "Random close packings of 0.635, 0.3 % in 1 s (the caption; the text also says 1.0 /s), then held to 10 s. \
                  Input\n`configs/wahn2022/fig16.toml`; strain rate squared times density scaling 9·10³ s⁻².",
        plan: relaxation::plan,
        judge: relaxation::judge,
    },
];

/// Make runs, pictures and table; 0 if every check holds or is a finding, else 1.
///
/// # Errors
/// `--only` names no such figure; the output folder cannot be written.
pub fn main(options: &Wahn2022Options) -> Result<i32> {
    let started = Instant::now();
    let figures = chosen(&options.only)?;
    let extent = Extent { seeds: (1..=if options.quick { 1 } else { options.seeds }).collect(), quick: options.quick };
    let jobs: Vec<Job> = figures.iter().flat_map(|figure| (figure.plan)(&extent)).collect();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let workshop = Workshop {
        output: options.output.clone(),
        workers: options.workers.map_or(cores, usize::from),
        reuse: options.reuse,
    };
    say!("{} runs, {} at a time, into {}", jobs.len(), workshop.workers, options.output.display());
    let runs = workshop.make(&jobs, |done, job, result| {
        let outcome = match result {
            Ok(run) => format!("{:.1} s", run.wall),
            Err(reason) => format!("failed: {reason}"),
        };
        eprintln!("{done:>4}/{} fig{:02}/{}: {outcome}", jobs.len(), job.figure, job.name);
    })?;
    let mut chapters = Vec::new();
    for figure in figures {
        let chapter = judge(figure, &runs, &extent, options)?;
        report::print(&chapter);
        chapters.push(chapter);
    }
    let total = started.elapsed().as_secs_f64();
    report::write(&options.output, &command(options), &chapters, total)?;
    let report::Count { passed, failed, findings } = report::count(&chapters);
    say!("\n{passed} passed, {findings} findings, {failed} failed, {total:.1} s");
    say!("table in {}", options.output.join("wahn2022.md").display());
    Ok(i32::from(failed > 0))
}

fn chosen(only: &[u32]) -> Result<Vec<&'static Figure>> {
    let known: BTreeSet<u32> = FIGURES.iter().map(|figure| figure.number).collect();
    if let Some(unknown) = only.iter().find(|number| !known.contains(number)) {
        let names: Vec<String> = known.iter().map(u32::to_string).collect();
        return Err(Error::Input(format!(
            "--only {unknown}: there is no such figure; the figures are {}",
            names.join(", ")
        )));
    }
    Ok(FIGURES.iter().filter(|figure| only.is_empty() || only.contains(&figure.number)).collect())
}

/// Judge a figure and draw its pictures.
fn judge(figure: &Figure, runs: &Runs, extent: &Extent, options: &Wahn2022Options) -> Result<Chapter> {
    let judged = (figure.judge)(runs, extent);
    let Judgement { checks, panels } = judged.unwrap_or_else(|reason| Judgement {
        checks: vec![Check::failed("all runs of the figure are there", reason)],
        panels: Vec::new(),
    });
    let folder = options.output.join("wahn2022");
    create_folder(&folder)?;
    for (name, panel) in &panels {
        for ending in ["svg", "png"] {
            draw_panel(&folder.join(format!("{name}.{ending}")), panel)?;
        }
    }
    Ok(Chapter {
        number: figure.number,
        title: figure.title,
        setting: figure.setting,
        checks,
        pictures: panels.into_iter().map(|(name, _)| name).collect(),
        runs: (figure.plan)(extent).len(),
        wall: runs.wall(figure.number),
    })
}

/// The call that makes the same table.
fn command(options: &Wahn2022Options) -> String {
    let mut text = "dem-mpi verify wahn2022".to_owned();
    if options.quick {
        text.push_str(" --quick");
    } else if options.seeds != 3 {
        text.push_str(&format!(" --seeds {}", options.seeds));
    }
    if !options.only.is_empty() {
        let numbers: Vec<String> = options.only.iter().map(u32::to_string).collect();
        text.push_str(&format!(" --only {}", numbers.join(",")));
    }
    text
}
