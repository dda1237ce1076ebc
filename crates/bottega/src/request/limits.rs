//! The limits of request fields, the same for the command line, the HTTP API and Python.

/// Largest number of samples per pixel.
pub const SAMPLES_MAX: u32 = 1 << 22;
/// Largest number of bounces of light.
pub const DEPTH_MAX: u32 = 4096;
/// Largest number of light samples per bounce.
pub const LIGHT_SAMPLES_MAX: u32 = 1024;
/// Largest width and height of a picture, in pixels.
pub const SIDE_MAX: u32 = 1 << 16;
/// Largest number of rendered pixels of a picture: some 15 GB with all layers.
pub const PIXELS_MAX: u64 = 1 << 28;
/// Largest number of groups of lights.
pub const LIGHT_GROUPS_MAX: usize = bottega_render::LightGroups::MAX;
/// Largest number of characters of the name of a group of lights.
pub const LIGHT_GROUP_CHARS_MAX: usize = 64;
/// Largest number of photons emitted.
pub const PHOTONS_MAX: u32 = 100_000_000;
/// Largest number of photons in a density estimate.
pub const GATHER_MAX: u32 = bottega_render::photon::NEAREST_MAX as u32;
/// Largest number of final gather rays per sample.
pub const FINAL_RAYS_MAX: u32 = 1024;
/// Largest number of lighting agents cast from the lights.
pub const LIGHTING_AGENTS_MAX: u32 = 10_000_000;
/// Largest memory limit of lighting agents, in MiB.
pub const ORACLE_MEMORY_MAX: u64 = 1 << 20;
/// Largest number of work units that may wait in the work bin.
pub const BIN_MAX: u32 = 1 << 20;
/// Largest number of Render Agents, and of CPU threads.
pub const AGENTS_MAX: u16 = 1024;
/// The most zones that an agent works on at once.
pub const PREFETCH_MAX: u32 = bottega_farm::PREFETCH_MAX;
/// Largest number of zones of a picture.
pub const ZONES_MAX: u32 = 1 << 20;
/// Largest width of the interpolation bands between zones, in pixels.
pub const BAND_PIXELS_MAX: u32 = bottega_farm::BAND_MAX;
/// Range of the time limit of a picture, in seconds.
pub const SECONDS: std::ops::RangeInclusive<f64> = 0.1..=1e7;
/// Largest number of tags of a machine, and of tags that a job requires.
pub const TAGS_MAX: usize = 16;
/// Largest number of characters of a machine's tag.
pub const TAG_CHARS_MAX: usize = 32;
/// Default priority of a job on a farm.
pub const PRIORITY: u32 = 10;
/// Largest priority of a job on a farm.
pub const PRIORITY_MAX: u32 = 1000;
