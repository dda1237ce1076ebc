//! `bottega engines`: lists, checks and tries external engines.

mod args;
mod attempt;
mod list;

use std::process::ExitCode;

pub(crate) use args::EnginesArgs;
use args::EnginesCommand;

use crate::error::CliError;

pub(crate) fn run(args: &EnginesArgs) -> Result<ExitCode, CliError> {
    match &args.command {
        EnginesCommand::List(args) => list::list(args),
        EnginesCommand::Check(args) => list::check(args),
        EnginesCommand::Try(args) => attempt::run(args),
        EnginesCommand::Release(args) => list::release(args),
    }
}
