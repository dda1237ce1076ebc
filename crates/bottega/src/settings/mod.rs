//! The settings that a request means to the engines and the farm, with the scene that it is of.

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
    text::duration,
};

/// Samples of a pixel where nobody says.
const DEFAULT_SAMPLES: u32 = 64;
/// The most samples of a pixel where an error is asked for, and nobody says.
const MOST_SAMPLES: u32 = 4096;
/// The same with a time: a picture may take all night.
const MOST_SAMPLES_IN_TIME: u32 = 1 << 16;
/// For so many samples the guide is learnt at most where nobody knows how many a pixel will get.
const PLANNED_SAMPLES_MAX: u32 = 256;
/// The least time that is given to painting, where a time for all of it was asked for and is not over.
const LEAST_PAINTING: Duration = Duration::from_millis(20);
/// Bounces where nobody says.
const DEFAULT_DEPTH: u32 = 16;

/// The settings of a job that our own engine paints.
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

/// What the settings of a job have of the request whoever paints it.
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

/// The part of the picture that is asked for.
pub(crate) fn crop(request: &Request) -> Option<Rect> {
    request.film.crop.map(|[x0, y0, x1, y1]| Rect::new(x0, y0, x1, y1))
}

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

/// Samples of a pixel where nobody says: `usual`, or as many as may be of use where an error or a time ends the picture.
pub(crate) fn samples_unasked(request: &Request, usual: u32) -> u32 {
    match (request.goal.error, request.goal.time) {
        (Some(_), _) => MOST_SAMPLES.max(usual),
        (_, Some(_)) => MOST_SAMPLES_IN_TIME.max(usual),
        _ => usual,
    }
}

/// When a zone is finished, for one who paints with others: their Master keeps the time.
pub fn shared_goal(request: &Request) -> Goal {
    request.goal.error.map_or(Goal::Samples, Goal::Error)
}

/// When a zone is finished. Loading, since `begun`, is a part of the time that was asked for, and so is `finishing`.
pub(crate) fn goal(request: &Request, begun: Instant, finishing: Duration) -> Result<Goal, Error> {
    match (request.goal.error, request.goal.time) {
        (Some(error), _) => Ok(Goal::Error(error)),
        (None, Some(time)) => match Duration::from_secs_f64(time).checked_sub(begun.elapsed()) {
            // What is painted first takes a moment; it is better late than never.
            Some(left) if !left.is_zero() => Ok(Goal::Time(left.saturating_sub(finishing).max(LEAST_PAINTING))),
            _ => Err(Error::failed(
                format!("reading the scene took {}, no less than the time for all of it", duration(begun.elapsed())),
                "give it more time",
            )),
        },
        (None, None) => Ok(Goal::Samples),
    }
}

/// Samples per pixel for which it is worth learning, as far as they are known before anything is painted.
pub(crate) fn planned_samples(job: &JobSettings) -> u32 {
    match job.goal {
        Goal::Samples => job.samples,
        Goal::Error(_) | Goal::Time(_) => job.samples.min(PLANNED_SAMPLES_MAX),
    }
}

/// Samples per pixel that a time allows, where paths take as long as those that an engine has just followed: for so many it is worth
/// learning. Others that run on this machine are in it.
pub(crate) fn samples_in_time(job: &JobSettings, engine: &BuiltinEngine) -> u32 {
    /// Columns and rows that are looked at, and the share of the time in which paths are followed.
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

/// Bounces of light.
pub fn max_depth(request: &Request, subject: &LoadedScene) -> u32 {
    request.integrator.max_depth.or(subject.hints.max_depth).map_or(DEFAULT_DEPTH, |depth| depth.min(DEPTH_MAX))
}

/// Agents for so many processors, where nobody says.
pub fn agents(asked: Option<u16>, threads: usize) -> usize {
    asked.map_or(threads.div_ceil(2), usize::from)
}

/// How the picture is cut.
pub fn level(level: u8) -> Level {
    Level::ALL[usize::from(level).min(Level::ALL.len() - 1)]
}

/// What zones must be like.
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

/// How the winners of an auction are found.
pub fn auction_rule(choice: AuctionChoice) -> AuctionRule {
    match choice {
        AuctionChoice::FinishingTime => AuctionRule::FinishingTime,
        AuctionChoice::Promised => AuctionRule::Promised,
        AuctionChoice::Paper => AuctionRule::Paper,
        AuctionChoice::Stealing => AuctionRule::Stealing,
    }
}

/// How agents learn their speed.
pub fn adaptation_rule(choice: AdaptationChoice) -> AdaptationRule {
    match choice {
        AdaptationChoice::Ratio => AdaptationRule::MedianRatio,
        AdaptationChoice::Paper => AdaptationRule::Paper,
    }
}

/// The measure of importance, of the channels that are on.
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

/// How samples are spread over a pixel.
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

/// The part of the picture that the file asks for, as far as it lies within.
fn hinted_crop(subject: &LoadedScene) -> Option<Rect> {
    let [x, y, width, height] = subject.hints.crop?;
    let frame = subject.frame();
    let (x1, y1) = (x.saturating_add(width).min(frame.x1), y.saturating_add(height).min(frame.y1));
    (x < x1 && y < y1).then(|| Rect::new(x, y, x1, y1))
}

/// How highlights are brought into range.
pub fn tone(tone: ToneCurve) -> ToneMap {
    match tone {
        ToneCurve::Agx => ToneMap::Agx,
        ToneCurve::Aces => ToneMap::Aces,
        ToneCurve::Linear => ToneMap::Linear,
    }
}

/// How a PNG's values are stored.
pub(crate) fn encoding(encoding: PngEncoding) -> Encoding {
    match encoding {
        PngEncoding::Srgb => Encoding::Srgb,
        PngEncoding::Linear => Encoding::Linear,
    }
}
