//! The directions into which a surface emits.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::light::SpotFalloff;

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
        }
    }
}
