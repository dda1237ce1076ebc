//! The table of API routes, from which the server and its OpenAPI document are made.

mod about;
mod comparisons;
mod events;
mod jobs;
mod layers;
mod machines;
mod pictures;
mod tokens;
mod uploads;
mod viewports;

use std::sync::Arc;

use axum::{
    Router,
    http::StatusCode,
    middleware::from_fn_with_state,
    routing::{any, get},
};
use bottega::Request as PictureRequest;
use bottega_cluster::web_secrets::TokenRole;
use serde_json::Value;

use crate::{
    guard::{admit, guard, pace, steering},
    manual, openapi, page,
    problem::Problem,
    route::{Route, RouteAnswer, json_text},
    state::DoorState,
};

/// Returns the API as an OpenAPI 3.1 document.
pub fn openapi_document() -> Value {
    openapi::document(&all())
}

/// Returns all routes of the API.
fn all() -> Vec<Route> {
    let mut routes = vec![
        Route::query(
            "/api/openapi.json",
            "This API, as OpenAPI 3.1.",
            RouteAnswer::Media("application/json"),
            get(async || json_text(StatusCode::OK, openapi_document().to_string())),
        )
        .for_all(),
        Route::query(
            "/api/schema/request",
            "The JSON Schema of a request: every field, what it means.",
            RouteAnswer::Media("application/schema+json"),
            get(async || json_text(StatusCode::OK, PictureRequest::schema().to_value().to_string())),
        )
        .for_all(),
    ];
    routes.extend(jobs::routes());
    routes.extend(pictures::routes());
    routes.extend(layers::routes());
    routes.extend(comparisons::routes());
    routes.push(events::route());
    routes.extend(uploads::routes());
    routes.extend(machines::routes());
    routes.extend(tokens::routes());
    routes.extend(viewports::routes());
    routes.push(about::route());
    routes
}

/// Returns the router of a door: page, manual and API.
pub(crate) fn router(state: &Arc<DoorState>) -> Router {
    let (mut api, mut open) = (Router::new(), Router::new());
    for Route { path, role, is_open, handler, .. } in all() {
        let steered = || from_fn_with_state(Arc::clone(state), steering);
        let handler = if role == TokenRole::Steer { handler.layer(steered()) } else { handler };
        if is_open {
            open = open.route(path, handler);
        } else {
            api = api.route(path, handler);
        }
    }
    let unknown = async || Problem::unknown("there is no such route", "GET /api/openapi.json has all");
    let wrong_method = async || {
        let detail = "the route does not know this method";
        Problem::new(StatusCode::METHOD_NOT_ALLOWED, detail, "GET /api/openapi.json has all")
    };
    api.route("/api/{*unknown}", any(unknown))
        .method_not_allowed_fallback(wrong_method)
        .layer(from_fn_with_state(Arc::clone(state), admit))
        .merge(open.method_not_allowed_fallback(wrong_method).layer(from_fn_with_state(Arc::clone(state), pace)))
        .merge(page::routes())
        .merge(manual::routes())
        .fallback(unknown)
        .layer(from_fn_with_state(Arc::clone(state), guard))
        .with_state(Arc::clone(state))
}
