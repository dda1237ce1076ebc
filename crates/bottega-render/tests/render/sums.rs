//! Sums of surfaces, and sheets that transmit coloured light without deflection.

use std::f32::consts::PI;

use bottega_render::{DirectLight, PathSettings};
use bottega_scene::{Conductor, Environment, Facets, Light, LightKind, Material, Surface};
use glam::Vec3;

use crate::render::{
    known_answers::{assert_near, floor, irradiance},
    scenes::{add_quad, camera, color, paint, prepare},
};

/// The radiance of a floor below a sky of radiance 1.
fn below_white_sky(surface: Surface) -> Vec3 {
    let mut scene = floor();
    scene.materials[0] = surface.into();
    scene.environment = Some(Environment::uniform(Vec3::ONE));
    color(&paint(&prepare(scene), (1, 1), 4096, PathSettings::default()), 0, 0)
}

fn mirror(reflectance: f32) -> Surface {
    let (black, facets) = (Vec3::ZERO, Facets::default());
    let reflectance = Vec3::splat(reflectance).into();
    Surface::Conductor(Conductor { eta: black.into(), k: black.into(), reflectance, facets })
}

#[test]
fn a_sum_reflects_as_both_surfaces_together() {
    let matte = |albedo: f32| Surface::matte(Vec3::new(albedo, 0.5 * albedo, 0.0));
    let sum = below_white_sky(Surface::sum([matte(0.3), matte(0.4)]));
    assert!((sum - Vec3::new(0.7, 0.35, 0.0)).abs().max_element() < 0.01, "{sum}");
    let sum = below_white_sky(Surface::sum([matte(0.3), mirror(0.5)]));
    assert!((sum - Vec3::new(0.8, 0.65, 0.5)).abs().max_element() < 0.02, "{sum}");
    // A sum in a blend, and one in a sum
    let nested = Surface::sum([matte(0.2), Surface::sum([matte(0.1), matte(0.4)])]);
    let sum = below_white_sky(Surface::blend(0.25.into(), [nested, matte(1.0)]));
    assert!((sum.x - (0.75 * 0.7 + 0.25)).abs() < 0.02, "{sum}");
}

/// A sheet that transmits a colour without deflection.
fn sheet(surface: Surface) -> Material {
    Material { see_through: true, ..surface.into() }
}

#[test]
fn the_shadow_of_a_coloured_sheet_has_its_colour() {
    let tint = Vec3::new(0.25, 0.5, 1.0);
    let clear = Surface::clear_sheet(tint.into());
    let half_opaque = Surface::blend(0.5.into(), [clear.clone(), Surface::matte(Vec3::ZERO)]);
    // The sum of two transmitting sheets transmits twice as much
    let twice = Surface::sum([clear.clone(), clear.clone()]);
    for (surface, factor, tolerance) in [(clear, 1.0, 1e-3), (half_opaque, 0.5, 0.07), (twice, 2.0, 0.01)] {
        let mut scene = floor();
        scene.cameras[0] = camera(Vec3::new(-3.0, 0.5, 0.0), Vec3::ZERO, 0.001);
        add_quad(&mut scene, Vec3::new(-2.0, 1.0, -2.0), Vec3::X * 4.0, Vec3::Z * 4.0, sheet(surface));
        let kind = LightKind::Point { position: Vec3::Y * 4.0, intensity: Vec3::splat(10.0) };
        scene.lights.push(Light::new("", kind));
        let settings = PathSettings { max_depth: 1, ..PathSettings::default() };
        let found = color(&paint(&prepare(scene), (1, 1), 4096, settings), 0, 0) * (PI / 0.5);
        for channel in 0..3 {
            assert_near(found[channel], factor * tint[channel] * 10.0 / 16.0, tolerance);
        }
    }
}

#[test]
fn a_lamp_behind_coloured_sheets_is_seen_in_their_product() {
    let mut scene = floor();
    scene.cameras[0] = camera(Vec3::new(0.0, 1.0, 5.0), Vec3::Y, 0.001);
    let tint = Vec3::new(0.5, 1.0, 0.25);
    for z in [1.0, 2.0, 3.0] {
        let material = sheet(Surface::clear_sheet(tint.into()));
        add_quad(&mut scene, Vec3::new(-2.0, -2.0, z), Vec3::X * 4.0, Vec3::Y * 4.0, material);
    }
    add_quad(&mut scene, Vec3::new(-2.0, -2.0, 0.0), Vec3::X * 4.0, Vec3::Y * 4.0, Material::emitter(Vec3::ONE));
    let settings = PathSettings { max_depth: 0, ..PathSettings::default() };
    let found = color(&paint(&prepare(scene), (1, 1), 16, settings), 0, 0);
    assert!((found - tint * tint * tint).abs().max_element() < 1e-4, "{found}");
}

#[test]
fn a_sum_of_nothing_is_a_clear_sheet() {
    let mut scene = floor();
    let surface = Surface::sum([Surface::Null, Surface::matte(Vec3::ZERO)]);
    scene.cameras[0] = camera(Vec3::new(-3.0, 0.5, 0.0), Vec3::ZERO, 0.001);
    add_quad(&mut scene, Vec3::new(-2.0, 1.0, -2.0), Vec3::X * 4.0, Vec3::Z * 4.0, sheet(surface));
    let kind = LightKind::Point { position: Vec3::Y * 4.0, intensity: Vec3::splat(10.0) };
    scene.lights.push(Light::new("", kind));
    assert_near(irradiance(scene, DirectLight::Combined), 10.0 / 16.0, 0.1);
}
