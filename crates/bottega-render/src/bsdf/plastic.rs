//! A matte base below a smooth or rough dielectric boundary.
//!
//! Parameters: index of refraction, reflectance of the base, specular tint, facets, treatment of internal reflection.
//! Source: the plugins `plastic` and `roughplastic` of Mitsuba 3.

use std::f32::consts::FRAC_1_PI;

use bottega_scene::{InnerReflection, Spectrum};
use glam::Vec3;

use super::cover::RoughCover;
use super::fresnel::{self, mean};
use super::microfacet::Microfacets;
use super::scatter::{Lobes, Scatter, split};
use super::{BsdfSample, LobeFlags, TransportMode, warp};

/// A matte base below a dielectric boundary. Light is reflected by the boundary, or refracted, scattered by the base,
/// reflected internally any number of times, and refracted out. f = reflection + T(μo) T(μi) base / (π η²), where `base`
/// holds the geometric series.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plastic {
    /// Index of refraction inside over that outside.
    eta: f32,
    facets: Microfacets,
    /// Factor for the reflection of the boundary.
    specular: Spectrum,
    /// Sum of the geometric series over η².
    base: Spectrum,
    through: BaseTransmission,
}

/// The share of the light, by cosine, that reaches the base.
#[derive(Clone, Copy, Debug)]
pub(super) enum BaseTransmission {
    /// A smooth boundary over a layer of this thickness, in mean free paths.
    Smooth(f32),
    Rough(RoughCover),
}

/// [`Plastic`] for one direction.
struct PlasticView {
    through: f32,
    /// Probability of sampling the boundary's lobe.
    chance: f32,
}

impl Plastic {
    /// Creates Mitsuba's plastic: no absorption within, the series in closed form.
    ///
    /// - `diffuse`: reflectance of the base.
    /// - `cover`: transmission of rough facets, by [`Mean::Nodes`](super::cover::Mean); `None`: that of a smooth
    ///   boundary.
    ///
    /// The mean internal reflectance is computed as in Mitsuba, so that pictures agree. For smooth boundaries it is the
    /// fit of Egan and Hilgeman 1979, Optical Properties of Inhomogeneous Materials (after d'Eon and Irving 2011, A
    /// Quantized-Diffusion Model for Rendering Translucent Materials).
    pub(super) fn new(
        eta: f32,
        diffuse: Spectrum,
        specular: Spectrum,
        inner: InnerReflection,
        facets: Microfacets,
        cover: Option<RoughCover>,
    ) -> Self {
        let back = match &cover {
            None => fresnel::mean_internal_reflectance(eta),
            Some(cover) => cover.back(),
        };
        let base = match inner {
            InnerReflection::Linear => diffuse / ((1.0 - back) * (eta * eta)),
            InnerReflection::Nonlinear => diffuse / ((Spectrum::ONE - diffuse * back) * (eta * eta)),
            InnerReflection::Lost => diffuse,
        };
        Self {
            eta,
            facets,
            specular,
            base,
            through: cover.map_or(BaseTransmission::Smooth(0.0), BaseTransmission::Rough),
        }
    }

    /// Creates the BSDF from its parts: `base` is the sum of the series over η².
    pub(super) fn from_series(eta: f32, base: Spectrum, facets: Microfacets, through: BaseTransmission) -> Self {
        Self { eta, facets, specular: Spectrum::ONE, base, through }
    }

    fn through(&self, cos: f32) -> f32 {
        match &self.through {
            BaseTransmission::Smooth(thickness) => through_smooth(self.eta, *thickness, cos),
            BaseTransmission::Rough(cover) => cover.through(cos),
        }
    }

    fn seen(&self, wo: Vec3) -> PlasticView {
        let through = self.through(wo.z);
        // Light from the base returns through the boundary: approximate that share by a constant
        let mirrored = mean(self.specular) * fresnel::dielectric(wo.z, self.eta);
        let diffuse = mean(self.base) * through * MEAN_THROUGH;
        let sum = mirrored + diffuse;
        PlasticView { through, chance: if sum > 0.0 { mirrored / sum } else { 1.0 } }
    }
}

/// Approximate hemispherical mean of the transmittance of a plastic's boundary, for the choice of its lobe and its
/// albedo.
pub const MEAN_THROUGH: f32 = 0.9;

/// Returns the share of the light at a cosine that reaches the base below a smooth boundary and an absorbing layer.
fn through_smooth(eta: f32, thickness: f32, cos: f32) -> f32 {
    let through = 1.0 - fresnel::dielectric(cos, eta);
    if thickness == 0.0 {
        return through;
    }
    let sin2 = (1.0 - cos * cos).max(0.0) / (eta * eta);
    through * bottega_kernels::math::exp(-thickness / (1.0 - sin2).max(1e-12).sqrt())
}

impl Scatter for Plastic {
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, _mode: TransportMode) -> (Spectrum, f32) {
        if wi.z <= 0.0 {
            return (Spectrum::ZERO, 0.0);
        }
        let seen = self.seen(wo);
        let mut value = self.base * (seen.through * self.through(wi.z) * FRAC_1_PI);
        let mut pdf = (1.0 - seen.chance) * warp::cosine_hemisphere_pdf(wi.z);
        if !self.facets.is_smooth()
            && let Some(bounce) = self.facets.mirrored(wo, wi)
        {
            value += self.specular * (fresnel::dielectric(bounce.cos, self.eta) * bounce.value);
            pdf += seen.chance * bounce.pdf;
        }
        (value, pdf)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2], mode: TransportMode) -> Option<BsdfSample> {
        let PlasticView { chance, .. } = self.seen(wo);
        let (mirrors, _) = split(u_lobe, chance);
        if !mirrors {
            let lobe = LobeFlags::REFLECTION.union(LobeFlags::DIFFUSE);
            return self.spread(wo, warp::cosine_hemisphere(u), mode, lobe, 1.0);
        }
        if self.facets.is_smooth() {
            let energy = self.specular * fresnel::dielectric(wo.z, self.eta);
            return BsdfSample::delta(Vec3::new(-wo.x, -wo.y, wo.z), energy, chance, LobeFlags::REFLECTION, 1.0);
        }
        let wi = fresnel::reflect(wo, self.facets.sample_visible_normal(wo, u));
        self.spread(wo, wi, mode, LobeFlags::REFLECTION.union(LobeFlags::GLOSSY), 1.0)
    }

    fn diffuse_pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        (1.0 - self.seen(wo).chance) * warp::cosine_hemisphere_pdf(wi.z)
    }

    fn albedo(&self, wo: Vec3) -> Spectrum {
        let diffuse = self.base * (self.through(wo.z) * MEAN_THROUGH);
        self.specular * fresnel::dielectric(wo.z, self.eta) + diffuse
    }

    fn lobes(&self) -> Lobes {
        let has_non_delta = self.base != Spectrum::ZERO || !self.facets.is_smooth();
        Lobes { has_non_delta, is_transmissive: false, roughness: self.facets.roughness() }
    }
}
