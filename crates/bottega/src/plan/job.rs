//! The settings of a picture's job: film, samples, zones and agents.

use bottega_engines::Tunables;
use bottega_farm::{Expert, JobSettings};
use bottega_image::{Aov, Layout, Rect};

use crate::{
    devices::threads,
    error::Error,
    loaded_scene::LoadedScene,
    request::{Request, SAMPLES_MAX},
    settings::{
        adaptation_rule, agents, auction_rule, band_width, group_layers, importance_function, level, optimization,
        own_layers, zone_limits,
    },
};

/// Samples per pixel if neither request nor scene gives a number.
const DEFAULT_SAMPLES: u32 = 64;
/// Maximum samples per pixel with a goal of error, if the request gives none.
const MOST_SAMPLES: u32 = 4096;
/// Maximum samples per pixel with a goal of time, if the request gives none; a picture may render all night.
const MOST_SAMPLES_IN_TIME: u32 = 1 << 16;

/// Returns the settings of a job for the built-in engine, with samples as its goal.
///
/// # Errors
/// The crop does not lie within the picture, or a layer is unknown.
pub(super) fn settings(
    request: &Request,
    scene: &LoadedScene,
    experts: Vec<Expert>,
    max_depth: u32,
) -> Result<JobSettings, Error> {
    // Choose the crop
    let frame = scene.frame();
    let crop = crop(request).or_else(|| hinted_crop(scene)).unwrap_or(frame);
    check_crop(&crop, &frame)?;
    let threads = threads(request);
    let tunables = Tunables { max_depth, light_samples: request.integrator.light_samples };
    let goal = &request.goal;
    let hinted = scene.hints.samples.filter(|_| goal.error.is_none() && goal.time.is_none());
    let samples =
        goal.samples.or(hinted).unwrap_or_else(|| default_sample_limit(request, DEFAULT_SAMPLES)).clamp(1, SAMPLES_MAX);
    let aovs = own_layers(request.film.layers.as_deref(), request.film.denoise)?;
    let catchers = if request.film.shadow_catchers.is_empty() { &[][..] } else { &Aov::CATCHERS };
    let aovs = aovs.iter().chain(catchers.iter().copied()).collect();
    let layout = Layout::with_layers(aovs, group_layers(&request.film.light_groups))
        .map_err(|error| Error::usage(format!("film.light_groups: {error}"), "rename the group"))?;
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
        prefetch: request.work.prefetch,
        shares_tail: request.work.share_tail,
        zones: request.work.zones,
        zone_limits: zone_limits(&request.work),
        bands: band_width(request.work.bands),
        verify: request.farm.verify.unwrap_or(1),
        strangers: request.farm.strangers,
        ..settings
    }
}

/// Returns the crop of the request, in pixels; `None`: the whole picture.
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
pub(crate) fn default_sample_limit(request: &Request, usual: u32) -> u32 {
    match (request.goal.error, request.goal.time) {
        (Some(_), _) => MOST_SAMPLES.max(usual),
        (_, Some(_)) => MOST_SAMPLES_IN_TIME.max(usual),
        _ => usual,
    }
}

/// Returns the crop of the scene file, clipped to the picture.
fn hinted_crop(scene: &LoadedScene) -> Option<Rect> {
    let [x, y, width, height] = scene.hints.crop?;
    let frame = scene.frame();
    let (x1, y1) = (x.saturating_add(width).min(frame.x1), y.saturating_add(height).min(frame.y1));
    (x < x1 && y < y1).then(|| Rect::new(x, y, x1, y1))
}
