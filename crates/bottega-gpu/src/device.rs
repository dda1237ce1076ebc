//! One device with a scene on it: pipelines, buffers, and the way of a batch there and back.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bottega_kernels::Ray;
use bytemuck::{Pod, Zeroable};
use wgpu::{
    Adapter, BindGroup, BindGroupLayout, Buffer, BufferDescriptor, BufferUsages, ComputePipeline, PollError, PollType,
};

use crate::geometry::Geometry;
use crate::{AdapterInfo, GpuError};

/// Threads in a group, as in the shader.
const GROUP_SIZE: u32 = 64;
/// Groups in a dispatch that every device takes.
const GROUPS_MAX: u32 = 65_535;
/// Most rays that one dispatch can take.
pub(crate) const TILE_MAX: usize = (GROUP_SIZE * GROUPS_MAX) as usize;
/// Buffers for fewer rays than this are not worth growing later.
const BATCH_MIN: usize = 4_096;
/// Bytes of the scene that are handed over at once, so that staging takes little more.
const UPLOAD_BYTES: usize = 64 << 20;

/// What is asked of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Query {
    Intersect,
    Occluded,
}

impl Query {
    /// Words of 32 bits that answer one ray.
    pub(crate) const fn words(self) -> usize {
        match self {
            Self::Intersect => 5,
            Self::Occluded => 1,
        }
    }
}

/// A ray as the shader reads it: all finite, nothing to be found where `t_min >= t_max`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct DeviceRay([f32; 8]);

impl DeviceRay {
    const NEVER: Self = Self([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    /// Stands for infinity.
    const FAR: f32 = 3e38;

    pub(crate) fn of(ray: &Ray) -> Self {
        let (o, scale) = (ray.origin, direction_scale(ray));
        let d = ray.direction / scale;
        let (t_min, t_max) = ((ray.t_min * scale).max(0.0), (ray.t_max * scale).min(Self::FAR));
        // Beyond 10¹² the shader's products would overflow; nothing that it holds is as far out.
        let bounded = o.is_finite() && o.abs().max_element() < 1e12 && !ray.t_min.is_nan() && !ray.t_max.is_nan();
        let usable = bounded && d.is_finite() && d.length_squared() > 0.0 && t_min < t_max;
        if usable { Self([o.x, o.y, o.z, t_min, d.x, d.y, d.z, t_max]) } else { Self::NEVER }
    }
}

/// The size that is taken out of a direction whose length is far from 1; then `t` on the device is `t · scale`.
pub(crate) fn direction_scale(ray: &Ray) -> f32 {
    let size = ray.direction.abs().max_element();
    if (1e-3..=1e3).contains(&size) || size == 0.0 || !size.is_finite() { 1.0 } else { size }
}

/// What the driver said out of turn.
#[derive(Debug, Default)]
struct Faults {
    refused: Mutex<Option<String>>,
    lost: Mutex<Option<String>>,
}

fn note(slot: &Mutex<Option<String>>, message: String) {
    slot.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
}

fn noted(slot: &Mutex<Option<String>>) -> Option<String> {
    slot.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// Buffers of a batch, as large as the largest so far.
#[derive(Debug)]
struct Batch {
    capacity: usize,
    rays: Buffer,
    answers: Buffer,
    readback: Buffer,
    bindings: BindGroup,
}

#[derive(Debug)]
pub(crate) struct Device {
    device: wgpu::Device,
    queue: wgpu::Queue,
    layout: BindGroupLayout,
    intersect: ComputePipeline,
    occluded: ComputePipeline,
    nodes: Buffer,
    shapes: Buffer,
    params: Buffer,
    batch: Option<Batch>,
    staging: Vec<DeviceRay>,
    faults: Arc<Faults>,
    timeout: Duration,
}

/// Most bytes that the adapter lets a shader see in one array.
pub(crate) fn binding_limit(adapter: &Adapter) -> u64 {
    let limits = adapter.limits();
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

impl Device {
    pub(crate) fn new(
        adapter: &Adapter,
        info: &AdapterInfo,
        geometry: &Geometry,
        timeout: Duration,
    ) -> Result<Self, GpuError> {
        let limits = adapter.limits();
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("bottega"),
            required_limits: wgpu::Limits {
                max_storage_buffer_binding_size: limits.max_storage_buffer_binding_size,
                max_buffer_size: limits.max_buffer_size,
                ..wgpu::Limits::downlevel_defaults()
            },
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|source| GpuError::Device { adapter: info.name.clone(), source })?;
        let faults = Arc::new(Faults::default());
        let (refusals, losses) = (Arc::clone(&faults), Arc::clone(&faults));
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| note(&refusals.refused, error.to_string())));
        device.set_device_lost_callback(move |reason, message| note(&losses.lost, format!("{reason:?}: {message}")));

        let layout = layout(&device);
        let (intersect, occluded) = pipelines(&device, &layout);
        let nodes = upload(&device, &queue, "nodes", bytemuck::cast_slice(&geometry.nodes));
        let shapes = upload(&device, &queue, "shapes", bytemuck::cast_slice(&geometry.shapes));
        let params = buffer(&device, "params", 16, BufferUsages::UNIFORM | BufferUsages::COPY_DST);
        let made = Self {
            device,
            queue,
            layout,
            intersect,
            occluded,
            nodes,
            shapes,
            params,
            batch: None,
            staging: Vec::new(),
            faults,
            timeout,
        };
        made.check()?;
        Ok(made)
    }

    /// The first thing that went wrong so far.
    fn check(&self) -> Result<(), GpuError> {
        if let Some(message) = noted(&self.faults.lost) {
            return Err(GpuError::Lost(message));
        }
        noted(&self.faults.refused).map_or(Ok(()), |message| Err(GpuError::Refused(message)))
    }

    /// Answers up to [`TILE_MAX`] rays; `read` gets [`Query::words`] words for each.
    pub(crate) fn run(&mut self, query: Query, rays: &[Ray], read: impl FnOnce(&[u32])) -> Result<(), GpuError> {
        assert!(rays.len() <= TILE_MAX, "batches are cut into tiles before they come here");
        if rays.is_empty() {
            return Ok(());
        }
        self.check()?;
        self.grow(rays.len());
        let Some(batch) = &self.batch else { return Ok(()) };
        self.staging.clear();
        self.staging.extend(rays.iter().map(DeviceRay::of));
        self.queue.write_buffer(&batch.rays, 0, bytemuck::cast_slice(&self.staging));
        self.queue.write_buffer(&self.params, 0, bytemuck::cast_slice(&[rays.len() as u32, 0, 0, 0]));
        let bytes = (rays.len() * query.words() * size_of::<u32>()) as u64;
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(match query {
                Query::Intersect => &self.intersect,
                Query::Occluded => &self.occluded,
            });
            pass.set_bind_group(0, &batch.bindings, &[]);
            pass.dispatch_workgroups((rays.len() as u32).div_ceil(GROUP_SIZE), 1, 1);
        }
        encoder.copy_buffer_to_buffer(&batch.answers, 0, &batch.readback, 0, bytes);
        let submission = self.queue.submit([encoder.finish()]);
        let mapped = Arc::new(Mutex::new(None));
        let told = Arc::clone(&mapped);
        batch.readback.map_async(wgpu::MapMode::Read, 0..bytes, move |outcome| {
            *told.lock().unwrap_or_else(PoisonError::into_inner) = Some(outcome);
        });
        let wait = PollType::Wait { submission_index: Some(submission), timeout: Some(self.timeout) };
        let polled = self.device.poll(wait);
        self.check()?;
        match polled {
            Ok(_) => {}
            Err(PollError::Timeout) => return Err(GpuError::Timeout(self.timeout)),
            Err(error) => return Err(GpuError::Refused(error.to_string())),
        }
        match mapped.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(Ok(())) => {}
            Some(Err(error)) => return Err(GpuError::Refused(error.to_string())),
            None => return Err(GpuError::Timeout(self.timeout)),
        }
        let view = batch.readback.get_mapped_range(0..bytes).map_err(|error| GpuError::Refused(error.to_string()))?;
        read(bytemuck::cast_slice(&view));
        drop(view);
        batch.readback.unmap();
        self.check()
    }

    /// Makes room for a batch.
    fn grow(&mut self, rays: usize) {
        if self.batch.as_ref().is_some_and(|batch| batch.capacity >= rays) {
            return;
        }
        self.batch = None; // The old one goes first, where memory is short.
        let capacity = rays.max(BATCH_MIN).next_power_of_two().min(TILE_MAX);
        let answer_bytes = (capacity * Query::Intersect.words() * size_of::<u32>()) as u64;
        let make = |label, bytes, usage| buffer(&self.device, label, bytes, usage);
        let ray_bytes = (capacity * size_of::<DeviceRay>()) as u64;
        let rays = make("rays", ray_bytes, BufferUsages::STORAGE | BufferUsages::COPY_DST);
        let answers = make("answers", answer_bytes, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        let readback = make("readback", answer_bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST);
        let bound = [&self.nodes, &self.shapes, &rays, &answers, &self.params];
        let entries: Vec<_> = bound
            .into_iter()
            .zip(0..)
            .map(|(buffer, binding)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let bindings = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("batch"),
            layout: &self.layout,
            entries: &entries,
        });
        self.batch = Some(Batch { capacity, rays, answers, readback, bindings });
    }

    /// Takes the device away, as a driver does that resets it.
    #[cfg(test)]
    pub(crate) fn lose(&self) {
        self.device.destroy();
    }

    /// Asks for something that is not allowed, as a bug of ours would.
    #[cfg(test)]
    pub(crate) fn misuse(&self) {
        buffer(&self.device, "misuse", 16, BufferUsages::MAP_READ | BufferUsages::STORAGE);
    }
}

fn buffer(device: &wgpu::Device, label: &str, size: u64, usage: BufferUsages) -> Buffer {
    device.create_buffer(&BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
}

/// A buffer with `bytes` in it; never empty, which a binding may not be.
fn upload(device: &wgpu::Device, queue: &wgpu::Queue, label: &str, bytes: &[u8]) -> Buffer {
    // An array of one element at least, of the largest element that there is.
    let size = (bytes.len() as u64).max(64);
    let made = buffer(device, label, size, BufferUsages::STORAGE | BufferUsages::COPY_DST);
    for (part, index) in bytes.chunks(UPLOAD_BYTES).zip(0..) {
        queue.write_buffer(&made, index * UPLOAD_BYTES as u64, part);
        queue.submit([]); // Lets the staging memory go before the next part.
    }
    made
}

fn layout(device: &wgpu::Device) -> BindGroupLayout {
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    };
    let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("rays"),
        entries: &[
            entry(0, storage(true)),
            entry(1, storage(true)),
            entry(2, storage(true)),
            entry(3, storage(false)),
            entry(4, wgpu::BufferBindingType::Uniform),
        ],
    })
}

fn pipelines(device: &wgpu::Device, layout: &BindGroupLayout) -> (ComputePipeline, ComputePipeline) {
    let module = device.create_shader_module(wgpu::include_wgsl!("traverse.wgsl"));
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
                    let DeviceRay(numbers) = DeviceRay::of(&ray);
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
