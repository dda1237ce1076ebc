//! Path tracing of several samples in turn: while one path waits for memory, others are shaded.

use std::slice;

use bottega_image::SampleValues;
use bottega_kernels::{
    Hit,
    compiled::{self, Task},
};

use super::{
    group_sums::{GroupBuffer, GroupSumsOfPaths},
    path::{BRANCHES_MAX, Branch, DeferredLight, Guidance, Path, PathIntegrator},
    planned::SampleIntegrators,
    record::PathRecord,
};
use crate::{
    interaction::{self, Interaction},
    prepare::PreparedScene,
    sampler::PixelSampler,
};

/// Number of paths in flight.
const LANES: usize = 8;

/// A list of samples to trace.
pub(crate) struct SampleBatch<'a> {
    /// Integrator of the picture; its plan may pick another one per pixel.
    pub(crate) integrator: &'a PathIntegrator<'a>,
    /// Samples as (x, y, sample index).
    pub(crate) samples: &'a [(u32, u32, u32)],
    /// Receives the records, in the order of `samples`.
    pub(crate) records: &'a mut Vec<PathRecord>,
    /// Receives the light of the samples by groups of lights, if it is wanted.
    pub(crate) groups: Option<GroupBuffer<'a>>,
}

/// A path in flight.
struct PathLane<'a> {
    path: Path<'a>,
    /// Index of the path's sample, and the factor of that sample.
    sample: usize,
    factor: f32,
    hit: Hit,
    /// The interaction at the hit; `None`: the path ends there.
    point: Option<Interaction>,
    /// Learned data at the point.
    guidance: Guidance<'a>,
    /// Branches that wait to be traced.
    branches: Vec<Branch>,
    /// Light samples of the current vertex that wait for their shadow rays.
    deferred: Vec<DeferredLight>,
    /// `true`: the path continues from its current vertex.
    goes_on: bool,
}

impl Task for SampleBatch<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { integrator, samples, records, groups } = self;
        records.clear();
        let mut groups = groups.map(|groups| groups.of_paths(samples.len()));
        if integrator.goes_alone() {
            records.extend(samples.iter().map(|&(x, y, sample)| {
                let groups = groups.as_mut().and_then(Iterator::next);
                integrator.trace_volume(x, y, sample, integrator.catcher_role(), groups)
            }));
            return;
        }
        // Find the integrator of each sample's zone
        let ways = integrator.ways();
        let integrators = SampleIntegrators::new(integrator, ways.as_ref(), samples);
        if integrators.ask_agents() {
            paint::<true>(&integrators, samples, records, groups);
        } else {
            paint::<false>(&integrators, samples, records, groups);
        }
    }
}

impl PathIntegrator<'_> {
    /// Traces one sample of the pixel (x, y) of the whole picture, and returns its values. Radiance that is not finite
    /// counts as 0.
    pub fn sample(&self, x: u32, y: u32, sample_index: u32) -> SampleValues {
        let mut records = Vec::new();
        let samples = &[(x, y, sample_index)];
        compiled::run(SampleBatch { integrator: self, samples, records: &mut records, groups: None });
        records.first().copied().unwrap_or_default().values
    }
}

/// Traces all samples.
#[inline(always)]
fn paint<const AGENTS: bool>(
    integrators: &SampleIntegrators<'_, '_>,
    samples: &[(u32, u32, u32)],
    records: &mut Vec<PathRecord>,
    groups: Option<GroupSumsOfPaths<'_>>,
) {
    let Some(&(x, y, _)) = samples.first() else { return };
    let prepared = integrators.of_pixel(x, y).prepared();
    records.resize(samples.len(), PathRecord::default());
    in_turn::<AGENTS>(prepared, CameraPaths::<AGENTS> { integrators, samples: samples.iter(), groups }, records);
}

/// The paths of some samples, which start at the camera. Not a closure: it is called in two places, and functions that
/// are not inlined are compiled without the vector unit.
struct CameraPaths<'a, 'b, const AGENTS: bool> {
    integrators: &'a SampleIntegrators<'a, 'b>,
    samples: slice::Iter<'a, (u32, u32, u32)>,
    groups: Option<GroupSumsOfPaths<'a>>,
}

impl<'a, const AGENTS: bool> Iterator for CameraPaths<'a, '_, AGENTS> {
    type Item = (Path<'a>, f32);

    #[inline(always)]
    fn next(&mut self) -> Option<(Path<'a>, f32)> {
        let &(x, y, index) = self.samples.next()?;
        let integrator = self.integrators.of_pixel(x, y);
        let sampler = PixelSampler::new(integrator.settings().seed, x, y, index);
        let (ray, factor) = integrator.camera_ray(&sampler, x, y);
        let mut path = integrator.begin(sampler, &ray, integrator.guide(), None);
        path.groups = self.groups.as_mut().and_then(Iterator::next);
        if AGENTS {
            path.expect(integrator.place(x, y));
        }
        Some((path, factor))
    }
}

/// Traces paths, each with the factor of its sample, [`LANES`] at a time.
///
/// - `records`: receives the records of the paths, in their order.
#[inline(always)]
pub(super) fn in_turn<'a, const AGENTS: bool>(
    prepared: &PreparedScene,
    mut waiting: impl Iterator<Item = (Path<'a>, f32)>,
    records: &mut [PathRecord],
) {
    let mut lanes: Vec<PathLane<'_>> = Vec::with_capacity(LANES);
    let mut started = 0;
    while lanes.len() < LANES
        && let Some((path, factor)) = waiting.next()
    {
        let branches = if AGENTS { Vec::with_capacity(BRANCHES_MAX) } else { Vec::new() };
        lanes.push(PathLane {
            path,
            sample: started,
            factor,
            hit: Hit::NONE,
            point: None,
            guidance: Guidance::NONE,
            branches,
            deferred: Vec::new(),
            goes_on: true,
        });
        started += 1;
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
        // Compute the interactions at all hits, then look up the guide
        for lane in &mut lanes {
            lane.point = lane.path.arrive::<AGENTS>(&lane.hit);
        }
        for lane in &mut lanes {
            if let Some(point) = &lane.point {
                lane.guidance = lane.path.look_up::<AGENTS>(point);
            }
        }
        // Shade all vertices
        for PathLane { path, point, guidance, branches, deferred, goes_on, .. } in &mut lanes {
            *goes_on = match point {
                Some(point) => path.meet::<AGENTS>(point, *guidance, branches, deferred),
                None => false,
            };
        }
        // Trace all shadow rays, and add the light that is visible
        for lane in &mut lanes {
            for light in &lane.deferred {
                lane.path.add_if_visible(light);
            }
            lane.deferred.clear();
        }
        // Go on in each lane
        let mut i = 0;
        while i < lanes.len() {
            let lane = &mut lanes[i];
            if lane.goes_on {
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
            records[lane.sample] = lane.path.finish(lane.factor);
            if let Some((path, factor)) = waiting.next() {
                (lane.path, lane.sample, lane.factor) = (path, started, factor);
                started += 1;
                i += 1;
            } else {
                lanes.swap_remove(i);
            }
        }
    }
}
