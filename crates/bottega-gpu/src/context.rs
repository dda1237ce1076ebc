//! An open device with its queue, and the helpers that all its users share.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use wgpu::{Adapter, BindGroupLayout, Buffer, BufferDescriptor, BufferUsages, PollError, PollType, SubmissionIndex};

use crate::adapter::AdapterInfo;
use crate::error::GpuError;

/// The maximum number of workgroups per dispatch that every device supports.
pub(crate) const GROUPS_MAX: u32 = 65_535;
/// Bytes uploaded per submission; this bounds the staging memory.
const UPLOAD_BYTES: usize = 64 << 20;

/// Errors that the driver reported asynchronously; only the first of each kind is kept.
#[derive(Debug, Default)]
struct DriverMessages {
    refused: Mutex<Option<String>>,
    lost: Mutex<Option<String>>,
}

fn note(slot: &Mutex<Option<String>>, message: String) {
    slot.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
}

fn noted(slot: &Mutex<Option<String>>) -> Option<String> {
    slot.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// An open device, its queue, and the errors it reported.
#[derive(Debug)]
pub(crate) struct Context {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    faults: Arc<DriverMessages>,
    timeout: Duration,
    /// `true`: waiting for the device does not time out.
    is_patient: AtomicBool,
}

/// Returns the maximum size of an array that a shader can bind on this adapter, in bytes.
pub(crate) fn binding_limit(adapter: &Adapter) -> u64 {
    let limits = adapter.limits();
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

impl Context {
    /// Opens a device with the adapter's own limits for buffer sizes.
    ///
    /// - `storage_buffers`: the number of arrays that a shader binds at once.
    pub(crate) fn open(
        adapter: &Adapter,
        info: &AdapterInfo,
        storage_buffers: u32,
        features: wgpu::Features,
        timeout: Duration,
    ) -> Result<Self, GpuError> {
        let (limits, usual) = (adapter.limits(), wgpu::Limits::downlevel_defaults());
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("bottega"),
            required_features: features,
            required_limits: wgpu::Limits {
                max_storage_buffer_binding_size: limits.max_storage_buffer_binding_size,
                max_buffer_size: limits.max_buffer_size,
                max_storage_buffers_per_shader_stage: usual.max_storage_buffers_per_shader_stage.max(storage_buffers),
                ..usual
            },
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|source| GpuError::Device { adapter: info.name.clone(), source })?;
        let faults = Arc::new(DriverMessages::default());
        let (refusals, losses) = (Arc::clone(&faults), Arc::clone(&faults));
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| note(&refusals.refused, error.to_string())));
        device.set_device_lost_callback(move |reason, message| note(&losses.lost, format!("{reason:?}: {message}")));
        Ok(Self { device, queue, faults, timeout, is_patient: AtomicBool::new(false) })
    }

    /// Returns the first error that the device reported so far.
    pub(crate) fn check(&self) -> Result<(), GpuError> {
        if let Some(message) = noted(&self.faults.lost) {
            return Err(GpuError::Lost(message));
        }
        noted(&self.faults.refused).map_or(Ok(()), |message| Err(GpuError::Refused(message)))
    }

    /// Creates a buffer of `size` bytes.
    pub(crate) fn buffer(&self, label: &str, size: u64, usage: BufferUsages) -> Buffer {
        self.device.create_buffer(&BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
    }

    /// Creates a buffer that holds `bytes`; at least 64 bytes long, because a binding may not be empty.
    pub(crate) fn upload(&self, label: &str, bytes: &[u8]) -> Buffer {
        // One element of the largest element type must fit.
        let size = (bytes.len() as u64).max(64);
        let made = self.buffer(label, size, BufferUsages::STORAGE | BufferUsages::COPY_DST);
        for (part, index) in bytes.chunks(UPLOAD_BYTES).zip(0..) {
            self.queue.write_buffer(&made, index * UPLOAD_BYTES as u64, part);
            self.queue.submit([]); // Releases the staging memory before the next part.
        }
        made
    }

    /// Begins a scope that catches out-of-memory errors until [`MemoryScope::end`].
    pub(crate) fn memory_scope(&self) -> MemoryScope {
        MemoryScope(self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory))
    }

    /// Turns timeouts of [`Context::wait`] off (`true`) or on (`false`).
    pub(crate) fn set_patient(&self, is_patient: bool) {
        self.is_patient.store(is_patient, Ordering::SeqCst);
    }

    /// Waits until a submission has finished.
    pub(crate) fn wait(&self, submission: &SubmissionIndex) -> Result<(), GpuError> {
        loop {
            let wait = PollType::Wait { submission_index: Some(submission.clone()), timeout: Some(self.timeout) };
            let polled = self.device.poll(wait);
            self.check()?;
            match polled {
                Ok(_) => return Ok(()),
                Err(PollError::Timeout) if self.is_patient.load(Ordering::SeqCst) => {}
                Err(PollError::Timeout) => return Err(GpuError::Timeout(self.timeout)),
                Err(error) => return Err(GpuError::Refused(error.to_string())),
            }
        }
    }

    /// Waits for a submission that copied to `readback`, then passes the first `bytes` bytes to `read`.
    pub(crate) fn read(
        &self,
        submission: &SubmissionIndex,
        readback: &Buffer,
        bytes: u64,
        read: impl FnOnce(&[u32]),
    ) -> Result<(), GpuError> {
        let mapped = Arc::new(Mutex::new(None));
        let map_outcome = Arc::clone(&mapped);
        readback.map_async(wgpu::MapMode::Read, 0..bytes, move |outcome| {
            *map_outcome.lock().unwrap_or_else(PoisonError::into_inner) = Some(outcome);
        });
        self.wait(submission)?;
        match mapped.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(Ok(())) => {}
            Some(Err(error)) => return Err(GpuError::Refused(error.to_string())),
            None => return Err(GpuError::Timeout(self.timeout)),
        }
        let view = readback.get_mapped_range(0..bytes).map_err(|error| GpuError::Refused(error.to_string()))?;
        read(bytemuck::cast_slice(&view));
        drop(view);
        readback.unmap();
        self.check()
    }

    /// Creates a bind group layout of buffers for compute shaders.
    pub(crate) fn layout(&self, label: &str, entries: &[(u32, wgpu::BufferBindingType)]) -> BindGroupLayout {
        let entries: Vec<_> = entries
            .iter()
            .map(|&(binding, ty)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
                count: None,
            })
            .collect();
        let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries };
        self.device.create_bind_group_layout(&descriptor)
    }

    /// Creates a bind group of whole buffers.
    pub(crate) fn bind(&self, label: &str, layout: &BindGroupLayout, buffers: &[(u32, &Buffer)]) -> wgpu::BindGroup {
        let entries: Vec<_> = buffers
            .iter()
            .map(|&(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let descriptor = wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries };
        self.device.create_bind_group(&descriptor)
    }
}

/// A scope of [`Context::memory_scope`].
pub(crate) struct MemoryScope(wgpu::ErrorScopeGuard);

impl MemoryScope {
    /// Ends the scope.
    ///
    /// # Errors
    /// The device ran out of memory since the scope began.
    pub(crate) fn end(self) -> Result<(), GpuError> {
        match pollster::block_on(self.0.pop()) {
            None => Ok(()),
            Some(_) => Err(GpuError::OutOfMemory { wanted: 0 }),
        }
    }
}

/// Returns the binding type of a storage array.
pub(crate) fn storage(read_only: bool) -> wgpu::BufferBindingType {
    wgpu::BufferBindingType::Storage { read_only }
}
