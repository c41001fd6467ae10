//! `dem-mpi scaling`: what the communication model predicts for a cubic periodic packing of equal spheres
//! on many ranks of a machine that the user describes.

use crate::error::{Error, Result};
use crate::exchange::model::{HaloGeometry, Machine, StepTime};
use crate::exchange::{Decomposition, HaloContent};
use clap::Args;

/// Ranks of the table, if none are given.
const RANKS: [usize; 4] = [1, 1000, 10_000, 100_000];

/// Options of `dem-mpi scaling`.
#[derive(Debug, Clone, Args)]
pub struct ScalingOptions {
    /// Particles over all ranks.
    #[arg(long, default_value_t = 1e9)]
    particles: f64,
    /// Numbers of ranks [default: 1,1000,10000,100000, up to the number of particles]
    #[arg(long, value_delimiter = ',')]
    ranks: Vec<usize>,
    /// Time of one rank alone per particle and step [s]: one over the particle-steps/s of `dem-mpi bench`.
    #[arg(long, default_value_t = 1e-7)]
    step_cost: f64,
    /// Share of that time spent on contacts.
    #[arg(long, default_value_t = 0.6)]
    contact_share: f64,
    /// Latency of a message [s].
    #[arg(long, default_value_t = 2e-6)]
    latency: f64,
    /// A rank's share of the network [B/s].
    #[arg(long, default_value_t = 1e10)]
    bandwidth: f64,
    /// Skin of the lists over the diameter, as `parallel.skin`.
    #[arg(long, default_value_t = 0.1)]
    skin: f64,
    /// Solid fraction.
    #[arg(long, default_value_t = 0.64)]
    solid_fraction: f64,
}

/// The prediction, a line per number of ranks.
///
/// # Errors
/// [`Error::Input`] if a number is out of its range, or there are more ranks than particles.
pub fn table(options: &ScalingOptions) -> Result<String> {
    let ScalingOptions { particles, step_cost, contact_share, latency, bandwidth, skin, solid_fraction, .. } = *options;
    let numbers = [
        ("--particles", particles, [1.0, 1e15]),
        ("--step-cost", step_cost, [1e-15, 1.0]),
        ("--contact-share", contact_share, [1e-3, 1.0]),
        ("--latency", latency, [1e-15, 1.0]),
        ("--bandwidth", bandwidth, [1.0, 1e18]),
        ("--skin", skin, [0.0, 10.0]),
        ("--solid-fraction", solid_fraction, [1e-3, 1.0]),
    ];
    for (name, value, [least, most]) in numbers {
        if !(least..=most).contains(&value) {
            let found = if value == 0.0 || (1e-3..1e6).contains(&value.abs()) {
                value.to_string()
            } else {
                format!("{value:e}")
            };
            return Err(Error::Input(format!("{name} {found}: give a number from {least:e} to {most:e}")));
        }
    }
    if let Some(ranks) = options.ranks.iter().find(|&&ranks| ranks == 0 || ranks as f64 > particles) {
        return Err(Error::Input(format!(
            "--ranks {ranks}: give numbers from 1 to that of the particles, {particles}, or more --particles"
        )));
    }
    let usual = RANKS.iter().copied().filter(|&ranks| ranks as f64 <= particles);
    let all_ranks: Vec<usize> = if options.ranks.is_empty() { usual.collect() } else { options.ranks.clone() };
    let machine = Machine { step_cost, contact_share, latency, bandwidth };
    // Lengths in radii.
    let side = libm::cbrt(particles * 4.0 / 3.0 * std::f64::consts::PI / solid_fraction);
    let mut lines = vec![format!(
        "{:>8} {:>14} {:>12} {:>9} {:>8} {:>9} {:>10} {:>10} {:>10} {:>10} {:>8} {:>8}",
        "ranks",
        "grid",
        "particles",
        "ghosts",
        "messages",
        "kB",
        "work ms",
        "doubled ms",
        "halo ms",
        "agree ms",
        "eff. %",
        "hidden %"
    )];
    for ranks in all_ranks {
        let grid = Decomposition::automatic(ranks, particles as u64, 1, [side; 3]).grid;
        let geometry =
            HaloGeometry { grid, sides: [side; 3], periodic: [true; 3], margin: 2.0 + 2.0 * skin, particles };
        let traffic = geometry.expected(HaloContent { velocities: true, orientations: false }.bytes() as f64);
        let time = StepTime::new(&geometry, &traffic, &machine, 1.0);
        lines.push(format!(
            "{:>8} {:>14} {:>12.4e} {:>9.0} {:>8.1} {:>9.1} {:>10.4} {:>10.4} {:>10.4} {:>10.4} {:>8.1} {:>8.1}",
            grid.iter().product::<usize>(),
            grid.map(|n| n.to_string()).join(" × "),
            particles / grid.iter().product::<usize>() as f64,
            traffic.ghosts,
            traffic.messages,
            1e-3 * traffic.bytes,
            1e3 * time.work,
            1e3 * time.doubled,
            1e3 * time.halo,
            1e3 * time.agreement,
            100.0 * time.efficiency(),
            100.0 * time.efficiency_with_overlap()
        ));
    }
    lines.push(format!(
        "eff.: work over step time, nothing hidden; hidden: halo behind inner contacts. Assumed: {step_cost:e} s per \
         particle and step, {contact_share} of it contacts; latency {latency:e} s; {bandwidth:e} B/s per rank; agreement 2 \
         log2 P latencies; even load."
    ));
    Ok(lines.join("\n"))
}
