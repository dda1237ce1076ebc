//! Lights with an extent: suns with a disc, spots with a radius, panels with a spread.

use std::f32::consts::PI;

use bottega_render::DirectLight;
use bottega_scene::{EmissionProfile, Light, LightKind, Material, Scene, SpotFalloff};
use glam::Vec3;

use crate::render::{
    known_answers::{ALL, assert_near, floor, irradiance},
    scenes::{add_quad, add_sphere, camera, color, matte, paint, prepare},
};

/// Adds a sun whose light travels in `direction`; `angle`: its diameter in degrees.
fn add_sun(scene: &mut Scene, direction: Vec3, irradiance: f32, angle: f32) {
    let (irradiance, angle) = (Vec3::splat(irradiance), angle.to_radians());
    let kind = LightKind::Directional { direction: direction.normalize(), irradiance, angle };
    scene.lights.push(Light::new("", kind));
}

#[test]
fn the_irradiance_of_a_sun_does_not_depend_on_its_angle() {
    for (direction, angle) in
        [(Vec3::NEG_Y, 0.53), (Vec3::NEG_Y, 60.0), (Vec3::NEG_Y, 180.0), (Vec3::new(3.0, -4.0, 0.0), 40.0)]
    {
        let exact = 2.0 * -direction.normalize().y;
        for direct_light in ALL {
            if direct_light == DirectLight::BsdfSampling && angle < 30.0 {
                continue; // a needle in a haystack
            }
            let mut scene = floor();
            add_sun(&mut scene, direction, 2.0, angle);
            let tolerance = if direct_light == DirectLight::BsdfSampling { 0.06 } else { 0.01 };
            assert_near(irradiance(scene, direct_light), exact, tolerance);
        }
    }
}

#[test]
fn a_sun_half_below_the_horizon_shines_with_the_half_above() {
    // Quadrature over the disc
    let half = 20.0_f32.to_radians();
    let steps = 400;
    let mut exact = 0.0;
    for i in 0..steps * steps {
        let [x, y] = [i % steps, i / steps].map(|k| (k as f32 + 0.5) / steps as f32);
        let cos = 1.0 - x * (1.0 - half.cos());
        let up = (1.0 - cos * cos).sqrt() * (2.0 * PI * y).sin();
        exact += up.max(0.0) / (steps * steps) as f32;
    }
    let radiance = 2.0 / (PI * half.sin() * half.sin());
    exact *= radiance * 2.0 * PI * (1.0 - half.cos());
    for direct_light in [DirectLight::Combined, DirectLight::LightSampling] {
        let mut scene = floor();
        add_sun(&mut scene, Vec3::X, 2.0, 40.0);
        assert_near(irradiance(scene, direct_light), exact, 0.02);
    }
}

#[test]
fn the_penumbra_of_an_edge_is_a_segment_of_the_disc() {
    // A screen two units above the floor hides the disc beyond its edge: a segment of the disc
    let half = 2.5_f32;
    for share in [-1.3_f32, -0.6, 0.0, 0.5, 0.9] {
        let edge = 2.0 * (share * half.to_radians().sin());
        let mut scene = floor();
        scene.cameras[0] = camera(Vec3::new(-3.0, 1.0, 0.0), Vec3::ZERO, 0.001);
        add_quad(&mut scene, Vec3::new(edge, 2.0, -9.0), Vec3::X * 9.0, Vec3::Z * 18.0, matte(Vec3::ZERO));
        add_sun(&mut scene, Vec3::NEG_Y, 2.0, 2.0 * half);
        let c = share.clamp(-1.0, 1.0);
        let seen = 0.5 + (c.asin() + c * (1.0 - c * c).sqrt()) / PI;
        let found = irradiance(scene, DirectLight::Combined);
        assert!((found / 2.0 - seen).abs() < 0.01, "{share}: {found} {seen}");
    }
}

#[test]
fn the_camera_sees_the_disc_of_a_sun() {
    let mut scene = Scene { cameras: vec![camera(Vec3::ZERO, Vec3::Z, 0.2)], ..Scene::default() };
    add_sun(&mut scene, Vec3::NEG_Z, 2.0, 5.0);
    let tile = paint(&prepare(scene.clone()), (9, 9), 64, bottega_render::PathSettings::default());
    let radiance = 2.0 / (PI * 2.5_f32.to_radians().sin().powi(2));
    assert_near(color(&tile, 4, 4).x, radiance, 1e-3);
    assert_eq!(color(&tile, 0, 0), Vec3::ZERO);
    // The mean over the picture is the solid angle of the disc over that of the view
    let mean = (0..81).map(|i| color(&tile, i % 9, i / 9).x).sum::<f32>() / 81.0;
    let view = (2.0 * 0.1_f32.tan()).powi(2);
    assert_near(mean, radiance * PI * 2.5_f32.to_radians().tan().powi(2) / view, 0.03);
    scene.cameras[0].hides_emitters = true;
    assert_eq!(color(&paint(&prepare(scene), (1, 1), 16, bottega_render::PathSettings::default()), 0, 0), Vec3::ZERO);
}

/// The intensity of a spot light at the origin of the floor, 4 above it and 1 beside, that points straight down.
fn spot(radius: f32, cos_inner: f32, cos_outer: f32) -> f32 {
    let (position, axis, falloff) = (Vec3::new(1.0, 4.0, 0.0), Vec3::NEG_Y, SpotFalloff::SmoothCosine);
    let intensity = Vec3::splat(10.0);
    let mut scene = floor();
    scene.cameras[0] = camera(Vec3::new(-3.0, 0.5, 0.0), Vec3::ZERO, 0.001);
    if radius > 0.0 {
        let emission_profile = EmissionProfile::Spot { axis, cos_inner, cos_outer, falloff };
        let lamp = Material::emitter(intensity / (PI * radius * radius));
        add_sphere(&mut scene, position, radius, Material { emission_profile, ..lamp });
    } else {
        let kind = LightKind::Spot { position, direction: axis, intensity, cos_inner, cos_outer, falloff };
        scene.lights.push(Light::new("", kind));
    }
    irradiance(scene, DirectLight::Combined)
}

#[test]
fn a_spot_with_a_radius_is_one_without_from_afar() {
    // The origin is at cos θ = 4/√17 = 0.970 from the axis: within, in the middle of, and beyond the cone's edge
    for (cos_inner, cos_outer) in [(0.95, 0.9), (0.99, 0.95), (0.999, 0.98)] {
        let (sharp, small) = (spot(0.0, cos_inner, cos_outer), spot(0.02, cos_inner, cos_outer));
        assert!((sharp - small).abs() < 0.01 * (10.0 / 17.0), "{cos_inner}: {sharp} {small}");
    }
    // Every direction from the sphere is within the cone
    assert_near(spot(0.5, 0.9, 0.8), 10.0 * 4.0 / 17.0_f32.powf(1.5), 0.01);
}

/// A panel of 0.02 by 0.02 and radiance 3 above the floor at `x`, 2 high, with a spread of this half angle.
fn panel(x: f32, degrees: f32) -> Scene {
    let mut scene = floor();
    scene.cameras[0] = camera(Vec3::new(-3.0, 0.5, 0.0), Vec3::ZERO, 0.001);
    let emission_profile = EmissionProfile::Spread { half_angle: degrees.to_radians() };
    let lamp = Material { emission_profile, ..Material::emitter(Vec3::splat(3.0)) };
    add_quad(&mut scene, Vec3::new(x - 0.01, 2.0, -0.01), Vec3::X * 0.02, Vec3::Z * 0.02, lamp);
    scene
}

#[test]
fn a_panel_with_a_spread_shines_as_if_behind_slats() {
    for degrees in [20.0_f32, 45.0, 80.0] {
        let edge = degrees.to_radians();
        for tilt in [0.0_f32, 0.3, 0.6, 0.9] {
            // The origin is seen at a share of the spread's tangent
            let tangent = tilt * edge.tan();
            if tangent > 2.0 {
                continue;
            }
            let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
            let factor = (edge.tan() - tangent) / (edge.tan() - edge);
            let exact = 3.0 * factor * 4e-4 * cosine.powi(4) / 4.0;
            assert_near(irradiance(panel(2.0 * tangent, degrees), DirectLight::Combined), exact, 0.03);
        }
        assert_eq!(irradiance(panel(2.2 * edge.tan(), degrees), DirectLight::Combined), 0.0);
    }
}

#[test]
fn all_strategies_find_the_light_of_a_large_panel_with_a_spread() {
    let found = ALL.map(|direct_light| {
        let mut scene = floor();
        scene.cameras[0] = camera(Vec3::new(-3.0, 0.5, 0.0), Vec3::ZERO, 0.001);
        let emission_profile = EmissionProfile::Spread { half_angle: 0.8 };
        let lamp = Material { emission_profile, ..Material::emitter(Vec3::splat(3.0)) };
        add_quad(&mut scene, Vec3::new(-0.5, 1.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, lamp);
        irradiance(scene, direct_light)
    });
    assert!(found.iter().all(|it| (it / found[0] - 1.0).abs() < 0.03), "{found:?}");
}
