//! How much of the light a rough layer sends on: the tables that keep the layers' books balanced.
//!
//! They are integrated once, when the first material is met, with fixed nodes in a fixed order, so that every run has
//! the same bits. All are functions of the cosine μ to the normal (nodes even in √μ, where they bend most) and of the
//! perceptual roughness; means over the cosine-weighted hemisphere are those of the *interpolated* tables, so that
//! lobes normalized with them balance exactly.

use std::sync::OnceLock;

use glam::Vec3;

use super::fresnel;
use super::ggx::Ggx;
use super::sheen;

const MU: usize = 32;
const ROUGHNESS: usize = 16;
/// Nodes of the index of refraction, even in r = (n − 1) / (n + 1) from 0 to `R_MAX`.
const INDEX: usize = 12;
const R_MAX: f32 = (fresnel::IOR_MAX - 1.0) / (fresnel::IOR_MAX + 1.0);

/// Values by μ for one roughness (and index), and their mean 2 ∫ v μ dμ.
#[derive(Clone, Copy, Debug)]
struct Curve {
    at: [f32; MU],
    mean: f32,
}

/// Directional albedos by μ, roughness and index of refraction.
#[derive(Debug)]
pub(super) struct Tables {
    /// Reflection with F = 1, scattered once.
    single: Vec<Curve>,
    /// Reflection with F = Schlick's weight.
    schlick: Vec<Curve>,
    /// Reflection with F = s, the rise of the exact Fresnel term (see `DielectricFresnel`), from outside; by index.
    rise: Vec<Curve>,
    /// Reflection and transmission together through the boundary of a solid, scattered once: from outside and from
    /// within; by index.
    boundary: [Vec<Curve>; 2],
    /// Sheen of colour 1, in its own roughness.
    sheen: Vec<Curve>,
}

/// Two neighbouring nodes, and how near the second one is.
#[derive(Clone, Copy, Debug)]
struct Place {
    index: u32,
    fraction: f32,
}

impl Place {
    fn new(position: f32, nodes: usize) -> Self {
        let position = position.clamp(0.0, (nodes - 1) as f32);
        let index = (position as u32).min(nodes as u32 - 2);
        Self { index, fraction: position - index as f32 }
    }

    fn mix(self, value: impl Fn(usize) -> f32) -> f32 {
        let (a, b) = (value(self.index as usize), value(self.index as usize + 1));
        a + (b - a) * self.fraction
    }
}

/// A place on the axis of cosines.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mu(Place);

impl Mu {
    pub(super) fn new(cos: f32) -> Self {
        Self(Place::new(cos.max(0.0).sqrt() * (MU - 1) as f32, MU))
    }
}

/// A place on the axis of roughness.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rough(Place);

impl Rough {
    pub(super) fn new(roughness: f32) -> Self {
        Self(Place::new(roughness * (ROUGHNESS - 1) as f32, ROUGHNESS))
    }
}

/// A place on the axis of indices of refraction (n ≥ 1).
#[derive(Clone, Copy, Debug)]
pub(super) struct Index(Place);

impl Index {
    pub(super) fn new(ior: f32) -> Self {
        Self(Place::new((ior - 1.0) / (ior + 1.0) / R_MAX * (INDEX - 1) as f32, INDEX))
    }
}

/// A value of a curve, or its mean.
fn pick(curve: &Curve, mu: Option<Mu>) -> f32 {
    mu.map_or(curve.mean, |mu| mu.0.mix(|i| curve.at[i]))
}

/// The lookups. `mu`: `None` asks for the mean over the cosine-weighted hemisphere.
impl Tables {
    /// The tables; computed by the first caller.
    pub(super) fn get() -> &'static Self {
        static TABLES: OnceLock<Tables> = OnceLock::new();
        TABLES.get_or_init(Self::compute)
    }

    pub(super) fn single(&self, mu: Option<Mu>, rough: Rough) -> f32 {
        rough.0.mix(|i| pick(&self.single[i], mu))
    }

    pub(super) fn schlick(&self, mu: Option<Mu>, rough: Rough) -> f32 {
        rough.0.mix(|i| pick(&self.schlick[i], mu))
    }

    pub(super) fn rise(&self, mu: Option<Mu>, rough: Rough, index: Index) -> f32 {
        index.0.mix(|k| rough.0.mix(|i| pick(&self.rise[k * ROUGHNESS + i], mu)))
    }

    /// `inside`: the direction is within the solid.
    pub(super) fn boundary(&self, mu: Option<Mu>, rough: Rough, index: Index, inside: bool) -> f32 {
        let curves = &self.boundary[usize::from(inside)];
        index.0.mix(|k| rough.0.mix(|i| pick(&curves[k * ROUGHNESS + i], mu)))
    }

    pub(super) fn sheen(&self, mu: Option<Mu>, rough: Rough) -> f32 {
        rough.0.mix(|i| pick(&self.sheen[i], mu))
    }

    fn compute() -> Self {
        let roughness = |i: usize| i as f32 / (ROUGHNESS - 1) as f32;
        let ior = |k: usize| {
            let r = R_MAX * k as f32 / (INDEX - 1) as f32;
            (1.0 + r) / (1.0 - r)
        };
        let by_roughness = |value: &dyn Fn(f32, f32) -> f32| -> Vec<Curve> {
            (0..ROUGHNESS).map(|i| Curve::new(|mu| value(mu, roughness(i)))).collect()
        };
        let by_index = |value: &dyn Fn(f32, f32, f32) -> f32| -> Vec<Curve> {
            (0..INDEX).flat_map(|k| by_roughness(&|mu, roughness| value(mu, roughness, ior(k)))).collect()
        };
        Self {
            single: by_roughness(&|mu, roughness| reflected(mu, roughness, |_| 1.0)),
            schlick: by_roughness(&|mu, roughness| reflected(mu, roughness, fresnel::schlick_weight)),
            rise: by_index(&|mu, roughness, ior| {
                let f0 = ((ior - 1.0) / (ior + 1.0)).powi(2);
                reflected(mu, roughness, |cos| (fresnel::dielectric(cos, ior) - f0) / (1.0 - f0))
            }),
            boundary: [
                by_index(&|mu, roughness, ior| reflected_and_transmitted(mu, roughness, ior)),
                by_index(&|mu, roughness, ior| reflected_and_transmitted(mu, roughness, 1.0 / ior)),
            ],
            sheen: by_roughness(&sheen::albedo_by_quadrature),
        }
    }
}

impl Curve {
    fn new(value: impl Fn(f32) -> f32) -> Self {
        let mut at = [0.0; MU];
        for (i, slot) in at.iter_mut().enumerate() {
            let root = i as f32 / (MU - 1) as f32;
            *slot = value((root * root).max(1e-4));
        }
        // Between two nodes the value is linear in t = √μ, and 2 μ dμ = 4 t³ dt: two-point Gauss is exact enough
        // for a quartic over 31 pieces.
        let mut mean = 0.0f64;
        for i in 0..MU - 1 {
            for node in [0.5 - 0.5 / 3f64.sqrt(), 0.5 + 0.5 / 3f64.sqrt()] {
                let t = (i as f64 + node) / (MU - 1) as f64;
                let value = f64::from(at[i]) * (1.0 - node) + f64::from(at[i + 1]) * node;
                mean += value * 4.0 * t * t * t * 0.5 / (MU - 1) as f64;
            }
        }
        Self { at, mean: mean as f32 }
    }
}

/// Nodes over the visible normals: even in the azimuth (half of it, by symmetry) and in the cap.
const AZIMUTHS: usize = 10;
const CAPS: usize = 16;

/// Mean of `value` over the microfacet normals that a direction at cosine `mu` sees.
fn mean_over_normals(mu: f32, roughness: f32, value: impl Fn(&Ggx, Vec3, Vec3) -> f32) -> f32 {
    let ggx = Ggx::from_roughness(roughness);
    let wo = Vec3::new((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
    let mut sum = 0.0;
    for cap in 0..CAPS {
        for azimuth in 0..AZIMUTHS {
            // Every ring of the cap starts a little further round, so that edges are not all met at once.
            let shift = 0.25 + 0.5 * (cap % 2) as f32;
            let u = [0.5 * (azimuth as f32 + shift) / AZIMUTHS as f32, (cap as f32 + 0.5) / CAPS as f32];
            sum += value(&ggx, wo, ggx.sample_visible_normal(wo, u));
        }
    }
    sum / (CAPS * AZIMUTHS) as f32
}

/// Share of the light at cosine `mu` that is reflected once, where a facet reflects `fresnel(wo · h)`.
fn reflected(mu: f32, roughness: f32, fresnel: impl Fn(f32) -> f32) -> f32 {
    if roughness == 0.0 {
        return fresnel(mu);
    }
    mean_over_normals(mu, roughness, |ggx, wo, h| {
        let wi = fresnel::reflect(wo, h);
        if wi.z > 0.0 { fresnel(wo.dot(h)) * ggx.shadowing(wo.z, wi.z) } else { 0.0 }
    })
}

/// Share of the light at cosine `mu` that a dielectric boundary reflects or transmits without a second bounce.
fn reflected_and_transmitted(mu: f32, roughness: f32, eta: f32) -> f32 {
    if roughness == 0.0 {
        return 1.0;
    }
    mean_over_normals(mu, roughness, |ggx, wo, h| {
        let reflectance = fresnel::dielectric(wo.dot(h), eta);
        let mirrored = fresnel::reflect(wo, h);
        let mut share = 0.0;
        if mirrored.z > 0.0 {
            share += reflectance * ggx.shadowing(wo.z, mirrored.z);
        }
        if let Some(refracted) = fresnel::refract(wo, h, eta).filter(|wi| wi.z < 0.0) {
            share += (1.0 - reflectance) * ggx.masking(-refracted.z);
        }
        share
    })
}
