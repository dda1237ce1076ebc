//! The errors before and while painting.

/// Why a scene cannot be prepared, or a picture not be painted.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The scene has no such camera.
    #[error("there is no camera {index}: the scene has {count}")]
    NoCamera {
        /// The index asked for.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// The picture would have no pixel.
    #[error("a picture of {width} × {height} pixels has no pixel")]
    EmptyPicture {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The scene breaks a promise of the model, such as an index out of range.
    #[error("the scene is not sound")]
    UnsoundScene(#[source] Box<bottega_scene::SceneError>),
    /// Photons cannot be found in what fills space.
    #[error(
        "photons and lighting agents know nothing of media that scatter, emit or have no surface; paint this scene by path tracing"
    )]
    PhotonsInMedia,
    /// The acceleration structure cannot be built.
    #[error("cannot build the acceleration structure")]
    Accel(#[from] bottega_kernels::BuildError),
    /// The allocator did not take the work.
    #[error("the allocator refused the work")]
    Submit(#[from] bottega_hra::SubmitError),
    /// A unit of work was not done.
    #[error("a unit of work was lost")]
    Unit(#[from] bottega_hra::UnitError),
    /// A unit of work met one of the other errors.
    #[error(transparent)]
    Refused(std::sync::Arc<RenderError>),
    /// Work that is shared out with others was left before its end.
    #[error("the work that is shared out with others was left before its end")]
    Left,
    /// A resource gave an answer to another question, or none.
    #[error("a unit of work was not answered as asked")]
    Unanswered,
}
