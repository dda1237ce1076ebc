//! Render engines: the interface between the farm and an engine, the built-in engine, and external ones.
//!
//! The farm accesses an engine only through [`RenderEngine`]. The decision that shaped it: rendering is asynchronous. A
//! zone is started and its result reported by a callback, so that an agent can start its next zone before the current one
//! has drained.
//!
//! # Modules
//!
//! | what | where |
//! |---|---|
//! | the interface between farm and engine | `src/engine.rs` |
//! | the built-in engine: zones as work units, in blocks or in waves of paths | `src/builtin.rs`, `src/builtin/zone.rs`, `src/builtin/waves.rs` |
//! | processors and devices behind one allocator; priorities of pictures | `src/builtin/resources.rs`, `src/builtin/urgency.rs` |
//! | shared preparation done by one machine alone, with its time | `src/lone_hand.rs` |
//! | several engines for one picture | `src/mixed.rs` |
//! | manifests: parsed, found, shipped | `src/external/manifest.rs`, `src/external/shelf.rs`, `src/external/shipped.rs`; the files: `engines/` |
//! | finding an installed engine | `src/external/locate.rs` |
//! | child processes: limits, file access, and all processes that they start | `src/external/child.rs`, `src/external/child/guard.rs`, `src/external/child/fence.rs` |
//! | workers that wait for the next picture of their scene | `src/external/idle.rs` |
//! | communication with a worker or a command line | `src/external/session/`, the protocol: `src/external/protocol.rs`; the workers: `engines/` |
//! | validation of an engine's output | `src/external/picture.rs` |
//! | survey of a scene that only its engine reads, and the number of zones that pays | `src/external/tiny.rs` |
//! | rendering a picture in given windows, without the farm | `src/external/trial.rs` |
//! | quarantine for engines that fail repeatedly on this machine | `src/external/quarantine.rs` |
//! | the files that a scene refers to | `src/external/refers.rs` |
//! | comparison of zoned pictures with the engines' own frames | `xtask/src/bars.rs`, the frames: `engines/tests/full_frame.py` |

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
