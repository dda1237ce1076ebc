//! `bottega bench`: figures of this program on this machine.

mod ala;
mod engines;
mod farm;
mod gpu;
mod hra;
mod magarro;
mod peers;
mod scene;

use std::{
    ops::Range,
    path::{Path, PathBuf},
    process::ExitCode,
    sync::{Arc, mpsc},
    time::{Duration, Instant},
};

pub(crate) use ala::AlaArgs;
use bottega_engines::{
    BuiltinEngine, BuiltinOptions, CancelSwitch, Devices, EngineError, Leaning, RenderEngine, TaskProgress, Tunables,
    ZoneTask,
};
use bottega_image::{AovSet, Film, Layout, Picture, Rect, Tile};
use bottega_kernels::bench as kernels;
use bottega_render::{Filter, PathSettings, PrepareOptions, PreparedScene, View};
use bottega_scene::LoadOptions;
pub(crate) use engines::EnginesBenchArgs;
pub(crate) use farm::FarmBenchArgs;
pub(crate) use hra::HraBenchArgs;
pub(crate) use magarro::MagarroArgs;
use scene::NeutralScene;
use serde_json::{Value, json};

use bottega::{devices::processors, request::GuideChoice, settings::whole_guide, text::shown};

use crate::{
    cli::{BenchArgs, BenchCommand},
    error::CliError,
};

/// Primary rays of a built-in scene: its square.
const RAYS_SIDE: u32 = 512;

/// Pixels of a picture whose paths are counted: its square.
const PATHS_SIDE: u32 = 256;

/// Samples a pixel of one repetition.
const PATHS_SAMPLES: u32 = 16;

pub(crate) fn run(args: &BenchArgs) -> Result<ExitCode, CliError> {
    match &args.what {
        BenchCommand::Rays { scenes, repeat, gpu, json } => rays(scenes, *repeat, gpu.as_deref(), *json),
        BenchCommand::Peers(args) => peers::run(args),
        BenchCommand::Engines(args) => engines::run(args),
        BenchCommand::Farm(args) => farm::run(args),
        BenchCommand::Hra(args) => hra::run(args),
        BenchCommand::Ala(args) => ala::run(args),
        BenchCommand::Magarro(args) => magarro::run(args),
    }
}

fn rays(scenes: &[PathBuf], repeat: u16, gpu: Option<&str>, json: bool) -> Result<ExitCode, CliError> {
    let by_gpu = gpu.map(|name| gpu::measure(name, repeat)).transpose()?.unwrap_or_default();
    let report = kernels::run(kernels::built_in_scenes(), RAYS_SIDE, usize::from(repeat), processors())
        .map_err(|error| CliError::failed(error.to_string(), "this is unexpected; report it"))?;
    if let Some(reason) = &report.without_embree {
        eprintln!("NOT BESIDE EMBREE: {reason}");
    }
    let rays = report.scenes;
    let paths = scenes.iter().map(|scene| paths(scene, repeat)).collect::<Result<Vec<_>, _>>()?;
    if json {
        let rays: Vec<Value> =
            rays.iter().flat_map(|(scene, rows)| rows.iter().map(|row| row_as_json(&scene.name, row))).collect();
        println!("{}", json!({"rays": rays, "gpu": gpu::as_json(&by_gpu), "paths": paths}));
        return Ok(ExitCode::SUCCESS);
    }
    println!("rays on one thread, one at a time\n");
    for (scene, rows) in &rays {
        println!("{}", kernels::table(scene, rows));
    }
    print!("{}", gpu::as_text(&by_gpu));
    for scene in paths {
        println!(
            "{}: {} Mpaths/s on one thread, {} on {}",
            scene["scene"], scene["one"], scene["all"], scene["threads"]
        );
    }
    Ok(ExitCode::SUCCESS)
}

fn row_as_json(scene: &str, row: &kernels::Row) -> Value {
    let mrays: serde_json::Map<String, Value> =
        kernels::KINDS.iter().zip(row.mrays).map(|(kind, rate)| ((*kind).to_owned(), json!(rate))).collect();
    json!({
        "scene": scene,
        "kernel": row.name,
        "mrays_per_second": mrays,
        "build_seconds": row.build_time.as_secs_f64(),
        "bytes_per_triangle": row.bytes_per_triangle,
    })
}

/// Camera paths a second on one thread and on all, in turn; medians.
fn paths(scene: &Path, repeat: u16) -> Result<Value, CliError> {
    let loaded = bottega_scene::load(scene, &LoadOptions::default())?;
    let threads = processors();
    let options = PrepareOptions { threads, ..PrepareOptions::default() };
    let prepared = Arc::new(PreparedScene::new(Arc::new(loaded.scene), &options)?);
    let (mut one, mut all) = (Vec::new(), Vec::new());
    for _ in 0..repeat {
        one.push(paint(&prepared, 1)?);
        all.push(paint(&prepared, threads)?);
    }
    let rate = |times: &mut Vec<Duration>| {
        times.sort();
        let samples = f64::from(PATHS_SIDE * PATHS_SIDE * PATHS_SAMPLES);
        (samples / times[times.len() / 2].as_secs_f64() / 1e3).round() / 1e3
    };
    Ok(json!({"scene": shown(scene), "threads": threads, "one": rate(&mut one), "all": rate(&mut all)}))
}

fn paint(scene: &Arc<PreparedScene>, threads: usize) -> Result<Duration, CliError> {
    let view = View { camera: 0, width: PATHS_SIDE, height: PATHS_SIDE };
    Ok(paint_zone(scene, view, PathSettings::default(), threads, PATHS_SAMPLES)?.1)
}

/// Paints a neutral scene as its peers do, and how long that took.
fn paint_ours(
    scene: &NeutralScene,
    threads: usize,
    spp: u32,
    seed: u64,
    guide: GuideChoice,
) -> Result<(Picture, Duration), CliError> {
    let (guiding, agents) = whole_guide(guide);
    // Anew each time: what is learnt of where light comes from belongs to the time of a picture.
    let options = PrepareOptions { threads, ..PrepareOptions::default() };
    let prepared = Arc::new(PreparedScene::new(Arc::new(scene.scene.clone()), &options)?);
    let view = View { camera: 0, width: scene.width, height: scene.height };
    let settings = PathSettings {
        seed,
        max_depth: scene.max_bounces + 1,
        filter: Filter::PIXEL,
        planned_samples: spp,
        guiding,
        agents,
        ..PathSettings::default()
    };
    let (tile, time) = paint_zone(&prepared, view, settings, threads, spp)?;
    let mut film = Film::new(tile.rect(), tile.layout().clone());
    film.add_tile(&tile, |_, _| 1.0);
    Ok((film.to_picture(), time))
}

/// Paints a whole picture as one zone.
fn paint_zone(
    scene: &Arc<PreparedScene>,
    view: View,
    settings: PathSettings,
    threads: usize,
    spp: u32,
) -> Result<(Tile, Duration), CliError> {
    let options = BuiltinOptions { view, settings, layout: Layout::new(AovSet::NONE), threads };
    let engine = BuiltinEngine::new(Arc::clone(scene), options, Devices::default());
    paint_zone_with(&engine, view, settings, spp)
}

/// The same by an engine that is there.
fn paint_zone_with(
    engine: &BuiltinEngine,
    view: View,
    settings: PathSettings,
    spp: u32,
) -> Result<(Tile, Duration), CliError> {
    let tunables = Tunables { max_depth: settings.max_depth, light_samples: settings.light_samples };
    paint_samples(engine, Rect::of_size(view.width, view.height), tunables, 0..spp, None)
}

/// Samples of all pixels of a rectangle, and how long they took.
///
/// - `tile`: the running sums of those before.
fn paint_samples(
    engine: &BuiltinEngine,
    rect: Rect,
    tunables: Tunables,
    samples: Range<u32>,
    tile: Option<Tile>,
) -> Result<(Tile, Duration), CliError> {
    let (sender, receiver) = mpsc::channel();
    let (cancel, progress) = (CancelSwitch::default(), TaskProgress::default());
    let task = ZoneTask { rect, samples, tunables, leaning: Leaning::default(), tile, parts: None, cancel, progress };
    let start = Instant::now();
    // The receiver outlives the engine's report.
    engine.start(task, Box::new(move |painted| drop(sender.send(painted))));
    let lost = || EngineError::Zone { engine: "builtin".to_owned(), rect, reason: "it did not report".to_owned() };
    let painted = receiver.recv().map_err(|_| lost())??;
    Ok((painted.tile, start.elapsed()))
}
