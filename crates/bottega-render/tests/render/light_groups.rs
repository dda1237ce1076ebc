//! Light kept apart by groups of lights.

use std::sync::Arc;

use bottega_image::{AovSet, Combine, Layer, Layout, Rect, Tile};
use bottega_render::{
    BlockWork, DirectLight, LightFinder, LightGroups, PathKind, PathSettings, PrepareOptions, PreparedScene,
};
use bottega_scene::{Environment, Light, LightKind, Medium, Scene, Visibility};
use glam::Vec3;

use crate::render::{
    media::smoke,
    scenes::{Subject, add_sphere, color, cornell, lamp, paint, prepare},
};

const SIZE: (u32, u32) = (16, 12);
/// The groups of the tests, each named like its light.
const GROUPS: [&str; 5] = ["bulb", "environment", "lamp", "sphere*", "sun"];

/// Cornell's box without its front wall, lit by one light of each kind.
fn many_lights() -> Scene {
    let mut scene = cornell();
    let panel = scene.meshes.len() - 1;
    scene.meshes[panel].name = "lamp".into();
    add_sphere(&mut scene, Vec3::new(-0.6, 0.5, 0.5), 0.1, lamp(Vec3::new(2.0, 6.0, 9.0)));
    let light = |name: &str, kind| Light { name: name.into(), kind, visibility: Visibility::ALL, motion: Vec::new() };
    let intensity = Vec3::new(0.4, 0.2, 0.6);
    scene.lights.push(light("bulb", LightKind::Point { position: Vec3::new(0.5, 0.3, 0.8), intensity }));
    let (direction, irradiance) = (Vec3::new(0.2, -0.4, -1.0).normalize(), Vec3::new(1.5, 1.2, 0.5));
    scene.lights.push(light("sun", LightKind::Directional { direction, irradiance, angle: 0.1 }));
    scene.environment = Some(Environment::uniform(Vec3::new(0.1, 0.2, 0.4)));
    scene
}

/// The scene with the lights of one group alone.
fn alone(scene: &Scene, group: &str) -> Scene {
    let mut scene = scene.clone();
    scene.lights.retain(|light| light.name == group);
    if group != "environment" {
        scene.environment = None;
    }
    let is_dark = |name: &str| name != group;
    let panels: Vec<u32> = scene.meshes.iter().filter(|mesh| &*mesh.name == "lamp").map(|mesh| mesh.material).collect();
    for material in panels.into_iter().filter(|_| is_dark("lamp")) {
        scene.materials[material as usize].emission = Vec3::ZERO.into();
    }
    for index in scene.spheres.iter().map(|sphere| sphere.material as usize).filter(|_| is_dark("sphere*")) {
        scene.materials[index].emission = Vec3::ZERO.into();
    }
    scene
}

/// The groups of a scene, one for each of [`GROUPS`].
fn groups(scene: &PreparedScene) -> LightGroups {
    LightGroups::new(scene, GROUPS.len(), |names| {
        let is_of = |group: &str| match group.strip_suffix('*') {
            Some(start) => names.iter().any(|name| name.starts_with(start)),
            None => names.contains(&group),
        };
        GROUPS.iter().zip(0..).map(|(group, bit)| u16::from(is_of(group)) << bit).sum()
    })
}

/// Renders a picture with a layer for each group.
fn paint_groups(scene: &Subject, spp: u32, settings: PathSettings) -> Tile {
    let layer = |name: &&str| Layer {
        name: (*name).to_owned(),
        channels: ["R", "G", "B"].map(str::to_owned).to_vec(),
        combine: Combine::Mean,
    };
    let layout = Layout::with_layers(AovSet::NONE, GROUPS.iter().map(layer).collect()).expect("a layout");
    let (width, height) = SIZE;
    let tile = Tile::new(Rect::of_size(width, height), layout);
    let light_groups = Some(Arc::new(groups(&scene.scene)));
    let work = BlockWork { light_groups, ..scene.block(&scene.view(SIZE), settings, tile, 0..spp) };
    work.perform().expect("a picture").tile
}

/// Mean of each group at a pixel.
fn of_groups(tile: &Tile, x: u32, y: u32) -> [Vec3; GROUPS.len()] {
    let sums = tile.pixel(x, y);
    let mut places = tile.layout().placed_layers().map(|(place, _)| place);
    GROUPS.map(|_| {
        let place = places.next().expect("a layer");
        Vec3::from_slice(&sums[place..place + 3]) / sums[Layout::SAMPLE_COUNT]
    })
}

/// Scenes whose paths are traced side by side, and through a medium.
fn subjects() -> [(&'static str, Scene); 2] {
    let medium = Medium { scattering: Vec3::splat(0.4), g: 0.3, ..Medium::absorbing(Vec3::splat(0.1)) };
    let mut smoky = smoke(medium);
    let lights = many_lights();
    smoky.lights.extend(lights.lights);
    smoky.environment = lights.environment;
    let panel = smoky.meshes.len() - 1;
    smoky.meshes[panel].name = "lamp".into();
    [("box", many_lights()), ("smoke", smoky)]
}

#[test]
fn groups_sum_to_the_picture_and_change_nothing_in_it() {
    for (name, scene) in subjects() {
        let scene = prepare(scene);
        for settings in [PathSettings::default(), PathSettings { sample_max: 0.4, ..PathSettings::default() }] {
            let (tile, plain) = (paint_groups(&scene, 8, settings), paint(&scene, SIZE, 8, settings));
            for (x, y) in tile.rect().pixels() {
                assert_eq!(tile.pixel(x, y)[..6], *plain.pixel(x, y), "{name} {x} {y}");
                let (parts, whole) = (of_groups(&tile, x, y), color(&tile, x, y));
                let others = whole - parts.iter().sum::<Vec3>();
                assert!(others.abs().max_element() <= 2e-5 * whole.max_element().max(1.0), "{name}: {parts:?} {whole}");
            }
        }
    }
}

#[test]
fn a_group_is_the_picture_of_its_lights_alone() {
    const SPP: u32 = 512;
    let settings = PathSettings { max_depth: 4, ..PathSettings::default() };
    let mean = |tile: &Tile, of: &dyn Fn(u32, u32) -> Vec3| {
        tile.rect().pixels().map(|(x, y)| of(x, y)).sum::<Vec3>() / tile.rect().area() as f32
    };
    for (name, scene) in subjects() {
        let tile = paint_groups(&prepare(scene.clone()), SPP, settings);
        for (number, group) in GROUPS.into_iter().enumerate() {
            let subject = prepare(alone(&scene, group));
            let single = paint(&subject, SIZE, SPP, settings);
            let found = mean(&tile, &|x, y| of_groups(&tile, x, y)[number]);
            let expected = mean(&single, &|x, y| color(&single, x, y));
            assert!(expected.max_element() > 1e-3, "{name} {group}: {expected}");
            let error = (found - expected).abs().max_element();
            assert!(error <= 0.03 * expected.max_element() + 1e-6, "{name} {group}: {found} instead of {expected}");
        }
    }
}

/// Mean light over the picture by kind of path, and of all light.
fn by_path(scene: &Subject, settings: PathSettings) -> (Vec<Vec3>, Vec3) {
    let layer = |kind: usize| Layer {
        name: format!("kind{kind:02}"),
        channels: ["R", "G", "B"].map(str::to_owned).to_vec(),
        combine: Combine::Mean,
    };
    let layers = (0..PathKind::ALL.len()).map(layer).collect();
    let tile = Tile::new(Rect::of_size(SIZE.0, SIZE.1), Layout::with_layers(AovSet::NONE, layers).expect("a layout"));
    let light_groups = Some(Arc::new(LightGroups::by_path()));
    let work = BlockWork { light_groups, ..scene.block(&scene.view(SIZE), settings, tile, 0..16) };
    let tile = work.perform().expect("a picture").tile;
    let sum = |place: usize| {
        let of_pixel =
            |(x, y)| Vec3::from_slice(&tile.pixel(x, y)[place..place + 3]) / tile.pixel(x, y)[Layout::SAMPLE_COUNT];
        tile.rect().pixels().map(of_pixel).sum::<Vec3>() / tile.rect().area() as f32
    };
    let kinds = tile.layout().placed_layers().map(|(place, _)| sum(place)).collect();
    (kinds, sum(Layout::COLOR))
}

#[test]
fn kinds_of_paths_sum_to_the_picture_and_each_has_its_own_light() {
    for (name, scene) in subjects() {
        let scene = prepare(scene);
        let (kinds, whole) = by_path(&scene, PathSettings::default());
        let error = (kinds.iter().sum::<Vec3>() - whole).abs().max_element();
        assert!(error <= 1e-4 * whole.max_element(), "{name}: {kinds:?} instead of {whole}");
        // Direct light has at most one bounce
        let light = |settings: PathSettings, is_of: &dyn Fn(&PathKind) -> bool| {
            let (kinds, _) = by_path(&scene, settings);
            PathKind::ALL
                .iter()
                .zip(kinds)
                .filter(|(kind, _)| is_of(kind))
                .map(|(_, light)| light.max_element())
                .sum::<f32>()
        };
        let direct =
            PathSettings { max_depth: 1, guiding: false, agents: Default::default(), ..PathSettings::default() };
        assert_eq!(light(direct, &|kind| kind.bounces > 1), 0.0, "{name}");
        assert!(light(direct, &|kind| kind.bounces == 1 && kind.finder == LightFinder::Sample) > 0.0, "{name}");
        // Without light samples, rays find everything
        let rays = PathSettings { direct_light: DirectLight::BsdfSampling, ..direct };
        assert_eq!(light(rays, &|kind| kind.finder == LightFinder::Sample), 0.0, "{name}");
    }
}

#[test]
fn groups_have_the_same_bits_in_parts() {
    let scene =
        Subject::new(PreparedScene::new(Arc::new(many_lights()), &PrepareOptions::default()).expect("a sound scene"));
    let whole = paint_groups(&scene, 6, PathSettings::default());
    let first = paint_groups(&scene, 2, PathSettings::default());
    let light_groups = Some(Arc::new(groups(&scene.scene)));
    let work = BlockWork { light_groups, ..scene.block(&scene.view(SIZE), PathSettings::default(), first, 2..6) };
    assert_eq!(work.perform().expect("a picture").tile.sums(), whole.sums());
}
