//! A request to an engine, and the picture that answers it.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use bottega_image::Rect;

use super::super::protocol::CameraView;
use crate::CancelSwitch;

/// A scene as an engine is to paint it.
#[derive(Clone, Debug)]
pub struct SceneRequest {
    /// The file.
    pub scene: PathBuf,
    /// Size of the picture; `None`: as the scene says.
    pub size: Option<(u32, u32)>,
    /// Which frame of an animation.
    pub frame: Option<i32>,
    /// Threads of the engine.
    pub threads: usize,
    /// The camera of a scene that has none.
    pub view: Option<CameraView>,
    /// Whether scripts in the scene may run.
    pub trust: bool,
    /// More for the engine: what its manifest says, and the user beside it.
    pub parameters: BTreeMap<String, serde_json::Value>,
    /// Files and folders that the engine may read beside the folder of the scene; `/`: all that this process may read.
    pub outside: Vec<PathBuf>,
}

impl SceneRequest {
    /// What the engine may read of the disk beside what is its own.
    pub(in crate::external) fn reads(&self) -> Vec<PathBuf> {
        reads(&self.scene, &self.outside)
    }
}

/// What an engine may read for a scene.
pub(super) fn reads(scene: &Path, outside: &[PathBuf]) -> Vec<PathBuf> {
    let folder = scene.parent().map(Path::to_owned);
    outside.iter().cloned().chain(folder).chain([scene.to_owned()]).collect()
}

/// A window to paint. What is `None` is as the scene says, or the engine has it not.
#[derive(Clone, Debug)]
pub(in crate::external) struct WindowRequest {
    pub(in crate::external) window: Rect,
    pub(in crate::external) samples: u32,
    pub(in crate::external) first_sample: u32,
    pub(in crate::external) seed: u32,
    pub(in crate::external) max_depth: Option<u32>,
    pub(in crate::external) light_samples: Option<u32>,
    /// For how long it may paint: what is done by then is the picture.
    pub(in crate::external) seconds: Option<u32>,
    pub(in crate::external) cancel: CancelSwitch,
}

/// A picture that an engine wrote.
#[derive(Debug)]
pub(in crate::external) struct Written {
    pub(in crate::external) file: PathBuf,
    /// Which part of the frame it shows.
    pub(in crate::external) shows: Rect,
    /// Whether its rows come from below.
    pub(in crate::external) is_upside_down: bool,
    /// Samples of a pixel, where the engine tells.
    pub(in crate::external) samples: Option<u32>,
    /// Seconds that went into what later windows find done.
    pub(in crate::external) once: f64,
}
