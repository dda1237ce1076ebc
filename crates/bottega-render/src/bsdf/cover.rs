//! Transmission and internal reflection of a rough dielectric boundary over a matte base, tabulated once per boundary of
//! a scene.

use std::collections::BTreeMap;
use std::sync::{OnceLock, PoisonError, RwLock};

use bottega_kernels::math;
use bottega_scene::{Distribution, Shadowing};
use glam::Vec3;

use super::fresnel;
use super::microfacet::Microfacets;

/// Number of nodes of a cover curve over the cosine, uniform from 0 to 1.
pub const COSINES: usize = 64;
/// Number of nodes over α, uniform in √α from 0 to 1.
pub(super) const ROUGHNESS: usize = 48;
/// Steps per unit at which indices of refraction are quantized.
const ETA_STEPS: f32 = 16384.0;
/// Steps per octave at which thicknesses are quantized.
const THICKNESS_STEPS: f32 = 64.0;

/// Curves of one boundary at one roughness, over a clear layer that may absorb.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoverCurve {
    /// Share of the light at each node's cosine that reaches the base.
    through: [f32; COSINES],
    /// Share of the light leaving the base uniformly that returns to it.
    back: f32,
}

/// The quadrature of the hemispherical mean of the returned light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Mean {
    /// An accurate integral.
    Exact,
    /// Mitsuba's: the plain mean over the nodes with full weight at both ends, 1 to 2 % lower.
    Nodes,
}

/// A boundary with a roughness between two nodes of the tables.
#[derive(Clone, Copy, Debug)]
pub(super) struct RoughCover {
    curves: [&'static CoverCurve; 2],
    fraction: f32,
}

/// The parameters of a boundary except for its roughness, quantized: a key of the cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Boundary {
    eta: u32,
    /// Quantized logarithm of the layer's thickness; `i32::MIN`: thickness 0.
    thickness: i32,
    is_beckmann: bool,
    is_separable: bool,
    mean: Mean,
}

impl RoughCover {
    /// Looks up the curves of a boundary; computes them at first use.
    ///
    /// - `eta`: index of refraction of the layer over that of the outside.
    /// - `alpha`: α of the boundary's facets.
    /// - `thickness`: thickness of the layer, in mean free paths.
    pub(super) fn new(
        distribution: Distribution,
        shadowing: Shadowing,
        eta: f32,
        alpha: f32,
        thickness: f32,
        mean: Mean,
    ) -> Self {
        let boundary = Boundary {
            eta: (eta * ETA_STEPS).round() as u32,
            thickness: if thickness > 1e-6 {
                (math::log2(thickness) * THICKNESS_STEPS).round() as i32
            } else {
                i32::MIN
            },
            is_beckmann: distribution == Distribution::Beckmann,
            is_separable: shadowing == Shadowing::Separable,
            mean,
        };
        let (index, fraction) = place(alpha);
        let family = family(boundary);
        let curve = |index: usize| -> &'static CoverCurve { family[index].get_or_init(|| boundary.curve(index)) };
        Self { curves: [curve(index), curve(index + 1)], fraction }
    }

    /// Returns both curves, each with the share that reaches the base by cosine, then the share that returns to it.
    pub(super) fn curves(&self) -> [[f32; COSINES + 1]; 2] {
        self.curves.map(|curve| std::array::from_fn(|i| if i < COSINES { curve.through[i] } else { curve.back }))
    }

    fn mix(&self, value: impl Fn(&CoverCurve) -> f32) -> f32 {
        let [a, b] = self.curves.map(value);
        a + (b - a) * self.fraction
    }

    /// Returns the share of the light at a cosine that reaches the base.
    pub(super) fn through(&self, cos: f32) -> f32 {
        let position = cos.clamp(0.0, 1.0) * (COSINES - 1) as f32;
        let index = (position as usize).min(COSINES - 2);
        let fraction = position - index as f32;
        self.mix(|curve| curve.through[index] + (curve.through[index + 1] - curve.through[index]) * fraction)
    }

    /// Returns the share of the light leaving the base uniformly that returns to it.
    pub(super) fn back(&self) -> f32 {
        self.mix(|curve| curve.back)
    }
}

/// Returns the node at or below a roughness α, and the fraction of the way to the next node.
pub(super) fn place(alpha: f32) -> (usize, f32) {
    let position = alpha.max(0.0).sqrt().min(1.0) * (ROUGHNESS - 1) as f32;
    let index = (position as usize).min(ROUGHNESS - 2);
    (index, position - index as f32)
}

/// Returns α of a node.
pub(super) fn alpha_of(index: usize) -> f32 {
    let root = index as f32 / (ROUGHNESS - 1) as f32;
    root * root
}

type CurvesByRoughness = [OnceLock<CoverCurve>; ROUGHNESS];

/// Returns the curves of a boundary, by roughness. They live as long as the process: about 13 kB per boundary.
fn family(boundary: Boundary) -> &'static CurvesByRoughness {
    static FAMILIES: RwLock<BTreeMap<Boundary, &'static CurvesByRoughness>> = RwLock::new(BTreeMap::new());
    if let Some(family) = FAMILIES.read().unwrap_or_else(PoisonError::into_inner).get(&boundary) {
        return family;
    }
    let mut families = FAMILIES.write().unwrap_or_else(PoisonError::into_inner);
    families.entry(boundary).or_insert_with(|| Box::leak(Box::new([const { OnceLock::new() }; ROUGHNESS])))
}

impl Boundary {
    fn curve(&self, index: usize) -> CoverCurve {
        let distribution = if self.is_beckmann { Distribution::Beckmann } else { Distribution::Ggx };
        let shadowing = if self.is_separable { Shadowing::Separable } else { Shadowing::Correlated };
        let facets = Microfacets::new(distribution, shadowing, [alpha_of(index); 2]);
        let eta = self.eta as f32 / ETA_STEPS;
        let depth = if self.thickness == i32::MIN { 0.0 } else { math::exp2(self.thickness as f32 / THICKNESS_STEPS) };
        let node = |j: usize| (j as f32 / (COSINES - 1) as f32).max(1e-6);
        let kept = |mu: f32| {
            let passed = math::exp(-depth / mu);
            passed
                * share(&facets, mu, 1.0 / eta, |wo, h| {
                    let wi = fresnel::reflect(wo, h);
                    let reflectance = fresnel::dielectric(wo.dot(h), 1.0 / eta);
                    (wi.z > 0.0).then(|| (wi, reflectance * math::exp(-depth / wi.z)))
                })
        };
        // ∫ 2 μ f dμ; finer below a smooth boundary, where total reflection has a sharp edge and evaluation is cheap
        let steps = if facets.is_smooth() { 16 * COSINES } else { COSINES };
        let back = match self.mean {
            Mean::Exact => {
                let middle = |j: usize| (j as f32 + 0.5) / steps as f32;
                (0..steps).map(|j| 2.0 * middle(j) * kept(middle(j))).sum::<f32>() / steps as f32
            }
            Mean::Nodes => (0..COSINES).map(|j| 2.0 * node(j) * kept(node(j))).sum::<f32>() / COSINES as f32,
        };
        CoverCurve {
            through: std::array::from_fn(|j| {
                share(&facets, node(j), eta, |wo, h| {
                    let wi = fresnel::refract(wo, h, eta).filter(|wi| wi.z < 0.0)?;
                    let transmittance = 1.0 - fresnel::dielectric(wo.dot(h), eta);
                    Some((wi, transmittance * math::exp(depth / wi.z)))
                })
            }),
            back,
        }
    }
}

impl Microfacets {
    /// Returns the transmission of a rough boundary of these facets to a base; see [`RoughCover::new`].
    pub(super) fn cover(&self, eta: f32, thickness: f32, mean: Mean) -> RoughCover {
        let [x, y] = self.alpha();
        RoughCover::new(self.distribution(), self.shadowing, eta, (x * y).sqrt(), thickness, mean)
    }
}

/// Averages `way` over the normals visible from a direction at cosine `mu`. `way` maps wo and a normal to a direction and
/// its weight.
fn share(facets: &Microfacets, mu: f32, eta: f32, way: impl Fn(Vec3, Vec3) -> Option<(Vec3, f32)>) -> f32 {
    let wo = Vec3::new((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
    if facets.is_smooth() {
        return way(wo, Vec3::Z).map_or(0.0, |(_, share)| share);
    }
    let masking = facets.masking(wo);
    let weighed = |u: [f32; 2]| {
        let h = facets.sample_visible_normal(wo, u);
        way(wo, h).map_or(0.0, |(wi, share)| share * facets.shadowing(wo, wi) / masking)
    };
    if eta < 1.0 {
        // Total reflection has an edge: use a lattice, shifted differently for each cosine, so that its errors at the
        // edge do not add up
        let shift = |scale: f32| (mu * scale).fract();
        let node = |i: u32| {
            let i = i as f32 + 0.5;
            [(i / LATTICE as f32 + shift(61.0)).fract(), (i * GOLDEN_RATIO + shift(83.0)).fract()]
        };
        return (0..LATTICE).map(|i| weighed(node(i))).sum::<f32>() / LATTICE as f32;
    }
    // One half of the normals mirrors the other, in the number that draws the side: integrate one half
    let across = usize::from(facets.distribution() == Distribution::Beckmann);
    let (whole, half) = nodes();
    let mut sum = 0.0;
    for &(side, side_weight) in half {
        for &(other, other_weight) in whole {
            let mut u = [other; 2];
            u[across] = 0.5 * side;
            sum += side_weight * other_weight * weighed(u);
        }
    }
    sum
}

/// Number of normals per direction within the layer.
const LATTICE: u32 = 600;
const GOLDEN_RATIO: f32 = 0.618_034;

/// Nodes in [0, 1] with their weights.
type Nodes<const N: usize> = [(f32, f32); N];

fn nodes() -> &'static (Nodes<16>, Nodes<8>) {
    static NODES: OnceLock<(Nodes<16>, Nodes<8>)> = OnceLock::new();
    NODES.get_or_init(|| (gauss(), gauss()))
}

/// Computes the nodes and weights of Gauss-Legendre quadrature: the roots of the N-th Legendre polynomial by Newton's
/// method.
fn gauss<const N: usize>() -> Nodes<N> {
    std::array::from_fn(|i| {
        let guess = math::cos(std::f32::consts::PI * (i as f32 + 0.75) / (N as f32 + 0.5));
        let mut x = f64::from(guess);
        let mut slope = 1.0;
        for _ in 0..8 {
            let (mut before, mut value) = (1.0, x);
            for k in 2..=N {
                let k = k as f64;
                (before, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k);
            }
            slope = N as f64 * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
        }
        ((0.5 + 0.5 * x) as f32, (1.0 / ((1.0 - x * x) * slope * slope)) as f32)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn smooth(eta: f32) -> RoughCover {
        RoughCover::new(Distribution::Ggx, Shadowing::Correlated, eta, 0.0, 0.0, Mean::Exact)
    }

    #[test]
    fn quadrature_is_exact_for_polynomials() {
        let sum = |power: i32| -> f64 {
            gauss::<8>().iter().map(|&(x, weight)| f64::from(weight) * f64::from(x).powi(power)).sum()
        };
        for power in [0, 1, 2, 7, 15] {
            assert!((sum(power) * f64::from(power + 1) - 1.0).abs() < 1e-5, "{power}: {}", sum(power));
        }
    }

    #[test]
    fn a_rough_boundary_transmits_the_sum_over_all_slopes() {
        // Over slopes of either sign, in steps of 1/200 α, for Beckmann's facets with α = 0.1.
        let cover = RoughCover::new(Distribution::Beckmann, Shadowing::Separable, 1.49, 0.1, 0.0, Mean::Exact);
        for (node, expected) in [(48.0, 0.954_80), (32.0, 0.913_27), (16.0, 0.749_16), (8.0, 0.569_38)] {
            assert!((cover.through(node / 63.0) - expected).abs() < 5e-4, "{node}: {}", cover.through(node / 63.0));
        }
    }

    #[test]
    fn a_smooth_boundary_transmits_by_fresnel() {
        for eta in [1.3, 1.5, 2.4] {
            for cos in [1.0, 0.5, 0.25] {
                assert!((smooth(eta).through(cos) - (1.0 - fresnel::dielectric(cos, eta))).abs() < 3e-3);
            }
        }
    }

    #[test]
    fn transmission_outwards_follows_from_reciprocity() {
        // By reciprocity, η² (1 − back) is the mean of the transmission
        for alpha in [0.0, 0.1, 0.4] {
            for distribution in [Distribution::Ggx, Distribution::Beckmann] {
                let cover = RoughCover::new(distribution, Shadowing::Correlated, 1.5, alpha, 0.0, Mean::Exact);
                let steps = 1000;
                let cos = |i: i32| (f64::from(i) + 0.5) / f64::from(steps);
                let mean: f64 =
                    (0..steps).map(|i| 2.0 * cos(i) * f64::from(cover.through(cos(i) as f32)) / f64::from(steps)).sum();
                let out = 1.0 - f64::from(cover.back());
                // Energy lost between facets is lost on both sides
                assert!(mean / 2.25 <= out + 2e-3, "{alpha} {distribution:?}: {mean} {out}");
                assert!(alpha > 0.1 || mean / 2.25 > out - 0.05, "{alpha} {distribution:?}: {mean} {out}");
            }
        }
    }

    #[test]
    fn a_thick_layer_lets_less_through() {
        let cover =
            |thickness| RoughCover::new(Distribution::Ggx, Shadowing::Correlated, 1.5, 0.2, thickness, Mean::Exact);
        let (thin, thick) = (cover(0.0), cover(0.5));
        assert!((thick.through(1.0) / thin.through(1.0) - (-0.5f32).exp()).abs() < 0.01);
        assert!(thick.back() < 0.5 * thin.back());
    }
}
