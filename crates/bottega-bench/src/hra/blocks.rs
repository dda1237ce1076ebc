//! Throughput of the high-level primitive, samples of a block of pixels, on the processors, on a GPU, and on both: images in
//! zones of 512 × 512. Processors and GPU do not depend on each other here, so both together can be compared with the sum.

use std::{io::Write, sync::Arc};

use bottega::devices::{beside_gpus, painter};
use bottega_engines::{BuiltinEngine, BuiltinOptions, Devices};
use bottega_image::{AovSet, Layout};
use bottega_render::{AgentUse, Filter, PathSettings, View};

use super::{
    options::{HraOptions, WorkDivision},
    ray_scene::{BOUNCES_MAX, RayScene, SIDE},
    report::{BlockColumn, BlockRow, Occupation, occupation},
};
use crate::{error::Error, painting::paint_zone_with, report::say};

/// The target duration of a run at the paper's number of rays, in seconds.
const SECONDS: f64 = 40.0;
/// Samples per pixel of the pilot run.
const PILOT_SAMPLES: u32 = 1;
/// The maximum number of samples per pixel.
const SAMPLES_MAX: u32 = 1 << 18;

/// Renders with the processors, with the GPU, and with both; each with a number of samples that takes the same time.
pub(super) fn measure(options: &HraOptions, scene: &RayScene, log: &mut dyn Write) -> Result<BlockRow, Error> {
    let mut ways = vec![WorkDivision::Cpu];
    if options.gpu.is_some() {
        ways.extend([WorkDivision::CpuAndGpu, WorkDivision::Gpu]);
    }
    let mut columns = Vec::new();
    for way in ways {
        let (mut samples, mut rate) = (PILOT_SAMPLES, 0.0);
        let wanted = SECONDS * options.scale;
        while f64::from(samples) < f64::from(SAMPLES_MAX) {
            let seconds = once(options, scene, way, samples)?.0;
            rate = f64::from(samples) / seconds;
            if seconds > 0.3 * wanted {
                break;
            }
            samples = samples.saturating_mul(4).min(SAMPLES_MAX);
        }
        let samples = ((rate * wanted) as u32).clamp(1, SAMPLES_MAX);
        columns.push((samples, BlockColumn { way, samples_per_second: Vec::new(), resources: Vec::new() }));
    }
    let runs = options.runs;
    for run in 1..=runs {
        for (samples, column) in &mut columns {
            let (seconds, resources) = once(options, scene, column.way, *samples)?;
            let rate = f64::from(*samples) * f64::from(SIDE * SIDE) / seconds;
            let (name, way, millions) = (scene.name, column.way.name(), rate / 1e6);
            say(log, format_args!("pictures of scene {name}, run {run} of {runs}: {way} {millions:.2} Msamples/s"));
            column.samples_per_second.push(rate);
            column.resources = resources;
        }
    }
    let columns = columns.into_iter().map(|(_, column)| column).collect();
    Ok(BlockRow { scene: scene.name, kind: scene.kind, columns })
}

/// Measures one run. The scene is on the devices before the clock starts.
fn once(options: &HraOptions, scene: &RayScene, way: WorkDivision, samples: u32) -> Result<(f64, Occupation), Error> {
    let processors = usize::from(options.processors);
    let threads = match way {
        WorkDivision::Gpu => 0,
        WorkDivision::CpuAndGpu => beside_gpus(processors, 1),
        WorkDivision::Direct | WorkDivision::Cpu => processors,
    };
    let gpu = options.gpu.as_deref().filter(|_| way != WorkDivision::Cpu);
    let lanes = gpu.map(|name| painter(name, &scene.prepared)).transpose()?.into_iter().collect();
    // GPUs support neither guides nor lighting agents, so the processors do not use them either.
    let settings = PathSettings {
        guiding: false,
        agents: AgentUse::default(),
        max_depth: BOUNCES_MAX,
        filter: Filter::PIXEL,
        planned_samples: samples,
        ..PathSettings::default()
    };
    let view = View::of_scene(scene.prepared.scene(), 0, SIDE, SIDE)?;
    let options = BuiltinOptions { view, settings, layout: Layout::new(AovSet::NONE), threads, wavefront: false };
    let devices = Devices { lanes, costs: None };
    let engine = BuiltinEngine::new(Arc::clone(&scene.prepared), options, devices);
    let (_, time) = paint_zone_with(&engine, (SIDE, SIDE), settings, samples)?;
    Ok((time.as_secs_f64(), occupation(&engine.report())))
}
