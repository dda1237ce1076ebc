//! The settings of engines and farm, from a request and its scene.

mod guiding;
mod layers;
mod photons;

use std::time::{Duration, Instant};

use bottega_engines::{BuiltinEngine, CancelSwitch, Tunables};
use bottega_farm::{
    AdaptationRule, AuctionRule, Balance, BandWidth, ChannelSet, Expert, Goal, ImportanceFunction, JobSettings, Level,
    Optimization, ZoneLimits,
};
use bottega_image::{Encoding, Layout, Rect, ToneMap};
use bottega_render::Filter;

pub(crate) use self::{guiding::asks_for_agents, layers::ALL as ALL_LAYERS};
pub use self::{
    guiding::{directions, guide_agents, whole_guide},
    layers::{GUIDES, own_layers},
    photons::{agent_photons, photon_settings},
};
use crate::{
    devices::threads,
    error::Error,
    loaded_scene::LoadedScene,
    request::{
        AdaptationChoice, AuctionChoice, BalanceChoice, BandChoice, DEPTH_MAX, ImportanceChoice, OptimizationChoice,
        PixelFilter, PngEncoding, Request, SAMPLES_MAX, ToneCurve, WorkOptions,
    },
};

/// Samples per pixel if neither request nor scene gives a number.
const DEFAULT_SAMPLES: u32 = 64;
/// Maximum samples per pixel with a goal of error, if the request gives none.
const MOST_SAMPLES: u32 = 4096;
/// Maximum samples per pixel with a goal of time, if the request gives none; a picture may render all night.
const MOST_SAMPLES_IN_TIME: u32 = 1 << 16;
/// Largest number of samples per pixel for which the guide is planned if the final number is unknown.
const PLANNED_SAMPLES_MAX: u32 = 256;
/// Shortest time left for rendering if the time limit has not passed yet.
const LEAST_PAINTING: Duration = Duration::from_millis(20);
/// Maximum number of bounces if neither request nor scene gives one.
const DEFAULT_DEPTH: u32 = 16;

/// Returns the settings of a job for the built-in engine.
///
/// # Errors
/// The crop does not lie within the picture, or a layer is unknown.
pub fn job_settings(request: &Request, subject: &LoadedScene, experts: Vec<Expert>) -> Result<JobSettings, Error> {
    let frame = subject.frame();
    let crop = crop(request).or_else(|| hinted_crop(subject)).unwrap_or(frame);
    check_crop(&crop, &frame)?;
    let threads = threads(request);
    let tunables = Tunables { max_depth: max_depth(request, subject), light_samples: request.integrator.light_samples };
    let goal = &request.goal;
    let hinted = subject.hints.samples.filter(|_| goal.error.is_none() && goal.time.is_none());
    let samples =
        goal.samples.or(hinted).unwrap_or_else(|| samples_unasked(request, DEFAULT_SAMPLES)).clamp(1, SAMPLES_MAX);
    let layout = Layout::new(own_layers(request.film.layers.as_deref(), request.film.denoise)?);
    Ok(JobSettings {
        agents: agents(request.work.agents, threads),
        ..shared_settings(
            request,
            crop,
            experts,
            JobSettings::new(frame.width(), frame.height(), samples, tunables, layout),
        )
    })
}

/// Adds the settings of the request that do not depend on the engine.
pub(crate) fn shared_settings(
    request: &Request,
    crop: Rect,
    experts: Vec<Expert>,
    settings: JobSettings,
) -> JobSettings {
    JobSettings {
        crop,
        level: level(request.work.level),
        optimization: optimization(request.work.optimization),
        experts,
        processors: threads(request),
        importance: importance_function(&request.work),
        auction: auction_rule(request.work.auction),
        adaptation: adaptation_rule(request.work.adaptation),
        zones: request.work.zones,
        zone_limits: zone_limits(&request.work),
        bands: band_width(request.work.bands),
        verify: request.farm.verify.unwrap_or(1),
        strangers: request.farm.strangers,
        ..settings
    }
}

/// Returns the crop of the request.
pub(crate) fn crop(request: &Request) -> Option<Rect> {
    request.film.crop.map(|[x0, y0, x1, y1]| Rect::new(x0, y0, x1, y1))
}

/// Checks that a crop lies within the picture.
///
/// # Errors
/// The crop does not lie within the picture.
pub(crate) fn check_crop(crop: &Rect, frame: &Rect) -> Result<(), Error> {
    if frame.encloses(crop) {
        return Ok(());
    }
    Err(Error::usage(
        format!("the crop {crop} is not within the picture of {}x{}", frame.width(), frame.height()),
        "x1 and y1 may be at most the picture's width and height",
    ))
}

/// Returns the samples per pixel if the request gives none: `usual`, or the maximum if an error or a time ends the picture.
pub(crate) fn samples_unasked(request: &Request, usual: u32) -> u32 {
    match (request.goal.error, request.goal.time) {
        (Some(_), _) => MOST_SAMPLES.max(usual),
        (_, Some(_)) => MOST_SAMPLES_IN_TIME.max(usual),
        _ => usual,
    }
}

/// Returns the goal of zones for an agent of another process's job, whose Master enforces the time.
pub fn shared_goal(request: &Request) -> Goal {
    request.goal.error.map_or(Goal::Samples, Goal::Error)
}

/// Returns the goal of zones. The time since `begun` and the estimate `finishing` are subtracted from a requested time.
pub(crate) fn goal(request: &Request, begun: Instant, finishing: Duration) -> Goal {
    match (request.goal.error, request.goal.time) {
        (Some(error), _) => Goal::Error(error),
        (None, Some(time)) => {
            let left = Duration::from_secs_f64(time).saturating_sub(begun.elapsed() + finishing);
            // Allow at least a moment for rendering: late is better than no picture.
            Goal::Time(left.max(LEAST_PAINTING))
        }
        (None, None) => Goal::Samples,
    }
}

/// Returns the samples per pixel for which learning is planned, as known before rendering.
pub(crate) fn planned_samples(job: &JobSettings) -> u32 {
    match job.goal {
        Goal::Samples => job.samples,
        Goal::Error(_) | Goal::Time(_) => job.samples.min(PLANNED_SAMPLES_MAX),
    }
}

/// Returns the samples per pixel that a time limit allows, measured with a short trial of the engine under the present load.
/// Learning is planned for this number.
pub(crate) fn samples_in_time(job: &JobSettings, engine: &BuiltinEngine) -> u32 {
    /// Columns and rows of the trial, and the share of the time spent on tracing paths.
    const LOOK: (u32, u32) = (48, 36);
    const PAINTING: f64 = 0.8;
    let Goal::Time(time) = job.goal else { return planned_samples(job) };
    let begun = Instant::now();
    if !matches!(engine.glimpse(LOOK, 1, &CancelSwitch::default()), Ok(Some(_))) {
        return planned_samples(job);
    }
    let path = begun.elapsed().as_secs_f64() / f64::from(LOOK.0 * LOOK.1);
    let samples = PAINTING * time.as_secs_f64() / (path * job.crop.area() as f64).max(1e-9);
    (samples as u32).clamp(1, planned_samples(job))
}

/// Returns the maximum number of bounces.
pub fn max_depth(request: &Request, subject: &LoadedScene) -> u32 {
    request.integrator.max_depth.or(subject.hints.max_depth).map_or(DEFAULT_DEPTH, |depth| depth.min(DEPTH_MAX))
}

/// Returns the number of Render Agents: the requested one, else one per two CPU threads.
pub fn agents(asked: Option<u16>, threads: usize) -> usize {
    asked.map_or(threads.div_ceil(2), usize::from)
}

/// Returns the level of division into zones.
pub fn level(level: u8) -> Level {
    Level::ALL[usize::from(level).min(Level::ALL.len() - 1)]
}

/// Returns the limits on zones.
pub fn zone_limits(work: &WorkOptions) -> ZoneLimits {
    ZoneLimits {
        side_min: work.zone_min_size,
        complexity_max: work.zone_max_complexity,
        similarity: work.zone_similarity,
        balance: match work.zone_balance {
            BalanceChoice::Time => Balance::Time,
            BalanceChoice::Ratio => Balance::Ratio,
        },
    }
}

fn band_width(bands: BandChoice) -> BandWidth {
    match bands {
        BandChoice::Off => BandWidth::Off,
        BandChoice::Rules => BandWidth::Rules,
        BandChoice::Pixels(pixels) => BandWidth::Pixels(pixels),
    }
}

fn optimization(optimization: OptimizationChoice) -> Optimization {
    match optimization {
        OptimizationChoice::Off => Optimization::Off,
        OptimizationChoice::Vs => Optimization::VerySmall,
        OptimizationChoice::S => Optimization::Small,
        OptimizationChoice::N => Optimization::Normal,
        OptimizationChoice::B => Optimization::Big,
        OptimizationChoice::Vb => Optimization::VeryBig,
    }
}

/// Returns the rule that decides auctions.
pub fn auction_rule(choice: AuctionChoice) -> AuctionRule {
    match choice {
        AuctionChoice::FinishingTime => AuctionRule::FinishingTime,
        AuctionChoice::Promised => AuctionRule::Promised,
        AuctionChoice::Paper => AuctionRule::Paper,
        AuctionChoice::Stealing => AuctionRule::Stealing,
    }
}

/// Returns the rule by which agents adapt V_cp.
pub fn adaptation_rule(choice: AdaptationChoice) -> AdaptationRule {
    match choice {
        AdaptationChoice::Ratio => AdaptationRule::MedianRatio,
        AdaptationChoice::Paper => AdaptationRule::Paper,
    }
}

/// Returns the measure of the importance map, with its channels.
pub fn importance_function(work: &WorkOptions) -> ImportanceFunction {
    let channels = match &work.channels {
        Some(channels) => channels.iter().copied().collect::<ChannelSet>(),
        None => ChannelSet::ALL,
    };
    match work.importance {
        ImportanceChoice::Predicted => ImportanceFunction::PredictedCost(channels),
        ImportanceChoice::Paper => ImportanceFunction::Paper,
        ImportanceChoice::Visual => ImportanceFunction::Visual(channels),
    }
}

/// Returns the pixel filter.
pub(crate) fn filter(request: &Request, subject: &LoadedScene) -> Filter {
    match request.film.filter {
        None => subject.hints.filter.unwrap_or_default(),
        Some(PixelFilter::BlackmanHarris) => Filter::default(),
        Some(PixelFilter::Gaussian) => Filter::Gaussian { radius: 1.5, sigma: 0.5 },
        Some(PixelFilter::Tent) => Filter::Tent { radius: 1.0 },
        Some(PixelFilter::Mitchell) => Filter::Mitchell { radius: 2.0, b: 1.0 / 3.0, c: 1.0 / 3.0 },
        Some(PixelFilter::Box) => Filter::PIXEL,
    }
}

/// Returns the crop of the scene file, clipped to the picture.
fn hinted_crop(subject: &LoadedScene) -> Option<Rect> {
    let [x, y, width, height] = subject.hints.crop?;
    let frame = subject.frame();
    let (x1, y1) = (x.saturating_add(width).min(frame.x1), y.saturating_add(height).min(frame.y1));
    (x < x1 && y < y1).then(|| Rect::new(x, y, x1, y1))
}

/// Returns the tone curve.
pub fn tone(tone: ToneCurve) -> ToneMap {
    match tone {
        ToneCurve::Agx => ToneMap::Agx,
        ToneCurve::Aces => ToneMap::Aces,
        ToneCurve::Linear => ToneMap::Linear,
    }
}

/// Returns the encoding of PNG values.
pub(crate) fn encoding(encoding: PngEncoding) -> Encoding {
    match encoding {
        PngEncoding::Srgb => Encoding::Srgb,
        PngEncoding::Linear => Encoding::Linear,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::GoalOptions;

    #[test]
    fn a_time_that_reading_the_scene_has_used_up_leaves_a_moment_for_the_picture() {
        let timed =
            Request { goal: GoalOptions { time: Some(0.001), ..GoalOptions::default() }, ..Request::new("a.glb") };
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_millis(2) {
            std::hint::spin_loop();
        }
        assert_eq!(goal(&timed, begun, Duration::ZERO), Goal::Time(LEAST_PAINTING));
        let long = Request { goal: GoalOptions { time: Some(3600.0), ..GoalOptions::default() }, ..timed };
        let Goal::Time(left) = goal(&long, begun, Duration::from_secs(600)) else { panic!("it has a time") };
        assert!(left < Duration::from_secs(3000) && left > Duration::from_secs(2000), "{left:?}");
    }
}
