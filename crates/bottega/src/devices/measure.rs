//! The cost of work on each processor and GPU, measured.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use bottega_gpu::{GpuError, GpuOptions, GpuRays};
use bottega_hra::{
    CostModel, Hra, HraConfig, Lane, Primitive, PrimitiveSet, SubmitError, UnitError, VirtualCpu, Work, WorkUnit,
    split_work,
};
use bottega_image::{AovSet, Layout, Rect, Tile};
use bottega_render::{
    BlockWork, Filter, PathSettings, PrepareOptions, PreparedScene, Ray, RenderWork, View, camera::CameraRays,
};
use glam::Vec2;
use serde::Serialize;

use super::{costs, painter, processors, room::room};
use crate::error::{Error, error_chain};

/// Duration of the measurement per primitive and device, after one warm-up unit.
const MEASURED: Duration = Duration::from_secs(2);
/// Side of the picture that blocks are taken from, in pixels.
const SIDE: u32 = 512;
/// Side of a block, in pixels.
const BLOCK: u32 = 16;
/// Side of the pixel blocks that order the rays.
const RAY_BLOCK: u32 = 8;
/// Number of units queued for a device: as many as a remote one takes at once.
const WAITING: usize = 64;
/// Number of items in the example work that is split among all devices.
const SHARED_ITEMS: u64 = 100_000_000;
/// The primitives that are measured.
const PRIMITIVES: [Primitive; 3] = [Primitive::Intersect, Primitive::Occluded, Primitive::PixelBlock];

/// The measured cost of work on one kind of device of this machine.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceCosts {
    /// Name of the device.
    pub name: String,
    /// Number of devices of this kind.
    pub count: usize,
    /// One entry per measured primitive.
    pub primitives: Vec<PrimitiveCost>,
    /// Reasons for primitives that could not be measured.
    pub notes: Vec<String>,
}

/// The cost of one primitive on a device.
#[derive(Clone, Debug, Serialize)]
pub struct PrimitiveCost {
    /// Name of the primitive.
    pub primitive: &'static str,
    /// Items (rays or samples) per second of one device under full load.
    pub items_per_second: f64,
    /// Fixed cost per work unit, in nanoseconds.
    pub unit_ns: f64,
    /// Cost per item, in nanoseconds.
    pub item_ns: f64,
    /// Relative error of predictions with both costs, 0 to 1; `None`: too few measurements.
    pub uncertainty: Option<f64>,
    /// Share of a large work that all devices of this kind take if the whole machine takes part, 0 to 1.
    pub share: f64,
}

/// The reason why a primitive cannot be measured on a device.
#[derive(Debug, thiserror::Error)]
enum LaneError {
    #[error(transparent)]
    Open(#[from] Error),
    #[error("the device accepts no work")]
    Submit(#[from] SubmitError),
    #[error("the device failed")]
    Unit(#[from] UnitError),
}

impl From<GpuError> for LaneError {
    fn from(error: GpuError) -> Self {
        Self::Open(error.into())
    }
}

/// The measurements of one kind of device.
struct MeasuredDevice {
    name: String,
    count: usize,
    /// Per primitive: items per second, and the cost model.
    rates: Vec<(Primitive, f64, CostModel)>,
    notes: Vec<String>,
}

/// Measures one processor and these GPUs in a furnished room of some 75,000 triangles. Stores the results for later pictures.
/// Returns the costs of the processors, then those of each GPU; failures of a GPU are in its notes.
///
/// - `gpus`: names of the GPUs.
///
/// # Errors
/// The room cannot be prepared.
pub fn measure(gpus: &[String]) -> Result<Vec<DeviceCosts>, Error> {
    let subject = Subject::new()?;
    let processor = |primitive: Primitive| {
        let lane = VirtualCpu::new("cpu".to_owned(), PrimitiveSet::from([primitive]), RenderWork::perform);
        Ok(Lane::Direct(Box::new(lane) as _))
    };
    let mut devices = vec![subject.measure("cpu", processors(), processor)];
    devices.extend(gpus.iter().map(|name| subject.measure(name, 1, |primitive| subject.on_gpu(primitive, name))));
    let costs = devices.iter().enumerate().map(|(index, device)| DeviceCosts {
        name: device.name.clone(),
        count: device.count,
        primitives: device.primitives(|primitive| shares(&devices, primitive)[index]),
        notes: device.notes.clone(),
    });
    Ok(costs.collect())
}

impl MeasuredDevice {
    fn cost(&self, primitive: Primitive) -> Option<CostModel> {
        self.rates.iter().find(|(of, ..)| *of == primitive).map(|(.., cost)| *cost)
    }

    fn primitives(&self, share: impl Fn(Primitive) -> f64) -> Vec<PrimitiveCost> {
        let cost_of = |&(primitive, items_per_second, cost): &(Primitive, f64, CostModel)| PrimitiveCost {
            primitive: primitive.name(),
            items_per_second,
            unit_ns: cost.fixed_ns(),
            item_ns: cost.ns_per_item(),
            uncertainty: cost.uncertainty(),
            share: share(primitive),
        };
        self.rates.iter().map(cost_of).collect()
    }
}

/// Returns the share of each kind of device in a work of one primitive if all devices take part.
fn shares(all: &[MeasuredDevice], primitive: Primitive) -> Vec<f64> {
    // Each processor counts as a device of its own.
    let each: Vec<(usize, Option<CostModel>)> = all
        .iter()
        .enumerate()
        .flat_map(|(index, device)| std::iter::repeat_n((index, device.cost(primitive)), device.count))
        .collect();
    let costs: Vec<_> = each.iter().map(|(_, cost)| *cost).collect();
    let mut shares = vec![0.0; all.len()];
    for ((index, _), items) in each.iter().zip(split_work(SHARED_ITEMS, &costs)) {
        shares[*index] += items as f64 / SHARED_ITEMS as f64;
    }
    shares
}

/// The scene for the measurements, with rays in it.
struct Subject {
    prepared: Arc<PreparedScene>,
    view: View,
    /// Camera rays, in blocks of 8 × 8 pixels.
    rays: Vec<Ray>,
    settings: Arc<PathSettings>,
}

impl Subject {
    fn new() -> Result<Self, Error> {
        let scene = room();
        let view = View::of_scene(&scene, 0, SIDE, SIDE)?;
        let camera = CameraRays::new(&view.camera, SIDE, SIDE);
        let rays = Rect::of_size(SIDE, SIDE).blocks(RAY_BLOCK).flat_map(|block| block.pixels());
        let rays = rays.map(|(x, y)| {
            let ray = camera.ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5), [0.0; 2]);
            Ray::new(ray.origin, ray.direction)
        });
        let rays = rays.collect();
        let prepared = Arc::new(PreparedScene::new(Arc::new(scene), &PrepareOptions::default())?);
        let settings = PathSettings { guiding: false, max_depth: 5, filter: Filter::PIXEL, ..PathSettings::default() };
        Ok(Self { prepared, view, rays, settings: Arc::new(settings) })
    }

    /// Measures all primitives on a device.
    ///
    /// - `lane`: opens the device for one primitive.
    fn measure(
        &self,
        name: &str,
        count: usize,
        lane: impl Fn(Primitive) -> Result<Lane<RenderWork>, LaneError>,
    ) -> MeasuredDevice {
        let mut measured = MeasuredDevice { name: name.to_owned(), count, rates: Vec::new(), notes: Vec::new() };
        for primitive in PRIMITIVES {
            match lane(primitive).and_then(|lane| self.rate(primitive, lane)) {
                Ok((rate, cost)) => measured.rates.push((primitive, rate, cost)),
                Err(error) => measured.notes.push(format!("{primitive}: {}", error_chain(&error))),
            }
        }
        measured
    }

    /// Returns the items per second under full load, and the cost model that the allocator has learned, which is also stored.
    fn rate(&self, primitive: Primitive, lane: Lane<RenderWork>) -> Result<(f64, CostModel), LaneError> {
        let hra = Hra::with_lanes(HraConfig::default(), vec![lane]);
        let client = hra.client();
        let mut number = 0;
        let mut submit = |count: usize| {
            let units = (0..count).map(|_| {
                number += 1;
                WorkUnit::new(self.work(primitive, number), number)
            });
            client.submit_group(units.collect())
        };
        // Warm up the device with one unit
        let mut waiting = 1;
        submit(waiting)?;
        let (mut begun, mut items) = (None::<Instant>, 0);
        // Keep the queue full for the duration of the measurement, then drain it
        while let Some(answer) = client.take() {
            answer.output?;
            waiting -= 1;
            let begun = *begun.get_or_insert_with(Instant::now);
            items += self.work(primitive, answer.ticket).size();
            if begun.elapsed() < MEASURED {
                let more = WAITING.saturating_sub(waiting);
                submit(more)?;
                waiting += more;
            } else if waiting == 0 {
                break;
            }
        }
        let seconds = begun.map_or(0.0, |begun| begun.elapsed().as_secs_f64()).max(1e-9);
        let report = hra.report();
        costs::keep(&report);
        let cost = report.resources.first().and_then(|resource| resource.costs.iter().find(|(of, _)| *of == primitive));
        Ok((items as f64 / seconds, cost.map(|(_, cost)| *cost).unwrap_or_default()))
    }

    /// Returns the `n`-th unit. Sizes differ, so that the cost per unit can be separated from the cost per item.
    fn work(&self, primitive: Primitive, n: u64) -> RenderWork {
        let scene = Arc::clone(&self.prepared);
        let count = 1 << (10 + 2 * (n % 3));
        let first = (n as usize * 7919 * 64) % (self.rays.len() - count);
        let rays = || Arc::new(self.rays[first..][..count].to_vec());
        match primitive {
            Primitive::Intersect => RenderWork::Rays { scene, rays: rays() },
            Primitive::Occluded => RenderWork::Occlusion { scene, rays: rays() },
            _ => {
                let blocks = SIDE / BLOCK;
                let at = (n as u32).wrapping_mul(7919) % (blocks * blocks);
                let (x, y) = (at % blocks * BLOCK, at / blocks * BLOCK);
                let rect = Rect::new(x, y, x + BLOCK, y + BLOCK);
                RenderWork::Block(BlockWork {
                    scene,
                    prepass: Arc::default(),
                    view: self.view.clone(),
                    settings: Arc::clone(&self.settings),
                    tile: Tile::new(rect, Layout::new(AovSet::NONE)),
                    samples: 0..1 << (n % 3 * 2),
                    light_groups: None,
                    catchers: None,
                })
            }
        }
    }

    /// Opens a GPU for one primitive.
    fn on_gpu(&self, primitive: Primitive, name: &str) -> Result<Lane<RenderWork>, LaneError> {
        if primitive == Primitive::PixelBlock {
            return Ok(painter(name, &self.prepared)?);
        }
        let options = GpuOptions { adapter: Some(name.to_owned()), ..GpuOptions::default() };
        Ok(Lane::Direct(Box::new(GpuRays::new(self.prepared.scene(), &options)?)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a device on which an item of `Intersect` costs `ns_per_item` nanoseconds.
    fn device(name: &str, count: usize, ns_per_item: f64) -> MeasuredDevice {
        let mut cost = CostModel::default();
        for items in [1000, 4000, 16_000, 4000, 1000, 16_000] {
            cost.observe(items, Duration::from_secs_f64(1e-9 * ns_per_item * items as f64));
        }
        MeasuredDevice {
            name: name.to_owned(),
            count,
            rates: vec![(Primitive::Intersect, 1e9 / ns_per_item, cost)],
            notes: Vec::new(),
        }
    }

    #[test]
    fn all_processors_share_the_work_with_a_gpu_by_how_fast_they_are() {
        let all = [device("cpu", 4, 100.0), device("gpu", 1, 25.0)];
        let [cpu, gpu] = shares(&all, Primitive::Intersect)[..] else { panic!("one share each") };
        assert!((cpu - 0.5).abs() < 0.02 && (gpu - 0.5).abs() < 0.02, "{cpu} {gpu}");
        assert_eq!(shares(&all, Primitive::Occluded), [0.0; 2], "nobody has been measured");
    }
}
