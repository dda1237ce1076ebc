//! Limits of path tracing on a device.

use bottega_image::Aov;
use bottega_render::{BlockWork, camera::is_camera_for_devices, flat::LAYERS};

use super::batch::{PATHS_MAX, path_count};

/// The maximum number of pixels per batch; bounds the size of the readback.
pub(super) const PIXELS_MAX: u64 = 1 << 20;

/// The reason for returning work of scenes that were not admitted.
pub(super) const UNKNOWN_SCENE: &str = "the scene was not given to this device";

/// Returns the reason why a block is returned; `None`: it is rendered.
pub(super) fn refusal(block: &BlockWork) -> Option<String> {
    if block.tile.layout().offset(Aov::Cost).is_some() {
        return Some("devices do not support the layer `cost`".to_owned());
    }
    if let Some(aov) = block.tile.layout().aovs().iter().find(|aov| !LAYERS.contains(aov)) {
        return Some(format!("devices do not support the layer `{}`", aov.name()));
    }
    if let Some(layer) = block.tile.layout().layers().first() {
        return Some(format!("devices do not support the layer `{}`", layer.name));
    }
    if !is_camera_for_devices(&block.view.camera) {
        return Some("devices do not support this camera".to_owned());
    }
    if block.settings.photons.is_some() {
        return Some("devices do not support photon mapping".to_owned());
    }
    if block.tile.rect().area() > PIXELS_MAX || path_count(block) >= PATHS_MAX {
        return Some("the block is too large".to_owned());
    }
    None
}
