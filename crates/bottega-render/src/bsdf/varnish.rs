//! A base below a clear layer with a smooth or rough dielectric boundary; light that the boundary reflects back to the
//! base is lost.
//!
//! Parameters: index of refraction of the layer, its optical thickness per channel, tint of the boundary's reflection in
//! [0, 1], facets of the boundary; any base without transmission. f = reflection + T(μo) T(μi) exp(−τ (1/μ′o + 1/μ′i))
//! f_base(ω′o, ω′i) / η². T is the transmittance of the boundary, τ the optical thickness, ω′ a direction as a smooth
//! boundary refracts it into the layer, and μ′ its cosine. [`Coated`](super::coated) follows the lost light, too, for fewer
//! bases.
//!
//! Sources: Weidlich and Wilkie 2007, *Arbitrarily Layered Micro-Facet Surfaces*; the plugins `coating` and `roughcoating`
//! of Mitsuba 0.6.

use bottega_kernels::math;
use bottega_scene::Spectrum;
use glam::Vec3;

use super::conductor::Conductor;
use super::cover::RoughCover;
use super::fresnel::{self, mean};
use super::gloss::Gloss;
use super::matte::RoughMatte;
use super::microfacet::Microfacets;
use super::plastic::Plastic;
use super::principled::Principled;
use super::scatter::{Lobes, Scatter, split};
use super::{BsdfSample, LobeFlags, TransportMode};

/// The base below the layer.
#[derive(Clone, Copy, Debug)]
pub(super) enum VarnishBase {
    Matte(RoughMatte),
    Conductor(Conductor),
    Plastic(Plastic),
    Gloss(Gloss),
    Principled(Principled),
}

/// Dispatches an expression over all kinds of `VarnishBase`.
macro_rules! ask {
    ($base:expr, $it:ident => $answer:expr) => {
        match $base {
            VarnishBase::Matte($it) => $answer,
            VarnishBase::Conductor($it) => $answer,
            VarnishBase::Plastic($it) => $answer,
            VarnishBase::Gloss($it) => $answer,
            VarnishBase::Principled($it) => $answer,
        }
    };
}

/// A base, a clear layer, and the layer's boundary.
#[derive(Clone, Copy, Debug)]
pub(super) struct Varnish {
    /// Index of refraction of the layer over that of the outside.
    pub(super) eta: f32,
    pub(super) facets: Microfacets,
    /// Transmission of rough facets; `None`: the boundary is smooth.
    pub(super) cover: Option<RoughCover>,
    /// Factor of the reflection of the boundary.
    pub(super) specular: Spectrum,
    /// Optical thickness of the layer.
    pub(super) absorption: Spectrum,
    pub(super) base: VarnishBase,
}

/// A direction that passes the boundary.
#[derive(Clone, Copy)]
struct Passage {
    /// The direction within the layer, away from the base.
    inner: Vec3,
    /// Share of the light that passes the boundary and the layer.
    share: Spectrum,
    /// Solid angle within the layer per solid angle outside.
    compression: f32,
}

/// [`Varnish`] for one direction.
struct VarnishView {
    /// `None`: nothing passes the boundary.
    passage: Option<Passage>,
    /// Probability of sampling the boundary's lobe.
    chance: f32,
}

impl Varnish {
    fn through(&self, cos: f32) -> f32 {
        match &self.cover {
            None => 1.0 - fresnel::dielectric(cos, self.eta),
            Some(cover) => cover.through(cos),
        }
    }

    /// Returns the passage of a direction above the surface into the layer; `None`: total reflection.
    fn passage(&self, w: Vec3) -> Option<Passage> {
        let sin2 = (1.0 - w.z * w.z).max(0.0) / (self.eta * self.eta);
        let cos = (1.0 - sin2).sqrt();
        if sin2 >= 1.0 || cos <= 0.0 {
            return None;
        }
        let absorbed = |depth: f32| if depth == 0.0 { 1.0 } else { math::exp(-depth / cos) };
        let tau = self.absorption;
        let share = Spectrum::new(absorbed(tau.x), absorbed(tau.y), absorbed(tau.z)) * self.through(w.z);
        let inner = Vec3::new(w.x / self.eta, w.y / self.eta, cos);
        Some(Passage { inner, share, compression: w.z / (self.eta * self.eta * cos) })
    }

    /// Returns the direction outside the layer; `None`: total reflection.
    fn out(&self, inner: Vec3) -> Option<Vec3> {
        let sin2 = (1.0 - inner.z * inner.z).max(0.0) * (self.eta * self.eta);
        let cos = (1.0 - sin2).max(0.0).sqrt();
        (cos > 0.0).then(|| Vec3::new(inner.x * self.eta, inner.y * self.eta, cos))
    }

    fn seen(&self, wo: Vec3) -> VarnishView {
        let mirrored = mean(self.specular) * (1.0 - self.through(wo.z)).max(0.0);
        let passage = self.passage(wo);
        let from_base = passage.map_or(0.0, |passage| mean(passage.share * self.base_albedo(&passage)));
        let sum = mirrored + from_base;
        VarnishView { passage, chance: if sum > 0.0 { mirrored / sum } else { 1.0 } }
    }

    /// Estimates the share of the light arriving at the base that leaves the layer.
    fn base_albedo(&self, passage: &Passage) -> Spectrum {
        let (albedo, roughness) = ask!(&self.base, it => (it.albedo(passage.inner), it.lobes().roughness));
        // The boundary reflects much diffuse light back inside, and little of a mirror's
        let back = fresnel::mean_internal_reflectance(self.eta).clamp(0.0, 1.0);
        albedo * passage.share * (1.0 - back * roughness)
    }

    fn boundary(&self, wo: Vec3, u: [f32; 2], chance: f32, mode: TransportMode) -> Option<BsdfSample> {
        if self.facets.is_smooth() {
            let energy = self.specular * fresnel::dielectric(wo.z, self.eta);
            return BsdfSample::delta(Vec3::new(-wo.x, -wo.y, wo.z), energy, chance, LobeFlags::REFLECTION, 1.0);
        }
        let wi = fresnel::reflect(wo, self.facets.sample_visible_normal(wo, u));
        self.spread(wo, wi, mode, LobeFlags::REFLECTION.union(LobeFlags::GLOSSY), 1.0)
    }
}

impl Scatter for Varnish {
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> (Spectrum, f32) {
        if wi.z <= 0.0 {
            return (Spectrum::ZERO, 0.0);
        }
        let VarnishView { passage, chance } = self.seen(wo);
        let (mut value, mut pdf) = (Spectrum::ZERO, 0.0);
        if !self.facets.is_smooth()
            && let Some(bounce) = self.facets.mirrored(wo, wi)
        {
            value += self.specular * (fresnel::dielectric(bounce.cos, self.eta) * bounce.value);
            pdf += chance * bounce.pdf;
        }
        if let (Some(o), Some(i)) = (passage, self.passage(wi)) {
            let (of_base, base_pdf) = ask!(&self.base, it => it.eval_pdf(o.inner, i.inner, mode));
            value += of_base * o.share * i.share / (self.eta * self.eta);
            pdf += (1.0 - chance) * base_pdf * i.compression;
        }
        (value, pdf)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2], mode: TransportMode) -> Option<BsdfSample> {
        let VarnishView { passage, chance } = self.seen(wo);
        let (mirrors, u_lobe) = split(u_lobe, chance);
        if mirrors {
            return self.boundary(wo, u, chance, mode);
        }
        // Refract into the layer, scatter at the base, and refract out
        let o = passage?;
        let sample = ask!(&self.base, it => it.sample(o.inner, u_lobe, u, mode))?;
        let wi = if sample.wi.z > 0.0 { self.out(sample.wi)? } else { return None };
        if !sample.is_delta() {
            return self.spread(wo, wi, mode, sample.lobe, 1.0);
        }
        let energy = sample.value * sample.wi.z * o.share * self.passage(wi)?.share;
        BsdfSample::delta(wi, energy, (1.0 - chance) * sample.pdf, LobeFlags::REFLECTION, 1.0)
    }

    fn diffuse_pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let VarnishView { passage, chance } = self.seen(wo);
        let (Some(o), Some(i)) = (passage, self.passage(wi)) else { return 0.0 };
        (1.0 - chance) * ask!(&self.base, it => it.diffuse_pdf(o.inner, i.inner)) * i.compression
    }

    fn albedo(&self, wo: Vec3) -> Spectrum {
        let from_base = self.passage(wo).map_or(Spectrum::ZERO, |passage| self.base_albedo(&passage));
        self.specular * (1.0 - self.through(wo.z)).max(0.0) + from_base
    }

    fn lobes(&self) -> Lobes {
        let base = ask!(&self.base, it => it.lobes());
        Lobes {
            has_non_delta: base.has_non_delta || !self.facets.is_smooth(),
            is_transmissive: false,
            roughness: base.roughness.min(self.facets.roughness()),
        }
    }
}

#[cfg(test)]
mod tests {
    use bottega_scene::{Distribution, Shadowing};

    use super::*;

    fn over(base: VarnishBase, depth: f32, alpha: f32) -> Varnish {
        let facets = Microfacets::new(Distribution::Beckmann, Shadowing::Separable, [alpha; 2]);
        let cover = (!facets.is_smooth()).then(|| facets.cover(1.5, 0.0, super::super::cover::Mean::Exact));
        let (specular, absorption) = (Spectrum::ONE, Spectrum::splat(depth));
        Varnish { eta: 1.5, facets, cover, specular, absorption, base }
    }

    fn white() -> VarnishBase {
        VarnishBase::Matte(RoughMatte::new(Spectrum::ONE, 0.0))
    }

    fn mirror() -> VarnishBase {
        let metal = Conductor::new(Spectrum::ZERO, Spectrum::ZERO, Spectrum::ONE, Microfacets::SMOOTH);
        VarnishBase::Conductor(metal.unwrap())
    }

    fn albedo(varnish: &Varnish, wo: Vec3) -> f32 {
        const SIDE: u32 = 32;
        // Many steps through the lobes, whose chances must be met
        const LOBES: u32 = 512;
        let mut sum = 0.0_f64;
        for i in 0..SIDE * SIDE * LOBES {
            let u = [((i % SIDE) as f32 + 0.5) / SIDE as f32, ((i / SIDE % SIDE) as f32 + 0.5) / SIDE as f32];
            let u_lobe = ((i / (SIDE * SIDE)) as f32 + 0.5) / LOBES as f32;
            let sample = varnish.sample(wo, u_lobe, u, TransportMode::Radiance);
            sum += sample.map_or(0.0, |sample| f64::from(sample.weight().x));
        }
        (sum / f64::from(SIDE * SIDE * LOBES)) as f32
    }

    #[test]
    fn a_varnished_mirror_reflects_at_its_boundary_and_at_its_base() {
        // F + (1 − F)² exp(−2 τ / μ′)
        for (cos, depth) in [(1.0_f32, 0.0_f32), (0.7, 0.0), (0.7, 0.3), (0.2, 0.1)] {
            let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let reflectance = fresnel::dielectric(cos, 1.5);
            let inner = (1.0 - (1.0 - cos * cos) / 2.25).sqrt();
            let expected = reflectance + (1.0 - reflectance).powi(2) * (-2.0 * depth / inner).exp();
            let varnish = over(mirror(), depth, 0.0);
            let ways = [0.0, 1.0_f32.next_down()].map(|u_lobe| {
                let sample = varnish.sample(wo, u_lobe, [0.3; 2], TransportMode::Radiance).unwrap();
                assert!(sample.is_delta() && (sample.wi - Vec3::new(-wo.x, 0.0, cos)).length() < 1e-5, "{sample:?}");
                (sample.weight().x * sample.pdf, sample.pdf)
            });
            let found = ways[0].0 + ways[1].0;
            assert!((found - expected).abs() < 1e-4, "{cos} {depth}: {found} {expected}");
            assert!((ways[0].1 + ways[1].1 - 1.0).abs() < 1e-5, "{ways:?}");
        }
    }

    #[test]
    fn a_varnished_white_base_loses_what_its_boundary_reflects_inside() {
        // F(μ) + (1 − F(μ)) (1 − F̄) / η², with F̄ = 0.091766 for an index of 1.5
        for cos in [1.0_f32, 0.6, 0.2] {
            let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let reflectance = fresnel::dielectric(cos, 1.5);
            let expected = reflectance + (1.0 - reflectance) * (1.0 - 0.091_766) / 2.25;
            let found = albedo(&over(white(), 0.0, 0.0), wo);
            assert!((found - expected).abs() < 3e-3, "{cos}: {found} {expected}");
        }
    }

    #[test]
    fn a_boundary_of_little_roughness_is_almost_smooth() {
        let wo = Vec3::new(0.6, 0.0, 0.8);
        let (smooth, rough) = (albedo(&over(white(), 0.2, 0.0), wo), albedo(&over(white(), 0.2, 0.02), wo));
        assert!((smooth - rough).abs() < 5e-3, "{smooth} {rough}");
    }

    #[test]
    fn a_layer_thinner_than_its_surroundings_reflects_all_low_light() {
        let varnish = Varnish { eta: 0.7, ..over(white(), 0.0, 0.0) };
        let wo = Vec3::new(0.9, 0.0, 0.19_f32.sqrt());
        let sample = varnish.sample(wo, 0.99, [0.5; 2], TransportMode::Radiance).unwrap();
        assert!(sample.is_delta() && (sample.weight().x - 1.0).abs() < 1e-6, "{sample:?}");
        assert_eq!(varnish.eval_pdf(wo, Vec3::Z, TransportMode::Radiance).0, Spectrum::ZERO);
    }
}
