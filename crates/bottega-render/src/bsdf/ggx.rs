//! The GGX microfacet distribution: Smith shadowing, visible normals.

use std::f32::consts::{PI, TAU};

use bottega_kernels::math;
use glam::Vec3;

/// A surface whose α is below this one is a mirror: its lobe is narrower than single precision resolves well.
pub const SMOOTH_ALPHA: f32 = 1e-3;

/// Isotropic GGX distribution of microfacet normals, in the frame whose +z is the surface's normal.
///
/// Sources: Walter et al. 2007, Microfacet Models for Refraction through Rough Surfaces, eq. 33 and 34; Heitz 2014,
/// Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs, eq. 72 and 99.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx {
    alpha: f32,
}

impl Ggx {
    /// From a perceptual roughness in [0, 1]: α is its square.
    pub fn from_roughness(roughness: f32) -> Self {
        Self { alpha: roughness * roughness }
    }

    /// Width of the distribution of slopes.
    pub fn alpha(&self) -> f32 {
        self.alpha
    }

    /// Whether the surface is treated as a mirror.
    pub fn is_smooth(&self) -> bool {
        self.alpha < SMOOTH_ALPHA
    }

    /// D(h): area of facets facing `h` per area of surface and solid angle, in sr⁻¹.
    pub fn density(&self, h: Vec3) -> f32 {
        let a2 = self.alpha * self.alpha;
        // sin² + α² cos² instead of 1 + (α² − 1) cos²: nothing cancels near the pole.
        let t = h.x * h.x + h.y * h.y + a2 * h.z * h.z;
        a2 / (PI * t * t)
    }

    /// √(α² + (1 − α²) cos²): what both shadowing terms are made of.
    fn stretch(&self, cos: f32) -> f32 {
        let a2 = self.alpha * self.alpha;
        (a2 + (1.0 - a2) * cos * cos).sqrt()
    }

    /// G₁: share of the facets facing a direction at cosine `cos` > 0 that it sees.
    pub fn masking(&self, cos: f32) -> f32 {
        2.0 * cos / (cos + self.stretch(cos))
    }

    /// G₂ / (4 cos_o cos_i): height-correlated masking and shadowing over the denominator of a reflection.
    pub fn visibility(&self, cos_o: f32, cos_i: f32) -> f32 {
        0.5 / (cos_i * self.stretch(cos_o) + cos_o * self.stretch(cos_i))
    }

    /// G₂ / G₁(o): weight of a reflection that was drawn by visible normals.
    pub fn shadowing(&self, cos_o: f32, cos_i: f32) -> f32 {
        let stretch_o = self.stretch(cos_o);
        cos_i * (cos_o + stretch_o) / (cos_i * stretch_o + cos_o * self.stretch(cos_i))
    }

    /// Density with which [`Self::sample_visible_normal`] draws `h`, in sr⁻¹ of normals.
    pub fn visible_normal_pdf(&self, wo: Vec3, h: Vec3) -> f32 {
        2.0 * wo.dot(h).max(0.0) * self.density(h) / (wo.z + self.stretch(wo.z))
    }

    /// Density of the direction that `wo` is mirrored to by a visible normal `h`, in sr⁻¹.
    pub fn reflection_pdf(&self, wo: Vec3, h: Vec3) -> f32 {
        0.5 * self.density(h) / (wo.z + self.stretch(wo.z))
    }

    /// A facet's normal, as likely as `wo` (wo.z > 0) sees it.
    ///
    /// Source: Dupuy and Benyoub 2023, Sampling Visible GGX Normals with Spherical Caps, listing 1.
    pub fn sample_visible_normal(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        let w = Vec3::new(self.alpha * wo.x, self.alpha * wo.y, wo.z).normalize();
        let (sin_phi, cos_phi) = math::sin_cos(TAU * u[0]);
        let z = (1.0 - u[1]) * (1.0 + w.z) - w.z;
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let h = Vec3::new(radius * cos_phi, radius * sin_phi, z) + w;
        Vec3::new(self.alpha * h.x, self.alpha * h.y, h.z.max(1e-9)).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_facets_cover_the_surface_exactly_once() {
        for roughness in [0.3, 0.6, 1.0] {
            let ggx = Ggx::from_roughness(roughness);
            let steps = 20_000;
            let area: f64 = (0..steps)
                .map(|i| {
                    let cos = (i as f64 + 0.5) / steps as f64;
                    let h = Vec3::new((1.0 - cos * cos).sqrt() as f32, 0.0, cos as f32);
                    f64::from(ggx.density(h)) * cos * std::f64::consts::TAU / steps as f64
                })
                .sum();
            assert!((area - 1.0).abs() < 2e-3, "{roughness}: {area}");
        }
    }

    proptest! {
        #[test]
        fn shadowing_is_the_ratio_of_its_parts(cos_o in 0.01f32..1.0, cos_i in 0.01f32..1.0, roughness in 0.05f32..1.0) {
            let ggx = Ggx::from_roughness(roughness);
            let expected = ggx.visibility(cos_o, cos_i) * 4.0 * cos_o * cos_i / ggx.masking(cos_o);
            prop_assert!((ggx.shadowing(cos_o, cos_i) - expected).abs() < 1e-4 * expected);
            prop_assert!(ggx.shadowing(cos_o, cos_i) <= 1.0 + 1e-5);
        }

        #[test]
        fn drawn_normals_face_both_the_viewer_and_the_surface(
            cos in 1e-6f32..1.0, roughness in 0.0f32..1.0, u0 in 0.0f32..1.0, u1 in 0.0f32..1.0,
        ) {
            let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let h = Ggx::from_roughness(roughness).sample_visible_normal(wo, [u0, u1]);
            prop_assert!(h.is_finite() && h.z >= 0.0 && wo.dot(h) >= -1e-4, "{h}");
            prop_assert!((h.length() - 1.0).abs() < 1e-5);
        }
    }
}
