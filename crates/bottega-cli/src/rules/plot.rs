//! `bottega rules plot`: draws the terms of all variables, or an output over two inputs.

mod axes;
mod surface;
mod terms;

use std::process::ExitCode;

use surface::Surface;
use terms::Terms;

use super::{
    args::PlotArgs,
    chart::{FigureFormat, write},
};
use bottega::text::shown;

use crate::error::CliError;

pub(super) fn run(args: &PlotArgs) -> Result<ExitCode, CliError> {
    let format = FigureFormat::of(&args.output)?;
    let block = args.rules.function_block()?;
    match (&args.surface, &args.over) {
        (Some(output), Some(over)) => {
            write(&Surface::new(&block, output, over, &args.rules.values)?, format, &args.output)?;
        }
        _ if !args.rules.values.is_empty() => {
            return Err(CliError::usage(
                "values of inputs do not change their terms",
                "leave them out, or draw a surface: --surface OUTPUT --over INPUT,INPUT",
            ));
        }
        _ => write(&Terms::new(&block), format, &args.output)?,
    }
    println!("{}", shown(&args.output));
    Ok(ExitCode::SUCCESS)
}
