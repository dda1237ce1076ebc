//! `bottega bench rays`: rays and paths a second.

use std::{path::PathBuf, process::ExitCode};

use bottega_bench::rays::{RaysOptions, measure};
use clap::{Args, ValueHint};

use super::result::print;
use crate::{error::CliError, output::LogWriter};

#[derive(Debug, Args)]
pub(super) struct RaysArgs {
    /// Scenes to measure; whose paths a second are measured beside the rays of built-in ones.
    #[arg(value_hint = ValueHint::FilePath)]
    scenes: Vec<PathBuf>,
    /// Repetitions, interleaved; the median is printed.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=100))]
    repeat: u16,
    /// The GPU whose name contains this is measured too, by itself: its rays do not travel.
    #[arg(long, value_name = "NAME")]
    gpu: Option<String>,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &RaysArgs) -> Result<ExitCode, CliError> {
    let options = RaysOptions { scenes: args.scenes.clone(), repeat: args.repeat, gpu: args.gpu.clone() };
    Ok(print(&measure(&options, &mut LogWriter)?, args.json))
}
