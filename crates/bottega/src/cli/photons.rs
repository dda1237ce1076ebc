//! The options of photon mapping.

use bottega_render::{PhotonFilter, PhotonSettings, photon::NEAREST_MAX};
use bottega_scene::PhotonHints;
use clap::Args;

use super::values::parse_share;

/// Photons that leave the lights where nothing else was asked for, and in each pass of a progressive picture.
const COUNT: u32 = 500_000;
const COUNT_IN_PASS: u32 = 100_000;
/// The most photons that anybody may ask for.
const COUNT_MAX: u32 = 100_000_000;
const GATHER: u32 = 60;
const RADIUS: f32 = 0.1;
const FINAL_RAYS: u32 = 4;

#[derive(Clone, Debug, Args)]
pub(crate) struct PhotonArgs {
    /// Photons that leave the lights; with --progressive in each pass. More of them show sharper caustics and finer changes
    /// of light, and take memory: some 20 bytes for each place where one arrives. Default: 500,000, progressive 100,000.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=COUNT_MAX as i64), help_heading = "Photon mapping")]
    pub(crate) photons: Option<u32>,
    /// Photons from which the light at a point is estimated: fewer are sharper, more are smoother. Default: 60.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=NEAREST_MAX as i64), help_heading = "Photon mapping")]
    pub(crate) photon_gather: Option<u32>,
    /// How far such photons may lie, as a share of the radius of what the camera sees, or of the scene where that is not much wider.
    /// Default: 0.1.
    #[arg(long, value_name = "R", value_parser = parse_share, help_heading = "Photon mapping")]
    pub(crate) photon_radius: Option<f32>,
    /// Rays of each sample that gather indirect light, their ends lit by photons. 0 takes the photons at the point itself:
    /// fast, and blotched. Default: 4.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=1024), help_heading = "Photon mapping")]
    pub(crate) final_rays: Option<u32>,
    /// Take indirect light on matte surfaces from places near by where its error is at most this share: 0.1 careful, 0.4
    /// coarse. Fast at many samples a pixel. Default: gather it anew for each sample.
    #[arg(long, value_name = "E", value_parser = parse_share, conflicts_with = "progressive", help_heading = "Photon mapping")]
    pub(crate) irradiance_cache: Option<f32>,
    /// Trace shadow rays only where photons that went on behind lit surfaces have not settled what is lit and what is not.
    #[arg(long, help_heading = "Photon mapping")]
    pub(crate) shadow_photons: bool,
    /// Photons of its own for each sample, looked for within a radius that shrinks: with more and more samples the picture
    /// becomes that of path tracing, caustics that paths do not find among it.
    #[arg(long, conflicts_with = "final_rays", help_heading = "Photon mapping")]
    pub(crate) progressive: bool,
}

impl PhotonArgs {
    /// - `bounces`: surfaces that light may come to.
    /// - `hints`: what the scene file says of photons, where its integrator is one of them; those are progressive, unless
    ///   the user asks for what they cannot have.
    pub(crate) fn settings(&self, bounces: u32, hints: Option<PhotonHints>) -> PhotonSettings {
        let is_plain = self.final_rays.is_some() || self.irradiance_cache.is_some();
        let progressive = self.progressive || hints.is_some() && !is_plain;
        let hints = hints.unwrap_or_default();
        let count = hints.count.filter(|_| progressive).map(|count| count.clamp(1, COUNT_MAX));
        let gather = hints.gather.map(|gather| gather.clamp(2, NEAREST_MAX as u32));
        let radius = hints.radius_share.filter(|&share| share <= 1.0);
        PhotonSettings {
            count: self.photons.or(count).unwrap_or(if progressive { COUNT_IN_PASS } else { COUNT }),
            gather: self.photon_gather.or(gather).unwrap_or(GATHER),
            radius: self.photon_radius.or(radius).unwrap_or(RADIUS),
            first_radius: hints.radius.filter(|_| self.photon_radius.is_none()),
            final_rays: self.final_rays.unwrap_or(FINAL_RAYS),
            bounces,
            filter: PhotonFilter::default(),
            irradiance_cache: self.irradiance_cache.unwrap_or(0.0),
            shadow_photons: self.shadow_photons,
            progressive,
            agents: None,
        }
    }
}
