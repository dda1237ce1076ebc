//! A device that is open: what all that runs on it shares.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use wgpu::{Adapter, BindGroupLayout, Buffer, BufferDescriptor, BufferUsages, PollError, PollType, SubmissionIndex};

use crate::adapter::AdapterInfo;
use crate::error::GpuError;

/// Groups in a dispatch that every device takes.
pub(crate) const GROUPS_MAX: u32 = 65_535;
/// Bytes that are handed over at once, so that staging takes little more.
const UPLOAD_BYTES: usize = 64 << 20;

/// What the driver said out of turn.
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

/// A device, its queue, and what went wrong on it.
#[derive(Debug)]
pub(crate) struct Context {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    faults: Arc<DriverMessages>,
    timeout: Duration,
    /// Whether the device may take as long as it likes.
    is_patient: AtomicBool,
}

/// Most bytes that the adapter lets a shader see in one array.
pub(crate) fn binding_limit(adapter: &Adapter) -> u64 {
    let limits = adapter.limits();
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

impl Context {
    /// Opens a device with arrays as large as the adapter has them.
    ///
    /// - `storage_buffers`: arrays that a shader sees at once.
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

    /// The first thing that went wrong so far.
    pub(crate) fn check(&self) -> Result<(), GpuError> {
        if let Some(message) = noted(&self.faults.lost) {
            return Err(GpuError::Lost(message));
        }
        noted(&self.faults.refused).map_or(Ok(()), |message| Err(GpuError::Refused(message)))
    }

    pub(crate) fn buffer(&self, label: &str, size: u64, usage: BufferUsages) -> Buffer {
        self.device.create_buffer(&BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
    }

    /// A buffer with `bytes` in it; never empty, which a binding may not be.
    pub(crate) fn upload(&self, label: &str, bytes: &[u8]) -> Buffer {
        // An array of one element at least, of the largest element that there is.
        let size = (bytes.len() as u64).max(64);
        let made = self.buffer(label, size, BufferUsages::STORAGE | BufferUsages::COPY_DST);
        for (part, index) in bytes.chunks(UPLOAD_BYTES).zip(0..) {
            self.queue.write_buffer(&made, index * UPLOAD_BYTES as u64, part);
            self.queue.submit([]); // Lets the staging memory go before the next part.
        }
        made
    }

    /// From now on notes when memory runs out, until [`MemoryScope::end`].
    pub(crate) fn memory_scope(&self) -> MemoryScope {
        MemoryScope(self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory))
    }

    /// From now on the device may take as long as it likes, or not any more.
    pub(crate) fn set_patient(&self, is_patient: bool) {
        self.is_patient.store(is_patient, Ordering::SeqCst);
    }

    /// Waits for a submission.
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

    /// Waits for a submission that copied to `readback`, and shows the first `bytes` of it to `read`.
    pub(crate) fn read(
        &self,
        submission: &SubmissionIndex,
        readback: &Buffer,
        bytes: u64,
        read: impl FnOnce(&[u32]),
    ) -> Result<(), GpuError> {
        let mapped = Arc::new(Mutex::new(None));
        let told = Arc::clone(&mapped);
        readback.map_async(wgpu::MapMode::Read, 0..bytes, move |outcome| {
            *told.lock().unwrap_or_else(PoisonError::into_inner) = Some(outcome);
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

    /// A layout of arrays and, where there is any, a block of uniform numbers.
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

    /// Whole buffers for a layout.
    pub(crate) fn bind(&self, label: &str, layout: &BindGroupLayout, buffers: &[(u32, &Buffer)]) -> wgpu::BindGroup {
        let entries: Vec<_> = buffers
            .iter()
            .map(|&(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let descriptor = wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries };
        self.device.create_bind_group(&descriptor)
    }
}

/// See [`Context::memory_scope`].
pub(crate) struct MemoryScope(wgpu::ErrorScopeGuard);

impl MemoryScope {
    /// # Errors
    /// Memory ran out since the scope began.
    pub(crate) fn end(self) -> Result<(), GpuError> {
        match pollster::block_on(self.0.pop()) {
            None => Ok(()),
            Some(_) => Err(GpuError::OutOfMemory { wanted: 0 }),
        }
    }
}

/// An array that shaders read, or read and write.
pub(crate) fn storage(read_only: bool) -> wgpu::BufferBindingType {
    wgpu::BufferBindingType::Storage { read_only }
}
