//! A shader run over an array of cases on whichever device there is.

use std::sync::mpsc;
use std::time::{Duration, Instant};

use wgpu::util::DeviceExt as _;

use crate::material::{EncodedMaterials, Features, source};

/// The declarations that precede every test shader.
const BINDINGS: &str = "
@group(0) @binding(0) var<storage, read> material_words: array<u32>;
@group(0) @binding(1) var<storage, read> texture_words: array<u32>;
@group(0) @binding(2) var<storage, read> cases: array<u32>;
@group(0) @binding(3) var<storage, read_write> answers: array<f32>;
";

/// A device with one test shader.
pub(super) struct Bench {
    /// True if the device rounds like the CPU on which it runs.
    pub(super) is_software: bool,
    device: wgpu::Device,
    queue: wgpu::Queue,
    pipeline: wgpu::ComputePipeline,
}

impl Bench {
    /// Compiles the entry point `main` of `shader`, with 64 threads per group and one per case. `None`: there is no device.
    pub(super) fn new(shader: &str, features: Features) -> Option<Self> {
        let wanted = std::env::var("BOTTEGA_GPU").unwrap_or_else(|_| "llvmpipe".into());
        let Ok((adapter, info)) = crate::adapter::choose(Some(&wanted)) else {
            eprintln!("skipped: no Vulkan adapter; install a driver, or Mesa's llvmpipe");
            return None;
        };
        let limits = adapter.limits();
        let descriptor = wgpu::DeviceDescriptor {
            required_limits: wgpu::Limits {
                max_storage_buffer_binding_size: limits.max_storage_buffer_binding_size,
                max_buffer_size: limits.max_buffer_size,
                ..wgpu::Limits::downlevel_defaults()
            },
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
        let source = format!("{}{BINDINGS}\n{}\n{shader}", crate::shared::source(), source(features));
        let before = Instant::now();
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("test"),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let parsed = before.elapsed();
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("test"),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        eprintln!("{}: parsed in {parsed:.2?}, compiled in {:.2?}", info.name, before.elapsed() - parsed);
        Some(Self { is_software: info.kind == crate::AdapterKind::Software, device, queue, pipeline })
    }

    /// Runs all cases of `stride` words each; each returns `answer` numbers.
    pub(super) fn run(&self, scene: &EncodedMaterials, cases: &[u32], stride: usize, answer: usize) -> Vec<f32> {
        let count = cases.len() / stride;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let upload = |words: &[u32]| {
            self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: None,
                contents: bytemuck::cast_slice(words),
                usage,
            })
        };
        let size = (count * answer * size_of::<f32>()) as u64;
        let make = |usage| {
            self.device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
        };
        let (answers, back) = (make(usage), make(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST));
        let bound = [upload(&scene.material_words), upload(&scene.texture_words), upload(cases), answers];
        // A shader that does not use all arrays has no bindings for the others.
        let entries: Vec<_> = bound
            .iter()
            .zip(0..)
            .map(|(buffer, binding)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let bindings = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &bindings, &[]);
            pass.dispatch_workgroups(count.div_ceil(64) as u32, 1, 1);
        }
        encoder.copy_buffer_to_buffer(&bound[3], 0, &back, 0, size);
        self.queue.submit([encoder.finish()]);
        let (sender, receiver) = mpsc::channel();
        back.map_async(wgpu::MapMode::Read, .., move |outcome| sender.send(outcome).unwrap());
        self.device
            .poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(Duration::from_secs(300)) })
            .unwrap();
        receiver.recv().unwrap().unwrap();
        let view = back.get_mapped_range(..).unwrap();
        bytemuck::cast_slice(&view).to_vec()
    }
}
