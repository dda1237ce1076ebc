//! The survey: a fast, low-resolution look at a scene, from which the Analyst computes its importance map.
//!
//! It has two passes, both by work units alone: recursion levels, by tracing mirrored and refracted rays breadth-first in
//! batches; and a few paths per pixel, which estimate colour and cost.

mod glimpse;
mod probe;

use std::sync::Arc;

use bottega_hra::HraClient;
use bottega_image::Rect;
use bottega_kernels::{Hit, Ray};
use glam::Vec3;

use crate::{
    bsdf::LobeFlags,
    camera::RayCone,
    error::RenderError,
    filter::Filter,
    integrator::PathIntegrator,
    interaction::{Interaction, SurfaceQuery, is_there},
    prepare::PreparedScene,
    sampler::{DimensionSet, PixelSampler},
    settings::{PathSettings, View},
    shading::bsdf_at,
    sharing::run,
    work::{ProbeWork, RenderOutput, RenderWork},
};

pub use glimpse::{GlimpseOptions, glimpse};
pub use probe::SurveyPixel;
pub(crate) use probe::probe;

/// Largest number of recursion levels.
const LEVELS_MAX: u32 = 16;
/// Number of rays traced per pixel for its recursion levels.
const CHAINS_PER_PIXEL: u32 = 4;
/// Number of rays in a work unit.
const RAYS_PER_UNIT: usize = 4096;
/// Density in sr⁻¹ above which a glossy direction counts as mirrored.
const MIRROR_PDF: f32 = 10.0;
/// Number of samples per pixel of the probes.
const PROBE_SAMPLES: u32 = 6;
/// Largest number of bounces of the probes; later bounces hardly differ between pixels.
const PROBE_DEPTH_MAX: u32 = 16;
/// Side of a probe's block in pixels.
const PROBE_SIDE: u32 = 16;

/// The cost and the colour of each pixel of a picture at low resolution, from a few paths per pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Survey {
    /// Number of columns.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Pixels `[width × height]`, row-major.
    pub pixels: Vec<SurveyPixel>,
    /// Largest number of zones for which the fixed cost of a zone stays small compared to that of its samples; `None`:
    /// no limit.
    pub zones_max: Option<u32>,
}

/// Surveys the picture `view`, which should be small: about 128 columns are enough. Returns its pixels, without a limit
/// of zones.
///
/// - `max_depth`: largest number of bounces of the final picture.
/// - `client`: does all heavy work, and must not be used by others meanwhile.
///
/// The result depends on the scene, the view and the depth alone.
///
/// # Errors
/// [`RenderError::EmptyPicture`], or the allocator does not do the work.
pub fn survey(
    scene: &Arc<PreparedScene>,
    view: &View,
    max_depth: u32,
    client: &HraClient<RenderWork>,
) -> Result<Survey, RenderError> {
    let settings = Arc::new(probe_settings(max_depth));
    let mut pixels = probe_all(scene, view, &settings, client)?;
    let levels = recursion_levels(scene, view, &settings, client)?;
    for (pixel, levels) in pixels.iter_mut().zip(levels) {
        pixel.recursion_levels = levels;
    }
    Ok(Survey { width: view.width, height: view.height, pixels, zones_max: None })
}

/// Returns the settings of probes; `max_depth` is that of the picture.
fn probe_settings(max_depth: u32) -> PathSettings {
    PathSettings {
        max_depth: max_depth.min(PROBE_DEPTH_MAX),
        filter: Filter::PIXEL,
        guiding: false,
        ..PathSettings::default()
    }
}

/// Copies the pixels of a block to their positions in the whole.
fn take_in(pixels: &mut [SurveyPixel], whole: Rect, block: Rect, seen: &[SurveyPixel]) {
    for ((x, y), pixel) in block.pixels().zip(seen) {
        pixels[whole.index(x, y)] = *pixel;
    }
}

fn probe_all(
    scene: &Arc<PreparedScene>,
    view: &View,
    settings: &Arc<PathSettings>,
    client: &HraClient<RenderWork>,
) -> Result<Vec<SurveyPixel>, RenderError> {
    let whole = Rect::of_size(view.width, view.height);
    let blocks: Vec<Rect> = whole.blocks(PROBE_SIDE).collect();
    let works = blocks.iter().map(|&rect| {
        let (scene, settings) = (Arc::clone(scene), Arc::clone(settings));
        RenderWork::Probe(ProbeWork { scene, view: view.clone(), settings, rect, sample_count: PROBE_SAMPLES })
    });
    let mut pixels = vec![SurveyPixel::default(); whole.area() as usize];
    for (rect, output) in blocks.iter().zip(run(client, works.collect())?) {
        let RenderOutput::Probe(seen) = output else { return Err(RenderError::Unanswered) };
        take_in(&mut pixels, whole, *rect, &seen);
    }
    Ok(pixels)
}

/// A ray that is traced through mirrored and refracted bounces.
#[derive(Clone, Copy)]
struct Chain {
    pixel: usize,
    sampler: PixelSampler,
    origin: Vec3,
    direction: Vec3,
    cone: RayCone,
    /// Distance up to which its next ray sees surfaces.
    reach: f32,
    /// Number of surfaces passed: mirrored or refracted at, or crossed as transparent.
    step: u32,
}

impl Chain {
    fn ray(&self) -> Ray {
        Ray { t_max: self.reach, ..Ray::new(self.origin, self.direction) }
    }
}

/// Returns the mean number of consecutive mirrored or refracted bounces for each pixel.
fn recursion_levels(
    scene: &Arc<PreparedScene>,
    view: &View,
    settings: &PathSettings,
    client: &HraClient<RenderWork>,
) -> Result<Vec<f32>, RenderError> {
    let integrator = PathIntegrator::unguided(scene, view, settings)?;
    let whole = Rect::of_size(view.width, view.height);
    let mut levels = vec![0.0; whole.area() as usize];
    let mut chains: Vec<Chain> = whole
        .pixels()
        .flat_map(|(x, y)| (0..CHAINS_PER_PIXEL).map(move |sample| (x, y, sample)))
        .map(|(x, y, sample)| {
            let sampler = PixelSampler::new(settings.seed, x, y, sample);
            let (ray, _) = integrator.camera_ray(&sampler, x, y);
            let pixel = whole.index(x, y);
            Chain {
                pixel,
                sampler,
                origin: ray.origin,
                direction: ray.direction,
                cone: ray.cone,
                reach: ray.reach,
                step: 0,
            }
        })
        .collect();
    // Trace all rays by one bounce per iteration
    while !chains.is_empty() {
        let hits = intersect_all(scene, &chains, client)?;
        let mut next = Vec::with_capacity(chains.len());
        for (chain, hit) in chains.into_iter().zip(&hits) {
            let pixel = chain.pixel;
            let Some((followed, level)) = follow(scene, chain, hit) else { continue };
            levels[pixel] += level / CHAINS_PER_PIXEL as f32;
            next.push(followed);
        }
        chains = next;
    }
    Ok(levels)
}

fn intersect_all(
    scene: &Arc<PreparedScene>,
    chains: &[Chain],
    client: &HraClient<RenderWork>,
) -> Result<Vec<Hit>, RenderError> {
    let works = chains.chunks(RAYS_PER_UNIT).map(|chunk| {
        let rays = chunk.iter().map(Chain::ray).collect();
        RenderWork::Rays { scene: Arc::clone(scene), rays: Arc::new(rays) }
    });
    let mut hits = Vec::with_capacity(chains.len());
    for output in run(client, works.collect())? {
        let RenderOutput::Hits(part) = output else { return Err(RenderError::Unanswered) };
        hits.extend(part);
    }
    if hits.len() == chains.len() { Ok(hits) } else { Err(RenderError::Unanswered) }
}

/// Continues a chain at its hit; returns it with the number of levels to add. `None`: it ends.
fn follow(scene: &PreparedScene, chain: Chain, hit: &Hit) -> Option<(Chain, f32)> {
    let step = chain.step + 1;
    if hit.is_none() || step > LEVELS_MAX {
        return None;
    }
    let cone = chain.cone.at(hit.t);
    let point = Interaction::new(scene, hit, chain.origin, chain.direction, cone);
    let ray = chain.ray();
    let chain = Chain { reach: f32::INFINITY, ..chain };
    if !is_there(scene, &ray, 0.0, hit, SurfaceQuery::Path.of_vertex(chain.step), |surface| {
        chain.sampler.hashed(surface)
    }) {
        let origin = point.ray_origin(chain.direction);
        return Some((Chain { origin, cone, step, ..chain }, 0.0));
    }
    let u = chain.sampler.quad(DimensionSet::scattering(chain.step));
    let mut place = None;
    let sample = bsdf_at(scene, &point, || u[3], &mut place).sample(point.to_local(point.wo), u[0], [u[1], u[2]])?;
    let is_mirror = sample.is_delta() || (sample.lobe.contains(LobeFlags::GLOSSY) && sample.pdf > MIRROR_PDF);
    let direction = point.to_world(sample.wi);
    is_mirror.then(|| (Chain { origin: point.ray_origin(direction), direction, cone, step, ..chain }, 1.0))
}
