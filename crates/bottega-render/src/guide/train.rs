//! Tracing the paths that are learnt from.

use bottega_scene::Spectrum;
use glam::Vec3;
use rayon::prelude::*;

use super::agent::{EyePath, PictureWorth};
use super::budget::{Budget, PassFindings};
use super::directions::place_of;
use super::expected::PictureParts;
use super::learn::{DirectionSample, Vertex, learn};
use super::tree::{Guide, face_of};
use crate::{
    lights::{Lights, RequestedLight},
    luminance,
};

/// Vertices of a path that are learnt from.
const VERTICES_MAX: usize = 32;
/// Paths that one processor traces in a row.
const PATHS_PER_CHUNK: u32 = 512;

/// The vertices of one path at which it could have gone elsewhere.
#[derive(Debug, Default)]
pub(crate) struct Trail {
    steps: Vec<TrailStep>,
}

#[derive(Clone, Copy, Debug)]
struct TrailStep {
    p: Vec3,
    normal: Vec3,
    /// What the path carried when it came, and had gathered.
    throughput: Spectrum,
    radiance: Spectrum,
    went: Option<ScatterChoice>,
    asked: Option<RequestedLight>,
}

/// Where a path went on.
#[derive(Clone, Copy, Debug)]
struct ScatterChoice {
    wi: Vec3,
    bsdf_pdf: f32,
    pdf: f32,
    /// What the path had gathered when it left.
    radiance: Spectrum,
}

impl Trail {
    /// A path comes to a point with a normal, carries `throughput` and has gathered `radiance`.
    pub(crate) fn come(&mut self, p: Vec3, normal: Vec3, throughput: Spectrum, radiance: Spectrum) {
        if self.steps.len() < VERTICES_MAX {
            self.steps.push(TrailStep { p, normal, throughput, radiance, went: None, asked: None });
        }
    }

    /// It asks for light at the point where it came last.
    pub(crate) fn ask(&mut self, asked: RequestedLight) {
        if let Some(step) = self.steps.last_mut() {
            step.asked.get_or_insert(asked);
        }
    }

    /// It leaves the point where it came last in direction `wi`, and has gathered `radiance`.
    pub(crate) fn go(&mut self, wi: Vec3, bsdf_pdf: f32, pdf: f32, radiance: Spectrum) {
        if let Some(step) = self.steps.last_mut()
            && step.went.is_none()
        {
            step.went = Some(ScatterChoice { wi, bsdf_pdf, pdf, radiance });
        }
    }

    /// The path has ended with `radiance`.
    fn finish(&mut self, radiance: Spectrum, vertices: &mut Vec<Vertex>) {
        for (index, step) in self.steps.iter().enumerate() {
            let carried = luminance(step.throughput);
            let next = self.steps.get(index + 1);
            let emitted =
                |went: ScatterChoice| luminance(next.map_or(radiance, |next| next.radiance) - went.radiance) / carried;
            let taken = |went: ScatterChoice| {
                let (cell, cube) = place_of(went.wi);
                DirectionSample { cell, cube, pdf: went.pdf, bsdf_pdf: went.bsdf_pdf }
            };
            vertices.push(Vertex {
                p: step.p,
                face: face_of(step.normal) as u8,
                has_next: next.is_some(),
                leaving: finite(luminance(radiance - step.radiance) / carried),
                weight: finite(next.map_or(0.0, |next| luminance(next.throughput) / carried)),
                emitted: finite(step.went.map_or(0.0, emitted)),
                taken: step.went.map(taken),
                brightness: finite(
                    ((radiance - step.radiance) / step.throughput.max(Spectrum::splat(1e-9))).max_element(),
                ),
                work: (self.steps.len() - index) as f32,
                asked: step.asked.filter(|asked| asked.found.is_finite()),
            });
        }
        self.steps.clear();
    }
}

/// What is not a number teaches nothing.
fn finite(value: f32) -> f32 {
    if value.is_finite() { value } else { 0.0 }
}

/// How a guide is learnt.
pub(crate) struct Training<'a> {
    /// Samples of the picture, all pixels together. Few are not worth much learning.
    pub(crate) samples: u64,
    /// Of the picture, in pixels.
    pub(crate) size: [u32; 2],
    /// Of the scene, if agents are wanted beside directions.
    pub(crate) lights: Option<&'a Lights>,
    /// To trace with. The guide does not depend on it.
    pub(crate) threads: usize,
}

/// A path to learn from: one of the [block](Self::BLOCK) that a pixel gets, half of which go as if nothing had been learnt so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LearningPath {
    /// Which block.
    pub(crate) block: u32,
    /// Whether it is to go by the guide so far.
    pub(crate) is_guided: bool,
    /// Which picture of the pixel it is a sample of: 0 or 1.
    pub(crate) picture: u32,
    /// Which sample of that.
    pub(crate) sample: u32,
}

impl LearningPath {
    /// Paths of a block: of two pictures without and two with the guide.
    const BLOCK: u32 = 4 * Self::SAMPLES;
    /// Samples of each picture.
    const SAMPLES: u32 = 2;

    fn new(index: u32) -> Self {
        let (block, rest) = (index / Self::BLOCK, index % Self::BLOCK);
        let (half, rest) = (rest / (2 * Self::SAMPLES), rest % (2 * Self::SAMPLES));
        Self { block, is_guided: half == 1, picture: rest / Self::SAMPLES, sample: rest % Self::SAMPLES }
    }
}

/// What a path found, and what that took.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FoundLight {
    pub(crate) radiance: Spectrum,
    /// Where in the picture, in [0, 1)².
    pub(crate) place: [f32; 2],
    /// In vertices.
    pub(crate) work: f32,
}

/// Learns by tracing, as far as it pays. `None`: it does not.
///
/// - `trace`: takes the guide so far, a path, and the trail to leave.
pub(crate) fn train(
    training: &Training<'_>,
    trace: impl Fn(Option<&Guide>, LearningPath, &mut Trail) -> FoundLight + Sync,
) -> Option<Guide> {
    let all_passes = || {
        let mut budget = Budget::new(training.samples);
        let (mut vertices, mut seen, mut guide, mut first) = (Vec::new(), Vec::new(), None, 0);
        while let Some(count) = budget.next_pass() {
            let end = first + count.next_multiple_of(LearningPath::BLOCK);
            let before = seen.len();
            for (of_chunk, seen_by) in traced(first..end, guide.as_ref(), &trace) {
                vertices.extend(of_chunk);
                seen.extend(seen_by);
            }
            first = end;
            let parts = PictureParts::new(training.size, &seen);
            budget.take(findings(&parts, &seen[before..], guide.is_some()));
            if budget.is_lost() {
                return None;
            }
            let is_last = budget.next_pass().is_none();
            guide = Some(learn(&vertices, training.lights.filter(|_| is_last)));
        }
        let guide = guide?;
        let expected = PictureWorth::new(PictureParts::new(training.size, &seen), &seen, &guide);
        Some(guide.expecting(expected))
    };
    match rayon::ThreadPoolBuilder::new().num_threads(training.threads).build() {
        Ok(pool) => pool.install(all_passes),
        Err(_) => all_passes(),
    }
}

/// What the paths of a pass say of the guide that half of them went by.
fn findings(parts: &PictureParts, paths: &[EyePath], has_guide: bool) -> PassFindings {
    let samples = LearningPath::SAMPLES as usize;
    let mut errors: [Vec<f64>; 2] = Default::default();
    let mut work = [0.0_f64; 2];
    for block in paths.chunks_exact(LearningPath::BLOCK as usize) {
        for (half, paths) in block.chunks_exact(2 * samples).enumerate() {
            let mean = |paths: &[EyePath]| paths.iter().map(|path| f64::from(path.brightness)).sum::<f64>() / samples as f64;
            let (one, other) = paths.split_at(samples);
            let weight = f64::from(parts.weight(paths[0].place));
            errors[half].push(((mean(one) - mean(other)) * weight).powi(2));
            work[half] += paths.iter().map(|path| f64::from(path.work)).sum::<f64>();
        }
    }
    PassFindings::new(errors, work, samples, has_guide)
}

/// The vertices of a range of paths, in their order, and what each path saw.
fn traced(
    paths: std::ops::Range<u32>,
    guide: Option<&Guide>,
    trace: &(impl Fn(Option<&Guide>, LearningPath, &mut Trail) -> FoundLight + Sync),
) -> Vec<(Vec<Vertex>, Vec<EyePath>)> {
    let chunks = paths.len().div_ceil(PATHS_PER_CHUNK as usize) as u32;
    let of_chunk = |chunk: u32| {
        let first = paths.start + chunk * PATHS_PER_CHUNK;
        let (mut vertices, mut seen, mut trail) = (Vec::new(), Vec::new(), Trail::default());
        for path in first..paths.end.min(first + PATHS_PER_CHUNK) {
            let FoundLight { radiance, place, work } = trace(guide, LearningPath::new(path), &mut trail);
            let first = trail.steps.first().map(|step| (step.p, step.normal, step.throughput.max_element()));
            seen.push(EyePath { place, brightness: finite(radiance.max_element()), work, first });
            trail.finish(radiance, &mut vertices);
        }
        (vertices, seen)
    };
    (0..chunks).into_par_iter().map(of_chunk).collect()
}
