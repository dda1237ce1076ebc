//! Conversion of spectra in scene files to linear Rec. 709.
//!
//! Rendering uses three colours; a spectrum is projected onto them once, on import. Formats differ in how, so each
//! convention has a function: [`Sampled::mitsuba_color`](sampled::Sampled::mitsuba_color) follows Mitsuba 3's variants
//! `*_rgb`; [`Sampled::pbrt_color`](sampled::Sampled::pbrt_color) matches what pbrt-v4 shows in an RGB film.

pub(crate) mod color_space;
pub(crate) mod file;
pub(crate) mod named;
mod observer;
pub(crate) mod role;
pub(crate) mod sampled;
#[cfg(test)]
mod tests;
