//! Motion blur: known answers, and pictures against the mean of stills.

use bottega_render::{
    DirectLight, Filter, PathSettings, PhotonSettings, PrepareOptions, PreparedScene, Prepass,
    flat::{FlatScene, NotFlat},
    integrator::PhotonIntegrator,
};
use bottega_scene::{
    Camera, Environment, Instance, Light, LightKind, Material, Mesh, MeshKey, Projection, Scene, Shutter, SphereKey,
    TransformKey, Visibility,
};
use glam::{Affine3A, Quat, Vec3};

use crate::render::{
    known_answers::{assert_near, floor, irradiance},
    scenes::{add_mesh, add_quad, add_sphere, camera, color, lamp, matte, paint, prepare},
};

fn shift(time: f64, by: Vec3) -> TransformKey {
    TransformKey { time, transform: Affine3A::from_translation(by) }
}

/// A camera that looks along −z onto a window of this height, in parallel.
fn parallel(height: f32) -> Camera {
    Camera {
        world_from_camera: Affine3A::from_translation(Vec3::Z * 5.0),
        projection: Projection::Orthographic { height },
        ..Camera::default()
    }
}

/// Renders a row of pixels of width 1, whose centres are at x = −3.5 … 3.5.
fn row(scene: Scene, samples: u32) -> Vec<f32> {
    let filter = Filter::Box { radius: 0.5 };
    let settings = PathSettings { filter, max_depth: 0, ..PathSettings::default() };
    let tile = paint(&prepare(scene), (8, 1), samples, settings);
    (0..8).map(|x| color(&tile, x, 0).x).collect()
}

/// A glowing square of side 1 around the origin before that camera.
fn square() -> Scene {
    let mut scene = Scene { cameras: vec![parallel(1.0)], ..Scene::default() };
    add_quad(&mut scene, Vec3::new(-0.5, -0.5, 0.0), Vec3::X, Vec3::Y, lamp(Vec3::ONE));
    scene
}

/// The share of pixel and time that a square covers which moves from x = −2 to 2, by the light that the shutter lets pass
/// at each time.
fn expected(pixel: usize, passes: impl Fn(f64) -> f64) -> f64 {
    let (steps, center) = (4000, pixel as f64 - 3.5);
    let time = |step: usize| (step as f64 + 0.5) / steps as f64;
    let covered = |time: f64| (1.0 - (center - (4.0 * time - 2.0)).abs()).max(0.0);
    let sum: f64 = (0..steps).map(|step| covered(time(step)) * passes(time(step))).sum();
    sum / (0..steps).map(|step| passes(time(step))).sum::<f64>()
}

#[test]
fn a_square_that_passes_covers_each_pixel_for_its_share_of_the_time() {
    let mut scene = square();
    scene.shutter = Shutter { open: 10.0, close: 14.0, ramp: 0.0 };
    // Keys beyond the shutter count as far as it sees them
    scene.instances[0].motion = vec![shift(8.0, Vec3::X * -4.0), shift(16.0, Vec3::X * 4.0)];
    for (x, found) in row(scene.clone(), 16384).into_iter().enumerate() {
        assert!((f64::from(found) - expected(x, |_| 1.0)).abs() < 0.012, "{x}: {found}");
    }
    // A shutter that opens and closes slowly
    scene.shutter.ramp = 0.5;
    for (x, found) in row(scene.clone(), 16384).into_iter().enumerate() {
        let expected = expected(x, |time| time.min(1.0 - time));
        assert!((f64::from(found) - expected).abs() < 0.012, "{x}: {found} {expected}");
    }
    // A shutter that is open for no time sees the square where it is then
    scene.shutter = Shutter { open: 13.0, close: 13.0, ramp: 0.0 };
    let found = row(scene, 64);
    assert!(
        found.iter().enumerate().all(|(x, &found)| (found - [0.0, 0.5][usize::from(x == 4 || x == 5)]).abs() < 0.02)
    );
}

#[test]
fn moving_vertices_and_cameras_blur_alike() {
    let by = |x: f32| Vec3::X * x;
    let span = Shutter { open: 0.0, close: 1.0, ramp: 0.0 };
    let mut vertices = Scene { shutter: span, ..square() };
    let key = |time: f64, x: f32| {
        let positions = vertices.meshes[0].positions.iter().map(|&p| p + by(x)).collect();
        MeshKey { time, positions, normals: Vec::new() }
    };
    // Three keys, at the second of which the speed stays the same
    let motion = vec![key(0.0, -2.0), key(0.25, -1.0), key(1.0, 2.0)];
    vertices.meshes[0].motion = motion;
    let mut moving_camera = Scene { shutter: span, ..square() };
    let pose = |x: f32| Affine3A::from_translation(by(x) + Vec3::Z * 5.0);
    let key = |time: f64, x: f32| TransformKey { time, transform: pose(x) };
    moving_camera.cameras[0].motion = vec![key(0.0, 2.0), key(1.0, -2.0)];
    for scene in [vertices, moving_camera] {
        for (x, found) in row(scene, 16384).into_iter().enumerate() {
            assert!((f64::from(found) - expected(x, |_| 1.0)).abs() < 0.012, "{x}: {found}");
        }
    }
}

#[test]
fn a_moving_ball_covers_the_pixels_its_disc_passes() {
    let mut scene = Scene { shutter: Shutter { open: 0.0, close: 1.0, ramp: 0.0 }, ..Scene::default() };
    scene.cameras = vec![parallel(8.0)];
    add_sphere(&mut scene, Vec3::ZERO, 0.5, lamp(Vec3::ONE));
    let key = |time: f64, x: f32, radius: f32| SphereKey {
        time,
        center: Vec3::X * x,
        radius,
        world_from_object: Quat::IDENTITY,
    };
    scene.spheres[0].motion = vec![key(0.0, -2.0, 0.5), key(1.0, 2.0, 1.0)];
    let settings = PathSettings { max_depth: 0, ..PathSettings::default() };
    let tile = paint(&prepare(scene), (16, 16), 1024, settings);
    let sum: f32 = (0..16).flat_map(|y| (0..16).map(move |x| (x, y))).map(|(x, y)| color(&tile, x, y).x).sum();
    // ∫ π r² dt over radii from ½ to 1, in pixels of a quarter
    let expected = std::f32::consts::PI * (1.0 - 0.125) / (3.0 * 0.5) * 4.0;
    assert_near(sum, expected, 1e-2);
}

#[test]
fn a_light_that_moves_lights_by_its_mean() {
    let span = Shutter { open: 0.0, close: 1.0, ramp: 0.0 };
    // A point light that rises from 1 to 3: ∫ I / h² dt = I / 3
    let mut scene = Scene { shutter: span, ..floor() };
    let kind = LightKind::Point { position: Vec3::Y, intensity: Vec3::splat(9.0) };
    scene
        .lights
        .push(Light { motion: vec![shift(0.0, Vec3::ZERO), shift(1.0, Vec3::Y * 2.0)], ..Light::new("", kind) });
    assert_near(irradiance(scene, DirectLight::Combined), 3.0, 1e-2);
    // A small lamp that does the same: by area times radiance
    let side = 0.02;
    for strategy in [DirectLight::LightSampling, DirectLight::Combined] {
        let mut scene = Scene { shutter: span, ..floor() };
        let material = lamp(Vec3::splat(9.0 / (side * side)));
        add_quad(&mut scene, Vec3::new(-0.5 * side, 1.0, -0.5 * side), Vec3::X * side, Vec3::Z * side, material);
        let moved = scene.instances.last_mut().unwrap();
        moved.motion = vec![shift(0.0, Vec3::ZERO), shift(1.0, Vec3::Y * 2.0)];
        moved.visibility = Visibility::ALL.without(Visibility::CAMERA);
        assert_near(irradiance(scene, strategy), 3.0, 1e-2);
    }
    // A large ball finds the same light in all ways
    let by = [DirectLight::LightSampling, DirectLight::BsdfSampling, DirectLight::Combined].map(|strategy| {
        let mut scene = Scene { shutter: span, ..floor() };
        add_sphere(&mut scene, Vec3::Y * 2.0, 0.5, lamp(Vec3::splat(4.0)));
        scene.spheres[0].visibility = Visibility::ALL.without(Visibility::CAMERA);
        let key = |time: f64, center: Vec3| SphereKey { time, center, radius: 0.5, world_from_object: Quat::IDENTITY };
        scene.spheres[0].motion = vec![key(0.0, Vec3::Y * 2.0), key(1.0, Vec3::new(1.5, 1.0, 0.0))];
        irradiance(scene, strategy)
    });
    assert!((by[0] / by[2] - 1.0).abs() < 0.02 && (by[1] / by[2] - 1.0).abs() < 0.08, "{by:?}");
}

/// A scene in which everything moves that can: turning and growing boxes, waving vertices, a ball, lamps and the camera.
pub(crate) fn moving_scene() -> Scene {
    let span = Shutter { open: 0.0, close: 1.0, ramp: 0.0 };
    let mut scene = Scene {
        cameras: vec![camera(Vec3::new(0.0, 2.0, 5.0), Vec3::Y * 0.4, 0.7)],
        shutter: span,
        ..Scene::default()
    };
    scene.environment = Some(Environment::uniform(Vec3::splat(0.2)));
    add_quad(&mut scene, Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0, matte(Vec3::splat(0.6)));
    // A box that turns about a slanted axis, rises and grows, by three keys
    let material = scene.push_material(matte(Vec3::new(0.8, 0.3, 0.2)));
    let cube = scene.push_mesh(Mesh { material, ..Mesh::cuboid(Vec3::splat(-0.5), Vec3::splat(0.5)) });
    let pose = |turn: f32, size: f32, at: Vec3| {
        let axis = Vec3::new(0.3, 1.0, 0.2).normalize();
        Affine3A::from_scale_rotation_translation(Vec3::new(size, 0.8, 1.0), Quat::from_axis_angle(axis, turn), at)
    };
    let keys = [(0.0, pose(0.0, 1.0, Vec3::new(-1.2, 0.7, 0.0))), (0.4, pose(1.2, 0.6, Vec3::new(-0.9, 1.0, 0.3)))];
    let keys = keys.into_iter().chain([(1.0, pose(2.9, 1.3, Vec3::new(-1.0, 0.6, 0.8)))]);
    let motion = keys.map(|(time, transform)| TransformKey { time, transform }).collect();
    scene.instances.push(Instance { motion, ..Instance::new(cube, Affine3A::IDENTITY) });
    // A sheet of smooth normals whose vertices wave
    let wave = |phase: f32| -> (Vec<Vec3>, Vec<Vec3>) {
        let places = (0..25).map(|i| Vec3::new((i % 5) as f32 * 0.3 - 0.6, 0.0, (i / 5) as f32 * 0.3 - 0.6));
        let raised = |p: Vec3| p + Vec3::Y * 0.2 * (4.0 * p.x + phase).sin();
        let normal = |p: Vec3| Vec3::new(-0.8 * (4.0 * p.x + phase).cos(), 1.0, 0.0).normalize();
        places.map(|p| (raised(p), normal(p))).unzip()
    };
    let corners = |i: u32| [i, i + 5, i + 6, i, i + 6, i + 1];
    let quads = (0..16).map(|i| corners(i / 4 * 5 + i % 4));
    let triangles = quads.flat_map(|[a, b, c, d, e, f]| [[a, b, c], [d, e, f]]).collect();
    add_mesh(&mut scene, wave(0.0).0, triangles, matte(Vec3::new(0.2, 0.5, 0.8)));
    let key = |time: f64, phase: f32| {
        let (positions, normals) = wave(phase);
        MeshKey { time, positions, normals }
    };
    let keys = vec![key(0.0, 0.0), key(0.5, 1.0), key(1.0, 2.5)];
    let index = scene.meshes.len() - 1;
    scene.meshes[index].normals = wave(0.0).1;
    scene.meshes[index].motion = keys;
    scene.instances.last_mut().unwrap().world_from_object = Affine3A::from_translation(Vec3::new(1.2, 0.6, 0.0));
    // A ball, a lamp that turns, a point light, and the camera
    add_sphere(&mut scene, Vec3::ZERO, 0.3, matte(Vec3::splat(0.9)));
    let key =
        |time: f64, center: Vec3, radius: f32| SphereKey { time, center, radius, world_from_object: Quat::IDENTITY };
    let ends = [Vec3::new(-0.2, 0.3, 1.5), Vec3::new(0.5, 0.8, 1.2)];
    scene.spheres[0].motion = vec![key(0.0, ends[0], 0.3), key(1.0, ends[1], 0.2)];
    let glow = Material { emission: Vec3::splat(14.0).into(), ..matte(Vec3::ZERO) };
    add_quad(&mut scene, Vec3::new(-0.4, 0.0, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8, glow);
    let pose =
        |turn: f32, x: f32| Affine3A::from_rotation_translation(Quat::from_rotation_z(turn), Vec3::new(x, 2.6, 0.0));
    let keys = [(0.0, pose(0.0, -1.0)), (1.0, pose(2.0, 1.0))];
    scene.instances.last_mut().unwrap().motion = keys.map(|(time, transform)| TransformKey { time, transform }).into();
    let kind = LightKind::Point { position: Vec3::new(2.0, 2.0, 1.0), intensity: Vec3::splat(1.5) };
    scene
        .lights
        .push(Light { motion: vec![shift(0.0, Vec3::ZERO), shift(1.0, Vec3::NEG_X * 1.5)], ..Light::new("", kind) });
    let eye = |x: f32| camera(Vec3::new(x, 2.0, 5.0), Vec3::Y * 0.4, 0.7).world_from_camera;
    scene.cameras[0].motion =
        [(0.0, eye(0.0)), (1.0, eye(0.6))].map(|(time, transform)| TransformKey { time, transform }).into();
    scene
}

#[test]
fn a_moving_scene_is_the_mean_of_its_stills() {
    const SIZE: (u32, u32) = (16, 12);
    const STILLS: u32 = 64;
    let settings = PathSettings { max_depth: 3, ..PathSettings::default() };
    let pixels = || (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y)));
    let mut mean = vec![Vec3::ZERO; (SIZE.0 * SIZE.1) as usize];
    for still in 0..STILLS {
        let time = (f64::from(still) + 0.5) / f64::from(STILLS);
        let shutter = Shutter { open: time, close: time, ramp: 0.0 };
        let prepared = prepare(Scene { shutter, ..moving_scene() });
        assert!(!prepared.scene.moves());
        let settings = PathSettings { seed: still.into(), ..settings };
        let tile = paint(&prepared, SIZE, 64, settings);
        for (sum, (x, y)) in mean.iter_mut().zip(pixels()) {
            *sum += color(&tile, x, y) / STILLS as f32;
        }
    }
    let prepared = prepare(moving_scene());
    assert!(prepared.scene.moves());
    let tile = paint(&prepared, SIZE, 64 * STILLS, settings);
    let (mut total, mut worst) = ([0.0; 2], 0.0f32);
    for (mean, (x, y)) in mean.iter().zip(pixels()) {
        let (still, moving) = (mean.element_sum(), color(&tile, x, y).element_sum());
        total = [total[0] + still, total[1] + moving];
        worst = worst.max((still - moving).abs() / still.max(0.3));
    }
    assert!((total[1] / total[0] - 1.0).abs() < 0.01, "{total:?}");
    assert!(worst < 0.2, "{worst}");
}

#[test]
fn techniques_without_motion_refuse_it() {
    let subject = prepare(moving_scene());
    let prepared = &subject.scene;
    assert!(matches!(FlatScene::new(prepared), Err(missing) if missing.contains(&NotFlat::Motion)));
    let view = subject.view((8, 8));
    let settings = PathSettings { photons: Some(PhotonSettings::default()), ..PathSettings::default() };
    let refused = PhotonIntegrator::new(prepared, &Prepass::default(), &view, &settings, PhotonSettings::default());
    assert!(refused.is_err_and(|error| error.to_string().contains("motion")));
    assert!(!prepared.can_learn(&subject.view((1000, 1000)), 1 << 10));
}

#[test]
fn keys_that_cannot_be_followed_are_refused() {
    let prepared = |change: fn(&mut Scene)| {
        let mut scene = moving_scene();
        change(&mut scene);
        PreparedScene::new(scene.into(), &PrepareOptions::default()).map(drop)
    };
    assert!(prepared(|_| {}).is_ok());
    let changes: [fn(&mut Scene); 6] = [
        |scene| scene.instances[1].motion.swap(0, 1),
        |scene| scene.instances[1].motion[1].transform.matrix3 = glam::Mat3A::ZERO,
        |scene| scene.meshes[2].motion[1].positions.truncate(3),
        |scene| scene.spheres[0].motion[1].radius = -1.0,
        |scene| scene.cameras[0].motion[1].time = f64::NAN,
        |scene| scene.shutter.close = -1.0,
    ];
    for (index, change) in changes.into_iter().enumerate() {
        assert!(prepared(change).is_err(), "{index}");
    }
}
