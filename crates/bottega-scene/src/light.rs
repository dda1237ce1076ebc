//! Lights without a surface, and the environment. Emissive surfaces are in their materials.

use glam::{Affine3A, Mat3, Vec3};
use serde::{Deserialize, Serialize};

use crate::color::Spectrum;
use crate::motion::TransformKey;
use crate::texture::{ImageId, TextureMap};
use crate::visibility::Visibility;

/// A light without extent, or at infinity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Light {
    /// The name in the file; may be empty.
    pub name: String,
    /// The kind, position and strength of the light.
    pub kind: LightKind,
    /// Kinds of ray that the light reaches: those of the camera see the disc of a sun. [`Visibility::SHADOW`] has no
    /// effect.
    #[serde(default)]
    pub visibility: Visibility,
    /// Keys of a transformation of the light from where [`Self::kind`] puts it, world space to world space, if it moves.
    /// Lights at infinity stand still.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub motion: Vec<TransformKey>,
}

/// The kinds of light without extent. Directions are of unit length, in world space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LightKind {
    /// A point light that emits equally in all directions.
    Point {
        /// Position, world space.
        #[serde(with = "crate::numbers")]
        position: Vec3,
        /// Radiant intensity in W·sr⁻¹.
        #[serde(with = "crate::numbers")]
        intensity: Spectrum,
    },
    /// A point light that emits into a cone.
    Spot {
        /// Position, world space.
        #[serde(with = "crate::numbers")]
        position: Vec3,
        /// Axis of the cone.
        #[serde(with = "crate::numbers")]
        direction: Vec3,
        /// Radiant intensity on the axis, in W·sr⁻¹.
        #[serde(with = "crate::numbers")]
        intensity: Spectrum,
        /// Cosine of the half angle inside which the intensity is full.
        cos_inner: f32,
        /// Cosine of the half angle outside which the intensity is 0; below `cos_inner`.
        cos_outer: f32,
        /// Falloff of the intensity between the two angles.
        falloff: SpotFalloff,
    },
    /// A point light that projects a picture.
    Projector {
        /// Light space to world space, without scale. The light is at the origin and points along its own −z, as a
        /// camera does.
        #[serde(with = "crate::numbers")]
        world_from_light: Affine3A,
        /// The picture, (0, 0) in its upper left corner; black outside of it.
        picture: TextureMap,
        /// Factor of the picture: radiant intensity on the axis, in W·sr⁻¹. It grows as 1/cos³ of the angle to the
        /// axis, so a screen perpendicular to the axis is lit evenly.
        #[serde(with = "crate::numbers")]
        intensity: Spectrum,
        /// Full angle between the upper and the lower edge of the picture, in radians.
        vertical_fov: f32,
        /// Width over height of the picture.
        aspect: f32,
    },
    /// A point light whose intensity a picture gives for each direction: a profile of IES, or pbrt's `goniometric`.
    Goniometric {
        /// Position, world space.
        #[serde(with = "crate::numbers")]
        position: Vec3,
        /// Light space to world space: orthonormal; may mirror.
        #[serde(with = "crate::numbers")]
        world_from_light: Mat3,
        /// The picture. Of one of equal areas, the mean of its channels is used.
        image: ImageId,
        /// Layout of directions on the picture.
        #[serde(default = "EnvironmentMapping::equal_area", skip_serializing_if = "EnvironmentMapping::is_equal_area")]
        mapping: EnvironmentMapping,
        /// Factor of the picture: radiant intensity in W·sr⁻¹.
        #[serde(with = "crate::numbers")]
        intensity: Spectrum,
    },
    /// Light from infinitely far away: parallel, or from a disc like the sun's.
    Directional {
        /// Direction in which the light of its centre travels.
        #[serde(with = "crate::numbers")]
        direction: Vec3,
        /// Irradiance on a surface perpendicular to it, in W·m⁻², whatever the angle.
        #[serde(with = "crate::numbers")]
        irradiance: Spectrum,
        /// Angular diameter in radians, from 0 (parallel light) to π.
        angle: f32,
    },
}

/// The falloff of a spot light from full intensity at the inner angle to 0 at the outer one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SpotFalloff {
    /// Square of the linear interpolation of the cosine (KHR_lights_punctual).
    #[default]
    SquaredCosine,
    /// Linear in the angle (Mitsuba).
    LinearAngle,
    /// Smoothstep of the cosine (pbrt).
    SmoothCosine,
}

/// The layout of directions on an environment's picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EnvironmentMapping {
    /// Latitude and longitude: the upper edge is +y, the centre column −z, u grows towards +x.
    #[default]
    LatitudeLongitude,
    /// The layout of [`Self::LatitudeLongitude`], but the centres of the first and last row are the poles themselves
    /// (Mitsuba).
    LatitudeLongitudeToPoles,
    /// Equal areas on an octahedron, as in pbrt-v4 (Clarberg 2008, Fast Equal-Area Mapping of the (Hemi)Sphere using
    /// SIMD): +z is the centre, −z the corners, +x points right and +y down. Looked up without interpolation, as there.
    EqualArea,
}

/// A rectangle through which an environment shines, world space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Portal {
    /// One corner of the rectangle.
    #[serde(with = "crate::numbers")]
    pub corner: Vec3,
    /// The edges from there to the adjacent corners, perpendicular to each other. Their cross product points outwards;
    /// light comes in against it.
    #[serde(with = "crate::numbers")]
    pub edges: [Vec3; 2],
}

/// The environment: radiance along rays that leave the scene, from a picture or constant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Environment {
    /// The picture; `None`: 1 in all directions.
    pub image: Option<ImageId>,
    /// Layout of directions on the picture.
    pub mapping: EnvironmentMapping,
    /// Factor of the picture: radiance in W·sr⁻¹·m⁻².
    #[serde(with = "crate::numbers")]
    pub factor: Spectrum,
    /// Environment space to world space: orthonormal; may mirror.
    #[serde(with = "crate::numbers")]
    pub world_from_environment: Mat3,
    /// Portals. If not empty, the environment is visible only along rays that leave through a portal, once for each
    /// portal that they cross, and black elsewhere.
    pub portals: Vec<Portal>,
    /// Kinds of ray that find it.
    pub visibility: Visibility,
}

impl EnvironmentMapping {
    fn equal_area() -> Self {
        Self::EqualArea
    }

    fn is_equal_area(&self) -> bool {
        *self == Self::EqualArea
    }
}

impl Light {
    /// Returns a light that stands still and reaches every kind of ray.
    pub fn new(name: impl Into<String>, kind: LightKind) -> Self {
        Self { name: name.into(), kind, visibility: Visibility::ALL, motion: Vec::new() }
    }
}

impl LightKind {
    /// Returns the light, moved by a transformation from world space to world space. Its strength stays, and lights at
    /// infinity stay where they are.
    #[must_use]
    pub fn moved(mut self, by: &Affine3A) -> Self {
        match &mut self {
            Self::Point { position, .. } => *position = by.transform_point3(*position),
            Self::Spot { position, direction, .. } => {
                *position = by.transform_point3(*position);
                *direction = by.transform_vector3(*direction).normalize_or(*direction);
            }
            Self::Projector { world_from_light, .. } => {
                let matrix = by.matrix3 * world_from_light.matrix3;
                let unit = |axis: glam::Vec3A| axis.normalize_or(glam::Vec3A::Z);
                world_from_light.matrix3 =
                    glam::Mat3A::from_cols(unit(matrix.x_axis), unit(matrix.y_axis), unit(matrix.z_axis));
                world_from_light.translation = by.transform_point3a(world_from_light.translation);
            }
            Self::Goniometric { position, world_from_light, .. } => {
                *position = by.transform_point3(*position);
                let matrix = Mat3::from(by.matrix3) * *world_from_light;
                let unit = |axis: Vec3| axis.normalize_or(Vec3::Z);
                *world_from_light = Mat3::from_cols(unit(matrix.x_axis), unit(matrix.y_axis), unit(matrix.z_axis));
            }
            Self::Directional { .. } => {}
        }
        self
    }
}

impl Environment {
    /// Returns an environment of constant radiance, in W·sr⁻¹·m⁻², without portals and visible to every kind of ray.
    pub fn uniform(radiance: Spectrum) -> Self {
        Self {
            image: None,
            mapping: EnvironmentMapping::LatitudeLongitude,
            factor: radiance,
            world_from_environment: Mat3::IDENTITY,
            portals: Vec::new(),
            visibility: Visibility::ALL,
        }
    }

    /// Returns a latitude-longitude picture as an environment, without portals and visible to every kind of ray.
    ///
    /// - `factor`: factor of the picture: radiance in W·sr⁻¹·m⁻².
    /// - `world_from_environment`: environment space to world space: orthonormal; may mirror.
    pub fn picture(image: ImageId, factor: Spectrum, world_from_environment: Mat3) -> Self {
        Self { image: Some(image), world_from_environment, ..Self::uniform(factor) }
    }
}
