//! The identity of a picture over several jobs.

use std::sync::Arc;

/// The identity of a job's picture, which recognizes it in a later job. An empty scene: unknown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Subject {
    /// The scene: equal for equal files and options of reading them.
    pub scene: Arc<str>,
    /// The view of the scene: camera, pose, and the painted part of the picture.
    pub view: Arc<str>,
}

impl Default for Subject {
    fn default() -> Self {
        Self { scene: "".into(), view: "".into() }
    }
}
