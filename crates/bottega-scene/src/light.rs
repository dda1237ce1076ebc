//! Lights that are no surfaces. Surfaces shine by the emission of their material.

use glam::{Quat, Vec3};

use crate::{ImageId, Spectrum};

/// A light without extent.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// The name in the file; may be empty.
    pub name: String,
    /// What kind, and how strong.
    pub kind: LightKind,
}

/// The kinds of light without extent. Directions are of unit length, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Shines equally in all directions.
    Point {
        /// Where it is, world space.
        position: Vec3,
        /// Radiant intensity in W·sr⁻¹.
        intensity: Spectrum,
    },
    /// Shines into a cone. Between the two angles the intensity falls off as KHR_lights_punctual says:
    /// the square of the linear interpolation of the cosine.
    Spot {
        /// Where it is, world space.
        position: Vec3,
        /// Where it points.
        direction: Vec3,
        /// Radiant intensity on the axis, in W·sr⁻¹.
        intensity: Spectrum,
        /// Cosine of the half angle inside which the intensity is full.
        cos_inner: f32,
        /// Cosine of the half angle outside which there is none; below `cos_inner`.
        cos_outer: f32,
    },
    /// Parallel light from infinitely far away.
    Directional {
        /// The direction in which the light travels.
        direction: Vec3,
        /// Irradiance on a surface that faces it, in W·m⁻².
        irradiance: Spectrum,
    },
}

/// What is seen where there is no surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Latitude-longitude picture: the upper edge is +y, the centre column −z, u grows towards +x. `None`: 1 everywhere.
    pub image: Option<ImageId>,
    /// Multiplies the picture.
    pub factor: Spectrum,
    /// Turns the environment: environment space to world space.
    pub world_from_environment: Quat,
}
