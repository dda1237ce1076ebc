//! `bottega bench hra`: the tables of the HRA paper.

use std::{path::PathBuf, process::ExitCode};

use bottega_bench::hra::{HraOptions, measure};
use clap::{Args, ValueHint};

use super::result::print;
use crate::{error::CliError, output::LogWriter};

/// The tables of the HRA paper.
#[derive(Debug, Args)]
#[command(
    after_help = "Three ways to do the same rays: calling the primitives directly, handing them to the allocator with the \
    processors as its only resource, and with a GPU beside them. As on the paper's machines, all of it has one processor (but \
    --processors). The loop that follows paths is above the allocator; what it asks for are closest hits and occlusion of batches of \
    rays. Ways take turns; of all runs of one the best and the worst do not count. \
    Then pictures of the same scenes, by the processors, the GPU and both. For example:\n  bottega bench hra --scale 0.1\n  \
    bottega bench hra --scale 0.01 --gpu llvmpipe --processors 2 -o hra/"
)]
pub(super) struct HraBenchArgs {
    /// Rays, as a share of the paper's 100,000,000.
    #[arg(long, value_name = "S", default_value_t = 0.05, value_parser = parse_scale)]
    scale: f64,
    /// Runs of each way; the best and the worst do not count.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u16).range(3..=100))]
    runs: u16,
    /// Processors to keep to.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    processors: u16,
    /// Paths that are followed together: about the rays of a work unit.
    #[arg(long, value_name = "N", default_value_t = 16_384, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    batch: u32,
    /// The GPU whose name contains this takes part in a third way, and alone in a fourth.
    #[arg(long, value_name = "NAME")]
    gpu: Option<String>,
    /// Folder for hra.json, time lines of all resources (SVG), and what the rays show (PNG).
    #[arg(short, long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    output: Option<PathBuf>,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &HraBenchArgs) -> Result<ExitCode, CliError> {
    let options = HraOptions {
        scale: args.scale,
        runs: args.runs,
        processors: args.processors,
        batch: args.batch,
        gpu: args.gpu.clone(),
        output: args.output.clone(),
    };
    Ok(print(&measure(&options, &mut LogWriter)?, args.json))
}

fn parse_scale(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(scale) if (1e-4..=100.0).contains(&scale) => Ok(scale),
        _ => Err("a number from 0.0001 to 100 is needed".to_owned()),
    }
}
