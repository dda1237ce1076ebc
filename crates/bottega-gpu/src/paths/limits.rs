//! Limits of paths on a device: the work that they are not followed for.

use bottega_image::Aov;
use bottega_render::BlockWork;

use super::batch::{PATHS_MAX, path_count};

/// Most pixels of a batch, which bounds what comes back at once.
pub(super) const PIXELS_MAX: u64 = 1 << 20;

/// Why work of scenes that are not on its shelf is given back.
pub(super) const UNKNOWN_SCENE: &str = "the device was not told of this scene";

/// Why a block is given back; `None`: it is painted.
pub(super) fn refusal(block: &BlockWork) -> Option<String> {
    if block.tile.layout().offset(Aov::Cost).is_some() {
        return Some("the cost of a pixel is not known to devices".to_owned());
    }
    if block.settings.photons.is_some() {
        return Some("photon mapping is not known to devices".to_owned());
    }
    if block.tile.rect().area() > PIXELS_MAX || path_count(block) >= PATHS_MAX {
        return Some("too large a block".to_owned());
    }
    None
}
