//! GPUs as resources of the allocator.

use std::{sync::Arc, time::Duration};

use bottega_gpu::{AdapterKind, EncodedScene, GpuAdapter, GpuError, GpuPaths, PathOptions, adapters};
pub use bottega_gpu::{GpuScenes, compiling};
use bottega_hra::{Lane, Window};
use bottega_platform::folders::state_folder;
use bottega_render::{PreparedScene, RenderWork};

use crate::error::Error;

/// Time without an answer after which a GPU counts as hanging. Generous, because a slow GPU may be the only device.
const PATIENCE: Duration = Duration::from_secs(120);

/// Largest number of work units in one packet: a unit is thousands of paths, and a fast GPU traces millions in the time that it
/// takes to hand over a packet.
const UNITS_PER_PACKET: usize = 4096;

/// A GPU chosen for a scene, and the scene in the encoding of the GPU.
pub(super) struct ChosenGpu {
    adapter: GpuAdapter,
    encoded: EncodedScene,
}

impl ChosenGpu {
    /// Chooses the GPU whose name contains `name`, or the best one.
    ///
    /// # Errors
    /// There is no such GPU, or it does not support the scene.
    pub(super) fn choose(name: Option<&str>, scene: &Arc<PreparedScene>) -> Result<Self, Error> {
        let adapter = GpuAdapter::choose(name)?;
        let encoded = adapter.encode(scene)?;
        Ok(Self { adapter, encoded })
    }

    pub(super) fn name(&self) -> &str {
        &self.adapter.info().name
    }

    /// Opens the GPU as a lane of the allocator, and returns the lane and the scenes in its memory.
    ///
    /// - `memory`: memory limit for scenes on the GPU, in bytes; `None`: nearly all free memory.
    ///
    /// # Errors
    /// The GPU cannot be opened.
    pub(super) fn open(&self, memory: Option<u64>) -> Result<(Lane<RenderWork>, GpuScenes), Error> {
        let gpu = GpuPaths::open(self.adapter.clone(), &path_options(Some(self.name().to_owned()), memory))?;
        let scenes = gpu.scenes();
        Ok((lane_of(gpu), scenes))
    }

    /// Compiles the kernels for the scene, so that it can be sent to the GPU.
    ///
    /// - `waits`: true to wait for the compilation; if false, other devices render in the meantime.
    pub(super) fn admit(&self, scenes: &GpuScenes, waits: bool) -> Result<(), Error> {
        let admitted = if waits { scenes.admit(&self.encoded) } else { scenes.admit_later(&self.encoded) };
        admitted.map_err(Error::from)
    }

    /// Returns the reason why the scene does not fit into GPU memory; `None`: it fits, or the free memory is unknown.
    ///
    /// - `memory`: memory limit for scenes on the GPU, in bytes; `None`: nearly all free memory.
    pub(super) fn lacks_room(&self, memory: Option<u64>) -> Option<String> {
        let room = memory.or_else(|| self.adapter.memory().map(|memory| memory.free.unwrap_or(memory.total)))?;
        let bytes = self.encoded.bytes();
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        (bytes > room)
            .then(|| format!("the scene needs {:.1} MiB there; at most {:.1} are available", mib(bytes), mib(room)))
    }
}

/// Returns true if this machine has a GPU that is not a software renderer.
pub(super) fn has_hardware() -> bool {
    adapters().iter().any(|adapter| adapter.kind != AdapterKind::Software)
}

/// Returns the name of the GPU whose name contains `wanted`, or of the best one that is not software; `None`: there is none.
pub(super) fn name_of(wanted: Option<&str>) -> Option<String> {
    let adapter = GpuAdapter::choose(wanted).ok()?;
    let info = adapter.info();
    (wanted.is_some() || info.kind != AdapterKind::Software).then(|| info.name.clone())
}

/// Returns true if an error means that there is no such GPU, not that it does not support the scene.
pub(super) fn is_absence(error: &Error) -> bool {
    matches!(error, Error::Gpu(GpuError::UnknownAdapter { .. } | GpuError::NoAdapter))
}

/// Returns the error of a picture that no GPU can render, with the reasons.
pub(super) fn unsupported(reasons: &[String]) -> Error {
    GpuError::Unsupported(reasons.to_vec()).into()
}

/// Opens the GPU whose name contains `name` for a scene. Returns the lane by which the allocator sends it blocks of pixels.
///
/// # Errors
/// There is no such GPU, it cannot be opened, or it does not support the scene.
pub fn painter(name: &str, scene: &Arc<PreparedScene>) -> Result<Lane<RenderWork>, Error> {
    Ok(lane_of(GpuPaths::new(scene, &path_options(Some(name.to_owned()), None))?))
}

fn path_options(adapter: Option<String>, memory: Option<u64>) -> PathOptions {
    let cache = Some(state_folder().join("kernels"));
    PathOptions { adapter, timeout: PATIENCE, memory, cache, ..PathOptions::default() }
}

fn lane_of(gpu: GpuPaths) -> Lane<RenderWork> {
    let window =
        Window { patience: PATIENCE, units_per_packet: UNITS_PER_PACKET, keeps_data: true, ..Window::default() };
    Lane::Windowed(Box::new(gpu) as _, window)
}
