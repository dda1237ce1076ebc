//! The Analyst's survey.

use bottega_hra::{Hra, HraConfig, VirtualCpu};
use bottega_render::{
    RenderError, RenderWork, View,
    survey::{Survey, survey},
};
use bottega_scene::Scene;
use glam::Vec3;

use crate::render::scenes::{Subject, add_quad, add_sphere, camera, cornell, glass, matte, prepare};

/// The survey of a scene with its first camera.
fn surveyed(scene: &Subject, lanes: usize) -> Survey {
    survey(&scene.scene, &scene.view((32, 32)), 8, &allocator(lanes).client()).unwrap()
}

fn allocator(lanes: usize) -> Hra<RenderWork> {
    Hra::new(HraConfig::default(), VirtualCpu::lanes(lanes, RenderWork::perform))
}

#[test]
fn glass_has_levels_of_recursion_and_walls_have_none() {
    let seen = surveyed(&prepare(cornell()), 1);
    assert_eq!((seen.width, seen.height, seen.pixels.len()), (32, 32, 1024));
    let at = |x: usize, y: usize| seen.pixels[y * 32 + x];
    let (glass, wall) = (at(22, 26), at(16, 10));
    assert!(glass.recursion_levels >= 1.5, "{glass:?}");
    assert_eq!(wall.recursion_levels, 0.0);
    assert!(wall.steps > 1.0 && wall.path_length > 1.5 && wall.albedo[0] > 0.5 && wall.depth > 3.0, "{wall:?}");
    assert!(wall.noise > 0.0 && wall.color[0] > 0.0);
}

#[test]
fn between_two_mirrors_the_levels_end() {
    let mut scene = Scene { cameras: vec![camera(Vec3::ZERO, Vec3::new(0.02, 0.01, -1.0), 0.3)], ..Scene::default() };
    let mirror: bottega_scene::Material =
        bottega_scene::Layered { metallic: 1.0.into(), roughness: 0.0.into(), ..Default::default() }.into();
    add_quad(&mut scene, Vec3::new(-50.0, -50.0, -1.0), Vec3::X * 100.0, Vec3::Y * 100.0, mirror.clone());
    add_quad(&mut scene, Vec3::new(-50.0, -50.0, 1.0), Vec3::Y * 100.0, Vec3::X * 100.0, mirror);
    let seen = surveyed(&prepare(scene), 1);
    assert_eq!(seen.pixels[16 * 32 + 16].recursion_levels, 16.0);
}

#[test]
fn it_does_not_depend_on_the_number_of_lanes() {
    let scene = prepare(cornell());
    let (one, three) = (surveyed(&scene, 1), surveyed(&scene, 3));
    assert_eq!(one, three);
}

#[test]
fn a_view_that_is_not_there_is_an_error_and_leaves_nothing_behind() {
    let mut scene = Scene { cameras: vec![camera(Vec3::Z, Vec3::ZERO, 1.0)], ..Scene::default() };
    add_sphere(&mut scene, Vec3::ZERO, 0.2, glass());
    add_sphere(&mut scene, Vec3::X, 0.2, matte(Vec3::ONE));
    let hra = allocator(1);
    let client = hra.client();
    let scene = prepare(scene);
    let absent = View::of_scene(scene.scene.scene(), 3, 32, 32);
    assert!(matches!(absent, Err(RenderError::NoCamera { index: 3, count: 1 })));
    let result = survey(&scene.scene, &scene.view((0, 32)), 8, &client);
    assert!(matches!(result, Err(RenderError::Refused(_) | RenderError::EmptyPicture { .. })));
    assert_eq!(client.outstanding(), 0);
}
