//! A physically based renderer as a library; agents share out the work of a picture.
//!
//! A [`Request`] describes a picture as plain data; the command line, the HTTP API and Python make the same requests. A
//! [`Session`] loads the scene, prepares it, chooses the devices and renders a [`Picture`]. During rendering a [`Watcher`]
//! receives [`Event`]s.
//!
//! ```no_run
//! use std::sync::Arc;
//! use bottega::{Request, Session, StopSwitch};
//!
//! let mut request = Request::new("scene.glb");
//! request.goal.samples = Some(64);
//! let picture = Session::open(&request)?.render(Arc::new(()), &StopSwitch::new())?;
//! picture.save("picture.png")?;
//! # Ok::<(), bottega::Error>(())
//! ```
//!
//! # Modules
//!
//! | subject | where |
//! |---|---|
//! | requests: sections, choices, limits, validation | [`request`]: `src/request/sections.rs`, `src/request/choices.rs`, `src/request/limits.rs`, `src/request/validate.rs` |
//! | requests as JSON; setting one field by its path; readable errors of JSON | `src/request/json.rs`, `src/request/set.rs`; [`json`] |
//! | from a request to a picture | [`session`]: `src/session/mod.rs`, `src/session/painting.rs`, `src/session/painter.rs`, `src/session/looking.rs`; sessions of a farm: `src/session/farm.rs` |
//! | events of a job, and their receivers | [`events`]; `src/session/reporter.rs`, `src/session/watcher.rs` |
//! | the picture, its files and its metadata | [`picture`] |
//! | every choice made for a picture; single choices as settings of engines and farm | [`plan`]: `src/plan/job.rs`, `src/plan/part.rs`; [`settings`] |
//! | the scene of a request; its integrator | [`loaded_scene`]; [`method`] |
//! | the built-in engine, prepared for a picture | `src/builtin.rs` |
//! | external engines; the layers of their pictures; the files that a farm needs | [`engines`]: `src/engines/painter.rs`, `src/engines/layers.rs`, `src/engines/scene_files.rs` |
//! | scenes that the built-in engine does not read: the engine that does, the format to export | `src/engines/of_scene.rs`, `src/formats.rs` |
//! | processors and GPUs; the cost of work on each, and its measurement | [`devices`]: `src/devices/choice.rs`, `src/devices/costs.rs`, `src/devices/measure.rs`; devices kept open between pictures: `src/devices/kept.rs` |
//! | utilization of processors and devices | `src/session/occupation.rs` |
//! | expert rules, from files or built in; those of a picture's agents; their view for web pages | [`rules`], [`rule_texts`]; [`agent_rules`]; [`rule_view`] |
//! | the choice between paths and photons by rules | `src/technique_choice.rs`, `rules/technique-choice.fcl` |
//! | animations: the request of one frame; lists of frames and file names | `src/animation.rs`; [`frames`]: `src/frames/list.rs`, `src/frames/name.rs` |
//! | the journal beside a picture | [`journal`] |
//! | the Analyst's view of a scene; the noise of a picture; the difference of two pictures | [`analysis`], [`noise`], [`difference`] |
//! | interactive view of a scene | [`viewport`] |
//! | previews, denoising | `src/preview.rs`, [`denoise`] |
//! | identity of the build | [`identity`] |
//! | examples: ten lines; a scene made in memory | `examples/ten_lines.rs`, `examples/in_memory.rs` |

pub mod agent_rules;
pub mod analysis;
mod animation;
mod brightness;
mod builtin;
pub mod denoise;
pub mod devices;
pub mod difference;
pub mod engines;
pub mod error;
pub mod events;
pub mod experience;
mod formats;
pub mod frames;
pub mod identity;
pub mod journal;
pub mod json;
pub mod loaded_scene;
pub mod method;
pub mod noise;
pub mod picture;
pub mod plan;
mod preview;
pub mod request;
pub mod rule_texts;
pub mod rule_view;
pub mod rules;
pub mod session;
pub mod settings;
mod technique_choice;
mod tev;
pub mod text;
pub mod viewport;

pub use bottega_farm::StopSwitch;
pub use bottega_scene as scene;

/// The crate of the vectors and transformations of scenes.
pub use glam;

pub use self::{
    error::Error,
    events::Event,
    picture::Picture,
    request::{InvalidField, Request, RequestError},
    session::{Session, SessionOptions, Watcher},
};
