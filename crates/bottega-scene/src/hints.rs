//! Render settings and metadata from a scene file.

use serde::{Deserialize, Serialize};

use crate::integrator::IntegratorHint;

/// The render settings that a file asks for. `None`: the file does not say; user settings take precedence. (Exposure is
/// not among them: importers fold it into the lights.)
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenderHints {
    /// Columns and rows of the whole picture, in pixels.
    pub resolution: Option<[u32; 2]>,
    /// Visible part of the picture, in pixels: first column, first row, number of columns, number of rows.
    pub crop: Option<[u32; 4]>,
    /// Number of samples per pixel.
    pub samples: Option<u32>,
    /// Maximal number of bounces: 0 is directly visible emission only, 1 direct light; `u32::MAX`: no limit.
    pub max_depth: Option<u32>,
    /// The integrator that the file names.
    pub integrator: Option<IntegratorHint>,
    /// The pixel filter.
    pub filter: Option<FilmFilter>,
    /// Maximal value of a channel of a sample: brighter samples are scaled down to it and keep their hue (pbrt's
    /// `maxcomponentvalue`).
    pub sample_max: Option<f32>,
    /// `true`: the film keeps alpha, and pixels that show no surface are transparent in formats with alpha.
    pub alpha: bool,
    /// `true`: the file has no light, and a neutral sky was added.
    pub is_sky_added: bool,
}

/// A separable pixel reconstruction filter. Radii are in pixels, from the centre to the edge. Workers with other
/// engines report their filter in this format.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum FilmFilter {
    /// A box: constant.
    Box {
        /// Half its width; 0.5: one pixel.
        radius: f32,
    },
    /// A tent: falls off linearly.
    Tent {
        /// Radius at which the filter reaches 0.
        radius: f32,
    },
    /// A Gaussian, shifted down so that it ends at 0.
    Gaussian {
        /// Radius at which the filter is cut off.
        radius: f32,
        /// Standard deviation, in pixels.
        sigma: f32,
    },
    /// The filter of Mitchell and Netravali 1988.
    Mitchell {
        /// Radius at which the filter ends.
        radius: f32,
        /// Parameter B of Mitchell and Netravali (1988).
        b: f32,
        /// Parameter C of Mitchell and Netravali (1988).
        c: f32,
    },
    /// The four-term Blackman-Harris window, close to a Gaussian.
    BlackmanHarris {
        /// Radius at which the filter ends.
        radius: f32,
    },
}

impl FilmFilter {
    /// Returns true if the filter's parameters are valid and its radius is at most 64 pixels.
    pub fn is_sound(&self) -> bool {
        let is_length = |value: f32| value > 0.0 && value <= 64.0;
        match *self {
            Self::Box { radius } | Self::Tent { radius } | Self::BlackmanHarris { radius } => is_length(radius),
            Self::Gaussian { radius, sigma } => is_length(radius) && is_length(sigma),
            Self::Mitchell { radius, b, c } => is_length(radius) && [b, c].iter().all(|value| value.abs() <= 64.0),
        }
    }

    /// The filter that covers one pixel evenly: a box with a radius of half a pixel.
    pub const PIXEL: Self = Self::Box { radius: 0.5 };
}

impl Default for FilmFilter {
    /// Returns a Blackman-Harris filter of radius 1.5.
    fn default() -> Self {
        Self::BlackmanHarris { radius: 1.5 }
    }
}

/// Facts about a scene file: its format, and the program that wrote it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Metadata {
    /// Name of the format.
    pub format: &'static str,
    /// Program that wrote the file; `None`: the file does not say.
    pub generator: Option<String>,
    /// Extensions of the format that the file uses.
    pub extensions: Vec<String>,
}
