//! The settings of photons and lighting agents.

use bottega_render::{AgentSettings, Oracle, PhotonFilter, PhotonSettings};
use bottega_scene::PhotonHints;

use crate::request::{GATHER_MAX, LightingAgentOptions, OracleChoice, OracleQuestion, PHOTONS_MAX, PhotonOptions};

/// Default number of emitted photons: for a plain picture, and per pass of a progressive one.
const COUNT: u32 = 500_000;
const COUNT_IN_PASS: u32 = 100_000;
const GATHER: u32 = 60;
const RADIUS: f32 = 0.1;
const FINAL_RAYS: u32 = 4;

/// Returns the settings of photons: those of the request, those of the scene file, or the defaults.
///
/// - `bounces`: maximum number of bounces of light.
/// - `hints`: photon settings of the scene file, if its integrator uses photons; then the picture is progressive unless the
///   request excludes it.
pub fn photon_settings(options: &PhotonOptions, bounces: u32, hints: Option<PhotonHints>) -> PhotonSettings {
    let is_plain = options.final_rays.is_some() || options.irradiance_cache.is_some();
    let progressive = options.progressive || hints.is_some() && !is_plain;
    let hints = hints.unwrap_or_default();
    let count = hints.count.filter(|_| progressive).map(|count| count.clamp(1, PHOTONS_MAX));
    let gather = hints.gather.map(|gather| gather.clamp(2, GATHER_MAX));
    let radius = hints.radius_share.filter(|&share| share <= 1.0);
    PhotonSettings {
        count: options.count.or(count).unwrap_or(if progressive { COUNT_IN_PASS } else { COUNT }),
        gather: options.gather.or(gather).unwrap_or(GATHER),
        radius: options.radius.or(radius).unwrap_or(RADIUS),
        first_radius: hints.radius.filter(|_| options.radius.is_none()),
        final_rays: options.final_rays.unwrap_or(FINAL_RAYS),
        bounces,
        filter: PhotonFilter::default(),
        irradiance_cache: options.irradiance_cache.unwrap_or(0.0),
        lookouts: options.lookouts,
        shadow_photons: options.shadow_photons,
        gather_directions: options.gather_directions.unwrap_or(options.irradiance_cache.is_none()),
        separate_maps: options.separate_maps,
        indirect: options.indirect,
        progressive,
        agents: None,
    }
}

/// Returns the settings with lighting agents in place of all photons except those of caustics.
pub fn agent_photons(options: &LightingAgentOptions, photons: PhotonSettings) -> PhotonSettings {
    let decides = |question| options.decides.contains(&question);
    let agents = AgentSettings {
        cast: options.cast,
        oracle: match options.oracle {
            OracleChoice::Error => Oracle::Error,
            OracleChoice::Paper => Oracle::Paper,
        },
        error: options.error as f32,
        memory_bytes: options.memory_mb << 20,
        decides_shadows: decides(OracleQuestion::Shadows),
        // Without indirect light there are no questions about it.
        decides_irradiance: photons.indirect && decides(OracleQuestion::Irradiance),
        decides_radiance: decides(OracleQuestion::Radiance),
        asks_network: options.network,
    };
    PhotonSettings {
        agents: Some(agents),
        irradiance_cache: 0.0,
        shadow_photons: false,
        gather_directions: false,
        separate_maps: false,
        progressive: false,
        ..photons
    }
}
