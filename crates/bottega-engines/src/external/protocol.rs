//! What is said to a worker, and what it answers: JSON, an object a line.

use std::{collections::BTreeMap, path::Path};

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
        frame: Option<u32>,
        threads: usize,
        trust: bool,
        scratch: &'a Path,
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
        frame: Option<u32>,
    },
    Files {
        scene: &'a Path,
    },
}

#[derive(Debug, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Answer {
    Ready(Ready),
    Opened(Opened),
    Files(Files),
    Progress(Progress),
    Painted(PaintedFile),
    Failed(Failed),
}

#[derive(Debug, PartialEq, Deserialize)]
pub(super) struct Ready {
    pub(super) version: String,
    pub(super) protocol: u32,
}

/// What a worker says of a scene.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct Opened {
    /// Width of the frame.
    pub width: u32,
    /// Height of the frame.
    pub height: u32,
    /// The scene's first frame.
    #[serde(default)]
    pub first_frame: Option<u32>,
    /// The scene's last frame.
    #[serde(default)]
    pub last_frame: Option<u32>,
    /// What it paints beside the colour.
    #[serde(default)]
    pub layers: Vec<String>,
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
pub(super) struct Progress {
    pub(super) id: u64,
    pub(super) share: f64,
}

#[derive(Debug, PartialEq, Deserialize)]
pub(super) struct PaintedFile {
    pub(super) id: u64,
    pub(super) file: std::path::PathBuf,
    pub(super) window: [u32; 4],
}

#[derive(Debug, PartialEq, Deserialize)]
pub(super) struct Failed {
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
            frame: Some(3),
        };
        let expected = r#"{"do":"paint","id":7,"window":[1,2,3,4],"samples":64,"first_sample":0,"seed":5,"max_depth":null,"light_samples":null,"frame":3}"#;
        assert_eq!(serde_json::to_string(&paint).expect("JSON"), expected);
    }

    #[test]
    fn answers_are_read() {
        let answer: Answer = serde_json::from_str(
            r#"{"painted":{"id":7,"file":"/s/7.exr","window":[0,0,8,8],"samples":64,"seconds":1.25}}"#,
        )
        .expect("an answer");
        assert_eq!(answer, Answer::Painted(PaintedFile { id: 7, file: "/s/7.exr".into(), window: [0, 0, 8, 8] }));
        let answer: Answer =
            serde_json::from_str(r#"{"failed":{"id":null,"reason":"no","fatal":true}}"#).expect("an answer");
        assert_eq!(answer, Answer::Failed(Failed { reason: "no".into(), fatal: true }));
        assert!(serde_json::from_str::<Answer>(r#"{"painted":{"id":-1}}"#).is_err());
    }
}
