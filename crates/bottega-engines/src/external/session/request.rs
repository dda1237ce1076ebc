//! A request to an external engine, and the picture that it writes.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use bottega_image::Rect;

use super::super::protocol::CameraView;
use crate::CancelSwitch;

/// A request to open a scene.
#[derive(Clone, Debug)]
pub struct SceneRequest {
    /// The path of the scene file.
    pub scene: PathBuf,
    /// Width and height of the picture in pixels; `None`: those of the scene.
    pub size: Option<(u32, u32)>,
    /// The frame of an animation; `None`: the one that the scene file selects.
    pub frame: Option<i32>,
    /// The number of threads of the engine.
    pub threads: usize,
    /// The camera for a scene without one; `None`: that of the scene, if it has one.
    pub view: Option<CameraView>,
    /// True if scripts in the scene may run.
    pub trust: bool,
    /// Further parameters for the engine by their names, from its manifest and from the user.
    pub parameters: BTreeMap<String, serde_json::Value>,
    /// Files and folders that the engine may read in addition to the folder of the scene; `/`: everything that this process
    /// may read.
    pub outside: Vec<PathBuf>,
}

impl SceneRequest {
    /// Returns the files that the engine may read in addition to its own.
    pub(in crate::external) fn reads(&self) -> Vec<PathBuf> {
        reads(&self.scene, &self.outside)
    }
}

/// Returns the files that an engine may read for a scene.
pub(super) fn reads(scene: &Path, outside: &[PathBuf]) -> Vec<PathBuf> {
    let folder = scene.parent().map(Path::to_owned);
    outside.iter().cloned().chain(folder).chain([scene.to_owned()]).collect()
}

/// A request to render a window. `None` values are those of the scene, or unsupported.
#[derive(Clone, Debug)]
pub(in crate::external) struct WindowRequest {
    pub(in crate::external) window: Rect,
    pub(in crate::external) samples: u32,
    pub(in crate::external) first_sample: u32,
    pub(in crate::external) seed: u32,
    pub(in crate::external) max_depth: Option<u32>,
    pub(in crate::external) light_samples: Option<u32>,
    /// The time limit in seconds: what is rendered by then is the result.
    pub(in crate::external) seconds: Option<u32>,
    pub(in crate::external) cancel: CancelSwitch,
}

/// A picture file that an engine wrote.
#[derive(Debug)]
pub(in crate::external) struct Written {
    pub(in crate::external) file: PathBuf,
    /// The part of the frame that it shows.
    pub(in crate::external) shows: Rect,
    /// True if the picture's first row is at the bottom.
    pub(in crate::external) is_upside_down: bool,
    /// Samples per pixel, if the engine reports them.
    pub(in crate::external) samples: Option<u32>,
    /// Seconds spent on work that later windows reuse.
    pub(in crate::external) once: f64,
}
