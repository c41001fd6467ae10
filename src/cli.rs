//! The command line as typed, and what each subcommand calls.

use crate::bench::{self, BenchOptions};
use crate::config::{self, Config};
use crate::error::{Error, Result};
use crate::exchange::{Communicator, agree};
use crate::output::{checkpoint, plot};
use crate::run::{self, Outcome, RunOptions, Signals};
use crate::scaling::{self, ScalingOptions};
use crate::setup;
use crate::verify;
use crate::verify::becker2021::Becker2021Options;
use crate::verify::wahn2022::Wahn2022Options;
use clap::{Args, Parser, Subcommand};
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Exit code of a run that wrote a checkpoint on SIGUSR1 and wants to be queued again (EX_TEMPFAIL).
pub const EXIT_REQUEUE: i32 = 75;
/// Exit code of wrong input or usage.
pub const EXIT_INPUT: i32 = 2;

/// Discrete element method for battery electrodes and granular matter.
///
/// `dem-mpi CONFIG` runs a simulation; put `mpirun -n N` in front for N ranks.
#[derive(Debug, Parser)]
#[command(version, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: RunArguments,
}

#[derive(Debug, Args)]
struct RunArguments {
    /// Configuration file (TOML).
    #[arg(required = true)]
    config: Option<PathBuf>,
    #[command(flatten)]
    input: InputArguments,
    /// Go on from a checkpoint file, or from the newest valid checkpoint of a run directory.
    #[arg(long, value_name = "FILE|DIR")]
    restart: Option<PathBuf>,
}

#[derive(Debug, Args)]
struct InputArguments {
    /// Set a key of the configuration, for example `--set stage.0.duration="2 s"`.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Run directory.
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Threads per rank.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(config::MAX_THREADS)))]
    threads: Option<u16>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Validate a configuration and print the pre-run sheet.
    Check {
        /// Configuration file (TOML).
        config: PathBuf,
        #[command(flatten)]
        input: InputArguments,
    },
    /// Print a commented example configuration.
    Init,
    /// Print the input reference as Markdown.
    Reference,
    /// Draw the plots of a run directory.
    Plot {
        /// Run directory.
        directory: PathBuf,
    },
    /// Print the digest of the latest state of a run directory, or of a checkpoint.
    Digest {
        /// Run directory or checkpoint file.
        path: PathBuf,
    },
    /// Measure speed: particle-steps/s on a jammed periodic packing.
    Bench(BenchOptions),
    /// Predict the parallel efficiency on many ranks from the communication model.
    Scaling(ScalingOptions),
    /// Run cases with a known answer and compare: claim, expected, got.
    #[command(args_conflicts_with_subcommands = true)]
    Verify {
        /// Only cases with this in their name.
        filter: Option<String>,
        #[command(subcommand)]
        paper: Option<Paper>,
    },
}

/// A paper whose figures are recomputed.
#[derive(Debug, Subcommand)]
enum Paper {
    /// Recompute and draw the figures of Wahn, Gan, Kamlah 2022 and compare with what they must show.
    Wahn2022(Wahn2022Options),
    /// Recompute and draw figures of Becker, Kamlah 2021 and compare with what they must show.
    Becker2021(Becker2021Options),
}

impl InputArguments {
    fn load(&self, path: &Path) -> Result<Config> {
        config::load(path, &self.set, self.output.as_deref(), self.threads.map(usize::from))
    }
}

/// Parse the command line, do what it says, and return the exit code.
#[must_use]
pub fn main() -> i32 {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version are no errors; clap prints each to the right stream.
            return parallel(|comm| match comm.rank() {
                0 => delivered(error.print()).map(|()| error.exit_code()),
                _ => Ok(error.exit_code()),
            });
        }
    };
    let Some(command) = arguments.command else {
        // Before MPI starts, which takes its time: an unheard signal kills.
        let signals = Signals::listen();
        run::let_through();
        return parallel(|comm| run_command(comm, &arguments.run, signals));
    };
    run::let_through();
    match command {
        Command::Check { config, input } => on_first(|ranks| check(&config, &input, ranks)),
        Command::Init => on_first(|_| print(&config::example())),
        Command::Reference => on_first(|_| print(&config::reference_markdown())),
        Command::Plot { directory } => on_first(|_| {
            for file in plot::plot_run(&directory)? {
                say!("{}", file.display());
            }
            Ok(())
        }),
        Command::Bench(options) => parallel(|comm| bench::main(comm, &options).map(|()| 0)),
        Command::Scaling(options) => on_first(|_| scaling::table(&options).and_then(|table| print(&table))),
        Command::Verify { filter, paper } => alone("verify", || match &paper {
            Some(Paper::Wahn2022(options)) => verify::wahn2022::main(options),
            Some(Paper::Becker2021(options)) => verify::becker2021::main(options),
            None => Ok(verify::main(filter.as_deref())),
        }),
        Command::Digest { path } => on_first(|_| print(&checkpoint::digest_of(&path)?.to_string())),
    }
}

/// Print the sheet of an input, and refuse what its run on so many ranks would refuse before the first step.
fn check(path: &Path, input: &InputArguments, ranks: usize) -> Result<()> {
    let config = Arc::new(input.load(path)?);
    let tried = setup::trial(&config, ranks);
    let completed = tried.as_ref().ok().and_then(Option::as_ref);
    print(&config::sheet::sheet(completed.unwrap_or(&config)))?;
    tried.map(|_| ())
}

/// What rank 0 does alone, given the number of ranks, while the others wait: commands that have no use for more.
fn on_first(work: impl FnOnce(usize) -> Result<()>) -> i32 {
    parallel(|comm| if comm.rank() == 0 { work(comm.size()).map(|()| 0) } else { Ok(0) })
}

/// A command that takes its time and would let all ranks but one idle.
fn alone(name: &str, work: impl FnOnce() -> Result<i32>) -> i32 {
    parallel(|comm| match comm.size() {
        1 => work(),
        ranks => Err(Error::Input(format!(
            "`dem-mpi {name}` runs in one process, and mpirun started {ranks}; run it without mpirun"
        ))),
    })
}

/// Print what a command is there to print; if that fails, so does the command.
fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout();
    delivered(writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush()))
}

/// What became of a text for standard output. A reader that has gone (`| head`) has had enough.
fn delivered(written: std::io::Result<()>) -> Result<()> {
    written.or_else(|error| match error.kind() {
        ErrorKind::BrokenPipe => Ok(()),
        _ => Err(Error::File {
            path: "standard output".into(),
            message: format!("cannot be written ({error}); make room there, or redirect it to another place"),
        }),
    })
}

/// Print an error and give its exit code.
fn report(error: &Error) -> i32 {
    eprintln!("dem-mpi: {error}");
    if matches!(error, Error::Input(_)) { EXIT_INPUT } else { 1 }
}

/// Run on all ranks; every rank returns the largest exit code, rank 0 prints the error.
fn parallel(work: impl FnOnce(&Communicator) -> Result<i32>) -> i32 {
    let comm = match Communicator::world() {
        Ok(comm) => comm,
        Err(error) => return report(&error),
    };
    let code = match work(&comm) {
        Ok(code) => code,
        Err(error) if comm.rank() == 0 => report(&error),
        Err(error) => {
            if matches!(error, Error::Input(_)) {
                EXIT_INPUT
            } else {
                1
            }
        }
    };
    comm.sleep_until_all();
    let mut codes = [f64::from(code)];
    comm.max_f64(&mut codes);
    codes[0] as i32
}

fn run_command(comm: &Communicator, arguments: &RunArguments, signals: Result<Signals>) -> Result<i32> {
    let signals = agree(comm, signals)?;
    let Some(path) = &arguments.config else {
        return Err(Error::Input("no configuration file given; see `dem-mpi --help`".into()));
    };
    let config = Arc::new(agree(comm, arguments.input.load(path))?);
    let outcome = run::run(comm, &config, &RunOptions { restart: arguments.restart.clone() }, signals)?;
    Ok(match outcome {
        Outcome::Finished => 0,
        Outcome::Requeue => EXIT_REQUEUE,
        Outcome::Stopped(signal) => 128 + signal,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_an_error_and_a_reader_that_has_gone_is_none() {
        assert!(delivered(Ok(())).is_ok());
        assert!(delivered(Err(ErrorKind::BrokenPipe.into())).is_ok());
        let message = delivered(Err(ErrorKind::StorageFull.into())).unwrap_err().to_string();
        assert!(message.starts_with("standard output: cannot be written"), "{message}");
    }
}
