//! `sample` draws by `pdf`: Pearson's χ² test over bins of the whole sphere. One more bin takes the samples that scatter
//! nothing and those of Dirac lobes, and expects what the density leaves over from 1; so the rejected mass is tested too.

use std::f64::consts::{PI, TAU};

use bottega_render::bsdf::{Bsdf, SurfaceParams};
use bottega_scene::Spectrum;
use glam::Vec3;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::bsdf_laws::support::{Uniform, at};

/// Bins, even in the angle to the normal (an even count: the horizon is between two bins) and in the azimuth.
const POLAR: usize = 24;
const AZIMUTHS: usize = 32;
const SAMPLES: u32 = 40_000;
/// Cosines of wo, and roughness, of each kind of material. (At 0.2 the edge of what glass refracts lies a hair's breadth
/// beside the edge of a bin, where the quadrature does not see it.)
const ANGLES: [f32; 5] = [0.97, 0.75, 0.45, 0.23, 0.07];
const ROUGHNESS: [f32; 4] = [0.3, 0.5, 0.75, 1.0];
/// Of a whole test; Šidák's correction makes that of one case from it.
const SIGNIFICANCE: f64 = 0.01;

/// ∫ pdf sin θ dθ dφ over a rectangle, by Gauss's rule with 2 × 2 nodes, halved until that changes little.
struct Quadrature<'a> {
    bsdf: &'a Bsdf<'a>,
    wo: Vec3,
}

impl Quadrature<'_> {
    fn once(&self, corner: [f64; 2], size: [f64; 2]) -> f64 {
        const NODE: f64 = 0.211_324_865_405_187_1;
        let mut sum = 0.0;
        for (a, b) in [(NODE, NODE), (1.0 - NODE, NODE), (NODE, 1.0 - NODE), (1.0 - NODE, 1.0 - NODE)] {
            let (theta, phi) = (corner[0] + a * size[0], corner[1] + b * size[1]);
            let wi = Vec3::new((theta.sin() * phi.cos()) as f32, (theta.sin() * phi.sin()) as f32, theta.cos() as f32);
            sum += f64::from(self.bsdf.pdf(self.wo, wi)) * theta.sin();
        }
        sum * size[0] * size[1] / 4.0
    }

    fn refined(&self, corner: [f64; 2], size: [f64; 2], coarse: f64, depth: u32) -> f64 {
        let half = size.map(|side| side / 2.0);
        let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
            .map(|(i, j)| [corner[0] + i * half[0], corner[1] + j * half[1]]);
        let parts = corners.map(|corner| self.once(corner, half));
        let fine: f64 = parts.iter().sum();
        // Half a thousandth of what the test could notice.
        if depth == 0 || (fine - coarse).abs() * f64::from(SAMPLES) < 0.02 {
            return fine;
        }
        corners.iter().zip(parts).map(|(&corner, part)| self.refined(corner, half, part, depth - 1)).sum()
    }
}

fn expected(bsdf: &Bsdf<'_>, wo: Vec3) -> Vec<f64> {
    let quadrature = Quadrature { bsdf, wo };
    let size = [PI / POLAR as f64, TAU / AZIMUTHS as f64];
    let mut bins = Vec::with_capacity(POLAR * AZIMUTHS + 1);
    for i in 0..POLAR {
        for j in 0..AZIMUTHS {
            let corner = [i as f64 * size[0], j as f64 * size[1] - PI];
            let probability = quadrature.refined(corner, size, f64::INFINITY, 7);
            bins.push(probability * f64::from(SAMPLES));
        }
    }
    let rest = f64::from(SAMPLES) - bins.iter().sum::<f64>();
    assert!(rest > -2e-4 * f64::from(SAMPLES), "the density integrates to {}", 1.0 - rest / f64::from(SAMPLES));
    bins.push(rest.max(0.0));
    bins
}

fn observed(bsdf: &Bsdf<'_>, wo: Vec3, seed: u64) -> Vec<f64> {
    let mut bins = vec![0.0; POLAR * AZIMUTHS + 1];
    let mut uniform = Uniform::new(seed);
    for _ in 0..SAMPLES {
        let drawn = bsdf.sample(wo, uniform.next(), uniform.pair()).filter(|sample| !sample.is_delta());
        let bin = drawn.map_or(POLAR * AZIMUTHS, |sample| {
            let polar = f64::from(sample.wi.z).acos() / PI * POLAR as f64;
            let turns = f64::from(sample.wi.y).atan2(f64::from(sample.wi.x)) / TAU + 0.5;
            let index = |x: f64, count: usize| (x as usize).min(count - 1);
            index(polar, POLAR) * AZIMUTHS + index(turns * AZIMUTHS as f64, AZIMUTHS)
        });
        bins[bin] += 1.0;
    }
    bins
}

/// Probability of a χ² at least this large. Bins that expect fewer than 5 samples are pooled.
fn p_value(expected: &[f64], observed: &[f64]) -> f64 {
    let (mut statistic, mut bins) = (0.0, 0usize);
    let (mut pool_expected, mut pool_observed) = (0.0, 0.0);
    for (&e, &o) in expected.iter().zip(observed) {
        if e < 5.0 {
            pool_expected += e;
            pool_observed += o;
        } else {
            statistic += (o - e) * (o - e) / e;
            bins += 1;
        }
    }
    if pool_expected >= 5.0 {
        statistic += (pool_observed - pool_expected) * (pool_observed - pool_expected) / pool_expected;
        bins += 1;
    } else if pool_observed > 5.0 + 10.0 * pool_expected.max(1.0) {
        return 0.0;
    }
    // All light in one Dirac lobe leaves nothing to compare.
    if bins < 2 { 1.0 } else { ChiSquared::new((bins - 1) as f64).unwrap().sf(statistic) }
}

/// Tests a kind of material, made for each roughness, at all angles and roughnesses.
pub(crate) fn check(name: &str, bsdf: impl Fn(f32) -> Bsdf<'static>) {
    check_each(name, &ROUGHNESS, bsdf);
}

/// Tests a kind of material, made for each of some roughnesses, at all angles.
pub(crate) fn check_each(name: &str, roughnesses: &[f32], bsdf: impl Fn(f32) -> Bsdf<'static>) {
    let cases = ANGLES.len() * roughnesses.len();
    let threshold = 1.0 - (1.0 - SIGNIFICANCE).powf(1.0 / cases as f64);
    for (a, &cos) in ANGLES.iter().enumerate() {
        for (r, &roughness) in roughnesses.iter().enumerate() {
            let bsdf = bsdf(roughness);
            let wo = at(cos, 0.4);
            let p = p_value(&expected(&bsdf, wo), &observed(&bsdf, wo, (a * 100 + r) as u64));
            assert!(p > threshold, "{name}: cos {cos} roughness {roughness}: p = {p:e}");
        }
    }
}

fn check_params(params: &SurfaceParams) {
    check(&format!("{params:?}"), |roughness| Bsdf::new(&SurfaceParams { roughness, ..*params }));
}

const GRAY: SurfaceParams = SurfaceParams {
    base_color: Spectrum::splat(0.6),
    roughness: 0.0,
    specular: 1.0,
    specular_color: Spectrum::ONE,
    ior: 1.5,
    ..SurfaceParams::BLACK
};

#[test]
fn diffuse_is_drawn_by_its_density() {
    check_params(&SurfaceParams { specular: 0.0, ..GRAY });
}

#[test]
fn metal_is_drawn_by_its_density() {
    check_params(&SurfaceParams { metallic: 1.0, ..GRAY });
}

#[test]
fn plastic_is_drawn_by_its_density() {
    check_params(&GRAY);
}

#[test]
fn glass_from_outside_is_drawn_by_its_density() {
    check_params(&SurfaceParams { transmission: 1.0, ..GRAY });
}

#[test]
fn glass_without_gloss_is_drawn_by_its_density() {
    check_params(&SurfaceParams { transmission: 1.0, specular_color: Spectrum::ZERO, ..GRAY });
}

#[test]
fn glass_from_within_is_drawn_by_its_density() {
    check_params(&SurfaceParams { transmission: 1.0, front: false, ..GRAY });
}

#[test]
fn a_thin_sheet_is_drawn_by_its_density() {
    check_params(&SurfaceParams { transmission: 1.0, thin: true, ..GRAY });
}

#[test]
fn a_rough_coat_is_drawn_by_its_density() {
    check_params(&SurfaceParams { coat: 1.0, coat_roughness: 0.4, ..GRAY });
}

#[test]
fn a_tilted_coat_is_drawn_by_its_density() {
    let coat_normal = at(0.8, 2.0);
    check_params(&SurfaceParams { coat: 1.0, coat_roughness: 0.4, coat_normal, metallic: 1.0, ..GRAY });
}

#[test]
fn a_smooth_coat_is_drawn_by_its_density() {
    check_params(&SurfaceParams { coat: 0.8, coat_roughness: 0.0, metallic: 1.0, ..GRAY });
}

#[test]
fn sheen_is_drawn_by_its_density() {
    check_params(&SurfaceParams { sheen_color: Spectrum::splat(0.9), sheen_roughness: 0.4, ..GRAY });
}

#[test]
fn all_layers_together_are_drawn_by_their_density() {
    let all = SurfaceParams {
        metallic: 0.3,
        transmission: 0.5,
        coat: 0.7,
        coat_roughness: 0.5,
        sheen_color: Spectrum::new(0.2, 0.5, 0.1),
        sheen_roughness: 0.6,
        specular: 0.7,
        specular_color: Spectrum::new(1.0, 0.5, 0.2),
        ior: 1.7,
        ..GRAY
    };
    check_params(&all);
    check_params(&SurfaceParams { front: false, ..all });
    check_params(&SurfaceParams { thin: true, ..all });
}

#[test]
fn stretched_highlights_are_drawn_by_their_density() {
    check_params(&SurfaceParams { metallic: 1.0, anisotropy: 0.7, ..GRAY });
    check_params(&SurfaceParams { transmission: 1.0, anisotropy: 0.5, ..GRAY });
}

#[test]
fn dispersive_glass_is_drawn_by_its_density() {
    let glass = SurfaceParams { transmission: 1.0, dispersion: 3.0, ..GRAY };
    check_params(&glass);
    check_params(&SurfaceParams { front: false, ..glass });
}

#[test]
fn leaves_and_soap_are_drawn_by_their_density() {
    check_params(&SurfaceParams { diffuse_transmission: 0.4, iridescence: 0.8, ..GRAY });
}

#[test]
fn a_wrong_density_is_found_out() {
    let metal = SurfaceParams { metallic: 1.0, ..GRAY };
    let bsdf = Bsdf::new(&SurfaceParams { roughness: 0.5, ..metal });
    let other = Bsdf::new(&SurfaceParams { roughness: 0.52, ..metal });
    let wo = at(0.7, 0.4);
    assert!(p_value(&expected(&other, wo), &observed(&bsdf, wo, 1)) < 1e-6);
}
