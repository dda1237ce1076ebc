//! The results of all methods on both scenes.

use bottega_hra::{HraReport, ResourceReport};

use super::options::WorkDivision;

/// The resources of an allocator: name, share of time with work, number of units.
pub(super) type Occupation = Vec<(String, f64, u64)>;

/// The times of all methods on both scenes.
pub(super) struct HraBenchReport {
    pub(super) processors: u16,
    /// True if the system restricted the program to these processors.
    pub(super) is_kept: bool,
    pub(super) batch: u32,
    pub(super) rows: Vec<RayRow>,
    pub(super) blocks: Vec<BlockRow>,
}

/// The ray results of one scene.
pub(super) struct RayRow {
    pub(super) scene: &'static str,
    pub(super) kind: &'static str,
    pub(super) paths: u64,
    /// Number of rays, as counted by the processors.
    pub(super) rays: u64,
    pub(super) columns: Vec<RayColumn>,
}

/// The ray results of one method.
pub(super) struct RayColumn {
    pub(super) way: WorkDivision,
    /// Seconds of all runs, in order.
    pub(super) seconds: Vec<f64>,
    /// The resources of the last run.
    pub(super) resources: Occupation,
}

impl RayColumn {
    /// Returns the mean without the best and the worst: the paper's *average − max − min*.
    pub(super) fn average(&self) -> f64 {
        average(&self.seconds)
    }

    /// Returns the range from the best run to the worst, in seconds.
    pub(super) fn range(&self) -> f64 {
        range(&self.seconds)
    }
}

/// The block results of one scene.
pub(super) struct BlockRow {
    pub(super) scene: &'static str,
    pub(super) kind: &'static str,
    pub(super) columns: Vec<BlockColumn>,
}

/// The block results of one method.
pub(super) struct BlockColumn {
    pub(super) way: WorkDivision,
    /// Samples per second of all runs, in order.
    pub(super) samples_per_second: Vec<f64>,
    /// The resources of the last run.
    pub(super) resources: Occupation,
}

impl BlockColumn {
    /// Returns the mean without the best and the worst.
    pub(super) fn average(&self) -> f64 {
        average(&self.samples_per_second)
    }

    /// Returns the range from the worst run to the best.
    pub(super) fn range(&self) -> f64 {
        range(&self.samples_per_second)
    }
}

impl BlockRow {
    /// Returns the throughput of both together, relative to the sum of each alone.
    pub(super) fn share_of_sum(&self) -> Option<f64> {
        let rate = |way| self.columns.iter().find(|column| column.way == way).map(BlockColumn::average);
        Some(rate(WorkDivision::CpuAndGpu)? / (rate(WorkDivision::Cpu)? + rate(WorkDivision::Gpu)?))
    }
}

/// Returns the mean without the least and the greatest value.
fn average(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let kept = &sorted[1..sorted.len() - 1];
    kept.iter().sum::<f64>() / kept.len() as f64
}

/// Returns the greatest value minus the least.
fn range(values: &[f64]) -> f64 {
    let (least, greatest) = values
        .iter()
        .fold((f64::INFINITY, 0.0_f64), |(least, greatest), value| (least.min(*value), greatest.max(*value)));
    (greatest - least).max(0.0)
}

/// Returns the occupation of each resource.
pub(super) fn occupation(report: &HraReport) -> Occupation {
    let share = |resource: &ResourceReport| {
        let busy = resource.busy.as_secs_f64() / report.uptime.as_secs_f64().max(1e-9);
        (resource.descriptor.name.clone(), busy, resource.units)
    };
    report.resources.iter().map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_and_the_worst_are_in_the_range_and_not_in_the_average() {
        let runs = [3.0, 1.0, 9.0, 2.0, 4.0];
        assert_eq!((average(&runs), range(&runs)), (3.0, 8.0));
    }
}
