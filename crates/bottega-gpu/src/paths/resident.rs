//! Scenes in the memory of a device. Arrays with equal contents are stored once: an animation whose textures do not change
//! uploads them with its first frame only.

use std::collections::BTreeMap;
use std::sync::{Arc, Weak};

use bottega_hra::DataId;
use wgpu::Buffer;

use super::kernels::{Kernels, Layouts, Variant};
use super::scene::PathScene;
use crate::context::Context;
use crate::device::Device;
use crate::error::GpuError;
use crate::pipeline_cache::PipelineCache;

/// A scene in the memory of the device.
#[derive(Debug)]
pub(super) struct ResidentScene {
    /// The arrays: nodes, shapes, scene, materials, textures.
    pub(super) arrays: [Arc<Buffer>; 5],
    pub(super) kernels: Arc<Kernels>,
    depth: u32,
    /// The tracer for rays alone; created on first use.
    rays: Option<Device>,
}

impl ResidentScene {
    /// Returns the tracer for rays alone, over the same arrays.
    pub(super) fn rays(&mut self, context: &Arc<Context>) -> &mut Device {
        let [nodes, shapes, ..] = &self.arrays;
        self.rays.get_or_insert_with(|| {
            Device::on(Arc::clone(context), Buffer::clone(nodes), Buffer::clone(shapes), self.depth)
        })
    }
}

/// All scenes in the memory of a device.
#[derive(Debug, Default)]
pub(super) struct ResidentScenes {
    scenes: BTreeMap<DataId, ResidentScene>,
    /// The arrays by the digest of their contents.
    arrays: Vec<([u8; 32], Weak<Buffer>)>,
    kernels: Vec<(Variant, Arc<Kernels>)>,
    /// The maximum size of scenes in bytes; `None`: as much as the device has.
    memory: Option<u64>,
    sent_bytes: u64,
}

impl ResidentScenes {
    /// Makes an empty set of scenes.
    ///
    /// - `memory`: the maximum size of all scenes, in bytes.
    pub(super) fn new(memory: Option<u64>) -> Self {
        Self { memory, ..Self::default() }
    }

    pub(super) fn get(&mut self, id: DataId) -> Option<&mut ResidentScene> {
        self.scenes.get_mut(&id)
    }

    /// Evicts a scene. Arrays that another scene shares stay.
    pub(super) fn evict(&mut self, id: DataId) {
        self.scenes.remove(&id);
        self.arrays.retain(|(_, array)| array.strong_count() > 0);
    }

    /// Returns the bytes uploaded since the last call, and the bytes on the device.
    pub(super) fn bytes(&mut self) -> (u64, u64) {
        let there = self.arrays.iter().filter_map(|(_, array)| array.upgrade()).map(|array| array.size()).sum();
        (std::mem::take(&mut self.sent_bytes), there)
    }

    /// Uploads a scene, unless it is on the device.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`]: the scene does not fit; the device is unchanged.
    pub(super) fn admit(
        &mut self,
        context: &Context,
        layouts: &Layouts,
        cache: &PipelineCache,
        id: DataId,
        flat: &PathScene,
    ) -> Result<(), GpuError> {
        if self.scenes.contains_key(&id) {
            return Ok(());
        }
        let kernels = self.kernels(context, layouts, cache, flat.variant())?;
        let scope = context.memory_scope();
        let arrays: Result<Vec<_>, _> =
            flat.arrays().into_iter().map(|(label, bytes)| self.array(context, label, bytes)).collect();
        let outcome = scope.end().and(arrays);
        self.arrays.retain(|(_, array)| array.strong_count() > 0);
        let Ok(arrays) = <[Arc<Buffer>; 5]>::try_from(outcome?) else {
            return Err(GpuError::Invalid("a scene has five arrays".to_owned()));
        };
        self.scenes.insert(id, ResidentScene { arrays, kernels, depth: flat.geometry.depth, rays: None });
        Ok(())
    }

    /// Returns true if the kernels of a variant are compiled.
    pub(super) fn has_kernels(&self, variant: Variant) -> bool {
        self.kernels.iter().any(|(known, _)| *known == variant)
    }

    /// Returns the kernels of a variant; compiles them if needed.
    pub(super) fn kernels(
        &mut self,
        context: &Context,
        layouts: &Layouts,
        cache: &PipelineCache,
        variant: Variant,
    ) -> Result<Arc<Kernels>, GpuError> {
        if let Some((_, kernels)) = self.kernels.iter().find(|(known, _)| *known == variant) {
            return Ok(Arc::clone(kernels));
        }
        let kernels = Arc::new(Kernels::new(context, layouts, variant, cache.get()));
        context.check()?;
        cache.keep();
        self.kernels.push((variant, Arc::clone(&kernels)));
        Ok(kernels)
    }

    /// Returns an array with these bytes: an existing one, or a new one.
    fn array(&mut self, context: &Context, label: &str, bytes: &[u8]) -> Result<Arc<Buffer>, GpuError> {
        let digest = *blake3::hash(bytes).as_bytes();
        let known = self.arrays.iter().find(|(other, _)| *other == digest);
        if let Some(array) = known.and_then(|(_, array)| array.upgrade()) {
            return Ok(array);
        }
        let there: u64 = self.arrays.iter().filter_map(|(_, array)| array.upgrade()).map(|array| array.size()).sum();
        let bytes_there = there.saturating_add(bytes.len() as u64);
        if self.memory.is_some_and(|memory| bytes_there > memory) {
            return Err(GpuError::OutOfMemory { wanted: bytes.len() as u64 });
        }
        let array = Arc::new(context.upload(label, bytes));
        self.sent_bytes += bytes.len() as u64;
        self.arrays.push((digest, Arc::downgrade(&array)));
        Ok(array)
    }
}
