//! Shading normals perturbed by a bump or normal map, and their effect on scattering.

use glam::Vec3;

/// A shading normal perturbed by a bump or normal map. As in Mitsuba 3, scattering is black for directions that lie on
/// different sides of the perturbed and the unperturbed normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiftedNormal {
    /// Unperturbed normal in the local frame, whose +z is the perturbed normal. Unit length.
    normal: Vec3,
    /// α² of GGX facets that cast the same shadows as the relief; 0: no shadowing.
    alpha_squared: f32,
}

impl LiftedNormal {
    /// Creates a perturbed normal.
    ///
    /// - `normal`: unperturbed normal in the local frame of the perturbed one; unit length.
    /// - `shadows`: `true`: attenuates light from grazing directions, which hides the bump terminator.
    ///
    /// Source: Conty Estevez, Lecocq and Stein 2019, A Microfacet-Based Shadowing Function to Solve the Bump Terminator
    /// Problem, Ray Tracing Gems, chapter 12: α² is an eighth of the squared slope, at most 1.
    pub fn new(normal: Vec3, shadows: bool) -> Self {
        Self { normal, alpha_squared: if shadows { (0.125 * slope_squared(normal.z)).min(1.0) } else { 0.0 } }
    }

    /// Returns the factor for scattering towards or from `wi`: Smith's shadowing of GGX facets. It depends on `wi` alone,
    /// so the scattering is not reciprocal.
    pub(crate) fn factor(&self, wi: Vec3) -> f32 {
        let cosine = self.normal.dot(wi);
        if cosine * wi.z <= 0.0 {
            return 0.0;
        }
        if self.alpha_squared == 0.0 {
            return 1.0;
        }
        2.0 / (1.0 + (1.0 + self.alpha_squared * slope_squared(cosine)).sqrt())
    }
}

/// Returns tan² θ for `cosine` = cos θ.
fn slope_squared(cosine: f32) -> f32 {
    let squared = cosine * cosine;
    (1.0 - squared).max(0.0) / squared.max(1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lifted_normal_darkens_low_light_and_cuts_off_what_it_alone_sees() {
        let normal = Vec3::new(0.6, 0.0, 0.8);
        let lifted = LiftedNormal::new(normal, true);
        // α² = 0.5625 ∕ 8; tan² = 3 at 60°.
        let low = Vec3::new(0.6 * 0.5, 3_f32.sqrt() / 2.0, 0.8 * 0.5);
        let expected = 2.0 / (1.0 + (1.0 + 3.0 * 0.5625 / 8.0_f32).sqrt());
        assert!((lifted.factor(low) - expected).abs() < 1e-5, "{}", lifted.factor(low));
        assert!((lifted.factor(normal) - 1.0).abs() < 1e-5);
        assert_eq!(lifted.factor(Vec3::new(-0.9, 0.0, 0.19_f32.sqrt())), 0.0);
        assert_eq!(LiftedNormal::new(normal, false).factor(low), 1.0);
    }
}
