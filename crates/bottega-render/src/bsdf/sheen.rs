//! Sheen: the soft rim light of cloth, by the Charlie distribution.
//!
//! Parameters: colour, roughness in [0, 1]. Source: Estevez and Kulla 2017, below.

use std::f32::consts::{PI, TAU};

use bottega_kernels::math;
use bottega_scene::Spectrum;
use glam::Vec3;

use super::tables::{Mu, Rough, Tables};

/// Smallest roughness of sheen; smaller values are clamped, because the lobe becomes a line along the horizon.
pub const ROUGHNESS_MIN: f32 = 0.1;

/// A layer of fibers on top of all other layers.
///
/// Source: Estevez and Kulla 2017, Production Friendly Microfacet Sheen BRDF, eq. 2 (distribution) and section 3 (the fit
/// of the shadowing), without the softened terminator, which is not reciprocal. The fit gives grazing directions an
/// albedo above 1; a common factor for all directions scales it down to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sheen {
    color: Spectrum,
    alpha: f32,
    fit: [f32; 5],
    rough: Rough,
}

impl Sheen {
    /// Creates a sheen layer; `None` for a black colour.
    pub(super) fn new(tables: &Tables, color: Spectrum, roughness: f32) -> Option<Self> {
        if color.max_element() <= 0.0 {
            return None;
        }
        let roughness = roughness.max(ROUGHNESS_MIN);
        let alpha = roughness * roughness;
        let rough = Rough::at((roughness - ROUGHNESS_MIN) / (1.0 - ROUGHNESS_MIN));
        let color = color / tables.sheen_peak(rough).max(1.0);
        Some(Self { color, alpha, fit: fit(alpha), rough })
    }

    /// Returns f(wo, wi) in sr⁻¹; both directions must be above the horizon.
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Spectrum {
        let Some(h) = (wo + wi).try_normalize() else { return Spectrum::ZERO };
        self.color * charlie(self.alpha, &self.fit, wo.z, wi.z, h)
    }

    /// Returns the share of the light at cosine `mu` that reaches the layers below (KHR_materials_sheen, albedo scaling).
    pub(super) fn passed(&self, tables: &Tables, mu: Mu) -> f32 {
        1.0 - self.color.max_element() * tables.sheen(mu, self.rough)
    }

    /// Returns the reflected share, given the result of [`Self::passed`].
    pub(super) fn albedo(&self, passed: f32) -> Spectrum {
        self.color * ((1.0 - passed) / self.color.max_element())
    }
}

/// Returns the roughness at a position in [0, 1] along the tables' axis.
pub(super) fn roughness_at(position: f32) -> f32 {
    ROUGHNESS_MIN + (1.0 - ROUGHNESS_MIN) * position
}

/// Returns D · G / (4 cos_o cos_i) for a white colour.
fn charlie(alpha: f32, fit: &[f32; 5], cos_o: f32, cos_i: f32, h: Vec3) -> f32 {
    let sin = (h.x * h.x + h.y * h.y).sqrt().min(1.0);
    if sin <= 0.0 {
        return 0.0;
    }
    let density = (2.0 + 1.0 / alpha) * math::powf(sin, 1.0 / alpha) / TAU;
    let (cos_o, cos_i) = (cos_o.max(1e-4), cos_i.max(1e-4));
    density / (4.0 * cos_o * cos_i * (1.0 + lambda(fit, cos_o) + lambda(fit, cos_i)))
}

/// Coefficients of the fit of the sheen's shadowing for α = 0.
pub const NARROW: [f32; 5] = [25.3245, 3.32435, 0.16801, -1.27393, -4.85967];
/// Coefficients of the fit of the sheen's shadowing for α = 1.
pub const WIDE: [f32; 5] = [21.5473, 3.82987, 0.19823, -1.97760, -4.32054];

/// Interpolates the coefficients of the fit for `alpha`.
fn fit(alpha: f32) -> [f32; 5] {
    let narrow = (1.0 - alpha) * (1.0 - alpha);
    std::array::from_fn(|i| narrow * NARROW[i] + (1.0 - narrow) * WIDE[i])
}

fn lambda(fit: &[f32; 5], cos: f32) -> f32 {
    let [a, b, c, d, e] = *fit;
    let l = |x: f32| a / (1.0 + b * math::powf(x, c)) + d * x + e;
    math::exp(if cos < 0.5 { l(cos) } else { 2.0 * l(0.5) - l((1.0 - cos).max(1e-6)) })
}

/// Returns the albedo of white sheen at cosine `mu`, by quadrature. Used to build the tables.
pub(super) fn albedo_by_quadrature(mu: f32, roughness: f32) -> f32 {
    const COSINES: usize = 24;
    const AZIMUTHS: usize = 20;
    let alpha = roughness * roughness;
    let fit = fit(alpha);
    let wo = Vec3::new((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
    let mut sum = 0.0;
    for i in 0..COSINES {
        // Uniform steps in √cos: most of the light is near the horizon
        let root = (i as f32 + 0.5) / COSINES as f32;
        let cos = root * root;
        let sin = (1.0 - cos * cos).sqrt();
        for j in 0..AZIMUTHS {
            let (sin_phi, cos_phi) = math::sin_cos(PI * (j as f32 + 0.5) / AZIMUTHS as f32);
            let wi = Vec3::new(sin * cos_phi, sin * sin_phi, cos);
            let h = (wo + wi).normalize();
            sum += charlie(alpha, &fit, mu, cos, h) * cos * 2.0 * root;
        }
    }
    sum * TAU / (COSINES * AZIMUTHS) as f32
}
