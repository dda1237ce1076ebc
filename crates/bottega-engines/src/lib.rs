//! Render engines: what they can do, and how a zone is handed to one.
//!
//! The farm knows an engine only by [`RenderEngine`]. The decision that shaped it: painting is started and reported,
//! never waited for, so that one agent can have its next zone under way before the present one has drained.
//!
//! # Modules
//!
//! | what | where |
//! |---|---|
//! | the contract between farm and engine | `src/engine.rs` |
//! | the built-in engine: zones as work units, blocks or waves of paths | `src/builtin.rs`, `src/builtin/zone.rs`, `src/builtin/waves.rs` |
//! | processors and devices behind one allocator; which picture goes first there | `src/builtin/resources.rs`, `src/builtin/urgency.rs` |
//! | what would be shared with other machines, done alone by the clock | `src/lone_hand.rs` |
//! | two engines that paint one picture | `src/mixed.rs` |
//! | manifests: read, found, shipped | `src/external/manifest.rs`, `src/external/shelf.rs`, `src/external/shipped.rs`; the files: `engines/` |
//! | where an engine is on this machine | `src/external/locate.rs` |
//! | children: limits, their files, and all that they started | `src/external/child.rs`, `src/external/child/guard.rs`, `src/external/child/fence.rs` |
//! | talk with a worker or a command line | `src/external/session/`, the protocol: `src/external/protocol.rs`; the workers: `engines/` |
//! | the check of what an engine wrote | `src/external/picture.rs` |
//! | the look at a scene that only its engine reads, and how many zones it bears | `src/external/tiny.rs` |
//! | a picture in windows of our choice, without the farm | `src/external/trial.rs` |
//! | engines that failed too often on this machine | `src/external/quarantine.rs` |
//! | which files a scene refers to | `src/external/refers.rs` |
//! | pictures in zones held to the engines' own frames | `xtask/src/bars.rs`, the frames: `engines/tests/full_frame.py` |

mod builtin;
mod engine;
pub mod external;
mod lone_hand;
mod mixed;

pub use bottega_render::{
    RenderError, Sharing, SpeedProbe,
    survey::{Survey, SurveyPixel},
};
pub use builtin::{BuiltinEngine, BuiltinOptions, Devices, Resources, Urgency};
pub use engine::{
    CancelSwitch, EngineDescription, EngineError, EnginePreference, Painted, RenderEngine, TaskProgress, Tunables,
    ZoneCallback, ZoneTask,
};
pub use lone_hand::{LoneHand, SharedTime};
pub use mixed::MixedEngine;
