//! In place of `gpu.rs` where the library is built without the feature `gpu`: there are no GPUs.

use std::{convert::Infallible, sync::Arc, time::Duration};

use bottega_hra::Lane;
use bottega_render::{PreparedScene, RenderWork};

use crate::error::Error;

/// A GPU that was chosen for a scene. There are none.
pub(super) struct ChosenGpu(Infallible);

/// In place of the scenes in the memory of a GPU. There are none.
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

/// The devices that compile kernels just now, and for how long they have. There are none.
pub fn compiling() -> Vec<(String, Duration)> {
    Vec::new()
}

impl NoScenes {
    /// Bytes of scenes that it holds.
    pub fn resident_bytes(&self) -> u64 {
        match self.0 {}
    }

    /// Bytes of scenes that it was sent so far.
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

/// A GPU that was asked for by name is an error: no other device stands in for it.
pub(super) fn is_absence(_: &Error) -> bool {
    true
}

pub(super) fn unsupported(reasons: &[String]) -> Error {
    Error::NotBuiltIn { device: format!("a GPU ({})", reasons.join("; ")), feature: "gpu" }
}
