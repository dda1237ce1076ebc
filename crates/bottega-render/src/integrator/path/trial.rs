//! The trial whether it pays to end and to split paths, and to leave out shadow rays, by what agents say they are worth: on a few
//! pixels beforehand.
//!
//! What agents say is about independent paths. Those of a pixel are spread evenly, and where light is smooth that is worth
//! more than to end paths here and to split them there. So some pixels are painted both ways, twice each, and the way with
//! the lesser error times work is taken. Work is counted, not timed: the answer is the same everywhere.

use std::sync::Arc;

use bottega_kernels::compiled;
use bottega_scene::Spectrum;
use rayon::prelude::*;

use super::{super::record::PathRecord, learn::LEARNING_SEED, setup::PathIntegrator};
use crate::{
    AgentUse, PathSettings,
    guide::Guide,
    integrator::turns::Painting,
    sampler::{DimensionSet, PixelSampler},
};

/// Samples of the whole picture for each that is tried, and pixels that are tried, at most.
const SAMPLES_PER_TRIED: u64 = 48;
const PIXELS_MAX: u64 = 4096;
/// Fewer of them tell nothing.
const PIXELS_MIN: u64 = 64;
/// Samples of each pixel: enough that their being spread evenly counts.
const SAMPLES: u32 = 16;
/// Pixels that one processor tries in a row.
const PIXELS_PER_CHUNK: usize = 32;
/// Share of the pixels, the worst ones, that do not count.
const TRIM: f64 = 0.005;
/// By what factor error times work must fall.
const GAIN_MIN: f64 = 1.05;
/// Work of a ray towards a light, and of a path beside its vertices, in vertices.
const SHADOW_WORK: f64 = 0.5;
const PATH_WORK: f64 = 0.5;

/// What one pixel showed, and what that took.
#[derive(Clone, Copy, Default)]
struct PixelTrial {
    radiance: Spectrum,
    work: f64,
}

impl PathIntegrator<'_> {
    /// Tries it. `samples`: of the whole picture.
    pub(super) fn worth_pays(&self, samples: u64, guide: &Arc<Guide>) -> bool {
        let count = samples / SAMPLES_PER_TRIED / u64::from(4 * SAMPLES);
        if count < PIXELS_MIN {
            return false;
        }
        let count = count.min(PIXELS_MAX) as u32;
        let pixels: Vec<(u32, u32)> = (0..count)
            .map(|index| {
                let place = PixelSampler::new(LEARNING_SEED, 1, 0, index).get_2d(DimensionSet::CAMERA) * self.size;
                (place.x as u32, place.y as u32)
            })
            .collect();
        let nothing = AgentUse { roulette: false, shadows: false, ..self.settings.agents };
        let ways = [nothing, self.settings.agents].map(|agents| {
            [1, 2].map(|seed| {
                let settings = PathSettings { seed: LEARNING_SEED + seed, agents, ..*self.settings };
                self.tried(&settings, guide, &pixels)
            })
        });
        let worth = |&(x, y): &(u32, u32)| guide.expected().at(self.place(x, y));
        let worths: Vec<f32> = pixels.iter().map(worth).collect();
        let [plain, by_worth] = ways.map(|[once, again]| {
            let work = once.iter().chain(&again).map(|tried| tried.work).sum::<f64>();
            let pairs = once.iter().zip(&again).zip(&worths);
            let mut errors: Vec<f64> = pairs.map(|((a, b), worth)| error(*a, *b, *worth)).collect();
            errors.sort_unstable_by(f64::total_cmp);
            let kept = errors.len() - (errors.len() as f64 * TRIM) as usize;
            errors[..kept].iter().sum::<f64>() * work
        });
        // (Neither is a number where nothing shines.)
        by_worth * GAIN_MIN < plain
    }

    fn tried(&self, settings: &PathSettings, guide: &Arc<Guide>, pixels: &[(u32, u32)]) -> Vec<PixelTrial> {
        let integrator = PathIntegrator {
            settings,
            splits: settings.agents.roulette,
            looks_rarely: settings.agents.shadows,
            camera: self.camera.clone(),
            filter: self.filter.clone(),
            guide: Some(Arc::clone(guide)),
            ..*self
        };
        let of_chunk = |pixels: &[(u32, u32)]| {
            let samples: Vec<_> =
                pixels.iter().flat_map(|&(x, y)| (0..SAMPLES).map(move |sample| (x, y, sample))).collect();
            let mut records = Vec::new();
            compiled::run(Painting { integrator: &integrator, samples: &samples, records: &mut records });
            records.chunks_exact(SAMPLES as usize).map(pixel).collect::<Vec<_>>()
        };
        pixels.par_chunks(PIXELS_PER_CHUNK).map(of_chunk).flatten_iter().collect()
    }
}

fn pixel(samples: &[PathRecord]) -> PixelTrial {
    samples.iter().fold(PixelTrial::default(), |sum, record| PixelTrial {
        radiance: sum.radiance + Spectrum::from(record.values.radiance) / samples.len() as f32,
        work: sum.work
            + PATH_WORK
            + f64::from(record.vertex_count)
            + SHADOW_WORK * f64::from(record.counts.shadow_rays),
    })
}

/// Squared difference of the same pixel painted twice, by what light is worth to it.
fn error(a: PixelTrial, b: PixelTrial, worth: f32) -> f64 {
    f64::from((a.radiance - b.radiance).length_squared() * worth * worth)
}
