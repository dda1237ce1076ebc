//! BSDFs at the ends of their ranges: mirrors, grazing angles, senseless numbers.

use bottega_render::bsdf::{Bsdf, LobeFlags, SurfaceParams, TransportMode, fresnel};
use bottega_scene::Spectrum;
use glam::Vec3;
use proptest::prelude::*;

use crate::bsdf_laws::support::{Uniform, at, materials};

const GLASS: SurfaceParams = SurfaceParams {
    base_color: Spectrum::ONE,
    transmission: 1.0,
    specular: 1.0,
    specular_color: Spectrum::ONE,
    ior: 1.5,
    roughness: 0.0,
    ..SurfaceParams::BLACK
};

/// Energy and mean direction of the samples on each side: reflected, transmitted.
fn sides(bsdf: &Bsdf<'_>, wo: Vec3) -> [(f32, Vec3); 2] {
    let mut uniform = Uniform::new(5);
    let mut sums = [(0.0, Vec3::ZERO); 2];
    const COUNT: u32 = 20_000;
    for i in 0..COUNT {
        if let Some(sample) = bsdf.sample(wo, (i as f32 + 0.5) / COUNT as f32, uniform.pair()) {
            let side = &mut sums[usize::from(sample.wi.z < 0.0)];
            side.0 += sample.weight().x / COUNT as f32;
            side.1 += sample.wi * sample.weight().x;
        }
    }
    sums.map(|(energy, direction)| (energy, direction.normalize_or_zero()))
}

#[test]
fn smooth_glass_reflects_by_fresnel_and_refracts_by_snell() {
    for (front, eta) in [(true, 1.5), (false, 1.0 / 1.5)] {
        let bsdf = Bsdf::new(&SurfaceParams { front, ..GLASS }).with_mode(TransportMode::Importance);
        assert!(bsdf.is_delta_only() && !bsdf.has_non_delta() && bsdf.is_transmissive());
        assert_eq!(bsdf.roughness(), 0.0);
        for cos in [0.95, 0.8, 0.3] {
            let wo = at(cos, 0.7);
            let [(reflected, mirror), (transmitted, refracted)] = sides(&bsdf, wo);
            let expected = fresnel::dielectric(cos, eta);
            assert!((reflected - expected).abs() < 1e-3 && (transmitted - (1.0 - expected)).abs() < 1e-3);
            if expected > 0.0 {
                assert!((mirror - Vec3::new(-wo.x, -wo.y, wo.z)).length() < 1e-4);
            }
            if let Some(wi) = fresnel::refract(wo, Vec3::Z, eta) {
                assert!((refracted - wi).length() < 1e-4, "{refracted} {wi}");
            }
        }
    }
}

#[test]
fn each_colour_of_dispersive_glass_goes_by_its_own_index() {
    // Half of the spread is (1.5 − 1) · 0.025 · 4.
    for (front, spread) in [(true, 0.05), (false, 0.05)] {
        let bsdf = Bsdf::new(&SurfaceParams { dispersion: 4.0, front, ..GLASS }).with_mode(TransportMode::Importance);
        let wo = at(0.85, 0.3);
        let mut uniform = Uniform::new(3);
        let mut energy = Spectrum::ZERO;
        const COUNT: u32 = 30_000;
        for i in 0..COUNT {
            let Some(sample) = bsdf.sample(wo, (i as f32 + 0.5) / COUNT as f32, uniform.pair()) else { continue };
            if sample.wi.z > 0.0 {
                continue;
            }
            let channel = sample.weight().max_position();
            assert!(sample.weight().element_sum() == sample.weight().max_element());
            let ior = 1.5 + (channel as f32 - 1.0) * spread;
            let eta = if front { ior } else { 1.0 / ior };
            let expected = fresnel::refract(wo, Vec3::Z, eta).unwrap();
            assert!((sample.wi - expected).length() < 1e-5 && (sample.eta - eta).abs() < 1e-6);
            energy += sample.weight() / COUNT as f32;
        }
        for channel in 0..3 {
            let ior = 1.5 + (channel as f32 - 1.0) * spread;
            let expected = 1.0 - fresnel::dielectric(wo.z, if front { ior } else { 1.0 / ior });
            assert!((energy[channel] - expected).abs() < 5e-3, "{energy} {channel} {expected}");
        }
    }
}

#[test]
fn a_stretched_highlight_is_wider_along_x() {
    let metal = SurfaceParams { transmission: 0.0, metallic: 1.0, roughness: 0.3, anisotropy: 0.6, ..GLASS };
    let bsdf = Bsdf::new(&metal);
    let back = |phi: f32| bsdf.eval(at(0.9, phi), at(0.9, phi));
    let (along, across) = (back(0.0), back(std::f32::consts::FRAC_PI_2));
    assert!(along.x > 2.0 * across.x, "{along} {across}");
}

#[test]
fn seen_from_within_a_coat_spreads_no_light() {
    let coated = SurfaceParams { coat: 1.0, coat_roughness: 0.5, ..GLASS };
    let (outside, within) = (Bsdf::new(&coated), Bsdf::new(&SurfaceParams { front: false, ..coated }));
    assert!(outside.has_non_delta() && within.is_delta_only());
    assert_eq!(within.eval(at(0.9, 0.0), at(0.8, 1.0)), Spectrum::ZERO);
    let sample = within.sample(at(0.9, 0.0), 0.9, [0.5; 2]).unwrap();
    assert!(sample.is_delta() && sample.wi.z < 0.0);
}

#[test]
fn nearly_smooth_surfaces_look_like_smooth_ones() {
    let kinds = [
        GLASS,
        SurfaceParams { front: false, ..GLASS },
        SurfaceParams { thin: true, ..GLASS },
        SurfaceParams { transmission: 0.0, metallic: 1.0, base_color: Spectrum::splat(0.7), ..GLASS },
        SurfaceParams { transmission: 0.0, base_color: Spectrum::ZERO, ..GLASS },
        SurfaceParams { transmission: 0.0, base_color: Spectrum::ZERO, coat: 1.0, ..GLASS },
    ];
    for params in kinds {
        for cos in [0.95, 0.8, 0.4] {
            let smooth = Bsdf::new(&params).with_mode(TransportMode::Importance);
            let rough = Bsdf::new(&params.at_least_as_rough_as(0.05)).with_mode(TransportMode::Importance);
            assert!(smooth.is_delta_only() && rough.has_non_delta());
            let (a, b) = (sides(&smooth, at(cos, 0.0)), sides(&rough, at(cos, 0.0)));
            for (a, b) in a.into_iter().zip(b) {
                assert!((a.0 - b.0).abs() < 0.01, "{cos} {a:?} {b:?} {params:?}");
                assert!(a.0 < 0.01 || (a.1 - b.1).length() < 0.01, "{cos} {a:?} {b:?} {params:?}");
            }
        }
    }
}

#[test]
fn a_sample_names_its_lobe() {
    let mut seen = LobeFlags::default();
    let params = SurfaceParams { transmission: 0.5, roughness: 0.5, coat: 1.0, ..GLASS };
    let bsdf = Bsdf::new(&params);
    let mut uniform = Uniform::new(1);
    for _ in 0..2000 {
        let Some(sample) = bsdf.sample(at(0.6, 0.0), uniform.next(), uniform.pair()) else { continue };
        assert_eq!(sample.lobe.contains(LobeFlags::REFLECTION), sample.wi.z > 0.0);
        assert_eq!(sample.lobe.contains(LobeFlags::TRANSMISSION), sample.wi.z < 0.0);
        assert_eq!(sample.eta, if sample.wi.z < 0.0 { 1.5 } else { 1.0 });
        seen = seen.union(sample.lobe);
    }
    for flag in [LobeFlags::DIFFUSE, LobeFlags::GLOSSY, LobeFlags::DELTA, LobeFlags::TRANSMISSION] {
        assert!(seen.contains(flag), "{flag:?} in {seen:?}");
    }
}

#[test]
fn black_scatters_nothing() {
    let bsdf = Bsdf::new(&SurfaceParams::BLACK);
    assert!(bsdf.is_black() && !bsdf.is_delta_only() && !bsdf.has_non_delta());
    assert_eq!(bsdf.sample(Vec3::Z, 0.5, [0.5; 2]), None);
    assert_eq!(bsdf.eval_pdf(Vec3::Z, at(0.5, 0.0)), (Spectrum::ZERO, 0.0));
}

#[test]
fn senseless_parameters_are_clamped() {
    let nan = f32::NAN;
    let bsdf = Bsdf::new(&SurfaceParams {
        base_color: Spectrum::splat(nan),
        metallic: -3.0,
        roughness: nan,
        ior: nan,
        specular: f32::INFINITY,
        specular_color: Spectrum::splat(f32::INFINITY),
        transmission: 7.0,
        coat: nan,
        coat_roughness: -1.0,
        sheen_color: Spectrum::splat(1e30),
        sheen_roughness: nan,
        ..SurfaceParams::default()
    });
    let (value, pdf) = bsdf.eval_pdf(at(0.5, 0.0), at(0.7, 1.0));
    assert!(value.is_finite() && pdf.is_finite());
    assert!(bsdf.albedo(Vec3::Z).is_finite());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_samples_weight_is_f_cos_over_pdf(
        params in materials(), exponent in 0.0f32..7.0, u_lobe in 0.0f32..1.0, u0 in 0.0f32..1.0, u1 in 0.0f32..1.0,
    ) {
        // From 1 down to grazing at 10⁻⁷.
        let wo = at(10f32.powf(-exponent), 2.0);
        let bsdf = Bsdf::new(&params);
        if let Some(sample) = bsdf.sample(wo, u_lobe, [u0, u1]) {
            prop_assert!((sample.wi.length() - 1.0).abs() < 1e-4, "{sample:?} {params:?}");
            prop_assert!(sample.pdf > 0.0 && sample.pdf.is_finite(), "{sample:?} {params:?}");
            prop_assert!(sample.weight().is_finite() && sample.value.min_element() >= 0.0, "{sample:?} {params:?}");
            if !sample.is_delta() {
                prop_assert_eq!(bsdf.eval_pdf(wo, sample.wi), (sample.value, sample.pdf));
            }
        }
    }

    #[test]
    fn grazing_directions_give_finite_values(params in materials(), a in 0.0f32..8.0, b in 0.0f32..8.0, phi in 0.0f32..6.3) {
        let bsdf = Bsdf::new(&params);
        let (wo, wi) = (at(10f32.powf(-a), 0.0), at(10f32.powf(-b), phi));
        for wi in [wi, -wi, Vec3::new(wi.x, wi.y, 0.0).normalize_or(Vec3::X), wo, -wo] {
            let (value, pdf) = bsdf.eval_pdf(wo, wi);
            prop_assert!(value.is_finite() && value.min_element() >= 0.0, "{wo} {wi} {value} {params:?}");
            prop_assert!(pdf.is_finite() && pdf >= 0.0, "{wo} {wi} {pdf} {params:?}");
        }
        prop_assert_eq!(bsdf.eval_pdf(-wo, wi), (Spectrum::ZERO, 0.0));
    }
}

#[test]
fn a_path_that_lost_all_colours_but_one_keeps_to_the_way_of_that_one() {
    for (roughness, front) in [(0.0, true), (0.0, false), (0.4, true), (0.4, false)] {
        let bsdf = Bsdf::new(&SurfaceParams { dispersion: 4.0, roughness, front, ..GLASS });
        let bsdf = bsdf.with_mode(TransportMode::Importance);
        let bsdf = bsdf.at_carrying(at(0.85, 0.3), Spectrum::new(0.0, 0.2, 0.0));
        let mut uniform = Uniform::new(4);
        let mut energy = 0.0;
        const COUNT: u32 = 30_000;
        for i in 0..COUNT {
            let Some(sample) = bsdf.sample((i as f32 + 0.5) / COUNT as f32, uniform.pair()) else { continue };
            assert!(sample.weight().y > 0.0, "{sample:?}");
            if !sample.is_delta() {
                assert_eq!(bsdf.eval_pdf(sample.wi), (sample.value, sample.pdf));
            }
            energy += sample.weight().y / COUNT as f32;
        }
        assert!((energy - 1.0).abs() < 0.02, "{roughness} {front}: {energy}");
    }
}
