//! A physically based renderer whose work is shared out by agents, as a library.
//!
//! A picture asked for is a [`Request`]: plain data, the same through every door. A [`Session`] loads its scene, prepares it and
//! chooses who paints; what it paints is a [`Picture`]. While it paints it tells a [`Watcher`] what happens, in [`Event`]s.
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
//! | what | where |
//! |---|---|
//! | what may be asked for: sections, words, limits, checks | [`request`]: `src/request/sections.rs`, `src/request/choices.rs`, `src/request/limits.rs`, `src/request/validate.rs` |
//! | requests as JSON; one field set by its path; what is wrong with JSON, in plain words | `src/request/json.rs`, `src/request/set.rs`; [`json`] |
//! | the way from a request to a picture | [`session`]: `src/session/mod.rs`, `src/session/painting.rs`, `src/session/painter.rs`, `src/session/looking.rs` |
//! | what is told meanwhile, and to whom | [`events`]; `src/session/reporter.rs`, `src/session/watcher.rs` |
//! | the picture, its files and its metadata | [`picture`] |
//! | what a request means to engines and farm | [`settings`]; its scene: [`loaded_scene`]; which integrator paints it: [`method`] |
//! | our own engine made ready | `src/builtin.rs` |
//! | other renderers; which layers their pictures have; what a farm is sent | [`engines`]: `src/engines/painter.rs`, `src/engines/layers.rs`, `src/engines/scene_files.rs` |
//! | scenes that our own engine does not read: who does, what to export | `src/engines/of_scene.rs`, `src/formats.rs` |
//! | processors and GPUs, what each costs, how that is measured | [`devices`]: `src/devices/choice.rs`, `src/devices/costs.rs`, `src/devices/measure.rs`; those kept from picture to picture: `src/devices/kept.rs` |
//! | what they were at while a picture was painted | `src/session/occupation.rs` |
//! | expert knowledge, from files or with the program; as pages show it | [`rules`]; [`rule_view`] |
//! | animations: the request of a frame; which frames, under which names | `src/animation.rs`; [`frames`]: `src/frames/list.rs`, `src/frames/name.rs` |
//! | the journal beside a picture | [`journal`] |
//! | what the Analyst makes of a scene; how two pictures differ | [`analysis`], [`difference`] |
//! | a scene looked around in | [`viewport`] |
//! | previews, denoising | `src/preview.rs`, [`denoise`] |
//! | which build this is | [`identity`] |
//! | ten lines; a scene made in memory | `examples/ten_lines.rs`, `examples/in_memory.rs` |

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
pub mod picture;
mod preview;
pub mod request;
pub mod rule_view;
pub mod rules;
pub mod session;
pub mod settings;
mod tev;
pub mod text;
pub mod viewport;

pub use bottega_farm::StopSwitch;
pub use bottega_scene as scene;

/// Vectors and transformations, as scenes have them.
pub use glam;

pub use self::{
    builtin::own_engine,
    error::Error,
    events::Event,
    picture::Picture,
    request::{InvalidField, Request, RequestError},
    session::{Session, SessionOptions, Watcher},
};
