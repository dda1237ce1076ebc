//! The protocol with a worker: one JSON object per line.

use std::{collections::BTreeMap, path::Path};

use bottega_image::{Combine, Layer};
use bottega_scene::{FilmFilter, objects_only::from_json};
use serde::{Deserialize, Serialize};

/// The version of the protocol.
pub(super) const VERSION: u32 = 1;

/// A request to a worker.
#[derive(Debug, Serialize)]
#[serde(tag = "do", rename_all = "lowercase")]
pub(super) enum Request<'a> {
    Open {
        scene: &'a Path,
        width: Option<u32>,
        height: Option<u32>,
        frame: Option<i32>,
        threads: usize,
        trust: bool,
        scratch: &'a Path,
        view: Option<CameraView>,
        parameters: &'a BTreeMap<String, serde_json::Value>,
    },
    Paint {
        id: u64,
        window: [u32; 4],
        samples: u32,
        first_sample: u32,
        seed: u32,
        max_depth: Option<u32>,
        light_samples: Option<u32>,
        time: Option<u32>,
        frame: Option<i32>,
    },
    Files {
        scene: &'a Path,
    },
}

/// An answer of a worker.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum WorkerReply {
    Ready(Ready),
    Opened(Opened),
    Files(Files),
    Progress(ProgressReport),
    Painted(PaintedFile),
    Failed(WorkerFailure),
}

/// The first answer of a worker, once it can take requests.
#[derive(Debug, PartialEq, Deserialize)]
pub(super) struct Ready {
    pub(super) version: String,
    pub(super) protocol: u32,
}

/// A worker's description of a scene.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct Opened {
    /// The width of the frame in pixels.
    pub width: u32,
    /// The height of the frame in pixels.
    pub height: u32,
    /// The first frame of the scene's animation; `None`: the worker reports none.
    #[serde(default)]
    pub first_frame: Option<i32>,
    /// The last frame of the scene's animation; `None`: the worker reports none.
    #[serde(default)]
    pub last_frame: Option<i32>,
    /// True if the scene has a camera, or was given one. Without one nothing can be rendered.
    #[serde(default = "yes")]
    pub camera: bool,
    /// The cost of a window in seconds, without its samples, if it is so high that it should not be measured.
    #[serde(default)]
    pub window_seconds: Option<f64>,
    /// The pixel filter; `None`: unknown or unsupported.
    #[serde(default)]
    pub filter: Option<FilmFilter>,
    /// The layers that the worker renders in addition to the color.
    #[serde(default)]
    pub layers: Vec<OpenedLayer>,
}

fn yes() -> bool {
    true
}

/// A camera for a scene without one, in the axes of the scene file. It looks along its −z axis, and +y is up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CameraView {
    /// The transform from camera space to world space, without scale, column by column.
    pub world_from_camera: [f32; 16],
    /// The vertical field of view, in radians.
    pub vertical_fov: f32,
}

impl Opened {
    /// Returns the reported cost of a window, without its samples, if it is a plausible time.
    pub(super) fn window_seconds(&self) -> Option<f64> {
        self.window_seconds.filter(|seconds| (0.0..f64::from(u16::MAX)).contains(seconds))
    }

    /// Returns the layers that the worker announced, in the form that a film uses.
    pub fn layers(&self) -> impl Iterator<Item = Layer> {
        self.layers.iter().map(|OpenedLayer { name, channels, combine, .. }| Layer {
            name: name.clone(),
            channels: channels.clone(),
            combine: match combine {
                CombineWord::Mean => Combine::Mean,
                CombineWord::Pick => Combine::Pick,
            },
        })
    }
}

/// A layer that a worker announces.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct OpenedLayer {
    /// The name of the layer.
    pub name: String,
    /// The names of the layer's channels; in the file they are prefixed with the layer's name and a period.
    pub channels: Vec<String>,
    /// The way to combine the values of several passes.
    #[serde(default)]
    pub combine: CombineWord,
    /// True if the layer has the same meaning as the built-in engine's layer of this name.
    #[serde(default)]
    pub shared: bool,
}

/// The way to combine the values of several passes in a layer, as the worker names it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CombineWord {
    /// The mean, weighted by samples.
    #[default]
    Mean,
    /// The value of the pass with the most samples.
    Pick,
}

/// The files that a scene refers to.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct Files {
    /// The paths of existing files.
    pub files: Vec<std::path::PathBuf>,
    /// Missing files, as named in the scene.
    #[serde(default)]
    pub missing: Vec<String>,
}

/// The rendered share of a window, in 0..=1.
#[derive(Debug, PartialEq, Deserialize)]
pub(super) struct ProgressReport {
    pub(super) id: u64,
    pub(super) share: f64,
}

/// The answer to a finished window: the file, and the part of the frame that it shows.
#[derive(Debug, PartialEq, Deserialize)]
pub(super) struct PaintedFile {
    pub(super) id: u64,
    pub(super) file: std::path::PathBuf,
    pub(super) window: [u32; 4],
    /// Samples per pixel, if fewer than requested because of a time limit.
    #[serde(default)]
    pub(super) samples: Option<u32>,
    /// Seconds spent on work that later windows reuse.
    #[serde(default)]
    pub(super) once: f64,
}

impl WorkerReply {
    /// Parses a line.
    pub(super) fn parse(line: &str) -> serde_json::Result<Self> {
        from_json(line.as_bytes())
    }
}

/// The answer to a request that failed; if `fatal`, the worker must be restarted.
#[derive(Debug, PartialEq, Deserialize)]
pub(super) struct WorkerFailure {
    pub(super) reason: String,
    #[serde(default)]
    pub(super) fatal: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_as_the_protocol_says() {
        let paint = Request::Paint {
            id: 7,
            window: [1, 2, 3, 4],
            samples: 64,
            first_sample: 0,
            seed: 5,
            max_depth: None,
            light_samples: None,
            time: Some(20),
            frame: Some(3),
        };
        let expected = r#"{"do":"paint","id":7,"window":[1,2,3,4],"samples":64,"first_sample":0,"seed":5,"max_depth":null,"light_samples":null,"time":20,"frame":3}"#;
        assert_eq!(serde_json::to_string(&paint).expect("JSON"), expected);
    }

    #[test]
    fn answers_are_read() {
        let answer: WorkerReply = serde_json::from_str(
            r#"{"painted":{"id":7,"file":"/s/7.exr","window":[0,0,8,8],"samples":64,"seconds":1.25,"once":0.5}}"#,
        )
        .expect("an answer");
        let (file, window) = ("/s/7.exr".into(), [0, 0, 8, 8]);
        let painted = PaintedFile { id: 7, file, window, samples: Some(64), once: 0.5 };
        assert_eq!(answer, WorkerReply::Painted(painted));
        let answer: WorkerReply =
            serde_json::from_str(r#"{"failed":{"id":null,"reason":"no","fatal":true}}"#).expect("an answer");
        assert_eq!(answer, WorkerReply::Failed(WorkerFailure { reason: "no".into(), fatal: true }));
        assert!(serde_json::from_str::<WorkerReply>(r#"{"painted":{"id":-1}}"#).is_err());
        // An array with the members in order is not accepted.
        assert!(WorkerReply::parse(r#"{"failed":{"reason":"no","fatal":true}}"#).is_ok());
        assert!(WorkerReply::parse(r#"{"failed":["no",true]}"#).is_err());
        let answer = serde_json::from_str(
            r#"{"opened":{"width":8,"height":8,"filter":{"kind":"gaussian","radius":2,"sigma":0.5},"layers":[{"name":"id","channels":["Y"],"combine":"pick"}]}}"#,
        );
        let Ok(WorkerReply::Opened(opened)) = answer else { panic!("{answer:?}") };
        let layer = Layer { name: "id".to_owned(), channels: vec!["Y".to_owned()], combine: Combine::Pick };
        assert_eq!(opened.layers().collect::<Vec<_>>(), [layer]);
        let filter = FilmFilter::Gaussian { radius: 2.0, sigma: 0.5 };
        assert_eq!((opened.filter, opened.camera), (Some(filter), true));
    }
}
