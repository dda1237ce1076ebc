//! A picture through the allocator, by a processor and a device together.

use std::{
    sync::{
        Arc, Mutex,
        mpsc::{self, RecvTimeoutError},
    },
    time::Duration,
};

use bottega_gpu::{GpuError, GpuPaths, PathOptions, adapters};
use bottega_hra::{Hra, HraConfig, Lane, VirtualCpu, Window, WorkUnit};
use bottega_image::{AovSet, Layout, Rect, Tile};
use bottega_render::{BlockWork, PathSettings, PrepareOptions, PreparedScene, RenderOutput, RenderWork, View};
use bottega_scene::{Camera, Environment, Material, Medium, Mesh, Scene};
use glam::{Affine3A, Vec3};

/// Returns options for the adapter that `BOTTEGA_GPU` names, or llvmpipe, or any; `None` if there is no adapter.
fn options() -> Option<PathOptions> {
    if let Ok(name) = std::env::var("BOTTEGA_GPU") {
        return Some(PathOptions { adapter: Some(name), ..PathOptions::default() });
    }
    let there = adapters();
    let software = there.iter().find(|adapter| adapter.name.contains("llvmpipe"));
    let chosen = software.or(there.first()).map(|adapter| adapter.name.clone());
    if chosen.is_none() {
        eprintln!("skipped: no Vulkan adapter; install a driver, or Mesa's llvmpipe");
    }
    chosen.map(|adapter| PathOptions { adapter: Some(adapter), ..PathOptions::default() })
}

/// A ball on a floor below a sky.
fn scene() -> Scene {
    let mut scene = Scene {
        cameras: vec![Camera {
            world_from_camera: Affine3A::from_translation(Vec3::new(0.0, 0.3, 5.0)),
            ..Camera::default()
        }],
        environment: Some(Environment::uniform(Vec3::new(0.4, 0.6, 1.0))),
        ..Scene::default()
    };
    let floor = scene.push_material(Material::matte(Vec3::new(0.7, 0.5, 0.3)));
    let quad = Mesh::quad(Vec3::new(-4.0, -1.0, -4.0), 8.0 * Vec3::Z, 8.0 * Vec3::X);
    scene.push_surface(Mesh { material: floor, ..quad });
    scene.push_sphere(Vec3::ZERO, 1.0, floor);
    scene
}

const SIDE: u32 = 64;

#[test]
fn a_processor_and_a_device_paint_one_picture() {
    let Some(options) = options() else { return };
    let scene = Arc::new(PreparedScene::new(Arc::new(scene()), &PrepareOptions::default()).unwrap());
    let settings = Arc::new(PathSettings { guiding: false, max_depth: 4, ..PathSettings::default() });
    let gpu = GpuPaths::new(&scene, &options).unwrap();
    let window = Window { packets: 2, units_per_packet: 8, ..Window::default() };
    // The device has done a unit before the processor continues, however slow it is.
    let (tell, device_is_through) = mpsc::channel::<()>();
    let device_is_through = Arc::new(Mutex::new(device_is_through));
    let cpu = VirtualCpu::lanes(1, move |work: RenderWork| {
        // The sender is gone once the device has done something.
        let received = device_is_through.lock().unwrap().recv_timeout(Duration::from_secs(600));
        assert_eq!(received, Err(RecvTimeoutError::Disconnected), "the device does nothing");
        work.perform()
    });
    let mut tell = Some(tell);
    let lanes = cpu.into_iter().map(Lane::Direct).chain([Lane::Windowed(Box::new(gpu), window)]).collect();
    let hra = Hra::with_lanes(HraConfig::default(), lanes);
    let client = hra.client();
    let whole = Rect::new(0, 0, SIDE, SIDE);
    let layout = Layout::new(AovSet::NONE);
    let block = |rect| BlockWork {
        scene: Arc::clone(&scene),
        prepass: Arc::default(),
        view: View::of_scene(scene.scene(), 0, SIDE, SIDE).unwrap(),
        settings: Arc::clone(&settings),
        tile: Tile::new(rect, layout.clone()),
        samples: 0..16,
        light_groups: None,
        catchers: None,
    };
    let units = whole.blocks(8).zip(0..).map(|(rect, n)| WorkUnit::new(RenderWork::Block(block(rect)), n));
    client.submit_group(units.collect()).unwrap();
    let (mut picture, mut by_device) = (Tile::new(whole, layout.clone()), 0);
    while let Some(completed) = client.take() {
        if completed.resource.is_some_and(|resource| resource.0 == 1) {
            by_device += 1;
            drop(tell.take());
        }
        let Ok(RenderOutput::Block(output)) = completed.output else { panic!("{:?}", completed.output) };
        picture.copy_from(&output.tile);
    }
    assert!(by_device > 0 && by_device < 64, "the device did {by_device} of 64 blocks");
    let right = block(whole).perform().unwrap().tile;
    let mut difference = 0.0;
    for (a, b) in picture.sums().chunks_exact(6).zip(right.sums().chunks_exact(6)) {
        assert_eq!(a[Layout::SAMPLE_COUNT], 16.0);
        difference += f64::from((a[0] - b[0]).abs()) / f64::from(b[0].max(1e-3)) / f64::from(SIDE * SIDE);
    }
    assert!(difference < 1e-3, "{difference}");
}

#[test]
fn scenes_that_are_none_for_a_device_are_refused_by_name() {
    let Some(options) = options() else { return };
    let mut fog = scene();
    let medium = fog.push_medium(Medium { scattering: Vec3::ONE, ..Medium::absorbing(Vec3::ONE) });
    fog.cameras[0].medium = Some(medium);
    let prepared = Arc::new(PreparedScene::new(Arc::new(fog), &PrepareOptions::default()).unwrap());
    let outcome = GpuPaths::new(&prepared, &options).map(|_| ());
    assert!(
        matches!(&outcome, Err(GpuError::Unsupported(what)) if what.len() == 1 && what[0].contains("media")),
        "{outcome:?}"
    );
}

#[test]
fn compiled_kernels_are_kept_for_the_next_time() {
    let Some(options) = options() else { return };
    let folder = tempfile::tempdir().unwrap();
    let options = PathOptions { cache: Some(folder.path().join("kernels")), ..options };
    let scene = Arc::new(PreparedScene::new(Arc::new(scene()), &PrepareOptions::default()).unwrap());
    let files = || std::fs::read_dir(folder.path().join("kernels")).into_iter().flatten().flatten();
    let kept = || files().map(|file| std::fs::read(file.path()).unwrap()).collect::<Vec<_>>();
    drop(GpuPaths::new(&scene, &options).unwrap());
    let first = kept();
    if first.is_empty() {
        eprintln!("skipped: this driver keeps no kernels");
        return;
    }
    // The stored kernels are used, or overwritten if the driver does not accept them.
    drop(GpuPaths::new(&scene, &options).unwrap());
    assert_eq!(kept(), first);
    for file in files() {
        std::fs::write(file.path(), b"nothing of the kind").unwrap();
    }
    drop(GpuPaths::new(&scene, &options).unwrap());
    assert_eq!(kept().len(), first.len());
    assert!(kept()[0].len() > 32, "it was not written again");
}
