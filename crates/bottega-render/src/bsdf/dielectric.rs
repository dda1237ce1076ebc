//! The boundary of a clear solid, or a thin clear sheet; smooth or rough.
//!
//! Parameters: index of refraction, tints of reflection and transmission in [0, 1], facets, thin or solid. Source: the
//! dielectric models of Mitsuba 3 and pbrt; rough refraction by Walter et al. 2007.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::fresnel::{self, mean};
use super::microfacet::Microfacets;
use super::scatter::{Lobes, Scatter};
use super::{BsdfSample, LobeFlags, TransportMode};

/// The boundary of a clear solid, or a thin sheet with two of them. Single scattering only, as in Mitsuba and pbrt.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dielectric {
    /// Index of refraction beyond the boundary (sheet: within it) over that on the side of wo.
    eta: f32,
    /// Factor for the reflection, in [0, 1].
    reflectance: Spectrum,
    /// Factor for the transmission, in [0, 1].
    transmittance: Spectrum,
    facets: Microfacets,
    /// `true`: a sheet that transmits without refraction, with all reflections between both boundaries.
    thin: bool,
}

/// Smallest difference of the index from 1 of a rough boundary; below it, refraction is so weak that it counts as smooth.
pub const ETA_STEP_MIN: f32 = 1e-3;

impl Dielectric {
    /// Creates the BSDF; `None` if both tints are black.
    pub(super) fn new(
        eta: f32,
        reflectance: Spectrum,
        transmittance: Spectrum,
        facets: Microfacets,
        thin: bool,
    ) -> Option<Self> {
        let is_matched = (eta - 1.0).abs() < ETA_STEP_MIN && !thin;
        let facets = if is_matched { Microfacets::SMOOTH } else { facets };
        (reflectance.max(transmittance).max_element() > 0.0).then_some(Self {
            eta,
            reflectance,
            transmittance,
            facets,
            thin,
        })
    }

    /// Returns reflectance and transmittance of a facet, and the probability of sampling reflection.
    fn split(&self, cos: f32) -> (Spectrum, Spectrum, f32) {
        let single = fresnel::dielectric(cos, self.eta);
        // Both boundaries of a sheet: R + T² R / (1 − R²), with T = 1 − R
        let share = if self.thin { 2.0 * single / (1.0 + single) } else { single };
        let (reflected, transmitted) = (self.reflectance * share, self.transmittance * (1.0 - share));
        let (r, t) = (mean(reflected), mean(transmitted));
        (reflected, transmitted, if r + t > 0.0 { r / (r + t) } else { 1.0 })
    }

    /// Returns the transmittance of a smooth sheet, without deflection; 0 for anything else.
    pub(super) fn straight(&self, wo: Vec3) -> Spectrum {
        if self.thin && self.facets.is_smooth() { self.split(wo.z).1 } else { Spectrum::ZERO }
    }

    fn eta_across(&self) -> f32 {
        if self.thin { 1.0 } else { self.eta }
    }
}

impl Scatter for Dielectric {
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> (Spectrum, f32) {
        let is_reflected = wi.z > 0.0;
        let bounce = match (is_reflected, self.thin) {
            _ if self.facets.is_smooth() => None,
            (true, _) => self.facets.mirrored(wo, wi),
            (false, true) => self.facets.mirrored(wo, Vec3::new(wi.x, wi.y, -wi.z)),
            (false, false) => self.facets.refracted(wo, wi, self.eta),
        };
        let Some(bounce) = bounce else { return (Spectrum::ZERO, 0.0) };
        let (reflected, transmitted, chance) = self.split(bounce.cos);
        if is_reflected {
            (reflected * bounce.value, chance * bounce.pdf)
        } else {
            let scale = mode.radiance_scale(self.eta_across());
            (transmitted * (bounce.value * scale), (1.0 - chance) * bounce.pdf)
        }
    }

    #[inline]
    fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2], mode: TransportMode) -> Option<BsdfSample> {
        let smooth = self.facets.is_smooth();
        let h = if smooth { Vec3::Z } else { self.facets.sample_visible_normal(wo, u) };
        let (reflected, transmitted, chance) = self.split(wo.dot(h));
        if u_lobe < chance {
            let wi = fresnel::reflect(wo, h);
            if smooth {
                return BsdfSample::delta(wi, reflected, chance, LobeFlags::REFLECTION, 1.0);
            }
            let lobe = LobeFlags::REFLECTION.union(LobeFlags::GLOSSY);
            return if wi.z > 0.0 { self.spread(wo, wi, mode, lobe, 1.0) } else { None };
        }
        let eta = self.eta_across();
        let wi =
            if self.thin { fresnel::reflect(wo, h) * Vec3::new(1.0, 1.0, -1.0) } else { fresnel::refract(wo, h, eta)? };
        if smooth {
            let energy = transmitted * mode.radiance_scale(eta);
            return BsdfSample::delta(wi, energy, 1.0 - chance, LobeFlags::TRANSMISSION, eta);
        }
        let lobe = LobeFlags::TRANSMISSION.union(LobeFlags::GLOSSY);
        if wi.z < 0.0 { self.spread(wo, wi, mode, lobe, eta) } else { None }
    }

    fn albedo(&self, wo: Vec3) -> Spectrum {
        let (reflected, transmitted, _) = self.split(wo.z);
        reflected + transmitted
    }

    fn lobes(&self) -> Lobes {
        let roughness = self.facets.roughness();
        let is_transmissive = self.transmittance != Spectrum::ZERO;
        Lobes { has_non_delta: !self.facets.is_smooth(), is_transmissive, roughness }
    }
}
