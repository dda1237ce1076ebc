//! Fresnel reflectance of dielectric and conductor boundaries; reflected and refracted directions.

use bottega_scene::Spectrum;
use glam::Vec3;

/// Returns the reflectance of a smooth dielectric boundary for unpolarized light, by Fresnel's equations.
///
/// - `cos_o`: cosine between the direction and the normal, in [0, 1].
/// - `eta`: index of refraction beyond the boundary over that on the side of the direction.
///
/// 1 for total internal reflection.
pub fn dielectric(cos_o: f32, eta: f32) -> f32 {
    let cos_o = cos_o.clamp(0.0, 1.0);
    let sin2_i = (1.0 - cos_o * cos_o) / (eta * eta);
    if sin2_i >= 1.0 {
        return 1.0;
    }
    let cos_i = (1.0 - sin2_i).sqrt();
    let parallel = (eta * cos_o - cos_i) / (eta * cos_o + cos_i);
    let perpendicular = (cos_o - eta * cos_i) / (cos_o + eta * cos_i);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// Returns the reflectance of a smooth metal for unpolarized light, by channel: Fresnel's equations for a complex index
/// of refraction (`eta` + i `k`) relative to that of the outside. `cos_o` as in [`dielectric`]. Source: Born and Wolf,
/// Principles of Optics, section 14.2 (in real numbers).
pub fn conductor(cos_o: f32, eta: Spectrum, k: Spectrum) -> Spectrum {
    let cos = cos_o.clamp(0.0, 1.0);
    let cos2 = cos * cos;
    let sin2 = 1.0 - cos2;
    let channel = |n: f32, k: f32| {
        // (a + ib)² = (n + ik)² − sin²
        let t = n * n - k * k - sin2;
        let size = (t * t + 4.0 * n * n * k * k).sqrt();
        let twice = 2.0 * cos * (0.5 * (size + t)).max(0.0).sqrt();
        let perpendicular = (size + cos2 - twice) / (size + cos2 + twice);
        let (p, q) = (cos2 * size + sin2 * sin2, twice * sin2);
        0.5 * perpendicular * (1.0 + (p - q) / (p + q))
    };
    let value = Spectrum::new(channel(eta.x, k.x), channel(eta.y, k.y), channel(eta.z, k.z));
    // 0 / 0 at the horizon for an index of 1
    if value.is_finite() { value } else { Spectrum::ONE }
}

/// Returns the direction into which light along `wo` is refracted at a boundary; it points away from the boundary like
/// `wo`. `None`: total internal reflection.
///
/// - `h`: normal of the boundary, unit length, with wo · h > 0.
/// - `eta`: as in [`dielectric`].
pub fn refract(wo: Vec3, h: Vec3, eta: f32) -> Option<Vec3> {
    let cos_o = wo.dot(h);
    let sin2_i = (1.0 - cos_o * cos_o).max(0.0) / (eta * eta);
    if sin2_i >= 1.0 {
        return None;
    }
    let cos_i = (1.0 - sin2_i).sqrt();
    Some((h * (cos_o / eta - cos_i) - wo / eta).normalize())
}

/// Returns `wo` mirrored at the unit normal `h`; it points away from the boundary like `wo`.
pub fn reflect(wo: Vec3, h: Vec3) -> Vec3 {
    2.0 * wo.dot(h) * h - wo
}

/// Returns (1 − cos θ)⁵, the weight of white in Schlick's Fresnel term. Source: Schlick 1994, An Inexpensive BRDF Model
/// for Physically-based Rendering, eq. 15.
pub fn schlick_weight(cos_o: f32) -> f32 {
    let m = (1.0 - cos_o).clamp(0.0, 1.0);
    let m2 = m * m;
    m2 * m2 * m
}

/// Largest index of refraction of a boundary, relative to the outside; larger ones are clamped. The smallest is its
/// inverse.
pub const IOR_MAX: f32 = 5.0;
/// Smallest difference of a rough boundary's index from 1; below it, the lobe is too narrow for single precision.
pub const IOR_STEP_MIN: f32 = 5e-3;

/// Fresnel term of a dielectric with the strength and tint of KHR_materials_specular.
///
/// F = specular · (f₀ + (1 − f₀) s), where s = (F_exact − F₀) / (1 − F₀) is the rise of the exact reflectance from its
/// value F₀ at normal incidence towards 1, and f₀ = min(F₀ · tint, 1). With specular 1 and a white tint, F is the exact
/// reflectance. (The extension uses Schlick's weight for s; here only an index that stands for total reflection, F₀ = 1,
/// does.)
#[derive(Clone, Copy, Debug)]
pub(super) struct DielectricFresnel {
    /// Index of refraction beyond the boundary over that on the side of wo.
    pub(super) eta: f32,
    /// f₀: tinted reflectance at normal incidence, before `specular`.
    pub(super) f0: Spectrum,
    /// Strength of the reflection, in [0, 1].
    pub(super) specular: f32,
    /// F₀: untinted reflectance at normal incidence; 1 stands for total reflection.
    pub(super) f0_exact: f32,
}

impl DielectricFresnel {
    /// Creates the term; `ior` of the solid is at least 1, or 0 for total reflection; `inside`: `true` if wo is within
    /// the solid.
    pub(super) fn new(ior: f32, specular: f32, tint: Spectrum, inside: bool) -> Self {
        let f0_exact = if ior == 0.0 { 1.0 } else { at_normal_incidence(ior) };
        let eta = match (ior == 0.0, inside) {
            (true, _) => 1.0,
            (false, true) => 1.0 / ior,
            (false, false) => ior,
        };
        Self { eta, f0: (tint * f0_exact).min(Spectrum::ONE), specular, f0_exact }
    }

    /// Returns true if the index stands for total reflection.
    pub(super) fn is_total(&self) -> bool {
        self.f0_exact >= 1.0
    }

    /// Returns the reflectance for a direction at cosine `cos_o` to the (micro)normal.
    pub(super) fn at(&self, cos_o: f32) -> Spectrum {
        if self.is_total() {
            return self.of_rise(schlick_weight(cos_o));
        }
        let exact = dielectric(cos_o, self.eta);
        if exact >= 1.0 && self.eta < 1.0 {
            // Total internal reflection: no light is refracted, even for a weak `specular`
            return Spectrum::ONE;
        }
        self.of_rise((exact - self.f0_exact) / (1.0 - self.f0_exact))
    }

    /// Returns the reflectance with a separate index of refraction per channel; `etas`: beyond the boundary over before
    /// it.
    pub(super) fn at_dispersed(&self, cos_o: f32, etas: [f32; 3]) -> Spectrum {
        Spectrum::from([0, 1, 2].map(|channel| {
            let f0_exact = at_normal_incidence(etas[channel]);
            let f0 = (self.f0 * (f0_exact / self.f0_exact.max(1e-9))).min(Spectrum::ONE);
            let own = Self { eta: etas[channel], f0, f0_exact, ..*self };
            own.at(cos_o)[channel]
        }))
    }

    /// Returns s for light from outside: the rise of the exact reflectance.
    pub(super) fn rise(&self, cos_o: f32) -> f32 {
        if self.is_total() {
            return schlick_weight(cos_o);
        }
        (dielectric(cos_o, self.eta.max(1.0 / self.eta)) - self.f0_exact) / (1.0 - self.f0_exact)
    }

    /// Returns F for a given s.
    pub(super) fn of_rise(&self, rise: f32) -> Spectrum {
        // Negative only with a black tint and an index above 2 + √3, whose reflectance dips before it rises
        self.specular * (self.f0 + (Spectrum::ONE - self.f0) * rise).max(Spectrum::ZERO)
    }
}

/// Returns the hemispherical mean of the reflectance from within a solid of index `eta`, by the fit of Egan and Hilgeman
/// 1979, Optical Properties of Inhomogeneous Materials.
pub(super) fn mean_internal_reflectance(eta: f32) -> f32 {
    // Fits in terms of the index beyond the boundary over that before it
    let beyond = 1.0 / eta;
    if beyond < 1.0 {
        ((-1.4399 * beyond + 0.7099) * beyond + 0.6681) + 0.0636 / beyond
    } else {
        let r = 1.0 / beyond;
        ((((-1.36881 * r + 4.98554) * r - 7.80989) * r + 6.75335) * r - 3.4793) * r + 0.919317
    }
}

/// Returns F₀, the reflectance at normal incidence, of an index of refraction.
pub(super) fn at_normal_incidence(ior: f32) -> f32 {
    let r = (ior - 1.0) / (ior + 1.0);
    r * r
}

/// Returns the mean of a colour's channels, used for lobe probabilities.
pub(super) fn mean(color: Spectrum) -> f32 {
    (color.x + color.y + color.z) * (1.0 / 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflectance_of_glass_has_its_textbook_values() {
        assert!((dielectric(1.0, 1.5) - 0.04).abs() < 1e-6);
        assert!((dielectric(1.0, 1.0 / 1.5) - 0.04).abs() < 1e-6);
        assert_eq!(dielectric(0.0, 1.5), 1.0);
        // Brewster's angle: only the perpendicular half is reflected, ((n² − 1) / (n² + 1))² / 2.
        let brewster = 1.0 / (1.0f32 + 1.5 * 1.5).sqrt();
        assert!((dielectric(brewster, 1.5) - 0.5 * (1.25f32 / 3.25).powi(2)).abs() < 1e-6);
    }

    #[test]
    fn beyond_the_critical_angle_everything_is_reflected() {
        let critical = (1.0f32 - 1.0 / (1.5 * 1.5)).sqrt();
        assert_eq!(dielectric(critical - 1e-3, 1.0 / 1.5), 1.0);
        assert!(dielectric(critical + 1e-3, 1.0 / 1.5) < 1.0);
        let wo = Vec3::new((1.0 - (critical - 1e-3).powi(2)).sqrt(), 0.0, critical - 1e-3);
        assert_eq!(refract(wo, Vec3::Z, 1.0 / 1.5), None);
    }

    #[test]
    fn both_ways_through_a_boundary_reflect_alike() {
        for step in 1..50 {
            let cos_o = step as f32 / 50.0;
            let wo = Vec3::new((1.0 - cos_o * cos_o).sqrt(), 0.0, cos_o);
            let wi = refract(wo, Vec3::Z, 1.5).unwrap();
            assert!((wo.x + 1.5 * wi.x).abs() < 1e-6, "Snell's law");
            assert!((dielectric(cos_o, 1.5) - dielectric(-wi.z, 1.0 / 1.5)).abs() < 2e-4);
        }
    }

    #[test]
    fn full_strength_and_a_white_tint_leave_fresnel_exact() {
        for ior in [1.1, 1.5, 2.4, 5.0] {
            let fresnel = DielectricFresnel::new(ior, 1.0, Spectrum::ONE, false);
            for step in 0..=20 {
                let cos_o = step as f32 / 20.0;
                assert!((fresnel.at(cos_o).x - dielectric(cos_o, ior)).abs() < 2e-6);
            }
        }
    }
}
