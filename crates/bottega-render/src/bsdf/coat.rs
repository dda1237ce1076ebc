//! The clear coat: a thin, colourless film of varnish.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::LobeFlags;
use super::fresnel;
use super::ggx::Ggx;
use super::interface::Drawn;
use super::tables::{Index, Mu, Rough, Tables};

/// Index of refraction of the coat (KHR_materials_clearcoat).
const IOR: f32 = 1.5;

/// A dielectric GGX layer over all but the sheen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coat {
    weight: f32,
    pub(super) ggx: Ggx,
    rough: Rough,
    index: Index,
}

impl Coat {
    /// `None` without strength.
    pub(super) fn new(weight: f32, roughness: f32) -> Option<Self> {
        let (ggx, rough) = (Ggx::from_roughness(roughness), Rough::new(roughness));
        (weight > 0.0).then(|| Self { weight, ggx, rough, index: Index::new(IOR) })
    }

    /// f and density of a rough coat; nothing of a smooth one.
    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (f32, f32) {
        let Some(h) = (wo + wi).try_normalize().filter(|_| !self.ggx.is_smooth()) else { return (0.0, 0.0) };
        let facets = self.ggx.density(h) * self.ggx.visibility(wo.z, wi.z);
        (self.reflectance(wo.dot(h)) * facets, self.ggx.reflection_pdf(wo, h))
    }

    /// What a facet reflects.
    pub(super) fn reflectance(&self, cos: f32) -> f32 {
        self.weight * fresnel::dielectric(cos, IOR)
    }

    /// `None`: the light goes on between the facets.
    pub(super) fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<Drawn> {
        let smooth = self.ggx.is_smooth();
        let h = if smooth { Vec3::Z } else { self.ggx.sample_visible_normal(wo, u) };
        let wi = fresnel::reflect(wo, h);
        let sharp = if smooth { LobeFlags::DELTA } else { LobeFlags::GLOSSY };
        (wi.z > 0.0).then(|| Drawn {
            wi,
            flags: LobeFlags::REFLECTION.union(sharp),
            eta: 1.0,
            delta: smooth.then(|| (Spectrum::splat(self.reflectance(wo.z)), 1.0)),
        })
    }

    /// Share of the light at a cosine that is reflected.
    pub(super) fn albedo(&self, tables: &Tables, mu: Mu) -> f32 {
        let f0 = ((IOR - 1.0) / (IOR + 1.0)) * ((IOR - 1.0) / (IOR + 1.0));
        let rise = tables.rise(Some(mu), self.rough, self.index);
        self.weight * (f0 * tables.single(Some(mu), self.rough) + (1.0 - f0) * rise)
    }
}
