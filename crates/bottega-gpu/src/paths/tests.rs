//! Images by the kernels compared with those of the CPU, path by path: both use the same random numbers.

mod scenes;

use std::sync::Arc;

use bottega_image::{Aov, AovSet, Combine, Layer, Layout, Rect, Tile};
use bottega_kernels::Ray;
use bottega_render::{
    BlockWork, DirectLight, Filter, PathSettings, PrepareOptions, PreparedScene, RenderOutput, RenderWork, View,
};
use bottega_scene::{Camera, Clip, Environment, Panorama, Projection, Scene};
use glam::Vec3;

use super::GpuAdapter;
use super::kernels::{Variant, camera_source, plan_source, shading_source, traversal_source};
use super::options::PathOptions;
use super::shelf::SceneShelf;
use super::tracer::Tracer;
use super::worker::PathWorker;
use crate::adapters;
use crate::material::Features;

/// A worker on llvmpipe, or else on any device.
fn worker(scene: &Arc<PreparedScene>, paths: u64) -> Option<PathWorker> {
    let there = adapters();
    let software = there.iter().find(|adapter| adapter.name.contains("llvmpipe"));
    let Some(wanted) = std::env::var("BOTTEGA_GPU").ok().or(software.or(there.first()).map(|it| it.name.clone()))
    else {
        eprintln!("skipped: no Vulkan adapter; install a driver, or Mesa's llvmpipe");
        return None;
    };
    let adapter = GpuAdapter::choose(Some(&wanted)).unwrap();
    let shelf = Arc::new(SceneShelf::default());
    shelf.put(&adapter.encode(scene).unwrap());
    let options = PathOptions { paths, timeout: std::time::Duration::from_secs(120), ..PathOptions::default() };
    let open = move || Tracer::new(&adapter.adapter, &adapter.info, &options);
    Some(PathWorker::new(shelf, wanted, Box::new(open)).unwrap())
}

fn layout() -> Layout {
    Layout::new([Aov::Albedo, Aov::Normal, Aov::Depth].into_iter().collect::<AovSet>())
}

fn prepare(scene: Scene) -> Arc<PreparedScene> {
    Arc::new(PreparedScene::new(Arc::new(scene), &PrepareOptions::default()).unwrap())
}

fn settings() -> PathSettings {
    PathSettings { guiding: false, max_depth: 6, filter: Filter::Box { radius: 0.5 }, ..PathSettings::default() }
}

/// The samples of a small image, by the device and by the CPU.
struct TilePair {
    device: Tile,
    processor: Tile,
}

const SIDE: u32 = 48;

fn view(scene: &PreparedScene) -> View {
    View::of_scene(scene.scene(), 0, SIDE, SIDE).unwrap()
}

fn paint(
    worker: &mut PathWorker,
    scene: &Arc<PreparedScene>,
    settings: PathSettings,
    samples: std::ops::Range<u32>,
) -> TilePair {
    let settings = Arc::new(settings);
    let tile = Tile::new(Rect::new(0, 0, SIDE, SIDE), layout());
    let block = BlockWork {
        scene: Arc::clone(scene),
        prepass: Arc::default(),
        view: view(scene),
        settings,
        tile,
        samples,
        light_groups: None,
        catchers: None,
    };
    let processor = block.clone().perform().unwrap().tile;
    let outcome = worker.perform(vec![RenderWork::Block(block)]).remove(0);
    match outcome.unwrap() {
        RenderOutput::Block(output) => TilePair { device: output.tile, processor },
        other => panic!("{other:?}"),
    }
}

impl TilePair {
    /// Of single samples: the share of pixels in which any value differs by more than a thousandth.
    fn differing(&self) -> f64 {
        let stride = self.device.layout().stride();
        let pairs = self.device.sums().chunks_exact(stride).zip(self.processor.sums().chunks_exact(stride));
        let close = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-3 * (a.abs() + b.abs()) + 1e-5;
        let different = |(a, b): &(&[f32], &[f32])| !a.iter().zip(b.iter()).all(close);
        let all = pairs.clone().count();
        for (a, b) in pairs.clone().filter(different).take(4) {
            eprintln!("  device {a:?}\n  processor {b:?}");
        }
        pairs.filter(different).count() as f64 / all as f64
    }

    /// The mean radiance of all pixels, by the device and by the CPU.
    fn means(&self) -> [f64; 2] {
        [&self.device, &self.processor].map(|tile| {
            let stride = tile.layout().stride();
            let pixels = tile.sums().chunks_exact(stride);
            let count = pixels.clone().map(|pixel| f64::from(pixel[Layout::SAMPLE_COUNT])).sum::<f64>();
            pixels.map(|pixel| f64::from(pixel[0] + pixel[1] + pixel[2])).sum::<f64>() / count
        })
    }
}

/// Checks that single paths agree except for a few that graze an edge, and that the means agree.
fn check(scene: Scene, all_settings: &[PathSettings]) {
    let scene = prepare(scene);
    let Some(mut worker) = worker(&scene, 1 << 14) else { return };
    for &settings in all_settings {
        let single = paint(&mut worker, &scene, settings, 5..6);
        let differing = single.differing();
        eprintln!("{:.2} % of the paths differ", 100.0 * differing);
        assert!(differing <= 0.01, "{} % of the paths differ; means {:?}", 100.0 * differing, single.means());
        let [device, processor] = paint(&mut worker, &scene, settings, 0..8).means();
        assert!(processor > 0.01, "the picture is black");
        assert!((device / processor - 1.0).abs() < 0.005, "{device} against {processor}");
    }
}

#[test]
fn the_kernels_are_sound() {
    let all = [false, true].into_iter().flat_map(|has_opacity| {
        [Features::ALL, Features::default()].map(|features| Variant { has_opacity, features, stack_size: 16 })
    });
    let sources = all.flat_map(|variant| [traversal_source(variant), shading_source(variant)]);
    for source in sources.chain([camera_source(), plan_source()]) {
        let module = wgpu::naga::front::wgsl::parse_str(&source)
            .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
        let flags = wgpu::naga::valid::ValidationFlags::all();
        let mut validator = wgpu::naga::valid::Validator::new(flags, wgpu::naga::valid::Capabilities::all());
        validator.validate(&module).unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
    }
}

#[test]
fn a_box_with_a_lamp_is_the_same_by_all_strategies() {
    let strategies = [
        (DirectLight::Combined, 1),
        (DirectLight::BsdfSampling, 1),
        (DirectLight::LightSampling, 1),
        (DirectLight::Combined, 3),
    ];
    let settings =
        strategies.map(|(direct_light, light_samples)| PathSettings { direct_light, light_samples, ..settings() });
    check(scenes::cornell(), &settings);
}

#[test]
fn long_paths_and_wide_filters_are_the_same() {
    let deep = PathSettings { max_depth: 70, roulette_depth: 60, ..settings() };
    let filters = [
        Filter::Tent { radius: 1.0 },
        Filter::Mitchell { radius: 2.0, b: 1.0 / 3.0, c: 1.0 / 3.0 },
        Filter::Gaussian { radius: 1.5, sigma: 0.5 },
    ];
    let settings: Vec<_> =
        filters.map(|filter| PathSettings { filter, ..settings() }).into_iter().chain([deep]).collect();
    check(scenes::open(), &settings);
}

#[test]
fn skies_instances_and_lenses_are_the_same() {
    check(scenes::placed(), &[settings()]);
}

#[test]
fn views_all_around_are_the_same() {
    // Wide enough to look up directions beyond the edges of the image.
    let wide = PathSettings { filter: Filter::Gaussian { radius: 1.5, sigma: 0.5 }, ..settings() };
    for panorama in [Panorama::Equirectangular, Panorama::EqualArea] {
        let mut scene = scenes::cornell();
        scene.cameras[0].projection = Projection::Panorama(panorama);
        scene.cameras[0].world_from_camera.translation = glam::Vec3A::new(0.1, 0.2, 0.3);
        check(scene, &[wide]);
    }
}

#[test]
fn pictures_between_clip_planes_are_the_same() {
    for (projection, clip, lens_radius) in [
        (Projection::Perspective { vertical_fov: 0.7 }, Clip { near: 3.7, far: 4.9 }, 0.1),
        (Projection::Orthographic { height: 2.2 }, Clip { near: 3.9, far: f32::INFINITY }, 0.0),
    ] {
        let mut scene = scenes::cornell();
        scene.environment = Some(Environment::uniform(Vec3::new(0.2, 0.5, 0.9)));
        let camera = &mut scene.cameras[0];
        (camera.projection, camera.clip, camera.lens_radius, camera.focus_distance) =
            (projection, clip, lens_radius, 4.0);
        check(scene, &[settings()]);
    }
}

#[test]
fn pictures_that_shine_are_the_same() {
    check(scenes::pictures(), &[settings()]);
}

#[test]
fn cut_outs_are_the_same() {
    check(scenes::cut_outs(), &[settings()]);
}

#[test]
fn glass_and_metal_are_the_same() {
    check(scenes::glass(), &[PathSettings { max_depth: 12, ..settings() }]);
}

#[test]
fn reliefs_are_the_same() {
    check(scenes::reliefs(), &[settings()]);
}

#[test]
fn many_lights_are_the_same() {
    check(scenes::many_lights(), &[settings()]);
}

#[test]
fn a_lost_device_returns_its_blocks_and_is_opened_again() {
    let scene = prepare(scenes::open());
    let Some(mut worker) = worker(&scene, 1 << 10) else { return };
    let block = |x: u32| BlockWork {
        scene: Arc::clone(&scene),
        prepass: Arc::default(),
        view: view(&scene),
        settings: Arc::new(settings()),
        tile: Tile::new(Rect::new(x, 0, x + 8, 8), layout()),
        samples: 0..2,
        light_groups: None,
        catchers: None,
    };
    worker.device().unwrap().lose();
    let outcomes = worker.perform(vec![RenderWork::Block(block(0)), RenderWork::Block(block(8))]);
    for (outcome, x) in outcomes.into_iter().zip([0, 8]) {
        let failed = outcome.unwrap_err();
        let RenderWork::Block(given) = failed.work else { panic!("not a block") };
        assert_eq!(given.tile, block(x).tile);
        assert!(failed.reason.contains("device"), "{}", failed.reason);
    }
    assert!(worker.device().is_none());
    let again = worker.perform(vec![RenderWork::Block(block(0))]).remove(0);
    assert!(matches!(again, Ok(RenderOutput::Block(output)) if output.tile.sums().iter().sum::<f32>() > 1.0));
}

#[test]
fn unsupported_units_are_returned_and_the_others_are_done() {
    let scene = prepare(scenes::open());
    let Some(mut worker) = worker(&scene, 1 << 10) else { return };
    let block = |scene: &Arc<PreparedScene>, layout: Layout, samples| {
        let tile = Tile::new(Rect::new(3, 4, 8, 6), layout);
        let settings = Arc::new(settings());
        RenderWork::Block(BlockWork {
            scene: Arc::clone(scene),
            prepass: Arc::default(),
            view: view(scene),
            settings,
            tile,
            samples,
            light_groups: None,
            catchers: None,
        })
    };
    let costly = Layout::new(AovSet::NONE.with(Aov::Cost));
    let channels = ["R", "G", "B"].map(str::to_owned).to_vec();
    let group = Layer { name: "light_key".to_owned(), channels, combine: Combine::Mean };
    let grouped = Layout::with_layers(AovSet::NONE, vec![group]).unwrap();
    let projection = Projection::Panorama(Panorama::Cube);
    let cube = Camera { projection, ..scene.scene().cameras[0].clone() };
    let mut all_around = block(&scene, layout(), 0..1);
    if let RenderWork::Block(block) = &mut all_around {
        block.view.camera = Arc::new(cube);
    }
    let works = vec![
        all_around,
        block(&scene, costly, 0..1),
        block(&scene, grouped, 0..1),
        RenderWork::Rays { scene: prepare(scenes::open()), rays: Arc::default() },
        block(&prepare(scenes::open()), layout(), 0..1),
        block(&scene, layout(), 0..0),
        block(&scene, Layout::new(AovSet::NONE), 0..3),
    ];
    let outcomes = worker.perform(works);
    let reasons: Vec<_> = outcomes.iter().map(|outcome| outcome.as_ref().err().map(|failed| &*failed.reason)).collect();
    assert_eq!(
        reasons,
        [
            Some("devices do not support this camera"),
            Some("devices do not support the layer `cost`"),
            Some("devices do not support the layer `light_key`"),
            Some("the scene was not given to this device"),
            Some("the scene was not given to this device"),
            None,
            None
        ]
    );
    let Ok(RenderOutput::Block(output)) = &outcomes[6] else { panic!("no block") };
    assert!(output.tile.sums().chunks_exact(6).all(|pixel| pixel[Layout::SAMPLE_COUNT] == 3.0));
}

#[test]
fn other_samples_are_other_paths() {
    let scene = prepare(scenes::cornell());
    let Some(mut worker) = worker(&scene, 1 << 12) else { return };
    let device = paint(&mut worker, &scene, settings(), 5..6).device;
    let processor = paint(&mut worker, &scene, settings(), 6..7).processor;
    assert!(TilePair { device, processor }.differing() > 0.5, "the comparison sees nothing");
}

#[test]
fn rays_are_answered_beside_paths() {
    let scene = prepare(scenes::cornell());
    let Some(mut worker) = worker(&scene, 1 << 10) else { return };
    let directions = (0..200).map(|i| Vec3::new((i % 20) as f32 * 0.03 - 0.3, (i / 20) as f32 * 0.06 - 0.3, -1.0));
    let rays = directions.map(|d| Ray { t_max: 4.5, ..Ray::new(Vec3::new(0.0, 0.0, 4.0), d) }).collect();
    let rays = Arc::new(rays);
    let works = [
        RenderWork::Rays { scene: Arc::clone(&scene), rays: Arc::clone(&rays) },
        RenderWork::Occlusion { scene: Arc::clone(&scene), rays },
    ];
    let outcomes = worker.perform(works.to_vec());
    for (outcome, right) in outcomes.into_iter().zip(works.map(RenderWork::perform)) {
        match (outcome.unwrap(), right) {
            (RenderOutput::Hits(hits), RenderOutput::Hits(right)) => {
                let same = hits.iter().zip(&right).filter(|(a, b)| a.instance == b.instance).count();
                assert!(same >= 199 && right.iter().filter(|hit| hit.is_some()).count() > 50, "{same}");
            }
            (RenderOutput::Occlusion(hits), RenderOutput::Occlusion(right)) => {
                let same = hits.iter().zip(&right).filter(|(a, b)| a == b).count();
                assert!(same >= 199, "{same}");
            }
            (other, _) => panic!("{other:?}"),
        }
    }
}
