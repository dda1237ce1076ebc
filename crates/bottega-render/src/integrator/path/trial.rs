//! The trial of what was learnt: on a few pixels beforehand, which are painted in all ways.
//!
//! What a guide and its agents say is about independent paths. Those of a pixel are spread evenly, and where light is smooth that is
//! worth more than better directions, or than to end paths here and to split them there. So some pixels are painted in all ways, twice
//! each, and each zone of the picture takes the way with the least error times work. Both measures of error count: that relative to
//! what a pixel shows, and that of what a display shows of it. Work is counted, not timed: the answer is the same everywhere.

use std::{ops::Range, sync::Arc};

use bottega_kernels::compiled;
use bottega_scene::Spectrum;
use rayon::prelude::*;

use super::{super::record::PathRecord, setup::PathIntegrator};
use crate::{
    RenderError, Sharing,
    guide::{Guide, PaintPlan, PaintingWay},
    integrator::turns::Painting,
    photon::bytes::{ByteForm, Reader, Writer},
    sampler::{DimensionSet, PixelSampler},
    sharing::in_parts,
};

/// Seed of the paths that the guide learns from and is tried by, which no picture shares: what is learnt must not know the picture's
/// samples.
pub(super) const LEARNING_SEED: u64 = 0x6775_6964_655f_7365;
/// Samples of the whole picture for each that is tried, and pixels that are tried, at most.
const SAMPLES_PER_TRIED: u64 = 40;
const PIXELS_MAX: u64 = 4096;
/// Fewer of them tell nothing.
const PIXELS_MIN: u64 = 64;
/// Samples of each pixel, if the picture has as many: enough that their being spread evenly counts.
const SAMPLES_MAX: u32 = 16;
/// Pixels that one processor tries in a row.
const PIXELS_PER_CHUNK: usize = 16;
/// Pixels from which on machines share the trial, and in how many parts: each takes more than to tell of it.
const SHARED_MIN: usize = 1024;
const PARTS: usize = 16;
/// Share of the pixels, the worst ones, that do not count.
const TRIM: f64 = 0.005;
/// By what factor error times work must fall.
const GAIN_MIN: f64 = 1.05;
/// Pixels tried for each zone that the picture is cut into, and zones along a side at most. What all pixels say counts in each zone
/// as much as so many of its own.
const PIXELS_PER_ZONE: f64 = 64.0;
const ZONES_MAX: f64 = 8.0;
const COMMON_PIXELS: f64 = 32.0;

/// Ways that are tried, each twice.
const WAYS: usize = PaintingWay::ALL.len();

/// What one pixel showed, and what that took.
#[derive(Clone, Copy, Default)]
pub(super) struct PixelTrial {
    radiance: Spectrum,
    work: f64,
}

/// A pixel painted in all ways, twice each: the first way first.
pub(super) type AllTrials = [PixelTrial; 2 * WAYS];

impl ByteForm for AllTrials {
    fn write(&self, to: &mut Writer) {
        for tried in self {
            to.vector(tried.radiance);
            to.long(tried.work.to_bits());
        }
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        let mut all = [PixelTrial::default(); 2 * WAYS];
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
    /// Of each pixel, in each way and each time.
    samples: u32,
}

impl<'a> Trial<'a> {
    /// `None`: there are too few pixels to try. `samples`: of the whole picture.
    pub(super) fn new(integrator: &'a PathIntegrator<'a>, samples: u64, guide: &'a Arc<Guide>) -> Option<Self> {
        let of_pixel = integrator.settings.planned_samples.clamp(1, SAMPLES_MAX);
        let count = samples / SAMPLES_PER_TRIED / (2 * WAYS as u64 * u64::from(of_pixel));
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
        Some(Self { integrator, guide, pixels, samples: of_pixel })
    }

    /// Paints all pixels.
    pub(super) fn alone(&self) -> Vec<AllTrials> {
        self.integrator.prepared.on_threads(|| self.tried(&self.pixels))
    }

    /// Paints all pixels with others.
    ///
    /// # Errors
    /// As [`Sharing::share`].
    pub(super) fn together(&self, others: &dyn Sharing) -> Result<Vec<AllTrials>, RenderError> {
        if self.pixels.len() < SHARED_MIN {
            return Ok(self.alone());
        }
        let here = |part: Range<usize>| Ok(self.integrator.prepared.on_threads(|| self.tried(&self.pixels[part])));
        in_parts(others, 0, self.pixels.len(), PARTS, here)
    }

    /// Which way pays in each zone.
    pub(super) fn plan(&self, painted: &[AllTrials]) -> PaintPlan {
        let Self { integrator, guide, pixels, .. } = self;
        let tallies: Vec<Tally> = pixels
            .iter()
            .zip(painted)
            .map(|(&(x, y), tried)| Tally::new(tried, guide.expected().at(integrator.place(x, y))))
            .collect();
        let all: Vec<&Tally> = tallies.iter().collect();
        let Some(common) = Scores::new(&all, None) else { return PaintPlan::default() };
        eprintln!("trial {} pixels {:.3?} work {:.3?}", pixels.len(), common.0, [1,2].map(|w| tallies.iter().map(|t| t.work[w]).sum::<f64>()/tallies.iter().map(|t| t.work[0]).sum::<f64>()));
        let side = (pixels.len() as f64 / PIXELS_PER_ZONE).sqrt().floor().clamp(1.0, ZONES_MAX) as u32;
        let mut by_zone = vec![Vec::new(); (side * side) as usize];
        for (&(x, y), tally) in pixels.iter().zip(&tallies) {
            by_zone[PaintPlan::zone([side, side], integrator.place(x, y))].push(tally);
        }
        let way = |zone: &Vec<&Tally>| Scores::new(zone, Some(&common)).unwrap_or(common).best();
        PaintPlan::new(side, side, by_zone.iter().map(way).collect()).unwrap_or_default()
    }

    /// Paints some pixels.
    fn tried(&self, pixels: &[(u32, u32)]) -> Vec<AllTrials> {
        let Self { integrator: plain, guide, samples: count, .. } = *self;
        let settings = [1, 2].map(|seed| crate::PathSettings { seed: LEARNING_SEED + seed, ..*plain.settings });
        let of_chunk = |pixels: &[(u32, u32)]| {
            let samples: Vec<_> =
                pixels.iter().flat_map(|&(x, y)| (0..count).map(move |sample| (x, y, sample))).collect();
            let mut painted = vec![AllTrials::default(); pixels.len()];
            let mut records = Vec::new();
            for (number, place) in (0..2 * WAYS).map(|number| (number, &settings[number % 2])) {
                let way = PaintingWay::ALL[number / 2];
                let integrator = PathIntegrator { settings: place, ..plain.in_way(way, guide) };
                compiled::run(Painting { integrator: &integrator, samples: &samples, records: &mut records });
                let is_guided = way != PaintingWay::Plain;
                let of_pixels = records.chunks_exact(count as usize).map(|samples| pixel(samples, is_guided));
                painted.iter_mut().zip(of_pixels).for_each(|(all, tried)| all[number] = tried);
            }
            painted
        };
        pixels.par_chunks(PIXELS_PER_CHUNK).map(of_chunk).flatten_iter().collect()
    }
}

fn pixel(samples: &[PathRecord], is_guided: bool) -> PixelTrial {
    samples.iter().fold(PixelTrial::default(), |sum, record| PixelTrial {
        radiance: sum.radiance + Spectrum::from(record.values.radiance) / samples.len() as f32,
        work: sum.work + record.work(is_guided),
    })
}

/// Of one pixel in each way.
#[derive(Clone, Copy)]
struct Tally {
    /// By relative error, and by what a display shows.
    errors: [[f64; 2]; WAYS],
    work: [f64; WAYS],
}

impl Tally {
    /// - `worth`: what light is worth to the pixel.
    fn new(tried: &AllTrials, worth: f32) -> Self {
        let pair = |way: usize| [tried[2 * way], tried[2 * way + 1]];
        let error = |way: usize| {
            let [a, b] = pair(way).map(|tried| tried.radiance);
            // The root stands for the curve of a display: it has the same bits everywhere.
            let seen = |light: Spectrum| {
                let [r, g, b] = light.to_array().map(|value| value.clamp(0.0, 1.0).sqrt());
                Spectrum::new(r, g, b)
            };
            let squared = |difference: Spectrum| f64::from(difference.length_squared());
            [squared((a - b) * worth), squared(seen(a) - seen(b))]
        };
        let all: [usize; WAYS] = std::array::from_fn(|way| way);
        Self { errors: all.map(error), work: all.map(|way| pair(way).iter().map(|tried| tried.work).sum()) }
    }
}

/// Error times work of each way over that of the plain one, by both measures of error.
#[derive(Clone, Copy)]
struct Scores([[f64; 2]; WAYS]);

impl Scores {
    /// Of some pixels. `None`: they tell nothing.
    ///
    /// - `common`: what all pixels say.
    fn new(tallies: &[&Tally], common: Option<&Self>) -> Option<Self> {
        let count = tallies.len() as f64;
        let kept = tallies.len() - (count * TRIM) as usize;
        let product = |way: usize, measure: usize| {
            let mut errors: Vec<f64> = tallies.iter().map(|tally| tally.errors[way][measure]).collect();
            errors.sort_unstable_by(f64::total_cmp);
            errors[..kept].iter().sum::<f64>() * tallies.iter().map(|tally| tally.work[way]).sum::<f64>()
        };
        let ratio = |way: usize, measure: usize| {
            let own = product(way, measure) / product(0, measure);
            match common {
                None => own,
                Some(Self(common)) => (count * own + COMMON_PIXELS * common[way][measure]) / (count + COMMON_PIXELS),
            }
        };
        let ratios = std::array::from_fn(|way| std::array::from_fn(|measure| ratio(way, measure)));
        // (Nothing shines there, or what shines is no number.)
        ratios.iter().flatten().all(|ratio: &f64| ratio.is_finite()).then_some(Self(ratios))
    }

    /// The way that pays best by the measure by which it pays least.
    fn best(&self) -> PaintingWay {
        let worse = |way: PaintingWay| self.0[way.number()].iter().copied().fold(0.0, f64::max);
        let best = |best: PaintingWay, way: PaintingWay| if worse(way) < worse(best) { way } else { best };
        let best = PaintingWay::ALL.into_iter().fold(PaintingWay::Plain, best);
        if worse(best) * GAIN_MIN < worse(PaintingWay::Plain) { best } else { PaintingWay::Plain }
    }
}
