//! Tracing the paths that are learnt from.

use bottega_scene::Spectrum;
use glam::Vec3;
use rayon::prelude::*;

use super::directions::place_of;
use super::learn::{Taken, Vertex, learn};
use super::tree::{Guide, face_of};
use crate::luminance;

/// Paths of the last pass, at most and for each sample of the picture; each pass before has half as many as the next.
const PATHS_MAX: u64 = 1 << 18;
const PATHS_PER_SAMPLE: f64 = 1.0 / 32.0;
/// Passes.
const PASSES: u32 = 4;
/// Vertices of a path that are learnt from.
const VERTICES_MAX: usize = 32;
/// Paths that one processor traces in a row.
const PATHS_PER_CHUNK: u32 = 512;

/// The vertices of one path at which it could have gone elsewhere.
#[derive(Debug, Default)]
pub(crate) struct Trail {
    steps: Vec<Step>,
}

#[derive(Clone, Copy, Debug)]
struct Step {
    p: Vec3,
    normal: Vec3,
    /// What the path carried when it came, and had gathered.
    throughput: Spectrum,
    radiance: Spectrum,
    went: Option<Went>,
}

/// Where a path went on.
#[derive(Clone, Copy, Debug)]
struct Went {
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
            self.steps.push(Step { p, normal, throughput, radiance, went: None });
        }
    }

    /// It leaves the point where it came last in direction `wi`, and has gathered `radiance`.
    pub(crate) fn go(&mut self, wi: Vec3, bsdf_pdf: f32, pdf: f32, radiance: Spectrum) {
        if let Some(step) = self.steps.last_mut()
            && step.went.is_none()
        {
            step.went = Some(Went { wi, bsdf_pdf, pdf, radiance });
        }
    }

    /// The path has ended with `radiance`.
    fn finish(&mut self, radiance: Spectrum, vertices: &mut Vec<Vertex>) {
        for (index, step) in self.steps.iter().enumerate() {
            let carried = luminance(step.throughput);
            let next = self.steps.get(index + 1);
            let emitted = |went: Went| luminance(next.map_or(radiance, |next| next.radiance) - went.radiance) / carried;
            let taken = |went: Went| {
                let (cell, cube) = place_of(went.wi);
                Taken { cell, cube, pdf: went.pdf, bsdf_pdf: went.bsdf_pdf }
            };
            vertices.push(Vertex {
                p: step.p,
                face: face_of(step.normal) as u8,
                has_next: next.is_some(),
                leaving: finite(luminance(radiance - step.radiance) / carried),
                weight: finite(next.map_or(0.0, |next| luminance(next.throughput) / carried)),
                emitted: finite(step.went.map_or(0.0, emitted)),
                taken: step.went.map(taken),
            });
        }
        self.steps.clear();
    }
}

/// What is not a number teaches nothing.
fn finite(value: f32) -> f32 {
    if value.is_finite() { value } else { 0.0 }
}

/// Learns by tracing: `trace` takes the guide so far, the index of a path, and the trail to leave, and returns the
/// radiance found.
///
/// - `samples`: of the picture, all pixels together. Few are not worth much learning.
/// - `threads`: to trace with. The guide does not depend on it.
pub(crate) fn train(
    samples: u64,
    threads: usize,
    trace: impl Fn(Option<&Guide>, u32, &mut Trail) -> Spectrum + Sync,
) -> Guide {
    let all_passes = || {
        let last = ((samples as f64 * PATHS_PER_SAMPLE) as u64).clamp(1, PATHS_MAX) as u32;
        let (mut vertices, mut guide, mut first) = (Vec::new(), None, 0);
        for pass in (0..PASSES).rev() {
            let end = first + (last >> pass);
            vertices.extend(traced(first..end, guide.as_ref(), &trace).into_iter().flatten());
            guide = Some(learn(&vertices));
            first = end;
        }
        guide.unwrap_or_default()
    };
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(all_passes),
        Err(_) => all_passes(),
    }
}

/// The vertices of a range of paths, in their order.
fn traced(
    paths: std::ops::Range<u32>,
    guide: Option<&Guide>,
    trace: &(impl Fn(Option<&Guide>, u32, &mut Trail) -> Spectrum + Sync),
) -> Vec<Vec<Vertex>> {
    let chunks = paths.len().div_ceil(PATHS_PER_CHUNK as usize) as u32;
    let of_chunk = |chunk: u32| {
        let first = paths.start + chunk * PATHS_PER_CHUNK;
        let (mut vertices, mut trail) = (Vec::new(), Trail::default());
        for path in first..paths.end.min(first + PATHS_PER_CHUNK) {
            let radiance = trace(guide, path, &mut trail);
            trail.finish(radiance, &mut vertices);
        }
        vertices
    };
    (0..chunks).into_par_iter().map(of_chunk).collect()
}
