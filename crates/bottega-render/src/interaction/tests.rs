use std::sync::Arc;

use bottega_kernels::Ray;
use bottega_scene::{Instance, Layered, Mesh, ScalarParam};
use glam::Affine3A;

use super::*;
use crate::{
    prepare::{PrepareOptions, PreparedScene},
    sampler::PixelSampler,
    sampling::uniform_sphere,
};

fn numbers(i: u32) -> impl FnMut() -> f32 {
    let sampler = PixelSampler::new(5, i, 0, 0);
    let mut key = 0;
    move || {
        key += 1;
        sampler.hashed(key)
    }
}

/// A unit square in the xy plane, its picture upright, with a normal map of one color.
fn normal_mapped(texel: [f32; 3]) -> Interaction {
    let mesh = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
        // v grows downwards.
        uvs: [vec![Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(1.0, 0.0), Vec2::ZERO], vec![]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let map = TextureMap::new(bottega_scene::ImageId(0));
    let scene = Scene {
        images: vec![bottega_scene::Image::from_linear_rgb("normals", 1, 1, vec![texel])].into(),
        instances: vec![Instance::new(0, Affine3A::IDENTITY)],
        meshes: vec![mesh].into(),
        materials: vec![Material {
            relief: Some(Relief::normals(map, 1.0)),
            ..Layered { coat: 1.0.into(), ..Layered::default() }.into()
        }],
        ..Scene::default()
    };
    let prepared = PreparedScene::new(Arc::new(scene), &PrepareOptions::default()).unwrap();
    let (origin, direction) = (Vec3::new(0.7, 0.4, 3.0), Vec3::NEG_Z);
    let hit = prepared.accel().intersect(&Ray::new(origin, direction));
    Interaction::new(&prepared, &hit, origin, direction, RayCone { width: 0.25, spread: 0.0 })
}

#[test]
fn red_of_a_normal_map_leans_to_the_right_and_green_up_the_picture() {
    let close = |a: Vec3, b: Vec3| (a - b).length() < 1e-5;
    assert!(close(normal_mapped([0.5, 0.5, 1.0]).frame[2], Vec3::Z));
    assert!(close(normal_mapped([0.8, 0.5, 0.9]).frame[2], Vec3::new(0.6, 0.0, 0.8)));
    assert!(close(normal_mapped([0.5, 0.8, 0.9]).frame[2], Vec3::new(0.0, 0.6, 0.8)));
}

/// A square of two units in the xy plane, or a unit sphere, whose heights rise along u and v by what `texel` says, seen
/// from +z at `(x, y)`.
fn bumped(on_sphere: bool, slope: Vec2, x: f32, y: f32) -> Interaction {
    const SIZE: u32 = 64;
    let height = |i: u32| {
        let (column, row) = (i % SIZE, i / SIZE);
        let uv = Vec2::new(column as f32 + 0.5, row as f32 + 0.5) / SIZE as f32;
        [uv.dot(slope) + 2.0; 3]
    };
    let texels = (0..SIZE * SIZE).map(height).collect();
    let map = TextureMap::new(bottega_scene::ImageId(0));
    let height = ScalarParam { factor: 1.0, texture: Some((map, bottega_scene::Channel::R)) };
    let mut scene = Scene {
        images: vec![bottega_scene::Image::from_linear_rgb("heights", SIZE, SIZE, texels)].into(),
        materials: vec![Material { relief: Some(Relief::heights(height)), ..Material::default() }],
        ..Scene::default()
    };
    if on_sphere {
        scene.push_sphere(Vec3::ZERO, 1.0, 0);
    } else {
        scene.push_surface(Mesh::quad(Vec3::new(-1.0, -1.0, 0.0), 2.0 * Vec3::X, 2.0 * Vec3::Y));
    }
    let prepared = PreparedScene::new(Arc::new(scene), &PrepareOptions::default()).unwrap();
    let (origin, direction) = (Vec3::new(x, y, 3.0), Vec3::NEG_Z);
    let hit = prepared.accel().intersect(&Ray::new(origin, direction));
    Interaction::new(&prepared, &hit, origin, direction, RayCone { width: 0.0, spread: 0.0 })
}

#[test]
fn a_bump_leans_away_from_where_it_rises() {
    // u covers two units: a slope of 1 in texture coordinates is one half in the world.
    let expected = Vec3::new(-0.5, -0.25, 1.0).normalize();
    let normal = bumped(false, Vec2::new(1.0, 0.5), 0.1, 0.2).frame[2];
    assert!((normal - expected).length() < 0.01, "{normal}");
    assert!((bumped(false, Vec2::ZERO, 0.1, 0.2).frame[2] - Vec3::Z).length() < 1e-5);
}

#[test]
fn a_bump_on_a_sphere_leans_by_its_own_coordinates() {
    // At (0, 0, 1) u grows towards +x, 2 π units a turn, and v towards −y, π units from pole to pole.
    let normal = bumped(true, Vec2::new(3.0, 0.0), 0.0, 0.0).frame[2];
    assert!((normal - Vec3::new(-3.0 / (2.0 * PI), 0.0, 1.0).normalize()).length() < 0.01, "{normal}");
    let normal = bumped(true, Vec2::new(0.0, 1.5), 0.0, 0.0).frame[2];
    assert!((normal - Vec3::new(0.0, 1.5 / PI, 1.0).normalize()).length() < 0.01, "{normal}");
}

#[test]
fn a_sphere_is_there_where_its_texture_says() {
    // Left half of the picture clear: u below one half, where n.x is negative.
    let texels = vec![[1.0, 1.0, 1.0, 0.0], [1.0; 4]];
    let texture =
        Some((TextureMap { smooth: false, ..TextureMap::new(bottega_scene::ImageId(0)) }, bottega_scene::Channel::A));
    let mut scene = Scene {
        images: vec![bottega_scene::Image::from_linear_rgba("half", 2, 1, texels)].into(),
        materials: vec![Material {
            opacity: ScalarParam { factor: 1.0, texture },
            alpha_mode: bottega_scene::AlphaMode::Blend,
            ..Material::default()
        }],
        ..Scene::default()
    };
    scene.push_sphere(Vec3::ZERO, 1.0, 0);
    let prepared = PreparedScene::new(Arc::new(scene), &PrepareOptions::default()).unwrap();
    for (x, is_met) in [(-0.5, false), (0.5, true)] {
        // Longer than a unit, as shadow rays are.
        let ray = Ray::new(Vec3::new(x, 0.0, 3.0), 2.0 * Vec3::NEG_Z);
        let hit = prepared
            .accel()
            .intersect_filtered(&ray, |hit| is_there(&prepared, &ray, 0.0, hit, SurfaceQuery::Path, |_| 0.5));
        assert_eq!(hit.is_some(), is_met, "{x}");
    }
}

#[test]
fn the_camera_sees_through_backs_and_nothing_else_does() {
    for culls_back in [false, true] {
        let mut scene = Scene { materials: vec![Material { culls_back, ..Material::default() }], ..Scene::default() };
        scene.push_surface(bottega_scene::Mesh::quad(Vec3::ZERO, Vec3::X, Vec3::Y));
        scene.push_sphere(Vec3::X * 10.0, 1.0, 0);
        // The same, its front where the back was.
        let mirrored = glam::Affine3A::from_scale_rotation_translation(
            Vec3::new(1.0, 1.0, -1.0),
            glam::Quat::IDENTITY,
            Vec3::X * 20.0,
        );
        scene.push_instance(0, mirrored);
        let prepared = PreparedScene::new(Arc::new(scene), &PrepareOptions::default()).unwrap();
        assert_eq!(prepared.has_opacity(), culls_back);
        for (origin, direction, is_back) in [
            (Vec3::new(0.3, 0.2, 1.0), Vec3::NEG_Z, false),
            (Vec3::new(0.3, 0.2, -1.0), Vec3::Z, true),
            (Vec3::new(20.3, 0.2, 1.0), Vec3::NEG_Z, true),
            (Vec3::new(20.3, 0.2, -1.0), Vec3::Z, false),
            (Vec3::new(10.0, 0.0, 0.5), Vec3::Z, true),
        ] {
            let ray = Ray::new(origin, direction);
            for (asks, passes) in [
                (SurfaceQuery::Path.of_vertex(0), culls_back && is_back),
                (SurfaceQuery::Path.of_vertex(1), false),
                (SurfaceQuery::Shadow, false),
            ] {
                let hit =
                    prepared.accel().intersect_filtered(&ray, |hit| is_there(&prepared, &ray, 0.0, hit, asks, |_| 0.5));
                assert_eq!(hit.is_none(), passes, "{origin} {asks:?} {culls_back}");
            }
        }
    }
}

#[test]
fn the_coat_keeps_the_smooth_normal_where_it_has_no_map_of_its_own() {
    let point = normal_mapped([0.8, 0.5, 0.9]);
    assert!((point.to_world(point.coat_normal) - Vec3::Z).length() < 1e-5);
}

#[test]
fn a_lookup_is_as_wide_as_the_beam() {
    let point = normal_mapped([0.5, 0.5, 1.0]);
    assert!((point.footprint - 0.25).abs() < 1e-5 && (point.uvs[0] - Vec2::new(0.7, 0.6)).length() < 1e-5);
}

#[test]
fn a_ray_that_leaves_a_surface_does_not_meet_it_again() {
    let mut met = 0;
    for i in 0..2000 {
        let mut next = numbers(i);
        let size = 10_f32.powf(4.0 * next() - 2.0);
        let middle = uniform_sphere([next(), next()]) * size * 10_f32.powf(4.0 * next() - 3.0);
        let mut corner = || middle + uniform_sphere([next(), next()]) * size;
        let mesh =
            Mesh { positions: vec![corner(), corner(), corner()], triangles: vec![[0, 1, 2]], ..Mesh::default() };
        let turn = glam::Quat::from_rotation_y(next());
        let scale = Vec3::new(0.5 + next(), 0.5 + next(), 2.0);
        let scene = Scene {
            instances: vec![Instance::new(
                0,
                Affine3A::from_scale_rotation_translation(scale, turn, Vec3::splat(next())),
            )],
            meshes: vec![mesh].into(),
            materials: vec![Material::default()],
            ..Scene::default()
        };
        let prepared = PreparedScene::new(Arc::new(scene), &PrepareOptions::default()).unwrap();
        let place = prepared.scene().instances[0].world_from_object;
        for _ in 0..4 {
            let (u, v) = crate::sampling::uniform_triangle([next(), next()]);
            let [a, b, c] = [0, 1, 2].map(|k| place.transform_point3(prepared.scene().meshes[0].positions[k]));
            let target = a * (1.0 - u - v) + b * u + c * v;
            let eye = target + uniform_sphere([next(), next()]) * size * 3.0 * next();
            let direction = (target - eye).normalize_or(Vec3::X);
            let hit = prepared.accel().intersect(&Ray::new(eye, direction));
            if hit.is_none() {
                continue;
            }
            let point = Interaction::new(&prepared, &hit, eye, direction, RayCone::default());
            for _ in 0..16 {
                let wi = uniform_sphere([next(), next()]);
                let ray = Ray::new(point.ray_origin(wi), wi);
                met += u32::from(prepared.accel().intersect(&ray).is_some());
            }
        }
    }
    assert_eq!(met, 0);
}
