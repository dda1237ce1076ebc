//! Microfacets of a rough boundary: distribution of normals, masking and shadowing, single reflection and refraction.

use bottega_scene::{Distribution, Shadowing};
use glam::Vec3;

use super::beckmann::Beckmann;
use super::ggx::{Ggx, SMOOTH_ALPHA};

/// Microfacets with a GGX or Beckmann distribution; or a smooth boundary without facets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Microfacets {
    normals: Normals,
    /// Correlation of masking and shadowing.
    pub(super) shadowing: Shadowing,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Normals {
    Smooth,
    Ggx(Ggx),
    Beckmann(Beckmann),
}

/// Largest α; larger values are clamped, since all directions are then about equally likely.
pub const ALPHA_MAX: f32 = 10.0;

impl Microfacets {
    /// A smooth boundary.
    pub(super) const SMOOTH: Self = Self { normals: Normals::Smooth, shadowing: Shadowing::Correlated };

    /// Creates facets; `alpha`: α along x and y, below [`SMOOTH_ALPHA`] (or NaN) on both axes for a smooth boundary.
    pub(super) fn new(distribution: Distribution, shadowing: Shadowing, alpha: [f32; 2]) -> Self {
        let is_smooth = !alpha.iter().any(|&alpha| alpha >= SMOOTH_ALPHA);
        let alpha = alpha.map(|alpha| if alpha > SMOOTH_ALPHA { alpha.min(ALPHA_MAX) } else { SMOOTH_ALPHA });
        let normals = match distribution {
            _ if is_smooth => Normals::Smooth,
            Distribution::Ggx => Normals::Ggx(Ggx::new(alpha)),
            Distribution::Beckmann => Normals::Beckmann(Beckmann { alpha }),
        };
        Self { normals, shadowing }
    }

    /// Returns true for a smooth boundary, whose only lobe is a Dirac lobe.
    pub(super) fn is_smooth(&self) -> bool {
        self.normals == Normals::Smooth
    }

    /// Returns α along x and y; 0 for a smooth boundary.
    pub(super) fn alpha(&self) -> [f32; 2] {
        match &self.normals {
            Normals::Smooth => [0.0; 2],
            Normals::Ggx(ggx) => ggx.alpha,
            Normals::Beckmann(beckmann) => beckmann.alpha,
        }
    }

    /// Returns the perceptual roughness: the square root of the geometric mean of both α, at most 1.
    pub(super) fn roughness(&self) -> f32 {
        let [x, y] = self.alpha();
        (x * y).sqrt().sqrt().min(1.0)
    }

    /// Returns D(h) in sr⁻¹; 0 for a smooth boundary.
    pub(super) fn density(&self, h: Vec3) -> f32 {
        match &self.normals {
            Normals::Smooth => 0.0,
            Normals::Ggx(ggx) => ggx.density(h),
            Normals::Beckmann(beckmann) => beckmann.density(h),
        }
    }

    /// Returns the distribution of normals; GGX for a smooth boundary.
    pub(super) fn distribution(&self) -> Distribution {
        if let Normals::Beckmann(_) = self.normals { Distribution::Beckmann } else { Distribution::Ggx }
    }

    /// Returns G₁, the share of the facets visible from a direction on either side.
    pub(super) fn masking(&self, w: Vec3) -> f32 {
        match &self.normals {
            Normals::Smooth => 1.0,
            Normals::Ggx(ggx) => ggx.masking(w),
            Normals::Beckmann(beckmann) => beckmann.masking(w),
        }
    }

    /// Returns G₂, the share of the facets visible from both directions, which may be on different sides.
    pub(super) fn shadowing(&self, wo: Vec3, wi: Vec3) -> f32 {
        let (o, i) = (self.masking(wo), self.masking(wi));
        match self.shadowing {
            Shadowing::Separable => o * i,
            // 1 / (1 + Λo + Λi), with G₁ = 1 / (1 + Λ).
            Shadowing::Correlated => o * i / (o + i - o * i).max(f32::MIN_POSITIVE),
        }
    }

    /// Returns ∫ D(h) max(wo · h, 0) dω for a wo above the surface.
    fn visible_area(&self, wo: Vec3) -> f32 {
        match &self.normals {
            Normals::Smooth => wo.z,
            Normals::Ggx(ggx) => ggx.visible_area(wo),
            Normals::Beckmann(beckmann) => beckmann.visible_area(wo),
        }
    }

    /// Draws a facet's normal from the distribution of normals visible from `wo` (wo.z > 0).
    pub(super) fn sample_visible_normal(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        match &self.normals {
            Normals::Smooth => Vec3::Z,
            Normals::Ggx(ggx) => ggx.sample_visible_normal(wo, u),
            Normals::Beckmann(beckmann) => beckmann.sample_visible_normal(wo, u),
        }
    }

    /// Returns the reflection from `wi` to `wo`; `None` unless both are above the surface.
    pub(super) fn mirrored(&self, wo: Vec3, wi: Vec3) -> Option<Bounce> {
        let h = (wo + wi).try_normalize()?;
        let cos = wo.dot(h);
        if !(cos > 0.0 && wo.z > 0.0 && wi.z > 0.0) {
            return None;
        }
        let density = self.density(h);
        let value = density * self.shadowing(wo, wi) / (4.0 * wo.z * wi.z);
        Some(Bounce { cos, value, pdf: 0.25 * density / self.visible_area(wo) })
    }

    /// Returns the refraction from `wi` below the surface to `wo` above it, in importance mode; `None` if no facet
    /// refracts so. `eta`: index of refraction below over that above. Source: Walter et al. 2007, eq. 16 to 21.
    pub(super) fn refracted(&self, wo: Vec3, wi: Vec3, eta: f32) -> Option<Bounce> {
        let sum = wo + eta * wi;
        let length2 = sum.length_squared();
        let h = sum / length2.sqrt() * sum.z.signum();
        let (cos_o, cos_i) = (wo.dot(h), wi.dot(h));
        if !(cos_o > 0.0 && cos_i < 0.0 && wo.z > 0.0 && wi.z < 0.0) {
            return None;
        }
        // dω_h / dω_i, eq. 17.
        let jacobian = eta * eta * -cos_i / length2;
        let density = self.density(h) * cos_o * jacobian;
        let value = density * self.shadowing(wo, wi) / (wo.z * -wi.z);
        Some(Bounce { cos: cos_o, value, pdf: density / self.visible_area(wo) })
    }
}

/// Scattering of facets between two directions, before the Fresnel factor.
#[derive(Clone, Copy)]
pub(super) struct Bounce {
    /// Cosine between wo and the facet's normal.
    pub(super) cos: f32,
    /// f in sr⁻¹, before the Fresnel factor.
    pub(super) value: f32,
    /// Density of wi in sr⁻¹ if it is drawn by visible normals.
    pub(super) pdf: f32,
}
