//! Light finds its way back.

use bottega_render::bsdf::{Bsdf, SurfaceParams, TransportMode};
use bottega_scene::Spectrum;
use glam::Vec3;
use proptest::prelude::*;

use crate::bsdf_laws::support::{directions, materials, turned_over};

/// Seen from both ends, a half vector is not quite the same in single precision, and close to the critical angle
/// Fresnel's equations make much of that.
fn same(a: Spectrum, b: Spectrum) -> bool {
    (a - b).abs().max_element() <= 1e-2 * a.max(b).max_element() + 5e-4
}

fn flipped(w: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, -w.z)
}

fn broad(params: SurfaceParams) -> SurfaceParams {
    SurfaceParams { ior: params.ior.max(1.2), ..params }.at_least_as_rough_as(0.25)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn reflection_is_the_same_both_ways(params in materials(), wo in directions(0.02), wi in directions(0.02)) {
        let bsdf = Bsdf::new(&broad(params));
        let (there, back) = (bsdf.eval(wo, wi), bsdf.eval(wi, wo));
        prop_assert!(same(there, back), "{there} {back} {params:?}");
    }

    #[test]
    fn transmission_differs_by_the_square_of_the_index(
        params in materials(), wo in directions(0.05), above in directions(0.05),
    ) {
        let params = broad(SurfaceParams { transmission: params.transmission.max(0.2), ..params });
        let wi = flipped(above);
        let opposite = turned_over(&params);
        let eta2 = match (params.thin || params.metallic == 1.0, params.front) {
            (true, _) => 1.0,
            (false, true) => params.ior * params.ior,
            (false, false) => 1.0 / (params.ior * params.ior),
        };
        for (mode, scale) in [(TransportMode::Radiance, eta2), (TransportMode::Importance, 1.0 / eta2)] {
            let there = Bsdf::new(&params).with_mode(mode).eval(wo, wi) * scale;
            let back = Bsdf::new(&opposite).with_mode(mode).eval(flipped(wi), flipped(wo));
            prop_assert!(same(there, back), "{mode:?} {there} {back} {params:?}");
        }
    }

    #[test]
    fn the_two_modes_are_each_others_adjoint(params in materials(), wo in directions(0.05), above in directions(0.05)) {
        let params = broad(params);
        let opposite = turned_over(&params);
        let wi = flipped(above);
        let radiance = Bsdf::new(&params).eval(wo, wi);
        let importance = Bsdf::new(&opposite).with_mode(TransportMode::Importance).eval(flipped(wi), flipped(wo));
        prop_assert!(same(radiance, importance), "{radiance} {importance} {params:?}");
    }

    #[test]
    fn turning_the_surface_about_its_normal_changes_nothing(
        params in materials(), wo in directions(0.05), wi in directions(0.05), angle in 0.0f32..6.0,
    ) {
        let params = SurfaceParams { anisotropy: 0.0, ..broad(params) };
        let turn = glam::Quat::from_rotation_z(angle);
        let turned = SurfaceParams { coat_normal: turn * params.coat_normal, ..params };
        let (a, b) = (Bsdf::new(&params).eval_pdf(wo, wi), Bsdf::new(&turned).eval_pdf(turn * wo, turn * wi));
        prop_assert!(same(a.0, b.0) && (a.1 - b.1).abs() <= 2e-3 * a.1 + 1e-6, "{a:?} {b:?} {params:?}");
    }
}
