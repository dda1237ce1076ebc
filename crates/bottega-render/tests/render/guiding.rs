//! Guided paths have the mean of unguided ones, less noise, and bits that do not depend on threads.

use std::sync::{Arc, OnceLock};

use bottega_image::Tile;
use bottega_render::{Filter, PathSettings, PrepareOptions, PreparedScene};
use bottega_scene::{Layered, Material, Scene};
use glam::Vec3;

use crate::render::scenes::{Subject, add_quad, add_room, camera, cornell, matte, paint, prepare};
use crate::render::strategies::{assert_same_mean, moments};

/// Large enough that there is something to learn from.
const SIDE: u32 = 128;

/// Factor on the samples of the reference picture: where light is rare, few samples underestimate their own
/// variance.
const MORE: u32 = 4;

fn paint_by(scene: &Subject, guiding: bool, spp: u32, seed: u64) -> Tile {
    let settings = PathSettings { seed, filter: Filter::PIXEL, guiding, ..PathSettings::default() };
    paint(scene, (SIDE, SIDE), spp, settings)
}

/// A room whose only lamp shines on the wall behind a screen, open at one side.
pub(crate) fn behind_a_screen(wall: &Material) -> Scene {
    let mut scene =
        Scene { cameras: vec![camera(Vec3::new(-1.6, 0.0, 1.8), Vec3::new(-1.0, 0.0, -2.0), 1.0)], ..Scene::default() };
    add_room(&mut scene, Vec3::new(2.0, 1.0, 2.0), wall);
    add_quad(&mut scene, Vec3::new(0.9, -1.0, -2.0), Vec3::Y * 2.0, Vec3::Z * 3.2, matte(Vec3::splat(0.6)));
    let lamp = Material::emitter(Vec3::splat(60.0));
    add_quad(&mut scene, Vec3::new(1.3, 0.99, -0.5), Vec3::X * 0.4, Vec3::Z * 0.4, lamp);
    scene
}

/// The matte room, prepared once for all tests: its guide is learnt once.
fn matte_room() -> &'static Subject {
    static ROOM: OnceLock<Subject> = OnceLock::new();
    ROOM.get_or_init(|| prepare(behind_a_screen(&matte(Vec3::splat(0.7)))))
}

/// Sum over the pixels of the variance of their means, relative to the picture's mean.
fn noise(tile: &Tile) -> f64 {
    let (mean, variance) = moments(tile, &tile.rect());
    variance / (mean * mean)
}

#[test]
fn in_a_room_with_glass() {
    let scene = prepare(cornell());
    assert_same_mean("glass", &paint_by(&scene, true, 32, 1), &paint_by(&scene, false, 32, 2));
}

#[test]
fn behind_a_screen_with_less_noise() {
    let scene = matte_room();
    let (guided, plain) = (paint_by(scene, true, 16, 1), paint_by(scene, false, MORE * 16, 2));
    assert_same_mean("matte", &guided, &plain);
    let (guided, plain) = (noise(&guided), f64::from(MORE) * noise(&plain));
    assert!(guided < 0.9 * plain, "{guided} {plain}");
}

#[test]
fn behind_a_screen_of_gloss() {
    let gloss = Layered { roughness: 0.3.into(), base_color: Vec3::splat(0.7).into(), ..Layered::default() };
    let scene = prepare(behind_a_screen(&gloss.into()));
    assert_same_mean("gloss", &paint_by(&scene, true, 16, 1), &paint_by(&scene, false, MORE * 16, 2));
}

#[test]
fn whatever_the_number_of_threads() {
    let one = paint_by(matte_room(), true, 2, 3);
    let options = PrepareOptions { threads: 3, ..PrepareOptions::default() };
    let scene = behind_a_screen(&matte(Vec3::splat(0.7)));
    let three = Subject::new(PreparedScene::new(Arc::new(scene), &options).unwrap());
    assert!(one == paint_by(&three, true, 2, 3) && one != paint_by(matte_room(), false, 2, 3));
}

#[test]
fn of_few_samples_nothing_is_learnt() {
    let scene = matte_room();
    let by = |guiding, planned_samples| {
        let settings = PathSettings { guiding, planned_samples, filter: Filter::PIXEL, ..PathSettings::default() };
        paint(scene, (SIDE, SIDE), 1, settings)
    };
    assert!(by(true, 31) == by(false, 31) && by(true, 32) != by(false, 32));
}
