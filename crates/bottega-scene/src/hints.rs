//! Hints of a scene file about itself and about how it is rendered.

use serde::Deserialize;

use crate::integrator::IntegratorHint;

/// How a file wants to be painted. What it does not say is left open; what the user says goes first. (Exposure is none of
/// these: importers fold it into the lights.)
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderHints {
    /// Columns and rows of the whole picture.
    pub resolution: Option<[u32; 2]>,
    /// Part of the picture: first column and row, columns and rows.
    pub crop: Option<[u32; 4]>,
    /// Samples of each pixel.
    pub samples: Option<u32>,
    /// Bounces: 0 shows only emission seen directly, 1 direct light; `u32::MAX`: no limit.
    pub max_depth: Option<u32>,
    /// The integrator that the file names.
    pub integrator: Option<IntegratorHint>,
    /// The pixel filter.
    pub filter: Option<FilmFilter>,
    /// The greatest value that a channel of a sample may have: brighter samples are darkened to it, and keep their colour (pbrt's
    /// `maxcomponentvalue`).
    pub sample_max: Option<f32>,
    /// Whether the film keeps alpha: what shows no surface is transparent in formats that can tell.
    pub alpha: bool,
    /// Whether the file has no light, and a neutral sky was added.
    pub is_sky_added: bool,
}

/// A separable pixel filter. Radii are in pixels, from the centre to the edge. Workers of other engines tell theirs in these words.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum FilmFilter {
    /// Constant.
    Box {
        /// Half its width; 0.5 is one pixel.
        radius: f32,
    },
    /// Falls off linearly.
    Tent {
        /// Where it is 0.
        radius: f32,
    },
    /// The bell, shifted down so that it ends at 0.
    Gaussian {
        /// Where it ends.
        radius: f32,
        /// Standard deviation, in pixels.
        sigma: f32,
    },
    /// Mitchell and Netravali 1988.
    Mitchell {
        /// Where it ends.
        radius: f32,
        /// Their B.
        b: f32,
        /// Their C.
        c: f32,
    },
    /// The four-term window of Blackman and Harris: close to a Gaussian.
    BlackmanHarris {
        /// Where it ends.
        radius: f32,
    },
}

impl FilmFilter {
    /// Whether it is a filter at all, and reaches no further than any real one does.
    pub fn is_sound(&self) -> bool {
        let is_length = |value: f32| value > 0.0 && value <= 64.0;
        match *self {
            Self::Box { radius } | Self::Tent { radius } | Self::BlackmanHarris { radius } => is_length(radius),
            Self::Gaussian { radius, sigma } => is_length(radius) && is_length(sigma),
            Self::Mitchell { radius, b, c } => is_length(radius) && [b, c].iter().all(|value| value.abs() <= 64.0),
        }
    }

    /// The pixel itself.
    pub const PIXEL: Self = Self::Box { radius: 0.5 };
}

impl Default for FilmFilter {
    /// Blackman-Harris of radius 1.5.
    fn default() -> Self {
        Self::BlackmanHarris { radius: 1.5 }
    }
}

/// The metadata of a scene file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Metadata {
    /// Name of the format.
    pub format: &'static str,
    /// The program that wrote it.
    pub generator: Option<String>,
    /// Extensions of the format that it uses.
    pub extensions: Vec<String>,
}
