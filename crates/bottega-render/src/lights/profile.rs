//! The directions into which a surface emits, for evaluation.

use std::f32::consts::{FRAC_PI_2, PI};

use bottega_kernels::math;
use bottega_scene::{DirectionPicture, EmissionProfile, Scene, Spectrum, SpotFalloff};
use glam::Vec3;

use super::{
    bounds::{Cone, LightBounds},
    direction_picture::{DirectionLookup, PictureExtent},
    punctual::{FADE_MIN, fall_off},
};
use crate::{bsdf::warp::cosine_hemisphere, sampling::orthonormal_basis};

/// The directions into which a surface emits: the factor of its radiance. See [`EmissionProfile`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Profile {
    /// 1 in all directions.
    Diffuse,
    /// A cone around the normal: max(tan α − tan θ, 0) / (tan α − α), which keeps the power.
    Spread {
        /// Tangent of the half-angle α of the cone.
        tangent: f32,
        /// 1 / (tan α − α).
        scale: f32,
    },
    /// A cone around an axis.
    Spot { axis: Vec3, cos_inner: f32, cos_outer: f32, falloff: SpotFalloff },
    /// By a picture of directions.
    Picture(DirectionPicture),
}

/// Returns the factor of a picture; rare, and so not a part of the loops over paths.
#[cold]
#[inline(never)]
fn factor_of_picture(scene: &Scene, picture: &DirectionPicture, direction: Vec3) -> Spectrum {
    DirectionLookup::new(scene, picture).factor(direction)
}

impl Profile {
    /// Prepares an emission profile for evaluation.
    pub(crate) fn new(profile: &EmissionProfile) -> Self {
        match *profile {
            EmissionProfile::Diffuse => Self::Diffuse,
            EmissionProfile::Spread { half_angle: a } => {
                let tangent = math::tan(a);
                // tan α − α loses its digits for small α: use its series there
                let a2 = a * a;
                let series = a
                    * a2
                    * (1.0 / 3.0
                        + a2 * (2.0 / 15.0 + a2 * (17.0 / 315.0 + a2 * (62.0 / 2835.0 + a2 * (1382.0 / 155_925.0)))));
                Self::Spread { tangent, scale: 1.0 / if a < 0.4 { series } else { tangent - a } }
            }
            EmissionProfile::Spot { axis, cos_inner, cos_outer, falloff } => {
                Self::Spot { axis, cos_inner, cos_outer, falloff }
            }
            EmissionProfile::Picture(picture) => Self::Picture(picture),
        }
    }

    /// Returns the factor of the radiance.
    ///
    /// - `direction`: away from the surface, unit length.
    /// - `cosine`: of the angle between it and the normal on the side that emits.
    pub(crate) fn factor(&self, scene: &Scene, direction: Vec3, cosine: f32) -> Spectrum {
        match *self {
            Self::Diffuse => Spectrum::ONE,
            Self::Spread { tangent, scale } => {
                let tan_theta = (1.0 - cosine * cosine).max(0.0).sqrt() / cosine.abs().max(1e-9);
                Spectrum::splat((tangent - tan_theta).max(0.0) * scale)
            }
            Self::Spot { axis, cos_inner, cos_outer, falloff } => {
                Spectrum::splat(fall_off(falloff, direction.dot(axis), cos_inner, cos_outer))
            }
            Self::Picture(ref picture) => factor_of_picture(scene, picture, direction),
        }
    }

    /// Returns bounds of a light with this profile, given those of one that emits equally in all directions.
    pub(super) fn bounds(&self, scene: &Scene, diffuse: LightBounds) -> LightBounds {
        match *self {
            Self::Diffuse => diffuse,
            // Around a sphere the normals point everywhere, and the power is the same
            Self::Spread { .. } if diffuse.cone.angle >= PI => diffuse,
            Self::Spread { tangent, scale } => LightBounds {
                emission_angle: math::atan(tangent).max(FADE_MIN),
                intensity: diffuse.intensity * tangent * scale,
                ..diffuse
            },
            Self::Spot { axis, cos_inner, cos_outer, .. } => {
                let [inner, outer] = [cos_inner, cos_outer].map(math::acos);
                LightBounds {
                    cone: Cone { axis, angle: inner },
                    emission_angle: (outer - inner).clamp(FADE_MIN, FRAC_PI_2),
                    two_sided: false,
                    ..diffuse
                }
            }
            Self::Picture(picture) => {
                let extent = PictureExtent::new(scene, &picture);
                let intensity = diffuse.intensity * extent.peak;
                // Normals of a flat light are a smaller cone; those of a sphere point everywhere
                if diffuse.cone.angle < PI {
                    return LightBounds { intensity, ..diffuse };
                }
                LightBounds {
                    cone: Cone { axis: extent.axis, angle: extent.angle },
                    emission_angle: FADE_MIN,
                    intensity,
                    ..diffuse
                }
            }
        }
    }

    /// Returns the power of a light with this profile over that of one that emits equally in all directions, roughly.
    pub(super) fn power_share(&self, scene: &Scene) -> f32 {
        match *self {
            Self::Diffuse | Self::Spread { .. } => 1.0,
            Self::Picture(picture) => PictureExtent::new(scene, &picture).share(),
            Self::Spot { cos_inner, cos_outer, .. } => 0.5 * (1.0 - 0.5 * (cos_inner + cos_outer)),
        }
    }

    /// Draws the direction of a photon that leaves a surface with normal `n`. Returns it with the factor of its power, where
    /// directions by the cosine alone have 1.
    pub(super) fn leaving(&self, scene: &Scene, n: Vec3, [u, v]: [f32; 2]) -> (Vec3, Spectrum) {
        let within = |sine_squared: f32| {
            // A part of the disc below the hemisphere is a cone
            let local = cosine_hemisphere([u, v]);
            let sine = Vec3::new(local.x, local.y, 0.0) * sine_squared.sqrt();
            let (s, t) = orthonormal_basis(n);
            let z = (1.0 - sine.length_squared()).max(0.0).sqrt();
            (s * sine.x + t * sine.y + n * z, z)
        };
        match *self {
            Self::Diffuse => (within(1.0).0, Spectrum::ONE),
            Self::Spread { tangent, .. } => {
                let sine_squared = tangent * tangent / (1.0 + tangent * tangent);
                let (direction, cosine) = within(sine_squared);
                (direction, sine_squared * self.factor(scene, direction, cosine))
            }
            Self::Spot { .. } | Self::Picture(_) => {
                let (direction, cosine) = within(1.0);
                (direction, self.factor(scene, direction, cosine))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_keeps_the_power_however_narrow() {
        let scene = Scene::default();
        for degrees in [0.1_f32, 1.0, 10.0, 22.9, 23.0, 45.0, 80.0, 89.0] {
            let half_angle = degrees.to_radians();
            let profile = Profile::new(&EmissionProfile::Spread { half_angle });
            // ∫ f cos θ sin θ dθ over the cone; ½ without spread
            let steps = 4000;
            let sum: f64 = (0..steps)
                .map(|i| {
                    let theta = f64::from(half_angle) * (f64::from(i) + 0.5) / f64::from(steps);
                    let direction = Vec3::new(theta.sin() as f32, 0.0, theta.cos() as f32);
                    // The cosine of a narrow cone has too few digits in single precision
                    let Profile::Spread { tangent, scale } = profile else { return 0.0 };
                    let factor = (f64::from(tangent) - theta.tan()).max(0.0) * f64::from(scale);
                    if degrees >= 10.0 {
                        let found = f64::from(profile.factor(&scene, direction, direction.z).x);
                        assert!(
                            (found - factor).abs() < 2e-3 * f64::from(tangent * scale),
                            "{degrees} {theta}: {found} {factor}"
                        );
                    }
                    factor * theta.sin() * theta.cos() * f64::from(half_angle) / f64::from(steps)
                })
                .sum();
            assert!((sum - 0.5).abs() < 1e-3, "{degrees}: {sum}");
        }
    }
}
