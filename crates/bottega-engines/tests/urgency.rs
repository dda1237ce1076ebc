//! Two pictures on the same processors, one of which is urgent.

use std::{
    sync::{Arc, mpsc},
    thread,
    time::{Duration, Instant},
};

use bottega_engines::{
    BuiltinEngine, BuiltinOptions, CancelSwitch, Devices, EnginePreference, RenderEngine, Resources, TaskProgress,
    Tunables, Urgency, ZoneTask,
};
use bottega_image::{AovSet, Layout, Rect};
use bottega_render::{PathSettings, PrepareOptions, PreparedScene, Prepass, View};
use bottega_scene::{Camera, Layered, Material, Mesh, Scene, Spectrum};
use glam::Vec3;

const SIDE: u32 = 128;

fn scene() -> Arc<PreparedScene> {
    let mut scene = Scene::default();
    let floor = scene.push_material(Layered { roughness: 0.3.into(), ..Layered::default() }.into());
    let light = scene.push_material(Material { emission: Spectrum::splat(5.0).into(), ..Material::default() });
    let quad = Mesh::quad(Vec3::new(-2.0, 0.0, 2.0), Vec3::X * 4.0, Vec3::Z * -4.0);
    scene.push_surface(quad.with_material(floor));
    scene.push_sphere(Vec3::Y, 0.8, floor);
    let quad = Mesh::quad(Vec3::new(-0.5, 3.0, -0.5), Vec3::X, Vec3::Z);
    scene.push_surface(quad.with_material(light));
    let ball = (Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    scene.cameras.push(Camera::framing_from(Vec3::new(0.0, 0.5, 2.0), ball, 1.2));
    scene.validate().expect("a sound scene");
    Arc::new(PreparedScene::new(Arc::new(scene), &PrepareOptions::default()).expect("a scene"))
}

fn engine(scene: &Arc<PreparedScene>, resources: &Arc<Resources>, urgency: Urgency) -> BuiltinEngine {
    let options = BuiltinOptions {
        view: View::of_scene(scene.scene(), 0, SIDE, SIDE).expect("a camera"),
        settings: PathSettings::default(),
        layout: Layout::new(AovSet::NONE),
        threads: 1,
        wavefront: false,
    };
    let prepass: Arc<Prepass> = Arc::default();
    BuiltinEngine::on(Arc::clone(scene), prepass, options, Arc::clone(resources)).with_urgency(urgency)
}

/// Renders the whole picture, with more samples than there is time for. Returns whether it is complete.
fn begin(engine: &BuiltinEngine, cancel: &CancelSwitch) -> mpsc::Receiver<bool> {
    let (sender, receiver) = mpsc::channel();
    let task = ZoneTask {
        rect: Rect::of_size(SIDE, SIDE),
        samples: 0..1 << 20,
        tunables: Tunables { max_depth: 6, light_samples: 1 },
        preference: EnginePreference::default(),
        tile: None,
        parts: None,
        cancel: cancel.clone(),
        progress: TaskProgress::default(),
    };
    let done = move |painted: Result<bottega_engines::Painted, _>| _ = sender.send(painted.expect("a tile").complete);
    engine.start(task, Box::new(done));
    receiver
}

/// Samples of a long picture of sixteen zones that are rendered before the first block of a preview.
fn samples_meanwhile(urgency: Urgency) -> u64 {
    let (scene, resources) = (scene(), Arc::new(Resources::new(1, Devices::default(), None)));
    let (long, cancel) = (engine(&scene, &resources, Urgency::Picture), CancelSwitch::default());
    let zones: Vec<_> = (0..16).map(|_| begin(&long, &cancel)).collect();
    until(|| long.samples_done() > 0);
    let preview = engine(&scene, &resources, urgency);
    let before = long.samples_done();
    preview.survey(SIDE / 8, SIDE / 8).expect("a look");
    let (sender, seen) = mpsc::channel();
    preview.watch(move |_| _ = sender.send(()));
    let painted = begin(&preview, &cancel);
    seen.recv_timeout(Duration::from_secs(60)).expect("a block");
    let samples = long.samples_done() - before;
    cancel.cancel();
    zones.iter().chain([&painted]).for_each(|zone| _ = zone.recv());
    samples
}

/// Waits until a condition holds.
fn until(is_so: impl Fn() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(begun.elapsed() < Duration::from_secs(60), "it does not come to pass");
        thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_preview_in_the_middle_of_a_long_picture_is_seen_sooner_by_its_priority() {
    let (with, without) = (samples_meanwhile(Urgency::Look), samples_meanwhile(Urgency::Picture));
    eprintln!("samples of the picture before the first block of the preview: {with}; without priority {without}");
    assert!(with < without, "{with} with priority, {without} without");
}

#[test]
fn an_abandoned_look_is_not_painted_further_and_is_reported() {
    let (scene, resources) = (scene(), Arc::new(Resources::new(1, Devices::default(), None)));
    let (long, cancel) = (engine(&scene, &resources, Urgency::Picture), CancelSwitch::default());
    let picture = begin(&long, &cancel);
    let left = || {
        let look = engine(&scene, &resources, Urgency::Look);
        let painted = begin(&look, &CancelSwitch::default());
        until(|| look.samples_done() > 0);
        assert_eq!(look.report().expiries.count(), 0);
        look.leave();
        assert!(!painted.recv().expect("a report"), "it is not whole");
        look
    };
    // Leave a look while some of its units wait: nobody renders them. Usually the first one has some.
    let begun = Instant::now();
    let look = loop {
        let look = left();
        if look.report().expiries.waiting >= 1 {
            break look;
        }
        assert!(begun.elapsed() < Duration::from_secs(60), "no waiting unit expires");
    };
    let samples = look.samples_done();
    // Later requests to it are not rendered either, and other pictures continue.
    let before = long.samples_done();
    assert!(!begin(&look, &CancelSwitch::default()).recv().expect("a report"));
    assert!(look.survey(8, 8).is_err());
    until(|| long.samples_done() > before);
    assert_eq!(look.samples_done(), samples);
    cancel.cancel();
    assert!(!picture.recv().expect("a report"));
}

#[test]
fn a_picture_is_not_left() {
    let (scene, resources) = (scene(), Arc::new(Resources::new(1, Devices::default(), None)));
    let picture = engine(&scene, &resources, Urgency::Crop);
    picture.leave();
    assert!(picture.survey(8, 8).is_ok());
    assert_eq!(picture.report().expiries.count(), 0);
}
