//! Light sampling, BSDF sampling and both combined have the same mean.

use std::sync::Arc;

use bottega_image::{Layout, Rect, Tile};
use bottega_render::{DirectLight, Filter, PathSettings, PreparedScene};
use bottega_scene::{Environment, Image, ImageId, Layered, Material, Portal, Scene};
use glam::{Mat3, Vec3};
use statrs::function::erf::erfc;

use crate::render::scenes::{Subject, add_quad, add_room, add_sphere, camera, cornell, lamp, matte, paint, prepare};

const SIDE: u32 = 24;
const SPP: u32 = 256;

/// Side of the blocks of pixels that are compared: large enough that their means are nearly normal.
const BLOCK: u32 = 4;

/// Mean luminance of a block of pixels and the variance of that mean.
pub(crate) fn moments(tile: &Tile, block: &Rect) -> (f64, f64) {
    let pixels = block.area() as f64;
    block.pixels().fold((0.0, 0.0), |(sum, variance_sum), (x, y)| {
        let sums = tile.pixel(x, y);
        let count = f64::from(sums[Layout::SAMPLE_COUNT]);
        let luminance = 0.2126 * f64::from(sums[0]) + 0.7152 * f64::from(sums[1]) + 0.0722 * f64::from(sums[2]);
        let mean = luminance / count;
        let variance = (f64::from(sums[Layout::LUMINANCE_SQUARED]) / count - mean * mean).max(0.0) / (count - 1.0);
        (sum + mean / pixels, variance_sum + variance / (pixels * pixels))
    })
}

/// Two-sided z-test on every block of pixels, corrected for their number (Šidák), and on the whole picture.
///
/// The variance estimate assumes independent samples; for stratified ones it is too large, which is on the safe side.
pub(crate) fn assert_same_mean(what: &str, a: &Tile, b: &Tile) {
    let blocks: Vec<Rect> = a.rect().blocks(BLOCK).chain([a.rect()]).collect();
    let significance = 1.0 - (1.0 - 0.001_f64).powf(1.0 / blocks.len() as f64);
    for block in blocks {
        let ((mean_a, variance_a), (mean_b, variance_b)) = (moments(a, &block), moments(b, &block));
        let z = (mean_a - mean_b) / (variance_a + variance_b).sqrt().max(1e-6);
        let chance = erfc(z.abs() / std::f64::consts::SQRT_2);
        assert!(chance > significance, "{what}: block {block}: {mean_a:.5} against {mean_b:.5}, z = {z:.1}");
    }
}

fn paint_by(scene: &Subject, direct_light: DirectLight, light_samples: u32, seed: u64) -> Tile {
    let settings =
        PathSettings { seed, max_depth: 4, light_samples, filter: Filter::PIXEL, direct_light, ..Default::default() };
    paint(scene, (SIDE, SIDE), SPP, settings)
}

pub(crate) fn assert_strategies_agree(what: &str, scene: Scene) {
    let scene = prepare(scene);
    let combined = paint_by(&scene, DirectLight::Combined, 1, 1);
    for (direct_light, light_samples) in
        [(DirectLight::LightSampling, 1), (DirectLight::BsdfSampling, 1), (DirectLight::Combined, 3)]
    {
        let other = paint_by(&scene, direct_light, light_samples, 2);
        assert_same_mean(&format!("{what}: {direct_light:?} × {light_samples}"), &other, &combined);
    }
}

#[test]
fn in_a_room_with_a_lamp_at_the_ceiling() {
    let mut scene = cornell();
    // Without the glass: light sampling cannot see through it.
    scene.spheres.pop();
    let corner = Vec3::new(-0.6, 0.7, -0.6);
    add_quad(&mut scene, corner, Vec3::X * 1.2, Vec3::Z * 1.2, Material::emitter(Vec3::ONE));
    assert_strategies_agree("cornell", scene);
}

#[test]
fn with_glossy_surfaces_near_spheres_that_shine() {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.2, 1.8), Vec3::ZERO, 1.2)], ..Scene::default() };
    let glossy = Layered { roughness: 0.4.into(), base_color: Vec3::splat(0.6).into(), ..Layered::default() }.into();
    add_room(&mut scene, Vec3::new(1.0, 1.0, 2.0), &glossy);
    add_sphere(&mut scene, Vec3::new(0.3, 0.2, -0.5), 0.3, lamp(Vec3::new(3.0, 2.0, 1.0)));
    add_sphere(&mut scene, Vec3::new(-0.5, -0.4, 0.2), 0.5, lamp(Vec3::splat(0.5)));
    let metal = Layered { metallic: 1.0.into(), roughness: 0.3.into(), ..Layered::default() }.into();
    add_sphere(&mut scene, Vec3::new(0.4, -0.6, 0.1), 0.35, metal);
    assert_strategies_agree("spheres", scene);
}

#[test]
fn under_a_sky_with_bright_spots() {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 1.0, 3.0), Vec3::ZERO, 0.8)], ..Scene::default() };
    add_quad(&mut scene, Vec3::new(-5.0, -0.5, -5.0), Vec3::Z * 10.0, Vec3::X * 10.0, matte(Vec3::splat(0.6)));
    let plastic = Layered { roughness: 0.35.into(), ..Layered::default() }.into();
    add_sphere(&mut scene, Vec3::ZERO, 0.5, plastic);
    let texel = |i: u32| {
        let (x, y) = (i % 16, i / 16);
        if (3..6).contains(&x) && y == 2 { [20.0, 18.0, 12.0] } else { [0.2, 0.3, 0.1 + 0.05 * y as f32] }
    };
    scene.images.push(Image::from_linear_rgb("sky", 16, 8, (0..128).map(texel).collect()));
    scene.environment = Some(Environment::picture(ImageId(0), Vec3::ONE, Mat3::from_rotation_y(0.4)));
    assert_strategies_agree("sky", scene.clone());
    // Compensation changes the noise, not the mean.
    let options = bottega_render::PrepareOptions { threads: 1, compensate_environment: true };
    let compensated = Subject::new(PreparedScene::new(Arc::new(scene.clone()), &options).unwrap());
    let plain = paint_by(&prepare(scene), DirectLight::Combined, 1, 3);
    assert_same_mean("compensated", &paint_by(&compensated, DirectLight::Combined, 1, 4), &plain);
}

/// A hall whose ceiling has a window of 2 by 1: open to the sky, or closed by a portal.
fn hall(is_open: bool) -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.8, 2.5), Vec3::ZERO, 0.9)], ..Scene::default() };
    add_quad(&mut scene, Vec3::new(-3.0, -0.5, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0, matte(Vec3::splat(0.6)));
    let plastic = Layered { roughness: 0.35.into(), ..Layered::default() }.into();
    add_sphere(&mut scene, Vec3::ZERO, 0.5, plastic);
    if is_open {
        // Four walls, and a ceiling in four parts.
        let black = || matte(Vec3::ZERO);
        for (corner, along) in [
            (Vec3::new(-3.0, -0.5, -3.0), Vec3::X),
            (Vec3::new(-3.0, -0.5, 3.0), Vec3::X),
            (Vec3::new(-3.0, -0.5, -3.0), Vec3::Z),
            (Vec3::new(3.0, -0.5, -3.0), Vec3::Z),
        ] {
            add_quad(&mut scene, corner, along * 6.0, Vec3::Y * 2.0, black());
        }
        for [x0, x1, z0, z1] in
            [[-3.0, -1.0, -3.0, 3.0], [1.0, 3.0, -3.0, 3.0], [-1.0, 1.0, -3.0, -0.5], [-1.0, 1.0, 0.5, 3.0]]
        {
            add_quad(&mut scene, Vec3::new(x0, 1.5, z0), Vec3::X * (x1 - x0), Vec3::Z * (z1 - z0), black());
        }
    }
    let texel = |i: u32| {
        let (x, y) = (i % 16, i / 16);
        if (3..6).contains(&x) && y == 2 { [20.0, 18.0, 12.0] } else { [0.2, 0.3, 0.1 + 0.05 * y as f32] }
    };
    scene.images.push(Image::from_linear_rgb("sky", 16, 8, (0..128).map(texel).collect()));
    let edges = [Vec3::Z, 2.0 * Vec3::X];
    let portals = if is_open { Vec::new() } else { vec![Portal { corner: Vec3::new(-1.0, 1.5, -0.5), edges }] };
    let sky = Environment::picture(ImageId(0), Vec3::ONE, Mat3::from_rotation_y(0.4));
    scene.environment = Some(Environment { portals, ..sky });
    scene
}

#[test]
fn a_portal_lets_in_as_much_as_a_window() {
    assert_strategies_agree("portal", hall(false));
    let portal = paint_by(&prepare(hall(false)), DirectLight::Combined, 1, 5);
    let window = paint_by(&prepare(hall(true)), DirectLight::Combined, 1, 6);
    assert_same_mean("portal and window", &window, &portal);
    // Sampling through the portal is not noisier overall.
    let rect = portal.rect();
    assert!(moments(&portal, &rect).1 < moments(&window, &rect).1);
}

#[test]
fn the_test_itself_can_fail() {
    let mut scene = cornell();
    scene.spheres.pop();
    let brighter = {
        let mut scene = scene.clone();
        for material in &mut scene.materials {
            material.emission.factor *= 1.1;
        }
        prepare(scene)
    };
    let a = paint_by(&prepare(scene), DirectLight::Combined, 1, 1);
    let b = paint_by(&brighter, DirectLight::Combined, 1, 2);
    let (mean, other) = (moments(&a, &a.rect()), moments(&b, &a.rect()));
    let z = (mean.0 - other.0) / (mean.1 + other.1).sqrt();
    assert!(z < -5.0, "{z} {mean:?} {other:?}");
    assert!(std::panic::catch_unwind(|| assert_same_mean("10 % brighter", &a, &b)).is_err());
}
