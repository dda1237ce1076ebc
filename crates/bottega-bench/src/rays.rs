//! Rays a second of the kernels by kind of ray, and camera paths a second.

mod gpu;

use std::{
    io::Write,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use bottega::{devices::processors, text::shown};
use bottega_kernels::bench as kernels;
use bottega_render::{PathSettings, PrepareOptions, PreparedScene, Prepass, View};
use bottega_scene::LoadOptions;
use serde_json::{Map, Value, json};

use self::gpu::GpuRow;
use crate::{Error, Report, painting::paint_zone, say};

/// Primary rays of a built-in scene: its square.
const RAYS_SIDE: u32 = 512;
/// Pixels of a picture whose paths are counted: its square.
const PATHS_SIDE: u32 = 256;
/// Samples a pixel of one repetition.
const PATHS_SAMPLES: u32 = 16;
/// Why Embree is left out of a program that was built without its bindings.
const NOT_BUILT_IN: &str =
    "the comparison was not built in; `cargo run --release --features embree -- bench rays` has it";

/// The options of the measurement.
#[derive(Clone, Debug)]
pub struct RaysOptions {
    /// Scenes whose paths a second are measured, beside the rays of built-in ones.
    pub scenes: Vec<PathBuf>,
    /// Repetitions, interleaved, at least 1; medians are told.
    pub repeat: u16,
    /// The GPU whose name contains this is measured too, by itself.
    pub gpu: Option<String>,
}

/// Rays and paths a second.
pub struct RaysReport {
    rays: Vec<(kernels::BenchScene, Vec<kernels::Row>)>,
    gpu: Vec<GpuRow>,
    paths: Vec<PathsRow>,
}

/// Camera paths of a scene, in millions a second.
struct PathsRow {
    scene: String,
    threads: usize,
    on_one: f64,
    on_all: f64,
}

/// Measures our kernels, beside Embree 4 where this is built with the feature `embree` and the library is found.
///
/// - `log`: is told why Embree is left out.
///
/// # Errors
/// A scene or the GPU cannot be used.
pub fn measure(options: &RaysOptions, log: &mut dyn Write) -> Result<RaysReport, Error> {
    let repeat = options.repeat.max(1);
    let gpu = options.gpu.as_deref().map(|name| gpu::measure(name, repeat)).transpose()?.unwrap_or_default();
    let report = kernels::run(kernels::built_in_scenes(), RAYS_SIDE, usize::from(repeat), processors())?;
    if let Some(reason) = &report.without_embree {
        let reason = if cfg!(feature = "embree") { reason } else { NOT_BUILT_IN };
        say(log, format_args!("NOT BESIDE EMBREE: {reason}"));
    }
    let paths = options.scenes.iter().map(|scene| paths(scene, repeat)).collect::<Result<_, _>>()?;
    Ok(RaysReport { rays: report.scenes, gpu, paths })
}

/// Measures on one thread and on all, in turn; medians.
fn paths(scene: &Path, repeat: u16) -> Result<PathsRow, Error> {
    let loaded = bottega_scene::load(scene, &LoadOptions::default())?;
    let threads = processors();
    let options = PrepareOptions { threads, ..PrepareOptions::default() };
    let prepared = Arc::new(PreparedScene::new(Arc::new(loaded.scene), &options)?);
    let subject = (&prepared, &Arc::default());
    let (mut one, mut all) = (Vec::new(), Vec::new());
    for _ in 0..repeat {
        one.push(paint(subject, 1)?);
        all.push(paint(subject, threads)?);
    }
    let rate = |times: &mut Vec<Duration>| {
        times.sort();
        let samples = f64::from(PATHS_SIDE * PATHS_SIDE * PATHS_SAMPLES);
        (samples / times[times.len() / 2].as_secs_f64() / 1e3).round() / 1e3
    };
    Ok(PathsRow { scene: shown(scene), threads, on_one: rate(&mut one), on_all: rate(&mut all) })
}

fn paint(scene: (&Arc<PreparedScene>, &Arc<Prepass>), threads: usize) -> Result<Duration, Error> {
    let view = View { camera: 0, width: PATHS_SIDE, height: PATHS_SIDE };
    Ok(paint_zone(scene, view, PathSettings::default(), threads, PATHS_SAMPLES)?.1)
}

impl Report for RaysReport {
    fn as_text(&self) -> String {
        let mut text = "rays on one thread, one at a time\n\n".to_owned();
        for (scene, rows) in &self.rays {
            text += &kernels::table(scene, rows);
            text += "\n";
        }
        text += &gpu::as_text(&self.gpu);
        for PathsRow { scene, threads, on_one, on_all } in &self.paths {
            text += &format!("{scene:?}: {on_one:?} Mpaths/s on one thread, {on_all:?} on {threads}\n");
        }
        text
    }

    fn as_json(&self) -> Value {
        let rays: Vec<Value> =
            self.rays.iter().flat_map(|(scene, rows)| rows.iter().map(|row| row_as_json(&scene.name, row))).collect();
        let paths =
            |row: &PathsRow| json!({"scene": row.scene, "threads": row.threads, "one": row.on_one, "all": row.on_all});
        let paths: Vec<Value> = self.paths.iter().map(paths).collect();
        json!({"rays": rays, "gpu": gpu::as_json(&self.gpu), "paths": paths})
    }
}

fn row_as_json(scene: &str, row: &kernels::Row) -> Value {
    let mrays: Map<String, Value> =
        kernels::KINDS.iter().zip(row.mrays).map(|(kind, rate)| ((*kind).to_owned(), json!(rate))).collect();
    json!({
        "scene": scene,
        "kernel": row.name,
        "mrays_per_second": mrays,
        "build_seconds": row.build_time.as_secs_f64(),
        "bytes_per_triangle": row.bytes_per_triangle,
    })
}
