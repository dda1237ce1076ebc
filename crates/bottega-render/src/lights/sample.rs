//! Light that a point is asked about, and what comes of it.

use bottega_scene::Spectrum;
use glam::Vec3;

/// Stands for "no light" in the number of a light.
pub(crate) const NO_LIGHT: u32 = u32::MAX;

/// Light that reaches a point from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LightSample {
    /// Unit length, from the point to the light.
    pub(crate) wi: Vec3,
    /// How far the light is; infinite for one infinitely far away.
    pub(crate) distance: f32,
    /// Radiance along `wi`, if nothing is between. Of a light without extent: intensity over squared distance.
    pub(crate) radiance: Spectrum,
    /// Density per solid angle, or the probability alone of a light without extent.
    pub(crate) pdf: f32,
    /// Whether only light sampling can find it.
    pub(crate) is_delta: bool,
    /// Which light of the tree it was; [`NO_LIGHT`] for one infinitely far away.
    pub(crate) light: u32,
    /// The factor of `pdf` that is the probability of this light.
    pub(crate) pmf: f32,
}

/// A point that asks for light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Receiver {
    /// World space.
    pub(crate) p: Vec3,
    /// Normal of an opaque surface on the side that is lit; 0 where light counts from everywhere: in a medium, and on a
    /// surface that lets light through.
    pub(crate) n: Vec3,
}
