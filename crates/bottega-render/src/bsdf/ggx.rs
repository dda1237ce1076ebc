//! The GGX microfacet distribution: Smith shadowing, visible normals.

use std::f32::consts::PI;

use bottega_kernels::math;
use glam::Vec3;

/// Largest α of a mirror: below it, the lobe is too narrow for single precision.
pub const SMOOTH_ALPHA: f32 = 1e-3;

/// GGX distribution of microfacet normals, in the frame whose +z is the surface's normal.
///
/// Sources: Walter et al. 2007, Microfacet Models for Refraction through Rough Surfaces, eq. 33 and 34; Heitz 2014,
/// Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs, eq. 72, 85, 86 and 99.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx {
    /// α along x and along y.
    pub(super) alpha: [f32; 2],
}

impl Ggx {
    /// Creates the distribution with a roughness α along x and another along y.
    pub fn new(alpha: [f32; 2]) -> Self {
        Self { alpha }
    }

    /// Creates the isotropic distribution of a perceptual roughness in [0, 1]: α is its square.
    pub fn from_roughness(roughness: f32) -> Self {
        Self { alpha: [roughness * roughness; 2] }
    }

    /// Creates the distribution of a perceptual roughness, wider along x: α along x goes from roughness² to 1 with the
    /// square of `stretch`, in [0, 1] (KHR_materials_anisotropy).
    pub fn stretched(roughness: f32, stretch: f32) -> Self {
        let alpha = roughness * roughness;
        let along = alpha + (1.0 - alpha) * stretch * stretch;
        let across = if along >= SMOOTH_ALPHA { alpha.max(SMOOTH_ALPHA) } else { alpha };
        Self { alpha: if stretch > 0.0 { [along, across] } else { [alpha; 2] } }
    }

    /// Returns the width of the distribution of slopes: the geometric mean of both α.
    pub fn alpha(&self) -> f32 {
        let [x, y] = self.alpha;
        if x == y { x } else { (x * y).sqrt() }
    }

    /// Returns the quadratic mean of both α.
    pub(super) fn mean_slope(&self) -> f32 {
        let [x, y] = self.alpha;
        (0.5 * (x * x + y * y)).sqrt()
    }

    /// Returns true if the surface is treated as a mirror.
    pub fn is_smooth(&self) -> bool {
        self.alpha[0].max(self.alpha[1]) < SMOOTH_ALPHA
    }

    /// Returns D(h): area of facets facing `h` per area of surface and solid angle, in sr⁻¹.
    pub fn density(&self, h: Vec3) -> f32 {
        let [ax, ay] = self.alpha;
        let area = ax * ay;
        let (x, y, z) = (ay * h.x, ax * h.y, area * h.z);
        // sin² + α² cos² instead of 1 + (α² − 1) cos²: nothing cancels near the pole.
        let t = x * x + y * y + z * z;
        area * area * area / (PI * t * t)
    }

    /// Returns the length of `w` in the space where α is 1; both shadowing terms use it.
    fn stretch(&self, w: Vec3) -> f32 {
        let [ax, ay] = self.alpha;
        let (x, y) = (ax * w.x, ay * w.y);
        (x * x + y * y + w.z * w.z).sqrt()
    }

    /// Returns G₁(w) = 1 ∕ (1 + Λ(w)), the share of the facets visible from a direction on either side; Λ: Heitz 2014, eq. 72 and 86.
    pub fn masking(&self, w: Vec3) -> f32 {
        let cos = w.z.abs();
        2.0 * cos / (cos + self.stretch(w))
    }

    /// Returns G₂ / (4 cos_o cos_i): height-correlated masking and shadowing over the denominator of a reflection.
    pub fn visibility(&self, wo: Vec3, wi: Vec3) -> f32 {
        0.5 / (wi.z * self.stretch(wo) + wo.z * self.stretch(wi))
    }

    /// Returns G₂(o, i) / G₁(o): the weight of a reflection drawn by visible normals, with the height-correlated G₂ of
    /// [`Self::visibility`].
    pub fn shadowing(&self, wo: Vec3, wi: Vec3) -> f32 {
        let stretch_o = self.stretch(wo);
        wi.z * (wo.z + stretch_o) / (wi.z * stretch_o + wo.z * self.stretch(wi))
    }

    /// Returns ∫ D(h) max(w · h, 0) dω: the area of the facets visible from `w` (above the surface).
    pub fn visible_area(&self, w: Vec3) -> f32 {
        0.5 * (w.z + self.stretch(w))
    }

    /// Returns the density with which [`Self::sample_visible_normal`] draws `h`, per solid angle of normals, in sr⁻¹.
    pub fn visible_normal_pdf(&self, wo: Vec3, h: Vec3) -> f32 {
        wo.dot(h).max(0.0) * self.density(h) / self.visible_area(wo)
    }

    /// Returns the density of the direction into which `wo` is mirrored at a visible normal `h`, in sr⁻¹.
    pub fn reflection_pdf(&self, wo: Vec3, h: Vec3) -> f32 {
        0.25 * self.density(h) / self.visible_area(wo)
    }

    /// Draws a facet's normal from the distribution of normals visible from `wo` (wo.z > 0). Returns it with unit
    /// length.
    ///
    /// - `u`: uniform random numbers in [0, 1).
    ///
    /// Source: Dupuy and Benyoub 2023, Sampling Visible GGX Normals with Spherical Caps, listing 1.
    pub fn sample_visible_normal(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        let [ax, ay] = self.alpha;
        let w = Vec3::new(ax * wo.x, ay * wo.y, wo.z).normalize();
        let (sin_phi, cos_phi) = math::sin_cos_of_turns(u[0]);
        let z = (1.0 - u[1]) * (1.0 + w.z) - w.z;
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let h = Vec3::new(radius * cos_phi, radius * sin_phi, z) + w;
        Vec3::new(ax * h.x, ay * h.y, h.z.max(1e-9)).normalize()
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
        fn shadowing_is_the_ratio_of_its_parts(
            cos_o in 0.01f32..1.0, cos_i in 0.01f32..1.0, x in 0.01f32..1.0, y in 0.01f32..1.0,
        ) {
            let ggx = Ggx::new([x, y]);
            let direction = |cos: f32| Vec3::new(0.6, 0.8, 0.0) * (1.0 - cos * cos).sqrt() + cos * Vec3::Z;
            let (wo, wi) = (direction(cos_o), direction(cos_i));
            let expected = ggx.visibility(wo, wi) * 4.0 * cos_o * cos_i / ggx.masking(wo);
            prop_assert!((ggx.shadowing(wo, wi) - expected).abs() < 1e-4 * expected);
            prop_assert!(ggx.shadowing(wo, wi) <= 1.0 + 1e-5);
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
