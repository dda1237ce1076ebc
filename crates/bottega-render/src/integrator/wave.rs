//! Waves of paths: all paths of a wave advance to their next vertex together. The caller traces their rays; a wave only
//! shades.
//!
//! Source: Pereira et al., *Efficient use of Multiple Hardware Components for Image Synthesis*, section 3.3.1: rays are
//! a low-level primitive, shading a high-level one, and the caller drives the recursion. Pictures are bit-identical to
//! those of paths traced one by one: light is added to each path in the same order.

use std::{fmt, sync::Arc};

use bottega_image::SurfaceValues;
use bottega_kernels::{
    Hit, Ray,
    compiled::{self, Task},
};
use bottega_scene::Spectrum;

use super::{
    path::{Branch, DeferredLight, PathIntegrator, SuspendedPath},
    planned::SampleIntegrators,
    record::PathRecord,
    surface::WantedSurface,
};
use crate::sampler::PixelSampler;

/// A wave of paths, one per sample, that advance together: after each step they wait for the hits of their rays.
#[derive(Clone, Default)]
pub struct Wave {
    /// Samples as (x, y, sample index).
    samples: Vec<(u32, u32, u32)>,
    paths: Vec<WavePath>,
    /// Number of paths that have not ended.
    live_count: usize,
    /// Light samples that wait for their shadow rays, with the indices of their paths.
    deferred: Vec<(u32, Spectrum)>,
    /// Records of the samples, in their order.
    records: Vec<PathRecord>,
    /// First surfaces of the samples, in their order; empty unless they are wanted and all paths have ended.
    surfaces: Vec<SurfaceValues>,
    rays: Arc<Vec<Ray>>,
    shadow_rays: Arc<Vec<Ray>>,
}

/// The results of a wave's rays, by which its paths continue.
#[derive(Clone, Debug, Default)]
pub struct WaveAnswers {
    /// Closest hits of [`Wave::rays`].
    pub hits: Vec<Hit>,
    /// For each of [`Wave::shadow_rays`]: `true` if it hits anything.
    pub occluded: Vec<bool>,
}

/// A path of a wave.
#[derive(Clone)]
struct WavePath {
    path: SuspendedPath,
    /// Index of the path's sample, and the factor of that sample.
    sample: u32,
    factor: f32,
    /// Branches that wait to be traced.
    branches: Vec<Branch>,
    stage: PathStage,
}

/// Stage of a path.
#[derive(Clone, Copy, PartialEq)]
enum PathStage {
    /// The path waits for the hit of its ray.
    Ray,
    /// The path scatters no further, and waits only for shadow rays.
    Light,
    /// The record of the path is stored. The path keeps its slot: skipping it is cheaper than moving the others.
    Ended,
}

impl Wave {
    /// Creates a wave of paths that have not started.
    pub(crate) fn new(samples: Vec<(u32, u32, u32)>) -> Self {
        Self { samples, ..Self::default() }
    }

    /// Returns the rays whose closest hits the paths wait for.
    pub fn rays(&self) -> &Arc<Vec<Ray>> {
        &self.rays
    }

    /// Returns the shadow rays whose occlusion the paths wait for.
    pub fn shadow_rays(&self) -> &Arc<Vec<Ray>> {
        &self.shadow_rays
    }

    /// Returns `true` if all paths have ended; `false` for a wave that has not started.
    pub fn is_over(&self) -> bool {
        !self.samples.is_empty() && self.live_count == 0 && self.records.len() == self.samples.len()
    }

    /// Returns the number of paths to shade next, a measure of the step's work.
    pub(crate) fn path_count(&self) -> u64 {
        if self.records.is_empty() { self.samples.len() as u64 } else { self.live_count as u64 }
    }

    /// Returns the samples, as (x, y, sample index).
    pub(crate) fn samples(&self) -> &[(u32, u32, u32)] {
        &self.samples
    }

    /// Returns the records of the samples, in their order; final once [`Self::is_over`] is `true`.
    pub(crate) fn records(&self) -> &[PathRecord] {
        &self.records
    }

    /// Returns the first surfaces of the samples, in their order; empty unless [`Self::find_surfaces`] was called.
    pub(crate) fn surfaces(&self) -> &[SurfaceValues] {
        &self.surfaces
    }

    /// Finds the first surfaces of the samples.
    pub(crate) fn find_surfaces(&mut self, integrator: &PathIntegrator<'_>, wanted: WantedSurface) {
        self.surfaces = integrator.surfaces(&self.samples, wanted);
    }

    /// Takes the results of the rays, and shades until the next rays.
    pub(crate) fn step(&mut self, integrator: &PathIntegrator<'_>, answers: &WaveAnswers) {
        compiled::run(WaveStep { wave: self, integrator, answers });
    }
}

impl fmt::Debug for Wave {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {} paths, {} rays", self.live_count, self.samples.len(), self.rays.len())
    }
}

/// One step of a wave, compiled for the vector unit.
struct WaveStep<'a> {
    wave: &'a mut Wave,
    integrator: &'a PathIntegrator<'a>,
    answers: &'a WaveAnswers,
}

impl Task for WaveStep<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { wave, integrator, answers } = self;
        let ways = integrator.ways();
        let integrators = SampleIntegrators::new(integrator, ways.as_ref(), &wave.samples);
        if integrators.ask_agents() {
            wave.advance::<true>(&integrators, answers);
        } else {
            wave.advance::<false>(&integrators, answers);
        }
    }
}

impl Wave {
    /// Takes the results of the rays, and collects the next rays.
    #[inline(always)]
    fn advance<const AGENTS: bool>(&mut self, integrators: &SampleIntegrators<'_, '_>, answers: &WaveAnswers) {
        if self.records.is_empty() {
            self.begin::<AGENTS>(integrators);
        } else {
            self.take_light(&answers.occluded);
            self.meet::<AGENTS>(integrators, &answers.hits);
        }
        // Collect the next rays
        let mut rays = Vec::with_capacity(self.live_count);
        rays.extend(self.paths.iter().filter(|it| it.stage == PathStage::Ray).map(|it| it.path.ray()));
        self.rays = Arc::new(rays);
    }

    /// Starts all paths at their camera rays.
    #[inline(always)]
    fn begin<const AGENTS: bool>(&mut self, integrators: &SampleIntegrators<'_, '_>) {
        self.records = vec![PathRecord::default(); self.samples.len()];
        let begun = self.samples.iter().zip(0..).map(|(&(x, y, index), sample)| {
            let integrator = integrators.of_pixel(x, y);
            let sampler = PixelSampler::new(integrator.settings().seed, x, y, index);
            let (ray, factor) = integrator.camera_ray(&sampler, x, y);
            // Start the path at its camera ray
            let mut path = integrator.begin(sampler, &ray, integrator.guide(), None);
            if AGENTS {
                path.expect(integrator.place(x, y));
            }
            WavePath { path: path.suspend(), sample, factor, branches: Vec::new(), stage: PathStage::Ray }
        });
        self.paths = begun.collect();
        self.live_count = self.paths.len();
    }

    /// Adds the deferred light samples that are not occluded.
    fn take_light(&mut self, occluded: &[bool]) {
        for (&(path, light), &is_occluded) in self.deferred.iter().zip(occluded) {
            if !is_occluded {
                self.paths[path as usize].path.add(light);
            }
        }
        self.deferred.clear();
    }

    /// Shades every path at the hit of its ray. Paths that ended store their records, or continue with a waiting
    /// branch.
    #[inline(always)]
    fn meet<const AGENTS: bool>(&mut self, integrators: &SampleIntegrators<'_, '_>, hits: &[Hit]) {
        // Missing hits render black without an error; the caller has already checked their number
        assert_eq!(hits.len(), self.rays.len(), "a hit for every ray");
        let mut hits = hits.iter();
        let (mut shadow_rays, mut deferred, mut lights) = (Vec::new(), Vec::new(), Vec::<DeferredLight>::new());
        // Remove ended paths only when they are more than half
        if 2 * self.live_count < self.paths.len() {
            self.paths.retain(|it| it.stage != PathStage::Ended);
        }
        for (it, at) in self.paths.iter_mut().zip(0..) {
            if it.stage == PathStage::Ended {
                continue;
            }
            let (x, y, _) = self.samples[it.sample as usize];
            let integrator = integrators.of_pixel(x, y);
            // Shade the hit
            if it.stage == PathStage::Ray {
                let Some(hit) = hits.next() else { return };
                let mut path = integrator.resume(&it.path);
                let goes_on = match path.arrive::<AGENTS>(hit) {
                    Some(point) => {
                        let guidance = path.look_up::<AGENTS>(&point);
                        path.meet::<AGENTS>(&point, guidance, &mut it.branches, &mut lights)
                    }
                    None => false,
                };
                if !goes_on {
                    it.stage = PathStage::Light;
                }
                it.path = path.suspend();
            }
            // Collect deferred light samples
            let waits = !lights.is_empty();
            for DeferredLight { ray, light, .. } in lights.drain(..) {
                shadow_rays.push(ray);
                deferred.push((at, light));
            }
            // Continue with a waiting branch, or store the record
            if it.stage == PathStage::Light && !waits {
                if let Some(branch) = it.branches.pop() {
                    it.path.go_back(branch);
                    it.stage = PathStage::Ray;
                } else {
                    self.records[it.sample as usize] = integrator.resume(&it.path).finish(it.factor);
                    it.stage = PathStage::Ended;
                    self.live_count -= 1;
                }
            }
        }
        self.deferred = deferred;
        self.shadow_rays = Arc::new(shadow_rays);
    }
}
