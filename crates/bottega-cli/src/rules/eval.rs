//! `bottega rules eval`: evaluates rules and explains the result.

use std::process::ExitCode;

use bottega::rules::{explained, inputs};
use bottega_fuzzy::{EvaluateError, FunctionBlock};

use super::args::EvalArgs;
use crate::error::CliError;

pub(super) fn run(args: &EvalArgs) -> Result<ExitCode, CliError> {
    let block = args.rules.function_block()?;
    let values: Vec<(&str, f64)> = args.rules.values.iter().map(|(name, value)| (name.as_str(), *value)).collect();
    let why = block.explain(&values).map_err(|error| unusable(&block, &error))?;
    if args.json {
        println!("{}", explained(&block, &why, args.explain));
    } else if args.explain {
        print!("{why}");
    } else {
        for (output, value) in block.outputs().iter().zip(why.outputs.values()) {
            println!("{} = {}", output.name, value.map_or("no value".to_owned(), |value| value.to_string()));
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the error for values that do not fit the inputs.
pub(super) fn unusable(block: &FunctionBlock, error: &EvaluateError) -> CliError {
    CliError::usage(error.to_string(), format!("give a value, as INPUT=VALUE, to each of {}", inputs(block)))
}
