//! The directions into which a surface emits.

use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

use crate::light::SpotFalloff;
use crate::texture::ImageId;

/// The directions into which a surface emits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EmissionProfile {
    /// Equally bright from all directions.
    #[default]
    Diffuse,
    /// Within a cone around the normal, as if behind a grid of black slats: the radiance is proportional to
    /// tan α − tan θ at an angle θ to the normal. The power is that of [`Self::Diffuse`] (the spread of Blender's area
    /// lights).
    Spread {
        /// Half angle α of the cone, in radians, above 0 and below π/2.
        half_angle: f32,
    },
    /// Within a cone around one axis for all points, as of a spot light.
    Spot {
        /// Axis, unit length, world space.
        #[serde(with = "crate::numbers")]
        axis: Vec3,
        /// Cosine of the half angle inside which the radiance is full.
        cos_inner: f32,
        /// Cosine of the half angle outside which it is 0; below `cos_inner`.
        cos_outer: f32,
        /// Falloff between the two angles.
        falloff: SpotFalloff,
    },
    /// By a picture of directions, the same for all points.
    Picture(DirectionPicture),
}

/// A picture that gives a factor, R G B, for each direction. Its layout is
/// [`EnvironmentMapping::LatitudeLongitudeToPoles`](crate::EnvironmentMapping); texels are interpolated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DirectionPicture {
    /// The picture.
    pub image: ImageId,
    /// Light space to world space: orthonormal; may mirror. The upper row of the picture is +y of light space.
    #[serde(with = "crate::numbers")]
    pub world_from_light: Mat3,
}

impl DirectionPicture {
    /// Returns the rotation for a picture whose upper row is the axis −z of a light, and whose left edge is its +x: a profile
    /// of IES whose lamp hangs along the light's axis. Horizontal angles grow from +x towards +y.
    ///
    /// - `world_from_light`: axes of the light in world space, orthonormal.
    pub fn along_axis(world_from_light: Mat3) -> Mat3 {
        // Of the picture: +y is −z of the light; its left edge is +z, and its columns grow towards −x
        world_from_light * Mat3::from_cols(Vec3::NEG_Y, Vec3::NEG_Z, Vec3::X)
    }
}

/// Least half angle of [`EmissionProfile::Spread`], in radians: a tenth of a degree.
const SPREAD_MIN: f32 = 0.1 * std::f32::consts::PI / 180.0;

impl EmissionProfile {
    /// Returns true if the profile's numbers are sound.
    pub(crate) fn is_sound(&self) -> bool {
        match *self {
            Self::Diffuse => true,
            Self::Spread { half_angle } => (SPREAD_MIN..std::f32::consts::FRAC_PI_2).contains(&half_angle),
            Self::Spot { axis, cos_inner, cos_outer, .. } => {
                axis.is_normalized() && cos_outer < cos_inner && cos_outer >= -1.0 && cos_inner <= 1.0
            }
            Self::Picture(DirectionPicture { world_from_light, .. }) => is_orthonormal(&world_from_light),
        }
    }
}

/// Returns true if a matrix is a rotation, or one that mirrors.
pub(crate) fn is_orthonormal(matrix: &Mat3) -> bool {
    (*matrix * matrix.transpose()).abs_diff_eq(Mat3::IDENTITY, 1e-3)
}
