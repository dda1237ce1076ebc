//! Conversion of spectra in scene files to linear Rec. 709.
//!
//! Rendering uses three colours; a spectrum is projected onto them once, on import. Formats differ in how, so each
//! convention has a function: [`mitsuba_color`](sampled::SampledSpectrum::mitsuba_color) follows Mitsuba 3's variants `*_rgb`;
//! [`pbrt_color`](sampled::SampledSpectrum::pbrt_color) matches pictures of pbrt-v4 in an RGB film.

pub(crate) mod color_space;
pub(crate) mod file;
pub(crate) mod named;
mod observer;
pub(crate) mod role;
pub(crate) mod sampled;
#[cfg(test)]
mod tests;
