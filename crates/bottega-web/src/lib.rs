//! A running job, for whoever looks: the events of the farm as JSON, an HTTP API, and a live dashboard.
//!
//! No logic of its own: it shows what it is told. The same [`bottega::Event`]s are what `bottega render --json` prints,
//! so that a script and a browser see one and the same thing.
//!
//! # Where is what
//!
//! | what | where |
//! |---|---|
//! | the server: the page, `/api/job`, `/api/events`, `/api/preview.png` | `src/server.rs` |
//! | the page | `src/dashboard.html` |

mod server;

pub use server::{Dashboard, ServeError};
