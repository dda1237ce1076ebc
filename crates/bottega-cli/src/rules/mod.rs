//! `bottega rules`: expert knowledge checked, evaluated and drawn.

mod args;
mod chart;
mod check;
mod eval;
mod plot;

use std::process::ExitCode;

pub(crate) use args::RulesArgs;
use args::{LaidOutArgs, RulesCommand};

use bottega::rules::{Source, inputs};
use bottega_fuzzy::FunctionBlock;

use crate::error::CliError;

pub(crate) fn run(args: &RulesArgs) -> Result<ExitCode, CliError> {
    match &args.command {
        RulesCommand::Check(args) => check::run(args),
        RulesCommand::Eval(args) => eval::run(args),
        RulesCommand::Plot(args) => plot::run(args),
    }
}

/// A function block with its inputs laid out as the user says.
fn laid_out(args: &LaidOutArgs) -> Result<FunctionBlock, CliError> {
    let source = Source::read(&args.file)?;
    let mut block = source.block(args.block.as_deref())?.clone();
    let inputs = inputs(&block);
    for (name, min, max) in &args.ranges {
        block
            .layout_inputs(name, *min, *max)
            .map_err(|error| CliError::usage(error.to_string(), format!("the inputs are {inputs}")))?;
    }
    Ok(block)
}
