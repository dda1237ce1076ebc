//! Phase functions.

use std::f32::consts::PI;

use bottega_kernels::math;
use glam::Vec3;

use crate::sampling::orthonormal_basis;

/// Henyey and Greenstein 1941, *Diffuse Radiation in the Galaxy*: where light goes that a medium scatters. It sums up to
/// 1, and is drawn by itself, so that its value is its density.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Phase {
    /// Mean cosine of the angle by which light is turned.
    pub(crate) g: f32,
}

impl Phase {
    /// Value in sr⁻¹, and density in sr⁻¹ of [`Self::sample`].
    ///
    /// - `cosine`: of the angle between the directions in which light goes before and afterwards.
    pub(crate) fn eval(self, cosine: f32) -> f32 {
        let g = self.g;
        let denominator = (1.0 + g * g - 2.0 * g * cosine).max(1e-12);
        (1.0 - g * g) / (4.0 * PI * denominator * denominator.sqrt())
    }

    /// A direction after light that went along `direction` was scattered, or the other way round.
    pub(crate) fn sample(self, direction: Vec3, u: [f32; 2]) -> (Vec3, f32) {
        let g = self.g;
        let cosine = if g.abs() < 1e-3 {
            1.0 - 2.0 * u[0]
        } else {
            let root = (1.0 - g * g) / (1.0 - g + 2.0 * g * u[0]);
            ((1.0 + g * g - root * root) / (2.0 * g)).clamp(-1.0, 1.0)
        };
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let (sin, cos) = math::sin_cos_of_turns(u[1]);
        let (s, t) = orthonormal_basis(direction);
        let wi = (s * (sine * cos) + t * (sine * sin) + direction * cosine).normalize();
        (wi, self.eval(cosine))
    }
}
