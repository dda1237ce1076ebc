//! Path tracing of several samples in turn: while one path waits for memory, others are shaded.

use bottega_image::SampleValues;
use bottega_kernels::{
    Hit,
    compiled::{self, Task},
};

use super::{
    path::{BRANCHES_MAX, Branch, Path, PathIntegrator},
    planned::SampleIntegrators,
    record::PathRecord,
};
use crate::{interaction, sampler::PixelSampler};

/// Number of paths in flight.
const LANES: usize = 8;

/// A list of samples to trace.
pub(crate) struct Painting<'a> {
    /// Integrator of the picture; its plan may pick another one per pixel.
    pub(crate) integrator: &'a PathIntegrator<'a>,
    /// Samples as (x, y, sample index).
    pub(crate) samples: &'a [(u32, u32, u32)],
    /// Receives the records, in the order of `samples`.
    pub(crate) records: &'a mut Vec<PathRecord>,
}

/// A path in flight.
struct PathLane<'a> {
    path: Path<'a>,
    /// Index of the path's sample, and the factor of that sample.
    sample: usize,
    factor: f32,
    hit: Hit,
    /// Branches that wait to be traced.
    branches: Vec<Branch>,
}

impl Task for Painting<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { integrator, samples, records } = self;
        records.clear();
        if integrator.goes_alone() {
            records.extend(samples.iter().map(|&(x, y, sample)| integrator.trace_volume(x, y, sample)));
            return;
        }
        // Find the integrator of each sample's zone
        let ways = integrator.ways();
        let integrators = SampleIntegrators::new(integrator, ways.as_ref(), samples);
        if integrators.ask_agents() {
            in_turn::<true>(&integrators, samples, records);
        } else {
            in_turn::<false>(&integrators, samples, records);
        }
    }
}

impl PathIntegrator<'_> {
    /// Traces sample `sample_index` of the pixel (x, y). Radiance that is not finite counts as 0.
    pub fn sample(&self, x: u32, y: u32, sample_index: u32) -> SampleValues {
        let mut records = Vec::new();
        compiled::run(Painting { integrator: self, samples: &[(x, y, sample_index)], records: &mut records });
        records.first().copied().unwrap_or_default().values
    }
}

/// Traces all samples, [`LANES`] paths at a time.
#[inline(always)]
fn in_turn<const AGENTS: bool>(
    integrators: &SampleIntegrators<'_, '_>,
    samples: &[(u32, u32, u32)],
    records: &mut Vec<PathRecord>,
) {
    let Some(&(x, y, _)) = samples.first() else { return };
    let prepared = integrators.of_pixel(x, y).prepared();
    records.resize(samples.len(), PathRecord::default());
    // Generate the camera rays lazily, one per sample
    let mut waiting = samples.iter().zip(0..).map(|(&(x, y, index), sample)| {
        let integrator = integrators.of_pixel(x, y);
        let sampler = PixelSampler::new(integrator.settings().seed, x, y, index);
        let (ray, factor) = integrator.camera_ray(&sampler, x, y);
        let mut path = integrator.begin(sampler, &ray, integrator.guide(), None);
        if AGENTS {
            path.expect(integrator.place(x, y));
        }
        (path, sample, factor)
    });
    let mut lanes: Vec<PathLane<'_>> = Vec::with_capacity(LANES);
    for (path, sample, factor) in waiting.by_ref().take(LANES) {
        let branches = if AGENTS { Vec::with_capacity(BRANCHES_MAX) } else { Vec::new() };
        lanes.push(PathLane { path, sample, factor, hit: Hit::NONE, branches });
    }
    while !lanes.is_empty() {
        // Intersect all rays, prefetching first triangles, then vertices and the guide
        for lane in &mut lanes {
            lane.hit = lane.path.intersect();
            interaction::request_triangle(prepared, &lane.hit);
        }
        for lane in &lanes {
            interaction::request_vertices(prepared, &lane.hit);
            lane.path.request_guide(&lane.hit);
        }
        // Shade all hits
        let mut i = 0;
        while i < lanes.len() {
            let lane = &mut lanes[i];
            if lane.path.meet::<AGENTS, false>(&lane.hit, &mut lane.branches, &mut Vec::new()) {
                i += 1;
                continue;
            }
            // Continue with a waiting branch
            if AGENTS && let Some(branch) = lane.branches.pop() {
                lane.path.go_back(&branch);
                i += 1;
                continue;
            }
            // Store the record, and start the next sample in this lane
            records[lane.sample] = lane.path.finish().scaled(lane.factor);
            if let Some((path, sample, factor)) = waiting.next() {
                (lane.path, lane.sample, lane.factor) = (path, sample, factor);
                i += 1;
            } else {
                lanes.swap_remove(i);
            }
        }
    }
}
