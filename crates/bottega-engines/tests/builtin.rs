//! The built-in engine as the farm uses it.

use std::{
    ops::Range,
    sync::{Arc, mpsc},
    thread,
    time::Duration,
};

use bottega_engines::{
    BuiltinEngine, BuiltinOptions, CancelSwitch, Devices, EngineError, EnginePreference, Painted, RenderEngine,
    TaskProgress, Tunables, ZoneTask,
};
use bottega_image::{Aov, AovSet, Layout, Rect, Tile};
use bottega_render::{PathSettings, PrepareOptions, PreparedScene, View};
use bottega_scene::{Camera, Layered, Material, Mesh, Scene, Spectrum};
use glam::Vec3;

const FRAME: Rect = Rect { x0: 0, y0: 0, x1: 40, y1: 33 };

/// A glossy floor, a ball of glass and a bright quad.
fn scene() -> Scene {
    let mut scene = Scene::default();
    let floor = scene.push_material(Layered { roughness: 0.3.into(), ..Layered::default() }.into());
    let glass =
        scene.push_material(Layered { roughness: 0.0.into(), transmission: 1.0.into(), ..Layered::default() }.into());
    let light = scene.push_material(Material { emission: Spectrum::splat(5.0).into(), ..Material::default() });
    let quad = Mesh::quad(Vec3::new(-2.0, 0.0, 2.0), Vec3::X * 4.0, Vec3::Z * -4.0);
    scene.push_surface(quad.with_material(floor));
    scene.push_sphere(Vec3::Y, 0.8, glass);
    let quad = Mesh::quad(Vec3::new(-0.5, 3.0, -0.5), Vec3::X, Vec3::Z);
    scene.push_surface(quad.with_material(light));
    let ball = (Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    scene.cameras.push(Camera::framing_from(Vec3::new(0.0, 0.5, 2.0), ball, 1.2));
    scene.validate().expect("a sound scene");
    scene
}

fn engine(threads: usize) -> BuiltinEngine {
    let scene = PreparedScene::new(Arc::new(scene()), &PrepareOptions::default()).expect("a scene");
    let options = BuiltinOptions {
        view: View::of_scene(scene.scene(), 0, FRAME.x1, FRAME.y1).expect("a camera"),
        settings: PathSettings::default(),
        layout: Layout::new(AovSet::NONE.with(Aov::Normal)),
        threads,
        wavefront: false,
    };
    BuiltinEngine::new(Arc::new(scene), options, Devices::default())
}

fn begin(
    engine: &BuiltinEngine,
    rect: Rect,
    samples: Range<u32>,
    tile: Option<Tile>,
) -> mpsc::Receiver<Result<Painted, EngineError>> {
    begin_with(engine, rect, samples, tile, CancelSwitch::default())
}

fn begin_with(
    engine: &BuiltinEngine,
    rect: Rect,
    samples: Range<u32>,
    tile: Option<Tile>,
    cancel: CancelSwitch,
) -> mpsc::Receiver<Result<Painted, EngineError>> {
    let (sender, receiver) = mpsc::channel();
    let tunables = Tunables { max_depth: 6, light_samples: 1 };
    let task = ZoneTask {
        rect,
        samples,
        tunables,
        preference: EnginePreference::default(),
        tile,
        parts: None,
        cancel,
        progress: TaskProgress::default(),
    };
    engine.start(task, Box::new(move |painted| drop(sender.send(painted))));
    receiver
}

fn paint(engine: &BuiltinEngine, rect: Rect, samples: Range<u32>, tile: Option<Tile>) -> Painted {
    begin(engine, rect, samples, tile).recv().expect("a report").expect("a tile")
}

#[test]
fn zones_in_parts_and_passes_have_the_bits_of_the_whole() {
    let whole = paint(&engine(1), FRAME, 0..9, None);
    assert!(whole.complete && whole.busy > Duration::ZERO);
    let engine = engine(2);
    let mut joined = Tile::new(FRAME, whole.tile.layout().clone());
    for rect in [Rect::new(0, 0, 17, 33), Rect::new(17, 0, 40, 20), Rect::new(17, 20, 40, 33)] {
        let first = paint(&engine, rect, 0..2, None);
        let rest = paint(&engine, rect, 2..9, Some(first.tile));
        joined.copy_from(&rest.tile);
    }
    assert_eq!(joined, whole.tile);
    assert_eq!(engine.samples_done(), FRAME.area() * 9);
}

#[test]
fn several_zones_are_under_way_at_once() {
    let engine = engine(2);
    let zones: Vec<_> = FRAME.blocks(16).map(|rect| (rect, begin(&engine, rect, 0..3, None))).collect();
    for (rect, zone) in zones {
        let painted = zone.recv().expect("a report").expect("a tile");
        assert!(painted.complete);
        assert_eq!(painted.tile.rect(), rect);
        assert!(rect.pixels().all(|(x, y)| painted.tile.pixel(x, y)[Layout::SAMPLE_COUNT] == 3.0));
    }
}

#[test]
fn a_cancelled_zone_is_reported_with_what_it_has_and_can_be_gone_on_with() {
    let many = 20_000;
    let first = engine(1);
    let cancel = CancelSwitch::default();
    let zone = begin_with(&first, FRAME, 0..many, None, cancel.clone());
    thread::sleep(Duration::from_millis(60));
    cancel.cancel();
    let cancelled = zone.recv().expect("a report").expect("a tile");
    assert!(!cancelled.complete);
    let counts: Vec<u32> =
        FRAME.pixels().map(|(x, y)| cancelled.tile.pixel(x, y)[Layout::SAMPLE_COUNT] as u32).collect();
    assert!(counts.iter().any(|&count| count > 0) && counts.iter().all(|&count| count < many));

    let target = counts.iter().max().expect("pixels") + 2;
    let engine = engine(2);
    let resumed = paint(&engine, FRAME, 0..target, Some(cancelled.tile));
    assert_eq!(resumed.tile, paint(&engine, FRAME, 0..target, None).tile);
}

#[test]
fn an_engine_may_end_with_its_last_zone() {
    let engine = Arc::new(engine(1));
    let (sender, receiver) = mpsc::channel();
    let last = Arc::clone(&engine);
    let tunables = Tunables { max_depth: 6, light_samples: 1 };
    let (cancel, progress) = (CancelSwitch::default(), TaskProgress::default());
    let task = ZoneTask {
        rect: FRAME,
        samples: 0..64,
        tunables,
        preference: EnginePreference::default(),
        tile: None,
        parts: None,
        cancel,
        progress: progress.clone(),
    };
    engine.start(
        task,
        Box::new(move |painted| {
            assert!(painted.is_ok());
            assert_eq!(progress.get(), 64 * FRAME.area());
            while Arc::strong_count(&last) > 1 {
                thread::yield_now();
            }
            drop(last);
            sender.send(()).expect("somebody waits");
        }),
    );
    drop(engine);
    // A thread that waits for itself panics before it reports this.
    receiver.recv().expect("the zone's thread goes on after the engine's end");
}

#[test]
fn the_survey_sees_the_glass() {
    let survey = engine(2).survey(20, 16).expect("a survey");
    assert_eq!((survey.width, survey.height, survey.pixels.len()), (20, 16, 320));
    let middle = survey.pixels[8 * 20 + 10];
    let corner = survey.pixels[0];
    assert!(middle.recursion_levels >= 1.0, "{middle:?}");
    assert_eq!(corner.recursion_levels, 0.0, "{corner:?}");
}
