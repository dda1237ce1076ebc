//! The unevenness of a relief: what its normal sees otherwise than the surface without it.

use glam::Vec3;

/// A normal that a relief lifted off that of the surface, as Mitsuba 3 has it: scattering is black where the two see a
/// direction from different sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiftedNormal {
    /// Normal of the surface without relief, in the local frame, whose +z is the lifted one. Unit length.
    normal: Vec3,
    /// Square of the roughness of facets that throw the same shadows as the relief; 0: it throws none.
    alpha_squared: f32,
}

impl LiftedNormal {
    /// - `normal`: of the surface without relief, in the local frame of the lifted one; unit length.
    /// - `shadows`: whether light that comes in low is weakened.
    ///
    /// Source: Conty Estevez, Lecocq and Stein 2019, A Microfacet-Based Shadowing Function to Solve the Bump Terminator
    /// Problem, Ray Tracing Gems, chapter 12: α² is an eighth of the squared slope, and 1 at most.
    pub fn new(normal: Vec3, shadows: bool) -> Self {
        Self { normal, alpha_squared: if shadows { (0.125 * slope_squared(normal.z)).min(1.0) } else { 0.0 } }
    }

    /// What the scattering towards or from `wi` is multiplied by: Smith's shadowing of GGX facets. It knows of the light
    /// alone, so that scattering is not reciprocal by it.
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

/// tan² of an angle.
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
