//! Render engines: what they can do, and how a zone is handed to one.
//!
//! The farm knows an engine only by [`RenderEngine`]. The decision that shaped it: painting is started and reported,
//! never waited for, so that one agent can have its next zone under way before the present one has drained.

mod builtin;
mod engine;
pub mod external;
mod mixed;

pub use bottega_render::{
    RenderError, Sharing,
    survey::{Survey, SurveyPixel},
};
pub use builtin::{BuiltinEngine, BuiltinOptions, Devices};
pub use engine::{
    CancelSwitch, EngineDescription, EngineError, Leaning, Painted, RenderEngine, TaskProgress, Tunables, ZoneTask,
};
pub use mixed::MixedEngine;
