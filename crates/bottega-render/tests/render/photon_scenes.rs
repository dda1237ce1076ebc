//! Test scenes of photon mapping, their references, and the comparison of two means.

use std::sync::OnceLock;

use bottega_render::{PathSettings, PhotonSettings};
use bottega_scene::{AlphaMode, Environment, Layered, Light, LightKind, Material, Medium, Scene, Surface};
use glam::Vec3;

use crate::render::scenes::{
    Subject, add_quad, add_room, add_sphere, camera, cornell, glass, lamp, matte, mean_color, paint, prepare,
};

pub(crate) const SIZE: (u32, u32) = (24, 24);

pub(crate) fn by_photons(photons: PhotonSettings, seed: u64, samples: u32) -> PathSettings {
    PathSettings { photons: Some(photons), planned_samples: samples, seed, guiding: false, ..PathSettings::default() }
}

pub(crate) fn few() -> PhotonSettings {
    PhotonSettings { count: 20_000, ..PhotonSettings::default() }
}

/// Mean of pictures of several seeds, and the square of its standard error, by channel.
pub(crate) fn mean_of_seeds(scene: &Subject, samples: u32, settings: impl Fn(u64) -> PathSettings) -> (Vec3, Vec3) {
    let means: Vec<Vec3> = (0..6).map(|seed| mean_color(&paint(scene, SIZE, samples, settings(seed)))).collect();
    let mean = means.iter().sum::<Vec3>() / 6.0;
    (mean, means.iter().map(|it| (*it - mean) * (*it - mean)).sum::<Vec3>() / 30.0)
}

/// A scene that several tests render, and its light by path tracing.
pub(crate) struct KnownScene {
    pub(crate) scene: Subject,
    by_paths: OnceLock<(Vec3, Vec3)>,
}

impl KnownScene {
    pub(crate) fn new(scene: Scene) -> Self {
        Self { scene: prepare(scene), by_paths: OnceLock::new() }
    }

    /// Mean of the scene's pictures by paths, and the square of the standard error. They are rendered once.
    pub(crate) fn by_paths(&self) -> (Vec3, Vec3) {
        *self.by_paths.get_or_init(|| by_paths(&self.scene))
    }
}

/// Cornell's room, prepared once for all tests.
pub(crate) fn cornell_known() -> &'static KnownScene {
    static KNOWN: OnceLock<KnownScene> = OnceLock::new();
    KNOWN.get_or_init(|| KnownScene::new(cornell()))
}

/// The room of [`many_things`], prepared once for all tests.
pub(crate) fn many_things_known() -> &'static KnownScene {
    static KNOWN: OnceLock<KnownScene> = OnceLock::new();
    KNOWN.get_or_init(|| KnownScene::new(many_things()))
}

/// The glass ball below a sky, prepared once for all tests.
pub(crate) fn sky_known() -> &'static KnownScene {
    static KNOWN: OnceLock<KnownScene> = OnceLock::new();
    KNOWN.get_or_init(|| KnownScene::new(outside(false)))
}

pub(crate) fn by_paths(scene: &Subject) -> (Vec3, Vec3) {
    mean_of_seeds(scene, 512, |seed| PathSettings { seed: seed + 100, guiding: false, ..PathSettings::default() })
}

/// The distance of two means beyond a share of the mean, in standard errors.
pub(crate) fn distance(a: (Vec3, Vec3), b: (Vec3, Vec3), margin: f32) -> f32 {
    let beyond = ((a.0 - b.0).abs() - b.0 * margin).max(Vec3::ZERO);
    (beyond / (a.1 + b.1).map(f32::sqrt).max(Vec3::splat(1e-9))).max_element()
}

pub(crate) fn mirror() -> Material {
    let metal = Layered {
        metallic: 1.0.into(),
        roughness: 0.0.into(),
        base_color: Vec3::splat(0.9).into(),
        ..Layered::default()
    };
    metal.into()
}

/// A room with mirrors, frosted and clear glass, a matte sheet that transmits light, and lights of several kinds.
pub(crate) fn many_things() -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.2, 3.6), Vec3::ZERO, 0.7)], ..Scene::default() };
    add_room(&mut scene, Vec3::new(1.2, 1.0, 4.0), &matte(Vec3::new(0.6, 0.5, 0.4)));
    add_sphere(&mut scene, Vec3::new(-0.5, -0.6, -0.4), 0.4, mirror());
    let tinted = scene.push_medium(Medium::absorbing(Vec3::new(0.2, 1.0, 2.0)));
    add_sphere(&mut scene, Vec3::new(0.5, -0.6, 0.2), 0.35, Material { interior: Some(tinted), ..glass() });
    let frosted = Layered { roughness: 0.5.into(), transmission: 1.0.into(), ..Layered::default() };
    add_sphere(&mut scene, Vec3::new(0.1, 0.2, -0.6), 0.3, frosted.into());
    let shiny = Layered { base_color: Vec3::new(0.2, 0.5, 0.2).into(), roughness: 0.3.into(), ..Layered::default() };
    add_sphere(&mut scene, Vec3::new(-0.7, 0.3, 0.3), 0.25, shiny.into());
    let sheet =
        Surface::DiffuseTransmission { reflectance: Vec3::splat(0.3).into(), transmittance: Vec3::splat(0.5).into() };
    add_quad(&mut scene, Vec3::new(0.4, -0.2, 0.4), Vec3::X * 0.5, Vec3::new(0.0, 0.4, -0.2), sheet.into());
    let veil = Material { alpha_mode: AlphaMode::Blend, opacity: 0.4.into(), ..matte(Vec3::splat(0.5)) };
    add_quad(&mut scene, Vec3::new(-0.4, 0.5, 0.2), Vec3::X * 0.5, Vec3::Z * 0.4, veil);
    add_quad(
        &mut scene,
        Vec3::new(-0.2, 0.99, -0.2),
        Vec3::X * 0.4,
        Vec3::Z * 0.4,
        Material::emitter(Vec3::splat(5.0)),
    );
    add_sphere(&mut scene, Vec3::new(0.9, 0.7, -0.3), 0.08, lamp(Vec3::new(10.0, 5.0, 2.0)));
    scene
}

/// A scene below a sky: with a glass ball, or with a sun and a lamp without extent, whose light paths cannot find through glass.
pub(crate) fn outside(has_sun: bool) -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 1.0, 3.6), Vec3::ZERO, 0.7)], ..Scene::default() };
    add_quad(&mut scene, Vec3::new(-1.5, -0.5, -1.5), Vec3::Z * 3.0, Vec3::X * 3.0, matte(Vec3::splat(0.6)));
    add_sphere(&mut scene, Vec3::new(0.4, 0.0, 0.0), 0.45, if has_sun { matte(Vec3::splat(0.8)) } else { glass() });
    add_sphere(&mut scene, Vec3::new(-0.5, -0.1, 0.0), 0.4, matte(Vec3::new(0.7, 0.3, 0.2)));
    scene.environment = Some(Environment::uniform(Vec3::new(0.4, 0.6, 0.9)));
    if has_sun {
        let (direction, irradiance) = (Vec3::new(0.6, -0.8, 0.0), Vec3::new(2.0, 1.8, 1.5));
        let sun = LightKind::Directional { direction, irradiance, angle: 0.0 };
        let lamp = LightKind::Point { position: Vec3::new(-0.9, 0.8, 0.9), intensity: Vec3::new(0.1, 0.2, 0.4) };
        scene.lights.extend([sun, lamp].map(|kind| Light::new("", kind)));
    }
    scene
}

/// A closed room with a lamp below its ceiling and a ball; its back wall may be a mirror.
pub(crate) fn closed_room(has_mirror: bool) -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.0, 0.97), Vec3::ZERO, 1.2)], ..Scene::default() };
    add_room(&mut scene, Vec3::ONE, &matte(Vec3::new(0.7, 0.5, 0.4)));
    if has_mirror {
        add_quad(&mut scene, Vec3::new(-1.0, -1.0, -0.99), Vec3::X * 2.0, Vec3::Y * 2.0, mirror());
    }
    add_quad(
        &mut scene,
        Vec3::new(-0.4, 0.97, -0.4),
        Vec3::X * 0.8,
        Vec3::Z * 0.8,
        Material::emitter(Vec3::splat(4.0)),
    );
    add_sphere(&mut scene, Vec3::new(0.0, -0.5, 0.0), 0.35, matte(Vec3::new(0.7, 0.5, 0.4)));
    scene
}

/// Rooms without light, with black light, with a light and a lamp inside closed objects, of mirrors alone; only a sky; Cornell's room.
/// Each is prepared once, and its trial photons are traced once, for all modes.
pub(crate) fn hard_scenes() -> [Subject; 7] {
    let room = |material: &Material| {
        let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.0, 0.9), Vec3::ZERO, 0.9)], ..Scene::default() };
        add_room(&mut scene, Vec3::ONE, material);
        scene
    };
    let grey = matte(Vec3::splat(0.5));
    let mut black = room(&grey);
    add_sphere(&mut black, Vec3::ZERO, 0.1, lamp(Vec3::ZERO));
    let mut closed = room(&grey);
    add_sphere(&mut closed, Vec3::new(0.5, 0.0, -0.5), 0.2, grey.clone());
    let kind = LightKind::Point { position: Vec3::new(0.5, 0.0, -0.5), intensity: Vec3::ONE };
    closed.lights.push(Light::new("", kind));
    let mut shade = room(&grey);
    add_sphere(&mut shade, Vec3::new(0.5, 0.0, -0.5), 0.2, grey.clone());
    add_sphere(&mut shade, Vec3::new(0.5, 0.0, -0.5), 0.12, lamp(Vec3::ONE));
    let mut mirrors = room(&mirror());
    add_sphere(&mut mirrors, Vec3::new(0.5, 0.0, -0.5), 0.2, lamp(Vec3::ONE));
    let mut nothing = Scene { cameras: room(&grey).cameras, ..Scene::default() };
    nothing.environment = Some(Environment::uniform(Vec3::ONE));
    [room(&grey), black, closed, shade, mirrors, nothing, cornell()].map(prepare)
}
