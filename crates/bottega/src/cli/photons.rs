//! The options of photon mapping.

use bottega_render::{PhotonFilter, PhotonSettings, photon::NEAREST_MAX};
use clap::Args;

use super::values::parse_share;

/// Photons that leave the lights where nothing else was asked for, and in each pass of a progressive picture.
const COUNT: u32 = 500_000;
const COUNT_IN_PASS: u32 = 100_000;

#[derive(Clone, Debug, Args)]
pub(crate) struct PhotonArgs {
    /// Photons that leave the lights; with --progressive in each pass. More of them show sharper caustics and finer changes
    /// of light, and take memory: some 20 bytes for each place where one arrives. Default: 500,000, progressive 100,000.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000_000), help_heading = "Photon mapping")]
    pub(crate) photons: Option<u32>,
    /// Photons from which the light at a point is estimated: fewer are sharper, more are smoother.
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(2..=NEAREST_MAX as i64), help_heading = "Photon mapping")]
    pub(crate) photon_gather: u32,
    /// How far such photons may lie, as a share of the radius of the scene.
    #[arg(long, value_name = "R", default_value_t = 0.1, value_parser = parse_share, help_heading = "Photon mapping")]
    pub(crate) photon_radius: f32,
    /// Rays of each sample that gather indirect light, their ends lit by photons. 0 takes the photons at the point itself:
    /// fast, and blotched.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(0..=1024), help_heading = "Photon mapping")]
    pub(crate) final_rays: u32,
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
    pub(crate) fn settings(&self, bounces: u32) -> PhotonSettings {
        PhotonSettings {
            count: self.photons.unwrap_or(if self.progressive { COUNT_IN_PASS } else { COUNT }),
            gather: self.photon_gather,
            radius: self.photon_radius,
            first_radius: None,
            final_rays: self.final_rays,
            bounces,
            filter: PhotonFilter::default(),
            irradiance_cache: self.irradiance_cache.unwrap_or(0.0),
            shadow_photons: self.shadow_photons,
            progressive: self.progressive,
            agents: None,
        }
    }
}
