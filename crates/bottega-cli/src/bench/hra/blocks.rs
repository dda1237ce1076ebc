//! Pictures of the scenes, zone by zone of 512 × 512: what the high-level primitive, samples of a block of pixels, brings on the
//! processors, on a GPU, and on both. Nobody makes rays for others here, so what both do can be held against the sum.

use std::sync::Arc;

use bottega_engines::{BuiltinEngine, BuiltinOptions, Devices};
use bottega_image::{AovSet, Layout};
use bottega_render::{Filter, PathSettings, View};

use super::{
    HraBenchArgs, Way, occupation,
    studio::{BOUNCES_MAX, SIDE, Studio},
};
use bottega::devices::{beside_gpus, painter};

use crate::{bench::paint_zone_with, error::CliError};

/// How long a run should take at the paper's number of rays, in seconds.
const SECONDS: f64 = 40.0;
/// Samples a pixel of the first look.
const PILOT_SAMPLES: u32 = 1;
/// No more samples a pixel than this.
const SAMPLES_MAX: u32 = 1 << 18;

/// One scene.
pub(super) struct BlockRow {
    pub(super) scene: &'static str,
    pub(super) kind: &'static str,
    pub(super) columns: Vec<BlockColumn>,
}

/// One way to paint it.
pub(super) struct BlockColumn {
    pub(super) way: Way,
    /// Of all runs, in their order.
    pub(super) samples_per_second: Vec<f64>,
    /// Of the last run: resource, share of time with work, units.
    pub(super) resources: Vec<(String, f64, u64)>,
}

impl BlockColumn {
    /// Without the best and the worst.
    pub(super) fn average(&self) -> f64 {
        super::average(&self.samples_per_second)
    }
}

impl BlockRow {
    /// What both together do, of the sum of what each does alone.
    pub(super) fn share_of_sum(&self) -> Option<f64> {
        let rate = |way| self.columns.iter().find(|column| column.way == way).map(BlockColumn::average);
        Some(rate(Way::CpuAndGpu)? / (rate(Way::Cpu)? + rate(Way::Gpu)?))
    }
}

/// Paints with the processors, with the GPU, and with both; each way so many samples that all take the same time.
pub(super) fn measure(args: &HraBenchArgs, studio: &Studio) -> Result<BlockRow, CliError> {
    let mut ways = vec![Way::Cpu];
    if args.gpu.is_some() {
        ways.extend([Way::CpuAndGpu, Way::Gpu]);
    }
    let mut columns = Vec::new();
    for way in ways {
        let (mut samples, mut rate) = (PILOT_SAMPLES, 0.0);
        let wanted = SECONDS * args.scale;
        while f64::from(samples) < f64::from(SAMPLES_MAX) {
            let seconds = once(args, studio, way, samples)?.0;
            rate = f64::from(samples) / seconds;
            if seconds > 0.3 * wanted {
                break;
            }
            samples = samples.saturating_mul(4).min(SAMPLES_MAX);
        }
        let samples = ((rate * wanted) as u32).clamp(1, SAMPLES_MAX);
        columns.push((samples, BlockColumn { way, samples_per_second: Vec::new(), resources: Vec::new() }));
    }
    for _ in 0..args.runs {
        for (samples, column) in &mut columns {
            let (seconds, resources) = once(args, studio, column.way, *samples)?;
            column.samples_per_second.push(f64::from(*samples) * f64::from(SIDE * SIDE) / seconds);
            column.resources = resources;
        }
    }
    let columns = columns.into_iter().map(|(_, column)| column).collect();
    Ok(BlockRow { scene: studio.name, kind: studio.kind, columns })
}

type Occupation = Vec<(String, f64, u64)>;

/// One run. The scene is on its devices before the clock is started.
fn once(args: &HraBenchArgs, studio: &Studio, way: Way, samples: u32) -> Result<(f64, Occupation), CliError> {
    let processors = usize::from(args.processors);
    let threads = match way {
        Way::Gpu => 0,
        Way::CpuAndGpu => beside_gpus(processors, 1),
        Way::Direct | Way::Cpu => processors,
    };
    let gpu = args.gpu.as_deref().filter(|_| way != Way::Cpu);
    let lanes = gpu.map(|name| painter(name, &studio.prepared)).transpose()?.into_iter().collect();
    let settings = PathSettings {
        guiding: false,
        max_depth: BOUNCES_MAX,
        filter: Filter::PIXEL,
        planned_samples: samples,
        ..PathSettings::default()
    };
    let view = View { camera: 0, width: SIDE, height: SIDE };
    let options = BuiltinOptions { view, settings, layout: Layout::new(AovSet::NONE), threads };
    let devices = Devices { lanes, costs: None };
    let engine = BuiltinEngine::new(Arc::clone(&studio.prepared), options, devices);
    let (_, time) = paint_zone_with(&engine, view, settings, samples)?;
    Ok((time.as_secs_f64(), occupation(&engine.report())))
}
