//! One timed run of a given packing on the ranks of this process, and what it prints.

use super::data::{cells, moved};
use super::workload::{Law, Leg, Particles, Workload};
use super::{BenchOptions, parse_copies};
use crate::error::{Error, Result};
use crate::exchange::{Communicator, agree};
use crate::force::observe::Wanted;
use crate::packing::{MAX_PARTICLES, file};
use crate::run::{available_bytes, peak_bytes, ranks_here, resident_bytes, set_up_threads};
use crate::setup::{self, Initial};
use crate::simulation::{Requests, STAGES, Simulation, Stage};
use crate::state::ParticleState;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Strain rate along z \[1/s\].
const STRAIN_RATE: f64 = 0.2;

/// Warm up, time the steps, print what came out and `loop SECONDS s`.
///
/// # Errors
/// The packing cannot be read or the run fails; the same error on every rank.
pub fn run(comm: &Communicator, path: &Path, options: &BenchOptions) -> Result<()> {
    let started = Instant::now();
    let copies = parse_copies(options.copies.as_deref())?;
    let names = if comm.rank() == 0 { file::species_names(path) } else { Ok(Vec::new()) };
    let names = names_of_all(comm, agree(comm, names)?);
    let parse = |legs: Vec<(Leg, u64)>| {
        let sides = options.sides.as_deref().and_then(|sides| <[f64; 3]>::try_from(sides).ok());
        let particles = Particles::File { path, species: &names, sides };
        agree(
            comm,
            Workload { particles, law: options.law, legs, threads: options.threads.map_or(1, usize::from) }.config(),
        )
    };
    let mut initial = setup::from_packing(comm, &parse(vec![(Leg::AlongZ(STRAIN_RATE), 1)])?)?;
    if copies != [1; 3] {
        agree(comm, check_room(comm, initial.global.particles, copies))?;
        replicate(comm, &mut initial, copies);
    }
    let total = initial.global.particles;
    let steps = options.steps.unwrap_or_else(|| (20_000_000 / total).clamp(20, 100_000));
    let warm = options.warm.unwrap_or_else(|| (2_000_000 / total).clamp(10, 1000));
    let config = Arc::new(parse(vec![(Leg::AlongZ(STRAIN_RATE), warm + steps)])?);
    let threads = set_up_threads(comm, &config);
    let decomposition = agree(comm, setup::decomposition(comm, &config, &initial.global))?;
    let mut simulation = setup::simulation(comm.clone(), &config, decomposition, initial, threads)?;
    if comm.rank() == 0 {
        say!("{}: ready after {:.1} s", path.display(), started.elapsed().as_secs_f64());
    }
    advance(&mut simulation, warm)?;
    let before = simulation.timers().seconds();
    comm.barrier();
    let timed = Instant::now();
    advance(&mut simulation, steps)?;
    comm.barrier();
    let wall = timed.elapsed().as_secs_f64();
    let after = simulation.timers().seconds();
    let spent: Vec<f64> = after.iter().zip(before).map(|(after, before)| after - before).collect();
    let shape = Shape { steps, warm, threads, law: options.law };
    print(comm, &mut simulation, &shape, &spent, wall)
}

/// What the printed lines say of the run beside its times.
struct Shape {
    steps: u64,
    warm: u64,
    threads: usize,
    law: Law,
}

/// `name value` lines, which the bench that launched this case reads, and the line for other tools.
fn print(comm: &Communicator, simulation: &mut Simulation, shape: &Shape, spent: &[f64], wall: f64) -> Result<()> {
    // Before the observation, which allocates.
    let mut bytes = [resident_bytes() as i64, peak_bytes() as i64];
    comm.sum_i64(&mut bytes);
    let report = simulation.observe(Wanted { sums: true, ..Wanted::default() })?;
    let all: Vec<Vec<f64>> = comm
        .all_gather(bytemuck::cast_slice(spent))
        .iter()
        .map(|bytes| bytemuck::pod_collect_to_vec::<u8, f64>(bytes))
        .collect();
    if comm.rank() != 0 {
        return Ok(());
    }
    let waiting = [Stage::Halo as usize, Stage::Reduce as usize, Stage::Output as usize];
    let busy: Vec<f64> = all.iter().map(|rank| wall - waiting.iter().map(|stage| rank[*stage]).sum::<f64>()).collect();
    let mean_busy = busy.iter().sum::<f64>() / busy.len() as f64;
    let imbalance = busy.iter().copied().fold(0.0, f64::max) / mean_busy;
    let particles = simulation.global().particles as f64;
    let steps = shape.steps as f64;
    let contacts = report.row.contacts as f64;
    let cores = (comm.size() * shape.threads) as f64;
    let line = |name: &str, value: String| say!("{name:<24}{value}");
    line("particles", format!("{particles}"));
    line("ranks x threads", format!("{} x {}", comm.size(), shape.threads));
    line("steps", format!("{steps} after {} to warm up", shape.warm));
    line("laws", format!("{} + mindlin", shape.law.name()));
    for (stage, name) in STAGES {
        let mean = all.iter().map(|rank| rank[stage as usize]).sum::<f64>() / all.len() as f64;
        line(&format!("share {name}"), format!("{:.2} %", 100.0 * mean / wall));
    }
    line("imbalance", format!("{imbalance:.4}"));
    line("particle-steps/s", format!("{:.4e}", particles * steps / wall));
    line("contacts/s", format!("{:.4e}", contacts * steps / wall));
    line("ns/contact/step/core", format!("{:.3}", 1e9 * wall * cores / (contacts * steps)));
    line("solid fraction", format!("{:.4}", report.row.solid_fraction));
    line("coordination", format!("{:.4}", report.row.coordination));
    line("bytes/particle", format!("{:.0}", bytes[0] as f64 / particles));
    line("peak bytes/particle", format!("{:.0}", bytes[1] as f64 / particles));
    say!("loop {wall} s");
    Ok(())
}

/// Take so many steps.
///
/// # Errors
/// A step failed.
pub fn advance(simulation: &mut Simulation, steps: u64) -> Result<()> {
    let end = simulation.global().step + steps;
    while !simulation.settle_stage() && simulation.global().step < end {
        simulation.step(Wanted::default(), Requests::default(), |_, _| Ok(()))?;
    }
    Ok(())
}

fn names_of_all(comm: &Communicator, names: Vec<String>) -> Vec<String> {
    let mut bytes = names.join("\n").into_bytes();
    comm.broadcast(0, &mut bytes);
    String::from_utf8_lossy(&bytes).lines().map(str::to_owned).collect()
}

/// Memory of a particle while its rank is set up \[bytes\] (docs/performance.md).
const BYTES_PER_PARTICLE: u64 = 1000;

/// That ids can number the copies and that this rank's share of them fits into the memory there is.
fn check_room(comm: &Communicator, base: u64, copies: [usize; 3]) -> Result<()> {
    let total = copies.iter().fold(base, |product, &n| product.saturating_mul(n as u64));
    let text = copies.map(|n| n.to_string()).join("x");
    if total > MAX_PARTICLES as u64 {
        return Err(Error::Input(format!(
            "--copies {text} of {base} particles are more than ids can number ({MAX_PARTICLES}); give fewer copies"
        )));
    }
    let share = total.div_ceil(comm.size() as u64).saturating_mul(BYTES_PER_PARTICLE);
    let needed = share.saturating_mul(ranks_here(comm.size()) as u64);
    match available_bytes() {
        Some(available) if needed > available => Err(Error::Input(format!(
            "--copies {text} of {base} particles need about {:.1} GB on this machine, where {:.1} GB are free; give fewer \
             copies, or use more machines",
            1e-9 * needed as f64,
            1e-9 * available as f64
        ))),
        _ => Ok(()),
    }
}

/// Repeat the packing along each axis; every rank makes its share of the copies.
fn replicate(comm: &Communicator, initial: &mut Initial, copies: [usize; 3]) {
    let mut bytes = bytemuck::cast_slice(&initial.particles).to_vec();
    comm.broadcast(0, &mut bytes);
    let base: Vec<ParticleState> = bytemuck::pod_collect_to_vec(&bytes);
    drop(bytes);
    let sides = initial.global.sides;
    initial.particles.clear();
    for (copy, cell) in cells(copies).enumerate().filter(|(copy, _)| copy % comm.size() == comm.rank()) {
        initial.particles.extend(base.iter().map(|state| ParticleState {
            id: state.id + (copy * base.len()) as u32,
            position: moved(state.position, cell, sides),
            ..*state
        }));
    }
    initial.global.sides = [0, 1, 2].map(|k| sides[k] * copies[k] as f64);
    initial.global.initial_sides = initial.global.sides;
    initial.global.particles *= copies.iter().product::<usize>() as u64;
}
