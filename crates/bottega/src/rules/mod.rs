//! `bottega rules`: expert knowledge checked, evaluated and drawn; and read for `render --rules`.

mod args;
mod chart;
mod check;
mod eval;
mod plot;
mod source;

use std::process::ExitCode;

pub(crate) use args::RulesArgs;
use args::RulesCommand;
pub(crate) use source::{RulesText, engine_choice, experts, rule_texts};

use crate::error::CliError;

pub(crate) fn run(args: &RulesArgs) -> Result<ExitCode, CliError> {
    match &args.command {
        RulesCommand::Check(args) => check::run(args),
        RulesCommand::Eval(args) => eval::run(args),
        RulesCommand::Plot(args) => plot::run(args),
    }
}
