//! The cost of work on each processor and GPU.

use std::{
    fmt::Write,
    sync::Arc,
    time::{Duration, Instant},
};

use bottega::devices::{costs, painter, processors};
use bottega_gpu::{GpuOptions, GpuRays};
use bottega_hra::{CostModel, Hra, HraConfig, Lane, Primitive, PrimitiveSet, VirtualCpu, Work, WorkUnit, split_work};
use bottega_image::{AovSet, Layout, Rect, Tile};
use bottega_kernels::{Ray, bench::BenchScene};
use bottega_render::{BlockWork, Filter, PathSettings, PrepareOptions, PreparedScene, RenderWork, View};
use bottega_scene::{Camera, Environment, Instance, Mesh, Projection, Scene, Spectrum, Surface};
use glam::{Affine3A, Vec3};
use serde_json::{Value, json};

use crate::{Error, Report};

/// How long each primitive of a device is measured, after a first look that does not count.
const MEASURED: Duration = Duration::from_secs(2);
/// Side of the picture of which blocks are painted.
const SIDE: u32 = 512;
/// Side of a block.
const BLOCK: u32 = 16;
/// Work that is split to show who would do how much of it.
const SHARED_ITEMS: u64 = 100_000_000;

/// The cost of work on the devices of this machine.
pub struct DevicesReport(Vec<DeviceCosts>);

/// A device and what its work costs.
struct DeviceCosts {
    name: String,
    /// How many there are of it.
    count: usize,
    /// Items a second, and the cost model, by primitive.
    rates: Vec<(Primitive, f64, CostModel)>,
    /// Why it was not measured, or not whole.
    notes: Vec<String>,
}

/// Measures one processor, and these GPUs; keeps what is found for those who paint. A GPU that fails is noted in the report.
///
/// # Errors
/// There is no scene to measure on.
pub fn measure(gpus: &[String]) -> Result<DevicesReport, Error> {
    let subject = Subject::new()?;
    let lanes = |primitive: Primitive| {
        let lane = VirtualCpu::new("cpu".to_owned(), PrimitiveSet::from([primitive]), RenderWork::perform);
        Ok(Lane::Direct(Box::new(lane) as _))
    };
    let primitives = [Primitive::Intersect, Primitive::Occluded, Primitive::PixelBlock];
    let mut all = vec![one("cpu".to_owned(), processors(), &primitives, &subject, lanes)];
    for name in gpus {
        let lanes = |primitive: Primitive| subject.on_gpu(primitive, name);
        all.push(one(name.clone(), 1, &primitives, &subject, lanes));
    }
    Ok(DevicesReport(all))
}

fn one(
    name: String,
    count: usize,
    primitives: &[Primitive],
    subject: &Subject,
    lane: impl Fn(Primitive) -> Result<Lane<RenderWork>, Error>,
) -> DeviceCosts {
    let mut measured = DeviceCosts { name, count, rates: Vec::new(), notes: Vec::new() };
    for &primitive in primitives {
        match lane(primitive).and_then(|lane| rate(primitive, lane, subject)) {
            Ok((rate, cost)) => measured.rates.push((primitive, rate, cost)),
            Err(error) => measured.notes.push(format!("{primitive}: {}", error.error_chain())),
        }
    }
    measured
}

/// Items a second while the device has as much work as it wants.
fn rate(primitive: Primitive, lane: Lane<RenderWork>, subject: &Subject) -> Result<(f64, CostModel), Error> {
    let hra = Hra::with_lanes(HraConfig::default(), vec![lane]);
    let client = hra.client();
    let mut number = 0;
    let mut submit = |count: usize| -> Result<(), Error> {
        let units = (0..count).map(|_| {
            number += 1;
            WorkUnit::new(subject.work(primitive, number), number)
        });
        client.submit_group(units.collect()).map_err(Error::from)
    };
    // As many units wait as a far device takes at once; the first ones warm it up.
    let mut waiting = 1;
    submit(waiting)?;
    let (mut begun, mut items) = (None::<Instant>, 0);
    while let Some(answer) = client.take() {
        answer.output?;
        waiting -= 1;
        let begun = *begun.get_or_insert_with(Instant::now);
        items += subject.work(primitive, answer.ticket).size();
        if begun.elapsed() < MEASURED {
            let more = (64_usize).saturating_sub(waiting);
            submit(more)?;
            waiting += more;
        } else if waiting == 0 {
            break;
        }
    }
    let seconds = begun.map_or(0.0, |begun| begun.elapsed().as_secs_f64()).max(1e-9);
    let report = hra.report();
    costs::keep(&report);
    let cost = report.resources.first().and_then(|it| it.costs.iter().find(|(of, _)| *of == primitive));
    Ok((items as f64 / seconds, cost.map(|(_, cost)| *cost).unwrap_or_default()))
}

/// What is measured on: a furnished room of some 75,000 triangles under an even sky.
struct Subject {
    prepared: Arc<PreparedScene>,
    rays: Vec<Ray>,
    settings: Arc<PathSettings>,
}

impl Subject {
    fn new() -> Result<Self, Error> {
        let room = bottega_kernels::bench::interior();
        let rays = room.camera_rays(SIDE);
        let prepared = Arc::new(PreparedScene::new(Arc::new(scene_of(room, 0.7)), &PrepareOptions::default())?);
        let settings = PathSettings { guiding: false, max_depth: 5, filter: Filter::PIXEL, ..PathSettings::default() };
        Ok(Self { prepared, rays, settings: Arc::new(settings) })
    }

    /// The `n`-th unit: sizes differ, so that what a unit costs is told from what its items cost.
    fn work(&self, primitive: Primitive, n: u64) -> RenderWork {
        let scene = Arc::clone(&self.prepared);
        let count = 1 << (10 + 2 * (n % 3));
        let first = (n as usize * 7919 * 64) % (self.rays.len() - count);
        match primitive {
            Primitive::Intersect => RenderWork::Rays { scene, rays: Arc::new(self.rays[first..][..count].to_vec()) },
            Primitive::Occluded => {
                RenderWork::Occlusion { scene, rays: Arc::new(self.rays[first..][..count].to_vec()) }
            }
            _ => {
                let blocks = SIDE / BLOCK;
                let at = (n as u32).wrapping_mul(7919) % (blocks * blocks);
                let (x, y) = (at % blocks * BLOCK, at / blocks * BLOCK);
                let rect = Rect::new(x, y, x + BLOCK, y + BLOCK);
                RenderWork::Block(BlockWork {
                    scene,
                    prepass: Arc::default(),
                    view: View { camera: 0, width: SIDE, height: SIDE },
                    settings: Arc::clone(&self.settings),
                    tile: Tile::new(rect, Layout::new(AovSet::NONE)),
                    samples: 0..1 << (n % 3 * 2),
                })
            }
        }
    }

    /// A GPU, for one primitive.
    fn on_gpu(&self, primitive: Primitive, name: &str) -> Result<Lane<RenderWork>, Error> {
        if primitive == Primitive::PixelBlock {
            return Ok(painter(name, &self.prepared)?);
        }
        let options = GpuOptions { adapter: Some(name.to_owned()), ..GpuOptions::default() };
        Ok(Lane::Direct(Box::new(GpuRays::new(self.prepared.scene(), &options)?)))
    }
}

/// A scene of grey surfaces of this albedo under an even sky.
pub(crate) fn scene_of(room: BenchScene, albedo: f32) -> Scene {
    let forward = (room.target - room.eye).normalize_or(Vec3::NEG_Z);
    let right = forward.cross(Vec3::Y).normalize_or(Vec3::X);
    let toward = Affine3A::from_cols(right.into(), right.cross(forward).into(), (-forward).into(), room.eye.into());
    let camera = Camera {
        world_from_camera: toward,
        projection: Projection::Perspective { vertical_fov: 1.0 },
        ..Camera::default()
    };
    let BenchScene { name, positions, triangles, .. } = room;
    Scene {
        meshes: vec![Mesh { name, positions, triangles, ..Mesh::default() }],
        instances: vec![Instance { mesh: 0, world_from_object: Affine3A::IDENTITY }],
        materials: vec![Surface::matte(Spectrum::splat(albedo)).into()],
        environment: Some(Environment::uniform(Spectrum::ONE)),
        cameras: vec![camera],
        ..Scene::default()
    }
}

/// Who would do how much of a work of one primitive, if all took part.
fn shares(all: &[DeviceCosts], primitive: Primitive) -> Vec<f64> {
    let cost_of = |it: &DeviceCosts| it.rates.iter().find(|(of, ..)| *of == primitive).map(|(.., cost)| *cost);
    // Every processor is one who takes part.
    let each: Vec<(usize, Option<CostModel>)> =
        all.iter().enumerate().flat_map(|(index, it)| std::iter::repeat_n((index, cost_of(it)), it.count)).collect();
    let costs: Vec<_> = each.iter().map(|(_, cost)| *cost).collect();
    let mut shares = vec![0.0; all.len()];
    for ((index, _), items) in each.iter().zip(split_work(SHARED_ITEMS, &costs)) {
        shares[*index] += items as f64 / SHARED_ITEMS as f64;
    }
    shares
}

impl Report for DevicesReport {
    fn as_text(&self) -> String {
        let all = &self.0;
        let mut text = String::new();
        for (index, measured) in all.iter().enumerate() {
            _ = writeln!(text, "\n{}", measured.name);
            for (primitive, rate, cost) in &measured.rates {
                let share = 100.0 * shares(all, *primitive)[index];
                let of_all = if measured.count > 1 { format!(" by all {}", measured.count) } else { String::new() };
                _ = writeln!(
                    text,
                    "  {:<12} {:9.3} million a second; a unit costs {:7.1} us and {:8.2} ns an item; would do {share:.1} %{of_all}",
                    primitive.name(),
                    rate / 1e6,
                    cost.fixed_ns() / 1e3,
                    cost.ns_per_item(),
                );
            }
            measured.notes.iter().for_each(|note| _ = writeln!(text, "  {note}"));
        }
        text
    }

    fn as_json(&self) -> Value {
        let all = &self.0;
        let one = |(index, measured): (usize, &DeviceCosts)| {
            let rates = measured.rates.iter().map(|(primitive, rate, cost)| {
                json!({
                    "primitive": primitive.name(), "items_per_second": rate, "unit_ns": cost.fixed_ns(),
                    "item_ns": cost.ns_per_item(), "uncertainty": cost.uncertainty(),
                    "share": shares(all, *primitive)[index],
                })
            });
            json!({
                "name": measured.name, "count": measured.count, "primitives": rates.collect::<Vec<_>>(),
                "notes": measured.notes,
            })
        };
        all.iter().enumerate().map(one).collect()
    }
}
