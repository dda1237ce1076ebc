//! The noise of a picture: by pixel, and by the kinds of paths that cause it.
//!
//! The picture is rendered several times with different seeds, and the light of each kind of path is kept apart. The
//! variance over these renders is the error that a render of so many samples has, with stratification and guiding.

use std::sync::Arc;

use bottega_engines::{BuiltinEngine, BuiltinOptions, Devices, RenderEngine, Resources, Tunables, ZoneTask};
use bottega_image::{AovSet, Combine, Layer, Layout, Rect, Tile, luminance, srgb_from_linear};
use bottega_render::{LightFinder, LightGroups, PathKind};

use crate::{analysis::path_settings, error::Error, loaded_scene::LoadedScene};

/// The longer side of the renders in pixels, at most.
const SIDE_MAX: u32 = 512;
/// The finders of light, each with a picture of its own.
pub const FINDERS: [LightFinder; 3] = [LightFinder::Sample, LightFinder::Scattering, LightFinder::Mirror];

/// The noise of a picture.
#[derive(Clone, Debug)]
pub struct Noise {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The root of the relative squared error of each pixel's luminance, var / (mean² + 0.01), row-major.
    pub by_pixel: Vec<f32>,
    /// The same for the light that each of [`FINDERS`] finds, relative to the luminance of the pixel.
    pub by_finder: [Vec<f32>; FINDERS.len()],
    /// The mean relative squared error over all pixels.
    pub relative: f64,
    /// The mean squared error of the sRGB value, in [0, 1], over all pixels.
    pub shown: f64,
    /// The kinds of paths, in the order of [`PathKind::ALL`].
    pub kinds: Vec<KindNoise>,
}

/// The share of a kind of path in a picture's light and noise. The errors of kinds are not independent, so their shares
/// are those of the sum over all kinds.
#[derive(Clone, Copy, Debug)]
pub struct KindNoise {
    /// The kind of path.
    pub kind: PathKind,
    /// Share of the picture's luminance, 0 to 1.
    pub light: f64,
    /// Share of the relative squared error, 0 to 1.
    pub relative: f64,
    /// Share of the squared error as a display shows it, 0 to 1.
    pub shown: f64,
}

/// Measures the noise of path tracing, at a size of at most 512 × 512 pixels. Returns it by pixel and by kind of path.
///
/// - `samples`: number of samples per pixel of each render.
/// - `renders`: number of renders; fewer than 2 count as 2.
/// - `threads`: number of CPU threads.
///
/// # Errors
/// The scene cannot be rendered.
pub fn measure_noise(subject: &LoadedScene, samples: u32, renders: u32, threads: usize) -> Result<Noise, Error> {
    let longer = subject.view.width.max(subject.view.height).max(1);
    let scaled = |side: u32| if longer > SIDE_MAX { (side * SIDE_MAX / longer).max(1) } else { side };
    let view = subject.view.sized(scaled(subject.view.width), scaled(subject.view.height));
    let rect = Rect::of_size(view.width, view.height);
    let layout = layout()?;
    let groups = Some(Arc::new(LightGroups::by_path()));
    let resources = Arc::new(Resources::new(threads, Devices::default(), None));
    let mut sums = NoiseSums::new(rect.area() as usize);
    for seed in 0..renders.max(2) {
        let mut settings = path_settings(subject, samples);
        settings.seed = u64::from(seed);
        let tunables = Tunables { max_depth: settings.max_depth, light_samples: settings.light_samples };
        let options =
            BuiltinOptions { view: view.clone(), settings, layout: layout.clone(), threads, wavefront: false };
        let (scene, prepass) = (Arc::clone(&subject.prepared), Arc::clone(&subject.prepass));
        let engine =
            BuiltinEngine::on(scene, prepass, options, Arc::clone(&resources)).with_light_groups(groups.clone());
        sums.add(&engine.paint(ZoneTask::new(rect, 0..samples, tunables))?.tile);
    }
    Ok(sums.noise(view.width, view.height))
}

/// Returns the layout with a layer for each kind of path.
fn layout() -> Result<Layout, Error> {
    let channels = || ["R", "G", "B"].map(str::to_owned).to_vec();
    let layer = |kind: usize| Layer { name: format!("kind{kind:02}"), channels: channels(), combine: Combine::Mean };
    Layout::with_layers(AovSet::NONE, (0..PathKind::ALL.len()).map(layer).collect())
        .map_err(|error| Error::failed(error.to_string(), "this is unexpected; report it"))
}

/// Sum and sum of squares of a luminance over the renders.
#[derive(Clone, Copy, Default)]
struct RenderMoments {
    sum: f32,
    squares: f32,
}

impl RenderMoments {
    fn add(&mut self, value: f32) {
        self.sum += value;
        self.squares += value * value;
    }

    fn mean(self, count: f32) -> f32 {
        self.sum / count
    }

    /// Returns the variance of one render.
    fn variance(self, count: f32) -> f32 {
        ((self.squares - self.sum * self.sum / count) / (count - 1.0)).max(0.0)
    }
}

/// The moments of all pixels: of all light, by finder, and by kind.
struct NoiseSums {
    renders: u32,
    all: Vec<RenderMoments>,
    by_finder: [Vec<RenderMoments>; FINDERS.len()],
    by_kind: Vec<Vec<RenderMoments>>,
}

impl NoiseSums {
    fn new(pixels: usize) -> Self {
        let none = || vec![RenderMoments::default(); pixels];
        let by_kind = PathKind::ALL.iter().map(|_| none()).collect();
        Self { renders: 0, all: none(), by_finder: [none(), none(), none()], by_kind }
    }

    /// Adds a render.
    fn add(&mut self, tile: &Tile) {
        self.renders += 1;
        let places: Vec<usize> = tile.layout().placed_layers().map(|(place, _)| place).collect();
        for (index, (x, y)) in tile.rect().pixels().enumerate() {
            let pixel = tile.pixel(x, y);
            let count = pixel[Layout::SAMPLE_COUNT].max(1.0);
            let value = |place: usize| luminance([0, 1, 2].map(|channel| pixel[place + channel] / count));
            self.all[index].add(value(Layout::COLOR));
            let mut of_finders = [0.0; FINDERS.len()];
            for ((kind, &place), moments) in PathKind::ALL.iter().zip(&places).zip(&mut self.by_kind) {
                let light = value(place);
                moments[index].add(light);
                of_finders[kind.finder as usize] += light;
            }
            self.by_finder.iter_mut().zip(of_finders).for_each(|(moments, light)| moments[index].add(light));
        }
    }

    fn noise(&self, width: u32, height: u32) -> Noise {
        let count = self.renders as f32;
        let means: Vec<f32> = self.all.iter().map(|moments| moments.mean(count)).collect();
        // Weights of squared errors: relative, and by the slope of the sRGB curve
        let relative: Vec<f32> = means.iter().map(|mean| 1.0 / (mean * mean + 0.01)).collect();
        let shown: Vec<f32> = means.iter().map(|&mean| srgb_slope(mean).powi(2)).collect();
        let roots = |moments: &[RenderMoments]| {
            let root = |(moments, weight): (&RenderMoments, &f32)| (moments.variance(count) * weight).sqrt();
            moments.iter().zip(&relative).map(root).collect::<Vec<f32>>()
        };
        let total = |moments: &[RenderMoments], weights: &[f32]| {
            let errors = moments.iter().zip(weights).map(|(it, weight)| f64::from(it.variance(count) * weight));
            errors.sum::<f64>()
        };
        let light = |moments: &[RenderMoments]| moments.iter().map(|it| f64::from(it.mean(count))).sum::<f64>();
        let pixels = means.len().max(1) as f64;
        // Shares of kinds, of the sums over all kinds
        let of_kinds: Vec<[f64; 3]> =
            self.by_kind.iter().map(|it| [light(it), total(it, &relative), total(it, &shown)]).collect();
        let whole = |part: usize| of_kinds.iter().map(|it| it[part]).sum::<f64>().max(f64::MIN_POSITIVE);
        let whole = [whole(0), whole(1), whole(2)];
        let kind = |(kind, of): (&PathKind, &[f64; 3])| KindNoise {
            kind: *kind,
            light: of[0] / whole[0],
            relative: of[1] / whole[1],
            shown: of[2] / whole[2],
        };
        Noise {
            width,
            height,
            by_pixel: roots(&self.all),
            by_finder: [0, 1, 2].map(|finder: usize| roots(&self.by_finder[finder])),
            relative: total(&self.all, &relative) / pixels,
            shown: total(&self.all, &shown) / pixels,
            kinds: PathKind::ALL.iter().zip(&of_kinds).map(kind).collect(),
        }
    }
}

/// Returns the slope of the sRGB curve at a linear value; 0 above white, where a display shows no difference.
fn srgb_slope(value: f32) -> f32 {
    /// Half the width over which the slope is taken.
    const STEP: f32 = 1e-3;
    let [low, high] = [value - STEP, value + STEP].map(|value| srgb_from_linear(value.clamp(0.0, 1.0)));
    (high - low) / (2.0 * STEP)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variance_is_that_of_one_render_and_nothing_shows_above_white() {
        let mut moments = RenderMoments::default();
        [1.0, 3.0].into_iter().for_each(|value| moments.add(value));
        assert_eq!((moments.mean(2.0), moments.variance(2.0)), (2.0, 2.0));
        assert!(srgb_slope(2.0) == 0.0 && srgb_slope(0.5) > 0.5 && srgb_slope(0.01) > srgb_slope(0.5));
    }
}
