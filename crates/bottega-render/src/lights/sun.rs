//! Light from infinitely far away: parallel, or from a disc like the sun's.
//!
//! Parameters: direction; irradiance in W/m² per channel of a surface that faces the light; angular diameter, 0 to 180°.
//! The disc has the same radiance everywhere, E / (π sin² α) for irradiance E and half the diameter α, so the irradiance does
//! not depend on the diameter. Directions are sampled uniformly over the disc; paths that leave the scene towards it find it,
//! too, except parallel light.
//!
//! Source: the emitters `directional` of Mitsuba 3 and `distant` of pbrt-v4; the sun light of Blender.

use std::f32::consts::PI;

use bottega_kernels::math;
use bottega_scene::{Spectrum, Visibility};
use glam::Vec3;

use super::sample::Receiver;
use crate::{color::luminance, density::SolidAnglePdf, sampling::around};

/// Sine of half an angular diameter below which single precision cannot tell the directions of a disc apart.
const PARALLEL: f32 = 1e-5;

/// A light at infinity with a direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sun {
    /// Direction to the sun's centre, unit length.
    pub(crate) to_light: Vec3,
    /// Irradiance of a surface that faces it.
    pub(crate) irradiance: Spectrum,
    /// Luminance of the irradiance.
    pub(crate) illuminance: f32,
    /// Sine of half its angular diameter; 0: parallel light.
    sine: f32,
    /// 1 − cos of half its angular diameter, without cancellation.
    one_minus_cos: f32,
    /// Kinds of ray that find it.
    pub(super) visibility: Visibility,
}

impl Sun {
    /// Creates the light.
    ///
    /// - `direction`: in which the light travels, unit length.
    /// - `angle`: angular diameter in radians, from 0 to π.
    pub(super) fn new(direction: Vec3, irradiance: Spectrum, angle: f32, visibility: Visibility) -> Self {
        let quarter = math::sin(0.25 * angle);
        let one_minus_cos = 2.0 * quarter * quarter;
        let sine = (one_minus_cos * (2.0 - one_minus_cos)).sqrt();
        // Light sampling leaves out directions from which no surface receives light
        let illuminance = if visibility.has_bounces() { luminance(irradiance) } else { 0.0 };
        Self { to_light: -direction, irradiance, illuminance, sine, one_minus_cos, visibility }
    }

    /// Returns true if the sun is parallel light, which no path finds by itself.
    pub(super) fn is_parallel(&self) -> bool {
        self.sine < PARALLEL
    }

    /// Returns the radiance of the sun's disc, in W·sr⁻¹·m⁻².
    pub(super) fn radiance(&self) -> Spectrum {
        self.irradiance / (PI * self.sine * self.sine)
    }

    /// Returns the density of directions on the disc.
    pub(super) fn pdf(&self) -> SolidAnglePdf {
        SolidAnglePdf::uniform(2.0 * PI * self.one_minus_cos)
    }

    /// Returns true if the disc lies in a direction of unit length.
    #[inline(always)]
    pub(super) fn covers(&self, direction: Vec3) -> bool {
        // 1 − cos is half the squared distance of the unit vectors
        !self.is_parallel() && 0.5 * (direction - self.to_light).length_squared() <= self.one_minus_cos
    }

    /// Samples a direction to the light. Returns it with what arrives along it, the density, and true if it is the only one.
    #[inline(always)]
    pub(super) fn sample(&self, u: [f32; 2]) -> (Vec3, Spectrum, SolidAnglePdf, bool) {
        if self.is_parallel() {
            return (self.to_light, self.irradiance, SolidAnglePdf::ONLY, true);
        }
        (around(self.to_light, u[0] * self.one_minus_cos, u[1]), self.radiance(), self.pdf(), false)
    }

    /// Estimates the illuminance at a point. Above 0 wherever a part of the disc is above the horizon.
    #[inline(always)]
    pub(super) fn importance(&self, receiver: &Receiver) -> f32 {
        if receiver.n == Vec3::ZERO {
            return self.illuminance;
        }
        let cosine = receiver.n.dot(self.to_light);
        if cosine >= self.sine {
            self.illuminance * cosine
        } else if cosine > -self.sine {
            // The disc sets: a parabola from sin α to 0
            let above = cosine + self.sine;
            self.illuminance * above * above / (4.0 * self.sine)
        } else {
            0.0
        }
    }
}
