//! Mappings from the unit square to directions, and their densities.

use std::f32::consts::{PI, TAU};

use bottega_kernels::math;
use glam::Vec3;

/// Largest f32 below 1; rescaled random numbers are clamped to it.
pub const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

/// Maps `u`, uniform in [0, 1)², to a direction of the upper hemisphere (+z) with density cos θ / π. Never below the
/// horizon; z may be 0.
#[inline(always)]
pub fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let (sin_phi, cos_phi) = math::sin_cos_of_turns(u[0]);
    let radius = u[1].sqrt();
    Vec3::new(radius * cos_phi, radius * sin_phi, (1.0 - u[1]).max(0.0).sqrt())
}

/// Returns the density of [`cosine_hemisphere`], in sr⁻¹; 0 below the horizon.
#[inline(always)]
pub fn cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) / PI
}

/// Maps `u`, uniform in [0, 1)², to a direction of the upper hemisphere (+z) with constant density 1 / 2π.
pub fn uniform_hemisphere(u: [f32; 2]) -> Vec3 {
    let (sin_phi, cos_phi) = math::sin_cos_of_turns(u[0]);
    let z = 1.0 - u[1];
    let radius = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(radius * cos_phi, radius * sin_phi, z)
}

/// Density of [`uniform_hemisphere`], in sr⁻¹.
pub const UNIFORM_HEMISPHERE_PDF: f32 = 1.0 / TAU;
