//! Lamps with a profile of IES: illuminance by the table of the file, for points, spheres and panels.

use std::{f32::consts::PI, path::Path};

use bottega_render::DirectLight;
use bottega_scene::{
    DirectionPicture, EmissionProfile, EnvironmentMapping, IesInterpolation, IesProfile, Image, ImageId, Light,
    LightKind, Material, Scene,
};
use glam::{Mat3, Vec3};

use crate::render::{
    known_answers::{ALL, assert_near, floor, irradiance},
    scenes::{add_quad, add_sphere, camera},
};

/// A lamp of type C that is not symmetric, and dark above 60°.
const LAMP: &str = "IESNA91\nTILT=NONE\n1 -1 1 7 5 1 2 0 0 0 1 1 10\n0 10 20 30 40 50 60\n0 90 180 270 360\n\
    90 80 110 180 200 150 0\n90 85 80 70 60 50 0\n90 70 50 30 20 15 0\n90 95 90 85 150 60 0\n90 80 110 180 200 150 0\n";
/// Height of the lamp above the floor.
const HEIGHT: f32 = 4.0;

/// The shapes of the lamp.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    Point,
    Sphere(f32),
    Panel(f32),
}

/// Returns the profile, and a floor whose origin is seen; the lamp hangs above `place`, its 0° towards +x.
fn lamp(shape: Shape, place: Vec3) -> (IesProfile, Scene) {
    let profile = IesProfile::of_bytes(LAMP.as_bytes(), Path::new("lamp.ies")).unwrap();
    let picture = profile.picture(IesInterpolation::Linear);
    let texels = picture.values.iter().map(|&value| [value; 3]).collect();
    let mut scene = floor();
    scene.cameras[0] = camera(Vec3::new(-3.0, 0.5, 0.0), Vec3::ZERO, 0.001);
    scene.images.push(Image::from_linear_rgb("lamp", picture.width, picture.height, texels));
    let image = ImageId(0);
    // The axis −z of the lamp is −y of the world, and its y is −z
    let hanging = Mat3::from_cols(Vec3::X, Vec3::NEG_Z, Vec3::Y);
    let world_from_light = DirectionPicture::along_axis(hanging);
    let position = place + HEIGHT * Vec3::Y;
    let intensity = Vec3::splat(profile.peak() as f32);
    let emission_profile = EmissionProfile::Picture(DirectionPicture { image, world_from_light });
    let emitter = |area: f32| Material { emission_profile, ..Material::emitter(intensity / area) };
    match shape {
        Shape::Point => {
            let mapping = EnvironmentMapping::LatitudeLongitudeToPoles;
            let kind = LightKind::Goniometric { position, world_from_light, image, mapping, intensity };
            scene.lights.push(Light::new("", kind));
        }
        Shape::Sphere(radius) => add_sphere(&mut scene, position, radius, emitter(PI * radius * radius)),
        Shape::Panel(side) => {
            let corner = position - Vec3::new(0.5 * side, 0.0, 0.5 * side);
            add_quad(&mut scene, corner, Vec3::X * side, Vec3::Z * side, emitter(side * side));
        }
    }
    (profile, scene)
}

#[test]
fn the_illuminance_below_a_lamp_is_that_of_its_table() {
    for shape in [Shape::Point, Shape::Sphere(0.02), Shape::Panel(0.02)] {
        for (vertical, horizontal) in
            [(0.0, 0.0), (30.0, 0.0), (40.0, 90.0), (40.0, 270.0), (25.0, 180.0), (45.0, 40.0)]
        {
            // The origin lies in this direction of the lamp: +x at 0°, −z of the world at 90°
            let (v, h) = (f32::to_radians(vertical), f32::to_radians(horizontal));
            let place = HEIGHT * v.tan() * Vec3::new(-h.cos(), 0.0, h.sin());
            let (profile, scene) = lamp(shape, place);
            let candela = profile.candela(vertical.into(), horizontal.into()) as f32;
            let cosine = v.cos();
            // A panel is seen at the same angle at which its light arrives
            let power = if matches!(shape, Shape::Panel(_)) { 4 } else { 3 };
            let exact = candela * cosine.powi(power) / (HEIGHT * HEIGHT);
            assert_near(irradiance(scene, DirectLight::Combined), exact, 0.02);
        }
        let (_, scene) = lamp(shape, HEIGHT * 1.9 * Vec3::X);
        assert_eq!(irradiance(scene, DirectLight::Combined), 0.0, "{shape:?} is dark beyond 60°");
    }
}

#[test]
fn all_strategies_find_the_light_of_a_large_lamp_with_a_profile() {
    for shape in [Shape::Sphere(1.5), Shape::Panel(3.0)] {
        let found = ALL.map(|direct_light| irradiance(lamp(shape, Vec3::new(1.0, 0.0, 0.5)).1, direct_light));
        assert!(found.iter().all(|it| (it / found[0] - 1.0).abs() < 0.03), "{shape:?}: {found:?}");
    }
}
