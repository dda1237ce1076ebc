//! A GPU as a resource of the allocator.

use std::{sync::Arc, time::Duration};

use bottega_gpu::{GpuError, GpuPaths, PathOptions};
use bottega_hra::{Lane, Window};
use bottega_render::{PreparedScene, RenderWork};

use bottega_platform::folders::state_folder;

/// A device that does not answer for so long hangs, whatever it was expected to take: a slow one may be the only one.
const PATIENCE: Duration = Duration::from_secs(120);

/// Most units of work that a device is handed over at once: each is thousands of paths, and a fast one does millions in the time
/// that handing over takes.
const UNITS_PER_PACKET: usize = 4096;

/// A GPU that paints a scene; `name`: a part of its name.
pub(crate) fn open(name: Option<String>, scene: &Arc<PreparedScene>) -> Result<Lane<RenderWork>, GpuError> {
    let gpu = GpuPaths::new(scene, &path_options(name, None))?;
    Ok(lane_of(gpu))
}

pub(super) fn path_options(adapter: Option<String>, memory: Option<u64>) -> PathOptions {
    let cache = Some(state_folder().join("kernels"));
    PathOptions { adapter, timeout: PATIENCE, memory, cache, ..PathOptions::default() }
}

pub(super) fn lane_of(gpu: GpuPaths) -> Lane<RenderWork> {
    let window = Window { patience: PATIENCE, units_per_packet: UNITS_PER_PACKET, ..Window::default() };
    Lane::Windowed(Box::new(gpu) as _, window)
}
