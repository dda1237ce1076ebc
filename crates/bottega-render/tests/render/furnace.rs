//! Furnace tests: under uniform white light, white surfaces look white.

use bottega_image::Tile;
use bottega_render::{DirectLight, PathSettings};
use bottega_scene::{Environment, Layered, Material, Scene};
use glam::Vec3;

use crate::render::scenes::{add_room, add_sphere, camera, color, glass, matte, mean_color, paint, prepare};

fn deep() -> PathSettings {
    PathSettings { max_depth: 200, ..PathSettings::default() }
}

fn assert_uniform(tile: &Tile, expected: Vec3, pixel_tolerance: f32, mean_tolerance: f32) {
    for (x, y) in tile.rect().pixels() {
        let found = color(tile, x, y);
        assert!((found - expected).abs().max_element() < pixel_tolerance, "pixel {x} {y}: {found}");
    }
    let mean = mean_color(tile);
    assert!((mean - expected).abs().max_element() < mean_tolerance, "mean {mean}");
}

fn shining(albedo: f32) -> Material {
    Material { emission: Vec3::splat(1.0 - albedo).into(), ..matte(Vec3::splat(albedo)) }
}

#[test]
fn inside_a_half_white_sphere_that_emits_a_half_radiance_is_one() {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.3, 0.2, 0.1), Vec3::X, 1.2)], ..Scene::default() };
    add_sphere(&mut scene, Vec3::ZERO, 1.0, shining(0.5));
    let scene = prepare(scene);
    for direct_light in [DirectLight::Combined, DirectLight::BsdfSampling, DirectLight::LightSampling] {
        let tile = paint(&scene, (8, 8), 256, PathSettings { direct_light, ..deep() });
        assert_uniform(&tile, Vec3::ONE, 0.15, 0.01);
    }
}

#[test]
fn inside_a_shining_room_radiance_is_one_in_every_corner() {
    for albedo in [0.2, 0.8] {
        let mut scene = Scene { cameras: vec![camera(Vec3::new(0.8, 0.5, 1.5), Vec3::ZERO, 1.6)], ..Scene::default() };
        add_room(&mut scene, Vec3::new(1.0, 0.7, 2.0), &shining(albedo));
        let scene = prepare(scene);
        let tile = paint(&scene, (12, 12), 256, deep());
        assert_uniform(&tile, Vec3::ONE, 0.4, 0.012);
    }
}

#[test]
fn a_white_matte_thing_vanishes_before_a_white_sky() {
    let mut scene = sky(Vec3::ONE);
    add_sphere(&mut scene, Vec3::ZERO, 1.0, matte(Vec3::ONE));
    let tile = paint(&prepare(scene), (8, 8), 64, deep());
    assert_uniform(&tile, Vec3::ONE, 0.15, 0.005);
}

#[test]
fn clear_glass_vanishes_before_a_white_sky() {
    let mut scene = sky(Vec3::ONE);
    add_sphere(&mut scene, Vec3::ZERO, 1.0, glass());
    let tile = paint(&prepare(scene), (8, 8), 256, deep());
    assert_uniform(&tile, Vec3::ONE, 0.1, 0.01);
}

#[test]
fn glass_that_parts_colours_vanishes_before_a_white_sky() {
    for dispersion in [1.0, 6.0] {
        let mut scene = sky(Vec3::ONE);
        let glass = Layered { dispersion, roughness: 0.0.into(), transmission: 1.0.into(), ..Layered::default() };
        add_sphere(&mut scene, Vec3::ZERO, 1.0, glass.into());
        let tile = paint(&prepare(scene), (8, 8), 1024, deep());
        assert_uniform(&tile, Vec3::ONE, 0.15, 0.01);
    }
}

#[test]
fn white_metal_and_white_plastic_neither_gain_nor_lose() {
    for (metallic, roughness) in [(1.0, 0.0), (1.0, 0.5), (0.0, 0.3)] {
        let mut scene = sky(Vec3::new(1.0, 0.5, 2.0));
        let white = Layered { metallic: metallic.into(), roughness: roughness.into(), ..Layered::default() }.into();
        add_sphere(&mut scene, Vec3::ZERO, 1.0, white);
        let mean = mean_color(&paint(&prepare(scene), (8, 8), 128, deep()));
        assert!((mean / Vec3::new(1.0, 0.5, 2.0) - 1.0).abs().max_element() < 0.02, "{metallic} {roughness}: {mean}");
    }
}

fn sky(radiance: Vec3) -> Scene {
    Scene {
        cameras: vec![camera(Vec3::new(0.0, 0.0, 2.2), Vec3::ZERO, 0.8)],
        environment: Some(Environment::uniform(radiance)),
        ..Scene::default()
    }
}

#[test]
fn over_many_bounces_nothing_is_gained_or_lost() {
    // Nine tenths of the light comes from the bounce before: an error of a bounce shows tenfold.
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.8, 0.5, 1.5), Vec3::ZERO, 1.6)], ..Scene::default() };
    add_room(&mut scene, Vec3::new(1.0, 0.7, 2.0), &shining(0.9));
    let scene = prepare(scene);
    let mean = |roulette_depth, direct_light| {
        let settings = PathSettings { roulette_depth, direct_light, ..deep() };
        mean_color(&paint(&scene, (12, 12), 64, settings)).x
    };
    // Every path carries the same radiance: there is no noise.
    assert!((mean(200, DirectLight::BsdfSampling) - 1.0).abs() < 1e-5);
    let cases =
        [(3, DirectLight::Combined, 0.02), (200, DirectLight::Combined, 3e-3), (200, DirectLight::LightSampling, 3e-3)];
    for (roulette_depth, direct_light, tolerance) in cases {
        let found = mean(roulette_depth, direct_light);
        assert!((found - 1.0).abs() < tolerance, "{roulette_depth} {direct_light:?}: {found}");
    }
}
