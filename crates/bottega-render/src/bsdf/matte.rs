//! Matte surfaces: rough diffuse reflection, and diffuse reflection with transmission.
//!
//! Parameters: reflectance and transmittance in [0, 1]; roughness as standard deviation of slopes, in radians. Source:
//! Lambert's law; rough surfaces by Portsmouth, Kutz and Hill 2024, *EON: A Practical Energy-Preserving Rough Diffuse
//! BRDF*.

use std::f32::consts::{FRAC_1_PI, PI};

use bottega_kernels::math;
use bottega_scene::Spectrum;
use glam::Vec3;

use super::fresnel::mean;
use super::scatter::{Lobes, Scatter};
use super::{BsdfSample, LobeFlags, TransportMode, warp};

/// A rough matte surface like Oren and Nayar's that preserves energy: a white one reflects everything.
///
/// Source: Portsmouth, Kutz and Hill 2024, EON: A Practical Energy-Preserving Rough Diffuse BRDF, eq. 14 to 28. Their
/// parameter r is derived from the standard deviation of the slopes by the ratio of Oren and Nayar's two terms (1994,
/// Generalization of Lambert's Reflectance Model, eq. 30).
#[derive(Clone, Copy, Debug)]
pub(super) struct RoughMatte {
    color: Spectrum,
    /// Roughness r of EON, in [0, 1].
    rough: f32,
    /// Colour of multiple scattering between the facets, before its normalization.
    multiple: Spectrum,
}

/// Coefficient of the roughness r in the denominator 1 + LOSS · r of EON's first term.
pub const LOSS: f32 = 0.5 - 2.0 / (3.0 * PI);
/// Coefficient of the roughness r in the mean albedo (1 + GAIN · r) / (1 + LOSS · r) of EON's first term.
pub const GAIN: f32 = 2.0 / 3.0 - 28.0 / (15.0 * PI);

impl RoughMatte {
    /// Creates the surface; `deviation`: standard deviation of the slopes, in radians.
    pub(super) fn new(color: Spectrum, deviation: f32) -> Self {
        let s2 = deviation * deviation;
        let rough = (0.45 * s2 / (s2 + 0.09) / (1.0 - 0.5 * s2 / (s2 + 0.33))).min(1.0);
        let single = (1.0 + GAIN * rough) / (1.0 + LOSS * rough);
        let multiple = color * color * (single / (1.0 - single).max(1e-6)) / (Spectrum::ONE - color * (1.0 - single));
        Self { color, rough, multiple }
    }

    /// Returns the albedo of single scattering by a white surface at a cosine.
    fn single(&self, cos: f32) -> f32 {
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        // tan (1 − sin³), without cancellation at the horizon
        let tail = sin * cos * (1.0 + sin + sin * sin) / (1.0 + sin);
        let rise = sin * (math::acos(cos) - sin * cos - 2.0 / 3.0) + 2.0 / 3.0 * tail;
        (1.0 + self.rough * FRAC_1_PI * rise) / (1.0 + LOSS * self.rough)
    }
}

impl Scatter for RoughMatte {
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, _mode: TransportMode) -> (Spectrum, f32) {
        if wi.z <= 0.0 {
            return (Spectrum::ZERO, 0.0);
        }
        let s = wo.dot(wi) - wo.z * wi.z;
        let t = if s > 0.0 { wo.z.max(wi.z) } else { 1.0 };
        let single = (1.0 + self.rough * s / t) / (1.0 + LOSS * self.rough);
        let rest = (1.0 - self.single(wo.z)).max(0.0) * (1.0 - self.single(wi.z)).max(0.0);
        let value = (self.color * single + self.multiple * rest) * FRAC_1_PI;
        (value, warp::cosine_hemisphere_pdf(wi.z))
    }

    fn sample(&self, wo: Vec3, _u_lobe: f32, u: [f32; 2], mode: TransportMode) -> Option<BsdfSample> {
        let lobe = LobeFlags::REFLECTION.union(LobeFlags::DIFFUSE);
        self.spread(wo, warp::cosine_hemisphere(u), mode, lobe, 1.0)
    }

    fn diffuse_pdf(&self, _wo: Vec3, wi: Vec3) -> f32 {
        warp::cosine_hemisphere_pdf(wi.z)
    }

    fn albedo(&self, wo: Vec3) -> Spectrum {
        let single = self.single(wo.z);
        let mean_single = (1.0 + GAIN * self.rough) / (1.0 + LOSS * self.rough);
        self.color * single + self.multiple * ((1.0 - single) * (1.0 - mean_single))
    }

    fn lobes(&self) -> Lobes {
        Lobes { has_non_delta: true, is_transmissive: false, roughness: 1.0 }
    }
}

/// Lambertian reflection and transmission: paper, or a leaf.
#[derive(Clone, Copy, Debug)]
pub(super) struct Translucent {
    reflectance: Spectrum,
    transmittance: Spectrum,
    /// Probability of sampling reflection.
    reflection: f32,
}

impl Translucent {
    /// Creates the surface; `None` if both colours are black.
    pub(super) fn new(reflectance: Spectrum, transmittance: Spectrum) -> Option<Self> {
        let (r, t) = (mean(reflectance), mean(transmittance));
        (r + t > 0.0).then(|| Self { reflectance, transmittance, reflection: r / (r + t) })
    }
}

impl Scatter for Translucent {
    fn eval_pdf(&self, _wo: Vec3, wi: Vec3, _mode: TransportMode) -> (Spectrum, f32) {
        let reflects = wi.z > 0.0;
        let (color, chance) =
            if reflects { (self.reflectance, self.reflection) } else { (self.transmittance, 1.0 - self.reflection) };
        (color * FRAC_1_PI, chance * warp::cosine_hemisphere_pdf(wi.z.abs()))
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2], mode: TransportMode) -> Option<BsdfSample> {
        let wi = warp::cosine_hemisphere(u);
        if u_lobe < self.reflection {
            self.spread(wo, wi, mode, LobeFlags::REFLECTION.union(LobeFlags::DIFFUSE), 1.0)
        } else {
            self.spread(wo, -wi, mode, LobeFlags::TRANSMISSION.union(LobeFlags::DIFFUSE), 1.0)
        }
    }

    fn diffuse_pdf(&self, _wo: Vec3, wi: Vec3) -> f32 {
        self.reflection * warp::cosine_hemisphere_pdf(wi.z)
    }

    fn albedo(&self, _wo: Vec3) -> Spectrum {
        self.reflectance + self.transmittance
    }

    fn lobes(&self) -> Lobes {
        Lobes { has_non_delta: true, is_transmissive: self.transmittance != Spectrum::ZERO, roughness: 1.0 }
    }
}
