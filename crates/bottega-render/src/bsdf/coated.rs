//! A base below a rough or smooth dielectric boundary and a layer that may scatter, with all interreflections.
//!
//! Parameters: index of refraction and facets of the boundary; thickness (in mean free paths), albedo and phase function
//! of the layer; a matte or metal base.
//!
//! A matte base below a layer that only absorbs has a closed form: the base scatters light uniformly, and each round trip
//! multiplies it by the same factor, which gives the series of [`Plastic`]. All other stacks are evaluated as in pbrt:
//! one random walk through the layers estimates f(wo, wi). Its random numbers are a hash of both directions, so the
//! estimate is a function of them and has the right mean. Random walks also sample directions; unlike pbrt, the
//! throughput of the walk is the sample's weight, without another evaluation of f. The returned pdf only approximates
//! that of the samples, which suffices for MIS. Dirac lobes are exact.
//!
//! Source: Guo, Hašan and Zhao 2018, Position-Free Monte Carlo Simulation for Arbitrary Layered BSDFs; Pharr, Jakob and
//! Humphreys 2023, Physically Based Rendering, section 14.3.

use std::f32::consts::{PI, TAU};

use bottega_kernels::{SplitMix64, math, mix64};
use bottega_scene::{Distribution, Shadowing, Spectrum};
use glam::Vec3;

use super::conductor::Conductor;
use super::cover::RoughCover;
use super::frame::Frame;
use super::fresnel::{self, mean};
use super::microfacet::Microfacets;
use super::plastic::{BaseTransmission, Plastic};
use super::scatter::{Lobes, Scatter, split};
use super::{BsdfSample, LobeFlags, TransportMode, warp};

/// The base below the layer.
#[derive(Clone, Copy, Debug)]
pub(super) enum StackBase {
    /// A Lambertian base of this albedo.
    Matte(Spectrum),
    /// A metal, with its index of refraction relative to the layer.
    Metal(Conductor),
}

/// The layer between boundary and base.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClearLayer {
    /// Thickness in mean free paths.
    pub(super) thickness: f32,
    /// Single-scattering albedo; black: the layer only absorbs.
    pub(super) albedo: Spectrum,
    /// Asymmetry of the Henyey-Greenstein phase function, in (−1, 1).
    pub(super) g: f32,
    /// Largest number of events within the layer: scatterings and reflections.
    pub(super) max_depth: u32,
}

/// Returns the BSDF of a matte base below a clear or absorbing layer, in closed form.
///
/// - `eta`: index of refraction of the layer over that of the outside.
/// - `cover`: transmission of the rough boundary, for the layer's thickness.
pub(super) fn matte_coated(
    eta: f32,
    color: Spectrum,
    facets: Microfacets,
    layer: &ClearLayer,
    cover: RoughCover,
) -> Plastic {
    // Every other event within the layer is at the base
    let bounces = layer.max_depth.div_ceil(2);
    let round = color * cover.back();
    let beyond = |x: f32| math::powf(x, bounces as f32);
    let rest = Spectrum::new(beyond(round.x), beyond(round.y), beyond(round.z));
    let series = color * (Spectrum::ONE - rest) / (Spectrum::ONE - round);
    let through =
        if facets.is_smooth() { BaseTransmission::Smooth(layer.thickness) } else { BaseTransmission::Rough(cover) };
    Plastic::from_series(eta, series / (eta * eta), facets, through)
}

/// A stack without a closed form, evaluated by random walks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stack {
    eta: f32,
    facets: Microfacets,
    layer: ClearLayer,
    base: StackBase,
    /// GGX facets whose reflection from outside approximates that of the base through the boundary.
    proxy: Microfacets,
}

/// Random numbers of a walk, derived from two directions.
struct WalkRandom(SplitMix64);

impl Stack {
    /// Creates a stack; `eta`: index of refraction of the layer over that of the outside; `facets`: of the boundary.
    pub(super) fn new(eta: f32, facets: Microfacets, layer: ClearLayer, base: StackBase) -> Self {
        let below = if let StackBase::Metal(metal) = &base { metal.alpha() } else { [1.0; 2] };
        let above = facets.alpha();
        // Refraction steepens slopes of the base by η, and each crossing of a rough boundary adds its own spread
        let seen = [0, 1].map(|i| {
            let (a, b) = (eta * below[i], (eta - 1.0) * above[i]);
            (a * a + b * b).sqrt().min(1.0)
        });
        let proxy = Microfacets::new(Distribution::Ggx, Shadowing::Correlated, seen);
        Self { eta, facets, layer, base, proxy }
    }

    /// Returns the share of the light that is mirrored without scattering if the boundary is smooth; includes the base if
    /// that is smooth, too.
    fn mirrored_unscattered(&self, cos: f32) -> Spectrum {
        let surface = fresnel::dielectric(cos, self.eta);
        let StackBase::Metal(metal) = self.base else { return Spectrum::splat(surface) };
        if !metal.is_smooth() {
            return Spectrum::splat(surface);
        }
        let cos_below = self.cos_below(cos);
        let passed = math::exp(-2.0 * self.layer.thickness / cos_below);
        let once = metal.reflectance(cos_below) * passed;
        let (mut sum, mut term) = (Spectrum::ZERO, once * ((1.0 - surface) * (1.0 - surface)));
        for _ in 0..self.layer.max_depth.div_ceil(2) {
            sum += term;
            term *= once * surface;
        }
        sum + surface
    }

    fn cos_below(&self, cos: f32) -> f32 {
        (1.0 - (1.0 - cos * cos).max(0.0) / (self.eta * self.eta)).max(1e-8).sqrt()
    }

    fn is_smooth(&self) -> bool {
        let base = match &self.base {
            StackBase::Matte(_) => false,
            StackBase::Metal(metal) => metal.is_smooth(),
        };
        base && self.facets.is_smooth() && self.layer.albedo == Spectrum::ZERO
    }

    /// Returns the probabilities of sampling the boundary's lobe and the proxy's; the remainder is the cosine lobe.
    fn chances(&self, cos: f32) -> [f32; 2] {
        if self.is_smooth() {
            return [1.0, 0.0];
        }
        let surface = if self.facets.is_smooth() {
            mean(self.mirrored_unscattered(cos))
        } else {
            fresnel::dielectric(cos, self.eta)
        };
        let passed = math::exp(-2.0 * self.layer.thickness / self.cos_below(cos)) * (1.0 - surface);
        let (sharp, even) = match &self.base {
            StackBase::Matte(color) => (0.0, mean(*color)),
            StackBase::Metal(metal) if metal.is_smooth() && self.facets.is_smooth() => (0.0, 0.05),
            StackBase::Metal(metal) => (mean(metal.reflectance(self.cos_below(cos))) * passed, 0.05),
        };
        let even = even + (1.0 - surface - passed).max(0.0) * mean(self.layer.albedo);
        let sum = surface + sharp + even;
        [surface / sum, sharp / sum]
    }

    /// Samples the refraction of `w`, above, into the layer: returns the direction and its weight.
    fn enter(&self, w: Vec3, u: [f32; 2]) -> Option<(Vec3, f32)> {
        let h = self.facets.sample_visible_normal(w, u);
        let below = fresnel::refract(w, h, self.eta).filter(|below| below.z < 0.0)?;
        let weight = self.facets.shadowing(w, below) / self.facets.masking(w);
        Some((below, weight * (1.0 - fresnel::dielectric(w.dot(h), self.eta))))
    }

    /// Returns f of the boundary from `below` to `above` in importance mode, and the density with which `enter` samples
    /// `below` from `above`. Both are 0 for a smooth boundary.
    fn crossing(&self, above: Vec3, below: Vec3) -> (f32, f32) {
        if self.facets.is_smooth() {
            return (0.0, 0.0);
        }
        self.facets
            .refracted(above, below, self.eta)
            .map_or((0.0, 0.0), |bounce| (bounce.value * (1.0 - fresnel::dielectric(bounce.cos, self.eta)), bounce.pdf))
    }

    fn passed(&self, depth: f32, w: Vec3) -> f32 {
        math::exp(-depth / w.z.abs().max(1e-6))
    }

    /// Returns f and pdf of the base for directions above it.
    fn base(&self, wo: Vec3, wi: Vec3) -> (Spectrum, f32) {
        match &self.base {
            StackBase::Matte(color) => (*color / PI, warp::cosine_hemisphere_pdf(wi.z)),
            StackBase::Metal(metal) => metal.eval_pdf(wo, wi, TransportMode::Importance),
        }
    }

    /// Samples a direction above the base: returns it with its weight and its pdf (`None` for a Dirac lobe).
    fn sample_base(&self, wo: Vec3, u: [f32; 2]) -> Option<(Vec3, Spectrum, Option<f32>)> {
        match &self.base {
            StackBase::Matte(color) => {
                let wi = warp::cosine_hemisphere(u);
                Some((wi, *color, Some(warp::cosine_hemisphere_pdf(wi.z))))
            }
            StackBase::Metal(metal) => {
                let sample = metal.sample(wo, 0.0, u, TransportMode::Importance)?;
                Some((sample.wi, sample.weight(), (!sample.is_delta()).then_some(sample.pdf)))
            }
        }
    }

    /// Estimates f of the light that entered the layer and left it, except for purely mirrored light.
    fn walk(&self, wo: Vec3, wi: Vec3) -> Spectrum {
        let ClearLayer { thickness, albedo, g, max_depth } = self.layer;
        let scatters = albedo != Spectrum::ZERO;
        let mut chances = WalkRandom::new(wo, wi);
        // Refract the view path into the layer
        let Some((mut w, entered)) = self.enter(wo, chances.pair()) else { return Spectrum::ZERO };
        // Refract the light path into the layer, for next-event estimation: `exit` points down, against the light
        let exit = self.enter(wi, chances.pair());
        let rough_top = !self.facets.is_smooth();
        let mut carried = Spectrum::splat(entered);
        let mut sum = Spectrum::ZERO;
        // Depth below the boundary, in mean free paths
        let mut depth = 0.0;
        for event in 0..max_depth {
            // Terminate with Russian roulette
            if event > 3 {
                let survival = carried.max_element().min(1.0);
                if survival < 0.25 {
                    if chances.next() >= survival {
                        break;
                    }
                    carried /= survival;
                }
            }
            if scatters {
                // Sample the distance to the next scattering event
                let step = -math::ln(1.0 - chances.next()) * w.z.abs();
                let next = if w.z < 0.0 { depth + step } else { depth - step };
                if next > 0.0 && next < thickness {
                    depth = next;
                    carried *= albedo;
                    // Connect to the light path
                    if let Some((exit, left)) = exit {
                        let phase = henyey_greenstein(g, w.dot(-exit));
                        let weight = if rough_top { balance(self.crossing(wi, exit).1, phase) } else { 1.0 };
                        let left = left / -exit.z;
                        sum += carried * (phase * weight * left * self.passed(depth, exit));
                        if let (false, StackBase::Metal(metal)) = (rough_top, &self.base)
                            && metal.is_smooth()
                        {
                            // Connect by way of the smooth base, which no other strategy finds
                            let down = Vec3::new(-exit.x, -exit.y, exit.z);
                            let phase = henyey_greenstein(g, w.dot(down));
                            let passed = self.passed(2.0 * thickness - depth, exit);
                            sum += carried * metal.reflectance(-exit.z) * (phase * left * passed);
                        }
                    }
                    // Sample the phase function; leave through a rough boundary with MIS
                    let next = sample_henyey_greenstein(g, w, chances.pair());
                    let density = henyey_greenstein(g, w.dot(next));
                    w = next;
                    if w.z > 0.0 {
                        sum += carried * self.left(w, wi, Some(density), depth);
                    }
                    continue;
                }
            } else {
                carried *= self.passed(thickness, w);
            }
            if w.z > 0.0 {
                // Reflect at the boundary from below
                depth = 0.0;
                let down = self.reflected_within(w, chances.pair());
                let Some((next, share)) = down else { break };
                carried *= share;
                w = next;
                continue;
            }
            depth = thickness;
            let up = -w;
            // At the base: connect to the light path
            if let Some((exit, left)) = exit {
                let (value, density) = self.base(up, -exit);
                let weight = if rough_top { balance(self.crossing(wi, exit).1, density) } else { 1.0 };
                sum += carried * value * (weight * left * self.passed(thickness, exit));
            }
            // Sample the base; leave through a rough boundary with MIS
            let Some((next, share, density)) = self.sample_base(up, chances.pair()) else { break };
            carried *= share;
            w = next;
            sum += carried * self.left(w, wi, density, thickness);
        }
        sum / (self.eta * self.eta)
    }

    /// Returns the share of the light going up along `w` from `depth` that a rough boundary refracts to `wi`, weighted by
    /// MIS against sampling the boundary. `density`: pdf of `w`; `None` for a Dirac lobe.
    fn left(&self, w: Vec3, wi: Vec3, density: Option<f32>, depth: f32) -> f32 {
        let (value, other) = self.crossing(wi, -w);
        if value == 0.0 {
            return 0.0;
        }
        value * density.map_or(1.0, |density| balance(density, other)) * self.passed(depth, w)
    }

    /// Samples the reflection of light going up along `w` at the boundary: returns the direction and its weight.
    fn reflected_within(&self, w: Vec3, u: [f32; 2]) -> Option<(Vec3, f32)> {
        let o = Vec3::new(-w.x, -w.y, w.z);
        let h = self.facets.sample_visible_normal(o, u);
        let i = fresnel::reflect(o, h);
        let weight = self.facets.shadowing(o, i) / self.facets.masking(o);
        (i.z > 0.0).then(|| (Vec3::new(i.x, i.y, -i.z), weight * fresnel::dielectric(o.dot(h), 1.0 / self.eta)))
    }
}

impl Stack {
    /// Approximates the density with which `sample` draws `wi`, in sr⁻¹. It is used only for MIS weights, which need not
    /// be exact.
    fn likeness(&self, wo: Vec3, wi: Vec3) -> f32 {
        let [surface, sharp] = self.chances(wo.z);
        let mut pdf = (1.0 - surface - sharp).max(0.0) * warp::cosine_hemisphere_pdf(wi.z);
        if !self.facets.is_smooth()
            && let Some(bounce) = self.facets.mirrored(wo, wi)
        {
            pdf += surface * bounce.pdf;
        }
        if sharp > 0.0
            && let Some(bounce) = self.proxy.mirrored(wo, wi)
        {
            pdf += sharp * bounce.pdf;
        }
        pdf
    }

    /// Follows light that enters the layer until it leaves; returns its direction and throughput. `None` if it is
    /// absorbed, or only mirrored by smooth surfaces, which is a separate Dirac lobe.
    ///
    /// - `u`: samples the first facet, or below a smooth boundary the first direction from the base.
    fn walk_out(&self, wo: Vec3, u: [f32; 2], mut chances: WalkRandom) -> Option<(Vec3, Spectrum)> {
        let ClearLayer { thickness, albedo, g, max_depth } = self.layer;
        let scatters = albedo != Spectrum::ZERO;
        let rough_top = !self.facets.is_smooth();
        let mut first = (!rough_top).then_some(u);
        let (mut w, entered) = self.enter(wo, if rough_top { u } else { chances.pair() })?;
        let mut carried = Spectrum::splat(entered);
        let mut is_spread = rough_top;
        let mut depth = 0.0;
        let mut events = 0;
        loop {
            // Terminate with Russian roulette
            if events > 3 {
                let survival = carried.max_element().min(1.0);
                if survival < 0.25 {
                    if chances.next() >= survival {
                        return None;
                    }
                    carried /= survival;
                }
            }
            if scatters {
                // Sample the distance to the next scattering event
                let step = -math::ln(1.0 - chances.next()) * w.z.abs();
                let next = if w.z < 0.0 { depth + step } else { depth - step };
                if next > 0.0 && next < thickness {
                    if events >= max_depth {
                        return None;
                    }
                    events += 1;
                    depth = next;
                    carried *= albedo;
                    w = sample_henyey_greenstein(g, w, chances.pair());
                    is_spread = true;
                    continue;
                }
            } else {
                carried *= self.passed(thickness, w);
            }
            if w.z > 0.0 {
                // At the boundary, whose normal points down seen from within: reflect or refract by Fresnel
                let o = Vec3::new(-w.x, -w.y, w.z);
                let h = self.facets.sample_visible_normal(o, chances.pair());
                let mirrors = chances.next() < fresnel::dielectric(o.dot(h), 1.0 / self.eta);
                let i = if mirrors { Some(fresnel::reflect(o, h)) } else { fresnel::refract(o, h, 1.0 / self.eta) };
                let i = i.filter(|i| (i.z > 0.0) == mirrors && i.z != 0.0)?;
                carried *= self.facets.shadowing(o, i) / self.facets.masking(o);
                w = Vec3::new(i.x, i.y, -i.z);
                if !mirrors {
                    return is_spread.then_some((w, carried));
                }
                depth = 0.0;
            } else {
                // Sample the base
                let (next, share, density) = self.sample_base(-w, first.take().unwrap_or_else(|| chances.pair()))?;
                is_spread |= density.is_some();
                carried *= share;
                w = next;
                depth = thickness;
            }
            if events >= max_depth {
                return None;
            }
            events += 1;
        }
    }
}

impl Scatter for Stack {
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, _mode: TransportMode) -> (Spectrum, f32) {
        if wi.z <= 0.0 || self.is_smooth() {
            return (Spectrum::ZERO, 0.0);
        }
        let mut value = self.walk(wo, wi);
        if !self.facets.is_smooth()
            && let Some(bounce) = self.facets.mirrored(wo, wi)
        {
            value += fresnel::dielectric(bounce.cos, self.eta) * bounce.value;
        }
        (value, self.likeness(wo, wi))
    }

    /// Samples a direction. The sample's weight is the throughput of the walk: it estimates f as `eval_pdf` does, with
    /// less noise.
    fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2], _mode: TransportMode) -> Option<BsdfSample> {
        let [surface, _] = self.chances(wo.z);
        let (is_surface, rest) = split(u_lobe, surface);
        let (wi, weight, kind) = if !is_surface {
            let (wi, carried) = self.walk_out(wo, u, WalkRandom::new(wo, Vec3::new(rest, u[0], u[1])))?;
            (wi, carried / (1.0 - surface), LobeFlags::DIFFUSE)
        } else if self.facets.is_smooth() {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            return BsdfSample::delta(wi, self.mirrored_unscattered(wo.z), surface, LobeFlags::REFLECTION, 1.0);
        } else {
            let h = self.facets.sample_visible_normal(wo, u);
            let wi = fresnel::reflect(wo, h);
            let share = fresnel::dielectric(wo.dot(h), self.eta) * self.facets.shadowing(wo, wi);
            (wi, Spectrum::splat(share / (self.facets.masking(wo) * surface)), LobeFlags::GLOSSY)
        };
        if wi.z <= 0.0 || weight.max_element() <= 0.0 {
            return None;
        }
        let pdf = self.likeness(wo, wi);
        let value = weight * (pdf / wi.z);
        let lobe = LobeFlags::REFLECTION.union(kind);
        (pdf > 0.0 && value.is_finite()).then_some(BsdfSample { wi, value, pdf, lobe, eta: 1.0 })
    }

    fn diffuse_pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        (1.0 - self.chances(wo.z)[0]) * warp::cosine_hemisphere_pdf(wi.z)
    }

    fn albedo(&self, wo: Vec3) -> Spectrum {
        let surface = fresnel::dielectric(wo.z, self.eta);
        let below = match &self.base {
            StackBase::Matte(color) => *color,
            StackBase::Metal(metal) => metal.reflectance(self.cos_below(wo.z)),
        };
        let passed = math::exp(-2.0 * self.layer.thickness / self.cos_below(wo.z));
        below * ((1.0 - surface) * passed) + surface + self.layer.albedo * ((1.0 - surface) * (1.0 - passed) * 0.5)
    }

    fn lobes(&self) -> Lobes {
        let roughness = self.facets.roughness().min(self.proxy.roughness());
        Lobes { has_non_delta: !self.is_smooth(), is_transmissive: false, roughness }
    }
}

/// Returns the MIS weight, by the balance heuristic, of the strategy with density `chosen` against `other` (Veach 1997,
/// eq. 9.8).
fn balance(chosen: f32, other: f32) -> f32 {
    if chosen > 0.0 { 1.0 / (1.0 + other / chosen) } else { 0.0 }
}

/// Returns the Henyey-Greenstein phase function in sr⁻¹; `cos`: cosine between the directions of travel before and after
/// scattering. Source: Henyey and Greenstein 1941, Diffuse Radiation in the Galaxy, eq. 2.
fn henyey_greenstein(g: f32, cos: f32) -> f32 {
    let t = (1.0 + g * g - 2.0 * g * cos).max(1e-6);
    (1.0 - g * g) / (2.0 * TAU * t * t.sqrt())
}

/// Samples the direction of travel after scattering of light that travelled along `w`.
fn sample_henyey_greenstein(g: f32, w: Vec3, u: [f32; 2]) -> Vec3 {
    let cos = if g.abs() < 1e-3 {
        1.0 - 2.0 * u[0]
    } else {
        let t = (1.0 - g * g) / (1.0 + g - 2.0 * g * u[0]);
        (1.0 + g * g - t * t) / (2.0 * g)
    };
    let cos = cos.clamp(-1.0, 1.0);
    let sin = (1.0 - cos * cos).sqrt();
    let (sin_phi, cos_phi) = math::sin_cos_of_turns(u[1]);
    Frame::from_normal(w).to_world(Vec3::new(sin * cos_phi, sin * sin_phi, cos)).normalize()
}

impl WalkRandom {
    fn new(wo: Vec3, wi: Vec3) -> Self {
        let bits = [wo.x, wo.y, wo.z, wi.x, wi.y, wi.z].map(f32::to_bits);
        Self(SplitMix64::new(
            bits.into_iter().fold(0x9e37_79b9_7f4a_7c15, |state, bits| mix64(state ^ u64::from(bits))),
        ))
    }

    fn next(&mut self) -> f32 {
        self.0.unit_f32()
    }

    fn pair(&mut self) -> [f32; 2] {
        [self.next(), self.next()]
    }
}
