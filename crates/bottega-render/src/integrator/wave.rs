//! Waves of paths: all of them come to their next surface together. What their rays meet is asked of whoever follows rays;
//! shading is what remains. The loop above asks for the one and then for the other.
//!
//! Source: Pereira et al., *Efficient use of Multiple Hardware Components for Image Synthesis*, section 3.3.1: rays are a
//! low-level primitive, shading a high-level one, and the recursion is the caller's. The bits of a picture are those of
//! paths that are followed one by one: what is added to a path is added in the same order.

use std::{fmt, sync::Arc};

use bottega_kernels::{
    Hit, Ray,
    compiled::{self, Task},
};
use bottega_scene::Spectrum;

use super::{
    path::{Branch, DeferredLight, PathIntegrator, SuspendedPath},
    planned::SampleIntegrators,
    record::PathRecord,
};
use crate::sampler::PixelSampler;

/// Paths that are followed together, one for each of some samples.
#[derive(Clone, Default)]
pub struct Wave {
    /// Pixels, each with the index of a sample.
    samples: Vec<(u32, u32, u32)>,
    paths: Vec<WavePath>,
    /// Paths that have not ended.
    live_count: usize,
    /// Light that waits for its ray, and which path it is for.
    deferred: Vec<(u32, Spectrum)>,
    /// What came of the samples, in their order.
    records: Vec<PathRecord>,
    rays: Arc<Vec<Ray>>,
    shadow_rays: Arc<Vec<Ray>>,
}

/// The answers to the rays of a wave.
#[derive(Clone, Debug, Default)]
pub struct WaveAnswers {
    /// For each of [`Wave::rays`].
    pub hits: Vec<Hit>,
    /// For each of [`Wave::shadow_rays`].
    pub occluded: Vec<bool>,
}

#[derive(Clone)]
struct WavePath {
    path: SuspendedPath,
    /// Which of the samples it is, and the factor with which it counts.
    sample: u32,
    factor: f32,
    /// Parts of it that wait.
    branches: Vec<Branch>,
    stage: PathStage,
}

/// How far a path is.
#[derive(Clone, Copy, PartialEq)]
enum PathStage {
    /// Its ray is asked for.
    Ray,
    /// It goes no further, and waits for light alone.
    Light,
    /// Its record is there. It stays in its place, for to move the others costs more than to pass it by.
    Ended,
}

impl Wave {
    /// Paths that are to begin.
    pub(crate) fn new(samples: Vec<(u32, u32, u32)>) -> Self {
        Self { samples, ..Self::default() }
    }

    /// Rays whose closest hits are wanted.
    pub fn rays(&self) -> &Arc<Vec<Ray>> {
        &self.rays
    }

    /// Rays of which is wanted whether they hit anything.
    pub fn shadow_rays(&self) -> &Arc<Vec<Ray>> {
        &self.shadow_rays
    }

    /// Whether all paths are at their end.
    pub fn is_over(&self) -> bool {
        !self.samples.is_empty() && self.live_count == 0 && self.records.len() == self.samples.len()
    }

    /// Paths that are to be shaded next: the size of that work.
    pub(crate) fn path_count(&self) -> u64 {
        if self.records.is_empty() { self.samples.len() as u64 } else { self.live_count as u64 }
    }

    pub(crate) fn samples(&self) -> &[(u32, u32, u32)] {
        &self.samples
    }

    pub(crate) fn records(&self) -> &[PathRecord] {
        &self.records
    }

    /// Takes in what rays found, and goes on to the next ones.
    pub(crate) fn step(&mut self, integrator: &PathIntegrator<'_>, answers: &WaveAnswers) {
        compiled::run(WaveStep { wave: self, integrator, answers });
    }
}

impl fmt::Debug for Wave {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {} paths, {} rays", self.live_count, self.samples.len(), self.rays.len())
    }
}

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
    #[inline(always)]
    fn advance<const AGENTS: bool>(&mut self, integrators: &SampleIntegrators<'_, '_>, answers: &WaveAnswers) {
        if self.records.is_empty() {
            self.begin::<AGENTS>(integrators);
        } else {
            self.take_light(&answers.occluded);
            self.meet::<AGENTS>(integrators, &answers.hits);
        }
        let mut rays = Vec::with_capacity(self.live_count);
        rays.extend(self.paths.iter().filter(|it| it.stage == PathStage::Ray).map(|it| it.path.ray()));
        self.rays = Arc::new(rays);
    }

    #[inline(always)]
    fn begin<const AGENTS: bool>(&mut self, integrators: &SampleIntegrators<'_, '_>) {
        self.records = vec![PathRecord::default(); self.samples.len()];
        let begun = self.samples.iter().zip(0..).map(|(&(x, y, index), sample)| {
            let integrator = integrators.of_pixel(x, y);
            let sampler = PixelSampler::new(integrator.settings().seed, x, y, index);
            let (ray, factor) = integrator.camera_ray(&sampler, x, y);
            let mut path = integrator.begin(sampler, &ray, integrator.guide(), None);
            if AGENTS {
                path.expect(integrator.place(x, y));
            }
            WavePath { path: path.suspend(), sample, factor, branches: Vec::new(), stage: PathStage::Ray }
        });
        self.paths = begun.collect();
        self.live_count = self.paths.len();
    }

    /// Adds the light that nothing is in front of.
    fn take_light(&mut self, occluded: &[bool]) {
        for (&(path, light), &is_occluded) in self.deferred.iter().zip(occluded) {
            if !is_occluded {
                self.paths[path as usize].path.add(light);
            }
        }
        self.deferred.clear();
    }

    /// Brings every path to the surface that its ray met. Those that were over end, or go on as a part that waited.
    #[inline(always)]
    fn meet<const AGENTS: bool>(&mut self, integrators: &SampleIntegrators<'_, '_>, hits: &[Hit]) {
        // The allocator has checked that there are as many; less would be black, and nobody would know.
        assert_eq!(hits.len(), self.rays.len(), "a hit for every ray");
        let mut hits = hits.iter();
        let (mut shadow_rays, mut deferred, mut lights) = (Vec::new(), Vec::new(), Vec::<DeferredLight>::new());
        // Most of those that ended are let go of at once, and seldom.
        if 2 * self.live_count < self.paths.len() {
            self.paths.retain(|it| it.stage != PathStage::Ended);
        }
        for (it, at) in self.paths.iter_mut().zip(0..) {
            if it.stage == PathStage::Ended {
                continue;
            }
            let (x, y, _) = self.samples[it.sample as usize];
            let integrator = integrators.of_pixel(x, y);
            if it.stage == PathStage::Ray {
                let Some(hit) = hits.next() else { return };
                let mut path = integrator.resume(&it.path);
                if !path.meet::<AGENTS, true>(hit, &mut it.branches, &mut lights) {
                    it.stage = PathStage::Light;
                }
                it.path = path.suspend();
            }
            let waits = !lights.is_empty();
            for DeferredLight { ray, light } in lights.drain(..) {
                shadow_rays.push(ray);
                deferred.push((at, light));
            }
            if it.stage == PathStage::Light && !waits {
                if let Some(branch) = it.branches.pop() {
                    it.path.go_back(branch);
                    it.stage = PathStage::Ray;
                } else {
                    self.records[it.sample as usize] = integrator.resume(&it.path).finish().scaled(it.factor);
                    it.stage = PathStage::Ended;
                    self.live_count -= 1;
                }
            }
        }
        self.deferred = deferred;
        self.shadow_rays = Arc::new(shadow_rays);
    }
}
