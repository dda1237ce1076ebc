//! Scenes in the memory of a device. Arrays with the same contents are there once: an animation whose textures do not change
//! sends them with its first frame alone.

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

/// A scene that is on the device.
#[derive(Debug)]
pub(super) struct ResidentScene {
    /// Nodes, shapes, scene, materials, textures.
    pub(super) arrays: [Arc<Buffer>; 5],
    pub(super) kernels: Arc<Kernels>,
    depth: u32,
    /// For rays alone, once somebody asks for them.
    rays: Option<Device>,
}

impl ResidentScene {
    /// What answers rays alone.
    pub(super) fn rays(&mut self, context: &Arc<Context>) -> &mut Device {
        let [nodes, shapes, ..] = &self.arrays;
        self.rays.get_or_insert_with(|| {
            Device::on(Arc::clone(context), Buffer::clone(nodes), Buffer::clone(shapes), self.depth)
        })
    }
}

/// All scenes on a device.
#[derive(Debug, Default)]
pub(super) struct ResidentScenes {
    scenes: BTreeMap<DataId, ResidentScene>,
    /// By digest of what is in them.
    arrays: Vec<([u8; 32], Weak<Buffer>)>,
    kernels: Vec<(Variant, Arc<Kernels>)>,
    /// Bytes that scenes may take; `None`: as many as the device has.
    memory: Option<u64>,
    sent_bytes: u64,
}

impl ResidentScenes {
    /// - `memory`: bytes that they may take.
    pub(super) fn new(memory: Option<u64>) -> Self {
        Self { memory, ..Self::default() }
    }

    pub(super) fn get(&mut self, id: DataId) -> Option<&mut ResidentScene> {
        self.scenes.get_mut(&id)
    }

    /// Throws a scene out. What another one shares with it stays.
    pub(super) fn evict(&mut self, id: DataId) {
        self.scenes.remove(&id);
        self.arrays.retain(|(_, array)| array.strong_count() > 0);
    }

    /// Bytes that were sent since this was asked last, and bytes that are there.
    pub(super) fn bytes(&mut self) -> (u64, u64) {
        let there = self.arrays.iter().filter_map(|(_, array)| array.upgrade()).map(|array| array.size()).sum();
        (std::mem::take(&mut self.sent_bytes), there)
    }

    /// Sends a scene, unless it is there.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`]: there is no room for it; the device is as it was before.
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

    /// Whether the kernels of a variant are compiled.
    pub(super) fn has_kernels(&self, variant: Variant) -> bool {
        self.kernels.iter().any(|(known, _)| *known == variant)
    }

    /// The kernels of a variant, compiled unless they are.
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

    /// An array with these bytes: one that is there, or a new one.
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
