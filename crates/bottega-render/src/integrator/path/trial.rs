//! The trial whether it pays to end and to split paths, and to leave out shadow rays, by what agents say they are worth: on a few
//! pixels beforehand.
//!
//! What agents say is about independent paths. Those of a pixel are spread evenly, and where light is smooth that is worth
//! more than to end paths here and to split them there. So some pixels are painted both ways, twice each, and the way with
//! the lesser error times work is taken. Work is counted, not timed: the answer is the same everywhere.

use std::{ops::Range, sync::Arc};

use bottega_kernels::compiled;
use bottega_scene::Spectrum;
use rayon::prelude::*;

use super::{super::record::PathRecord, setup::PathIntegrator};
use crate::{
    AgentUse, PathSettings, RenderError, Sharing,
    guide::Guide,
    integrator::turns::Painting,
    photon::bytes::{ByteForm, Reader, Writer},
    sampler::{DimensionSet, PixelSampler},
    sharing::in_parts,
};

/// Seed of the paths that the guide learns from and is tried by, which no picture shares: what is learnt must not know the picture's
/// samples.
pub(super) const LEARNING_SEED: u64 = 0x6775_6964_655f_7365;
/// Samples of the whole picture for each that is tried, and pixels that are tried, at most.
const SAMPLES_PER_TRIED: u64 = 48;
const PIXELS_MAX: u64 = 4096;
/// Fewer of them tell nothing.
const PIXELS_MIN: u64 = 64;
/// Samples of each pixel: enough that their being spread evenly counts.
const SAMPLES: u32 = 16;
/// Pixels that one processor tries in a row.
const PIXELS_PER_CHUNK: usize = 16;
/// Pixels from which on machines share the trial, and in how many parts: each takes more than to tell of it.
const SHARED_MIN: usize = 1024;
const PARTS: usize = 16;
/// Share of the pixels, the worst ones, that do not count.
const TRIM: f64 = 0.005;
/// By what factor error times work must fall.
const GAIN_MIN: f64 = 1.05;
/// Work of a ray towards a light, and of a path beside its vertices, in vertices.
const SHADOW_WORK: f64 = 0.5;
const PATH_WORK: f64 = 0.5;

/// What one pixel showed, and what that took.
#[derive(Clone, Copy, Default)]
pub(super) struct PixelTrial {
    radiance: Spectrum,
    work: f64,
}

/// A pixel painted in both ways, twice each: plain first.
pub(super) type BothTrials = [PixelTrial; 4];

impl ByteForm for BothTrials {
    fn write(&self, to: &mut Writer) {
        for tried in self {
            to.vector(tried.radiance);
            to.long(tried.work.to_bits());
        }
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        let mut all = [PixelTrial::default(); 4];
        for tried in &mut all {
            *tried = PixelTrial { radiance: from.vector()?, work: f64::from_bits(from.long()?) };
        }
        Some(all)
    }
}

/// A trial that is to be made.
pub(super) struct Trial<'a> {
    /// As it paints without a guide.
    integrator: &'a PathIntegrator<'a>,
    guide: &'a Arc<Guide>,
    pixels: Vec<(u32, u32)>,
}

impl<'a> Trial<'a> {
    /// `None`: there are too few pixels to try. `samples`: of the whole picture.
    pub(super) fn new(integrator: &'a PathIntegrator<'a>, samples: u64, guide: &'a Arc<Guide>) -> Option<Self> {
        let count = samples / SAMPLES_PER_TRIED / u64::from(4 * SAMPLES);
        if count < PIXELS_MIN {
            return None;
        }
        let count = count.min(PIXELS_MAX) as u32;
        let pixels = (0..count)
            .map(|index| {
                let place =
                    PixelSampler::new(LEARNING_SEED, 1, 0, index).get_2d(DimensionSet::CAMERA) * integrator.size;
                (place.x as u32, place.y as u32)
            })
            .collect();
        Some(Self { integrator, guide, pixels })
    }

    /// Paints all pixels.
    pub(super) fn alone(&self) -> Vec<BothTrials> {
        self.integrator.prepared.on_threads(|| self.tried(&self.pixels))
    }

    /// Paints all pixels with others.
    ///
    /// # Errors
    /// As [`Sharing::share`].
    pub(super) fn together(&self, others: &dyn Sharing) -> Result<Vec<BothTrials>, RenderError> {
        if self.pixels.len() < SHARED_MIN {
            return Ok(self.alone());
        }
        let here = |part: Range<usize>| Ok(self.integrator.prepared.on_threads(|| self.tried(&self.pixels[part])));
        in_parts(others, 0, self.pixels.len(), PARTS, here)
    }

    /// Whether it pays.
    pub(super) fn pays(&self, painted: &[BothTrials]) -> bool {
        let Self { integrator, guide, pixels } = self;
        let worth = |&(x, y): &(u32, u32)| guide.expected().at(integrator.place(x, y));
        let worths: Vec<f32> = pixels.iter().map(worth).collect();
        let [plain, by_worth] = [0, 2].map(|way| {
            let twice = || painted.iter().map(|tried| (tried[way], tried[way + 1]));
            let work = twice().map(|(once, _)| once.work).chain(twice().map(|(_, again)| again.work)).sum::<f64>();
            let mut errors: Vec<f64> = twice().zip(&worths).map(|((a, b), &worth)| error(a, b, worth)).collect();
            errors.sort_unstable_by(f64::total_cmp);
            let kept = errors.len() - (errors.len() as f64 * TRIM) as usize;
            errors[..kept].iter().sum::<f64>() * work
        });
        // (Neither is a number where nothing shines.)
        by_worth * GAIN_MIN < plain
    }

    /// Paints some pixels.
    fn tried(&self, pixels: &[(u32, u32)]) -> Vec<BothTrials> {
        let Self { integrator: plain, guide, .. } = self;
        let nothing = AgentUse { roulette: false, shadows: false, ..plain.settings.agents };
        let ways = [(nothing, 1), (nothing, 2), (plain.settings.agents, 1), (plain.settings.agents, 2)];
        let settings =
            ways.map(|(agents, seed)| PathSettings { seed: LEARNING_SEED + seed, agents, ..*plain.settings });
        let integrators = settings.each_ref().map(|settings| PathIntegrator {
            settings,
            splits: settings.agents.roulette,
            looks_rarely: settings.agents.shadows,
            camera: plain.camera.clone(),
            filter: plain.filter.clone(),
            guide: Some(Arc::clone(guide)),
            ..**plain
        });
        let of_chunk = |pixels: &[(u32, u32)]| {
            let samples: Vec<_> =
                pixels.iter().flat_map(|&(x, y)| (0..SAMPLES).map(move |sample| (x, y, sample))).collect();
            let mut painted = vec![BothTrials::default(); pixels.len()];
            let mut records = Vec::new();
            for (way, integrator) in integrators.iter().enumerate() {
                records.clear();
                compiled::run(Painting { integrator, samples: &samples, records: &mut records });
                let of_pixels = records.chunks_exact(SAMPLES as usize).map(pixel);
                painted.iter_mut().zip(of_pixels).for_each(|(both, tried)| both[way] = tried);
            }
            painted
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
