//! The tables of the HRA paper on this machine: the same rays by direct calls, through the allocator, and with a GPU.
//!
//! Every method traces the same paths, so the rays are equal and, except for a GPU's rounding, so is the light they find; this is
//! checked after every run.

mod blocks;
mod options;
mod paper;
mod ray_scene;
mod report;
mod tables;
mod walk;

use std::{io::Write, time::Instant};

use bottega_gpu::{GpuOptions, GpuRays};
use bottega_hra::{Hra, HraConfig, HraReport, Resource, VirtualCpu, timeline_svg};
use bottega_platform::scheduling;
use bottega_render::RenderWork;
use bottega_scene::Scene;

pub(crate) use self::options::HraOptions;
use self::{
    options::WorkDivision,
    ray_scene::RayScene,
    report::{HraBenchReport, RayColumn, RayRow, occupation},
    walk::{Caller, WalkResult, walk},
};
use crate::{
    error::Error,
    files::{create_folder, write_file},
    report::{Measurement, Report, headed, say},
};

/// The number of paths that measure the rays per path.
const PILOT_PATHS: u64 = 1 << 16;
/// The number of spans drawn per resource.
const SPANS_KEPT: usize = 20_000;
/// The allowed difference of a GPU's light: it finds other hits along edges.
const GPU_DIFFERENCE: f64 = 5e-3;

impl Measurement for HraOptions {
    /// Measures all methods in turn. Restricts this thread, and all threads that it starts, to the requested number of
    /// processors. `hra.json` is updated after each scene.
    fn measure(&self, log: &mut dyn Write) -> Result<Box<dyn Report>, Error> {
        let is_kept = scheduling::keep_to(self.processors);
        if let Some(folder) = &self.output {
            create_folder(folder)?;
        }
        let scenes = [RayScene::a()?, RayScene::b()?];
        let Self { processors, batch, .. } = *self;
        let mut report = HraBenchReport { processors, is_kept, batch, rows: Vec::new(), blocks: Vec::new() };
        for scene in &scenes {
            report.rows.push(measure_rays(self, scene, log)?);
            keep(self, &report)?;
        }
        for scene in &scenes {
            report.blocks.push(blocks::measure(self, scene, log)?);
            keep(self, &report)?;
        }
        Ok(Box::new(report))
    }
}

/// Writes the results so far, so that an early end loses no finished scene.
fn keep(options: &HraOptions, report: &HraBenchReport) -> Result<(), Error> {
    let Some(folder) = &options.output else { return Ok(()) };
    write_file(&folder.join("hra.json"), &headed(report).to_string())
}

fn measure_rays(options: &HraOptions, scene: &RayScene, log: &mut dyn Write) -> Result<RayRow, Error> {
    let pilot = walk(scene, &Caller::Direct, PILOT_PATHS, options.batch, usize::from(options.processors))?;
    let rays_wanted = paper::RAYS * options.scale;
    let paths = (rays_wanted * PILOT_PATHS as f64 / pilot.rays as f64).ceil() as u64;
    let mut ways = vec![WorkDivision::Direct, WorkDivision::Cpu];
    if options.gpu.is_some() {
        ways.extend([WorkDivision::CpuAndGpu, WorkDivision::Gpu]);
    }
    let column = |way| RayColumn { way, seconds: Vec::new(), resources: Vec::new() };
    let mut columns: Vec<RayColumn> = ways.into_iter().map(column).collect();
    let mut known: Option<WalkResult> = None;
    let runs = options.runs;
    for run in 1..=runs {
        for column in &mut columns {
            let (found, seconds, report) = once(options, scene, column.way, paths)?;
            check(column.way, &found, known.get_or_insert_with(|| found.clone()))?;
            let (name, way) = (scene.name, column.way.name());
            say(log, format_args!("rays of scene {name}, run {run} of {runs}: {way} {seconds:.3} s"));
            column.seconds.push(seconds);
            if let Some(report) = report {
                column.resources = occupation(&report);
                draw(options, scene, column.way, &report)?;
            }
        }
    }
    let rays = known.as_ref().map_or(0, |found| found.rays);
    if let (Some(folder), Some(found)) = (&options.output, &known) {
        tables::picture(&folder.join(format!("{}.png", scene.name)), found)?;
    }
    Ok(RayRow { scene: scene.name, kind: scene.kind, paths, rays, columns })
}

/// Measures one run. The scene is on the devices before the clock starts.
fn once(
    options: &HraOptions,
    scene: &RayScene,
    way: WorkDivision,
    paths: u64,
) -> Result<(WalkResult, f64, Option<HraReport>), Error> {
    let loops = usize::from(options.processors);
    let mut resources: Vec<Box<dyn Resource<RenderWork>>> = Vec::new();
    if matches!(way, WorkDivision::Cpu | WorkDivision::CpuAndGpu) {
        resources.extend(VirtualCpu::lanes(loops, RenderWork::perform));
    }
    if matches!(way, WorkDivision::Gpu | WorkDivision::CpuAndGpu) {
        resources.extend(gpu(options.gpu.as_deref(), scene.prepared.scene())?);
    }
    let spans_kept = if options.output.is_some() { SPANS_KEPT } else { 0 };
    let hra =
        (way != WorkDivision::Direct).then(|| Hra::new(HraConfig { spans_kept, ..HraConfig::default() }, resources));
    let gpus = usize::from(matches!(way, WorkDivision::Gpu | WorkDivision::CpuAndGpu));
    let caller = hra.as_ref().map_or(Caller::Direct, |hra| Caller::Allocator(hra, gpus));
    let begun = Instant::now();
    let found = walk(scene, &caller, paths, options.batch, loops)?;
    let seconds = begun.elapsed().as_secs_f64();
    Ok((found, seconds, hra.map(|hra| hra.report())))
}

/// Returns the requested GPU with the scene's triangles on it, as a resource for batches of rays.
fn gpu(name: Option<&str>, scene: &Scene) -> Result<Option<Box<dyn Resource<RenderWork>>>, Error> {
    let Some(name) = name else { return Ok(None) };
    let options = GpuOptions { adapter: Some(name.to_owned()), ..GpuOptions::default() };
    Ok(Some(Box::new(GpuRays::new(scene, &options)?)))
}

/// Checks that a method finds the same light as the first.
fn check(way: WorkDivision, found: &WalkResult, known: &WalkResult) -> Result<(), Error> {
    let is_same = match way {
        WorkDivision::Direct | WorkDivision::Cpu => found == known,
        WorkDivision::CpuAndGpu | WorkDivision::Gpu => (found.light() / known.light() - 1.0).abs() <= GPU_DIFFERENCE,
    };
    let other = || Error::OtherLight { way: way.name(), found: found.light(), known: known.light() };
    if is_same { Ok(()) } else { Err(other()) }
}

/// Draws the activity of each resource over time.
fn draw(options: &HraOptions, scene: &RayScene, way: WorkDivision, report: &HraReport) -> Result<(), Error> {
    let Some(folder) = &options.output else { return Ok(()) };
    let path = folder.join(format!("{}-{}.svg", scene.name, way.key()));
    write_file(&path, &timeline_svg(report, None))
}
