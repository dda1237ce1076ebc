//! Luminance of a color.

use bottega_scene::Spectrum;
use glam::Vec3;

/// Returns the luminance of linear Rec. 709 RGB.
pub(crate) fn luminance(color: Spectrum) -> f32 {
    color.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}
