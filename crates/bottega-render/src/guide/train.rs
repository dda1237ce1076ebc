//! The training of a guide: traces paths pass by pass.

use bottega_scene::Spectrum;
use glam::Vec3;
use rayon::prelude::*;

use super::agent::{PictureWorth, TracedPath};
use super::budget::noise;
use super::directions::place_of;
use super::expected::PictureParts;
use super::learn::{DirectionSample, Vertex, learn};
use super::tree::{Guide, face_of};
use crate::{
    color::luminance,
    lights::{Lights, RequestedLight},
};

/// Greatest number of vertices per path that are learned from.
const VERTICES_MAX: usize = 32;
/// Paths that one thread traces in a row.
const PATHS_PER_CHUNK: u32 = 512;
/// Paths that are traced together, in turn; each needs a trail.
const PATHS_AT_ONCE: u32 = 128;

/// The vertices of one path on surfaces that are not specular.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trail {
    steps: Vec<TrailStep>,
}

/// A recorded vertex.
#[derive(Clone, Copy, Debug)]
struct TrailStep {
    p: Vec3,
    normal: Vec3,
    /// Throughput on arrival.
    throughput: Spectrum,
    /// Radiance gathered so far on arrival.
    radiance: Spectrum,
    /// Direction taken; `None`: the path ended here.
    went: Option<ScatterChoice>,
    /// The light that was sampled here.
    light_sample: Option<RequestedLight>,
}

/// The direction that a path took at a vertex.
#[derive(Clone, Copy, Debug)]
struct ScatterChoice {
    wi: Vec3,
    bsdf_pdf: f32,
    pdf: f32,
    /// Radiance gathered so far when it left.
    radiance: Spectrum,
}

impl Trail {
    /// Records a vertex, with the throughput and the gathered radiance on arrival.
    pub(crate) fn record_vertex(&mut self, p: Vec3, normal: Vec3, throughput: Spectrum, radiance: Spectrum) {
        if self.steps.len() < VERTICES_MAX {
            self.steps.push(TrailStep { p, normal, throughput, radiance, went: None, light_sample: None });
        }
    }

    /// Records the first light sample at the last vertex.
    pub(crate) fn record_light(&mut self, light_sample: RequestedLight) {
        if let Some(step) = self.steps.last_mut() {
            step.light_sample.get_or_insert(light_sample);
        }
    }

    /// Records the direction from the last vertex, with its densities and the radiance gathered so far.
    pub(crate) fn record_direction(&mut self, wi: Vec3, bsdf_pdf: f32, pdf: f32, radiance: Spectrum) {
        if let Some(step) = self.steps.last_mut()
            && step.went.is_none()
        {
            step.went = Some(ScatterChoice { wi, bsdf_pdf, pdf, radiance });
        }
    }

    /// Converts the recorded vertices of a path that ended with `radiance`, and clears the trail.
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
                light_sample: step.light_sample.filter(|light_sample| light_sample.found.is_finite()),
            });
        }
        self.steps.clear();
    }
}

/// Returns the value, or 0 if it is not finite.
fn finite(value: f32) -> f32 {
    if value.is_finite() { value } else { 0.0 }
}

/// A path to learn from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum LearningPath {
    /// One path anywhere in the picture, by its number.
    Single(u32),
    /// One of some paths of a pixel, which measure its noise.
    OfPixel {
        /// Number of the pixel.
        number: u32,
        /// Repetition of the pixel: 0 or 1.
        picture: u32,
        /// Sample within the repetition.
        sample: u32,
    },
}

impl LearningPath {
    /// Samples per repetition of a pixel.
    const SAMPLES: u32 = 2;
    /// Paths per pixel: of two repetitions, whose difference is noise.
    const OF_PIXEL: u32 = 2 * Self::SAMPLES;

    fn new(index: u32, are_of_pixels: bool) -> Self {
        if !are_of_pixels {
            return Self::Single(index);
        }
        let (number, rest) = (index / Self::OF_PIXEL, index % Self::OF_PIXEL);
        Self::OfPixel { number, picture: rest / Self::SAMPLES, sample: rest % Self::SAMPLES }
    }
}

/// Radiance of a path, and its position in the picture, in [0, 1)².
#[derive(Clone, Copy, Debug)]
pub(crate) struct FoundLight {
    /// Radiance of the path.
    pub(crate) radiance: Spectrum,
    /// Position in the picture, in [0, 1)².
    pub(crate) place: [f32; 2],
}

/// A guide in training.
pub(crate) struct Training<'a> {
    /// Size of the picture, in pixels.
    size: [u32; 2],
    /// Lights of the scene, if agents are learned in addition to directions.
    lights: Option<&'a Lights>,
    vertices: Vec<Vertex>,
    seen: Vec<TracedPath>,
    /// Number of leading paths that belong to pixels.
    of_pixels: usize,
}

impl<'a> Training<'a> {
    /// Creates a training without paths.
    ///
    /// - `size`: size of the picture, in pixels.
    /// - `lights`: lights of the scene, if agents are learned in addition to directions.
    pub(crate) fn new(size: [u32; 2], lights: Option<&'a Lights>) -> Self {
        Self { size, lights, vertices: Vec::new(), seen: Vec::new(), of_pixels: 0 }
    }

    /// Traces a pass of about `count` paths, some for each of several pixels. Must precede [`Self::pass`].
    ///
    /// - `trace`: traces paths and records their trails.
    pub(crate) fn pass_of_pixels(
        &mut self,
        count: u32,
        trace: impl Fn(&[LearningPath], &mut [Trail]) -> Vec<FoundLight> + Sync,
    ) {
        self.trace(count.next_multiple_of(LearningPath::OF_PIXEL), true, trace);
        self.of_pixels = self.seen.len();
    }

    /// Traces a pass of `count` paths all over the picture.
    ///
    /// - `trace`: traces paths and records their trails.
    pub(crate) fn pass(&mut self, count: u32, trace: impl Fn(&[LearningPath], &mut [Trail]) -> Vec<FoundLight> + Sync) {
        self.trace(count, false, trace);
    }

    fn trace(
        &mut self,
        count: u32,
        are_of_pixels: bool,
        trace: impl Fn(&[LearningPath], &mut [Trail]) -> Vec<FoundLight> + Sync,
    ) {
        let first = self.seen.len() as u32;
        let path = |index| LearningPath::new(index, are_of_pixels);
        for (of_chunk, seen_by) in traced(first..first + count, &path, &trace) {
            self.vertices.extend(of_chunk);
            self.seen.extend(seen_by);
        }
    }

    /// Returns the variance of one path, relative to the brightness of its part of the picture.
    pub(crate) fn noise(&self) -> f64 {
        let samples = LearningPath::SAMPLES as usize;
        let parts = PictureParts::new(self.size, &self.seen);
        let square = |block: &[TracedPath]| {
            let mean = |paths: &[TracedPath]| {
                paths.iter().map(|path| f64::from(path.brightness)).sum::<f64>() / samples as f64
            };
            let (one, other) = block.split_at(samples);
            ((mean(one) - mean(other)) * f64::from(parts.weight(block[0].place))).powi(2)
        };
        noise(
            self.seen[..self.of_pixels].chunks_exact(LearningPath::OF_PIXEL as usize).map(square).collect(),
            LearningPath::SAMPLES,
        )
    }

    /// Returns a guide of directions only, to trace the next pass with.
    pub(crate) fn directions(&self) -> Guide {
        learn(&self.vertices, None)
    }

    /// Returns the guide with all that was learned.
    pub(crate) fn guide(&self) -> Guide {
        let guide = learn(&self.vertices, self.lights);
        let expected = PictureWorth::new(PictureParts::new(self.size, &self.seen), &self.seen, &guide);
        guide.expecting(expected)
    }
}

/// Returns the vertices of a range of paths, in order, and the result of each path.
fn traced(
    paths: std::ops::Range<u32>,
    path: &(impl Fn(u32) -> LearningPath + Sync),
    trace: &(impl Fn(&[LearningPath], &mut [Trail]) -> Vec<FoundLight> + Sync),
) -> Vec<(Vec<Vertex>, Vec<TracedPath>)> {
    let chunks = paths.len().div_ceil(PATHS_PER_CHUNK as usize) as u32;
    let of_chunk = |chunk: u32| {
        let first = paths.start + chunk * PATHS_PER_CHUNK;
        let chunk: Vec<LearningPath> = (first..paths.end.min(first + PATHS_PER_CHUNK)).map(path).collect();
        let (mut vertices, mut seen) = (Vec::new(), Vec::new());
        let mut trails = vec![Trail::default(); PATHS_AT_ONCE as usize];
        for some in chunk.chunks(PATHS_AT_ONCE as usize) {
            let found = trace(some, &mut trails[..some.len()]);
            for (FoundLight { radiance, place }, trail) in found.into_iter().zip(&mut trails) {
                let first = trail.steps.first().map(|step| (step.p, step.normal, step.throughput.max_element()));
                seen.push(TracedPath { place, brightness: finite(radiance.max_element()), first });
                trail.finish(radiance, &mut vertices);
            }
        }
        (vertices, seen)
    };
    (0..chunks).into_par_iter().map(of_chunk).collect()
}
