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
//! # Where is what
//!
//! - [`request`]: what may be asked for, its limits, its JSON.
//! - [`session`]: the way from a request to a picture; who is told.
//! - [`picture`]: what is painted, and the files it is written to.
//! - [`settings`]: what a request means to engines and farm. [`subject`]: its scene; [`method`]: which integrator paints it.
//! - [`engines`]: other renderers; [`devices`]: processors and GPUs; [`rules`]: expert knowledge.
//! - [`keeping`]: the journal beside a picture; [`preview`](session::SessionOptions::preview), [`denoise`], [`frames`].

pub mod denoise;
pub mod devices;
pub mod engines;
pub mod error;
pub mod events;
pub mod frames;
pub mod identity;
pub mod keeping;
pub mod method;
mod own;
pub mod picture;
mod preview;
pub mod request;
pub mod rules;
pub mod session;
pub mod settings;
pub mod state;
pub mod subject;
pub mod text;

pub use bottega_farm::StopSwitch;
pub use bottega_scene as scene;

/// Vectors and transformations, as scenes have them.
pub use glam;

pub use self::{
    error::Error,
    events::Event,
    own::own_engine,
    picture::Picture,
    request::{InvalidField, Request, RequestError},
    session::{Session, SessionOptions, Watcher},
};
