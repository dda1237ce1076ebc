//! The HTTP server ("door") for browsers and other programs: one API and one web page, for a farm or for the picture of one
//! process.
//!
//! It has no logic of its own: it asks a [`ShownFarm`], which is a farm ([`LinkedFarm`]) or this process's picture
//! ([`Dashboard`]). The events are those of `bottega render --json`. `docs/api.md` describes the routes and their limits.
//!
//! # Modules
//!
//! | subject | where |
//! |---|---|
//! | the server: connections, TLS, timeouts | `src/server.rs`, `src/timed_io.rs` |
//! | access control and rate limits | `src/guard.rs`, `src/hosts.rs`, `src/tokens.rs`, `src/limits.rs`; making and revoking tokens: `src/routes/tokens.rs` |
//! | the routes and their answers | `src/route.rs`, `src/routes/`; as OpenAPI: `src/openapi.rs` |
//! | the source of the data: a farm, one picture | `src/source.rs`; `src/linked_farm.rs`, `src/dashboard.rs` |
//! | live state of a job; its messages | `src/live.rs`; `src/message_log.rs` |
//! | interactive views of scenes | `src/viewports.rs`, `src/routes/viewports.rs` |
//! | comparison of pictures | `src/comparisons.rs`, `src/routes/comparisons.rs` |
//! | errors; removal of file paths from answers | `src/problem.rs`, `src/redact.rs` |
//! | the page; the manual | `src/page.rs`, `assets/`; `src/manual.rs` |

mod comparisons;
mod dashboard;
mod error;
mod guard;
mod hosts;
mod limits;
mod linked_farm;
mod live;
mod manual;
mod message_log;
mod openapi;
mod page;
mod problem;
mod redact;
mod route;
mod routes;
mod server;
mod source;
mod state;
mod timed_io;
mod tokens;
mod viewports;

pub use self::{
    dashboard::Dashboard,
    error::ServeError,
    limits::{EVENT_STREAMS_MAX, JSON_BYTES_MAX},
    linked_farm::LinkedFarm,
    live::LiveJob,
    problem::Problem,
    routes::openapi_document,
    server::{Door, DoorOptions},
    source::{AuctionSum, JobAgents, JobOrder, MachineRefusal, MachineStatus, PictureFile, ShownFarm, ShownKind},
};
