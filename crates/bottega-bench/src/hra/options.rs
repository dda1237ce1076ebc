//! Options of the measurement: what is measured, and who does the work.

use std::path::PathBuf;

/// Runs of a way: the best and the worst do not count.
pub(super) const RUNS_MIN: u16 = 3;

/// The size and the resources of the measurement.
#[derive(Clone, Debug)]
pub struct HraOptions {
    /// Rays, as a share of the paper's 100,000,000.
    pub scale: f64,
    /// Runs of each way, at least 3; the best and the worst do not count.
    pub runs: u16,
    /// Processors to keep to.
    pub processors: u16,
    /// Paths that are followed together: about the rays of a work unit.
    pub batch: u32,
    /// The GPU whose name contains this takes part in a third way, and alone in a fourth.
    pub gpu: Option<String>,
    /// Folder for `hra.json`, time lines of all resources (SVG), and what the rays show (PNG).
    pub output: Option<PathBuf>,
}

/// Who does the work.
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
