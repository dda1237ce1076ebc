//! Shadow catchers: known answers, and what the camera sees.

use std::{ops::Range, sync::Arc};

use bottega_image::{Aov, Film, Layout, Rect, Tile};
use bottega_render::{Filter, PathSettings, ShadowCatchers};
use bottega_scene::{Camera, Environment, Light, LightKind, Projection, Scene};
use glam::{Affine3A, Quat, Vec3};

use crate::render::scenes::{Subject, add_quad, add_sphere, lamp, matte, prepare};

/// A floor, the first mesh, under a camera that looks down from a height of ½ onto a window of this height.
fn scene(height: f32) -> Scene {
    let down = Affine3A::from_rotation_translation(Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2), Vec3::Y * 0.5);
    let projection = Projection::Orthographic { height };
    let cameras = vec![Camera { world_from_camera: down, projection, ..Camera::default() }];
    let mut scene = Scene { cameras, ..Scene::default() };
    add_quad(&mut scene, Vec3::new(-40.0, 0.0, -40.0), Vec3::Z * 80.0, Vec3::X * 80.0, matte(Vec3::splat(0.6)));
    scene
}

/// Adds samples to a part of a square picture whose catcher is the first mesh.
fn add(subject: &Subject, side: u32, tile: Tile, samples: Range<u32>) -> Tile {
    let catchers = ShadowCatchers::new(&subject.scene, |names| names.contains(&"mesh.0"));
    assert!(!catchers.is_empty());
    let settings = PathSettings { filter: Filter::Box { radius: 0.5 }, ..PathSettings::default() };
    let work = subject.block(&subject.view((side, side)), settings, tile, samples);
    bottega_render::BlockWork { catchers: Some(Arc::new(catchers)), ..work }.perform().unwrap().tile
}

fn layout() -> Layout {
    Layout::new(Aov::CATCHERS.into_iter().chain([Aov::Depth]).collect())
}

/// Renders such a picture. Returns color and alpha, then the layer of catchers, of each pixel.
fn pixels(scene: Scene, side: u32, samples: u32) -> Vec<([f32; 4], [f32; 4])> {
    let rect = Rect::of_size(side, side);
    let tile = add(&prepare(scene), side, Tile::new(rect, layout()), 0..samples);
    let mut film = Film::new(rect, layout());
    film.add_tile(&tile, |_, _| 1.0);
    let film = film.finished();
    let (stride, at) = (layout().stride() + 1, layout().offset(Aov::ShadowCatcher).unwrap());
    let pixel = |values: &[f32]| {
        ([values[0], values[1], values[2], values[Layout::ALPHA]], [0, 1, 2, 3].map(|i| values[at + i]))
    };
    film.values().chunks_exact(stride).map(pixel).collect()
}

#[test]
fn a_card_takes_all_light_of_a_point_within_its_shadow_and_none_outside() {
    let mut scene = scene(4.0);
    add_quad(&mut scene, Vec3::new(-0.5, 1.0, -0.5), Vec3::Z, Vec3::X, matte(Vec3::ZERO));
    let kind = LightKind::Point { position: Vec3::Y * 2.0, intensity: Vec3::splat(5.0) };
    scene.lights.push(Light::new("", kind));
    // The shadow is twice as large as the card: the inner half of a window of 4
    for (index, (color, layer)) in pixels(scene, 8, 8).into_iter().enumerate() {
        let is_dark = (2..6).contains(&(index % 8)) && (2..6).contains(&(index / 8));
        let ratio = if is_dark { 0.0 } else { 1.0 };
        assert_eq!((color, layer), ([0.0, 0.0, 0.0, 1.0 - ratio], [ratio, ratio, ratio, 1.0]), "{index}");
    }
}

#[test]
fn a_black_ball_takes_its_share_of_a_uniform_sky() {
    let mut scene = scene(0.01);
    scene.environment = Some(Environment::uniform(Vec3::ONE));
    add_sphere(&mut scene, Vec3::Y * 2.0, 1.0, matte(Vec3::ZERO));
    // The form factor of a ball straight above is (r / h)²
    let (color, layer) = pixels(scene.clone(), 1, 4096)[0];
    assert!((layer[0] - 0.75).abs() < 0.01, "{layer:?}");
    assert!(color[..3] == [0.0; 3] && (color[3] - 0.25).abs() < 0.01, "{color:?}");
    // A ball that glows lights the catcher with and without the others; a white one beside it takes and returns light
    scene.materials[1] = lamp(Vec3::ONE);
    let (_, layer) = pixels(scene, 1, 64)[0];
    assert_eq!(layer, [1.0; 4]);
}

#[test]
fn the_camera_sees_objects_before_catchers_and_neither_them_nor_the_sky() {
    let mut scene = scene(4.0);
    scene.environment = Some(Environment::uniform(Vec3::ONE));
    // A card below the camera over the left half of the picture, and a ball below the floor
    add_quad(&mut scene, Vec3::new(-4.0, 0.25, -4.0), Vec3::Z * 8.0, Vec3::X * 4.0, matte(Vec3::splat(0.5)));
    add_sphere(&mut scene, Vec3::Y * -2.0, 1.0, lamp(Vec3::ONE));
    for (index, (color, layer)) in pixels(scene, 8, 16).into_iter().enumerate() {
        if index % 8 < 4 {
            assert!(color[0] > 0.3 && color[3] == 1.0 && layer == [1.0, 1.0, 1.0, 0.0], "{index}: {color:?} {layer:?}");
        } else {
            assert!(color[..3] == [0.0; 3] && color[3] < 1.0 && layer[3] == 1.0, "{index}: {color:?} {layer:?}");
            assert!((color[3] - (1.0 - layer[0]).max(0.0)).abs() < 1e-5);
        }
    }
}

#[test]
fn light_on_catchers_has_the_same_bits_for_any_parts_of_the_work() {
    let mut scene = scene(3.0);
    scene.environment = Some(Environment::uniform(Vec3::ONE));
    add_sphere(&mut scene, Vec3::new(0.4, 1.2, 0.0), 0.7, matte(Vec3::splat(0.8)));
    let subject = prepare(scene);
    let whole = add(&subject, 6, Tile::new(Rect::of_size(6, 6), layout()), 0..7);
    let part = Rect::new(2, 1, 5, 4);
    let some = add(&subject, 6, Tile::new(part, layout()), 0..3);
    let some = add(&subject, 6, some, 3..7);
    for (x, y) in part.pixels() {
        assert_eq!(some.pixel(x, y), whole.pixel(x, y), "({x}, {y})");
    }
}
