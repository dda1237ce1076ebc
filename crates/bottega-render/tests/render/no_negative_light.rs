//! No sample is negative, with any guide and any integrator: light that is subtracted must have been added before.
//!
//! Every scene is rendered with every guide and by every integrator, with so few samples that nothing can hide a value
//! below zero.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use bottega_image::{AovSet, Layout, Rect, Tile};
use bottega_render::{
    AgentSettings, AgentUse, Filter, Oracle, PathSettings, PhotonFilter, PhotonSettings, PrepareOptions, PreparedScene,
    RenderError,
};
use bottega_scene::{Camera, Environment, Image, ImageId, Layered, LoadOptions, Scene};
use glam::Vec3;

use crate::render::agents::{around_a_corner, lamps};
use crate::render::guiding::behind_a_screen;
use crate::render::lighting_agents::{ball_under_sky, glossy_room, room_with_sphere};
use crate::render::photon_scenes::{many_things, outside};
use crate::render::scenes::{Subject, cornell, matte, room_under_sky};

/// Large enough that there is something to learn from.
const LEARNING_SIDE: u32 = 128;
/// Photons learn nothing about the view.
const SIDE: u32 = 16;
/// Planned samples per pixel, which decide how much paths learn, and rendered samples.
const PLANNED_SAMPLES: u32 = 32;
const SAMPLES: u32 = 2;

/// Files in this repository, from its root.
const OWN: [&str; 13] = [
    "scenes/clear-coat-test.glb",
    "scenes/cornell-box.glb",
    "scenes/goblets.glb",
    "engines/tests/scenes/room.xml",
    "crates/bottega-cli/tests/scenes/diffuse-box.glb",
    "crates/bottega-scene/tests/gltf/data/draco.glb",
    "crates/bottega-scene/tests/pbrt/box.pbrt",
    "crates/bottega-scene/tests/pbrt/smoke.pbrt",
    "crates/bottega-render/tests/pictures/scenes/colored-smoke.xml",
    "crates/bottega-render/tests/pictures/scenes/curves.xml",
    "crates/bottega-render/tests/pictures/scenes/relief.xml",
    "crates/bottega-render/tests/pictures/scenes/smoke.pbrt",
    "crates/bottega-render/tests/pictures/scenes/smoke.xml",
];

/// Files below the folder that `BOTTEGA_SCENES` names. Cornell's box occurs a second time with the materials of Mitsuba.
const SHARED: [&str; 22] = [
    "ala/ala.pbrt",
    "coffee/pbrt/scene-v4.pbrt",
    "cornell-box/mitsuba/scene_v3.xml",
    "gltf/FlightHelmet/FlightHelmet.gltf",
    "gltf/blender-io/01_alpha_blend/01_alpha_blend.gltf",
    "gltf/blender-io/14_emission_strength/14_emission_strength.gltf",
    "gltf/blender-io/15_transmission/15_transmission.gltf",
    "gltf/blender-io/16_volume/16_volume.gltf",
    "gltf/blender-io/17_ior/17_ior.gltf",
    "gltf/blender-io/19_sheen/19_sheen.gltf",
    "gltf/blender-io/25_anisotropy/25_anisotropy.gltf",
    "gltf/khronos/AnisotropyStrengthTest.glb",
    "gltf/khronos/AttenuationTest.glb",
    "gltf/playcanvas/Lights.glb",
    "magarro/magarro.xml",
    "peers/b_ala.xml",
    "peers/c_goblets.xml",
    "peers/d_interior.xml",
    "staircase2/pbrt/scene-v4.pbrt",
    "veach-bidir/pbrt/scene-v4.pbrt",
    "veach-mis/pbrt/scene-v4.pbrt",
    "volumetric-caustic/pbrt/scene-v4.pbrt",
];

const NOBODY: AgentUse = AgentUse { shadows: false, lights: false, roulette: false };

fn by_paths(guiding: bool, agents: AgentUse) -> PathSettings {
    PathSettings {
        guiding,
        agents,
        filter: Filter::PIXEL,
        planned_samples: PLANNED_SAMPLES,
        seed: 7,
        ..PathSettings::default()
    }
}

/// All guides of paths.
fn guides() -> Vec<(&'static str, PathSettings)> {
    vec![
        ("no guide", by_paths(false, NOBODY)),
        ("directions", by_paths(true, NOBODY)),
        ("agents", by_paths(true, AgentUse::ALL)),
        ("shadows", by_paths(false, AgentUse { shadows: true, ..NOBODY })),
        ("lights", by_paths(false, AgentUse { lights: true, ..NOBODY })),
        ("roulette", by_paths(false, AgentUse { roulette: true, ..NOBODY })),
    ]
}

/// Agents that also ask their network.
fn with_network(agents: AgentSettings) -> AgentSettings {
    AgentSettings { asks_network: true, ..agents }
}

/// All integrators that send out photons or agents.
fn maps() -> Vec<(&'static str, PathSettings)> {
    let few = PhotonSettings { count: 2_000, ..PhotonSettings::default() };
    let agents = |oracle| Some(AgentSettings { cast: 500, oracle, memory_bytes: 1 << 18, ..AgentSettings::default() });
    let cone = PhotonFilter::Cone;
    let all = [
        ("photons", few),
        ("photons in a cone, no gathering", PhotonSettings { final_rays: 0, filter: cone, ..few }),
        ("cache", PhotonSettings { irradiance_cache: 0.4, shadow_photons: true, ..few }),
        ("progressive", PhotonSettings { progressive: true, ..few }),
        ("no directions", PhotonSettings { gather_directions: false, ..few }),
        ("four maps", PhotonSettings { irradiance_cache: 0.4, shadow_photons: true, separate_maps: true, ..few }),
        ("no indirect light", PhotonSettings { indirect: false, ..few }),
        ("the paper's oracle", PhotonSettings { agents: agents(Oracle::Paper), ..few }),
        ("the oracle of errors", PhotonSettings { agents: agents(Oracle::Error), ..few }),
        ("network", PhotonSettings { agents: agents(Oracle::Error).map(with_network), ..few }),
    ];
    let settings = |photons| PathSettings { photons: Some(photons), max_depth: 6, ..by_paths(false, NOBODY) };
    all.into_iter().map(|(what, photons)| (what, settings(photons))).collect()
}

/// Renders with each of these settings, and checks that no value is below zero. Settings that media do not allow are skipped.
fn check(name: &str, scene: &Subject, side: u32, ways: &[(&str, PathSettings)]) {
    for (what, settings) in ways {
        let tile = Tile::new(Rect::of_size(side, side), Layout::new(AovSet::NONE));
        let tile = match scene.block(&scene.view((side, side)), *settings, tile, 0..SAMPLES).perform() {
            Ok(output) => output.tile,
            Err(RenderError::PhotonsInMedia) => continue,
            Err(error) => panic!("{name}, {what}: {error}"),
        };
        let is_dark = |&(x, y): &(u32, u32)| tile.pixel(x, y)[..3].iter().any(|&sum| sum < 0.0 || sum.is_nan());
        let count = tile.rect().pixels().filter(is_dark).count();
        let first = tile.rect().pixels().find(is_dark).map(|(x, y)| (x, y, tile.pixel(x, y)[..3].to_vec()));
        assert!(count == 0, "{name}, {what}: {count} pixels below zero, the first of them {first:?}");
    }
}

fn check_all(name: &str, scene: Scene, guides: &[(&str, PathSettings)], maps: &[(&str, PathSettings)]) {
    let options = PrepareOptions { threads: 1, ..PrepareOptions::default() };
    let scene = Subject::new(PreparedScene::new(Arc::new(scene), &options).expect("a sound scene"));
    check(name, &scene, LEARNING_SIDE, guides);
    check(name, &scene, SIDE, maps);
}

#[test]
fn in_scenes_made_by_hand() {
    let gloss = Layered { roughness: 0.3.into(), base_color: Vec3::splat(0.7).into(), ..Layered::default() };
    let scenes = [
        ("cornell", cornell()),
        ("room under a sky", room_under_sky()),
        ("ten lamps", lamps([5, 2])),
        ("many lamps", lamps([20, 10])),
        ("around a corner", around_a_corner()),
        ("behind a screen", behind_a_screen(&matte(Vec3::splat(0.7)))),
        ("behind a screen of gloss", behind_a_screen(&gloss.into())),
        ("many things", many_things()),
        ("outside", outside(false)),
        ("in the sun", outside(true)),
        ("a lamp that is a ball", room_with_sphere()),
        ("glossy room", glossy_room()),
        ("a ball under a sky", ball_under_sky()),
    ];
    for (name, scene) in scenes {
        check_all(name, scene, &guides(), &maps());
    }
}

/// A file's scene. Without lights it gets a sky that is bright above; without a camera, the default view.
fn loaded(path: &Path) -> Scene {
    let options = LoadOptions { allow_outside: true, ..LoadOptions::default() };
    let loaded = bottega_scene::load(path, &options);
    let mut scene = loaded.unwrap_or_else(|error| panic!("{}: {error}", path.display())).scene;
    if scene.cameras.is_empty() {
        scene.cameras.push(Camera::framing_scene(&scene, 1.0));
    }
    let shines = scene.materials.iter().any(|material| material.emission.factor != Vec3::ZERO);
    if scene.environment.is_none() && scene.lights.is_empty() && !shines {
        let texels = [[3.0, 3.0, 3.2], [0.1, 0.1, 0.1]].map(|texel| [texel; 4]).concat();
        scene.images.push(Image::from_linear_rgb("sky", 4, 2, texels));
        let image = Some(ImageId(scene.images.len() as u32 - 1));
        scene.environment = Some(Environment { image, ..Environment::uniform(Vec3::ONE) });
    }
    scene
}

#[test]
fn in_files() {
    let root = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let shared = std::env::var_os("BOTTEGA_SCENES").filter(|folder| !folder.is_empty()).map(PathBuf::from);
    if shared.is_none() {
        eprintln!("skipped {} files: set BOTTEGA_SCENES to the folder of the scenes", SHARED.len());
    }
    let shared = shared.iter().flat_map(|folder| SHARED.map(|name| (name, folder.join(name))));
    // The oracle of errors also asks agents whose network answers.
    let maps: Vec<_> = maps().into_iter().filter(|(what, _)| *what != "the oracle of errors").collect();
    for (name, path) in OWN.map(|name| (name, root.join(name))).into_iter().chain(shared) {
        eprintln!("{name}");
        // All guidance at once, and guided directions alone.
        check_all(name, loaded(&path), &guides()[..3], &maps);
    }
}
