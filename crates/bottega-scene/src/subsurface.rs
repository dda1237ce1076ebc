//! Subsurface scattering: light enters a solid, is scattered inside, and leaves it elsewhere.

use serde::{Deserialize, Serialize};

use crate::param::{ColorParam, ScalarParam};

/// The substance below a surface, as of skin, wax, milk or marble.
///
/// Light that the surface does not reflect enters diffusely, is scattered in a homogeneous medium, and leaves diffusely
/// where it meets the solid's surface from inside. The solid's mesh must be closed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Subsurface {
    /// Share of the diffuse light that enters, in [0, 1]. The rest is reflected where it arrives.
    pub weight: ScalarParam,
    /// The medium inside.
    pub substance: Substance,
    /// Henyey-Greenstein asymmetry of the medium, in (−1, 1).
    pub g: f32,
    /// Index of refraction that decides how much light the surface reflects back inside, at least 1; 1: none.
    pub inner_eta: f32,
}

/// The medium below a surface, by the colour that it gives the surface, or by its coefficients.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Substance {
    /// The medium of which a flat, thick slab reflects the base colour of the surface.
    Colored {
        /// Distance that light travels inside, per channel, in scene units.
        radius: ColorParam,
        /// The meaning of the distance.
        meaning: RadiusMeaning,
    },
    /// A medium by its coefficients.
    Coefficients {
        /// Absorption coefficient σ_a, per scene unit.
        absorption: ColorParam,
        /// Scattering coefficient σ_s, per scene unit.
        scattering: ColorParam,
    },
}

/// The meaning of the radius of [`Substance::Colored`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RadiusMeaning {
    /// The mean free path 1 / σ_t.
    MeanFreePath,
    /// The distance over which diffuse light fades to 1 / e, of a dipole at a boundary with this index of refraction (Jensen,
    /// Marschner, Levoy and Hanrahan 2001, *A Practical Model for Subsurface Light Transport*).
    DiffuseMeanFreePath(f32),
}
