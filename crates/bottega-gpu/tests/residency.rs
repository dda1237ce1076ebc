//! Scenes in the memory of a device: two of them in turn, through the allocator.

use std::sync::Arc;

use bottega_gpu::{EncodedScene, GpuAdapter, GpuPaths, GpuScenes, PathOptions, adapters};
use bottega_hra::{Hra, HraConfig, Lane, ResourceId, VirtualCpu, Window, WorkUnit};
use bottega_image::{AovSet, Layout, Rect, Tile};
use bottega_render::{BlockWork, PathSettings, PrepareOptions, PreparedScene, RenderOutput, RenderWork, View};
use bottega_scene::{Camera, Environment, Material, Mesh, Scene};
use glam::{Affine3A, Vec3};

const SIDE: u32 = 32;

/// The adapter that `BOTTEGA_GPU` names, or llvmpipe, or any; `None` if there is no adapter.
fn adapter() -> Option<GpuAdapter> {
    let there = adapters();
    let software = there.iter().find(|adapter| adapter.name.contains("llvmpipe"));
    let name = std::env::var("BOTTEGA_GPU").ok().or(software.or(there.first()).map(|adapter| adapter.name.clone()));
    if name.is_none() {
        eprintln!("skipped: no Vulkan adapter; install a driver, or Mesa's llvmpipe");
    }
    name.map(|name| GpuAdapter::choose(Some(&name)).unwrap())
}

/// A ball on a floor of many triangles, so that it is the geometry that takes the memory.
fn scene(colour: Vec3, height: f32) -> Scene {
    let mut scene = Scene {
        cameras: vec![Camera {
            world_from_camera: Affine3A::from_translation(Vec3::new(0.0, 0.3, 5.0)),
            ..Camera::default()
        }],
        environment: Some(Environment::uniform(Vec3::new(0.4, 0.6, 1.0))),
        ..Scene::default()
    };
    let matte = scene.push_material(Material::matte(colour));
    for cell in 0..400 {
        let corner = Vec3::new((cell % 20) as f32 * 0.4 - 4.0, -1.0, (cell / 20) as f32 * 0.4 - 4.0);
        scene.push_surface(Mesh { material: matte, ..Mesh::quad(corner, 0.4 * Vec3::Z, 0.4 * Vec3::X) });
    }
    scene.push_sphere(height * Vec3::Y, 1.0, matte);
    scene
}

fn prepare(scene: Scene) -> Arc<PreparedScene> {
    Arc::new(PreparedScene::new(Arc::new(scene), &PrepareOptions::default()).unwrap())
}

fn work(scene: &Arc<PreparedScene>, rect: Rect) -> RenderWork {
    RenderWork::Block(BlockWork {
        scene: Arc::clone(scene),
        prepass: Arc::default(),
        view: View::of_scene(scene.scene(), 0, SIDE, SIDE).unwrap(),
        settings: Arc::new(PathSettings { guiding: false, max_depth: 4, ..PathSettings::default() }),
        tile: Tile::new(rect, Layout::new(AovSet::NONE)),
        samples: 0..4,
        light_groups: None,
        catchers: None,
    })
}

/// Makes a device with this much memory for scenes, beside this many processors.
struct Bench {
    hra: Hra<RenderWork>,
    scenes: GpuScenes,
    encoded: Vec<EncodedScene>,
    device: ResourceId,
}

impl Bench {
    fn new(adapter: &GpuAdapter, memory: u64, processors: usize, all: &[Arc<PreparedScene>]) -> Self {
        let options = PathOptions { memory: Some(memory), paths: 1 << 12, ..PathOptions::default() };
        let gpu = GpuPaths::open(adapter.clone(), &options).unwrap();
        let scenes = gpu.scenes();
        let encoded: Vec<_> = all.iter().map(|scene| adapter.encode(scene).unwrap()).collect();
        encoded.iter().for_each(|encoded| scenes.admit(encoded).unwrap());
        let window = Window { packets: 2, units_per_packet: 8, ..Window::default() };
        let lanes = VirtualCpu::lanes(processors, RenderWork::perform).into_iter().map(Lane::Direct);
        let lanes = lanes.chain([Lane::Windowed(Box::new(gpu) as _, window)]).collect();
        Self {
            hra: Hra::with_lanes(HraConfig::default(), lanes),
            scenes,
            encoded,
            device: ResourceId(processors as u32),
        }
    }

    /// Renders a scene and checks the picture. Returns the number of blocks that the device rendered.
    fn paint(&self, scene: &Arc<PreparedScene>) -> usize {
        let whole = Rect::new(0, 0, SIDE, SIDE);
        let client = self.hra.client();
        let units = whole.blocks(8).zip(0..).map(|(rect, n)| WorkUnit::new(work(scene, rect), n));
        client.submit_group(units.collect()).unwrap();
        let (mut picture, mut by_device) = (Tile::new(whole, Layout::new(AovSet::NONE)), 0);
        while let Some(completed) = client.take() {
            by_device += usize::from(completed.resource == Some(self.device));
            let Ok(RenderOutput::Block(output)) = completed.output else { panic!("{:?}", completed.output) };
            picture.copy_from(&output.tile);
        }
        let RenderOutput::Block(right) = work(scene, whole).perform() else { panic!("no block") };
        let pixels = picture.sums().chunks_exact(6).zip(right.tile.sums().chunks_exact(6));
        let difference: f64 = pixels.map(|(a, b)| f64::from((a[0] - b[0]).abs() / b[0].max(1e-3))).sum();
        assert!(difference / f64::from(SIDE * SIDE) < 5e-3, "{difference}");
        by_device
    }

    fn bytes(&self, scene: usize) -> u64 {
        self.encoded[scene].bytes()
    }
}

fn scenes() -> [Arc<PreparedScene>; 2] {
    [prepare(scene(Vec3::new(0.8, 0.4, 0.2), 0.0)), prepare(scene(Vec3::new(0.2, 0.4, 0.8), 0.5))]
}

#[test]
fn nothing_is_sent_twice_that_fits() {
    let Some(adapter) = adapter() else { return };
    let [a, b] = scenes();
    let bench = Bench::new(&adapter, 1 << 20, 0, &[Arc::clone(&a), Arc::clone(&b)]);
    // At most a scene is sent to try the kernels; the others with the first work on them.
    assert!(bench.scenes.sent_bytes() <= bench.bytes(0).max(bench.bytes(1)), "{}", bench.scenes.sent_bytes());
    for scene in [&a, &b, &a, &b, &a] {
        assert_eq!(bench.paint(scene), 16);
    }
    let both = bench.bytes(0) + bench.bytes(1);
    // Arrays that two scenes share are stored once.
    assert!(bench.scenes.sent_bytes() <= both, "{} of {both}", bench.scenes.sent_bytes());
    assert!(bench.scenes.sent_bytes() > bench.bytes(0));
    assert_eq!(bench.hra.report().resources[0].resident_bytes, both);
}

#[test]
fn the_scene_that_is_not_needed_makes_room() {
    let Some(adapter) = adapter() else { return };
    let [a, b] = scenes();
    let one = adapter.encode(&a).unwrap().bytes().max(adapter.encode(&b).unwrap().bytes());
    let bench = Bench::new(&adapter, one + one / 2, 0, &[Arc::clone(&a), Arc::clone(&b)]);
    assert_eq!(bench.paint(&a), 16);
    let first = bench.scenes.sent_bytes();
    assert_eq!((first, bench.paint(&a)), (bench.bytes(0), 16));
    assert_eq!(bench.scenes.sent_bytes(), first, "it was there");
    assert_eq!(bench.paint(&b), 16);
    assert!(bench.scenes.resident_bytes() <= one + one / 2, "{}", bench.scenes.resident_bytes());
    let second = bench.scenes.sent_bytes();
    assert!(second > first);
    assert_eq!(bench.paint(&a), 16, "what was thrown out is sent again");
    assert!(bench.scenes.sent_bytes() > second);
    let report = bench.hra.report();
    assert_eq!(report.resources[0].resident_bytes, bench.bytes(0));
    assert!(report.incidents.is_empty(), "{:?}", report.incidents);
}

#[test]
fn scenes_too_large_for_the_device_are_painted_by_processors() {
    let Some(adapter) = adapter() else { return };
    let [a, b] = scenes();
    let bench = Bench::new(&adapter, 1000, 1, &[Arc::clone(&a), Arc::clone(&b)]);
    assert_eq!((bench.paint(&a), bench.paint(&b)), (0, 0));
    assert_eq!((bench.scenes.sent_bytes(), bench.hra.report().resources[1].resident_bytes), (0, 0));
}

#[test]
fn unchanged_data_is_sent_once_for_all_frames() {
    let Some(adapter) = adapter() else { return };
    let frame = |shift: f32| {
        let mut scene = scene(Vec3::new(0.8, 0.4, 0.2), 0.0);
        scene.cameras[0].world_from_camera.translation.x += shift;
        prepare(scene)
    };
    let frames = [frame(0.0), frame(0.1)];
    let bench = Bench::new(&adapter, 1 << 20, 0, &frames);
    bench.paint(&frames[0]);
    let first = bench.scenes.sent_bytes();
    bench.paint(&frames[1]);
    // The camera travels with the work.
    assert_eq!(bench.scenes.sent_bytes(), first);
}

#[test]
fn a_device_with_less_memory_than_promised_returns_the_work() {
    let Some(adapter) = adapter() else { return };
    let [a, b] = scenes();
    // The allocator gets a larger size than there is, as if another program had taken memory meanwhile.
    let options = PathOptions { memory: Some(1000), paths: 1 << 12, ..PathOptions::default() };
    let gpu = GpuPaths::open(adapter.clone(), &options).unwrap();
    gpu.scenes().admit(&adapter.encode(&b).unwrap()).unwrap();
    let scenes = gpu.scenes();
    let encoded = adapter.encode(&a).unwrap();
    scenes.admit(&encoded).unwrap();
    let lanes = VirtualCpu::lanes(1, RenderWork::perform).into_iter().map(Lane::Direct);
    let window = Window { packets: 2, units_per_packet: 8, ..Window::default() };
    let lanes = lanes.chain([Lane::Windowed(Box::new(UnlimitedMemory(gpu)) as _, window)]).collect();
    let hra = Hra::with_lanes(HraConfig::default(), lanes);
    let bench = Bench { hra, scenes, encoded: vec![encoded], device: ResourceId(1) };
    // The processor may be done with a small picture before the device asks for any of it.
    let ran_out = || bench.hra.report().incidents.iter().any(|it| it.fault == bottega_hra::Fault::OutOfMemory);
    let is_reported = (0..200).any(|_| {
        assert_eq!(bench.paint(&a), 0);
        ran_out()
    });
    assert!(is_reported, "{:?}", bench.hra.report().incidents);
}

/// A device that reports unlimited memory.
struct UnlimitedMemory(GpuPaths);

impl bottega_hra::WindowedResource<RenderWork> for UnlimitedMemory {
    fn descriptor(&self) -> bottega_hra::ResourceDescriptor {
        bottega_hra::ResourceDescriptor { memory_bytes: Some(1 << 40), ..self.0.descriptor() }
    }

    fn send(&mut self, packet: bottega_hra::Packet<RenderWork>) {
        self.0.send(packet);
    }

    fn recover(&mut self) -> Result<(), String> {
        self.0.recover()
    }

    fn evict(&mut self, data: bottega_hra::DataId) {
        self.0.evict(data);
    }
}
