//! Lights that are no surfaces. Surfaces shine by the emission of their material.

use glam::{Affine3A, Mat3, Vec3};

use crate::{ImageId, Spectrum, TextureMap};

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
    /// Shines into a cone.
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
        /// How the intensity falls off between the two angles.
        falloff: SpotFalloff,
    },
    /// Throws a picture.
    Projector {
        /// Stands at the origin and looks along its own −z, as a camera does; without scale.
        world_from_light: Affine3A,
        /// The picture, (0, 0) in its upper left corner; black outside of it.
        picture: TextureMap,
        /// Multiplies the picture: radiant intensity on the axis in W·sr⁻¹. It falls off as 1/cos³ of the angle to the
        /// axis, so that a screen across the axis is lit evenly.
        intensity: Spectrum,
        /// Full angle between the upper and the lower edge of the picture, in radians.
        vertical_fov: f32,
        /// Width over height.
        aspect: f32,
    },
    /// Without extent, with an intensity that a picture of all directions tells.
    Goniometric {
        /// World space.
        position: Vec3,
        /// Light space to world space: orthonormal, and mirroring where the file says so.
        world_from_light: Mat3,
        /// The picture, of equal areas: see [`EnvironmentMapping::EqualArea`]. The mean of its colours counts.
        image: ImageId,
        /// Multiplies the picture: radiant intensity in W·sr⁻¹.
        intensity: Spectrum,
    },
    /// Parallel light from infinitely far away.
    Directional {
        /// The direction in which the light travels.
        direction: Vec3,
        /// Irradiance on a surface that faces it, in W·m⁻².
        irradiance: Spectrum,
    },
}

/// The falloff of a spot's intensity from full, at the inner angle, to nothing, at the outer one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpotFalloff {
    /// As the square of the linear interpolation of the cosine (KHR_lights_punctual).
    #[default]
    SquaredCosine,
    /// Linearly with the angle (Mitsuba).
    LinearAngle,
    /// As the smooth step of the cosine (pbrt).
    SmoothCosine,
}

/// The layout of directions on an environment's picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EnvironmentMapping {
    /// Latitude and longitude: the upper edge is +y, the centre column −z, u grows towards +x.
    #[default]
    LatitudeLongitude,
    /// The same, but the centres of the first and the last row are the poles themselves, as Mitsuba has it.
    LatitudeLongitudeToPoles,
    /// Equal areas on an octahedron, as pbrt-v4 has it (Clarberg 2008, Fast Equal-Area Mapping of the (Hemi)Sphere using
    /// SIMD): +z is the centre, −z the corners, +x to the right and +y down. The nearest texel counts, as there.
    EqualArea,
}

/// A rectangle through which an environment shines, world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Portal {
    /// One of its corners.
    pub corner: Vec3,
    /// From there to the two corners beside it, perpendicular to one another. Their vector product looks outwards: light
    /// comes in against it.
    pub edges: [Vec3; 2],
}

/// The environment, which is seen where there is no surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// The picture; `None`: 1 everywhere.
    pub image: Option<ImageId>,
    /// How it is laid out.
    pub mapping: EnvironmentMapping,
    /// Multiplies the picture.
    pub factor: Spectrum,
    /// Environment space to world space: orthonormal, and mirroring where the file says so.
    pub world_from_environment: Mat3,
    /// Where there are some, it is seen along lines alone that lead out through one of them (once for each that they
    /// cross), and black elsewhere.
    pub portals: Vec<Portal>,
}

impl Environment {
    /// The same radiance from everywhere.
    pub fn uniform(radiance: Spectrum) -> Self {
        Self {
            image: None,
            mapping: EnvironmentMapping::LatitudeLongitude,
            factor: radiance,
            world_from_environment: Mat3::IDENTITY,
            portals: Vec::new(),
        }
    }

    /// A picture by latitude and longitude.
    pub fn picture(image: ImageId, factor: Spectrum, world_from_environment: Mat3) -> Self {
        Self { image: Some(image), world_from_environment, ..Self::uniform(factor) }
    }
}
