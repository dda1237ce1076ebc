//! The call of a viewport to the machines of its farm, and their answers: live messages.

use std::{collections::BTreeMap, time::Duration};

use bottega::Request;
use bottega_scene::Camera;
use serde::{Deserialize, Serialize};

use crate::files::sent_files::SentFiles;

/// The channel of calls.
pub(crate) const CALLS: &str = "viewport/calls";
/// Interval between calls of an open viewport.
pub(crate) const CALL_EVERY: Duration = Duration::from_secs(1);
/// Time without a call after which a viewport counts as closed.
pub(crate) const CALL_LASTS: Duration = Duration::from_secs(4);
/// Number of sample indices of a helper: the owner's come first, then those of each helper.
pub(crate) const HELPER_SAMPLES: u32 = 1 << 14;
/// The last place of a helper whose sample indices are numbers.
pub(crate) const PLACES_MAX: u32 = u32::MAX / HELPER_SAMPLES - 1;

/// Returns the channel by which the helpers of a viewport send messages to its owner.
pub(crate) fn frames_channel(viewport: u64) -> String {
    format!("viewport/{viewport:x}/frames")
}

/// A call of an open viewport: what it shows. The owner renders it as well.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct ViewportCall {
    /// The unique number of the viewport.
    pub(crate) viewport: u64,
    /// The name of the owner's computer.
    pub(crate) host: String,
    /// The identity of the owner's build: samples of other builds are of other pictures.
    pub(crate) version: String,
    /// The view to render; `None`: nothing at the moment.
    pub(crate) look: Option<CalledLook>,
    /// True if the look has ended and another one will be called soon.
    pub(crate) is_moving: bool,
    /// Places of the helpers by name, from 1. A helper without a place sends a [`HelperNotice`] and waits.
    pub(crate) places: BTreeMap<String, u32>,
    /// The most bytes per second that each helper may send.
    pub(crate) bytes_per_second: u64,
    /// True if the viewport is closed.
    pub(crate) is_over: bool,
}

/// A look that helpers render samples of.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct CalledLook {
    /// The number of the look.
    pub(crate) number: u64,
    /// The request of [`bottega::viewport::ViewportLook`].
    pub(crate) request: Request,
    /// The camera of the look.
    pub(crate) camera: Camera,
    /// The number of the state of the scene.
    pub(crate) state: u64,
    /// The file of the scene.
    pub(crate) scene: SentFiles,
}

/// The report of a helper on its own state.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct HelperNotice {
    /// The name of its process.
    pub(crate) name: String,
    /// True if the farm no longer has the scene.
    pub(crate) lacks_scene: bool,
    /// The reason why it cannot help.
    pub(crate) refuses: Option<String>,
    /// True if it leaves, for a job or because its owner needs it.
    pub(crate) leaves: bool,
}
