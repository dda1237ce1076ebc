//! The description of hair: what is in a fibre, and how a surface says where its fibres run.

use serde::{Deserialize, Serialize};

use crate::param::{ColorParam, ScalarParam};

/// The absorption of light within a fibre, by one of three parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pigment {
    /// Absorption coefficient σ_a within the fibre, per radius of the fibre.
    SigmaA(ColorParam),
    /// Reflectance of many fibres, in [0, 1], from which σ_a follows.
    Reflectance(ColorParam),
    /// Concentrations of the two pigments of human hair: about 0.3 for blond, 1.3 for brown and 8 for black hair.
    Melanin {
        /// Concentration of the brown pigment.
        eumelanin: ScalarParam,
        /// Concentration of the red pigment.
        pheomelanin: ScalarParam,
    },
}

/// The direction of fibres on a surface.
///
/// Meshes that are the hull of [curves](crate::FacingCurves) take it from the curves; this setting is for other meshes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Strand {
    /// A fibre runs along u, and v goes from 0 to 1 across its width, as of a ribbon (pbrt).
    #[default]
    AlongU,
    /// A fibre runs along v, and the surface is its round mantle (Mitsuba).
    AlongV,
}

/// The scattering of fibres of hair or fur (Chiang et al. 2016, A Practical and Controllable Hair and Fur Model for
/// Production Path Tracing).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hair {
    /// Absorption within a fibre.
    pub pigment: Pigment,
    /// Index of refraction of the fibre over that of the outside.
    pub eta: f32,
    /// Longitudinal roughness, in [0, 1].
    pub beta_m: ScalarParam,
    /// Azimuthal roughness, in [0, 1].
    pub beta_n: ScalarParam,
    /// Angle of the scales on the fibre, in degrees, in [−90, 90].
    pub alpha: f32,
    /// Direction of the fibres.
    pub strand: Strand,
}

impl Default for Hair {
    /// Returns brown hair.
    fn default() -> Self {
        Self {
            pigment: Pigment::Melanin { eumelanin: 1.3.into(), pheomelanin: 0.0.into() },
            eta: 1.55,
            beta_m: 0.3.into(),
            beta_n: 0.3.into(),
            alpha: 2.0,
            strand: Strand::AlongU,
        }
    }
}

impl Hair {
    /// Appends its colour and number parameters.
    pub(crate) fn add_params<'a>(&'a self, colors: &mut Vec<&'a ColorParam>, scalars: &mut Vec<&'a ScalarParam>) {
        match &self.pigment {
            Pigment::SigmaA(color) | Pigment::Reflectance(color) => colors.push(color),
            Pigment::Melanin { eumelanin, pheomelanin } => scalars.extend([eumelanin, pheomelanin]),
        }
        scalars.extend([&self.beta_m, &self.beta_n]);
    }
}
