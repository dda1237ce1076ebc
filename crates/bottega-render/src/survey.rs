//! The fast, low-resolution look at a scene from which the Analyst makes its importance map.
//!
//! Two passes, both by work units alone: levels of recursion, by following mirrored and refracted rays breadth first
//! in batches; and a few paths a pixel, for what pixels look like and what they cost.

use std::sync::Arc;

use bottega_hra::{HraClient, WorkUnit};
use bottega_image::Rect;
use bottega_kernels::{Hit, Ray, compiled};
use glam::Vec3;

use crate::{
    Filter, PathSettings, PreparedScene, ProbeWork, RenderError, RenderOutput, RenderWork, View,
    bsdf::LobeFlags,
    camera::RayCone,
    integrator::{Painting, PathIntegrator, PathRecord, Wanted, bsdf_at},
    interaction::{Asks, Interaction, is_there},
    luminance,
    sampler::{DimensionSet, PixelSampler},
};

/// Levels of recursion that are told apart.
const LEVELS_MAX: u32 = 16;
/// Rays followed for the recursion levels of a pixel.
const CHAINS_PER_PIXEL: u32 = 4;
/// Rays in a unit of work.
const RAYS_PER_UNIT: usize = 4096;
/// Density above which a glossy direction counts as mirrored, in sr⁻¹.
const MIRROR_PDF: f32 = 10.0;
/// Samples a pixel.
const PROBE_SAMPLES: u32 = 6;
/// Bounces at most: where paths go on for long, the last of them tell no places apart.
const PROBE_DEPTH_MAX: u32 = 16;
/// Side of a probe's block, in pixels.
const PROBE_SIDE: u32 = 16;

/// What the fast pass saw in one pixel; means over its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurveyPixel {
    /// Levels of recursion in mirror and transparent surfaces (the paper's importance function).
    pub recursion_levels: f32,
    /// Traversal steps (nodes and leaves visited) that one path took.
    pub steps: f32,
    /// Mean radiance, linear RGB.
    pub color: [f32; 3],
    /// Standard deviation of the luminance over the samples.
    pub noise: f32,
    /// Reflectance of the first surface.
    pub albedo: [f32; 3],
    /// Distance to the first surface; 0 where there is none.
    pub depth: f32,
    /// Vertices of one path.
    pub path_length: f32,
    /// Rays towards lights of one path.
    pub shadow_rays: f32,
    /// Vertices of one path at surfaces of several lobes, which are dearer to evaluate than a single one.
    pub layered: f32,
    /// Textures of the surfaces that one path meets.
    pub lookups: f32,
    /// Share of the luminance that came over more than one scattering, 0..=1.
    pub indirect: f32,
    /// Standard deviation of the luminance of [`albedo`](Self::albedo) over the samples.
    pub detail: f32,
}

/// A low-resolution look at the scene, row-major.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Survey {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `[width × height]`.
    pub pixels: Vec<SurveyPixel>,
    /// Into so many zones the picture should be cut at most: more would cost more than they gain. `None`: any number.
    pub zones_max: Option<u32>,
}

/// Looks at the whole picture `view`, which should be small: some 128 columns are plenty.
///
/// - `max_depth`: bounces of the paths that the picture will be painted with.
///
/// All heavy work goes through `client`, which nobody else may use meanwhile. The result depends on the scene, the view
/// and the depth alone.
pub fn survey(
    scene: &Arc<PreparedScene>,
    view: View,
    max_depth: u32,
    client: &HraClient<RenderWork>,
) -> Result<Survey, RenderError> {
    let settings = PathSettings {
        max_depth: max_depth.min(PROBE_DEPTH_MAX),
        filter: Filter::PIXEL,
        guiding: false,
        ..PathSettings::default()
    };
    let settings = Arc::new(settings);
    let mut pixels = probe_all(scene, view, &settings, client)?;
    let levels = recursion_levels(scene, view, &settings, client)?;
    for (pixel, levels) in pixels.iter_mut().zip(levels) {
        pixel.recursion_levels = levels;
    }
    Ok(Survey { width: view.width, height: view.height, pixels, zones_max: None })
}

/// Submits all work and returns the outputs in the same order.
pub(crate) fn run(client: &HraClient<RenderWork>, works: Vec<RenderWork>) -> Result<Vec<RenderOutput>, RenderError> {
    let count = works.len();
    client.submit_group(works.into_iter().zip(0..).map(|(work, ticket)| WorkUnit::new(work, ticket)).collect())?;
    let mut outputs: Vec<Option<RenderOutput>> = vec![None; count];
    let mut failure = None;
    // All answers are taken even after a failure: none may be left for the client's next user.
    while let Some(completed) = client.take() {
        match completed.output {
            Ok(RenderOutput::Refused(error)) => failure = Some(RenderError::Refused(error)),
            Ok(output) => outputs[completed.ticket as usize] = Some(output),
            Err(error) => failure = Some(error.into()),
        }
    }
    if let Some(error) = failure {
        return Err(error);
    }
    outputs.into_iter().collect::<Option<Vec<_>>>().ok_or(RenderError::Unanswered)
}

fn probe_all(
    scene: &Arc<PreparedScene>,
    view: View,
    settings: &Arc<PathSettings>,
    client: &HraClient<RenderWork>,
) -> Result<Vec<SurveyPixel>, RenderError> {
    let whole = Rect::of_size(view.width, view.height);
    let blocks: Vec<Rect> = whole.blocks(PROBE_SIDE).collect();
    let works = blocks.iter().map(|&rect| {
        let (scene, settings) = (Arc::clone(scene), Arc::clone(settings));
        RenderWork::Probe(ProbeWork { scene, view, settings, rect, sample_count: PROBE_SAMPLES })
    });
    let mut pixels = vec![SurveyPixel::default(); whole.area() as usize];
    for (rect, output) in blocks.iter().zip(run(client, works.collect())?) {
        let RenderOutput::Probe(seen) = output else { return Err(RenderError::Unanswered) };
        for ((x, y), pixel) in rect.pixels().zip(seen) {
            pixels[whole.index(x, y)] = pixel;
        }
    }
    Ok(pixels)
}

/// Looks at a block of pixels by a few paths. Everything but the recursion levels, row-major.
pub(crate) fn probe(
    scene: &PreparedScene,
    view: View,
    settings: &PathSettings,
    rect: Rect,
    sample_count: u32,
) -> Result<Vec<SurveyPixel>, RenderError> {
    let integrator = PathIntegrator::unguided(scene, view, settings)?.with_wanted(Wanted { albedo: true, cost: true });
    let (sample_count, mut records) = (sample_count.max(1), Vec::new());
    let mut pixels = Vec::with_capacity(rect.area() as usize);
    for y in rect.y0..rect.y1 {
        let row = Rect { y0: y, y1: y + 1, ..rect };
        let samples: Vec<(u32, u32, u32)> =
            row.pixels().flat_map(|(x, y)| (0..sample_count).map(move |sample| (x, y, sample))).collect();
        compiled::run(Painting { integrator: &integrator, samples: &samples, records: &mut records });
        pixels.extend(records.chunks_exact(sample_count as usize).map(seen_by));
    }
    Ok(pixels)
}

/// What the samples of one pixel saw.
fn seen_by(samples: &[PathRecord]) -> SurveyPixel {
    let sample_count = samples.len() as u32;
    let share = 1.0 / sample_count as f32;
    let mut pixel = SurveyPixel::default();
    let (mut color, mut albedo) = (Vec3::ZERO, Vec3::ZERO);
    let (mut brightness, mut pattern) = (Spread::default(), Spread::default());
    let (mut covered, mut indirect) = (0.0_f32, 0.0_f32);
    for record in samples {
        let values = record.values;
        let radiance = Vec3::from(values.radiance);
        brightness.add(luminance(radiance));
        pattern.add(luminance(values.albedo.into()));
        color += radiance * share;
        albedo += Vec3::from(values.albedo) * share;
        pixel.steps += values.cost * share;
        pixel.depth += values.depth;
        pixel.path_length += record.vertex_count as f32 * share;
        pixel.shadow_rays += record.counts.shadow_rays as f32 * share;
        pixel.layered += record.counts.layered as f32 * share;
        pixel.lookups += record.counts.lookups as f32 * share;
        covered += values.alpha;
        indirect += record.indirect();
    }
    pixel.color = color.to_array();
    pixel.albedo = albedo.to_array();
    pixel.depth /= covered.max(1.0);
    let found = brightness.mean * sample_count as f32;
    pixel.indirect = if found > 0.0 { (indirect / found).min(1.0) } else { 0.0 };
    pixel.noise = brightness.deviation();
    pixel.detail = pattern.deviation();
    pixel
}

/// Mean and standard deviation of numbers that come one by one, without cancellation between large sums. Source: Welford
/// 1962, *Note on a Method for Calculating Corrected Sums of Squares and Products*.
#[derive(Clone, Copy, Default)]
struct Spread {
    count: u32,
    mean: f32,
    squares: f32,
}

impl Spread {
    fn add(&mut self, value: f32) {
        self.count += 1;
        let from_mean = value - self.mean;
        self.mean += from_mean / self.count as f32;
        self.squares += from_mean * (value - self.mean);
    }

    /// Of one number; 0 for fewer than two.
    fn deviation(&self) -> f32 {
        (self.squares / self.count.saturating_sub(1).max(1) as f32).sqrt()
    }
}

/// A ray that is followed from mirror to mirror.
#[derive(Clone, Copy)]
struct Chain {
    pixel: usize,
    sampler: PixelSampler,
    origin: Vec3,
    direction: Vec3,
    cone: RayCone,
    /// How far its next ray sees surfaces.
    reach: f32,
    /// Surfaces passed, mirrors or half-transparent ones that were not there.
    step: u32,
}

impl Chain {
    fn ray(&self) -> Ray {
        Ray { t_max: self.reach, ..Ray::new(self.origin, self.direction) }
    }
}

/// Mean number of mirrored or refracted bounces in a row, for each pixel.
fn recursion_levels(
    scene: &Arc<PreparedScene>,
    view: View,
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

/// The chain behind the surface that it hit, and by how many levels that counts. `None`: it ends there.
fn follow(scene: &PreparedScene, chain: Chain, hit: &Hit) -> Option<(Chain, f32)> {
    let step = chain.step + 1;
    if hit.is_none() || step > LEVELS_MAX {
        return None;
    }
    let cone = chain.cone.at(hit.t);
    let point = Interaction::new(scene, hit, chain.origin, chain.direction, cone);
    let ray = chain.ray();
    let chain = Chain { reach: f32::INFINITY, ..chain };
    if !is_there(scene, &ray, hit, Asks::Path.of_vertex(chain.step), |surface| chain.sampler.hashed(surface)) {
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
