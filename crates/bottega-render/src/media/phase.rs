//! The Henyey-Greenstein phase function.
//!
//! Parameter: asymmetry g in (−1, 1). Source: Henyey and Greenstein 1941, *Diffuse Radiation in the Galaxy*.

use std::f32::consts::PI;

use bottega_kernels::math;
use glam::Vec3;

use crate::sampling::orthonormal_basis;

/// The phase function of Henyey and Greenstein 1941, *Diffuse Radiation in the Galaxy*. It is normalized and sampled
/// exactly, so that its value is also the pdf.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Phase {
    /// Asymmetry: mean cosine between the directions before and after scattering, in (−1, 1).
    pub(crate) g: f32,
}

impl Phase {
    /// Returns the value in sr⁻¹, which is also the density of [`Self::sample`].
    ///
    /// - `cosine`: cosine between the directions of travel before and after scattering.
    pub(crate) fn eval(self, cosine: f32) -> f32 {
        let g = self.g;
        let denominator = (1.0 + g * g - 2.0 * g * cosine).max(1e-12);
        (1.0 - g * g) / (4.0 * PI * denominator * denominator.sqrt())
    }

    /// Samples the direction of travel after scattering of light that travels along `direction`, or the reverse; returns
    /// it with its pdf.
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
