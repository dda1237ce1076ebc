//! Motion vectors: known answers for objects, vertices, spheres and cameras that move.

use bottega_image::{Aov, AovSet, Layout, Rect, Tile};
use bottega_render::{Filter, PathSettings};
use bottega_scene::{Camera, Material, MeshKey, Projection, Scene, Shutter, SphereKey, TransformKey};
use glam::{Affine3A, Quat, Vec2, Vec3};

use crate::render::scenes::{add_quad, add_sphere, matte, prepare};

/// Width and height of the pictures, in pixels.
const SIDE: u32 = 8;
const FOV: f32 = 0.9;

/// A scene before a camera at the origin that looks along −z. The shutter is open from 0 to 1.
fn scene(projection: Projection) -> Scene {
    let cameras = vec![Camera { projection, ..Camera::default() }];
    Scene { cameras, shutter: Shutter { open: 0.0, close: 1.0, ramp: 0.0 }, ..Scene::default() }
}

/// A wide wall at this distance.
fn wall(scene: &mut Scene, distance: f32) {
    let corner = Vec3::new(-20.0, -20.0, -distance);
    add_quad(scene, corner, Vec3::X * 40.0, Vec3::Y * 40.0, Material::matte(Vec3::ONE));
}

fn keys(at: [Affine3A; 2]) -> Vec<TransformKey> {
    (0..2).map(|time| TransformKey { time: f64::from(time), transform: at[time as usize] }).collect()
}

fn shift(x: f32, y: f32, z: f32) -> Affine3A {
    Affine3A::from_translation(Vec3::new(x, y, z))
}

/// Motion vectors of the picture, forward and backward, of each pixel.
fn vectors(scene: Scene, instant_shutter: bool) -> Vec<[Vec2; 2]> {
    let subject = prepare(scene);
    let layout = Layout::new(AovSet::NONE.with(Aov::Motion));
    let tile = Tile::new(Rect::of_size(SIDE, SIDE), layout);
    let filter = Filter::Box { radius: 0.5 };
    let settings = PathSettings { instant_shutter, filter, max_depth: 1, ..PathSettings::default() };
    let tile = subject.block(&subject.view((SIDE, SIDE)), settings, tile, 0..16).perform().unwrap().tile;
    let offset = tile.layout().offset(Aov::Motion).unwrap();
    let of_pixel = |(x, y)| {
        let sums = tile.pixel(x, y);
        let mean = |at: usize| sums[offset + at] / sums[Layout::SAMPLE_COUNT];
        [Vec2::new(mean(0), mean(1)), Vec2::new(mean(2), mean(3))]
    };
    tile.rect().pixels().map(of_pixel).collect()
}

#[track_caller]
fn assert_vectors(found: &[[Vec2; 2]], expected: impl Fn(Vec2) -> [Vec2; 2], tolerance: f32) {
    for (index, found) in found.iter().enumerate() {
        let (x, y) = (index as u32 % SIDE, index as u32 / SIDE);
        // From the axis, right and up, in pixels
        let half = 0.5 * SIDE as f32;
        let expected = expected(Vec2::new(x as f32 + 0.5 - half, half - y as f32 - 0.5));
        for (found, expected) in found.iter().zip(expected) {
            assert!((*found - expected).length() < tolerance, "({x}, {y}): {found} instead of {expected}");
        }
    }
}

#[test]
fn a_wall_that_moves_along_the_picture_moves_by_its_way_in_pixels() {
    let window = Projection::Orthographic { height: SIDE as f32 };
    let mut moving = scene(window);
    wall(&mut moving, 3.0);
    moving.instances[0].motion = keys([shift(0.0, 0.0, 0.0), shift(2.0, 0.5, -1.0)]);
    let half = Vec2::new(1.0, 0.25);
    assert_vectors(&vectors(moving.clone(), true), |_| [half, -half], 1e-4);
    // With blur, the whole way is the same, and the parts before and after depend on the times of the samples
    let blurred = vectors(moving, false);
    let ways: Vec<_> = blurred.iter().map(|[forward, backward]| [*forward - *backward, Vec2::ZERO]).collect();
    assert_vectors(&ways, |_| [2.0 * half, Vec2::ZERO], 1e-4);
    assert!(blurred.iter().any(|[forward, _]| (*forward - half).length() > 0.02));
    // A perspective sees less of the same way, farther away
    let mut moving = scene(Projection::Perspective { vertical_fov: FOV });
    wall(&mut moving, 4.0);
    moving.instances[0].motion = keys([shift(0.0, 0.0, 0.0), shift(0.4, -0.2, 0.0)]);
    let focal = 0.5 * SIDE as f32 / (0.5 * FOV).tan();
    let half = Vec2::new(0.2, -0.1) * (focal / 4.0);
    assert_vectors(&vectors(moving, true), |_| [half, -half], 1e-3);
}

#[test]
fn what_comes_nearer_moves_outwards() {
    let mut scene = scene(Projection::Perspective { vertical_fov: FOV });
    wall(&mut scene, 4.0);
    scene.instances[0].motion = keys([shift(0.0, 0.0, 0.0), shift(0.0, 0.0, 2.0)]);
    // Seen at the distance 3, it is at 2 in the end, and was at 4
    assert_vectors(&vectors(scene, true), |place| [place * 0.5, place * -0.25], 0.05);
}

#[test]
fn a_camera_that_turns_moves_all_that_stands_still() {
    let mut scene = scene(Projection::Perspective { vertical_fov: FOV });
    wall(&mut scene, 4.0);
    let turn = 0.2;
    scene.cameras[0].motion = keys([Affine3A::IDENTITY, Affine3A::from_rotation_y(turn)]);
    let focal = 0.5 * SIDE as f32 / (0.5 * FOV).tan();
    let seen_after = |place: Vec2, angle: f32| {
        let direction = Vec3::new(place.x, place.y, -focal);
        let turned = Quat::from_rotation_y(-angle) * direction;
        Vec2::new(turned.x, turned.y) * (focal / -turned.z) - place
    };
    let half = 0.5 * turn;
    assert_vectors(&vectors(scene, true), |place| [seen_after(place, half), seen_after(place, -half)], 0.02);
}

#[test]
fn vertices_and_spheres_that_move_have_vectors_of_their_own() {
    let window = Projection::Orthographic { height: SIDE as f32 };
    // A sheet that is stretched sideways, by 1 at the time of the picture
    let mut stretched = scene(window);
    wall(&mut stretched, 2.0);
    let positions = stretched.meshes[0].positions.clone();
    let key = |time: f64, factor: f32| {
        let positions = positions.iter().map(|&p| p * Vec3::new(factor, 1.0, 1.0)).collect();
        MeshKey { time, positions, normals: Vec::new() }
    };
    stretched.meshes[0].motion = vec![key(0.0, 0.5), key(1.0, 1.5)];
    let along = |place: Vec2| [Vec2::new(0.5 * place.x, 0.0), Vec2::new(-0.5 * place.x, 0.0)];
    assert_vectors(&vectors(stretched, true), along, 0.05);
    // A ball that flies and grows: its points move by its way and away from its centre
    let mut ball = scene(window);
    add_sphere(&mut ball, Vec3::NEG_Z * 20.0, 8.0, matte(Vec3::ONE));
    let key = |time: f64, x: f32, radius: f32| SphereKey {
        time,
        center: Vec3::new(x, 0.0, -20.0),
        radius,
        world_from_object: Quat::IDENTITY,
    };
    ball.spheres[0].motion = vec![key(0.0, -1.0, 7.0), key(1.0, 1.0, 9.0)];
    let expected = |place: Vec2| {
        let half = Vec2::X + place / 8.0;
        [half, -half]
    };
    assert_vectors(&vectors(ball, true), expected, 0.02);
}

#[test]
fn what_stands_still_has_no_vectors() {
    // A still wall in front of a moving one
    let mut scene = scene(Projection::Perspective { vertical_fov: FOV });
    wall(&mut scene, 3.0);
    wall(&mut scene, 5.0);
    scene.instances[1].motion = keys([shift(0.0, 0.0, 0.0), shift(1.0, 0.0, 0.0)]);
    let still = Scene { shutter: Shutter::default(), ..scene.clone() };
    for scene in [scene, still] {
        assert!(vectors(scene, false).iter().flatten().all(|&vector| vector == Vec2::ZERO));
    }
}
