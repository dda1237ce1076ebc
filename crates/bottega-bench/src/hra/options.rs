//! Options of the measurement.

use std::path::PathBuf;

use clap::Args;

use crate::arguments::number;

/// The tables of the HRA paper: rays by direct calls, through the allocator, and with a GPU beside the processors.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Three ways to do the same rays: calling the primitives directly, handing them to the allocator with the \
    processors as its only resource, and with a GPU beside them. As on the paper's machines, all of it has one processor (but \
    --processors). The loop that follows paths is above the allocator; what it asks for are closest hits and occlusion of batches of \
    rays. Ways take turns; of all runs of one the best and the worst do not count. \
    Then pictures of the same scenes, by the processors, the GPU and both. For example:\n  bottega-bench hra --scale 0.1\n  \
    bottega-bench hra --scale 0.01 --gpu llvmpipe --processors 2 -o hra/"
)]
pub(crate) struct HraOptions {
    /// Rays, as a share of the paper's 100,000,000.
    #[arg(long, value_name = "S", default_value_t = 0.05, value_parser = number(1e-4, 100.0))]
    pub(super) scale: f64,
    /// Runs of each way; the best and the worst do not count.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u16).range(3..=100))]
    pub(super) runs: u16,
    /// Processors to keep to.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(super) processors: u16,
    /// Paths that are followed together: about the rays of a work unit.
    #[arg(long, value_name = "N", default_value_t = 16_384, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub(super) batch: u32,
    /// The GPU whose name contains this takes part in a third way, and alone in a fourth.
    #[arg(long, value_name = "NAME")]
    pub(super) gpu: Option<String>,
    /// Folder for hra.json, time lines of all resources (SVG), and what the rays show (PNG).
    #[arg(short, long, value_name = "FOLDER")]
    pub(super) output: Option<PathBuf>,
}

/// The division of work between processors and GPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WorkDivision {
    Direct,
    Cpu,
    CpuAndGpu,
    Gpu,
}

impl WorkDivision {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Direct => "CPU without HRA",
            Self::Cpu => "CPU with HRA",
            Self::CpuAndGpu => "CPU+GPU with HRA",
            Self::Gpu => "GPU with HRA",
        }
    }

    pub(super) fn key(self) -> &'static str {
        match self {
            Self::Direct => "direct",
            Self::Cpu => "hra-cpu",
            Self::CpuAndGpu => "hra-cpu-gpu",
            Self::Gpu => "hra-gpu",
        }
    }
}
