//! `dem-mpi bench`: speed on a jammed periodic packing of equal spheres, Hertz + Mindlin.
//!
//! The packing is random close packing, replicated where it is large, compressed and relaxed to solid
//! fraction 0.64; then uniaxial compression at 0.2 /s is timed. Without `--case` every combination of
//! size, ranks and threads runs in a process of its own, repeats interleaved, and medians are shown.

use crate::config::Config;
use crate::error::{Error, Result};
use crate::exchange::{Communicator, agree};
use crate::force::observe::Wanted;
use crate::packing;
use crate::run::{resident_bytes, set_up_threads};
use crate::setup::{self, Initial};
use crate::simulation::{Requests, STAGES, Simulation};
use clap::Args;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

/// Largest packing made directly; larger ones are its replicas.
const BASE_PARTICLES: usize = 12_500;
/// Steps that bring the packing to its solid fraction, and steps that relax it.
const PREPARE_STEPS: [u64; 2] = [1500, 1500];

/// Options of `dem-mpi bench`.
#[derive(Debug, Clone, Args)]
pub struct BenchOptions {
    /// Numbers of particles (1000000 takes some minutes).
    #[arg(long, value_delimiter = ',', default_values_t = [250, 10_000, 100_000])]
    particles: Vec<usize>,
    /// Layouts as RANKSxTHREADS.
    #[arg(long, value_delimiter = ',', default_values_t = ["1x1".to_string(), "1x2".to_string(), "2x1".to_string()])]
    layouts: Vec<String>,
    /// Repeats of each combination.
    #[arg(long, default_value_t = 3)]
    repeats: usize,
    /// Steps to time; by itself about two seconds' worth.
    #[arg(long)]
    steps: Option<u64>,
    /// Measure one size with this process's own ranks and print one line.
    #[arg(long, hide = true)]
    case: Option<usize>,
    /// Threads of a case.
    #[arg(long, hide = true, default_value_t = 1)]
    threads: usize,
}

/// What one measurement gives.
#[derive(Debug, Clone, Copy)]
struct Measurement {
    particle_steps: f64,
    contacts: f64,
    coordination: f64,
    bytes: f64,
}

/// Run the bench.
///
/// # Errors
/// A case cannot be started or fails.
pub fn main(options: &BenchOptions) -> Result<()> {
    if let Some(particles) = options.case {
        return Communicator::world().and_then(|comm| case(&comm, particles, options));
    }
    println!(
        "{:>10} {:>7} {:>16} {:>16} {:>13} {:>7} {:>11}",
        "particles", "layout", "particle-steps/s", "contacts/s", "Cundall/core", "Z", "B/particle"
    );
    for particles in &options.particles {
        let mut rows: Vec<Vec<Measurement>> = vec![Vec::new(); options.layouts.len()];
        for _ in 0..options.repeats.max(1) {
            for (layout, row) in options.layouts.iter().zip(&mut rows) {
                row.push(launch(*particles, layout, options)?);
            }
        }
        for (layout, row) in options.layouts.iter().zip(&mut rows) {
            let (ranks, threads) = parse_layout(layout)?;
            row.sort_by(|a, b| a.particle_steps.total_cmp(&b.particle_steps));
            let median = row[row.len() / 2];
            println!(
                "{particles:>10} {layout:>7} {:>16.4e} {:>16.4e} {:>13.4e} {:>7.3} {:>11.0}",
                median.particle_steps,
                median.contacts,
                median.particle_steps / (ranks * threads) as f64,
                median.coordination,
                median.bytes
            );
        }
    }
    Ok(())
}

fn parse_layout(layout: &str) -> Result<(usize, usize)> {
    let wrong = || Error::Input(format!("--layouts {layout:?}: give RANKSxTHREADS, for example 2x1"));
    let (ranks, threads) = layout.split_once('x').ok_or_else(wrong)?;
    match (ranks.parse(), threads.parse()) {
        (Ok(ranks @ 1..), Ok(threads @ 1..)) => Ok((ranks, threads)),
        _ => Err(wrong()),
    }
}

fn launch(particles: usize, layout: &str, options: &BenchOptions) -> Result<Measurement> {
    let (ranks, threads) = parse_layout(layout)?;
    let failed = |what: String| Error::File { path: "bench".into(), message: what };
    let program = std::env::current_exe().map_err(|error| failed(format!("cannot find this program: {error}")))?;
    let mut command = if ranks > 1 {
        let mut command = Command::new("mpirun");
        command.args(["--oversubscribe", "-n", &ranks.to_string()]).arg(&program);
        command
    } else {
        Command::new(&program)
    };
    command.args(["bench", "--case", &particles.to_string(), "--threads", &threads.to_string()]);
    if let Some(steps) = options.steps {
        command.args(["--steps", &steps.to_string()]);
    }
    let output = command.output().map_err(|error| failed(format!("cannot start {command:?}: {error}")))?;
    let text = String::from_utf8_lossy(&output.stdout);
    let numbers: Vec<f64> = text
        .lines()
        .find_map(|line| line.strip_prefix("case "))
        .map(|line| line.split_whitespace().filter_map(|word| word.parse().ok()).collect())
        .unwrap_or_default();
    match numbers[..] {
        [particle_steps, contacts, coordination, bytes] => {
            Ok(Measurement { particle_steps, contacts, coordination, bytes })
        }
        _ => Err(failed(format!("{command:?} failed: {}", String::from_utf8_lossy(&output.stderr)))),
    }
}

/// Number of replicas per axis that brings the base packing nearest to the wanted number.
fn replicas(particles: usize) -> usize {
    (1..).find(|n| particles <= n * n * n * BASE_PARTICLES).unwrap_or(1)
}

fn config_text(base: usize, fraction_strain: f64, steps: u64) -> String {
    let rate = |strain: f64, steps: u64| strain / (steps as f64 * 5e-7);
    let [inflate, relax] = PREPARE_STEPS;
    format!(
        r#"
seed = 1
[[material]]
name = "grain"
density = 5e9
young_modulus = "142 GPa"
poisson_ratio = 0.25
restitution = 0.5
friction = 0.3
[[species]]
name = "grain"
material = "grain"
radius = "5 um"
count = {base}
[contact.normal.hertz]
[contact.tangential.mindlin]
factor = 1.0
[packing.random_close]
contraction_rate = 1e-3
[[stage]]
strain_rate = {}
steps = {inflate}
[[stage]]
strain_rate = 0
steps = {relax}
[[stage]]
strain_rate = {{ z = 0.2 }}
steps = {steps}
[time_step]
fixed = 5e-7
[parallel]
min_particles_per_rank = 1
"#,
        rate(fraction_strain, inflate)
    )
}

fn replicated(initial: &mut Initial, copies: usize) {
    let (count, sides) = (initial.particles.len(), initial.global.sides);
    let base = std::mem::take(&mut initial.particles);
    for copy in 0..copies * copies * copies {
        let cell = [copy % copies, copy / copies % copies, copy / copies / copies];
        for state in &base {
            let mut state = *state;
            state.id += (copy * count) as u32;
            state.position = [0, 1, 2].map(|k| state.position[k] + cell[k] as f64 * sides[k]);
            initial.particles.push(state);
        }
    }
    initial.global.sides = sides.map(|side| side * copies as f64);
    initial.global.initial_sides = initial.global.sides;
    initial.global.particles *= (copies * copies * copies) as u64;
}

fn case(comm: &Communicator, particles: usize, options: &BenchOptions) -> Result<()> {
    let copies = replicas(particles);
    let base = particles.div_ceil(copies * copies * copies);
    let steps = options.steps.unwrap_or_else(|| (20_000_000 / particles as u64).clamp(100, 100_000));
    let parse = |strain: f64| {
        Config::parse(&config_text(base, strain, steps), Path::new("bench"), &[], None, Some(options.threads))
    };
    let config = parse(0.0)?;
    // The packing tells how much it must be compressed to reach 0.64.
    let attained = if comm.rank() == 0 { packing::build(&config).map(|p| solid_fraction(&p)) } else { Ok(0.0) };
    let mut fraction = [agree(comm, attained)?];
    comm.max_f64(&mut fraction);
    let strain = 1.0 - libm::cbrt(fraction[0] / 0.64);
    let config = Arc::new(parse(strain)?);
    let threads = set_up_threads(comm, &config);
    let mut initial = setup::from_packing(comm, &config)?;
    if copies > 1 {
        replicated(&mut initial, copies);
    }
    let decomposition = agree(comm, setup::decomposition(comm, &config, &initial.global))?;
    let mut simulation = setup::simulation(comm.clone(), &config, decomposition, initial, threads)?;
    advance(&mut simulation, PREPARE_STEPS[0] + PREPARE_STEPS[1])?;
    let before = simulation.timers().seconds();
    comm.barrier();
    let started = Instant::now();
    advance(&mut simulation, steps)?;
    comm.barrier();
    let wall = started.elapsed().as_secs_f64();
    let report = simulation.observe(Wanted { sums: true, ..Wanted::default() })?;
    let mut bytes = [resident_bytes() as i64];
    comm.sum_i64(&mut bytes);
    if comm.rank() == 0 {
        let total = simulation.global().particles as f64;
        let speed = total * steps as f64 / wall;
        let contacts = report.row.contacts as f64 * steps as f64 / wall;
        println!("case {speed:e} {contacts:e} {} {}", report.row.coordination, bytes[0] as f64 / total);
        let after = simulation.timers().seconds();
        for ((_, name), (after, before)) in STAGES.iter().zip(after.iter().zip(before)) {
            println!("{name:<16}{:>8.1} %", 100.0 * (after - before) / wall);
        }
        println!("loop {wall} s");
    }
    Ok(())
}

fn solid_fraction(packing: &packing::Packing) -> f64 {
    let volume: f64 = packing.particles.iter().map(|p| crate::state::particles::sphere_mass(p.radius, 1.0)).sum();
    volume / (packing.sides[0] * packing.sides[1] * packing.sides[2])
}

fn advance(simulation: &mut Simulation, steps: u64) -> Result<()> {
    let end = simulation.global().step + steps;
    while !simulation.settle_stage() && simulation.global().step < end {
        simulation.step(Wanted::default(), Requests::default(), |_, _| Ok(()))?;
    }
    Ok(())
}
