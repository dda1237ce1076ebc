//! Disney's principled material, as in Mitsuba 3, for solids and thin sheets.
//!
//! Parameters: see [`bottega_scene::Principled`]. Sources: Burley 2012 and 2015, see [`Principled`].

use std::f32::consts::{FRAC_1_PI, PI};

use bottega_kernels::math;
use bottega_scene::{Distribution, Shadowing, Spectrum};
use glam::Vec3;

use super::fresnel::{self, mean, schlick_weight};
use super::microfacet::Microfacets;
use super::scatter::{Lobes, Scatter, split};
use super::{BsdfSample, LobeFlags, TransportMode, warp};

/// Parameters at one point, as in [`bottega_scene::Principled`], clamped to their ranges.
#[derive(Clone, Copy, Debug)]
pub(super) struct PrincipledParams {
    /// Base colour, multiplied by the vertex colour, in [0, 1].
    pub(super) base_color: Spectrum,
    /// Perceptual roughness, in [0, 1]: α is its square.
    pub(super) roughness: f32,
    /// Stretch of highlights along x, in [0, 1].
    pub(super) anisotropic: f32,
    /// Share of metal, in [0, 1].
    pub(super) metallic: f32,
    /// Share of transmission in the dielectric part, in [0, 1].
    pub(super) spec_trans: f32,
    /// Index of refraction inside over that outside.
    pub(super) eta: f32,
    /// Tint of the dielectric reflection towards the base colour, in [0, 1].
    pub(super) spec_tint: f32,
    /// Strength of the sheen, in [0, 1].
    pub(super) sheen: f32,
    /// Tint of the sheen towards the base colour, in [0, 1].
    pub(super) sheen_tint: f32,
    /// Blend of the diffuse lobe towards flat subsurface scattering, in [0, 1].
    pub(super) flatness: f32,
    /// Strength of the clear coat, in [0, 1].
    pub(super) clearcoat: f32,
    /// Gloss of the clear coat, in [0, 1]: α goes from 0.1 to 0.001.
    pub(super) clearcoat_gloss: f32,
    /// Share of the diffuse light that is transmitted, in [0, 1].
    pub(super) diff_trans: f32,
}

/// The material of a solid: diffuse lobe, sheen, main lobes of reflection and transmission, clear coat. From within the
/// solid, only the main lobes exist.
///
/// Sources: Burley 2012, Physically Based Shading at Disney; Burley 2015, Extending the Disney BRDF to a BSDF with
/// Integrated Subsurface Scattering. Details that they leave open follow Mitsuba 3: exact Fresnel reflectance of the
/// dielectric, separable shadowing, and √base_color at each crossing of the boundary.
#[derive(Clone, Copy, Debug)]
pub(super) struct Principled {
    p: PrincipledParams,
    facets: Microfacets,
    /// `true`: wo is within the solid.
    inside: bool,
    /// Base colour scaled to luminance 1.
    tint: Spectrum,
    /// α of the clear coat's facets.
    coat_alpha: f32,
}

/// The material of a thin sheet: diffuse and sharp lobes on both sides.
#[derive(Clone, Copy, Debug)]
pub(super) struct PrincipledSheet {
    p: PrincipledParams,
    reflecting: Microfacets,
    /// Facets of transmission: light is refracted twice, which changes the roughness.
    transmitting: Microfacets,
    tint: Spectrum,
}

fn facets(roughness: f32, anisotropic: f32) -> Microfacets {
    let aspect = (1.0 - 0.9 * anisotropic).sqrt();
    let alpha = roughness * roughness;
    let alpha = [alpha / aspect, alpha * aspect].map(|alpha| alpha.max(1e-3));
    Microfacets::new(Distribution::Ggx, Shadowing::Separable, alpha)
}

/// Returns a colour scaled to luminance 1; white for black.
fn tint_of(color: Spectrum) -> Spectrum {
    let luminance = color.dot(Vec3::new(0.212671, 0.715160, 0.072169));
    if luminance > 0.0 { color / luminance } else { Spectrum::ONE }
}

fn mix<T>(a: T, b: T, share: f32) -> T
where
    T: std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
{
    a * (1.0 - share) + b * share
}

/// Returns Schlick's term with reflectance `f0` at normal incidence, evaluated at the angle on the side of the smaller
/// index. `eta`: index of refraction beyond the boundary over that before it.
fn schlick(f0: Spectrum, cos: f32, eta: f32) -> Spectrum {
    let cos = if eta > 1.0 { cos } else { (1.0 - (1.0 - cos * cos) / (eta * eta)).max(0.0).sqrt() };
    mix(f0, Spectrum::ONE, schlick_weight(cos))
}

/// Diffuse lobe and sheen for a pair of directions, without base colour and weights.
struct Diffuse {
    diffuse: f32,
    sheen: Spectrum,
}

impl PrincipledParams {
    /// Evaluates diffuse lobe and sheen; both directions must be above the surface.
    fn diffuse(&self, wo: Vec3, wi: Vec3, tint: Spectrum) -> Diffuse {
        let (fo, fi) = (schlick_weight(wo.z), schlick_weight(wi.z));
        let cos = (wo + wi).normalize_or(Vec3::Z).dot(wi);
        let retro = 2.0 * self.roughness * cos * cos;
        let lambert = (1.0 - 0.5 * fo) * (1.0 - 0.5 * fi) + retro * (fo + fi + fo * fi * (retro - 1.0));
        // Hanrahan and Krueger's subsurface scattering, in Burley's flat approximation
        let at_horizon = 0.5 * retro;
        let flat = mix(1.0, at_horizon, fo) * mix(1.0, at_horizon, fi);
        let flat = 1.25 * (flat * (1.0 / (wo.z + wi.z) - 0.5) + 0.5);
        let sheen = mix(Spectrum::ONE, tint, self.sheen_tint) * (self.sheen * schlick_weight(cos.abs()));
        Diffuse { diffuse: FRAC_1_PI * mix(lambert, flat, self.flatness), sheen }
    }
}

impl Principled {
    /// Creates the BSDF; `p`: clamped parameters; `inside`: `true` if wo is within the solid.
    pub(super) fn new(p: PrincipledParams, inside: bool) -> Self {
        Self {
            facets: facets(p.roughness, p.anisotropic),
            inside,
            tint: tint_of(p.base_color),
            coat_alpha: mix(0.1, 0.001, p.clearcoat_gloss),
            p,
        }
    }

    /// Returns the share of the surface that is a clear solid.
    fn clear(&self) -> f32 {
        (1.0 - self.p.metallic) * self.p.spec_trans
    }

    /// Returns the share of the surface that has a matte base.
    fn matte(&self) -> f32 {
        (1.0 - self.p.metallic) * (1.0 - self.p.spec_trans)
    }

    /// Returns the index of refraction beyond the boundary over that on the side of wo.
    fn eta(&self) -> f32 {
        if self.inside { 1.0 / self.p.eta } else { self.p.eta }
    }

    /// Returns the reflectance of a facet, and the share of the light that it transmits.
    fn split(&self, cos: f32) -> (Spectrum, f32) {
        let p = &self.p;
        let exact = fresnel::dielectric(cos, self.eta());
        let through = self.clear() * (1.0 - exact);
        if self.inside {
            return (Spectrum::splat(self.clear() * exact), through);
        }
        let metal = schlick(p.base_color, cos, p.eta) * p.metallic;
        let f0 = self.tint * fresnel::at_normal_incidence(p.eta);
        let dielectric = mix(Spectrum::splat(exact), schlick(f0, cos, p.eta), p.spec_tint);
        (metal + dielectric * (1.0 - p.metallic), through)
    }

    /// Returns the probability of sampling reflection rather than transmission at a facet.
    fn reflection(&self, cos: f32) -> f32 {
        let (reflected, through) = self.split(cos);
        let (r, t) = (mean(reflected), through * mean(self.p.base_color));
        // Keep both probabilities above 0 to bound the weights
        if through > 0.0 { (r + 0.05) / (r + t + 0.1) } else { 1.0 }
    }

    /// Returns the probabilities of the main lobes and of the clear coat; the remainder is the diffuse lobe's.
    fn chances(&self, wo: Vec3) -> [f32; 2] {
        if self.inside {
            return [1.0, 0.0];
        }
        let (reflected, through) = self.split(wo.z);
        let main = mean(reflected) + through * mean(self.p.base_color) + 0.02;
        let coat = 0.25 * self.p.clearcoat * mix(0.04, 1.0, schlick_weight(wo.z));
        let diffuse = self.matte() * mean(self.p.base_color) + 0.2 * (1.0 - self.p.metallic) * self.p.sheen;
        let sum = main + coat + diffuse;
        [main / sum, coat / sum]
    }

    /// Returns f of the clear coat and its pdf. Its facets are Burley's generalized Trowbridge-Reitz distribution with γ
    /// = 1.
    fn coat(&self, wo: Vec3, wi: Vec3) -> (f32, f32) {
        let Some(h) = (wo + wi).try_normalize() else { return (0.0, 0.0) };
        let cos = wo.dot(h);
        if cos <= 0.0 {
            return (0.0, 0.0);
        }
        let a2 = self.coat_alpha * self.coat_alpha;
        let density = (a2 - 1.0) / (PI * math::ln(a2) * (h.x * h.x + h.y * h.y + a2 * h.z * h.z));
        let masking = |cos: f32| {
            let tan2 = (1.0 - cos * cos).max(0.0) / (cos * cos);
            2.0 / (1.0 + (1.0 + 0.25 * 0.25 * tan2).sqrt())
        };
        let reflectance = schlick(Spectrum::splat(0.04), cos, self.p.eta).x;
        let value = 0.25 * self.p.clearcoat * reflectance * density * masking(wo.z) * masking(wi.z);
        (value, density * h.z / (4.0 * cos))
    }

    fn sample_coat(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        let a2 = self.coat_alpha * self.coat_alpha;
        let cos2 = (1.0 - math::powf(a2, 1.0 - u[1])) / (1.0 - a2);
        let (cos, sin) = (cos2.max(0.0).sqrt(), (1.0 - cos2).max(0.0).sqrt());
        let (sin_phi, cos_phi) = math::sin_cos_of_turns(u[0]);
        fresnel::reflect(wo, Vec3::new(sin * cos_phi, sin * sin_phi, cos))
    }
}

impl Scatter for Principled {
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> (Spectrum, f32) {
        let p = &self.p;
        let [main, coat] = self.chances(wo);
        // Transmission into or out of the solid
        if wi.z < 0.0 {
            if self.clear() <= 0.0 {
                return (Spectrum::ZERO, 0.0);
            }
            let eta = self.eta();
            let Some(bounce) = self.facets.refracted(wo, wi, eta) else { return (Spectrum::ZERO, 0.0) };
            let (_, through) = self.split(bounce.cos);
            let color = Spectrum::new(p.base_color.x.sqrt(), p.base_color.y.sqrt(), p.base_color.z.sqrt());
            let value = color * (through * bounce.value * mode.radiance_scale(eta));
            return (value, main * (1.0 - self.reflection(bounce.cos)) * bounce.pdf);
        }
        let (mut value, mut pdf) = (Spectrum::ZERO, 0.0);
        // Reflection of the main lobe
        if let Some(bounce) = self.facets.mirrored(wo, wi) {
            value += self.split(bounce.cos).0 * bounce.value;
            pdf += main * self.reflection(bounce.cos) * bounce.pdf;
        }
        if self.inside {
            return (value, pdf);
        }
        // Clear coat
        if p.clearcoat > 0.0 {
            let (coat_value, coat_pdf) = self.coat(wo, wi);
            value += coat_value;
            pdf += coat * coat_pdf;
        }
        // Diffuse lobe and sheen
        let matte = self.matte();
        if matte > 0.0 {
            let light = p.diffuse(wo, wi, self.tint);
            value += p.base_color * (matte * light.diffuse) + light.sheen * (1.0 - p.metallic);
        }
        (value.max(Spectrum::ZERO), pdf + (1.0 - main - coat).max(0.0) * warp::cosine_hemisphere_pdf(wi.z))
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2], mode: TransportMode) -> Option<BsdfSample> {
        let [main, coat] = self.chances(wo);
        let (is_main, u_rest) = split(u_lobe, main);
        // Sample a facet, then reflection or transmission
        if is_main {
            let h = self.facets.sample_visible_normal(wo, u);
            if u_rest < self.reflection(wo.dot(h)) {
                let wi = fresnel::reflect(wo, h);
                let lobe = LobeFlags::REFLECTION.union(LobeFlags::GLOSSY);
                return if wi.z > 0.0 { self.spread(wo, wi, mode, lobe, 1.0) } else { None };
            }
            let eta = self.eta();
            let wi = fresnel::refract(wo, h, eta).filter(|wi| wi.z < 0.0)?;
            return self.spread(wo, wi, mode, LobeFlags::TRANSMISSION.union(LobeFlags::GLOSSY), eta);
        }
        // Sample the clear coat or the diffuse lobe
        let is_coat = u_lobe < main + coat;
        let wi = if is_coat { self.sample_coat(wo, u) } else { warp::cosine_hemisphere(u) };
        let kind = if is_coat { LobeFlags::GLOSSY } else { LobeFlags::DIFFUSE };
        if wi.z > 0.0 { self.spread(wo, wi, mode, LobeFlags::REFLECTION.union(kind), 1.0) } else { None }
    }

    fn diffuse_pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let [main, coat] = self.chances(wo);
        (1.0 - main - coat).max(0.0) * warp::cosine_hemisphere_pdf(wi.z)
    }

    fn albedo(&self, wo: Vec3) -> Spectrum {
        let (reflected, through) = self.split(wo.z);
        let matte = if self.inside { 0.0 } else { self.matte() };
        (reflected + self.p.base_color * (through + matte)).min(Spectrum::ONE)
    }

    fn lobes(&self) -> Lobes {
        let coat = if self.p.clearcoat > 0.0 && !self.inside { self.coat_alpha.sqrt() } else { 1.0 };
        Lobes { has_non_delta: true, is_transmissive: self.clear() > 0.0, roughness: self.facets.roughness().min(coat) }
    }
}

impl PrincipledSheet {
    /// Creates the BSDF; `p`: clamped parameters.
    pub(super) fn new(p: PrincipledParams) -> Self {
        let scaled = ((0.65 * p.eta - 0.35) * p.roughness).max(0.0);
        Self {
            reflecting: facets(p.roughness, p.anisotropic),
            transmitting: facets(scaled, p.anisotropic),
            tint: tint_of(p.base_color),
            p,
        }
    }

    /// Returns the probabilities of sharp reflection, sharp transmission and diffuse reflection.
    fn chances(&self) -> [f32; 3] {
        let (sharp, diffuse) = (self.p.spec_trans, 1.0 - self.p.spec_trans);
        [0.5 * sharp, 0.5 * sharp, diffuse * (1.0 - self.p.diff_trans)]
    }
}

/// Returns true if `wi`, below the surface, is also below the facet that mirrors `wo` to the image of `wi` above.
fn is_beyond(wo: Vec3, wi: Vec3) -> bool {
    wi.dot(wo + Vec3::new(wi.x, wi.y, -wi.z)) < 0.0
}

impl Scatter for PrincipledSheet {
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, _mode: TransportMode) -> (Spectrum, f32) {
        let p = &self.p;
        let [reflection, transmission, diffuse] = self.chances();
        let above = Vec3::new(wi.x, wi.y, wi.z.abs());
        let (mut value, mut pdf) = (Spectrum::ZERO, 0.0);
        let facets = if wi.z > 0.0 { &self.reflecting } else { &self.transmitting };
        if p.spec_trans > 0.0
            && let Some(bounce) = facets.mirrored(wo, above)
            && (wi.z > 0.0 || is_beyond(wo, wi))
        {
            let exact = fresnel::dielectric(bounce.cos, p.eta);
            let (color, chance) = if wi.z > 0.0 {
                let f0 = self.tint * fresnel::at_normal_incidence(p.eta);
                (mix(Spectrum::splat(exact), schlick(f0, bounce.cos, p.eta), p.spec_tint), reflection)
            } else {
                (p.base_color * (1.0 - exact), transmission)
            };
            value += color * (p.spec_trans * bounce.value);
            pdf += chance * bounce.pdf;
        }
        let matte = 1.0 - p.spec_trans;
        let cosine = warp::cosine_hemisphere_pdf(above.z);
        if wi.z > 0.0 {
            let light = p.diffuse(wo, wi, self.tint);
            value += (p.base_color * light.diffuse + light.sheen) * (matte * (1.0 - p.diff_trans));
            pdf += diffuse * cosine;
        } else {
            value += p.base_color * (matte * p.diff_trans * FRAC_1_PI);
            pdf += matte * p.diff_trans * cosine;
        }
        (value.max(Spectrum::ZERO), pdf)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2], mode: TransportMode) -> Option<BsdfSample> {
        let [reflection, transmission, diffuse] = self.chances();
        let is_sharp = u_lobe < reflection + transmission;
        let reflects = u_lobe < reflection || (!is_sharp && u_lobe < reflection + transmission + diffuse);
        let above = match (is_sharp, reflects) {
            (true, true) => fresnel::reflect(wo, self.reflecting.sample_visible_normal(wo, u)),
            (true, false) => fresnel::reflect(wo, self.transmitting.sample_visible_normal(wo, u)),
            (false, _) => warp::cosine_hemisphere(u),
        };
        if above.z <= 0.0 {
            return None;
        }
        let (wi, side) = if reflects {
            (above, LobeFlags::REFLECTION)
        } else {
            (Vec3::new(above.x, above.y, -above.z), LobeFlags::TRANSMISSION)
        };
        // Reject sharp transmission on the wrong side of its facet: the pdf there covers the diffuse lobe only
        if is_sharp && !reflects && !is_beyond(wo, wi) {
            return None;
        }
        let kind = if is_sharp { LobeFlags::GLOSSY } else { LobeFlags::DIFFUSE };
        self.spread(wo, wi, mode, side.union(kind), 1.0)
    }

    fn diffuse_pdf(&self, _wo: Vec3, wi: Vec3) -> f32 {
        self.chances()[2] * warp::cosine_hemisphere_pdf(wi.z)
    }

    fn albedo(&self, wo: Vec3) -> Spectrum {
        let exact = fresnel::dielectric(wo.z, self.p.eta);
        let sharp = Spectrum::splat(exact) + self.p.base_color * (1.0 - exact);
        mix(self.p.base_color, sharp, self.p.spec_trans)
    }

    fn lobes(&self) -> Lobes {
        let p = &self.p;
        let is_transmissive = p.spec_trans > 0.0 || p.diff_trans > 0.0;
        let roughness =
            if p.spec_trans > 0.0 { self.reflecting.roughness().min(self.transmitting.roughness()) } else { 1.0 };
        Lobes { has_non_delta: true, is_transmissive, roughness }
    }
}
