//! White in, white out, and never more. Measured in importance mode, where a transmission carries energy (radiance
//! also grows with the square of the index).

use std::f32::consts::TAU;

use bottega_render::bsdf::{Bsdf, SurfaceParams, TransportMode};
use bottega_scene::Spectrum;
use glam::Vec3;

use crate::bsdf_laws::support::{Uniform, at};

/// Mean weight of `count` samples, and its standard error, by channel.
pub(crate) fn measured_albedo(bsdf: &Bsdf<'_>, wo: Vec3, count: u32, seed: u64) -> (Spectrum, Spectrum) {
    let mut uniform = Uniform::new(seed);
    let (mut sum, mut squares) = (Spectrum::ZERO, Spectrum::ZERO);
    for i in 0..count {
        // Even steps through the lobes: only the directions are left to chance.
        let u_lobe = (i as f32 + 0.5) / count as f32;
        let weight = bsdf.sample(wo, u_lobe, uniform.pair()).map_or(Spectrum::ZERO, |sample| sample.weight());
        sum += weight;
        squares += weight * weight;
    }
    let mean = sum / count as f32;
    let variance = (squares / count as f32 - mean * mean).max(Spectrum::ZERO);
    (mean, Spectrum::new(variance.x.sqrt(), variance.y.sqrt(), variance.z.sqrt()) / (count as f32).sqrt())
}

fn bsdf_of(params: &SurfaceParams) -> Bsdf<'static> {
    Bsdf::new(params).with_mode(TransportMode::Importance)
}

const ANGLES: [f32; 6] = [1.0, 0.9, 0.6, 0.35, 0.15, 0.05];
const ROUGHNESS: [f32; 7] = [0.0, 0.1, 0.25, 0.4, 0.6, 0.8, 1.0];

/// The white furnace: albedo within `tolerance` of 1 at all angles and roughnesses; beyond it, three standard errors.
fn check_white(params: &SurfaceParams, tolerance: f32) {
    for roughness in ROUGHNESS {
        let bsdf = bsdf_of(&SurfaceParams { roughness, ..*params });
        for (seed, cos) in ANGLES.into_iter().enumerate() {
            let (mean, error) = measured_albedo(&bsdf, at(cos, 0.3), 10_000, seed as u64);
            let off = (mean - Spectrum::ONE).abs() - 3.0 * error;
            assert!(off.max_element() < tolerance, "roughness {roughness} cos {cos}: {mean} ± {error}; {params:?}");
        }
    }
}

const WHITE: SurfaceParams = SurfaceParams {
    base_color: Spectrum::ONE,
    specular: 1.0,
    specular_color: Spectrum::ONE,
    ior: 1.5,
    ..SurfaceParams::BLACK
};

#[test]
fn a_white_metal_reflects_everything() {
    check_white(&SurfaceParams { metallic: 1.0, ..WHITE }, 0.01);
}

#[test]
fn a_white_plastic_reflects_everything() {
    check_white(&WHITE, 0.01);
    check_white(&SurfaceParams { ior: 2.4, ..WHITE }, 0.01);
    check_white(&SurfaceParams { specular: 0.5, ..WHITE }, 0.01);
}

#[test]
fn total_reflection_reflects_everything() {
    check_white(&SurfaceParams { ior: 0.0, base_color: Spectrum::ZERO, ..WHITE }, 0.01);
}

#[test]
fn clear_glass_loses_nothing_on_either_side() {
    for ior in [1.1, 1.5, 2.4] {
        for front in [true, false] {
            check_white(&SurfaceParams { transmission: 1.0, ior, front, ..WHITE }, 0.015);
        }
    }
}

#[test]
fn a_clear_sheet_loses_nothing() {
    check_white(&SurfaceParams { transmission: 1.0, thin: true, ..WHITE }, 0.01);
}

#[test]
fn mixtures_of_white_materials_are_white() {
    check_white(&SurfaceParams { metallic: 0.4, transmission: 0.5, ..WHITE }, 0.01);
    check_white(&SurfaceParams { metallic: 0.4, transmission: 0.5, front: false, ..WHITE }, 0.01);
}

#[test]
fn a_coat_costs_a_white_base_no_more_than_a_few_percent() {
    for coat_roughness in [0.0, 0.3, 0.8] {
        check_white(&SurfaceParams { coat: 1.0, coat_roughness, ..WHITE }, 0.07);
        check_white(&SurfaceParams { coat: 1.0, coat_roughness, metallic: 1.0, ..WHITE }, 0.05);
    }
}

#[test]
fn a_white_leaf_loses_nothing() {
    check_white(&SurfaceParams { diffuse_transmission: 0.4, ..WHITE }, 0.01);
    check_white(&SurfaceParams { diffuse_transmission: 1.0, thin: true, ..WHITE }, 0.01);
}

#[test]
fn dispersion_costs_nothing() {
    for front in [true, false] {
        let glass = SurfaceParams { transmission: 1.0, dispersion: 2.0, front, ..WHITE };
        check_white(&glass, 0.02);
    }
}

#[test]
fn stretched_metal_returns_about_the_energy_it_loses() {
    // The tables hold for facets that are as rough along both axes.
    check_white(&SurfaceParams { metallic: 1.0, anisotropy: 0.4, ..WHITE }, 0.06);
}

#[test]
fn no_material_scatters_more_than_it_receives() {
    let mut uniform = Uniform::new(7);
    for case in 0..250 {
        let params = uniform.material();
        let bsdf = bsdf_of(&params);
        for cos in [0.98, 0.3 + 0.6 * uniform.next(), 0.02 + 0.2 * uniform.next()] {
            let (mean, error) = measured_albedo(&bsdf, at(cos, 1.0), 4000, case);
            // 250 · 3 · 3 values: four standard errors. 1.5 %: between the nodes of the tables.
            let excess = mean - Spectrum::ONE - 4.0 * error;
            assert!(excess.max_element() < 0.015, "cos {cos}: {mean} ± {error}; {params:?}");
        }
    }
}

#[test]
fn the_reported_albedo_is_the_measured_one() {
    let mut uniform = Uniform::new(11);
    for case in 0..120 {
        // A film reports only its mean.
        let params = SurfaceParams { transmission: 0.0, coat_normal: Vec3::Z, iridescence: 0.0, ..uniform.material() };
        let bsdf = bsdf_of(&params);
        let wo = at(0.25 + 0.7 * uniform.next(), 1.0);
        let (mean, error) = measured_albedo(&bsdf, wo, 4000, case);
        let (reported, slack) = (bsdf.albedo(wo), 4.0 * error);
        // Coat and sheen take a little more than they are said to from what is below them.
        let layered = params.coat > 0.0 || params.sheen_color != Spectrum::ZERO;
        let above = if layered { 0.2 } else { 0.02 };
        assert!((reported - mean - slack).max_element() < above, "{reported} reported, {mean} ± {error}; {params:?}");
        assert!((mean - reported - slack).max_element() < 0.02, "{reported} reported, {mean} ± {error}; {params:?}");
    }
}

#[test]
fn sampling_and_quadrature_of_eval_see_the_same_light() {
    const COSINES: u32 = 200;
    const AZIMUTHS: u32 = 128;
    let mut uniform = Uniform::new(3);
    for case in 0..12 {
        let params = uniform.material();
        let rough = |r: f32| r.max(0.5);
        let params = SurfaceParams {
            roughness: rough(params.roughness),
            coat_roughness: rough(params.coat_roughness),
            sheen_roughness: rough(params.sheen_roughness),
            ior: params.ior.max(1.5),
            ..params
        };
        let bsdf = bsdf_of(&params);
        let wo = at(0.2 + 0.75 * uniform.next(), 0.0);
        let mut sum = Spectrum::ZERO;
        for i in 0..2 * COSINES {
            for j in 0..AZIMUTHS {
                let z = (i as f32 + 0.5) / COSINES as f32 - 1.0;
                let wi = at(z, (j as f32 + 0.5) / AZIMUTHS as f32 * TAU);
                sum += bsdf.eval(wo, wi) * (z.abs() * TAU / (COSINES * AZIMUTHS) as f32);
            }
        }
        let (mean, error) = measured_albedo(&bsdf, wo, 40_000, case);
        assert!(((sum - mean).abs() - 4.0 * error).max_element() < 0.004, "{sum} {mean} ± {error}; {params:?}");
    }
}

#[test]
fn no_sample_weighs_much_more_than_its_fellows() {
    let mut uniform = Uniform::new(70);
    for _ in 0..1000 {
        let params = uniform.material();
        let bsdf = bsdf_of(&params);
        for cos in [0.9, 0.4, 0.1, 0.03] {
            for _ in 0..100 {
                let Some(sample) = bsdf.sample(at(cos, 0.0), uniform.next(), uniform.pair()) else { continue };
                // The heaviest are of narrow sheen near the horizon.
                assert!(sample.weight().max_element() < 40.0, "cos {cos}: {sample:?}; {params:?}");
            }
        }
    }
}
