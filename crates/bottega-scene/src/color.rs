//! Colours in linear Rec. 709.

use glam::{DVec3, Vec3};

/// Linear Rec. 709 RGB: radiance in W·sr⁻¹·m⁻², or a dimensionless reflectance.
pub type Spectrum = Vec3;

/// Weights of red, green and blue in the luminance.
pub(crate) const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// Returns the luminance of a colour; exactly its value if it is gray.
pub(crate) fn luminance(color: Spectrum) -> f32 {
    if color.x == color.y && color.y == color.z { color.x } else { color.dot(LUMINANCE.as_vec3()) }
}
