//! The limits of what may be asked for, the same through every door.

/// Most samples of a pixel.
pub const SAMPLES_MAX: u32 = 1 << 22;
/// Most bounces of light.
pub const DEPTH_MAX: u32 = 4096;
/// Most light samples at each bounce.
pub const LIGHT_SAMPLES_MAX: u32 = 1024;
/// Most pixels of a side of a picture.
pub const SIDE_MAX: u32 = 1 << 16;
/// Most pixels that are painted of a picture: with all layers that is some 15 GB.
pub const PIXELS_MAX: u64 = 1 << 28;
/// Most photons that leave the lights.
pub const PHOTONS_MAX: u32 = 100_000_000;
/// Most photons from which the light at a point is estimated.
pub const GATHER_MAX: u32 = bottega_render::photon::NEAREST_MAX as u32;
/// Most rays of a sample that gather indirect light.
pub const FINAL_RAYS_MAX: u32 = 1024;
/// Most lighting agents that the lights cast.
pub const LIGHTING_AGENTS_MAX: u32 = 10_000_000;
/// Most megabytes that lighting agents may take.
pub const ORACLE_MEMORY_MAX: u64 = 1 << 20;
/// Most Render Agents, and most processors.
pub const AGENTS_MAX: u16 = 1024;
/// Most zones.
pub const ZONES_MAX: u32 = 1 << 20;
/// Smallest and greatest share of the picture's complexity that a zone may have at most.
pub const COMPLEXITY_SHARE: std::ops::RangeInclusive<f64> = 1e-6..=1.0;
/// Most pixels of the bands between zones.
pub const BAND_PIXELS_MAX: u32 = bottega_farm::BAND_MAX;
/// Shortest and longest time that a picture may take, in seconds.
pub const SECONDS: std::ops::RangeInclusive<f64> = 0.1..=1e7;
/// Smallest and greatest relative error that may be asked for.
pub const ERROR: std::ops::RangeInclusive<f64> = 1e-6..=10.0;
/// Smallest and greatest error of indirect light that lighting agents interpolate.
pub const ORACLE_ERROR: std::ops::RangeInclusive<f64> = 0.001..=1.0;
/// Most stops that a PNG is brightened or darkened by.
pub const STOPS_MAX: f32 = 40.0;
/// Most tags of a machine, or that a job requires.
pub const TAGS_MAX: usize = 16;
/// Most characters of a tag.
pub const TAG_CHARS_MAX: usize = 32;
/// What a job is worth to a farm where nobody says.
pub const PRIORITY: u32 = 10;
/// The most that a job can be worth.
pub const PRIORITY_MAX: u32 = 1000;
