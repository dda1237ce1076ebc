//! The clear coat: a thin, colourless layer of varnish.
//!
//! Parameters: strength and perceptual roughness in [0, 1], normal. Source: KHR_materials_clearcoat.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::LobeFlags;
use super::frame::Frame;
use super::fresnel;
use super::ggx::Ggx;
use super::interface::BoundarySample;
use super::tables::{Index, Mu, Rough, Tables};

/// Index of refraction of the coat (KHR_materials_clearcoat).
pub const IOR: f32 = 1.5;

/// A dielectric GGX layer over all layers but the sheen, with a normal of its own.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coat {
    weight: f32,
    /// Facets of the coat.
    pub(super) ggx: Ggx,
    rough: Rough,
    index: Index,
    /// Frame around the coat's normal; `None`: the base's normal.
    tilted: Option<Frame>,
}

impl Coat {
    /// Creates a coat; `None` if `weight` is 0. `normal`: unit length, above the surface.
    pub(super) fn new(weight: f32, roughness: f32, normal: Vec3) -> Option<Self> {
        (weight > 0.0).then(|| Self {
            weight,
            ggx: Ggx::from_roughness(roughness),
            rough: Rough::new(roughness),
            index: Index::new(IOR),
            tilted: (normal != Vec3::Z).then(|| Frame::from_normal(normal)),
        })
    }

    fn in_coat(&self, w: Vec3) -> Vec3 {
        self.tilted.map_or(w, |frame| frame.to_local(w))
    }

    /// Returns the cosine between a direction on either side and the coat's normal on that side; not positive if the
    /// direction is below the coat.
    fn cos(&self, w: Vec3) -> f32 {
        self.tilted.map_or(w.z.abs(), |frame| frame.z.dot(w) * w.z.signum())
    }

    /// Returns f and pdf of a rough coat; 0 for a smooth one. Both directions must be above the surface.
    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (f32, f32) {
        let (o, i) = (self.in_coat(wo), self.in_coat(wi));
        if self.ggx.is_smooth() || o.z <= 0.0 || i.z <= 0.0 {
            return (0.0, 0.0);
        }
        let Some(h) = (o + i).try_normalize() else { return (0.0, 0.0) };
        let facets = self.ggx.density(h) * self.ggx.visibility(o, i) * tilt(wo, o) * tilt(wi, i);
        (self.reflectance(o.dot(h)) * facets, self.ggx.reflection_pdf(o, h))
    }

    /// Returns the reflectance of a facet at cosine `cos`.
    fn reflectance(&self, cos: f32) -> f32 {
        self.weight * fresnel::dielectric(cos, IOR)
    }

    /// Draws a reflection; `None`: it meets another facet and is lost.
    pub(super) fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<BoundarySample> {
        let o = self.in_coat(wo);
        if o.z <= 0.0 {
            return None;
        }
        let smooth = self.ggx.is_smooth();
        let h = if smooth { Vec3::Z } else { self.ggx.sample_visible_normal(o, u) };
        let i = fresnel::reflect(o, h);
        let wi = self.tilted.map_or(i, |frame| frame.to_world(i));
        let sharp = if smooth { LobeFlags::DELTA } else { LobeFlags::GLOSSY };
        (i.z > 0.0 && wi.z > 0.0).then(|| {
            // f |cos θi|; the f of a mirror is divided by the cosine to its own normal
            let weight = self.reflectance(o.z) * tilt(wo, o) * tilt(wi, i) * (wi.z / i.z);
            BoundarySample {
                wi,
                flags: LobeFlags::REFLECTION.union(sharp),
                eta: 1.0,
                delta: smooth.then(|| (Spectrum::splat(weight), 1.0)),
            }
        })
    }

    /// Returns the reflected share of the light along a direction; an upper bound for a normal of its own.
    pub(super) fn albedo(&self, tables: &Tables, w: Vec3) -> f32 {
        let cos = self.cos(w);
        if cos <= 0.0 {
            return 0.0;
        }
        let mu = Mu::new(cos);
        let f0 = fresnel::at_normal_incidence(IOR);
        let rise = tables.rise(Some(mu), self.rough, self.index);
        self.weight * (f0 * tables.single(Some(mu), self.rough) + (1.0 - f0) * rise)
    }
}

/// Returns the factor by which a tilted coat is attenuated, symmetric in both directions, so that cosines to the base's
/// normal reflect no more light than those to the coat's. `base`, `coat`: one direction in both frames.
fn tilt(base: Vec3, coat: Vec3) -> f32 {
    (coat.z / base.z).min(1.0)
}
