//! The command line of Bottega. It has no logic of its own: it parses options, calls the crates, and prints results.
//!
//! # Modules
//!
//! | subject | files |
//! |---|---|
//! | options, and their conversion to a request | `src/cli.rs`, `src/cli/render.rs`, `src/cli/scene.rs`, `src/cli/engine.rs` |
//! | the request fields that have an option; their help | `src/cli/fields.rs` |
//! | reading requests; converting a request to options | `src/cli/request.rs`, `src/cli/words.rs` |
//! | `render`, `request` | `src/render.rs`, `src/request.rs` |
//! | the progress bar, lines of text and JSON, the trace | `src/console_watcher.rs` |
//! | standard output and standard error | `src/output.rs` |
//! | display of errors | `src/error.rs` |
//! | `-h`; groups of commands; suggestions for unknown words | `src/short_help.rs`; `src/command_groups.rs`; `src/suggestions.rs` |
//! | the configuration file, environment variables | `src/config/`, `src/variables.rs` |
//! | prices, watts; values of options that several commands share | `src/energy_values.rs`; `src/option_value.rs` |
//! | Ctrl-C; the start time of the process | `src/signals.rs`; `src/process_start.rs` |
//! | `--on`: notifications of ends and stalls | `src/notifications/` |
//! | `analyze`; drawings of useful data density; accuracy of predicted times | `src/analyze.rs`; `src/analyze/ludd.rs`, `src/analyze/verify.rs` |
//! | `diff`, `info` | `src/diff.rs`, `src/info.rs` |
//! | `up`, `web`, `join`, `jobs`, `machines`; the options that select a farm | `src/farm/`; `src/farm_args.rs` |
//! | `engines` | `src/engines/` |
//! | `rules` | `src/rules/` |
//! | `devices` | `src/devices.rs` |
//! | `simulate` | `src/simulate/` |
//! | `platform`: serving one, queries to any | `src/platform/` |
//! | `manual`: man pages, the reference pages of the manual | `src/manual/` |
//! | tests of the whole program, including a farm of real processes | `tests/`, `tests/farm/` |
#![deny(clippy::print_stdout, clippy::print_stderr)]

// First, so that `println!` and similar macros are those of this crate.
#[macro_use]
mod output;

mod analyze;
mod board;
mod cli;
mod command_groups;
mod config;
mod console_watcher;
mod devices;
mod diff;
mod energy_values;
mod engines;
mod error;
mod farm;
mod farm_args;
mod info;
mod manual;
mod notifications;
mod option_value;
mod platform;
mod process_start;
mod render;
mod request;
mod rules;
mod short_help;
mod signals;
mod simulate;
mod suggestions;
mod variables;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches};
use cli::{Cli, Command};
use error::CliError;
use output::Purpose;
use tracing_subscriber::{filter::Targets, layer::SubscriberExt, util::SubscriberInitExt};

/// The default log filter; connection errors of NATS are reported by their callers.
const LOGGED: &str = "warn,async_nats=off";

fn main() -> ExitCode {
    process_start::process_start();
    start_log();
    let command = match command_line() {
        Ok(Ok(cli)) => cli.command,
        Ok(Err(usage)) => return output::print_usage(&usage),
        Err(error) => return output::finish(report(&error)),
    };
    output::begin(purpose(&command));
    bottega::engines::keep_quarantines();
    let code = run(command).unwrap_or_else(|error| report(&error));
    // Drivers shut down more reliably before the process exits.
    bottega::devices::release();
    output::finish(code)
}

/// Starts logging to standard error. `BOTTEGA_LOG` sets the filter: a level, or levels per target (`warn,bottega_farm=debug`).
fn start_log() {
    let setting = std::env::var("BOTTEGA_LOG").ok().filter(|setting| !setting.is_empty());
    let targets = setting.as_deref().map(str::parse::<Targets>).transpose();
    let filter = targets.as_ref().ok().cloned().flatten().unwrap_or_else(|| LOGGED.parse().unwrap_or_default());
    let lines = tracing_subscriber::fmt::layer().with_writer(|| output::LogWriter).with_ansi(output::has_colors());
    tracing_subscriber::registry().with(filter).with(lines).init();
    if let Err(error) = targets {
        tracing::warn!(
            "BOTTEGA_LOG is not a filter ({error}): `{LOGGED}` is used; it may be `info` or `warn,bottega_farm=debug`"
        );
    }
}

/// Reads the command line, the environment and the configuration file.
fn command_line() -> Result<Result<Cli, clap::Error>, CliError> {
    let program = variables::with_variables(short_help::fitting(Cli::command()));
    let words = config::with_config(std::env::args_os().collect(), &program)?;
    let matches = program.clone().try_get_matches_from(&words);
    let matches = matches.map_err(|error| suggestions::by_meaning(error, &program, &words));
    Ok(matches.and_then(|matches| Cli::from_arg_matches(&matches)))
}

/// Returns the purpose of a command's standard output.
fn purpose(command: &Command) -> Purpose {
    match command {
        Command::Render(args) if args.request.dry_run => Purpose::Result,
        Command::Render(args) if args.scene.json => Purpose::Events,
        Command::Render(_) | Command::Up(_) | Command::Web(_) | Command::Join(_) | Command::Board(_) => Purpose::Log,
        Command::Platform(args) => args.purpose(),
        _ => Purpose::Result,
    }
}

fn run(command: Command) -> Result<ExitCode, CliError> {
    match command {
        Command::Render(args) => render::run(&args),
        Command::Request(args) => request::run(&args),
        Command::Analyze(args) => analyze::run(&args),
        Command::Diff(args) => diff::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Up(args) => farm::up(&args),
        Command::Web(args) => farm::web(&args),
        Command::Join(args) => farm::join(&args),
        Command::Jobs(args) => farm::jobs(&args),
        Command::Blackboard(args) => farm::blackboard(&args),
        Command::Machines(args) => farm::machines(&args),
        Command::Tokens(args) => farm::tokens(&args),
        Command::Engines(args) => engines::run(&args),
        Command::Rules(args) => rules::run(&args),
        Command::Platform(args) => platform::run(&args),
        Command::Devices(args) => devices::run(&args),
        Command::Board(args) => board::run(&args),
        Command::Config(args) => config::run(&args, &Cli::command()),
        Command::Manual(args) => manual::run(&args, Cli::command()),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "bottega", &mut script);
            print!("{}", String::from_utf8_lossy(&script));
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// Prints an error. Returns exit code 2 for usage errors, 1 for failures.
fn report(error: &CliError) -> ExitCode {
    let code = if error.is_usage() { 2 } else { 1 };
    output::print_report(&error::report(error));
    ExitCode::from(code)
}
