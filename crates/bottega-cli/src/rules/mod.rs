//! `bottega rules`: checks, evaluates and draws expert rules.

mod args;
mod chart;
mod check;
mod eval;
mod plot;

use std::process::ExitCode;

pub(crate) use args::RulesArgs;
use args::RulesCommand;

use crate::error::CliError;

pub(crate) fn run(args: &RulesArgs) -> Result<ExitCode, CliError> {
    match &args.command {
        RulesCommand::Check(args) => check::run(args),
        RulesCommand::Eval(args) => eval::run(args),
        RulesCommand::Plot(args) => plot::run(args),
    }
}
