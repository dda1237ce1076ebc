//! The route about the program: its version, and the kind of source it shows.

use axum::{extract::State, routing::get};
use schemars::JsonSchema;
use serde::Serialize;

use crate::{
    route::{AtDoor, Route, RouteAnswer, RouteResult, json, schema},
    source::ShownKind,
};

/// The program behind the API.
#[derive(Debug, Serialize, JsonSchema)]
struct About {
    /// The version of the program.
    version: &'static str,
    /// The identity of the program's build; only builds with the same identity give the same bits.
    build: &'static str,
    /// The source: `farm`, or `picture` (the picture of one process, which is job 1).
    shows: ShownKind,
}

pub(super) fn route() -> Route {
    Route::query(
        "/api/about",
        "The version of the program, and whether a farm or the picture of one process is shown.",
        RouteAnswer::Json(schema::<About>),
        get(about),
    )
}

async fn about(State(door): AtDoor) -> RouteResult {
    let build = bottega_cluster::build::build().identity();
    Ok(json(&About { version: env!("CARGO_PKG_VERSION"), build, shows: door.farm.kind() }))
}
