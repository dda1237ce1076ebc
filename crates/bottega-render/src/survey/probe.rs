//! The probe of a pixel by a few paths.

use bottega_image::Rect;
use bottega_kernels::compiled;
use glam::Vec3;

use crate::{
    color::luminance,
    error::RenderError,
    integrator::{PathIntegrator, PathRecord, SampleBatch, Wanted},
    prepare::PreparedScene,
    settings::{PathSettings, View},
};

/// The cost and the colour of one pixel, as means over its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurveyPixel {
    /// Mean number of consecutive mirrored or refracted bounces from the camera on, at most 16 per path: the recursion
    /// levels of the paper's importance function.
    pub recursion_levels: f32,
    /// Cost per path, in traversal steps: nodes and leaves that its rays and shadow rays visit, and a fixed number for
    /// each vertex and each segment inside media.
    pub steps: f32,
    /// Mean radiance, linear RGB.
    pub color: [f32; 3],
    /// Standard deviation of the luminance between samples.
    pub noise: f32,
    /// Mean reflectance of the first surface.
    pub albedo: [f32; 3],
    /// Mean distance to the first surface, in scene units, over the samples that hit one; 0: none.
    pub depth: f32,
    /// Vertices per path.
    pub path_length: f32,
    /// Shadow rays per path.
    pub shadow_rays: f32,
    /// Vertices per path on surfaces with several lobes, which are slower to evaluate.
    pub layered: f32,
    /// Texture lookups per path.
    pub lookups: f32,
    /// Segments inside media per path.
    pub media: f32,
    /// Share of the luminance that scattered more than once, in [0, 1].
    pub indirect: f32,
    /// Standard deviation of the luminance of [`albedo`](Self::albedo) between samples.
    pub detail: f32,
}

/// Probes a block of pixels by a few paths. Returns all but the recursion levels, row-major.
pub(crate) fn probe(
    scene: &PreparedScene,
    view: &View,
    settings: &PathSettings,
    rect: Rect,
    sample_count: u32,
) -> Result<Vec<SurveyPixel>, RenderError> {
    let integrator = PathIntegrator::unguided(scene, view, settings)?.with_wanted(Wanted {
        albedo: true,
        cost: true,
        direct: false,
    });
    let (sample_count, mut records) = (sample_count.max(1), Vec::new());
    let mut pixels = Vec::with_capacity(rect.area() as usize);
    for y in rect.y0..rect.y1 {
        let row = Rect { y0: y, y1: y + 1, ..rect };
        let samples: Vec<(u32, u32, u32)> =
            row.pixels().flat_map(|(x, y)| (0..sample_count).map(move |sample| (x, y, sample))).collect();
        let batch = SampleBatch { integrator: &integrator, samples: &samples, records: &mut records, groups: None };
        compiled::run(batch);
        pixels.extend(records.chunks_exact(sample_count as usize).map(seen_by));
    }
    Ok(pixels)
}

/// Averages the samples of one pixel.
fn seen_by(samples: &[PathRecord]) -> SurveyPixel {
    let sample_count = samples.len() as u32;
    let share = 1.0 / sample_count as f32;
    let mut pixel = SurveyPixel::default();
    let (mut color, mut albedo) = (Vec3::ZERO, Vec3::ZERO);
    let (mut brightness, mut pattern) = (RunningMoments::default(), RunningMoments::default());
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
        pixel.media += record.counts.media as f32 * share;
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

/// Running mean and standard deviation, without cancellation between large sums. Source: Welford 1962, *Note on a
/// Method for Calculating Corrected Sums of Squares and Products*.
#[derive(Clone, Copy, Default)]
struct RunningMoments {
    count: u32,
    mean: f32,
    squares: f32,
}

impl RunningMoments {
    /// Adds a value.
    fn add(&mut self, value: f32) {
        self.count += 1;
        let from_mean = value - self.mean;
        self.mean += from_mean / self.count as f32;
        self.squares += from_mean * (value - self.mean);
    }

    /// Returns the sample standard deviation; 0 for fewer than two values.
    fn deviation(&self) -> f32 {
        (self.squares / self.count.saturating_sub(1).max(1) as f32).sqrt()
    }
}
