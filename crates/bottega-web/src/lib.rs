//! A running job, for whoever looks: the events of the farm as JSON, an HTTP API, and a live dashboard.
//!
//! No logic of its own: it shows what it is told. The same [`bottega::Event`]s are what `bottega render --json` prints,
//! so that a script and a browser see one and the same thing.

mod server;

pub use server::{Dashboard, ServeError};
