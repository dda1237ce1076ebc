//! One device with the scene's geometry on it: pipelines, buffers, and the round trip of a batch of rays.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bottega_kernels::{Hit, Ray};
use bottega_render::flat::Portable as _;
use glam::Vec3;
use wgpu::{Adapter, BindGroup, BindGroupLayout, Buffer, BufferUsages, ComputePipeline};

use crate::adapter::AdapterInfo;
use crate::context::{Context, GROUPS_MAX, storage};
use crate::error::GpuError;
use crate::geometry::Geometry;
use crate::shared::geometry::{AnswerRecord, FAR, GROUP_SIZE, HIT_NOTHING, Ray as DeviceRay, RayParams};
use crate::{shared, traversal};

/// The maximum number of rays per dispatch.
pub(crate) const TILE_MAX: usize = (GROUP_SIZE * GROUPS_MAX) as usize;
/// The minimum capacity of the ray buffers, in rays.
const BATCH_MIN: usize = 4_096;
/// The number of storage arrays that the shader binds.
const STORAGE_BUFFERS: u32 = 4;

/// The question that a batch asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Query {
    Intersect,
    Occluded,
}

impl Query {
    /// Returns the number of 32-bit words of an answer to one ray.
    const fn words(self) -> usize {
        match self {
            Self::Intersect => AnswerRecord::WORDS as usize,
            Self::Occluded => 1,
        }
    }
}

impl DeviceRay {
    const NEVER: Self = Self { origin: Vec3::ZERO, t_min: 1.0, direction: Vec3::Z, t_max: 0.0 };

    fn of(ray: &Ray) -> Self {
        let (o, scale) = (ray.origin, direction_scale(ray));
        let d = ray.direction / scale;
        let (t_min, t_max) = ((ray.t_min * scale).max(0.0), (ray.t_max * scale).min(FAR));
        // Beyond 10¹² the shader's products overflow; no shape on the device is that far out.
        let bounded = o.is_finite() && o.abs().max_element() < 1e12 && !ray.t_min.is_nan() && !ray.t_max.is_nan();
        let usable = bounded && d.is_finite() && d.length_squared() > 0.0 && t_min < t_max;
        if usable { Self { origin: o, t_min, direction: d, t_max } } else { Self::NEVER }
    }
}

/// Returns the factor by which the direction is divided before upload if its length is far from 1; `t` on the device is then `t ·
/// scale`.
fn direction_scale(ray: &Ray) -> f32 {
    let size = ray.direction.abs().max_element();
    if (1e-3..=1e3).contains(&size) || size == 0.0 || !size.is_finite() { 1.0 } else { size }
}

/// Buffers of a batch, sized for the largest batch so far.
#[derive(Debug)]
struct RayBuffers {
    capacity: usize,
    rays: Buffer,
    answers: Buffer,
    readback: Buffer,
    bindings: BindGroup,
}

/// An open device with shapes on it, which traces rays through them.
#[derive(Debug)]
pub(crate) struct Device {
    context: Arc<Context>,
    layout: BindGroupLayout,
    intersect: ComputePipeline,
    occluded: ComputePipeline,
    nodes: Buffer,
    shapes: Buffer,
    params: Buffer,
    batch: Option<RayBuffers>,
    staging: Vec<DeviceRay>,
}

impl Device {
    pub(crate) fn new(
        adapter: &Adapter,
        info: &AdapterInfo,
        geometry: &Geometry,
        timeout: Duration,
    ) -> Result<Self, GpuError> {
        let context = Context::open(adapter, info, STORAGE_BUFFERS, wgpu::Features::empty(), timeout)?;
        let nodes = context.upload("nodes", bytemuck::cast_slice(&geometry.nodes));
        let shapes = context.upload("shapes", bytemuck::cast_slice(&geometry.shapes));
        let made = Self::on(Arc::new(context), nodes, shapes, geometry.depth);
        made.context.check()?;
        Ok(made)
    }

    /// Creates a tracer over shapes that are already on the device, with a tree of this depth.
    pub(crate) fn on(context: Arc<Context>, nodes: Buffer, shapes: Buffer, depth: u32) -> Self {
        let uniform = wgpu::BufferBindingType::Uniform;
        let entries = [(0, storage(true)), (1, storage(true)), (2, storage(true)), (3, storage(false)), (4, uniform)];
        let layout = context.layout("rays", &entries);
        let (intersect, occluded) = pipelines(&context.device, &layout, depth);
        let params =
            context.buffer("params", size_of::<RayParams>() as u64, BufferUsages::UNIFORM | BufferUsages::COPY_DST);
        Self { context, layout, intersect, occluded, nodes, shapes, params, batch: None, staging: Vec::new() }
    }

    /// Returns the closest hit of each ray. Traces `tile` rays at a time, at most [`TILE_MAX`].
    pub(crate) fn intersect(&mut self, rays: &[Ray], tile: usize) -> Result<Vec<Hit>, GpuError> {
        let mut hits = Vec::with_capacity(rays.len());
        for tile in rays.chunks(tile) {
            self.run(Query::Intersect, tile, |words| {
                let (words, _) = words.as_chunks();
                hits.extend(tile.iter().zip(words).map(|(ray, words)| hit(ray, AnswerRecord::of(words))));
            })?;
        }
        Ok(hits)
    }

    /// Returns `true` for each ray that hits anything. Traces `tile` rays at a time, at most [`TILE_MAX`].
    pub(crate) fn occluded(&mut self, rays: &[Ray], tile: usize) -> Result<Vec<bool>, GpuError> {
        let mut occluded = Vec::with_capacity(rays.len());
        for tile in rays.chunks(tile) {
            self.run(Query::Occluded, tile, |words| occluded.extend(words.iter().map(|&word| word != 0)))?;
        }
        Ok(occluded)
    }

    /// Traces up to [`TILE_MAX`] rays; `read` gets [`Query::words`] words per ray.
    fn run(&mut self, query: Query, rays: &[Ray], read: impl FnOnce(&[u32])) -> Result<(), GpuError> {
        assert!(rays.len() <= TILE_MAX, "batches are cut into tiles before they come here");
        if rays.is_empty() {
            return Ok(());
        }
        self.context.check()?;
        self.grow(rays.len());
        let Some(batch) = &self.batch else { return Ok(()) };
        self.staging.clear();
        self.staging.extend(rays.iter().map(DeviceRay::of));
        let Context { device, queue, .. } = &*self.context;
        queue.write_buffer(&batch.rays, 0, bytemuck::cast_slice(&self.staging));
        queue.write_buffer(
            &self.params,
            0,
            bytemuck::bytes_of(&RayParams { ray_count: rays.len() as u32, ..RayParams::default() }),
        );
        let bytes = (rays.len() * query.words() * size_of::<u32>()) as u64;
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.dispatch(&mut encoder, query, batch, rays.len());
        encoder.copy_buffer_to_buffer(&batch.answers, 0, &batch.readback, 0, bytes);
        let submission = queue.submit([encoder.finish()]);
        self.context.read(&submission, &batch.readback, bytes, read)
    }

    fn dispatch(&self, encoder: &mut wgpu::CommandEncoder, query: Query, batch: &RayBuffers, rays: usize) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(match query {
            Query::Intersect => &self.intersect,
            Query::Occluded => &self.occluded,
        });
        pass.set_bind_group(0, &batch.bindings, &[]);
        pass.dispatch_workgroups((rays as u32).div_ceil(GROUP_SIZE), 1, 1);
    }

    /// Measures one pass over rays that are on the device: the time of `passes` more passes, divided by their number.
    pub(crate) fn time(&mut self, rays: &[Ray], any: bool, passes: u32) -> Result<Duration, GpuError> {
        let query = if any { Query::Occluded } else { Query::Intersect };
        self.run(query, rays, |_| {})?;
        let Some(batch) = &self.batch else { return Ok(Duration::ZERO) };
        let submit = |count: u32| -> Result<Duration, GpuError> {
            let mut encoder = self.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            for _ in 0..count {
                self.dispatch(&mut encoder, query, batch, rays.len());
            }
            let begun = Instant::now();
            let submission = self.context.queue.submit([encoder.finish()]);
            self.context.wait(&submission)?;
            Ok(begun.elapsed())
        };
        submit(1)?;
        let once = submit(1)?;
        Ok(submit(passes + 1)?.saturating_sub(once) / passes.max(1))
    }

    /// Grows the buffers to hold this many rays.
    fn grow(&mut self, rays: usize) {
        if self.batch.as_ref().is_some_and(|batch| batch.capacity >= rays) {
            return;
        }
        self.batch = None; // Free the old buffers first, in case memory is short.
        let capacity = rays.max(BATCH_MIN).next_power_of_two().min(TILE_MAX);
        let answer_bytes = (capacity * Query::Intersect.words() * size_of::<u32>()) as u64;
        let make = |label, bytes, usage| self.context.buffer(label, bytes, usage);
        let ray_bytes = (capacity * size_of::<DeviceRay>()) as u64;
        let rays = make("rays", ray_bytes, BufferUsages::STORAGE | BufferUsages::COPY_DST);
        let answers = make("answers", answer_bytes, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        let readback = make("readback", answer_bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST);
        let bound = [(0, &self.nodes), (1, &self.shapes), (2, &rays), (3, &answers), (4, &self.params)];
        let bindings = self.context.bind("batch", &self.layout, &bound);
        self.batch = Some(RayBuffers { capacity, rays, answers, readback, bindings });
    }

    /// Destroys the device, like a driver that resets it.
    #[cfg(test)]
    pub(crate) fn lose(&self) {
        self.context.device.destroy();
    }

    /// Sends an invalid command, to test how errors are reported.
    #[cfg(test)]
    pub(crate) fn misuse(&self) {
        self.context.buffer("misuse", 16, BufferUsages::MAP_READ | BufferUsages::STORAGE);
    }
}

/// Converts an answer of the shader to a hit of the CPU kernels.
fn hit(ray: &Ray, answer: AnswerRecord) -> Hit {
    let AnswerRecord { t, u, v, instance, primitive } = answer;
    if instance == HIT_NOTHING {
        return Hit::NONE;
    }
    Hit { t: t / direction_scale(ray), u, v, instance, primitive }
}

fn pipelines(device: &wgpu::Device, layout: &BindGroupLayout, depth: u32) -> (ComputePipeline, ComputePipeline) {
    let traversal = traversal::source(depth);
    let source =
        [shared::source(), include_str!("wgsl/shapes.wgsl"), &traversal, include_str!("wgsl/rays.wgsl")].concat();
    let module = traversal::module(device, "rays", &source);
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("rays"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    let pipeline = |entry_point| {
        device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry_point),
            layout: Some(&layout),
            module: &module,
            entry_point: Some(entry_point),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
    };
    (pipeline("intersect"), pipeline("occluded"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn only_finite_numbers_go_to_the_device() {
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, 1e-40, 1e38, 1e20, 1.0];
        for a in odd {
            for b in odd {
                let rays = [
                    Ray { origin: Vec3::new(a, b, 0.0), t_min: 0.0, direction: Vec3::X, t_max: f32::INFINITY },
                    Ray { origin: Vec3::ZERO, t_min: a, direction: Vec3::Y, t_max: b },
                    Ray { origin: Vec3::ZERO, t_min: 0.0, direction: Vec3::new(a, b, b), t_max: 1.0 },
                    Ray { origin: Vec3::ZERO, t_min: b, direction: Vec3::new(a, a, a), t_max: b },
                ];
                for ray in rays {
                    let numbers: [f32; 8] = bytemuck::cast(DeviceRay::of(&ray));
                    assert!(numbers.iter().all(|number| number.is_finite()), "{ray:?} → {numbers:?}");
                    assert!(numbers[4..7].iter().all(|number| number.abs() <= 1e3), "{ray:?} → {numbers:?}");
                }
            }
        }
    }

    #[test]
    fn a_ray_without_room_to_hit_anything_never_hits() {
        let never = |ray: Ray| DeviceRay::of(&ray) == DeviceRay::NEVER;
        let ray = Ray::new(Vec3::ZERO, Vec3::X);
        assert!(!never(ray));
        assert!(never(Ray { t_min: 2.0, t_max: 2.0, ..ray }));
        assert!(never(Ray { t_max: f32::NAN, ..ray }) && never(Ray { t_min: f32::NAN, ..ray }));
        assert!(never(Ray { t_max: -1.0, ..ray }));
        assert!(never(Ray { direction: Vec3::ZERO, ..ray }));
        assert!(never(Ray { origin: Vec3::NAN, ..ray }));
    }
}
