//! The command line of Bottega. No logic of its own: it reads options, calls the crates, and tells what happened.
#![allow(clippy::print_stdout, reason = "a command line speaks to its user")]

mod analyze;
mod bench;
mod cli;
mod clock;
mod denoise;
mod devices;
mod diff;
mod engines;
mod error;
mod farm;
mod frames;
mod info;
mod keeping;
mod method;
mod platform;
mod preview;
mod render;
mod reporter;
mod rules;
mod scene;
mod simulate;

use std::{io, process::ExitCode};

use clap::{CommandFactory, Parser};
use cli::{Cli, Command};
use error::CliError;

/// What is written to the log where nobody asks for more: who cannot link up with a server tells that himself.
const LOGGED: &str = "warn,async_nats=off";

/// Exit code of a program that was told more than somebody wanted to hear, as shells have it: 128 and SIGPIPE.
const NOBODY_LISTENS: i32 = 141;

fn main() -> ExitCode {
    end_quietly_when_nobody_listens();
    tracing_subscriber::fmt()
        .with_env_filter(tracing_subscriber::EnvFilter::try_from_env("BOTTEGA_LOG").unwrap_or_else(|_| LOGGED.into()))
        .with_writer(io::stderr)
        .init();
    engines::keep_quarantines();
    let outcome = match Cli::parse().command {
        Command::Render(args) => render::run(&args),
        Command::Analyze(args) => analyze::run(&args),
        Command::Diff(args) => diff::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Up(args) => farm::up(&args),
        Command::Join(args) => farm::join(&args),
        Command::Jobs(args) => farm::jobs(&args),
        Command::Machines(args) => farm::machines(&args),
        Command::Engines(args) => engines::run(&args),
        Command::Rules(args) => rules::run(&args),
        Command::Platform(args) => platform::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Devices(args) => devices::run(&args),
        Command::Completions { shell } => {
            clap_complete::generate(shell, &mut Cli::command(), "bottega", &mut io::stdout());
            Ok(ExitCode::SUCCESS)
        }
    };
    outcome.unwrap_or_else(report)
}

/// Tells what went wrong. 2 is for what was asked wrongly, 1 for what failed.
fn report(error: CliError) -> ExitCode {
    let code = if error.is_usage() { 2 } else { 1 };
    eprintln!("{:?}", miette::Report::new(error));
    ExitCode::from(code)
}

/// `bottega jobs list | head -1` ends the reader first: that is no fault of anybody's. The standard library panics then.
fn end_quietly_when_nobody_listens() {
    let tell = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let words = panic.payload().downcast_ref::<String>();
        if words.is_some_and(|words| words.starts_with("failed printing to std") && words.contains("Broken pipe")) {
            std::process::exit(NOBODY_LISTENS);
        }
        tell(panic);
    }));
}
