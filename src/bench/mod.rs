//! `dem-mpi bench`: speed on jammed periodic packings under uniaxial compression.
//!
//! With `--packing` one packing is timed on the ranks of this process. Otherwise packings are made, and
//! every combination of size and layout runs in a process of its own (repeats interleaved, medians
//! shown): a table, or a study of strong or weak scaling.

mod case;
mod data;
mod launch;
mod make;
mod scaling;
mod workload;

use crate::error::{Error, Result};
use crate::exchange::Communicator;
use crate::packing::MAX_PARTICLES;
use clap::Args;
use launch::{Layout, Measurement, Series};
use make::Plan;
use std::path::{Path, PathBuf};
use workload::{Aspects, Law};

/// Options of `dem-mpi bench`.
#[derive(Debug, Clone, Args)]
pub struct BenchOptions {
    /// Numbers of particles; with --weak per core.
    #[arg(long, value_delimiter = ',')]
    particles: Vec<usize>,
    /// Layouts as RANKSxTHREADS.
    #[arg(long, value_delimiter = ',', conflicts_with = "write_data")]
    layouts: Vec<Layout>,
    /// Repeats of each combination.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..), conflicts_with_all = ["packing", "write_data"])]
    repeats: u32,
    /// Steps to time; by itself some seconds' worth.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..), conflicts_with = "write_data")]
    steps: Option<u64>,
    /// Steps before the timed ones.
    #[arg(long, conflicts_with = "write_data")]
    warm: Option<u64>,
    /// Normal law.
    #[arg(long, value_enum, default_value_t = Law::Hertz, conflicts_with = "write_data")]
    law: Law,
    /// Largest over smallest radius of packings made here.
    #[arg(long, value_name = "RATIO", default_value_t = 1.0)]
    radii: f64,
    /// Ellipsoids instead of spheres: ratios b/a and c/a drawn between these two, for example 0.7:1.3.
    #[arg(long, value_name = "LOW:HIGH", conflicts_with_all = ["strong", "weak"])]
    aspects: Option<Aspects>,
    /// Time this packing (CSV, HDF5, LAMMPS data file) on the ranks of this process, as `mpirun -n N` started them.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["particles", "layouts", "radii", "aspects", "strong", "weak", "write_data"])]
    packing: Option<PathBuf>,
    /// Repeat the packing along each axis.
    #[arg(long, value_name = "AxBxC", requires = "packing")]
    copies: Option<String>,
    /// Sides of the cell in m, for packings that do not hold them.
    #[arg(long, value_names = ["X", "Y", "Z"], num_args = 3, requires = "packing")]
    sides: Option<Vec<f64>>,
    /// Threads per rank with --packing [default: 1]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024), requires = "packing")]
    threads: Option<u16>,
    /// Make a packing of --particles particles and write it, spheres as a LAMMPS data file, ellipsoids as CSV; times
    /// nothing.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["strong", "weak"])]
    write_data: Option<PathBuf>,
    /// Strong scaling: one size on growing layouts; table and pictures in --output.
    #[arg(long, conflicts_with = "weak")]
    strong: bool,
    /// Weak scaling: a size per core on growing layouts; table and pictures in --output.
    #[arg(long)]
    weak: bool,
    /// Folder for tables, pictures and the packings made [default: bench-strong, bench-weak, or none]
    #[arg(long, value_name = "DIR", conflicts_with_all = ["packing", "write_data"])]
    output: Option<PathBuf>,
    /// Command before the program, with {ranks} and {threads}, split at blanks [default: mpirun, ranks bound to cores
    /// where there are enough].
    #[arg(long, value_name = "COMMAND", conflicts_with_all = ["packing", "write_data"])]
    launcher: Option<String>,
}

/// Run the bench.
///
/// # Errors
/// A packing cannot be made, read or written, or a case cannot be started or fails.
pub fn main(comm: &Communicator, options: &BenchOptions) -> Result<()> {
    if let Some(sides) = options.sides.as_ref().filter(|sides| sides.iter().any(|s| !(s.is_finite() && *s > 0.0))) {
        return Err(Error::Input(format!(
            "--sides {sides:?}: give three lengths above 0 in m, for example 1e-4 1e-4 1e-4"
        )));
    }
    if let Some(path) = &options.packing {
        return case::run(comm, path, options);
    }
    if comm.size() > 1 {
        return Err(Error::Input(
            "this bench starts its ranks itself: run it without mpirun and choose --layouts, or time one packing on the \
             ranks of this process with --packing FILE"
                .into(),
        ));
    }
    make::checked_ratio(options.radii)?;
    if let Some(wrong) = options.particles.iter().find(|&&number| number == 0 || number > MAX_PARTICLES) {
        return Err(Error::Input(format!(
            "--particles {wrong}: give numbers from 1 to {MAX_PARTICLES}, for example 10000"
        )));
    }
    if let Some(path) = &options.write_data {
        let &[particles] = &options.particles[..] else {
            return Err(Error::Input("--write-data FILE needs one --particles N".into()));
        };
        let plan = Plan::new(particles, options.aspects);
        let [x, y, z] = make::write(path, plan, true, options.radii, options.aspects)?;
        say!("{} particles in {}, sides {x:e} {y:e} {z:e} m", plan.particles(), path.display());
        return Ok(());
    }
    if options.strong || options.weak { scaling::study(options) } else { table(options) }
}

fn table(options: &BenchOptions) -> Result<()> {
    let sizes = if options.particles.is_empty() { vec![250, 10_000, 100_000] } else { options.particles.clone() };
    let layouts = match &options.layouts[..] {
        [] => vec![Layout { ranks: 1, threads: 1 }, Layout { ranks: 1, threads: 2 }, Layout { ranks: 2, threads: 1 }],
        given => given.to_vec(),
    };
    let folder = launch::Folder::new(options.output.as_deref())?;
    say!(
        "{:>10} {:>7} {:>16} {:>19} {:>13} {:>11} {:>7} {:>11} {:>11}",
        "particles",
        "layout",
        "particle-steps/s",
        "min - max",
        "contacts/s",
        "ns/contact",
        "Z",
        "B/particle",
        "peak"
    );
    for size in sizes {
        let plan = Plan::new(size, options.aspects);
        let file = base_packing(folder.path(), plan, options)?;
        let mut series = vec![Series::default(); layouts.len()];
        for _ in 0..options.repeats {
            for (layout, series) in layouts.iter().zip(&mut series) {
                series.add(launch::measure(&file, plan.copies, *layout, options)?);
            }
        }
        for (layout, series) in layouts.iter().zip(&series) {
            let Measurement { particles, rate, contacts, per_contact, coordination, bytes, peak_bytes, .. } =
                series.median();
            let [low, high] = series.range().map(|rate| format!("{rate:.3e}"));
            say!(
                "{particles:>10} {:>7} {rate:>16.4e} {low:>9}-{high:>9} {contacts:>13.4e} {per_contact:>11.2} \
                 {coordination:>7.3} {bytes:>11.0} {peak_bytes:>11.0}",
                layout.to_string()
            );
        }
    }
    Ok(())
}

/// A packing in a file.
#[derive(Debug)]
struct BasePacking {
    path: PathBuf,
    /// Sides of the cell \[m\] where the file does not have them.
    sides: Option<[f64; 3]>,
}

/// The base of a plan as a file of the folder; one of spheres is made only if it is not there.
fn base_packing(folder: &Path, plan: Plan, options: &BenchOptions) -> Result<BasePacking> {
    if options.aspects.is_some() {
        let path = folder.join(format!("base-{}-ellipsoids.csv", plan.base));
        let sides = make::write(&path, plan, false, options.radii, options.aspects)?;
        return Ok(BasePacking { path, sides: Some(sides) });
    }
    let path = folder.join(format!("base-{}-radii-{}.data", plan.base, options.radii));
    if !path.exists() {
        make::write(&path, plan, false, options.radii, None)?;
    }
    Ok(BasePacking { path, sides: None })
}

/// Copies along each axis, as given.
fn parse_copies(text: Option<&str>) -> Result<[usize; 3]> {
    let Some(text) = text else { return Ok([1; 3]) };
    let numbers: Vec<usize> = text.split('x').filter_map(|part| part.parse().ok().filter(|n| *n > 0)).collect();
    match numbers[..] {
        [a, b, c] if text.matches('x').count() == 2 => Ok([a, b, c]),
        _ => Err(Error::Input(format!("--copies {text:?}: give three numbers above 0, for example 2x2x1"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_are_three_numbers() {
        assert_eq!(parse_copies(Some("2x3x1")).ok(), Some([2, 3, 1]));
        assert_eq!(parse_copies(None).ok(), Some([1; 3]));
        for text in ["2", "2x2", "2x2x0", "2xx2x2", "axbxc", "1x1x1x"] {
            assert!(parse_copies(Some(text)).is_err(), "{text}");
        }
    }
}
