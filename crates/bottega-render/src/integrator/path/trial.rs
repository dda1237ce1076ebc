//! The trial of a learned guide: some pixels are rendered in all ways before the picture.
//!
//! A guide and its agents reduce the variance of independent paths. The samples of a pixel are stratified, and where
//! light is smooth that helps more than better directions, roulette or splitting. So some pixels are rendered in all
//! ways, twice each, and each zone of the picture takes the way with the least error times work. Two measures of error
//! count: relative to the pixel's brightness, and as a display shows it. Work is counted, not timed, so the decision is
//! the same on every machine.

use std::{ops::Range, sync::Arc};

use bottega_kernels::compiled;
use bottega_scene::Spectrum;
use rayon::prelude::*;

use super::{super::record::PathRecord, setup::PathIntegrator};
use crate::{
    error::RenderError,
    guide::{Guide, PaintPlan, PaintingWay},
    integrator::turns::SampleBatch,
    photon::bytes::{ByteForm, Reader, Writer},
    sampler::{DimensionSet, PixelSampler},
    sharing::{Sharing, in_parts},
};

/// Seed of the paths that the guide learns from and of the trials. No picture uses it: what is learned must not depend
/// on the picture's samples.
pub(super) const LEARNING_SEED: u64 = 0x6775_6964_655f_7365;
/// Samples of the whole picture per sample of the first trial (which decides whether to learn on) and of the last one.
const SAMPLES_PER_TRIED: [u64; 2] = [256, 40];
/// Least number of pixels in a trial. Fewer are not conclusive.
const PIXELS_MIN: u64 = 64;
/// Greatest number of pixels in a trial.
const PIXELS_MAX: u64 = 4096;
/// Greatest number of samples per pixel: enough for stratification to show.
const SAMPLES_MAX: u32 = 16;
/// Pixels that one thread renders in a row.
const PIXELS_PER_CHUNK: usize = 16;
/// Number of pixels from which machines share a trial: smaller ones take less time than their messages.
const SHARED_MIN: usize = 512;
/// Number of parts of a shared trial.
const PARTS: usize = 16;
/// Share of the pixels, those with the greatest errors, that do not count.
const TRIM: f64 = 0.005;
/// Factor by which error times work must fall, by the geometric mean of both measures.
const GAIN_MIN: f64 = 1.05;
/// Greatest factor by which error times work may rise by one of both measures.
const LOSS_MAX: f64 = 1.25;
/// Pixels tried per zone of the plan.
const PIXELS_PER_ZONE: f64 = 64.0;
/// Greatest number of zones along a side of the plan.
const ZONES_MAX: f64 = 8.0;
/// Weight of the result of all pixels in each zone, in pixels.
const COMMON_PIXELS: f64 = 32.0;
/// Factor by which another way must be better in a zone than the way of most of the picture: a zone has few pixels.
const ZONE_GAIN_MIN: f64 = 1.25;

/// Number of ways; each of them may be tried, twice.
const WAYS: usize = PaintingWay::ALL.len();

/// The mean radiance of one pixel in a trial, and the work that it took, in vertices.
#[derive(Clone, Copy, Default)]
pub(super) struct PixelTrial {
    radiance: Spectrum,
    work: f64,
}

/// One pixel rendered in all ways that are tried, twice each: entries 2 w and 2 w + 1 are of the way with number w.
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

/// A trial that has not run yet.
pub(super) struct Trial<'a> {
    /// The integrator without a guide.
    integrator: &'a PathIntegrator<'a>,
    guide: &'a Arc<Guide>,
    ways: Vec<PaintingWay>,
    pixels: Vec<(u32, u32)>,
    /// Samples per pixel, per way and repetition.
    samples: u32,
}

impl<'a> Trial<'a> {
    /// Creates the small trial that decides whether to learn on, of the way that uses most of what is learned.
    ///
    /// - `samples`: number of samples of the whole picture.
    pub(super) fn first(integrator: &'a PathIntegrator<'a>, samples: u64, guide: &'a Arc<Guide>) -> Self {
        let furthest = Self::ways(integrator).last().copied().unwrap_or_default();
        Self::new(integrator, samples, 0, guide, vec![PaintingWay::Plain, furthest])
    }

    /// Creates the trial that decides the plan.
    ///
    /// - `samples`: number of samples of the whole picture.
    pub(super) fn last(integrator: &'a PathIntegrator<'a>, samples: u64, guide: &'a Arc<Guide>) -> Self {
        Self::new(integrator, samples, 1, guide, Self::ways(integrator))
    }

    /// Returns the ways that differ under the integrator's settings.
    fn ways(integrator: &PathIntegrator<'_>) -> Vec<PaintingWay> {
        let agents = integrator.settings.agents;
        let by_worth = agents.roulette || agents.shadows;
        PaintingWay::ALL.into_iter().filter(|&way| way != PaintingWay::ByWorth || by_worth).collect()
    }

    fn new(
        integrator: &'a PathIntegrator<'a>,
        of_picture: u64,
        which: usize,
        guide: &'a Arc<Guide>,
        ways: Vec<PaintingWay>,
    ) -> Self {
        // Divide a share of the picture's samples among pixels, ways and two repetitions
        let tried = of_picture / SAMPLES_PER_TRIED[which];
        let samples = integrator.settings.planned_samples.clamp(1, SAMPLES_MAX);
        let count = (tried / (2 * ways.len() as u64 * u64::from(samples))).clamp(PIXELS_MIN, PIXELS_MAX) as u32;
        // Draw the pixels evenly over the picture
        let pixels = (0..count)
            .map(|index| {
                let place =
                    PixelSampler::new(LEARNING_SEED, 1, 0, index).get_2d(DimensionSet::CAMERA) * integrator.size;
                (place.x as u32, place.y as u32)
            })
            .collect();
        Self { integrator, guide, ways, pixels, samples }
    }

    /// Renders all pixels on this machine.
    pub(super) fn alone(&self) -> Vec<AllTrials> {
        self.integrator.prepared.on_threads(|| self.tried(&self.pixels))
    }

    /// Renders all pixels together with other machines.
    ///
    /// - `stage`: the number of the trial, 0 or 1.
    ///
    /// # Errors
    /// The same as [`Sharing::share`].
    pub(super) fn together(&self, others: &dyn Sharing, stage: u32) -> Result<Vec<AllTrials>, RenderError> {
        if self.pixels.len() < SHARED_MIN {
            return Ok(self.alone());
        }
        let here = |part: Range<usize>| Ok(self.integrator.prepared.on_threads(|| self.tried(&self.pixels[part])));
        in_parts(others, stage, self.pixels.len(), PARTS, here)
    }

    /// Compares the ways by the rendered pixels.
    pub(super) fn findings(&self, painted: &[AllTrials]) -> Findings {
        let Self { integrator, guide, pixels, .. } = self;
        // Compute squared errors and work of each pixel in each way
        let tally = |(&(x, y), tried): (&(u32, u32), &AllTrials)| {
            let place = integrator.place(x, y);
            (place, PixelTally::new(tried, guide.expected().at(place)))
        };
        let tallies: Vec<_> = pixels.iter().zip(painted).map(tally).collect();
        // Score each way over all pixels
        let common = Scores::new(&tallies.iter().map(|(_, tally)| tally).collect::<Vec<_>>(), &self.ways, None);
        Findings { ways: self.ways.clone(), tallies, common }
    }

    /// Renders some pixels.
    fn tried(&self, pixels: &[(u32, u32)]) -> Vec<AllTrials> {
        let Self { integrator: plain, guide, samples: count, .. } = *self;
        let settings =
            [1, 2].map(|seed| crate::settings::PathSettings { seed: LEARNING_SEED + seed, ..*plain.settings });
        let of_chunk = |pixels: &[(u32, u32)]| {
            let samples: Vec<_> =
                pixels.iter().flat_map(|&(x, y)| (0..count).map(move |sample| (x, y, sample))).collect();
            let mut painted = vec![AllTrials::default(); pixels.len()];
            let mut records = Vec::new();
            // Render all pixels of the chunk in each way, twice with different seeds
            for (way, again) in self.ways.iter().flat_map(|&way| [(way, 0), (way, 1)]) {
                let integrator = PathIntegrator { settings: &settings[again], ..plain.in_way(way, guide) };
                let number = 2 * way.number() + again;
                compiled::run(SampleBatch {
                    integrator: &integrator,
                    samples: &samples,
                    records: &mut records,
                    groups: None,
                });
                let is_guided = way != PaintingWay::Plain;
                let of_pixels = records.chunks_exact(count as usize).map(|samples| pixel(samples, is_guided));
                painted.iter_mut().zip(of_pixels).for_each(|(all, tried)| all[number] = tried);
            }
            painted
        };
        pixels.par_chunks(PIXELS_PER_CHUNK).map(of_chunk).flatten_iter().collect()
    }
}

/// Returns mean radiance and total work of one pixel's samples.
fn pixel(samples: &[PathRecord], is_guided: bool) -> PixelTrial {
    samples.iter().fold(PixelTrial::default(), |sum, record| PixelTrial {
        radiance: sum.radiance + Spectrum::from(record.values.radiance) / samples.len() as f32,
        work: sum.work + record.work(is_guided),
    })
}

/// Squared errors and work of one pixel in each way.
#[derive(Clone, Copy)]
struct PixelTally {
    /// Squared difference of the two repetitions: relative, and as a display shows it.
    errors: [[f64; 2]; WAYS],
    /// Work of both repetitions, in vertices.
    work: [f64; WAYS],
}

impl PixelTally {
    /// - `worth`: importance of light to the pixel.
    fn new(tried: &AllTrials, worth: f32) -> Self {
        // The square root stands for a display's curve: it is bit-identical on every machine.
        let shown = |light: Spectrum| {
            let [r, g, b] = light.to_array().map(|value| value.clamp(0.0, 1.0).sqrt());
            Spectrum::new(r, g, b)
        };
        let pair = |way: usize| [tried[2 * way], tried[2 * way + 1]];
        let error = |way: usize| {
            let [a, b] = pair(way).map(|tried| tried.radiance);
            let squared = |difference: Spectrum| f64::from(difference.length_squared());
            [squared((a - b) * worth), squared(shown(a) - shown(b))]
        };
        let all: [usize; WAYS] = std::array::from_fn(|way| way);
        Self { errors: all.map(error), work: all.map(|way| pair(way).iter().map(|tried| tried.work).sum()) }
    }
}

/// Returns the mean of the errors without the greatest ones.
fn trimmed(mut errors: Vec<f64>) -> f64 {
    let kept = errors.len() - (errors.len() as f64 * TRIM) as usize;
    errors.sort_unstable_by(f64::total_cmp);
    errors[..kept].iter().sum::<f64>() / kept.max(1) as f64
}

/// The results of a trial.
pub(super) struct Findings {
    ways: Vec<PaintingWay>,
    /// Tally of each pixel, with its position in the picture, in [0, 1)².
    tallies: Vec<([f32; 2], PixelTally)>,
    /// Scores over all pixels; `None`: not conclusive.
    common: Option<Scores>,
}

impl Findings {
    /// Returns the least error times work of any way, relative to the plain one, as a display shows it. Relative errors
    /// have rare outliers, which few pixels miss.
    pub(super) fn shown_ratio(&self) -> f64 {
        let tried = self.ways.iter().filter(|&&way| way != PaintingWay::Plain);
        let ratios = self.common.iter().flat_map(|Scores(scores)| tried.clone().map(|&way| scores[way.number()][1]));
        ratios.fold(f64::INFINITY, f64::min)
    }

    /// Returns the plan: the way that pays off in each zone.
    pub(super) fn plan(&self) -> PaintPlan {
        let Some(common) = self.common else { return PaintPlan::default() };
        // Sort the pixels into the zones of the plan
        let side = (self.tallies.len() as f64 / PIXELS_PER_ZONE).sqrt().floor().clamp(1.0, ZONES_MAX) as u32;
        let mut by_zone = vec![Vec::new(); (side * side) as usize];
        for (place, tally) in &self.tallies {
            by_zone[PaintPlan::zone([side, side], *place)].push(tally);
        }
        // Choose for each zone its own best way if it is clearly better than the picture's best
        let usual = common.best(&self.ways);
        let way = |zone: &Vec<&PixelTally>| {
            let Some(scores) = Scores::new(zone, &self.ways, Some(&common)) else { return usual };
            let own = scores.best(&self.ways);
            if scores.mean(own) * ZONE_GAIN_MIN < scores.mean(usual) { own } else { usual }
        };
        PaintPlan::new(side, side, by_zone.iter().map(way).collect()).unwrap_or_default()
    }
}

/// Error times work of each way relative to the plain one, by both measures of error.
#[derive(Clone, Copy)]
struct Scores([[f64; 2]; WAYS]);

impl Scores {
    /// Computes the scores of some pixels. `None`: not conclusive.
    ///
    /// - `common`: the scores of all pixels, blended in where there are few.
    fn new(tallies: &[&PixelTally], ways: &[PaintingWay], common: Option<&Self>) -> Option<Self> {
        let count = tallies.len() as f64;
        // Multiply the trimmed mean error by the total work
        let product = |way: usize, measure: usize| {
            let error = trimmed(tallies.iter().map(|tally| tally.errors[way][measure]).collect());
            error * tallies.iter().map(|tally| tally.work[way]).sum::<f64>()
        };
        // Divide by the plain way, and blend with the ratio of all pixels by their numbers
        let ratio = |way: usize, measure: usize| {
            let own = product(way, measure) / product(0, measure);
            match common {
                None => own,
                Some(Self(common)) => (count * own + COMMON_PIXELS * common[way][measure]) / (count + COMMON_PIXELS),
            }
        };
        let ratios = std::array::from_fn(|way| std::array::from_fn(|measure| ratio(way, measure)));
        // Not finite: a black zone, or radiance that is NaN
        let is_known = |way: &PaintingWay| ratios[way.number()].iter().all(|ratio: &f64| ratio.is_finite());
        ways.iter().all(is_known).then_some(Self(ratios))
    }

    /// Returns the geometric mean of both measures.
    fn mean(&self, way: PaintingWay) -> f64 {
        let [relative, seen] = self.0[way.number()];
        (relative * seen).sqrt()
    }

    /// Returns the best way by the mean of both measures. Ways that are much worse by one measure are left out.
    fn best(&self, ways: &[PaintingWay]) -> PaintingWay {
        // Leave out ways that are much worse by one measure
        let is_sound = |way: PaintingWay| self.0[way.number()].iter().all(|&ratio| ratio <= LOSS_MAX);
        let sound = ways.iter().copied().filter(|&way| is_sound(way));
        // Take the way with the least mean; the plain one unless the gain is clear
        let best = |best: PaintingWay, way: PaintingWay| if self.mean(way) < self.mean(best) { way } else { best };
        let best = sound.fold(PaintingWay::Plain, best);
        if self.mean(best) * GAIN_MIN < 1.0 { best } else { PaintingWay::Plain }
    }
}
