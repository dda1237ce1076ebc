//! GPUs as resources of the allocator.

use std::{sync::Arc, time::Duration};

use bottega_gpu::{AdapterKind, EncodedScene, GpuAdapter, GpuError, GpuPaths, PathOptions, adapters};
pub use bottega_gpu::{GpuScenes, compiling};
use bottega_hra::{Lane, Window};
use bottega_platform::folders::state_folder;
use bottega_render::{PreparedScene, RenderWork};

use crate::error::Error;

/// A device that does not answer for this long hangs, whatever it was expected to take: a slow one may be the only one.
const PATIENCE: Duration = Duration::from_secs(120);

/// Most units of work in one packet to a device: each unit is thousands of paths, and a fast device does millions in the time that
/// a packet takes to be handed over.
const UNITS_PER_PACKET: usize = 4096;

/// A GPU that was chosen for a scene, and the scene in its form.
pub(super) struct ChosenGpu {
    adapter: GpuAdapter,
    encoded: EncodedScene,
}

impl ChosenGpu {
    /// Chooses the GPU whose name contains `name`, or the best one.
    ///
    /// # Errors
    /// There is none, or it cannot render the scene.
    pub(super) fn choose(name: Option<&str>, scene: &Arc<PreparedScene>) -> Result<Self, Error> {
        let adapter = GpuAdapter::choose(name)?;
        let encoded = adapter.encode(scene)?;
        Ok(Self { adapter, encoded })
    }

    pub(super) fn name(&self) -> &str {
        &self.adapter.info().name
    }

    /// Opens it as a lane of the allocator, with the place of scenes in its memory.
    ///
    /// - `memory`: bytes that scenes may take there; `None`: nearly all that it has.
    pub(super) fn open(&self, memory: Option<u64>) -> Result<(Lane<RenderWork>, GpuScenes), Error> {
        let gpu = GpuPaths::open(self.adapter.clone(), &path_options(Some(self.name().to_owned()), memory))?;
        let scenes = gpu.scenes();
        Ok((lane_of(gpu), scenes))
    }

    /// Compiles its kernels for the scene, which it may be sent afterwards.
    ///
    /// - `waits`: whether that is waited for. Others paint meanwhile where it is not.
    pub(super) fn admit(&self, scenes: &GpuScenes, waits: bool) -> Result<(), Error> {
        let admitted = if waits { scenes.admit(&self.encoded) } else { scenes.admit_later(&self.encoded) };
        admitted.map_err(Error::from)
    }

    /// Why it has no room for the scene; `None`: it has, or does not tell.
    ///
    /// - `memory`: bytes that scenes may take there; `None`: nearly all that it has.
    pub(super) fn lacks_room(&self, memory: Option<u64>) -> Option<String> {
        let room = memory.or_else(|| self.adapter.memory().map(|memory| memory.free.unwrap_or(memory.total)))?;
        let bytes = self.encoded.bytes();
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        (bytes > room).then(|| format!("the scene takes {:.1} MiB there, and may take {:.1}", mib(bytes), mib(room)))
    }
}

/// Whether this machine has a GPU that is not software.
pub(super) fn has_hardware() -> bool {
    adapters().iter().any(|adapter| adapter.kind != AdapterKind::Software)
}

/// Returns the name of the GPU whose name contains `wanted`, or of the best one that is not software.
pub(super) fn name_of(wanted: Option<&str>) -> Option<String> {
    let adapter = GpuAdapter::choose(wanted).ok()?;
    let info = adapter.info();
    (wanted.is_some() || info.kind != AdapterKind::Software).then(|| info.name.clone())
}

/// Whether an error says that there is no such GPU, not that it cannot render a scene.
pub(super) fn is_absence(error: &Error) -> bool {
    matches!(error, Error::Gpu(GpuError::UnknownAdapter { .. } | GpuError::NoAdapter))
}

/// Returns the error of a picture that no GPU can render, with the reasons.
pub(super) fn unsupported(reasons: &[String]) -> Error {
    GpuError::Unsupported(reasons.to_vec()).into()
}

/// Opens the GPU whose name contains `name` with a scene on it: it renders blocks of pixels.
///
/// # Errors
/// There is none of that name, or it cannot render the scene.
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
