//! Functions of colors.

use bottega_kernels::math;
use bottega_scene::Spectrum;
use glam::Vec3;

/// Returns the luminance of linear Rec. 709 RGB.
pub(crate) fn luminance(color: Spectrum) -> f32 {
    color.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Returns e to the power of each channel.
#[inline(always)]
pub(crate) fn exp(color: Spectrum) -> Spectrum {
    Vec3::new(math::exp(color.x), math::exp(color.y), math::exp(color.z))
}
