//! Pictures of cameras with lenses, of fisheyes, and of shutters that expose one row after another.

use std::f32::consts::PI;

use bottega_render::{Filter, PathSettings};
use bottega_scene::{
    Camera, Environment, FisheyeMapping, LensDescription, LensSurface, LensSystem, Projection, Scene, Shutter,
    TransformKey,
};
use glam::{Affine3A, Vec3};

use crate::render::scenes::{add_quad, color, lamp, paint, prepare};

fn settings() -> PathSettings {
    PathSettings { filter: Filter::Box { radius: 0.5 }, max_depth: 0, ..PathSettings::default() }
}

/// A scene of nothing but light of radiance 1 from everywhere.
fn furnace(camera: Camera) -> Scene {
    Scene { cameras: vec![camera], environment: Some(Environment::uniform(Vec3::ONE)), ..Scene::default() }
}

#[test]
fn a_film_behind_a_stop_gets_its_irradiance() {
    let (radius, distance) = (0.01, 0.05);
    let surfaces = vec![LensSurface { radius: 0.0, thickness: distance, eta: 1.0, aperture_radius: radius }];
    let lenses = LensSystem::new(LensDescription { surfaces, film_diagonal: 0.002, focus_distance: None }).unwrap();
    let camera = Camera { lenses: Some(lenses), ..Camera::default() };
    let tile = paint(&prepare(furnace(camera)), (4, 4), 512, settings());
    let mean = (0..16).map(|pixel| color(&tile, pixel % 4, pixel / 4).x).sum::<f32>() / 16.0;
    let expected = PI * radius * radius / (radius * radius + distance * distance);
    assert!((mean / expected - 1.0).abs() < 0.01, "{mean} instead of {expected}");
}

#[test]
fn beyond_the_rim_of_a_fisheye_the_picture_is_black_and_transparent() {
    let projection = Projection::Fisheye { mapping: FisheyeMapping::Equidistant, field_of_view: PI, height: 1.0 };
    let tile = paint(&prepare(furnace(Camera { projection, ..Camera::default() })), (16, 16), 4, settings());
    assert_eq!(color(&tile, 8, 8), Vec3::ONE);
    assert_eq!(color(&tile, 0, 0), Vec3::ZERO);
}

#[test]
fn each_row_of_a_rolling_shutter_has_its_own_time() {
    let mut scene = Scene {
        cameras: vec![Camera {
            world_from_camera: Affine3A::from_translation(Vec3::Z * 5.0),
            projection: Projection::Orthographic { height: 8.0 },
            rolling_shutter: Some(0.25),
            ..Camera::default()
        }],
        shutter: Shutter { open: 0.0, close: 1.0, ramp: 0.0 },
        ..Scene::default()
    };
    // A pole that crosses the picture from left to right
    add_quad(&mut scene, Vec3::new(-0.5, -4.0, 0.0), Vec3::X, Vec3::Y * 8.0, lamp(Vec3::ONE));
    scene.instances[0].motion = [(0.0, -4.0), (1.0, 4.0)]
        .map(|(time, x)| TransformKey { time, transform: Affine3A::from_translation(Vec3::X * x) })
        .to_vec();
    let tile = paint(&prepare(scene), (8, 8), 256, settings());
    for y in 0..8 {
        // The middle of the pole's places while this row is exposed
        let expected = 8.0 * ((y as f32 + 0.5) / 8.0 * 0.75 + 0.125);
        let weights = (0..8).map(|x| (x as f32 + 0.5, color(&tile, x, y).x));
        let (sum, moment) = weights.fold((0.0, 0.0), |(sum, moment), (x, light)| (sum + light, moment + x * light));
        assert!((moment / sum - expected).abs() < 0.1, "row {y}: {} instead of {expected}", moment / sum);
    }
}
