//! Coats against light that is followed through them: an oracle of its own, in double precision, straight from the model
//! that pbrt documents (Pharr, Jakob and Humphreys 2023, *Physically Based Rendering*, sections 9.6, 9.7 and 14.3): facets
//! of Trowbridge and Reitz with correlated shadowing, Fresnel's equations, a slab that absorbs and scatters after Henyey
//! and Greenstein, and no more events within than `maxdepth`.

use std::f64::consts::TAU;

use bottega_render::bsdf::Bsdf;
use bottega_scene::{Coated, CoatedBase, Conductor, Diffuse, Distribution, Facets, Material, Spectrum, Surface};
use glam::{DVec2, DVec3, Vec3};

use crate::bsdf_laws::support::{Uniform, at, bsdf_of};

/// Even ranges of the cosine.
const BINS: usize = 6;
const COUNT: u32 = 60_000;
/// Facets of less than this α are too sharp for directions that know nothing of them.
const SHARP: f64 = 0.01;

/// A stack of layers, of one colour.
#[derive(Clone, Copy, Debug)]
struct Stack {
    eta: f64,
    alpha: f64,
    thickness: f64,
    albedo: f64,
    g: f64,
    max_depth: u32,
    base: Base,
}

#[derive(Clone, Copy, Debug)]
enum Base {
    Matte(f64),
    /// η, k, α.
    Metal(f64, f64, f64),
}

/// The throughput and the direction of a path, and whether all boundaries on its way were smooth or nearly so.
struct LeavingLight {
    weight: f64,
    direction: DVec3,
    is_mirrored: bool,
}

fn uniform_numbers(uniform: &mut Uniform) -> DVec2 {
    let [u, v] = uniform.pair();
    DVec2::new(f64::from(u), f64::from(v))
}

/// A visible normal of facets (Heitz 2018, *Sampling the GGX Distribution of Visible Normals*).
fn visible_normal(w: DVec3, alpha: f64, u: DVec2) -> DVec3 {
    if alpha == 0.0 {
        return DVec3::Z;
    }
    let stretched = DVec3::new(alpha * w.x, alpha * w.y, w.z).normalize();
    let side = DVec3::Z.cross(stretched).try_normalize().unwrap_or(DVec3::X);
    let up = stretched.cross(side);
    let (r, phi) = (u.x.sqrt(), TAU * u.y);
    let (x, y) = (r * phi.cos(), r * phi.sin());
    let s = 0.5 * (1.0 + stretched.z);
    let y = (1.0 - s) * (1.0 - x * x).max(0.0).sqrt() + s * y;
    let h = side * x + up * y + stretched * (1.0 - x * x - y * y).max(0.0).sqrt();
    DVec3::new(alpha * h.x, alpha * h.y, h.z.max(1e-12)).normalize()
}

/// Smith's Λ.
fn lambda(w: DVec3, alpha: f64) -> f64 {
    let tan2 = (1.0 - w.z * w.z).max(0.0) / (w.z * w.z);
    0.5 * ((1.0 + alpha * alpha * tan2).sqrt() - 1.0)
}

/// Weight of a direction drawn by a visible normal: G₂ / G₁.
fn facet_weight(o: DVec3, i: DVec3, alpha: f64) -> f64 {
    (1.0 + lambda(o, alpha)) / (1.0 + lambda(o, alpha) + lambda(i, alpha))
}

/// Fresnel's reflectance; `eta`: far side over near side.
fn dielectric(cos: f64, eta: f64) -> f64 {
    let sin2 = (1.0 - cos * cos) / (eta * eta);
    if sin2 >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin2).sqrt();
    let parallel = (eta * cos - cos_t) / (eta * cos + cos_t);
    let across = (cos - eta * cos_t) / (cos + eta * cos_t);
    0.5 * (parallel * parallel + across * across)
}

/// Fresnel's reflectance of a metal.
fn metal(cos: f64, eta: f64, k: f64) -> f64 {
    let sin2 = 1.0 - cos * cos;
    let a = eta * eta - k * k - sin2;
    let b = (a * a + 4.0 * eta * eta * k * k).sqrt();
    let c = (0.5 * (a + b)).max(0.0).sqrt();
    let across = (b + cos * cos - 2.0 * c * cos) / (b + cos * cos + 2.0 * c * cos);
    let d = b * cos * cos + sin2 * sin2;
    let parallel = across * (d - 2.0 * c * cos * sin2) / (d + 2.0 * c * cos * sin2);
    0.5 * (across + parallel)
}

impl Stack {
    /// Light that comes along `o` meets the boundary from the side of the index 1, with `eta` beyond: where it goes, its
    /// weight, and whether it went through. Both directions point away, the other side is below.
    fn boundary(&self, o: DVec3, eta: f64, uniform: &mut Uniform) -> Option<(DVec3, f64, bool)> {
        let h = visible_normal(o, self.alpha, uniform_numbers(uniform));
        let cos = o.dot(h);
        if f64::from(uniform.next()) < dielectric(cos, eta) {
            let i = 2.0 * cos * h - o;
            return (i.z > 0.0).then(|| (i, facet_weight(o, i, self.alpha), false));
        }
        let cos_t = (1.0 - (1.0 - cos * cos) / (eta * eta)).max(0.0).sqrt();
        let i = (cos / eta - cos_t) * h - o / eta;
        (i.z < 0.0).then(|| (i, facet_weight(o, i, self.alpha), true))
    }

    /// Follows light through the stack; `None`: nothing comes out.
    fn follow(&self, o: DVec3, uniform: &mut Uniform) -> Option<LeavingLight> {
        let (mut w, mut weight, entered) = self.boundary(o, self.eta, uniform)?;
        let mut is_mirrored = self.alpha < SHARP;
        if !entered {
            return Some(LeavingLight { weight, direction: w, is_mirrored });
        }
        // Depth below the boundary; w points along the light's way.
        let mut depth = 0.0;
        let mut events = 0;
        loop {
            let step = -(1.0 - f64::from(uniform.next())).ln() * w.z.abs();
            let next = if w.z < 0.0 { depth + step } else { depth - step };
            let is_within = next > 0.0 && next < self.thickness;
            if is_within && self.albedo == 0.0 {
                return None;
            }
            if !is_within && w.z > 0.0 {
                depth = 0.0;
                // Seen from within: the normal points down.
                let o = DVec3::new(-w.x, -w.y, w.z);
                let (i, share, left) = self.boundary(o, 1.0 / self.eta, uniform)?;
                weight *= share;
                w = DVec3::new(i.x, i.y, -i.z);
                if left {
                    return Some(LeavingLight { weight, direction: w, is_mirrored });
                }
                if events >= self.max_depth {
                    return None;
                }
                events += 1;
                continue;
            }
            if events >= self.max_depth {
                return None;
            }
            events += 1;
            if is_within {
                depth = next;
                weight *= self.albedo;
                w = henyey_greenstein(w, self.g, uniform_numbers(uniform));
                is_mirrored = false;
                continue;
            }
            depth = self.thickness;
            let o = -w;
            (w, weight) = match self.base {
                Base::Matte(reflectance) => {
                    is_mirrored = false;
                    let u = uniform_numbers(uniform);
                    let (r, phi) = (u.x.sqrt(), TAU * u.y);
                    (DVec3::new(r * phi.cos(), r * phi.sin(), (1.0 - u.x).sqrt()), weight * reflectance)
                }
                Base::Metal(eta, k, alpha) => {
                    is_mirrored &= alpha < SHARP;
                    let h = visible_normal(o, alpha, uniform_numbers(uniform));
                    let i = 2.0 * o.dot(h) * h - o;
                    if i.z <= 0.0 {
                        return None;
                    }
                    (i, weight * metal(o.dot(h), eta / self.eta, k / self.eta) * facet_weight(o, i, alpha))
                }
            };
        }
    }

    /// Energy that leaves by cosine: of what was mirrored alone, and of all else.
    fn expected(&self, o: Vec3) -> [[f64; BINS]; 2] {
        let mut uniform = Uniform::new(99);
        let mut bins = [[0.0; BINS]; 2];
        for _ in 0..COUNT {
            let Some(left) = self.follow(o.as_dvec3(), &mut uniform) else { continue };
            bins[usize::from(!left.is_mirrored)][bin(left.direction.z)] += left.weight / f64::from(COUNT);
        }
        bins
    }

    /// The same for the renderer.
    fn bsdf(&self) -> Bsdf<'static> {
        let facets = |alpha: f64| Facets {
            distribution: Distribution::Ggx,
            roughness: [(alpha as f32).into(), (alpha as f32).into()],
            ..Facets::default()
        };
        let gray = |value: f64| Spectrum::splat(value as f32).into();
        let base = match self.base {
            Base::Matte(color) => CoatedBase::Diffuse(Diffuse { reflectance: gray(color), roughness: 0.0.into() }),
            Base::Metal(eta, k, alpha) => CoatedBase::Conductor(Conductor {
                eta: gray(eta),
                k: gray(k),
                reflectance: gray(1.0),
                facets: facets(alpha),
            }),
        };
        let surface = Surface::Coated(Box::new(Coated {
            eta: self.eta as f32,
            facets: facets(self.alpha),
            thickness: (self.thickness as f32).into(),
            albedo: gray(self.albedo),
            g: (self.g as f32).into(),
            max_depth: self.max_depth,
            base,
        }));
        bsdf_of(&Material::from(surface), true)
    }
}

fn henyey_greenstein(w: DVec3, g: f64, u: DVec2) -> DVec3 {
    let cos = if g.abs() < 1e-3 {
        1.0 - 2.0 * u.x
    } else {
        let t = (1.0 - g * g) / (1.0 - g + 2.0 * g * u.x);
        (1.0 + g * g - t * t) / (2.0 * g)
    };
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (x, y) = w.any_orthonormal_pair();
    let (s, c) = (TAU * u.y).sin_cos();
    (x * (sin * c) + y * (sin * s) + w * cos).normalize()
}

fn bin(cos: f64) -> usize {
    ((cos * BINS as f64) as usize).min(BINS - 1)
}

/// Sums of weights by cosine, and of their squares.
#[derive(Default)]
struct Sums {
    mean: [f64; BINS],
    square: [f64; BINS],
}

impl Sums {
    fn add(&mut self, cos: f32, weight: f64) {
        let weight = weight / f64::from(COUNT);
        self.mean[bin(f64::from(cos))] += weight;
        self.square[bin(f64::from(cos))] += weight * weight;
    }

    /// Four standard errors of 200 values, and 1 %: the tables.
    fn check(&self, expected: &[f64; BINS], what: &str) {
        for bin in 0..BINS {
            // Light that is followed has weights of at most 1: its variance is below its mean.
            let error = (self.square[bin] + expected[bin] / f64::from(COUNT)).sqrt();
            let off = (self.mean[bin] - expected[bin]).abs();
            let allowed = 4.0 * error + 0.01 * expected[bin] + 1e-5;
            assert!(off < allowed, "{what}, bin {bin}: {:?} instead of {expected:?}", self.mean);
        }
    }
}

fn check(stack: Stack) {
    let bsdf = stack.bsdf();
    for cos in [0.95, 0.55, 0.2] {
        let wo = at(cos, 0.5);
        let [mirrored, spread] = stack.expected(wo);
        let all: [f64; BINS] = std::array::from_fn(|bin| mirrored[bin] + spread[bin]);
        let mut uniform = Uniform::new(5);
        let (mut sampled, mut evaluated) = (Sums::default(), Sums::default());
        for _ in 0..COUNT {
            if let Some(sample) = bsdf.sample(wo, uniform.next(), uniform.pair()) {
                sampled.add(sample.wi.z, f64::from(sample.weight().x));
            }
            let [z, phi] = uniform.pair();
            let wi = at(z, std::f32::consts::TAU * phi);
            evaluated.add(z, f64::from(bsdf.eval(wo, wi).x * z * std::f32::consts::TAU));
        }
        sampled.check(&all, &format!("{stack:?} from {cos}, sampled"));
        evaluated.check(&spread, &format!("{stack:?} from {cos}, evaluated"));
    }
}

const GOLD: (f64, f64) = (0.375, 2.386);

fn clear(alpha: f64, thickness: f64, base: Base) -> Stack {
    Stack { eta: 1.5, alpha, thickness, albedo: 0.0, g: 0.0, max_depth: 10, base }
}

fn milky(alpha: f64, thickness: f64, g: f64, base: Base) -> Stack {
    Stack { albedo: 0.9, g, ..clear(alpha, thickness, base) }
}

fn gold(alpha: f64) -> Base {
    Base::Metal(GOLD.0, GOLD.1, alpha)
}

#[test]
fn coats_over_matte_bases_scatter_as_light_that_is_followed() {
    // pbrt's own defaults first; 0.001 is what converted scenes say for smooth.
    for (alpha, reflectance) in [(0.0, 0.8), (0.001, 0.95), (0.1, 0.8), (0.3, 0.4), (0.6, 0.8)] {
        check(clear(alpha, 0.01, Base::Matte(reflectance)));
    }
    check(clear(0.3, 0.5, Base::Matte(0.8)));
    check(Stack { eta: 1.33, max_depth: 3, ..clear(0.2, 0.0, Base::Matte(0.9)) });
}

#[test]
fn milky_coats_scatter_as_light_that_is_followed() {
    check(milky(0.0, 0.5, 0.4, Base::Matte(0.5)));
    check(milky(0.3, 0.5, -0.3, gold(0.2)));
    check(milky(0.0, 0.5, 0.0, gold(0.0)));
    check(milky(0.2, 1.0, 0.6, Base::Matte(0.5)));
}

#[test]
fn coats_over_metals_scatter_as_light_that_is_followed() {
    check(clear(0.0, 0.01, gold(0.3)));
    check(clear(0.2, 0.05, gold(0.1)));
    check(clear(0.3, 0.0, gold(0.0)));
    check(clear(0.0, 0.1, gold(0.0)));
    check(clear(0.1, 0.01, gold(0.4)));
}
