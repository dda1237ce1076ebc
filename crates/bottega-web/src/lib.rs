//! The door for browsers and other programs: one HTTP API and one page, for a farm and for the picture of one process.
//!
//! No logic of its own: it asks a [`ShownFarm`], which is a farm ([`LinkedFarm`]) or this process's picture ([`Dashboard`]). The
//! events are those of `bottega render --json`. What a client may do, and how much, is in `docs/api.md`.
//!
//! # Modules
//!
//! | what | where |
//! |---|---|
//! | the server: connections, TLS, timeouts | `src/server.rs`, `src/timed_io.rs` |
//! | who may come in, and how often | `src/guard.rs`, `src/hosts.rs`, `src/tokens.rs`, `src/limits.rs`; tokens made and revoked: `src/routes/tokens.rs` |
//! | the routes, and what each answers | `src/route.rs`, `src/routes/`; as OpenAPI: `src/openapi.rs` |
//! | what is shown: a farm, one picture | `src/source.rs`; `src/linked_farm.rs`, `src/dashboard.rs` |
//! | a job as it changes; its messages | `src/live.rs`; `src/message_log.rs` |
//! | scenes that are looked around in | `src/viewports.rs`, `src/routes/viewports.rs` |
//! | pictures compared | `src/comparisons.rs`, `src/routes/comparisons.rs` |
//! | errors; paths that nobody is told | `src/problem.rs`, `src/redact.rs` |
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
