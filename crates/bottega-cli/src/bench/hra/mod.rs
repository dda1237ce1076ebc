//! `bottega bench hra`: the tables of the HRA paper on this machine.
//!
//! The same paths are followed in each way, so the rays are the same and, but for a GPU's rounding, so is the light that they
//! find: that is checked after every run.

mod args;
mod blocks;
mod paper;
mod processors;
mod studio;
mod tables;
mod walk;

use std::{
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
    time::Instant,
};

use bottega_hra::{Hra, HraConfig, HraReport, Resource, VirtualCpu, timeline_svg};
use bottega_render::RenderWork;

pub(crate) use self::args::HraBenchArgs;
use self::{
    blocks::BlockRow,
    studio::Studio,
    walk::{Caller, Found, walk},
};
use crate::{devices, error::CliError};

/// Paths that tell how many rays a path has.
const PILOT_PATHS: u64 = 1 << 16;
/// Spans of a resource that are drawn.
const SPANS_KEPT: usize = 20_000;
/// By how much a GPU's light may differ: it finds other hits along edges.
const GPU_DIFFERENCE: f64 = 5e-3;

pub(crate) fn run(args: &HraBenchArgs) -> Result<ExitCode, CliError> {
    // Before any thread is started, so that all have the same processors.
    let is_kept = processors::keep_to(args.processors);
    if let Some(folder) = &args.output {
        fs::create_dir_all(folder).map_err(|source| CliError::write(folder.clone(), source))?;
    }
    let scenes = [Studio::a()?, Studio::b()?];
    let rows = scenes.iter().map(|studio| measure(args, studio)).collect::<Result<Vec<_>, _>>()?;
    let blocks = scenes.iter().map(|studio| blocks::measure(args, studio)).collect::<Result<Vec<_>, _>>()?;
    let report = Report { processors: args.processors, is_kept, batch: args.batch, rows, blocks };
    if let Some(folder) = &args.output {
        write(&folder.join("hra.json"), &tables::as_json(&report).to_string())?;
    }
    if args.json {
        println!("{}", tables::as_json(&report));
    } else {
        print!("{}", tables::as_text(&report));
    }
    Ok(ExitCode::SUCCESS)
}

/// Who does the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Direct,
    Cpu,
    CpuAndGpu,
    Gpu,
}

impl Way {
    fn name(self) -> &'static str {
        match self {
            Self::Direct => "CPU without HRA",
            Self::Cpu => "CPU with HRA",
            Self::CpuAndGpu => "CPU+GPU with HRA",
            Self::Gpu => "GPU with HRA",
        }
    }

    fn key(self) -> &'static str {
        match self {
            Self::Direct => "direct",
            Self::Cpu => "hra-cpu",
            Self::CpuAndGpu => "hra-cpu-gpu",
            Self::Gpu => "hra-gpu",
        }
    }
}

/// All that was measured.
struct Report {
    processors: u16,
    /// Whether the system kept the program to them.
    is_kept: bool,
    batch: u32,
    rows: Vec<Row>,
    blocks: Vec<BlockRow>,
}

/// One scene.
struct Row {
    scene: &'static str,
    kind: &'static str,
    paths: u64,
    /// As the processors count them.
    rays: u64,
    columns: Vec<Column>,
}

/// One way to do its rays.
struct Column {
    way: Way,
    /// Of all runs, in their order.
    seconds: Vec<f64>,
    /// Of the last run: resource, share of time with work, units.
    resources: Vec<(String, f64, u64)>,
}

impl Column {
    /// Without the best and the worst.
    fn average(&self) -> f64 {
        average(&self.seconds)
    }
}

/// Without the least and the greatest.
fn average(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let kept = &sorted[1..sorted.len() - 1];
    kept.iter().sum::<f64>() / kept.len() as f64
}

fn measure(args: &HraBenchArgs, studio: &Studio) -> Result<Row, CliError> {
    let pilot = walk(studio, &Caller::Direct, PILOT_PATHS, args.batch, usize::from(args.processors))?;
    let rays_wanted = paper::RAYS * args.scale;
    let paths = (rays_wanted * PILOT_PATHS as f64 / pilot.rays as f64).ceil() as u64;
    let mut ways = vec![Way::Direct, Way::Cpu];
    if args.gpu.is_some() {
        ways.extend([Way::CpuAndGpu, Way::Gpu]);
    }
    let column = |way| Column { way, seconds: Vec::new(), resources: Vec::new() };
    let mut columns: Vec<Column> = ways.into_iter().map(column).collect();
    let mut known: Option<Found> = None;
    for _ in 0..args.runs {
        for column in &mut columns {
            let (found, seconds, report) = once(args, studio, column.way, paths)?;
            check(column.way, &found, known.get_or_insert_with(|| found.clone()))?;
            column.seconds.push(seconds);
            if let Some(report) = report {
                column.resources = occupation(&report);
                draw(args, studio, column.way, &report)?;
            }
        }
    }
    let rays = known.as_ref().map_or(0, |found| found.rays);
    if let (Some(folder), Some(found)) = (&args.output, &known) {
        tables::picture(&folder.join(format!("{}.png", studio.name)), found)?;
    }
    Ok(Row { scene: studio.name, kind: studio.kind, paths, rays, columns })
}

/// One run. The scene is on its devices before the clock is started.
fn once(
    args: &HraBenchArgs,
    studio: &Studio,
    way: Way,
    paths: u64,
) -> Result<(Found, f64, Option<HraReport>), CliError> {
    let loops = usize::from(args.processors);
    let mut resources: Vec<Box<dyn Resource<RenderWork>>> = Vec::new();
    if matches!(way, Way::Cpu | Way::CpuAndGpu) {
        resources.extend(VirtualCpu::lanes(loops, RenderWork::perform));
    }
    if matches!(way, Way::Gpu | Way::CpuAndGpu) {
        resources.extend(devices::gpu(args.gpu.as_deref(), studio.prepared.scene())?);
    }
    let spans_kept = if args.output.is_some() { SPANS_KEPT } else { 0 };
    let hra = (way != Way::Direct).then(|| Hra::new(HraConfig { spans_kept, ..HraConfig::default() }, resources));
    let gpus = usize::from(matches!(way, Way::Gpu | Way::CpuAndGpu));
    let caller = hra.as_ref().map_or(Caller::Direct, |hra| Caller::Allocator(hra, gpus));
    let begun = Instant::now();
    let found = walk(studio, &caller, paths, args.batch, loops)?;
    let seconds = begun.elapsed().as_secs_f64();
    Ok((found, seconds, hra.map(|hra| hra.report())))
}

/// All ways find the same light.
fn check(way: Way, found: &Found, known: &Found) -> Result<(), CliError> {
    let is_same = match way {
        Way::Direct | Way::Cpu => found == known,
        Way::CpuAndGpu | Way::Gpu => (found.light() / known.light() - 1.0).abs() <= GPU_DIFFERENCE,
    };
    let what = || format!("{} found other light: {} instead of {}", way.name(), found.light(), known.light());
    if is_same { Ok(()) } else { Err(CliError::failed(what(), "report it, with the name of the device")) }
}

fn occupation(report: &HraReport) -> Vec<(String, f64, u64)> {
    let share = |resource: &bottega_hra::ResourceReport| {
        let busy = resource.busy.as_secs_f64() / report.uptime.as_secs_f64().max(1e-9);
        (resource.descriptor.name.clone(), busy, resource.units)
    };
    report.resources.iter().map(share).collect()
}

/// Draws what each resource did when.
fn draw(args: &HraBenchArgs, studio: &Studio, way: Way, report: &HraReport) -> Result<(), CliError> {
    let Some(folder) = &args.output else { return Ok(()) };
    let path = folder.join(format!("{}-{}.svg", studio.name, way.key()));
    write(&path, &timeline_svg(report, None))
}

fn write(path: &Path, text: &str) -> Result<(), CliError> {
    fs::write(path, text).map_err(|source| CliError::write(PathBuf::from(path), source))
}
