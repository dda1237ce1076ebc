//! Incident light at a point, and the points that receive it.

use bottega_scene::{Spectrum, Visibility};
use glam::Vec3;

use crate::density::SolidAnglePdf;

/// Index that stands for "no light".
pub(crate) const NO_LIGHT: u32 = u32::MAX;

/// Light that reaches a point from one direction, as drawn by light sampling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LightSample {
    /// Direction from the point to the light, unit length.
    pub(crate) wi: Vec3,
    /// Distance to the light; infinite for lights at infinity.
    pub(crate) distance: f32,
    /// Radiance along `wi`, before visibility. For a light without extent: intensity over squared distance.
    pub(crate) radiance: Spectrum,
    /// Density of `wi`; for a light without extent: the probability alone, see [`SolidAnglePdf::ONLY`].
    pub(crate) pdf: SolidAnglePdf,
    /// `true`: only light sampling can find the light.
    pub(crate) is_delta: bool,
    /// Index of the light in the tree; [`NO_LIGHT`] for lights at infinity.
    pub(crate) light: u32,
    /// Index of the sun; [`NO_LIGHT`] for other lights.
    pub(crate) sun: u32,
    /// Probability of choosing this light, a factor of `pdf`.
    pub(crate) pmf: f32,
    /// Kinds of ray that find the light.
    pub(crate) visibility: Visibility,
}

impl LightSample {
    /// Returns the density of the direction, given that this light is chosen.
    #[inline(always)]
    pub(crate) fn pdf_of_place(&self) -> SolidAnglePdf {
        SolidAnglePdf::new(self.pdf.per_sr() / self.pmf)
    }
}

/// A point that receives light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Receiver {
    /// Position in world space.
    pub(crate) p: Vec3,
    /// Normal of an opaque surface on the lit side; 0 where light from all directions counts: in a medium, and on a
    /// surface that transmits light.
    pub(crate) n: Vec3,
}
