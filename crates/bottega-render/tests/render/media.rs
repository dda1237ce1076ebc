//! Participating media against known answers, and all ways to find light in them against each other.

use std::f32::consts::PI;

use bottega_image::Tile;
use bottega_render::{DirectLight, Filter, PathSettings};
use bottega_scene::{
    Environment, Layered, Light, LightKind, Material, Medium, MediumId, Scene, Sides, Spectrum, Surface,
};
use glam::Vec3;

use crate::render::scenes::{add_quad, add_sphere, camera, color, matte, mean_color, paint, prepare};
use crate::render::strategies::assert_strategies_agree;

const ALL: [DirectLight; 3] = [DirectLight::Combined, DirectLight::LightSampling, DirectLight::BsdfSampling];

fn deep() -> PathSettings {
    PathSettings { max_depth: 400, ..PathSettings::default() }
}

fn scattering(sigma: Spectrum, g: f32) -> Medium {
    Medium { scattering: sigma, g, ..Medium::absorbing(Spectrum::ZERO) }
}

/// A boundary between two media that has no other effect.
fn boundary(interior: Option<MediumId>, exterior: Option<MediumId>) -> Material {
    Material { interior, exterior, ..Surface::Null.into() }
}

fn before_a_sky(radiance: Vec3) -> Scene {
    Scene {
        cameras: vec![camera(Vec3::new(0.0, 0.0, 2.6), Vec3::ZERO, 0.9)],
        environment: Some(Environment::uniform(radiance)),
        ..Scene::default()
    }
}

#[test]
fn a_white_cloud_vanishes_before_a_white_sky() {
    for (sigma, g) in [(Vec3::ONE, 0.0), (Vec3::new(0.2, 3.0, 1.0), 0.7), (Vec3::splat(2.0), -0.5)] {
        let sky = Vec3::new(1.0, 0.5, 2.0);
        let mut scene = before_a_sky(sky);
        let cloud = scene.push_medium(scattering(sigma, g));
        add_sphere(&mut scene, Vec3::ZERO, 1.0, boundary(Some(cloud), None));
        let scene = prepare(scene);
        for direct_light in ALL {
            let mean = mean_color(&paint(&scene, (8, 8), 512, PathSettings { direct_light, ..deep() }));
            assert!((mean / sky - 1.0).abs().max_element() < 0.02, "{sigma} {g} {direct_light:?}: {mean}");
        }
    }
}

#[test]
fn in_white_glass_filled_with_a_white_cloud_nothing_is_lost() {
    let mut scene = before_a_sky(Vec3::ONE);
    let cloud = scene.push_medium(scattering(Vec3::splat(1.5), 0.3));
    let glass = Layered { roughness: 0.0.into(), transmission: 1.0.into(), ..Layered::default() };
    add_sphere(&mut scene, Vec3::ZERO, 1.0, Material { interior: Some(cloud), ..glass.into() });
    let mean = mean_color(&paint(&prepare(scene), (8, 8), 512, deep()));
    assert!((mean - 1.0).abs().max_element() < 0.02, "{mean}");
}

#[test]
fn light_is_weakened_by_the_exponential_of_its_way() {
    // 2 units of the outer medium and 1 of the inner one, twice nested, in front of a lamp.
    let (outer, inner) = (Vec3::new(0.1, 0.5, 1.0), Vec3::new(1.0, 0.2, 0.0));
    let mut scene = Scene { cameras: vec![camera(Vec3::Z * 5.0, Vec3::ZERO, 0.001)], ..Scene::default() };
    let outer_medium = scene.push_medium(Medium::absorbing(outer));
    let inner_medium = scene.push_medium(Medium::absorbing(inner));
    add_sphere(&mut scene, Vec3::ZERO, 1.5, boundary(Some(outer_medium), None));
    add_sphere(&mut scene, Vec3::ZERO, 0.5, boundary(Some(inner_medium), Some(outer_medium)));
    let shine = Material::emitter(Vec3::splat(3.0));
    add_quad(&mut scene, Vec3::new(-0.5, -0.5, -4.0), Vec3::X, Vec3::Y, shine);
    let expected = 3.0 * (-2.0 * outer - inner).map(f32::exp);
    let found = color(&paint(&prepare(scene.clone()), (1, 1), 16, deep()), 0, 0);
    assert!((found / expected - 1.0).abs().max_element() < 1e-3, "{found} {expected}");
    // The same distance, for shadow rays to a matte wall behind.
    scene.materials.pop();
    scene.materials.push(matte(Vec3::ONE));
    let position = Vec3::new(0.0, 0.0, 6.0);
    let kind = LightKind::Point { position, intensity: Vec3::splat(100.0 * PI) };
    scene.lights.push(Light::new("", kind));
    let lit = color(&paint(&prepare(scene), (1, 1), 16, PathSettings { max_depth: 1, ..deep() }), 0, 0);
    let expected = (2.0 * (-2.0 * outer - inner)).map(f32::exp);
    assert!((lit / expected - 1.0).abs().max_element() < 2e-3, "{lit} {expected}");
}

#[test]
fn a_camera_within_a_medium_looks_through_it() {
    let sigma = Vec3::new(0.1, 0.5, 1.0);
    let mut scene = Scene { cameras: vec![camera(Vec3::Z * 3.0, Vec3::ZERO, 0.001)], ..Scene::default() };
    let medium = scene.push_medium(Medium { emission: Vec3::splat(0.2), ..Medium::absorbing(sigma) });
    scene.cameras[0].medium = Some(medium);
    add_quad(&mut scene, Vec3::new(-5.0, -5.0, 0.0), Vec3::X * 10.0, Vec3::Y * 10.0, Material::emitter(Vec3::ONE));
    let through = (-3.0 * sigma).map(f32::exp);
    let expected = through + 0.2 * (1.0 - through) / sigma;
    let found = color(&paint(&prepare(scene), (1, 1), 4, deep()), 0, 0);
    assert!((found / expected - 1.0).abs().max_element() < 1e-3, "{found} {expected}");
}

/// Radiance from a surrounding medium that scatters the light of a point once, within a distance along the ray.
fn single_scattering(sigma: f32, absorption: f32, g: f32, light: Vec3, end: f32) -> f32 {
    let extinction = f64::from(sigma + absorption);
    let g = f64::from(g);
    let steps = 200_000;
    let step = f64::from(end) / f64::from(steps);
    let sum: f64 = (0..steps)
        .map(|i| {
            let t = (f64::from(i) + 0.5) * step;
            let to_light = light.as_dvec3() - glam::DVec3::NEG_Z * t;
            let distance = to_light.length();
            let cosine = -to_light.z / distance;
            let phase = (1.0 - g * g) / (4.0 * std::f64::consts::PI * (1.0 + g * g - 2.0 * g * cosine).powf(1.5));
            (-extinction * (t + distance)).exp() * phase * f64::from(sigma) / (distance * distance)
        })
        .sum();
    (sum * step) as f32
}

#[test]
fn light_scattered_once_is_that_of_the_integral() {
    for (g, light) in
        [(0.0, Vec3::new(0.3, 0.0, -2.0)), (0.6, Vec3::new(0.02, 0.01, -1.0)), (-0.4, Vec3::new(1.0, 0.0, 0.5))]
    {
        let mut scene = Scene { cameras: vec![camera(Vec3::ZERO, Vec3::NEG_Z, 0.0001)], ..Scene::default() };
        let medium = Medium { scattering: Vec3::new(0.5, 0.2, 0.0), g, ..Medium::absorbing(Vec3::new(0.1, 0.0, 0.3)) };
        let medium = scene.push_medium(medium);
        scene.cameras[0].medium = Some(medium);
        scene.lights.push(Light::new("", LightKind::Point { position: light, intensity: Vec3::ONE }));
        // A black wall at the end.
        add_quad(&mut scene, Vec3::new(-50.0, -50.0, -4.0), Vec3::X * 100.0, Vec3::Y * 100.0, matte(Vec3::ZERO));
        let scene = prepare(scene);
        let found = color(&paint(&scene, (1, 1), 16_384, PathSettings { max_depth: 1, ..deep() }), 0, 0);
        let expected =
            Vec3::new(single_scattering(0.5, 0.1, g, light, 4.0), single_scattering(0.2, 0.0, g, light, 4.0), 0.0);
        let error = (found - expected).abs() / expected.max(Vec3::splat(1e-6));
        assert!(error.x < 0.01 && error.y < 0.01 && found.z == 0.0, "{g} {light}: {found} {expected}");
    }
}

/// A ball of smoke around a lamp, cut by a floor, below a second lamp outside of it.
pub(crate) fn smoke(medium: Medium) -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.2, 3.5), Vec3::ZERO, 0.7)], ..Scene::default() };
    let medium = scene.push_medium(medium);
    add_sphere(&mut scene, Vec3::ZERO, 1.4, boundary(Some(medium), None));
    let floor = Vec3::new(-2.0, -0.8, -2.0);
    add_quad(&mut scene, floor, Vec3::Z * 4.0, Vec3::X * 4.0, matte(Vec3::new(0.7, 0.5, 0.3)));
    add_sphere(&mut scene, Vec3::new(0.4, 0.3, 0.0), 0.15, Material::emitter(Vec3::splat(4.0)));
    add_quad(&mut scene, Vec3::new(-0.5, 1.9, -0.5), Vec3::X, Vec3::Z, Material::emitter(Vec3::splat(3.0)));
    scene.environment = Some(Environment::uniform(Vec3::splat(0.05)));
    scene
}

#[test]
fn all_ways_to_find_light_in_smoke_agree() {
    for (sigma, g) in [(Vec3::splat(0.4), 0.0), (Vec3::new(2.0, 1.0, 0.3), 0.6)] {
        let mut scene = smoke(scattering(sigma, g));
        let lamp = Material { emission_sides: Sides::Both, ..Material::emitter(Vec3::new(1.0, 2.0, 3.0)) };
        add_quad(&mut scene, Vec3::new(-0.6, -0.3, -0.3), Vec3::X * 0.4, Vec3::new(0.0, 0.3, 0.3), lamp);
        assert_strategies_agree("smoke", scene);
    }
}

/// The means of Mitsuba 3 (`volpath`, scalar_rgb, 32768 samples per pixel of 8 × 8, max_depth 7 = six bounces, no roulette) over
/// the four quarters of the picture, row by row; its standard errors are below 0.4 %.
const QUARTERS: [[[f32; 3]; 4]; 2] = [
    [
        [0.108_800, 0.106_133, 0.103_561],
        [0.233_880, 0.231_272, 0.228_760],
        [0.094_156, 0.076_665, 0.060_081],
        [0.105_075, 0.086_088, 0.068_055],
    ],
    [
        [0.124_848, 0.136_440, 0.037_686],
        [0.183_265, 0.239_281, 0.117_181],
        [0.050_272, 0.076_850, 0.017_000],
        [0.067_085, 0.092_477, 0.020_564],
    ],
];

#[test]
fn smoke_looks_as_another_renderer_paints_it() {
    const SEEDS: u64 = 8;
    let clear = scattering(Vec3::splat(0.4), 0.0);
    let colored = Medium { absorption: Vec3::new(0.1, 0.0, 0.5), ..scattering(Vec3::new(2.0, 1.0, 0.3), 0.6) };
    for (medium, expected) in [clear, colored].into_iter().zip(QUARTERS) {
        let scene = prepare(smoke(medium));
        let filter = Filter::Box { radius: 0.5 };
        let pictures: Vec<Tile> = (0..SEEDS)
            .map(|seed| {
                paint(&scene, (8, 8), 512, PathSettings { seed, max_depth: 6, filter, ..PathSettings::default() })
            })
            .collect();
        for (block, expected) in pictures[0].rect().blocks(4).zip(expected) {
            let means: Vec<Vec3> = pictures
                .iter()
                .map(|tile| block.pixels().map(|(x, y)| color(tile, x, y)).sum::<Vec3>() / block.area() as f32)
                .collect();
            let expected = Vec3::from(expected);
            let mean = means.iter().sum::<Vec3>() / SEEDS as f32;
            let squares: Vec3 = means.iter().map(|&m| (m - mean) * (m - mean)).sum();
            let variance = squares / (SEEDS * (SEEDS - 1)) as f32 + (0.004 * expected) * (0.004 * expected);
            let z = (mean - expected).abs() / variance.map(f32::sqrt);
            // 24 numbers: one of them exceeds 5.4 standard errors, estimated from eight seeds, with a probability of a thousandth.
            assert!(z.max_element() < 5.4, "{block}: {mean} {expected}, {z} standard errors");
            let error = (mean / expected - 1.0).abs();
            assert!(error.max_element() < 0.06, "{block}: {mean} {expected}");
            eprintln!("{block}: off by {error}, {z} standard errors");
        }
    }
}
