//! Pictures by Autonomous Lighting Agents against pictures by paths.

use std::sync::Arc;

use bottega_hra::{Hra, HraConfig, VirtualCpu};
use bottega_image::{AovSet, Layout, Rect, Tile};
use bottega_render::{
    AgentSettings, Oracle, PathSettings, PhotonSettings, PrepareOptions, PreparedScene, RenderWork,
    ala::{AgentReport, Criterion, Density, LocalSphere, SampleSet, Samples, Tally},
    photon::cast_photons,
};
use bottega_scene::{AlphaMode, Environment, Layered, Light, LightKind, Material, Scene, Surface};
use glam::Vec3;

use crate::render::scenes::{
    Subject, add_quad, add_room, add_sphere, camera, color, cornell, grow, lamp, matte, mean_color, paint, prepare,
    room_under_sky,
};

const SIZE: (u32, u32) = (24, 24);

const ORACLES: [Oracle; 2] = [Oracle::Paper, Oracle::Error];

fn few(oracle: Oracle) -> AgentSettings {
    AgentSettings { cast: 3_000, oracle, ..AgentSettings::default() }
}

fn by(agents: AgentSettings, seed: u64) -> PathSettings {
    let photons = PhotonSettings { count: 20_000, agents: Some(agents), ..PhotonSettings::default() };
    PathSettings { photons: Some(photons), seed, guiding: false, ..PathSettings::default() }
}

fn report(scene: &Subject, settings: &PathSettings) -> AgentReport {
    report_of(scene, SIZE, settings)
}

fn report_of(scene: &Subject, size: (u32, u32), settings: &PathSettings) -> AgentReport {
    let found =
        scene.prepass.lighting_agents(&scene.scene, &scene.view(size), settings.photons.unwrap(), settings.seed);
    found.expect("the requested agents")
}

/// The room with a spherical light, as in the paper's scene.
pub(crate) fn room_with_sphere() -> Scene {
    let mut scene = cornell();
    scene.meshes.pop();
    scene.instances.pop();
    add_sphere(&mut scene, Vec3::new(0.0, 0.7, 0.0), 0.12, lamp(Vec3::new(22.0, 20.0, 17.0)));
    scene
}

/// The room with a floor and a back wall of rough plastic, and a ball of rough metal.
pub(crate) fn glossy_room() -> Scene {
    let plastic = Layered { base_color: Vec3::splat(0.6).into(), roughness: 0.4.into(), ..Layered::default() };
    let metal = Layered { metallic: 1.0.into(), roughness: 0.7.into(), ..plastic.clone() };
    let mut scene = room_with_sphere();
    let mut replace = |mesh: usize| scene.materials[scene.meshes[mesh].material as usize] = plastic.clone().into();
    [0, 2].into_iter().for_each(&mut replace);
    let ball = scene.spheres[0].material as usize;
    scene.materials[ball] = metal.into();
    scene
}

#[test]
fn agents_spare_shadow_rays_and_show_nearly_the_light_of_paths() {
    let scene = prepare(room_with_sphere());
    let expected = paint(&scene, SIZE, 512, PathSettings { seed: 9, guiding: false, ..PathSettings::default() });
    for oracle in ORACLES {
        let settings = by(AgentSettings { cast: 10_000, ..few(oracle) }, 1);
        let found = paint(&scene, SIZE, 64, settings);
        let report = report(&scene, &settings);
        let tally = report.tally;
        let share = tally.shadow_traced as f64 / (tally.shadow_traced + tally.shadow_spared) as f64;
        assert!(share < 0.4, "{tally:?}");
        // The weight of records fades at their edges, so some light is gathered even among many of them.
        assert!(tally.irradiance_interpolated > 6 * tally.irradiance_computed, "{tally:?}");
        let (found, expected) = (mean_color(&found), mean_color(&expected));
        assert!(((found - expected) / expected).abs().max_element() < 0.03, "{oracle:?} {found} {expected}");
        assert!(report.clones > 0 && report.links > report.agents, "{report:?}");
        let deployed = if oracle == Oracle::Paper { &report.sensors[..] } else { &report.sensors[2..] };
        assert!(deployed.iter().all(|&count| count > 0), "{report:?}");
    }
}

/// A lamp in the ceiling does not illuminate the ceiling directly, so only agents cast on from illuminated places get there.
#[test]
fn scouts_look_at_unlit_places() {
    let mut scene = cornell();
    scene.cameras[0] = camera(Vec3::new(0.0, -0.6, 0.0), Vec3::Y, 1.2);
    let scene = prepare(scene);
    let expected = paint(&scene, SIZE, 512, PathSettings { seed: 9, guiding: false, ..PathSettings::default() });
    let settings = by(AgentSettings { cast: 10_000, ..few(Oracle::Error) }, 1);
    let found = paint(&scene, SIZE, 64, settings);
    let tally = report(&scene, &settings).tally;
    // Light is gathered where agents are uncertain or have a small reach.
    assert!(tally.irradiance_interpolated > 3 * tally.irradiance_computed, "{tally:?}");
    let (found, expected) = (mean_color(&found), mean_color(&expected));
    assert!(((found - expected) / expected).abs().max_element() < 0.03, "{found} {expected}");
}

/// A ball whose lower half is lit by the sky's light that the floor reflects.
/// The ball stands on the ground, under a uniform sky.
pub(crate) fn ball_under_sky() -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.5, 5.0), Vec3::Y * 0.5, 0.25)], ..Scene::default() };
    let grey = matte(Vec3::splat(0.5));
    add_quad(&mut scene, Vec3::new(-10.0, 0.0, 10.0), Vec3::X * 20.0, Vec3::Z * -20.0, grey.clone());
    add_sphere(&mut scene, Vec3::Y, 1.0, grey);
    scene.environment = Some(Environment::uniform(Vec3::ONE));
    scene
}

#[test]
fn a_wide_light_comes_back_whole_from_surfaces_that_are_known() {
    // As in pictures: the dim parts of the sky are left to paths that hit them.
    let options = PrepareOptions { threads: 1, compensate_environment: true };
    for scene in [ball_under_sky(), room_under_sky()] {
        let scene = Subject::new(PreparedScene::new(Arc::new(scene), &options).expect("a sound scene"));
        let expected =
            mean_color(&paint(&scene, SIZE, 512, PathSettings { seed: 9, guiding: false, ..PathSettings::default() }));
        for oracle in ORACLES {
            let settings = by(AgentSettings { cast: 8_000, ..few(oracle) }, 1);
            let found = mean_color(&paint(&scene, SIZE, 64, settings));
            assert!(((found - expected) / expected).abs().max_element() < 0.02, "{oracle:?} {found} {expected}");
        }
    }
}

#[test]
fn unlit_surfaces_shine_once_on_surfaces_with_records() {
    // The dim parts of the sky are left to rays that hit them, and these also reach unlit places.
    let options = PrepareOptions { threads: 1, compensate_environment: true };
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 4.0, 0.1), Vec3::ZERO, 0.9)], ..Scene::default() };
    add_quad(&mut scene, Vec3::new(-2.0, 0.0, 2.0), Vec3::X * 4.0, Vec3::Z * -4.0, matte(Vec3::splat(0.6)));
    let card = Surface::Unlit(Vec3::new(4.0, 1.0, 0.3).into());
    add_quad(&mut scene, Vec3::new(1.0, 0.0, 1.0), Vec3::Z * -2.0, Vec3::Y * 2.0, card.into());
    scene.environment = Some(Environment::uniform(Vec3::ONE));
    let scene = Subject::new(PreparedScene::new(Arc::new(scene), &options).expect("a sound scene"));
    let paths = |seed| PathSettings { seed, guiding: false, ..PathSettings::default() };
    let expected = mean_color(&paint(&scene, SIZE, 512, paths(9)));
    let cached = PhotonSettings { count: 20_000, irradiance_cache: 0.15, ..PhotonSettings::default() };
    let [by_paper, by_error] = ORACLES.map(|oracle| by(few(oracle), 1));
    for settings in [by_paper, by_error, PathSettings { photons: Some(cached), ..paths(1) }] {
        let found = mean_color(&paint(&scene, SIZE, 128, settings));
        assert!(((found - expected) / expected).abs().max_element() < 0.01, "{settings:?} {found} {expected}");
    }
}

#[test]
fn glossy_surfaces_sample_the_directions_of_incident_light() {
    let scene = prepare(glossy_room());
    let expected = paint(&scene, SIZE, 2048, PathSettings { seed: 9, guiding: false, ..PathSettings::default() });
    let by_asking = |decides_radiance: bool| {
        let settings = by(AgentSettings { cast: 10_000, decides_radiance, ..few(Oracle::Error) }, 1);
        let mean = mean_color(&paint(&scene, SIZE, 64, settings));
        assert!(((mean / mean_color(&expected)) - 1.0).abs().max_element() < 0.03, "{decides_radiance} {mean}");
        let tile = paint(&scene, SIZE, 8, settings);
        let error = |(x, y): (u32, u32)| {
            let (found, expected) = (color(&tile, x, y), color(&expected, x, y));
            ((found - expected) / expected.max_element()).length_squared().min(1.0)
        };
        let error: f32 = tile.rect().pixels().map(error).sum();
        (error, report(&scene, &settings).tally.irradiance_computed)
    };
    let (with_network, alone) = (by_asking(true), by_asking(false));
    assert!(with_network.0 < 0.8 * alone.0 && 2 * with_network.1 < alone.1, "{with_network:?} {alone:?}");
}

#[test]
fn agents_decide_only_what_the_settings_allow() {
    let scene = prepare(room_with_sphere());
    for (oracle, most) in [(Oracle::Paper, 6), (Oracle::Error, 2)] {
        let nothing = AgentSettings { decides_shadows: false, decides_irradiance: false, ..few(oracle) };
        let shadows = AgentSettings { decides_irradiance: false, ..few(oracle) };
        let settings = [by(nothing, 1), by(shadows, 1)];
        let [alone, with_shadows] = settings.map(|settings| paint(&scene, SIZE, 32, settings));
        let [none, some] = settings.map(|settings| report(&scene, &settings).tally);
        assert_eq!((none.shadow_spared, none.irradiance_interpolated, some.irradiance_interpolated), (0, 0, 0));
        assert!(some.shadow_spared > some.shadow_traced, "{some:?}");
        // The same samples: they differ only where an agent was wrong.
        let differs = |&(x, y): &(u32, u32)| {
            let (a, b) = (color(&alone, x, y), color(&with_shadows, x, y));
            (a - b).abs().max_element() > 0.1 * a.max_element()
        };
        let wrong = alone.rect().pixels().filter(differs).count();
        assert!(wrong <= most, "{oracle:?}: {wrong} of 576 pixels");
    }
}

#[test]
fn agents_make_do_with_the_memory_they_are_given() {
    let scene = prepare(room_with_sphere());
    let whole = paint(&scene, SIZE, 32, by(few(Oracle::Error), 3));
    let mut known = 1.0;
    for memory_bytes in [1 << 20, 60_000, 0] {
        let settings = by(AgentSettings { memory_bytes, ..few(Oracle::Error) }, 3);
        let tight = paint(&scene, SIZE, 32, settings);
        let report = report(&scene, &settings);
        // One record more than the budget holds, and the tree that contains it.
        assert!(report.map_bytes <= memory_bytes + 8_192, "{report:?}");
        let Tally { irradiance_computed, irradiance_interpolated, .. } = report.tally;
        let share = irradiance_interpolated as f64 / (irradiance_computed + irradiance_interpolated) as f64;
        assert!(share < known, "{known} {report:?}");
        known = share;
        let (whole, tight) = (mean_color(&whole), mean_color(&tight));
        assert!(((tight - whole) / whole).abs().max_element() < 0.05, "{memory_bytes}: {whole} {tight}");
    }
    assert_eq!(known, 0.0);
}

#[test]
fn the_less_error_is_borne_the_more_is_measured() {
    let scene = prepare(room_with_sphere());
    let sensors = [0.03, 0.1, 0.5].map(|error| {
        let settings = by(AgentSettings { error, ..few(Oracle::Error) }, 4);
        paint(&scene, (2, 2), 1, settings);
        report_of(&scene, (2, 2), &settings).sensors[3]
    });
    assert!(sensors[0] > sensors[1] && sensors[1] > sensors[2], "{sensors:?}");
}

#[test]
fn neither_threads_nor_cuts_nor_the_allocator_change_a_bit() {
    ORACLES.into_iter().for_each(does_not_depend_on_the_resource);
}

fn does_not_depend_on_the_resource(oracle: Oracle) {
    let mut room = glossy_room();
    let kind = LightKind::Point { position: Vec3::new(-0.5, 0.5, 0.5), intensity: Vec3::splat(0.3) };
    room.lights.push(Light::new("", kind));
    let room = Arc::new(room);
    let settings = by(few(oracle), 5);
    let painted = |threads: usize, lanes: usize, cuts: &[u32], blocks: u32| {
        let options = PrepareOptions { threads, ..PrepareOptions::default() };
        let scene = Subject::new(PreparedScene::new(Arc::clone(&room), &options).unwrap());
        let view = scene.view(SIZE);
        if lanes > 0 {
            let hra = Hra::new(HraConfig::default(), VirtualCpu::lanes(lanes, RenderWork::perform));
            cast_photons(&scene.scene, &scene.prepass, &view, &settings, &hra.client(), None).unwrap();
            assert!(hra.report().resources.iter().map(|resource| resource.units).sum::<u64>() > 6);
        }
        let mut whole = Tile::new(Rect::of_size(SIZE.0, SIZE.1), Layout::new(AovSet::NONE));
        for rect in Rect::of_size(SIZE.0, SIZE.1).blocks(blocks) {
            let mut tile = Tile::new(rect, Layout::new(AovSet::NONE));
            for range in cuts.windows(2) {
                tile = scene.block(&view, settings, tile, range[0]..range[1]).perform().unwrap().tile;
            }
            whole.copy_from(&tile);
        }
        let AgentReport { sensors, answers, links, tally, .. } = report(&scene, &settings);
        (whole.sums().to_vec(), sensors, answers, links, tally)
    };
    let expected = painted(1, 0, &[0, 3], 24);
    assert_eq!(expected, painted(2, 0, &[0, 1, 3], 7));
    assert_eq!(expected, painted(2, 2, &[0, 2, 3], 5));
}

fn is_sound(name: &str, scene: &Subject, agents: AgentSettings) -> Vec3 {
    let tile = paint(scene, (12, 12), 4, by(agents, 0));
    assert!(tile.sums().iter().all(|sum| sum.is_finite()), "{name}");
    mean_color(&tile)
}

/// Rooms without light, with black light, with a light inside a closed object, of mirrors alone; only a sky; a room that is
/// open to the sky, behind a veil; Cornell's room. Each is prepared once for all agents.
fn hard_scenes() -> [Subject; 7] {
    let room = |material: &Material| {
        let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.2, 3.6), Vec3::ZERO, 0.7)], ..Scene::default() };
        add_room(&mut scene, Vec3::new(1.2, 1.0, 4.0), material);
        scene
    };
    let mirror = Layered {
        metallic: 1.0.into(),
        roughness: 0.0.into(),
        base_color: Vec3::splat(0.9).into(),
        ..Layered::default()
    };
    let grey = matte(Vec3::splat(0.5));
    let mut black = room(&grey);
    add_sphere(&mut black, Vec3::ZERO, 0.1, lamp(Vec3::ZERO));
    let mut closed = room(&grey);
    add_sphere(&mut closed, Vec3::new(0.5, 0.0, -0.5), 0.2, grey.clone());
    let kind = LightKind::Point { position: Vec3::new(0.5, 0.0, -0.5), intensity: Vec3::ONE };
    closed.lights.push(Light::new("", kind));
    let mut mirrors = room(&mirror.into());
    add_sphere(&mut mirrors, Vec3::new(0.5, 0.0, -0.5), 0.2, lamp(Vec3::ONE));
    let mut nothing = Scene { cameras: room(&grey).cameras, ..Scene::default() };
    nothing.environment = Some(Environment::uniform(Vec3::ONE));
    let mut outside = room(&grey);
    outside.meshes.truncate(4);
    outside.instances.truncate(4);
    outside.environment = Some(Environment::uniform(Vec3::ONE));
    let veil = Material { alpha_mode: AlphaMode::Blend, opacity: 0.4.into(), ..grey.clone() };
    add_quad(&mut outside, Vec3::new(-0.5, -0.5, 0.8), Vec3::X, Vec3::Y, veil);
    [room(&grey), black, closed, mirrors, nothing, outside, cornell()].map(prepare)
}

#[test]
fn hard_cases_end_in_the_right_picture() {
    let [unlit, black, closed, mirrors, nothing, outside, cornell] = hard_scenes();
    for (cast, oracle) in [0, 1, 500].into_iter().flat_map(|cast| ORACLES.map(|oracle| (cast, oracle))) {
        let agents = AgentSettings { cast, ..few(oracle) };
        assert_eq!(is_sound("no light", &unlit, agents), Vec3::ZERO);
        assert_eq!(is_sound("black light", &black, agents), Vec3::ZERO);
        assert_eq!(is_sound("light inside a closed object", &closed, agents), Vec3::ZERO);
        assert!(is_sound("mirrors alone", &mirrors, agents) != Vec3::ZERO);
        assert_eq!(is_sound("nothing but sky", &nothing, agents), Vec3::ONE);
        assert!(is_sound("a sky and a veil", &outside, agents) != Vec3::ZERO);
        assert!(is_sound("cornell", &cornell, agents) != Vec3::ZERO);
    }
}

#[test]
fn the_size_of_a_scene_does_not_matter() {
    ORACLES.into_iter().for_each(does_not_depend_on_size);
}

fn does_not_depend_on_size(oracle: Oracle) {
    let of_size = |size: f32| {
        let mut scene = room_with_sphere();
        grow(&mut scene, size);
        let scene = prepare(scene);
        let settings = by(AgentSettings { cast: 1_000, ..few(oracle) }, 0);
        let tile = paint(&scene, (12, 12), 8, settings);
        assert!(tile.sums().iter().all(|sum| sum.is_finite()), "{size}");
        let tally = report_of(&scene, (12, 12), &settings).tally;
        (mean_color(&tile), tally.shadow_spared as f32 / (tally.shadow_spared + tally.shadow_traced) as f32)
    };
    let expected = of_size(1.0);
    for size in [1e-4, 1e6] {
        let found = of_size(size);
        assert!(((found.0 - expected.0) / expected.0).abs().max_element() < 0.05, "{size}: {found:?} {expected:?}");
        assert!((found.1 - expected.1).abs() < 0.05, "{size}: {found:?} {expected:?}");
    }
}

#[test]
fn a_few_sensors_differ_as_much_as_many_photons() {
    let scene = prepare(room_with_sphere());
    let view = scene.view(SIZE);
    let mean = |set: SampleSet, oracle: Oracle| {
        let criteria = [Criterion::Irradiance];
        let samples = Samples::new(&scene.scene, &scene.prepass, &view, &by(few(oracle), 2), set, &criteria).unwrap();
        let ludd = samples.over(&scene.scene, &view, LocalSphere::Count(20)).unwrap();
        let known: Vec<f32> = ludd.pixels.iter().flatten().filter_map(Density::all).collect();
        assert!(known.len() > 300 && known.iter().all(|density| density.is_finite() && *density >= 0.0));
        (known.iter().sum::<f32>() / known.len() as f32, ludd.sample_count)
    };
    let (by_photons, photons) = mean(SampleSet::IndirectPhotons, Oracle::Paper);
    for oracle in ORACLES {
        let (by_agents, sensors) = mean(SampleSet::Agents, oracle);
        assert!(sensors < photons, "{sensors} {photons}");
        assert!(by_agents > 0.4 * by_photons, "{oracle:?} {by_agents} {by_photons}");
    }
}

#[test]
fn a_picture_with_received_maps_has_the_same_bits() {
    let photons = PhotonSettings { count: 20_000, shadow_photons: true, ..PhotonSettings::default() };
    let by_photons = PathSettings { photons: Some(photons), seed: 6, guiding: false, ..PathSettings::default() };
    for settings in [by_photons, by(few(Oracle::Paper), 6), by(few(Oracle::Error), 6)] {
        let (one, other) = (prepare(glossy_room()), prepare(glossy_room()));
        let view = &one.view(SIZE);
        assert!(one.prepass.learnt(&one.scene, view, &settings).is_none());
        let expected = paint(&one, SIZE, 2, settings);
        let bytes = one.prepass.learnt(&one.scene, view, &settings).expect("maps that were made");
        other.prepass.learn_from(&other.scene, view, &settings, &bytes).expect("maps that can be read");
        assert!(other.prepass.learnt(&other.scene, view, &settings).as_ref() == Some(&bytes));
        assert_eq!(paint(&other, SIZE, 2, settings).sums(), expected.sums());
        // Truncated data and damaged counts are refused; other damage does no harm.
        let mut taken = 0;
        for i in 0..40 {
            let third = Subject { scene: Arc::clone(&one.scene), prepass: Arc::default() };
            let cut = &bytes[..i * bytes.len() / 40];
            assert!(third.prepass.learn_from(&third.scene, view, &settings, cut).is_err(), "{i}");
            let mut damaged = bytes.clone();
            damaged[i * bytes.len() / 40 + i % 7] ^= 1 << (i % 8);
            if third.prepass.learn_from(&third.scene, view, &settings, &damaged).is_ok() {
                taken += 1;
                // The maps belong to this view: another view has its own.
                let part = Tile::new(Rect::new(8, 8, 16, 16), Layout::new(AovSet::NONE));
                let part = third.block(view, settings, part, 0..1).perform().expect("a picture").tile;
                assert!(part.sums().iter().all(|sum| sum.is_finite()), "{i}");
            }
        }
        assert!(taken > 0, "no damaged map was painted with");
    }
}
