//! A smooth or rough metal with a complex index of refraction.
//!
//! Parameters: index of refraction per channel, tint in [0, 1], facets. Source: Fresnel's equations
//! ([`fresnel::conductor`]) on the facets of [`Microfacets`].

use bottega_scene::Spectrum;
use glam::Vec3;

use super::fresnel;
use super::microfacet::Microfacets;
use super::scatter::{Lobes, Scatter};
use super::{BsdfSample, LobeFlags, TransportMode};

/// A smooth or rough metal with a complex index of refraction. Single scattering only, as in Mitsuba and pbrt.
#[derive(Clone, Copy, Debug)]
pub(super) struct Conductor {
    /// Real part of the index of refraction (`k`: imaginary part), relative to the outside; both 0: a perfect mirror.
    eta: Spectrum,
    k: Spectrum,
    /// Factor for the reflection, in [0, 1].
    tint: Spectrum,
    facets: Microfacets,
}

impl Conductor {
    /// Creates a metal; `None` for a black `tint`.
    pub(super) fn new(eta: Spectrum, k: Spectrum, tint: Spectrum, facets: Microfacets) -> Option<Self> {
        (tint.max_element() > 0.0).then_some(Self { eta, k, tint, facets })
    }

    /// Returns the reflectance of a facet at cosine `cos`.
    pub(super) fn reflectance(&self, cos: f32) -> Spectrum {
        if self.eta == Spectrum::ZERO && self.k == Spectrum::ZERO {
            return self.tint;
        }
        self.tint * fresnel::conductor(cos, self.eta, self.k)
    }

    /// Returns true if the metal is a mirror: its only lobe is a Dirac lobe.
    pub(super) fn is_smooth(&self) -> bool {
        self.facets.is_smooth()
    }

    /// Returns α along x and y.
    pub(super) fn alpha(&self) -> [f32; 2] {
        self.facets.alpha()
    }
}

impl Scatter for Conductor {
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, _mode: TransportMode) -> (Spectrum, f32) {
        if self.is_smooth() {
            return (Spectrum::ZERO, 0.0);
        }
        match self.facets.mirrored(wo, wi) {
            Some(bounce) => (self.reflectance(bounce.cos) * bounce.value, bounce.pdf),
            None => (Spectrum::ZERO, 0.0),
        }
    }

    fn sample(&self, wo: Vec3, _u_lobe: f32, u: [f32; 2], mode: TransportMode) -> Option<BsdfSample> {
        if self.is_smooth() {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            return BsdfSample::delta(wi, self.reflectance(wo.z), 1.0, LobeFlags::REFLECTION, 1.0);
        }
        let wi = fresnel::reflect(wo, self.facets.sample_visible_normal(wo, u));
        self.spread(wo, wi, mode, LobeFlags::REFLECTION.union(LobeFlags::GLOSSY), 1.0)
    }

    fn albedo(&self, wo: Vec3) -> Spectrum {
        // Light that meets a second facet is lost: about the share masked from wo
        self.reflectance(wo.z) * self.facets.masking(wo)
    }

    fn lobes(&self) -> Lobes {
        let roughness = self.facets.roughness();
        Lobes { has_non_delta: !self.is_smooth(), is_transmissive: false, roughness }
    }
}
