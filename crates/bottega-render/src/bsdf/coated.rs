//! A base below a dielectric boundary and a layer that may scatter, with all reflections between them.
//!
//! A matte base below a layer that only absorbs has a closed form: light that the base scatters is spread evenly, and
//! each round trip multiplies it by the same number, so that the series is that of [`Plastic`]. All other stacks are
//! evaluated as pbrt does: f(wo, wi) is estimated by one random walk through the layers, its random numbers made from the
//! bits of both directions, so that the estimate is a function of them and has the right mean. Directions are drawn by
//! walks, too, and weigh what is left of the light; unlike there, f is not asked again. The density told is only about
//! that of the samples, which is enough to weigh ways to find light against each other. Dirac lobes are exact.
//!
//! Source: Guo, Hašan and Zhao 2018, Position-Free Monte Carlo Simulation for Arbitrary Layered BSDFs; Pharr, Jakob and
//! Humphreys 2023, Physically Based Rendering, section 14.3.

use std::f32::consts::{PI, TAU};

use bottega_kernels::{SplitMix64, math, mix64};
use bottega_scene::{Distribution, Shadowing, Spectrum};
use glam::Vec3;

use super::conductor::Conductor;
use super::cover::Cover;
use super::frame::Frame;
use super::fresnel::{self, mean};
use super::microfacet::Microfacets;
use super::plastic::{Plastic, Through};
use super::scatter::{Lobes, Scatter, split};
use super::{BsdfSample, LobeFlags, TransportMode, warp};

/// What lies below.
#[derive(Clone, Copy, Debug)]
pub(super) enum Base {
    /// Lambert's.
    Matte(Spectrum),
    /// Seen from within the layer.
    Metal(Conductor),
}

/// The layer between both.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClearLayer {
    /// In mean free paths.
    pub(super) thickness: f32,
    /// Single-scattering albedo; black: nothing scatters.
    pub(super) albedo: Spectrum,
    /// Henyey and Greenstein's.
    pub(super) g: f32,
    /// Greatest number of events within: scatterings and reflections.
    pub(super) max_depth: u32,
}

/// A matte base below a clear or absorbing layer.
///
/// - `eta`: index of refraction of the layer over that of the outside.
/// - `cover`: of rough facets, with the layer's thickness.
pub(super) fn matte_coated(
    eta: f32,
    color: Spectrum,
    facets: Microfacets,
    layer: &ClearLayer,
    cover: Cover,
) -> Plastic {
    // Of the events within, every other one is at the base.
    let bounces = layer.max_depth.div_ceil(2);
    let round = color * cover.back();
    let beyond = |x: f32| math::powf(x, bounces as f32);
    let rest = Spectrum::new(beyond(round.x), beyond(round.y), beyond(round.z));
    let series = color * (Spectrum::ONE - rest) / (Spectrum::ONE - round);
    let through = if facets.is_smooth() { Through::Smooth(layer.thickness) } else { Through::Rough(cover) };
    Plastic::from_series(eta, series / (eta * eta), facets, through)
}

/// All other stacks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stack {
    eta: f32,
    facets: Microfacets,
    layer: ClearLayer,
    base: Base,
    /// Facets on the outside whose reflections are about those of the base through the boundary.
    proxy: Microfacets,
}

/// A walk's random numbers: a function of two directions.
struct Chances(SplitMix64);

impl Stack {
    pub(super) fn new(eta: f32, facets: Microfacets, layer: ClearLayer, base: Base) -> Self {
        let below = if let Base::Metal(metal) = &base { metal.alpha() } else { [1.0; 2] };
        let above = facets.alpha();
        // Slopes below look η times as steep from outside, and each crossing of a rough boundary adds its own bend.
        let seen = [0, 1].map(|i| {
            let (a, b) = (eta * below[i], (eta - 1.0) * above[i]);
            (a * a + b * b).sqrt().min(1.0)
        });
        let proxy = Microfacets::new(Distribution::Ggx, Shadowing::Correlated, seen);
        Self { eta, facets, layer, base, proxy }
    }

    /// Share of the light that is mirrored without having been scattered, where boundary and base are smooth.
    fn mirrored_unscattered(&self, cos: f32) -> Spectrum {
        let surface = fresnel::dielectric(cos, self.eta);
        let Base::Metal(metal) = self.base else { return Spectrum::splat(surface) };
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
            Base::Matte(_) => false,
            Base::Metal(metal) => metal.is_smooth(),
        };
        base && self.facets.is_smooth() && self.layer.albedo == Spectrum::ZERO
    }

    /// Probabilities of the boundary's lobe and of the proxy's; the rest is evenly spread.
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
            Base::Matte(color) => (0.0, mean(*color)),
            Base::Metal(metal) if metal.is_smooth() && self.facets.is_smooth() => (0.0, 0.05),
            Base::Metal(metal) => (mean(metal.reflectance(self.cos_below(cos))) * passed, 0.05),
        };
        let even = even + (1.0 - surface - passed).max(0.0) * mean(self.layer.albedo);
        let sum = surface + sharp + even;
        [surface / sum, sharp / sum]
    }

    /// A direction within that is reached from `w` above, and its share of the light.
    fn enter(&self, w: Vec3, u: [f32; 2]) -> Option<(Vec3, f32)> {
        let h = self.facets.sample_visible_normal(w, u);
        let below = fresnel::refract(w, h, self.eta).filter(|below| below.z < 0.0)?;
        let weight = self.facets.shadowing(w, below) / self.facets.masking(w);
        Some((below, weight * (1.0 - fresnel::dielectric(w.dot(h), self.eta))))
    }

    /// f of the boundary from `below` to `above` in importance mode, and the density with which `enter` finds `below`
    /// from `above`. Nothing of a smooth one.
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

    /// f and density of the base for directions above it.
    fn base(&self, wo: Vec3, wi: Vec3) -> (Spectrum, f32) {
        match &self.base {
            Base::Matte(color) => (*color / PI, warp::cosine_hemisphere_pdf(wi.z)),
            Base::Metal(metal) => metal.eval_pdf(wo, wi, TransportMode::Importance),
        }
    }

    /// A direction above the base, its weight, and its density; `None` of the latter: the only one.
    fn sample_base(&self, wo: Vec3, u: [f32; 2]) -> Option<(Vec3, Spectrum, Option<f32>)> {
        match &self.base {
            Base::Matte(color) => {
                let wi = warp::cosine_hemisphere(u);
                Some((wi, *color, Some(warp::cosine_hemisphere_pdf(wi.z))))
            }
            Base::Metal(metal) => {
                let sample = metal.sample(wo, 0.0, u, TransportMode::Importance)?;
                Some((sample.wi, sample.weight(), (!sample.is_delta()).then_some(sample.pdf)))
            }
        }
    }

    /// An estimate of f of all light that entered the layer and left it, but for light that was mirrored alone.
    fn walk(&self, wo: Vec3, wi: Vec3) -> Spectrum {
        let ClearLayer { thickness, albedo, g, max_depth } = self.layer;
        let scatters = albedo != Spectrum::ZERO;
        let mut chances = Chances::new(wo, wi);
        let Some((mut w, entered)) = self.enter(wo, chances.pair()) else { return Spectrum::ZERO };
        // The light's way in, walked backwards: `exit` points down, the light comes from there up.
        let exit = self.enter(wi, chances.pair());
        let rough_top = !self.facets.is_smooth();
        let mut carried = Spectrum::splat(entered);
        let mut sum = Spectrum::ZERO;
        // Depth below the boundary.
        let mut depth = 0.0;
        for event in 0..max_depth {
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
                let step = -math::ln(1.0 - chances.next()) * w.z.abs();
                let next = if w.z < 0.0 { depth + step } else { depth - step };
                if next > 0.0 && next < thickness {
                    depth = next;
                    carried *= albedo;
                    if let Some((exit, left)) = exit {
                        let phase = henyey_greenstein(g, w.dot(-exit));
                        let weight = if rough_top { balance(self.crossing(wi, exit).1, phase) } else { 1.0 };
                        let left = left / -exit.z;
                        sum += carried * (phase * weight * left * self.passed(depth, exit));
                        if let (false, Base::Metal(metal)) = (rough_top, &self.base)
                            && metal.is_smooth()
                        {
                            // By way of the mirror below, which no other way finds.
                            let down = Vec3::new(-exit.x, -exit.y, exit.z);
                            let phase = henyey_greenstein(g, w.dot(down));
                            let passed = self.passed(2.0 * thickness - depth, exit);
                            sum += carried * metal.reflectance(-exit.z) * (phase * left * passed);
                        }
                    }
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
                // From below at the boundary: what is reflected goes on.
                depth = 0.0;
                let down = self.reflected_within(w, chances.pair());
                let Some((next, share)) = down else { break };
                carried *= share;
                w = next;
                continue;
            }
            depth = thickness;
            let up = -w;
            if let Some((exit, left)) = exit {
                let (value, density) = self.base(up, -exit);
                let weight = if rough_top { balance(self.crossing(wi, exit).1, density) } else { 1.0 };
                sum += carried * value * (weight * left * self.passed(thickness, exit));
            }
            let Some((next, share, density)) = self.sample_base(up, chances.pair()) else { break };
            carried *= share;
            w = next;
            sum += carried * self.left(w, wi, density, thickness);
        }
        sum / (self.eta * self.eta)
    }

    /// What of light going up along `w` from `depth`, drawn with `density` (`None`: the only way), a rough boundary sends
    /// to `wi`; weighted against light that was drawn from there.
    fn left(&self, w: Vec3, wi: Vec3, density: Option<f32>, depth: f32) -> f32 {
        let (value, other) = self.crossing(wi, -w);
        if value == 0.0 {
            return 0.0;
        }
        value * density.map_or(1.0, |density| balance(density, other)) * self.passed(depth, w)
    }

    /// Where light going up along `w` is mirrored to by the boundary, and its share.
    fn reflected_within(&self, w: Vec3, u: [f32; 2]) -> Option<(Vec3, f32)> {
        let o = Vec3::new(-w.x, -w.y, w.z);
        let h = self.facets.sample_visible_normal(o, u);
        let i = fresnel::reflect(o, h);
        let weight = self.facets.shadowing(o, i) / self.facets.masking(o);
        (i.z > 0.0).then(|| (Vec3::new(i.x, i.y, -i.z), weight * fresnel::dielectric(o.dot(h), 1.0 / self.eta)))
    }
}

impl Stack {
    /// About the density with which `sample` draws `wi`. It only weighs ways to find light against each other, for which
    /// it need not be exact.
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

    /// Follows light that enters the layer until it leaves, and returns where to, and what is left of it. Light that was
    /// mirrored by smooth things alone is a Dirac lobe of its own, and not found here.
    ///
    /// - `u`: decides on the first facet, or below a smooth boundary on the first direction from the base.
    fn walk_out(&self, wo: Vec3, u: [f32; 2], mut chances: Chances) -> Option<(Vec3, Spectrum)> {
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
                // Seen from within, the boundary's normal points down.
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

    /// The value of the sample is such that its weight is what is left of the light that was followed: it estimates f as
    /// `eval_pdf` does, with less noise.
    fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2], _mode: TransportMode) -> Option<BsdfSample> {
        let [surface, _] = self.chances(wo.z);
        let (is_surface, rest) = split(u_lobe, surface);
        let (wi, weight, kind) = if !is_surface {
            let (wi, carried) = self.walk_out(wo, u, Chances::new(wo, Vec3::new(rest, u[0], u[1])))?;
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

    fn albedo(&self, wo: Vec3) -> Spectrum {
        let surface = fresnel::dielectric(wo.z, self.eta);
        let below = match &self.base {
            Base::Matte(color) => *color,
            Base::Metal(metal) => metal.reflectance(self.cos_below(wo.z)),
        };
        let passed = math::exp(-2.0 * self.layer.thickness / self.cos_below(wo.z));
        below * ((1.0 - surface) * passed) + surface + self.layer.albedo * ((1.0 - surface) * (1.0 - passed) * 0.5)
    }

    fn lobes(&self) -> Lobes {
        let roughness = self.facets.roughness().min(self.proxy.roughness());
        Lobes { has_non_delta: !self.is_smooth(), is_transmissive: false, roughness }
    }
}

/// Weight of the strategy with density `chosen` against the one with density `other` (Veach 1997, eq. 9.8).
fn balance(chosen: f32, other: f32) -> f32 {
    if chosen > 0.0 { 1.0 / (1.0 + other / chosen) } else { 0.0 }
}

/// Density with which light goes on at an angle of cosine `cos` to where it went, in sr⁻¹. Source: Henyey and Greenstein
/// 1941, Diffuse Radiation in the Galaxy, eq. 2.
fn henyey_greenstein(g: f32, cos: f32) -> f32 {
    let t = (1.0 + g * g - 2.0 * g * cos).max(1e-6);
    (1.0 - g * g) / (2.0 * TAU * t * t.sqrt())
}

/// Where light goes on that went along `w`.
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

impl Chances {
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
