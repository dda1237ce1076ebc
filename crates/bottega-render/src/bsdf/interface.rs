//! The base's GGX boundary: reflection by metal and dielectric, and transmission.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::film::Film;
use super::fresnel::{self, DielectricFresnel, mean};
use super::ggx::Ggx;
use super::{LobeFlags, TransportMode};

/// The fate of light that is not reflected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TransmissionKind {
    /// Scattered diffusely or absorbed.
    Nothing,
    /// Transmitted by a thin sheet, without refraction.
    Thin,
    /// Refracted into or out of a solid.
    Solid,
}

/// A rough or smooth boundary. Its facets reflect `metal` · Schlick + `dielectric` · Fresnel and transmit the rest of the
/// dielectric's share, tinted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interface {
    /// Facets of the boundary; smooth ones make a mirror.
    pub(super) ggx: Ggx,
    /// Share of the surface that is metal, and its reflectance at normal incidence.
    pub(super) metal: f32,
    /// Reflectance of the metal at normal incidence.
    pub(super) metal_f0: Spectrum,
    /// Share of the surface that reflects as a dielectric.
    pub(super) dielectric: f32,
    /// Fresnel term of the dielectric.
    pub(super) fresnel: DielectricFresnel,
    /// Fate of the light that is not reflected.
    pub(super) through: TransmissionKind,
    /// Share of the surface that transmits light, times its colour.
    pub(super) tint: Spectrum,
    /// Thin film on the boundary.
    pub(super) film: Option<Film>,
    /// Reflectances at normal incidence, of metal and dielectric, that have the same mean as those under the film.
    pub(super) mean_f0: [Spectrum; 2],
    /// Half the difference of a solid's index of refraction between red and blue; 0: no dispersion.
    pub(super) spread: f32,
}

/// Reflection and transmission of one facet.
#[derive(Clone, Copy)]
struct FacetShares {
    reflected: Spectrum,
    transmitted: Spectrum,
    /// Probability of sampling reflection.
    reflection: f32,
}

/// A sampled direction, with value and probability if the boundary is smooth.
pub(super) struct BoundarySample {
    /// Sampled direction in the local frame, unit length.
    pub(super) wi: Vec3,
    /// Flags of the sampled lobe.
    pub(super) flags: LobeFlags,
    /// Index of refraction on the side of wi over that on the side of wo.
    pub(super) eta: f32,
    /// f |cos θi| and probability of a Dirac lobe; `None` otherwise.
    pub(super) delta: Option<(Spectrum, f32)>,
}

impl Interface {
    /// Returns the index of refraction on the far side over that on the near side, for the directions.
    pub(super) fn eta(&self) -> f32 {
        if self.through == TransmissionKind::Solid { self.fresnel.eta } else { 1.0 }
    }

    /// Returns the index of refraction of each channel, far side over near side (KHR_materials_dispersion).
    fn etas(&self) -> [f32; 3] {
        let inside = self.fresnel.eta < 1.0;
        let ior = if inside { 1.0 / self.fresnel.eta } else { self.fresnel.eta };
        [-1.0, 0.0, 1.0].map(|step| {
            let ior = (ior + step * self.spread).max(1.0);
            if inside { 1.0 / ior } else { ior }
        })
    }

    fn is_dispersive(&self) -> bool {
        self.spread > 0.0
    }

    /// Returns the reflectances of metal and dielectric.
    fn reflectances(&self, cos: f32) -> (Spectrum, Spectrum) {
        let dielectric =
            if self.is_dispersive() { self.fresnel.at_dispersed(cos, self.etas()) } else { self.fresnel.at(cos) };
        let metal = self.metal_f0 + (Spectrum::ONE - self.metal_f0) * fresnel::schlick_weight(cos);
        let Some(film) = &self.film else { return (metal, dielectric) };
        // The film is outside: totally reflected light from within does not reach it
        let inside = self.through == TransmissionKind::Solid && self.fresnel.eta < 1.0;
        let eta = if inside { self.fresnel.eta } else { 1.0 };
        let cos2 = 1.0 - (1.0 - cos * cos).max(0.0) / (eta * eta);
        if cos2 <= 0.0 {
            return (metal, dielectric);
        }
        let specular = self.fresnel.specular;
        let coloured = film.reflectance(cos2.sqrt(), self.fresnel.f0) * specular;
        let metal =
            if self.metal > 0.0 { film.mix(metal, film.reflectance(cos2.sqrt(), self.metal_f0)) } else { metal };
        (metal, film.mix(dielectric, coloured))
    }

    /// Splits the light at a facet.
    ///
    /// - `carried`: throughput per channel; with dispersion, it determines the probability of reflection.
    fn split(&self, cos: f32, carried: Spectrum) -> FacetShares {
        let (metal, dielectric) = self.reflectances(cos);
        let reflected = self.metal * metal + self.dielectric * dielectric;
        if self.through == TransmissionKind::Nothing {
            return FacetShares { reflected, transmitted: Spectrum::ZERO, reflection: 1.0 };
        }
        let passed = if self.is_dispersive() {
            Spectrum::ONE - dielectric
        } else {
            Spectrum::splat(1.0 - dielectric.max_element())
        };
        let transmitted = self.tint * passed;
        let (r, t) = if self.is_dispersive() {
            (carried.dot(reflected), carried.dot(transmitted))
        } else {
            (mean(reflected), mean(transmitted))
        };
        let reflection = if r + t > 0.0 { r / (r + t) } else { 1.0 };
        FacetShares { reflected, transmitted, reflection }
    }

    /// Returns true if nothing is reflected or transmitted.
    pub(super) fn is_black(&self) -> bool {
        self.metal <= 0.0 && self.dielectric * self.fresnel.specular <= 0.0 && self.tint == Spectrum::ZERO
    }

    /// Returns the albedo of reflection and transmission, from outside. `single`, `schlick`, `rise`: albedos of single
    /// reflection with F = 1, Schlick's weight, and s; `all`: share that the dielectric reflects or transmits.
    pub(super) fn albedo(&self, single: f32, schlick: f32, rise: f32, all: f32) -> Spectrum {
        let [metal_f0, f0] = self.mean_f0;
        let metal = metal_f0 * (single - schlick) + schlick;
        let dielectric = self.fresnel.specular * (f0 * (single - rise) + rise).max(Spectrum::ZERO);
        let through = (all - dielectric.max_element()).max(0.0);
        self.metal * metal + self.dielectric * dielectric + self.tint * through
    }

    /// Returns the albedo of the smooth boundary at cosine `cos`, for lobe probabilities.
    pub(super) fn smooth_albedo(&self, cos: f32) -> Spectrum {
        let split = self.split(cos, Spectrum::ONE);
        split.reflected + split.transmitted
    }

    /// Returns f and pdf of a rough boundary; 0 for a smooth one. `carried`: see
    /// [`Bsdf::at_carrying`](super::Bsdf::at_carrying).
    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3, mode: TransportMode, carried: Spectrum) -> (Spectrum, f32) {
        if self.ggx.is_smooth() || self.is_black() {
            return (Spectrum::ZERO, 0.0);
        }
        match (wi.z > 0.0, self.through) {
            (true, _) => self.mirrored(wo, wi, carried, |split| (split.reflected, split.reflection)),
            (false, TransmissionKind::Nothing) => (Spectrum::ZERO, 0.0),
            (false, TransmissionKind::Thin) => {
                let above = Vec3::new(wi.x, wi.y, -wi.z);
                self.mirrored(wo, above, carried, |split| (split.transmitted, 1.0 - split.reflection))
            }
            (false, TransmissionKind::Solid) => self.refracted(wo, wi, mode, carried),
        }
    }

    fn mirrored(
        &self,
        wo: Vec3,
        wi: Vec3,
        carried: Spectrum,
        share: impl Fn(FacetShares) -> (Spectrum, f32),
    ) -> (Spectrum, f32) {
        let Some(h) = (wo + wi).try_normalize() else { return (Spectrum::ZERO, 0.0) };
        let (color, probability) = share(self.split(wo.dot(h), carried));
        let value = color * (self.ggx.density(h) * self.ggx.visibility(wo, wi));
        (value, probability * self.ggx.reflection_pdf(wo, h))
    }

    fn refracted(&self, wo: Vec3, wi: Vec3, mode: TransportMode, carried: Spectrum) -> (Spectrum, f32) {
        let by = |eta, share: &dyn Fn(&FacetShares) -> (Spectrum, f32)| {
            self.refracted_by(wo, wi, eta, mode, |cos| share(&self.split(cos, carried)))
        };
        if !self.is_dispersive() {
            return by(self.eta(), &|split| (split.transmitted, 1.0 - split.reflection));
        }
        // Refract each channel by its own index, at its own facet
        let (mut value, mut pdf) = (Spectrum::ZERO, 0.0);
        for (channel, eta) in self.etas().into_iter().enumerate() {
            let (part, density) = by(eta, &|split| {
                let chance = (1.0 - split.reflection) * split.channel_chance(channel, carried);
                (split.transmitted * Spectrum::AXES[channel], chance)
            });
            value += part;
            pdf += density;
        }
        (value, pdf)
    }

    /// Evaluates refraction by Walter et al. 2007, eq. 16 to 21, with separable shadowing.
    fn refracted_by(
        &self,
        wo: Vec3,
        wi: Vec3,
        eta: f32,
        mode: TransportMode,
        share: impl Fn(f32) -> (Spectrum, f32),
    ) -> (Spectrum, f32) {
        let sum = wo + eta * wi;
        let length2 = sum.length_squared();
        let h = sum / length2.sqrt() * sum.z.signum();
        let (cos_o, cos_i) = (wo.dot(h), wi.dot(h));
        if !(cos_o > 0.0 && cos_i < 0.0) {
            return (Spectrum::ZERO, 0.0);
        }
        let (color, chance) = share(cos_o);
        // dω_h / dω_i, eq. 17.
        let jacobian = eta * eta * -cos_i / length2;
        let pdf = chance * self.ggx.visible_normal_pdf(wo, h) * jacobian;
        let facets = self.ggx.density(h) * self.ggx.masking(wo) * self.ggx.masking(wi);
        let value = color * (facets * cos_o * jacobian / (wo.z * -wi.z));
        (value * mode.radiance_scale(eta), pdf)
    }

    /// Draws a facet, then reflection or transmission. `None`: the light meets another facet and is lost.
    pub(super) fn sample(
        &self,
        wo: Vec3,
        u_way: f32,
        u: [f32; 2],
        mode: TransportMode,
        carried: Spectrum,
    ) -> Option<BoundarySample> {
        let smooth = self.ggx.is_smooth();
        let h = if smooth { Vec3::Z } else { self.ggx.sample_visible_normal(wo, u) };
        // Split the light at a facet, and choose reflection or transmission
        let split = self.split(wo.dot(h), carried);
        let sharp = if smooth { LobeFlags::DELTA } else { LobeFlags::GLOSSY };
        if u_way < split.reflection {
            let wi = fresnel::reflect(wo, h);
            return (wi.z > 0.0).then(|| BoundarySample {
                wi,
                flags: LobeFlags::REFLECTION.union(sharp),
                eta: 1.0,
                delta: smooth.then_some((split.reflected, split.reflection)),
            });
        }
        // Choose a channel if the boundary is dispersive
        let (eta, color, chance) = if self.is_dispersive() {
            let u = (u_way - split.reflection) / (1.0 - split.reflection);
            let channel = split.channel_at(u, carried);
            (self.etas()[channel], split.transmitted * Spectrum::AXES[channel], split.channel_chance(channel, carried))
        } else {
            (self.eta(), split.transmitted, 1.0)
        };
        let wi = match self.through {
            TransmissionKind::Nothing => return None,
            TransmissionKind::Thin => fresnel::reflect(wo, h) * Vec3::new(1.0, 1.0, -1.0),
            TransmissionKind::Solid => fresnel::refract(wo, h, eta)?,
        };
        (wi.z < 0.0).then(|| BoundarySample {
            wi,
            flags: LobeFlags::TRANSMISSION.union(sharp),
            eta,
            delta: smooth.then_some((color * mode.radiance_scale(eta), (1.0 - split.reflection) * chance)),
        })
    }
}

impl FacetShares {
    /// Returns the probability of a channel for refraction; a path with a single channel left follows it.
    fn channel_chance(&self, channel: usize, carried: Spectrum) -> f32 {
        let sum = self.transmitted.dot(carried);
        if sum > 0.0 { self.transmitted[channel] * carried[channel] / sum } else { 0.0 }
    }

    /// Returns the channel chosen by a random number in [0, 1).
    fn channel_at(&self, u: f32, carried: Spectrum) -> usize {
        let red = self.channel_chance(0, carried);
        let green = self.channel_chance(1, carried);
        if u < red {
            0
        } else if u < red + green {
            1
        } else {
            2
        }
    }
}
