//! Errors of preparing and rendering a scene.

/// An error of preparing or rendering a scene.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The scene has no camera with this index.
    #[error("there is no camera {index}: the scene has {count}")]
    NoCamera {
        /// The requested index of a camera, from 0.
        index: usize,
        /// Number of cameras.
        count: usize,
    },
    /// The picture has no pixels.
    #[error("a picture of {width} × {height} pixels has no pixel")]
    EmptyPicture {
        /// Requested width in pixels.
        width: u32,
        /// Requested height in pixels.
        height: u32,
    },
    /// The scene violates an invariant of the model, such as an index out of range.
    #[error("the scene is invalid")]
    UnsoundScene(#[source] Box<bottega_scene::SceneError>),
    /// Photon mapping and lighting agents do not support the scene's media, subsurface scattering, visibility by kind
    /// of ray, or motion.
    #[error(
        "photons and lighting agents do not support media that scatter, emit or have no surface, subsurface scattering, visibility by kind of ray, and motion blur; render this scene by path tracing"
    )]
    PhotonsInMedia,
    /// A picture that tries photons was rendered before its trial.
    #[error("paths and photons were not tried before the first zone")]
    Untried,
    /// The acceleration structure cannot be built.
    #[error("cannot build the acceleration structure")]
    Accel(#[from] bottega_kernels::BuildError),
    /// The allocator rejected the work.
    #[error("the allocator refused the work")]
    Submit(#[from] bottega_hra::SubmitError),
    /// The allocator did not finish a work unit.
    #[error("a unit of work was lost")]
    Unit(#[from] bottega_hra::UnitError),
    /// A work unit failed with one of the other errors.
    #[error(transparent)]
    Refused(std::sync::Arc<RenderError>),
    /// Work shared with others was abandoned.
    #[error("the shared work was left before its end")]
    Left,
    /// A resource returned an answer of the wrong kind, or none.
    #[error("a unit of work was answered with the wrong kind of result")]
    Unanswered,
}
