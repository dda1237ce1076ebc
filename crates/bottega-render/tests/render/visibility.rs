//! Visibility by kind of ray.

use bottega_render::{DirectLight, PathSettings};
use bottega_scene::{
    Conductor, Environment, Facets, Image, ImageId, InnerReflection, Light, LightKind, Material, Medium, Plastic,
    Scene, Surface, Visibility,
};
use glam::{Mat3, Vec3};

use crate::render::{
    known_answers::{assert_near, floor, irradiance},
    scenes::{add_quad, add_sphere, camera, color, matte, paint, prepare},
};

/// Adds a black screen 1 above the floor, over the origin, that exists for these rays only.
fn add_screen(scene: &mut Scene, visibility: Visibility) {
    add_quad(scene, Vec3::new(-1.0, 1.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, matte(Vec3::ZERO));
    scene.instances.last_mut().expect("an instance").visibility = visibility;
}

fn add_point(scene: &mut Scene, visibility: Visibility) {
    let kind = LightKind::Point { position: Vec3::new(0.0, 3.0, 0.0), intensity: Vec3::splat(9.0) };
    scene.lights.push(Light { visibility, ..Light::new("", kind) });
}

#[test]
fn a_screen_hides_from_the_camera_or_casts_no_shadow() {
    let lit = |visibility: Visibility| {
        let mut scene = floor();
        add_screen(&mut scene, visibility);
        add_point(&mut scene, Visibility::ALL);
        irradiance(scene, DirectLight::Combined)
    };
    // The camera looks straight down on it
    assert_eq!(lit(Visibility::ALL), 0.0);
    assert_eq!(lit(Visibility::ALL.without(Visibility::CAMERA)), 0.0);
    assert_eq!(lit(Visibility::ALL.without(Visibility::SHADOW)), 0.0);
    assert_near(lit(Visibility::BOUNCES), 1.0, 1e-3);
    assert_near(lit(Visibility::DIFFUSE), 1.0, 1e-3);
    assert_near(lit(Visibility::NONE), 1.0, 1e-3);
}

/// Surfaces with a diffuse lobe, with a glossy one, and with both.
fn surfaces() -> [Surface; 3] {
    let facets = Facets::from(0.2);
    let (black, white) = (Vec3::ZERO.into(), Vec3::ONE.into());
    let metal = Conductor { eta: Vec3::ZERO.into(), k: black, reflectance: white, facets: facets.clone() };
    let plastic = Plastic {
        eta: 1.5,
        diffuse: Vec3::splat(0.4).into(),
        specular: Vec3::ONE.into(),
        inner: InnerReflection::Linear,
        facets,
    };
    [Surface::matte(Vec3::splat(0.5)), Surface::Conductor(metal), Surface::Plastic(plastic)]
}

/// The radiance of the floor at the origin below a lamp and a point light of this visibility.
fn seen(surface: &Surface, visibility: Visibility, direct_light: DirectLight) -> f32 {
    let mut scene = floor();
    scene.cameras[0] = camera(Vec3::new(-2.0, 1.5, 0.0), Vec3::ZERO, 0.001);
    scene.materials[0] = surface.clone().into();
    add_quad(&mut scene, Vec3::new(0.5, 1.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, Material::emitter(Vec3::splat(2.0)));
    scene.instances.last_mut().expect("an instance").visibility = visibility;
    if direct_light != DirectLight::BsdfSampling {
        let kind = LightKind::Point { position: Vec3::new(2.0, 2.0, 1.0), intensity: Vec3::splat(3.0) };
        scene.lights.push(Light { visibility, ..Light::new("", kind) });
    }
    let settings = PathSettings { max_depth: 1, direct_light, ..PathSettings::default() };
    color(&paint(&prepare(scene), (1, 1), 16384, settings), 0, 0).x
}

#[test]
fn lobes_find_the_lamps_that_are_there_for_them() {
    let all = Visibility::ALL;
    for (surface, name) in surfaces().iter().zip(["matte", "metal", "plastic"]) {
        for direct_light in [DirectLight::Combined, DirectLight::LightSampling, DirectLight::BsdfSampling] {
            let found = |visibility| seen(surface, visibility, direct_light);
            let (both, none) = (found(all), found(all.without(Visibility::BOUNCES)));
            let (diffuse, glossy) = (found(all.without(Visibility::GLOSSY)), found(all.without(Visibility::DIFFUSE)));
            assert_eq!(none, 0.0, "{name}");
            let tolerance = 0.03 * both;
            assert!((diffuse + glossy - both).abs() < tolerance, "{name} {direct_light:?}: {diffuse} {glossy} {both}");
            match name {
                "matte" => assert!(glossy == 0.0 && diffuse > 0.0),
                "metal" => assert!(diffuse == 0.0 && glossy > 0.0),
                _ => assert!(diffuse > 0.1 * both && glossy > 0.1 * both, "{diffuse} {glossy} {both}"),
            }
        }
        // All strategies agree on the share of each lobe
        let diffuse = |strategy| {
            let lamps_alone = all.without(Visibility::GLOSSY);
            let mut scene = floor();
            scene.cameras[0] = camera(Vec3::new(-2.0, 1.5, 0.0), Vec3::ZERO, 0.001);
            scene.materials[0] = surface.clone().into();
            add_quad(&mut scene, Vec3::new(0.5, 1.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, Material::emitter(Vec3::ONE));
            scene.instances.last_mut().expect("an instance").visibility = lamps_alone;
            let settings = PathSettings { max_depth: 1, direct_light: strategy, ..PathSettings::default() };
            color(&paint(&prepare(scene), (1, 1), 16384, settings), 0, 0).x
        };
        let [a, b, c] = [DirectLight::Combined, DirectLight::LightSampling, DirectLight::BsdfSampling].map(diffuse);
        assert!((a - b).abs() <= 0.03 * a && (a - c).abs() <= 0.04 * a, "{name}: {a} {b} {c}");
    }
}

#[test]
fn a_mirror_does_not_show_objects_hidden_from_glossy_rays() {
    let facets = Facets::default();
    let mirror = Conductor { eta: Vec3::ZERO.into(), k: Vec3::ZERO.into(), reflectance: Vec3::ONE.into(), facets };
    let shown = |visibility: Visibility| {
        let mut scene = floor();
        scene.cameras[0] = camera(Vec3::new(-2.0, 2.0, 0.0), Vec3::ZERO, 0.001);
        scene.materials[0] = Surface::Conductor(mirror.clone()).into();
        add_sphere(&mut scene, Vec3::new(2.0, 2.0, 0.0), 0.5, Material::emitter(Vec3::splat(2.0)));
        scene.spheres[0].visibility = visibility;
        color(&paint(&prepare(scene), (1, 1), 16, PathSettings::default()), 0, 0).x
    };
    assert_eq!(shown(Visibility::ALL), 2.0);
    assert_eq!(shown(Visibility::GLOSSY), 2.0);
    assert_eq!(shown(Visibility::ALL.without(Visibility::GLOSSY)), 0.0);
    assert_eq!(shown(Visibility::ALL.without(Visibility::CAMERA)), 2.0);
}

#[test]
fn a_medium_scatters_the_lights_that_are_there_for_it() {
    let glow = |visibility: Visibility| {
        let mut scene = Scene { cameras: vec![camera(Vec3::Z * 4.0, Vec3::ZERO, 0.001)], ..Scene::default() };
        let scattering = Vec3::splat(0.3);
        scene.media.push(Medium { scattering, ..Medium::absorbing(Vec3::ZERO) });
        let boundary = Material { interior: Some(bottega_scene::MediumId(0)), ..Surface::Null.into() };
        add_sphere(&mut scene, Vec3::ZERO, 1.0, boundary);
        add_point(&mut scene, visibility);
        let settings = PathSettings { max_depth: 1, ..PathSettings::default() };
        color(&paint(&prepare(scene), (1, 1), 256, settings), 0, 0).x
    };
    assert!(glow(Visibility::ALL) > 1e-3);
    assert!((glow(Visibility::VOLUME) / glow(Visibility::ALL) - 1.0).abs() < 1e-4);
    assert_eq!(glow(Visibility::ALL.without(Visibility::VOLUME)), 0.0);
}

#[test]
fn the_environment_is_there_for_some_kinds_of_ray() {
    // A mirror and a matte floor below a sky with a bright and a dark half; the third camera looks at the sky.
    let shown = |visibility: Visibility| {
        let facets = Facets::default();
        let mirror = Conductor { eta: Vec3::ZERO.into(), k: Vec3::ZERO.into(), reflectance: Vec3::ONE.into(), facets };
        [Surface::Conductor(mirror), Surface::matte(Vec3::ONE), Surface::matte(Vec3::ONE)].into_iter().enumerate().map(
            move |(index, surface)| {
                let mut scene = floor();
                let at = if index == 2 { Vec3::new(-4.0, 4.0, 0.0) } else { Vec3::ZERO };
                scene.cameras[0] = camera(Vec3::new(-2.0, 2.0, 0.0), at, 0.001);
                scene.materials[0] = surface.into();
                let texels = (0..8 * 4).map(|i| [if i % 8 < 4 { 1.0 } else { 3.0 }; 3]).collect();
                scene.images.push(Image::from_linear_rgb("sky".to_owned(), 8, 4, texels));
                let sky = Environment::picture(ImageId(0), Vec3::ONE, Mat3::IDENTITY);
                scene.environment = Some(Environment { visibility, ..sky });
                color(&paint(&prepare(scene), (1, 1), 4096, PathSettings::default()), 0, 0).x
            },
        )
    };
    let [mirrored, matte, seen] = shown(Visibility::ALL).collect::<Vec<_>>()[..] else { panic!("three") };
    assert!(mirrored > 0.9 && matte > 0.9 && seen > 0.9, "{mirrored} {matte} {seen}");
    for (hidden, expected) in [
        (Visibility::CAMERA, [mirrored, matte, 0.0]),
        (Visibility::GLOSSY, [0.0, matte, seen]),
        (Visibility::DIFFUSE, [mirrored, 0.0, seen]),
        (Visibility::BOUNCES, [0.0, 0.0, seen]),
    ] {
        let found: Vec<f32> = shown(Visibility::ALL.without(hidden)).collect();
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() <= 0.03 * expected, "without {hidden:?}: {found} for {expected}");
        }
    }
}
