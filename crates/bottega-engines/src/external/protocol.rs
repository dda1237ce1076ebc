//! The protocol with a worker: JSON, an object a line.

use std::{collections::BTreeMap, path::Path};

use bottega_image::{Combine, Layer};
use bottega_scene::{FilmFilter, objects_only::from_json};
use serde::{Deserialize, Serialize};

/// The version of the protocol.
pub(super) const VERSION: u32 = 1;

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

#[derive(Debug, PartialEq, Deserialize)]
pub(super) struct Ready {
    pub(super) version: String,
    pub(super) protocol: u32,
}

/// The description of a scene by a worker.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct Opened {
    /// Width of the frame.
    pub width: u32,
    /// Height of the frame.
    pub height: u32,
    /// The scene's first frame.
    #[serde(default)]
    pub first_frame: Option<i32>,
    /// The scene's last frame.
    #[serde(default)]
    pub last_frame: Option<i32>,
    /// Whether the scene has a camera, or has been given one. Without one nothing can be painted.
    #[serde(default = "yes")]
    pub camera: bool,
    /// What a window costs beside its samples, in seconds, where it costs so much that it should not be tried out.
    #[serde(default)]
    pub window_seconds: Option<f64>,
    /// How samples are spread over a pixel; `None`: nobody knows, or in a way that there is no name for.
    #[serde(default)]
    pub filter: Option<FilmFilter>,
    /// What it paints beside the colour.
    #[serde(default)]
    pub layers: Vec<OpenedLayer>,
}

fn yes() -> bool {
    true
}

/// A camera for a scene that has none, in the axes of the scene's file. It looks along its own −z, and +y is up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CameraView {
    /// Where it stands: camera space to world space, without scale, column by column.
    pub world_from_camera: [f32; 16],
    /// From the lower to the upper edge, in radians.
    pub vertical_fov: f32,
}

impl Opened {
    /// What a window costs beside its samples, if that is a time at all.
    pub(super) fn window_seconds(&self) -> Option<f64> {
        self.window_seconds.filter(|seconds| (0.0..f64::from(u16::MAX)).contains(seconds))
    }

    /// The layers, as a film keeps them.
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
    /// Its name.
    pub name: String,
    /// Its channels: in the file they have its name before theirs, and a dot between.
    pub channels: Vec<String>,
    /// What several passes come to.
    #[serde(default)]
    pub combine: CombineWord,
    /// Whether it is what our own engine means by a layer of this name.
    #[serde(default)]
    pub shared: bool,
}

/// The combination of several passes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CombineWord {
    /// Their weighted mean.
    #[default]
    Mean,
    /// That of most samples.
    Pick,
}

/// The files that a scene refers to.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct Files {
    /// Those that are there.
    pub files: Vec<std::path::PathBuf>,
    /// Those that are not.
    #[serde(default)]
    pub missing: Vec<String>,
}

#[derive(Debug, PartialEq, Deserialize)]
pub(super) struct ProgressReport {
    pub(super) id: u64,
    pub(super) share: f64,
}

#[derive(Debug, PartialEq, Deserialize)]
pub(super) struct PaintedFile {
    pub(super) id: u64,
    pub(super) file: std::path::PathBuf,
    pub(super) window: [u32; 4],
    /// Fewer than were asked for where time was up.
    #[serde(default)]
    pub(super) samples: Option<u32>,
    /// Seconds that went into what later windows find done.
    #[serde(default)]
    pub(super) once: f64,
}

impl WorkerReply {
    /// Understands a line.
    pub(super) fn parse(line: &str) -> serde_json::Result<Self> {
        from_json(line.as_bytes())
    }
}

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
        // Members by their order are no answer.
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
