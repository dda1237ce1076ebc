//! Pictures by photons against pictures by paths.

use std::{cell::RefCell, collections::BTreeMap, sync::Arc};

use bottega_hra::{Hra, HraConfig, VirtualCpu};
use bottega_image::{Aov, AovSet, Layout, Rect, Tile};
use bottega_render::{
    AgentSettings, Oracle, PathSettings, PhotonFilter, PhotonSettings, PrepareOptions, PreparedScene, RenderError,
    RenderWork,
    photon::{PhotonWork, cast_photons},
};
use bottega_scene::{AlphaMode, Environment, Layered, Light, LightKind, Material, Medium, Scene, Spectrum};
use glam::Vec3;

use crate::render::photon_scenes::{
    KnownScene, SIZE, by_paths, by_photons, closed_room, cornell_known, distance, few, hard_scenes, many_things_known,
    mean_of_seeds, mirror, outside, sky_known,
};
use crate::render::scenes::{
    Subject, add_quad, add_sphere, camera, color, cornell, glass, grow, lamp, matte, mean_color, paint, prepare,
    room_under_sky,
};

#[test]
fn gathered_light_is_that_of_paths() {
    let [sun, room] = [outside(true), room_under_sky()].map(KnownScene::new);
    for (name, known, margin) in [
        ("cornell", cornell_known(), 0.006),
        ("many things", many_things_known(), 0.01),
        ("sky", sky_known(), 0.006),
        ("sun", &sun, 0.006),
        ("room under a sky", &room, 0.006),
    ] {
        let (scene, expected) = (&known.scene, known.by_paths());
        for filter in [PhotonFilter::Epanechnikov, PhotonFilter::Cone] {
            let photons = PhotonSettings { filter, ..few() };
            let found = mean_of_seeds(scene, 32, |seed| by_photons(photons, seed, 32));
            let distance = distance(found, expected, margin);
            assert!(distance < 4.0, "{name} {filter:?}: {found:?} {expected:?}, {distance}");
        }
    }
}

#[test]
fn reflections_of_glass_are_in_every_sample() {
    // A ball in the dark, lit by a lamp behind the camera: some 8 % of the light comes back from the ball's front and back.
    let mut scene = Scene { cameras: vec![camera(Vec3::Z * 3.0, Vec3::ZERO, 0.1)], ..Scene::default() };
    add_sphere(&mut scene, Vec3::ZERO, 0.5, glass());
    add_quad(&mut scene, Vec3::new(-4.0, -4.0, 6.0), Vec3::Y * 8.0, Vec3::X * 8.0, Material::emitter(Vec3::splat(5.0)));
    let tile = paint(&prepare(scene), SIZE, 1, by_photons(few(), 1, 1));
    let seen: Vec<f32> = (0..SIZE.0 * SIZE.1).map(|i| color(&tile, i % SIZE.0, i / SIZE.0).x).collect();
    let mean = seen.iter().sum::<f32>() / seen.len() as f32;
    let deviation = (seen.iter().map(|it| (it - mean).powi(2)).sum::<f32>() / seen.len() as f32).sqrt();
    assert!((0.06..0.1).contains(&(mean / 5.0)), "{mean}");
    // If the reflection were followed at random, the deviation would be three times the mean.
    assert!(deviation < 0.25 * mean, "{deviation} of {mean}");
}

#[test]
fn a_veil_is_as_bright_as_paths_find_it() {
    // Nothing else is visible, and half of the light comes by the floor.
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.0, 2.5), Vec3::ZERO, 0.4)], ..Scene::default() };
    let veil = Material { alpha_mode: AlphaMode::Blend, opacity: 0.3.into(), ..matte(Vec3::splat(0.8)) };
    add_quad(&mut scene, Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0, veil);
    add_quad(&mut scene, Vec3::new(-1.0, -1.0, 2.0), Vec3::Z * -2.0, Vec3::X * 2.0, matte(Vec3::splat(0.8)));
    let kind = LightKind::Point { position: Vec3::new(0.0, -0.9, 0.8), intensity: Vec3::ONE };
    scene.lights.push(Light::new("", kind));
    let scene = prepare(scene);
    let expected = by_paths(&scene);
    for photons in [few(), PhotonSettings { progressive: true, ..few() }] {
        let found = mean_of_seeds(&scene, 32, |seed| by_photons(photons, seed, 32));
        let distance = distance(found, expected, 0.02);
        assert!(distance < 4.0, "{photons:?}: {found:?} {expected:?}, {distance}");
    }
}

#[test]
fn a_progressive_picture_comes_nearer_to_that_of_paths_the_more_passes_it_has() {
    for (name, known) in [("cornell", cornell_known()), ("many things", many_things_known()), ("sky", sky_known())] {
        let (scene, expected) = (&known.scene, known.by_paths());
        let with = |radius: f32, passes: u32, count: u32| {
            let photons = PhotonSettings { radius, progressive: true, count, ..few() };
            mean_of_seeds(scene, 64, |seed| by_photons(photons, seed, passes))
        };
        let error = |found: (Vec3, Vec3)| ((found.0 - expected.0) / expected.0).abs().max_element();
        // So wide that the effect of the radius is visible.
        let (early, late) = (with(1.5, 1, 1_500), with(1.5, 64, 500));
        assert!(error(late) < 0.8 * error(early), "{name}: {early:?} {late:?} {expected:?}");
        let small = with(0.05, 64, 4_000);
        let distance = distance(small, expected, 0.004);
        assert!(distance < 4.0, "{name}: {small:?} {expected:?}, {distance}");
    }
}

#[test]
fn polished_surfaces_show_lamps_in_mirrors_as_sharply_as_paths_do() {
    let polished = Layered {
        metallic: 1.0.into(),
        roughness: 0.12.into(),
        base_color: Vec3::splat(0.8).into(),
        ..Layered::default()
    };
    let mut scene =
        Scene { cameras: vec![camera(Vec3::new(0.0, 0.4, 1.2), Vec3::new(0.0, -1.0, -0.4), 0.6)], ..Scene::default() };
    add_quad(&mut scene, Vec3::new(-1.0, -1.0, -1.0), Vec3::Z * 4.0, Vec3::X * 2.0, polished.into());
    add_quad(&mut scene, Vec3::new(-1.0, -1.0, -1.0), Vec3::X * 2.0, Vec3::Y * 3.0, mirror());
    add_quad(&mut scene, Vec3::new(-0.2, 0.6, 1.6), Vec3::X * 0.4, Vec3::Y * 0.3, lamp(Vec3::splat(9.0)));
    let scene = prepare(scene);
    let size = (24, 24);
    let expected = paint(&scene, size, 2048, PathSettings { seed: 7, guiding: false, ..PathSettings::default() });
    let found = paint(&scene, size, 256, by_photons(few(), 1, 256));
    let difference = |(x, y)| (color(&found, x, y) - color(&expected, x, y)).abs().x;
    let share = expected.rect().pixels().map(difference).sum::<f32>() / (576.0 * mean_color(&expected).x);
    assert!(share < 0.05, "{share}");
}

#[test]
fn photons_at_the_first_surface_show_nearly_the_same() {
    let (scene, expected) = (&cornell_known().scene, cornell_known().by_paths());
    let photons = PhotonSettings { final_rays: 0, count: 60_000, ..few() };
    let found = mean_of_seeds(scene, 16, |seed| by_photons(photons, seed, 16));
    assert!(((found.0 - expected.0) / expected.0).abs().max_element() < 0.03, "{found:?} {expected:?}");
}

/// Mean of small pictures of three seeds, and the square of its standard error, by channel.
fn mean_of_small(scene: &Subject, samples: u32, settings: impl Fn(u64) -> PathSettings) -> (Vec3, Vec3) {
    let means: Vec<Vec3> = (0..3).map(|seed| mean_color(&paint(scene, (12, 12), samples, settings(seed)))).collect();
    let mean = means.iter().sum::<Vec3>() / 3.0;
    (mean, means.iter().map(|it| (*it - mean) * (*it - mean)).sum::<Vec3>() / 6.0)
}

/// A closed room, empty and filled with a medium that absorbs nothing, and the light of its paths by their depth.
struct RoomByDepth {
    name: &'static str,
    scene: Subject,
    in_medium: Subject,
    by_paths: RefCell<BTreeMap<u32, (Vec3, Vec3)>>,
}

impl RoomByDepth {
    fn new(name: &'static str, room: Scene) -> Self {
        let mut clear = room.clone();
        clear.cameras[0].medium = Some(clear.push_medium(Medium::absorbing(Vec3::splat(1e-9))));
        Self { name, scene: prepare(room), in_medium: prepare(clear), by_paths: RefCell::default() }
    }

    fn path(max_depth: u32, seed: u64) -> PathSettings {
        PathSettings { max_depth, seed: seed + 100, guiding: false, ..PathSettings::default() }
    }

    /// Mean of small pictures by paths, and the square of its standard error. Each depth is rendered once.
    fn by_paths(&self, max_depth: u32) -> (Vec3, Vec3) {
        let paint = || mean_of_small(&self.scene, 512, |seed| Self::path(max_depth, seed));
        *self.by_paths.borrow_mut().entry(max_depth).or_insert_with(paint)
    }

    /// Checks that each mode shows the light of exactly this number of bounces.
    fn check(&self, max_depth: u32, modes: &[(&str, PhotonSettings)]) {
        let (name, expected) = (self.name, self.by_paths(max_depth));
        let in_medium = mean_of_small(&self.in_medium, 256, |seed| Self::path(max_depth, seed));
        let is_near = |found: (Vec3, Vec3)| distance(found, expected, 0.02) < 4.0;
        assert!(is_near(in_medium), "{name} {max_depth}, in a medium: {in_medium:?} {expected:?}");
        for &(mode, photons) in modes {
            let photons = PhotonSettings { bounces: max_depth, ..photons };
            let settings = |seed| PathSettings { max_depth, ..by_photons(photons, seed, 32) };
            let found = mean_of_small(&self.scene, 32, settings);
            let ratio = found.0 / expected.0;
            assert!(is_near(found), "{name} {max_depth} {mode}: {found:?} {expected:?}, {ratio}");
            if max_depth > 3 {
                continue;
            }
            // One bounce more or less makes a visible difference.
            let more = self.by_paths(max_depth + 1);
            let is_distinct = (found.0 - more.0).x.abs() > 2.0 * (found.0 - expected.0).x.abs();
            assert!(is_distinct, "{name} {max_depth} {mode}: {found:?} {expected:?} {more:?}");
        }
    }
}

#[test]
fn depth_is_the_same_number_of_bounces_for_all() {
    let agents = |oracle| Some(AgentSettings { cast: 1_500, oracle, ..AgentSettings::default() });
    let small = PhotonSettings { count: 10_000, ..PhotonSettings::default() };
    let modes = [
        ("gathered", small),
        ("cached", PhotonSettings { irradiance_cache: 0.2, ..small }),
        ("ala", PhotonSettings { agents: agents(Oracle::Error), ..small }),
        ("progressive", PhotonSettings { progressive: true, radius: 0.1, count: 2_000, ..small }),
        ("at once", PhotonSettings { final_rays: 0, radius: 0.05, count: 30_000, ..small }),
        ("ala by the paper", PhotonSettings { agents: agents(Oracle::Paper), ..small }),
    ];
    let room = RoomByDepth::new("box", closed_room(false));
    for (max_depth, count) in [(1, 1), (2, 6), (3, 5), (4, 3), (8, 2)] {
        room.check(max_depth, &modes[..count]);
    }
    RoomByDepth::new("mirror", closed_room(true)).check(3, &modes[..3]);
}

#[test]
fn neither_threads_nor_cuts_change_a_bit() {
    let mut room = cornell();
    let veil = Material { alpha_mode: AlphaMode::Blend, opacity: 0.4.into(), ..matte(Vec3::splat(0.5)) };
    add_quad(&mut room, Vec3::new(-0.5, -0.5, 0.8), Vec3::X, Vec3::Y, veil);
    let room = Arc::new(room);
    let cached = PhotonSettings { irradiance_cache: 0.3, ..few() };
    for photons in [few(), PhotonSettings { progressive: true, shadow_photons: true, ..few() }, cached] {
        let settings = by_photons(photons, 5, 4);
        let painted = |threads: usize, cuts: &[u32], blocks: u32| -> Vec<f32> {
            let options = PrepareOptions { threads, ..PrepareOptions::default() };
            let scene = Subject::new(PreparedScene::new(Arc::clone(&room), &options).unwrap());
            let view = scene.view(SIZE);
            let mut whole = Tile::new(Rect::of_size(SIZE.0, SIZE.1), Layout::new(AovSet::NONE));
            for rect in Rect::of_size(SIZE.0, SIZE.1).blocks(blocks) {
                let mut tile = Tile::new(rect, Layout::new(AovSet::NONE));
                for range in cuts.windows(2) {
                    tile = scene.block(&view, settings, tile, range[0]..range[1]).perform().unwrap().tile;
                }
                whole.copy_from(&tile);
            }
            whole.sums().to_vec()
        };
        assert_eq!(painted(1, &[0, 4], 24), painted(3, &[0, 1, 4], 7));
    }
}

fn is_sound(name: &str, scene: &Subject, photons: PhotonSettings) -> Spectrum {
    let tile = paint(scene, (12, 12), 4, by_photons(photons, 0, 4));
    assert!(tile.sums().iter().all(|sum| sum.is_finite()), "{name}");
    mean_color(&tile)
}

#[test]
fn hard_cases_end_in_the_right_picture() {
    let modes = [
        few(),
        PhotonSettings { progressive: true, ..few() },
        PhotonSettings { final_rays: 0, ..few() },
        PhotonSettings { count: 0, ..few() },
        PhotonSettings { count: 1, ..few() },
        PhotonSettings { gather: 0, ..few() },
        PhotonSettings { gather: 100_000, radius: f32::MAX, ..few() },
        PhotonSettings { radius: 0.0, bounces: 0, shadow_photons: true, ..few() },
        PhotonSettings { radius: f32::NAN, irradiance_cache: f32::NAN, ..few() },
        PhotonSettings { irradiance_cache: 0.3, ..few() },
        PhotonSettings { irradiance_cache: f32::MAX, ..few() },
    ];
    let [unlit, black, closed, shade, mirrors, nothing, cornell] = hard_scenes();
    for photons in modes {
        assert_eq!(is_sound("no light", &unlit, photons), Vec3::ZERO);
        assert_eq!(is_sound("black light", &black, photons), Vec3::ZERO);
        let inside = is_sound("light inside a closed object", &closed, photons);
        // A search as wide as the room cannot tell inside from outside.
        assert!(inside == Vec3::ZERO || photons.radius > 1.0, "{photons:?}");
        let inside = is_sound("lamp close to what hides it", &shade, photons);
        assert!(inside == Vec3::ZERO || photons.radius > 1.0, "{photons:?}");
        assert!(is_sound("mirrors alone", &mirrors, photons) != Vec3::ZERO);
        assert_eq!(is_sound("nothing but sky", &nothing, photons), Vec3::ONE);
        assert!(is_sound("cornell", &cornell, photons) != Vec3::ZERO);
    }
}

#[test]
fn the_size_of_a_scene_does_not_matter() {
    let of_size = |size: f32| {
        let mut scene = cornell();
        grow(&mut scene, size);
        is_sound("cornell", &prepare(scene), few())
    };
    let expected = of_size(1.0);
    for size in [1e-5, 1e6] {
        let found = of_size(size);
        assert!(((found - expected) / expected).abs().max_element() < 0.05, "{size}: {found} {expected}");
    }
}

#[test]
fn shadow_photons_decide_visibility_and_change_little() {
    let scene = prepare(cornell());
    let with = |shadow_photons| {
        let photons = PhotonSettings { shadow_photons, final_rays: 0, count: 100_000, ..few() };
        let settings = by_photons(photons, 3, 16);
        let tile = Tile::new(Rect::of_size(SIZE.0, SIZE.1), Layout::new([Aov::Cost].into_iter().collect()));
        let tile = scene.block(&scene.view(SIZE), settings, tile, 0..16).perform().unwrap().tile;
        let place = tile.layout().offset(Aov::Cost).unwrap();
        let cost: f32 = tile.rect().pixels().map(|(x, y)| tile.pixel(x, y)[place]).sum();
        (mean_color(&tile), cost)
    };
    let ((expected, all), (found, some)) = (with(false), with(true));
    // A shadow ray costs half as much as a vertex, of which a path has two or three.
    assert!(some < 0.9 * all, "{some} {all}");
    assert!(((found - expected) / expected).abs().max_element() < 0.01, "{found} {expected}");
}

#[test]
fn cached_irradiance_is_nearly_that_which_is_gathered() {
    let scene = prepare(cornell());
    let with = |irradiance_cache| {
        let photons = PhotonSettings { irradiance_cache, count: 100_000, ..few() };
        paint(&scene, SIZE, 16, by_photons(photons, 3, 16))
    };
    let (without, with) = (with(0.0), with(0.15));
    let (expected, found) = (mean_color(&without), mean_color(&with));
    assert!(without.sums() != with.sums(), "nothing is cached");
    assert!(((found - expected) / expected).abs().max_element() < 0.02, "{found} {expected}");
}

#[test]
fn maps_made_by_the_allocator_are_the_same() {
    let room = Arc::new(cornell());
    let settings = by_photons(few(), 5, 2);
    let painted = |cast: bool| {
        let scene = Subject::new(PreparedScene::new(Arc::clone(&room), &PrepareOptions::default()).unwrap());
        if cast {
            let hra = Hra::new(HraConfig::default(), VirtualCpu::lanes(2, RenderWork::perform));
            cast_photons(&scene.scene, &scene.prepass, &scene.view(SIZE), &settings, &hra.client(), None).unwrap();
            assert!(hra.report().resources.iter().map(|resource| resource.units).sum::<u64>() > 3);
        }
        let before = scene.prepass.memory_bytes();
        let sums = paint(&scene, SIZE, 2, settings).sums().to_vec();
        // Nothing remains to be traced.
        assert_eq!(scene.prepass.memory_bytes() == before, cast);
        sums
    };
    assert_eq!(painted(true), painted(false));
}

#[test]
fn media_are_refused() {
    let mut scene = cornell();
    let fog = Medium { scattering: Vec3::ONE, ..Medium::absorbing(Vec3::ZERO) };
    scene.cameras[0].medium = Some(scene.push_medium(fog));
    let scene = prepare(scene);
    let tile = Tile::new(Rect::of_size(4, 4), Layout::new(AovSet::NONE));
    let work = scene.block(&scene.view((4, 4)), by_photons(few(), 0, 1), tile, 0..1);
    assert!(matches!(work.perform(), Err(RenderError::PhotonsInMedia)));
}

#[test]
fn photons_sent_to_glass_bring_as_much_as_others_by_chance() {
    /// Photons cast by chance per photon sent to glass.
    const SHARE: u32 = 4;
    let mut small = cornell();
    add_sphere(&mut small, Vec3::new(-0.5, 0.4, -0.3), 0.08, glass());
    let sky = {
        let mut scene = small.clone();
        scene.meshes.pop();
        scene.instances.pop();
        scene.environment = Some(Environment::uniform(Vec3::new(0.5, 0.6, 0.8)));
        scene
    };
    for (name, scene) in [("lamp", small), ("sky", sky)] {
        let scene = prepare(scene);
        let settings = PhotonSettings { count: 160_000, ..PhotonSettings::default() };
        // Power of the caustics, and the number of traced photons that contribute to it.
        let found = |only_caustics: bool, seed: u64| {
            let indices = 0..if only_caustics { settings.count / SHARE } else { settings.count };
            let traced = indices.len() as f64;
            let view = scene.view(SIZE);
            let (scene, prepass) = (Arc::clone(&scene.scene), Arc::clone(&scene.prepass));
            let photons = PhotonWork { scene, prepass, settings, view, only_caustics, seed, indices }.perform();
            let power: Vec3 = photons.caustic.iter().map(|photon| photon.mark().power()).sum();
            (f64::from(power.element_sum()) / f64::from(settings.count), photons.caustic.len() as f64 / traced)
        };
        let several = |only_caustics: bool| {
            let runs: Vec<_> = (0..12).map(|seed| found(only_caustics, seed)).collect();
            let mean = runs.iter().map(|run| run.0).sum::<f64>() / 12.0;
            let variance = runs.iter().map(|run| (run.0 - mean).powi(2)).sum::<f64>() / (12.0 * 11.0);
            (mean, variance, runs[0].1)
        };
        let ((by_chance, a, few), (sent, b, many)) = (several(false), several(true));
        let z = (by_chance - sent) / (a + b).sqrt();
        assert!(z.abs() < 4.0 && sent > 0.0, "{name}: {by_chance} {sent}, z {z}");
        assert!(many > 3.0 * few, "{name}: {few} {many}");
        // A quarter of the photons; the variance estimated from twelve runs is within a factor of three.
        eprintln!("{name}: variance {a:.2e} {b:.2e}, share {few:.4} {many:.4}");
        assert!(b < 3.0 * a, "{name}: {a} {b}");
    }
}

/// A ball under a sun, on a plain that extends this far to all sides.
fn ball_on_a_plain(half: f32) -> Scene {
    let mut scene =
        Scene { cameras: vec![camera(Vec3::new(0.0, 2.0, 6.0), Vec3::new(0.0, 0.15, 0.0), 0.8)], ..Scene::default() };
    let corner = Vec3::new(-half, 0.0, half);
    add_quad(&mut scene, corner, Vec3::X * 2.0 * half, Vec3::NEG_Z * 2.0 * half, matte(Vec3::splat(0.7)));
    add_sphere(&mut scene, Vec3::Y, 1.0, matte(Vec3::new(0.8, 0.3, 0.2)));
    let direction = Vec3::new(0.0, -0.84, -0.54).normalize();
    let kind = LightKind::Directional { direction, irradiance: Vec3::splat(3.0), angle: 0.0 };
    scene.lights.push(Light::new("", kind));
    scene
}

#[test]
fn a_small_thing_in_a_wide_world_is_as_bright_as_paths_find_it() {
    const BLOCK: u32 = 4;
    let agents = |oracle| Some(AgentSettings { cast: 20_000, oracle, ..AgentSettings::default() });
    let block = |tile: &Tile, x: u32, y: u32| {
        let pixels = (0..BLOCK * BLOCK).map(|i| color(tile, BLOCK * x + i % BLOCK, BLOCK * y + i / BLOCK));
        pixels.sum::<Vec3>() / (BLOCK * BLOCK) as f32
    };
    let mut wrong = Vec::new();
    for half in [50.0, 5000.0] {
        let scene = prepare(ball_on_a_plain(half));
        let path = PathSettings { seed: 9, guiding: false, ..PathSettings::default() };
        let expected = paint(&scene, SIZE, 512, path);
        let modes = [
            ("progressive", PhotonSettings { progressive: true, count: 60_000, ..few() }, 24),
            ("gathered", PhotonSettings { count: 30_000, ..few() }, 32),
            ("ala", PhotonSettings { agents: agents(Oracle::Error), ..few() }, 32),
            ("ala by the paper", PhotonSettings { agents: agents(Oracle::Paper), ..few() }, 32),
        ];
        for (mode, photons, samples) in modes {
            let found = paint(&scene, SIZE, samples, by_photons(photons, 3, samples));
            let mut worst = (0.0_f32, 0, 0);
            for (x, y) in (0..SIZE.0 / BLOCK).flat_map(|x| (0..SIZE.1 / BLOCK).map(move |y| (x, y))) {
                let (found, expected) = (block(&found, x, y), block(&expected, x, y));
                let error = ((found - expected).abs() / (expected + 0.05)).max_element();
                worst = if error > worst.0 { (error, x, y) } else { worst };
            }
            eprintln!("{half} {mode}: {worst:?}");
            // The noise of a progressive picture is that of its photons.
            if worst.0 > if photons.progressive { 0.1 } else { 0.05 } {
                wrong.push((half, mode, worst));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

#[test]
fn contact_shadows_are_equal_on_large_and_small_triangles() {
    let [small, large] = [50.0, 5000.0].map(|half| {
        let path = PathSettings { seed: 4, guiding: false, ..PathSettings::default() };
        paint(&prepare(ball_on_a_plain(half)), SIZE, 512, path)
    });
    let block = |tile: &Tile, (x, y): (u32, u32)| {
        let pixels = (0..16).map(|i| color(tile, 4 * x + i % 4, 4 * y + i / 4));
        pixels.sum::<Vec3>() / 16.0
    };
    let mut worst = 0.0_f32;
    // Above the plain, the larger ball reaches farther.
    for place in (0..SIZE.0 / 4).flat_map(|x| (SIZE.1 / 8..SIZE.1 / 4).map(move |y| (x, y))) {
        let (found, expected) = (block(&large, place), block(&small, place));
        let error = ((found - expected).abs() / (expected + 0.05)).max_element();
        worst = worst.max(error);
    }
    assert!(worst < 0.03, "{worst}");
}

/// Rays that leave a triangle of any size and direction hit neither it nor its neighbor in the same plane.
#[test]
fn a_plain_of_any_size_and_slope_does_not_shadow_itself() {
    for (half, axis, angle) in [
        (50.0, Vec3::X, 0.0),
        (5e3, Vec3::new(1.0, 0.0, 0.3), 0.3),
        (5e4, Vec3::new(0.3, 0.2, 1.0), 0.6),
        (1e5, Vec3::ONE, 1.2),
    ] {
        let turn = glam::Quat::from_axis_angle(axis.normalize(), angle);
        let [right, up, away] = [Vec3::X, Vec3::Y, Vec3::NEG_Z].map(|axis| turn * axis);
        let eye = up * 2.0 - away * 3.0 + right * 0.3;
        let mut scene = Scene { cameras: vec![camera(eye, right * 0.1, 0.8)], ..Scene::default() };
        let corner = (-right - away) * half;
        add_quad(&mut scene, corner, right * 2.0 * half, away * 2.0 * half, matte(Vec3::ONE));
        // A low sun, so that rays leave along the plain.
        let direction = (-0.02 * up + 0.7 * right + 0.7 * away).normalize();
        let kind = LightKind::Directional { direction, irradiance: Vec3::splat(std::f32::consts::PI), angle: 0.0 };
        scene.lights.push(Light::new("", kind));
        let expected = -direction.dot(up);
        let picture = paint(&prepare(scene), SIZE, 16, PathSettings { guiding: false, ..PathSettings::default() });
        for (x, y) in (0..SIZE.0).flat_map(|x| (0..SIZE.1).map(move |y| (x, y))) {
            let found = color(&picture, x, y).x;
            // A ray past the edge hits nothing.
            assert!(found == 0.0 || (found / expected - 1.0).abs() < 0.01, "{half} {x} {y}: {found} {expected}");
        }
        assert!(color(&picture, SIZE.0 / 2, SIZE.1 / 2).x > 0.0);
    }
}
