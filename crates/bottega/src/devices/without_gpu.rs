//! The replacement for `gpu.rs` in builds without the feature `gpu`: there are no GPUs.

use std::{convert::Infallible, sync::Arc, time::Duration};

use bottega_hra::Lane;
use bottega_render::{PreparedScene, RenderWork};

use crate::error::Error;

/// A GPU chosen for a scene; has no values in this build.
pub(super) struct ChosenGpu(Infallible);

/// The scenes in the memory of a GPU; has no values in this build.
#[derive(Clone)]
pub struct NoScenes(Infallible);

pub use NoScenes as GpuScenes;

impl ChosenGpu {
    pub(super) fn choose(name: Option<&str>, _: &Arc<PreparedScene>) -> Result<Self, Error> {
        Err(Error::NotBuiltIn { device: name.unwrap_or("a GPU").to_owned(), feature: "gpu" })
    }

    pub(super) fn name(&self) -> &str {
        match self.0 {}
    }

    pub(super) fn open(&self, _: Option<u64>) -> Result<(Lane<RenderWork>, GpuScenes), Error> {
        match self.0 {}
    }

    pub(super) fn admit(&self, _: &GpuScenes, _: bool) -> Result<(), Error> {
        match self.0 {}
    }

    pub(super) fn lacks_room(&self, _: Option<u64>) -> Option<String> {
        match self.0 {}
    }
}

/// Returns the devices that are compiling kernels, and for how long; none in this build.
pub fn compiling() -> Vec<(String, Duration)> {
    Vec::new()
}

impl NoScenes {
    /// Returns the bytes of scenes in device memory.
    pub fn resident_bytes(&self) -> u64 {
        match self.0 {}
    }

    /// Returns the bytes of scenes sent to the device so far.
    pub fn sent_bytes(&self) -> u64 {
        match self.0 {}
    }
}

pub(super) fn has_hardware() -> bool {
    false
}

pub(super) fn name_of(_: Option<&str>) -> Option<String> {
    None
}

/// Returns true: a GPU requested by name must be reported as an error, not replaced by another device.
pub(super) fn is_absence(_: &Error) -> bool {
    true
}

pub(super) fn unsupported(reasons: &[String]) -> Error {
    Error::NotBuiltIn { device: format!("a GPU ({})", reasons.join("; ")), feature: "gpu" }
}
