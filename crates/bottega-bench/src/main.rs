//! Measurements: the tables of the papers with the papers' own results, rays and paths per second, other renderers on the same
//! triangles, a farm of many agents. `cargo run --release -p bottega-bench -- --help`.
//!
//! Every measurement has one struct of options, which the command line fills in, and returns a report. The report starts with a
//! header: commit, command and machine. Progress goes to standard error, one line per step.
//!
//! # Modules
//!
//! | subject | files |
//! |---|---|
//! | rays per second: ours, Embree's, those of `obvhs`, a GPU's; paths per second | `src/rays.rs`, `src/rays/` |
//! | the three papers | `src/hra/`, `src/magarro/`, `src/ala/` |
//! | error and time of several renderers, and the scenes that all of them read | `src/peers.rs`, `src/neutral_scene.rs` |
//! | the overhead of rendering in zones with an external engine | `src/engines.rs` |
//! | the gain of path guiding | `src/guide/` |
//! | the accuracy of time forecasts in a second job | `src/learning.rs` |
//! | time and memory over the size of the work | `src/scale/` |
//! | awards per second, on a real NATS server | `src/farm/` |
//! | measurements and reports; the header of a run | `src/report.rs` |
//! | options shared by several measurements | `src/arguments.rs` |
//! | generated scenes, and their random numbers | `src/scenes.rs`, `src/random.rs` |
//! | rendering shared by several measurements | `src/painting.rs` |
//! | child processes of a measurement | `src/part_process.rs` |
//! | output files, loading of scenes; errors and their remedies | `src/files.rs`, `src/error.rs` |

mod ala;
mod arguments;
mod engines;
mod error;
mod farm;
mod files;
mod guide;
mod hra;
mod learning;
mod magarro;
mod neutral_scene;
mod painting;
mod part_process;
mod peers;
mod random;
mod rays;
mod report;
mod scale;
mod scenes;

use std::{
    env,
    error::Error as _,
    io::{self, Write},
    process::ExitCode,
};

use clap::{Parser, Subcommand};
use tracing_subscriber::{filter::Targets, layer::SubscriberExt, util::SubscriberInitExt};

use self::{
    ala::AlaOptions,
    engines::EnginesOptions,
    error::Error,
    farm::{FarmOptions, PartOptions},
    guide::GuideOptions,
    hra::HraOptions,
    learning::LearningOptions,
    magarro::{MagarroOptions, SecondAgentOptions},
    peers::PeersOptions,
    rays::RaysOptions,
    report::{Measurement, head, headed},
    scale::ScaleOptions,
};

/// The default log filter.
const LOGGED: &str = "warn,async_nats=off";

/// Measures bottega: on this machine, at the commit that this program was built from.
#[derive(Debug, Parser)]
#[command(name = "bottega-bench")]
struct BenchProgram {
    /// Print one JSON object instead of text for people.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: BenchCommand,
}

#[derive(Debug, Subcommand)]
enum BenchCommand {
    Rays(RaysOptions),
    Peers(PeersOptions),
    Engines(EnginesOptions),
    Farm(FarmOptions),
    Hra(HraOptions),
    Magarro(MagarroOptions),
    Learning(LearningOptions),
    Guide(GuideOptions),
    Ala(AlaOptions),
    Scale(ScaleOptions),
    #[command(hide = true)]
    FarmPart(PartOptions),
    #[command(hide = true)]
    MagarroPart(SecondAgentOptions),
}

fn main() -> ExitCode {
    start_log();
    let program = BenchProgram::parse();
    bottega::engines::keep_quarantines();
    let done = run(&program);
    // Drivers shut down more reliably before the process exits.
    bottega::devices::release();
    done.map_or_else(|error| tell(&error), |()| ExitCode::SUCCESS)
}

fn start_log() {
    let level = env::var("BOTTEGA_LOG").ok().and_then(|level| level.parse::<Targets>().ok());
    let filter = level.unwrap_or_else(|| LOGGED.parse().unwrap_or_default());
    let lines = tracing_subscriber::fmt::layer().with_writer(io::stderr);
    tracing_subscriber::registry().with(filter).with(lines).init();
}

fn run(program: &BenchProgram) -> Result<(), Error> {
    let measurement: &dyn Measurement = match &program.command {
        BenchCommand::Rays(options) => options,
        BenchCommand::Peers(options) => options,
        BenchCommand::Engines(options) => options,
        BenchCommand::Farm(options) => options,
        BenchCommand::Hra(options) => options,
        BenchCommand::Magarro(options) => options,
        BenchCommand::Learning(options) => options,
        BenchCommand::Guide(options) => options,
        BenchCommand::Ala(options) => options,
        BenchCommand::Scale(options) => options,
        BenchCommand::FarmPart(options) => return options.run(&mut io::stdout()),
        BenchCommand::MagarroPart(options) => return options.run(&mut io::stdout()),
    };
    let head = head();
    if !program.json {
        print(&format!("{head}\n"))?;
    }
    let report = measurement.measure(&mut io::stderr())?;
    print(&if program.json { format!("{}\n", headed(&*report)) } else { report.as_text() })
}

fn print(text: &str) -> Result<(), Error> {
    let mut output = io::stdout().lock();
    output.write_all(text.as_bytes()).and_then(|()| output.flush()).map_err(Error::Output)
}

/// Prints an error with its causes and remedy.
fn tell(error: &Error) -> ExitCode {
    let mut text = format!("error: {error}\n");
    let mut next = error.source();
    while let Some(cause) = next {
        text += &format!("  because: {cause}\n");
        next = cause.source();
    }
    if let Some(remedy) = error.remedy() {
        text += &format!("  help: {remedy}\n");
    }
    // If standard error is closed, the exit code remains.
    _ = io::stderr().write_all(text.as_bytes());
    ExitCode::from(error.exit_code())
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        BenchProgram::command().debug_assert();
    }
}
