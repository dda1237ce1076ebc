//! Tests of photon emission against light sampling.

use std::sync::Arc;

use bottega_scene::{
    DirectionPicture, EmissionProfile, Environment, EnvironmentMapping, Image, ImageId, Light, LightKind, Material,
    Mesh, Portal, Scene, Sides, SpotFalloff, TextureMap,
};
use glam::{Affine3A, Mat3, Vec2, Vec3};

use super::*;
use crate::{
    lights::Receiver,
    prepare::PrepareOptions,
    sampler::{DimensionSet, PixelSampler},
};

/// A sphere in which the fluence is measured.
const MIDDLE: Vec3 = Vec3::new(0.3, -0.2, 0.4);
const RADIUS: f32 = 0.8;

fn quads(index: u32) -> (Quad, Quad) {
    let sampler = PixelSampler::new(31, 0, 0, index);
    (sampler.quad(DimensionSet::CAMERA), sampler.quad(DimensionSet::light(0)))
}

fn add(scene: &mut Scene, mut mesh: Mesh, material: Material) {
    mesh.material = scene.push_material(material);
    scene.push_surface(mesh);
}

/// Two small triangles that give the scene a size, with the sphere well inside.
fn dust() -> Scene {
    let mut scene = Scene::default();
    for place in [Vec3::splat(-3.0), Vec3::splat(3.0)] {
        let positions = vec![place, place + Vec3::X * 1e-3, place + Vec3::Y * 1e-3];
        let mesh = Mesh { positions, triangles: vec![[0, 1, 2]], ..Mesh::default() };
        add(&mut scene, mesh, Material::matte(Vec3::ZERO));
    }
    let texels = |i: u32| if i % 7 < 2 { [4.0, 2.0, 1.0] } else { [0.1; 3] };
    scene.images.push(Image::from_linear_rgb("stripes", 16, 16, (0..256).map(texels).collect()));
    scene
}

fn prepare(scene: Scene) -> PreparedScene {
    let options = PrepareOptions { threads: 1, compensate_environment: false };
    PreparedScene::new(Arc::new(scene), &options).unwrap()
}

fn lit(kind: LightKind) -> Scene {
    let mut scene = dust();
    scene.lights.push(Light::new("", kind));
    scene
}

fn panel(corner: Vec3, x: Vec3, y: Vec3, opposite: Vec3) -> Mesh {
    Mesh {
        positions: vec![corner, corner + x, opposite, corner + y],
        triangles: vec![[0, 1, 2], [2, 3, 0]],
        uvs: [vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], vec![]],
        ..Mesh::default()
    }
}

fn shining(mesh: Mesh, sides: Sides, textured: bool) -> Scene {
    let mut scene = dust();
    let mut material = Material { emission_sides: sides, ..Material::emitter(Vec3::new(3.0, 2.0, 1.0)) };
    if textured {
        material.emission.texture = Some(TextureMap::new(ImageId(0)));
    }
    add(&mut scene, mesh, material);
    scene
}

fn ball(sides: Sides, textured: bool) -> Scene {
    let mut scene = shining(Mesh::default(), sides, textured);
    scene.instances.pop();
    let material = scene.materials.len() as u32 - 1;
    scene.push_sphere(Vec3::new(1.5, 1.5, -0.5), 0.6, material);
    scene
}

/// Gives the last material of a scene another profile.
fn with_profile(mut scene: Scene, profile: EmissionProfile) -> Scene {
    scene.materials.last_mut().unwrap().emission_profile = profile;
    scene
}

/// A profile of stripes.
fn by_stripes() -> EmissionProfile {
    let world_from_light = Mat3::from_rotation_y(0.7);
    EmissionProfile::Picture(DirectionPicture { image: ImageId(0), world_from_light })
}

/// A spot with a radius that points to the middle.
fn spot_ball() -> Scene {
    let axis = (MIDDLE - Vec3::new(1.5, 1.5, -0.5)).normalize();
    let falloff = SpotFalloff::SmoothCosine;
    with_profile(ball(Sides::Front, false), EmissionProfile::Spot { axis, cos_inner: 0.98, cos_outer: 0.9, falloff })
}

fn sky(factor: Vec3, image: Option<ImageId>, portals: Vec<Portal>) -> Scene {
    let mut scene = dust();
    let uniform = Environment::uniform(factor);
    scene.environment =
        Some(Environment { image, portals, world_from_environment: Mat3::from_rotation_x(0.4), ..uniform });
    scene
}

/// Lights of every kind.
fn kinds() -> Vec<(&'static str, Scene)> {
    let position = Vec3::new(1.6, 0.9, -1.1);
    let direction = (MIDDLE - position).normalize();
    let intensity = Vec3::new(5.0, 3.0, 1.0);
    let spot =
        |falloff| lit(LightKind::Spot { position, direction, intensity, cos_inner: 0.9, cos_outer: 0.75, falloff });
    let towards = glam::camera::rh::view::look_at_mat4(position, MIDDLE + 0.3 * Vec3::Y, Vec3::Y).inverse();
    let (x, y) = (Vec3::new(0.9, 0.1, 0.0), Vec3::new(-0.1, 0.9, 0.3));
    let square = panel(position, x, y, position + x + y);
    let tilted = panel(position, x, y, position + x * 1.4 + y * 1.1);
    let portal = Portal { corner: Vec3::new(-1.0, 2.0, 1.2), edges: [2.0 * Vec3::Z, 1.5 * Vec3::X] };
    vec![
        ("point", lit(LightKind::Point { position, intensity })),
        ("spot", spot(SpotFalloff::SmoothCosine)),
        ("spot by the angle", spot(SpotFalloff::LinearAngle)),
        (
            "projector",
            lit(LightKind::Projector {
                world_from_light: Affine3A::from_mat4(towards),
                picture: TextureMap::new(ImageId(0)),
                intensity,
                vertical_fov: 0.6,
                aspect: 1.5,
            }),
        ),
        (
            "goniometric",
            lit(LightKind::Goniometric {
                position,
                world_from_light: Mat3::from_rotation_y(0.7),
                image: ImageId(0),
                mapping: EnvironmentMapping::EqualArea,
                intensity,
            }),
        ),
        (
            "lamp with a profile",
            lit(LightKind::Goniometric {
                position,
                world_from_light: Mat3::from_rotation_y(0.7),
                image: ImageId(0),
                mapping: EnvironmentMapping::LatitudeLongitudeToPoles,
                intensity,
            }),
        ),
        ("directional", lit(LightKind::Directional { direction, irradiance: intensity, angle: 0.0 })),
        ("sun", lit(LightKind::Directional { direction, irradiance: intensity, angle: 0.7 })),
        ("square", shining(square.clone(), Sides::Both, false)),
        ("back of a square", shining(panel(position, y, x, position + x + y), Sides::Back, false)),
        (
            "square with a spread",
            with_profile(shining(square.clone(), Sides::Both, false), EmissionProfile::Spread { half_angle: 1.0 }),
        ),
        ("spot with a radius", spot_ball()),
        ("square with a profile", with_profile(shining(square.clone(), Sides::Both, false), by_stripes())),
        ("sphere with a profile", with_profile(ball(Sides::Front, false), by_stripes())),
        ("front of a square", shining(square.clone(), Sides::Front, false)),
        ("picture on a square", shining(square, Sides::Both, true)),
        ("triangles", shining(tilted.clone(), Sides::Both, false)),
        ("picture on triangles", shining(tilted, Sides::Both, true)),
        ("sphere", ball(Sides::Front, false)),
        ("picture on a sphere", ball(Sides::Front, true)),
        ("uniform sky", sky(Vec3::ONE, None, Vec::new())),
        ("sky", sky(Vec3::ONE, Some(ImageId(0)), Vec::new())),
        ("window", sky(Vec3::ONE, Some(ImageId(0)), vec![portal])),
    ]
}

/// Returns the length of a ray's part within the sphere.
fn chord(emitted: &EmittedPhoton) -> f32 {
    let to_middle = MIDDLE - emitted.origin;
    let along = to_middle.dot(emitted.direction);
    let half = (RADIUS * RADIUS - (to_middle - emitted.direction * along).length_squared()).max(0.0).sqrt();
    ((along + half).max(0.0) - (along - half).max(0.0)).max(0.0)
}

/// Returns the mean, and the variance of the mean.
fn moments(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut count, mut mean, mut squares) = (0.0, 0.0, 0.0);
    for value in values {
        count += 1.0;
        let from_mean = value - mean;
        mean += from_mean / count;
        squares += from_mean * (value - mean);
    }
    (mean, squares / (count * (count - 1.0)))
}

#[test]
fn photons_bring_as_much_light_as_light_sampling_finds() {
    let volume = 4.0 / 3.0 * PI * RADIUS * RADIUS * RADIUS;
    for (name, scene) in kinds() {
        let prepared = prepare(scene);
        let emission = Emission::new(&prepared);
        let whole = Extent::whole(&prepared);
        for extent in [
            whole,
            Extent { center: MIDDLE, radius: 0.15, ..whole },
            Extent { center: Vec3::new(-2.4, 2.2, 1.9), radius: 0.4, ..whole },
        ] {
            let plan = emission.plan(&prepared, extent);
            // The path length of photons per volume is its mean fluence
            let by_photons = moments((0..200_000).map(|i| {
                let (u, v) = quads(i);
                let emitted = emission.emit(&prepared, &plan, u, v);
                emitted.map_or(0.0, |photon| f64::from(luminance(photon.power) * chord(&photon) / volume))
            }));
            let by_lights = moments((0..100_000).map(|i| {
                let sampler = PixelSampler::new(77, 1, 0, i);
                let [a, b, c, _] = sampler.quad(DimensionSet::CAMERA);
                let p = MIDDLE + uniform_sphere([a, b]) * (RADIUS * c.cbrt());
                let receiver = Receiver { p, n: Vec3::ZERO };
                let sample = prepared.lights().sample(&prepared, &receiver, sampler.quad(DimensionSet::light(0)));
                sample.map_or(0.0, |sample| f64::from(luminance(sample.radiance) / sample.pdf.per_sr()))
            }));
            let z = (by_photons.0 - by_lights.0) / (by_photons.1 + by_lights.1).sqrt();
            assert!(by_lights.0 > 0.0 && z.abs() < 4.5, "{name}, {extent:?}: {by_photons:?} {by_lights:?}, z = {z}");
        }
    }
}

#[test]
fn the_mean_power_of_photons_is_that_of_the_lights() {
    let ball = PI * 4.0 * PI * 0.36 * Vec3::new(3.0, 2.0, 1.0);
    // The scene's bounding sphere: its radius is half the diagonal between the small triangles
    let bounds = prepare(dust()).accel().bounds();
    let disc = 0.25 * PI * (bounds.max - bounds.min).length_squared() * 1.001 * 1.001;
    let intensity = Vec3::new(5.0, 3.0, 1.0);
    let expected = [
        ("point", 4.0 * PI * intensity),
        ("directional", disc * intensity),
        ("sphere", ball),
        ("uniform sky", Vec3::splat(4.0 * PI * disc)),
    ];
    for (name, scene) in kinds() {
        let prepared = prepare(scene);
        let emission = Emission::new(&prepared);
        let plan = emission.plan(&prepared, Extent::whole(&prepared));
        let (mut mean, count) = (Vec3::ZERO, 16_384);
        for i in 0..count {
            let (u, v) = quads(i);
            if let Some(photon) = emission.emit(&prepared, &plan, u, v) {
                assert!(photon.direction.is_normalized() && photon.origin.is_finite(), "{name}");
                mean += photon.power / count as f32;
            }
        }
        let Some((_, power)) = expected.iter().find(|(known, _)| *known == name) else { continue };
        assert!((mean / *power - 1.0).abs().max_element() < 0.01, "{name}: {mean} {power}");
    }
}

#[test]
fn lights_emit_as_often_as_they_are_strong() {
    let mut scene = dust();
    for (x, strength) in [(0.0, 1.0), (1.0, 3.0), (2.0, 0.0)] {
        let kind = LightKind::Point { position: Vec3::X * x, intensity: Vec3::splat(strength) };
        scene.lights.push(Light::new("", kind));
    }
    let prepared = prepare(scene);
    let emission = Emission::new(&prepared);
    let plan = emission.plan(&prepared, Extent::whole(&prepared));
    let mut counts = [0; 2];
    for i in 0..4096 {
        let (u, v) = quads(i);
        let photon = emission.emit(&prepared, &plan, u, v).unwrap();
        assert!((photon.power - Vec3::splat(16.0 * PI)).abs().max_element() < 1e-3, "all photons carry the same");
        counts[usize::from(photon.origin.x > 0.5)] += 1;
    }
    // Stratified: nearly exact
    assert!((counts[0] - 1024_i32).abs() <= 1, "{counts:?}");
}

#[test]
fn without_light_there_are_no_photons() {
    let dark = [
        Scene::default(),
        dust(),
        lit(LightKind::Point { position: Vec3::ZERO, intensity: Vec3::ZERO }),
        Scene { environment: Some(Environment::uniform(Vec3::ZERO)), ..dust() },
        // An environment without a scene below it
        Scene { environment: Some(Environment::uniform(Vec3::ONE)), ..Scene::default() },
    ];
    for scene in dark {
        let prepared = prepare(scene);
        let emission = Emission::new(&prepared);
        let plan = emission.plan(&prepared, Extent::whole(&prepared));
        let (u, v) = quads(0);
        assert!(emission.is_empty() && emission.emit(&prepared, &plan, u, v).is_none());
    }
}
