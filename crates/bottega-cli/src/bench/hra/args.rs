//! What `bottega bench hra` takes.

use std::path::PathBuf;

use clap::{Args, ValueHint};

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
pub(crate) struct HraBenchArgs {
    /// Rays, as a share of the paper's 100,000,000.
    #[arg(long, value_name = "S", default_value_t = 0.05, value_parser = parse_scale)]
    pub(crate) scale: f64,
    /// Runs of each way; the best and the worst do not count.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u16).range(3..=100))]
    pub(crate) runs: u16,
    /// Processors to keep to.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) processors: u16,
    /// Paths that are followed together: about the rays of a work unit.
    #[arg(long, value_name = "N", default_value_t = 16_384, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub(crate) batch: u32,
    /// The GPU whose name contains this takes part in a third way, and alone in a fourth.
    #[arg(long, value_name = "NAME")]
    pub(crate) gpu: Option<String>,
    /// Folder for hra.json, time lines of all resources (SVG), and what the rays show (PNG).
    #[arg(short, long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    pub(crate) output: Option<PathBuf>,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
}

fn parse_scale(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(scale) if (1e-4..=100.0).contains(&scale) => Ok(scale),
        _ => Err("a number from 0.0001 to 100 is needed".to_owned()),
    }
}
