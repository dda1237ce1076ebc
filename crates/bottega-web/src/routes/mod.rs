//! The routes of the API: a table, from which the server and its OpenAPI document are made.

mod events;
mod jobs;
mod machines;
mod pictures;
mod uploads;

use std::{sync::Arc, time::Duration};

use axum::{
    Router,
    body::{Body, to_bytes},
    extract::{FromRequestParts, Request, rejection::PathRejection},
    http::{StatusCode, header, request::Parts},
    middleware::from_fn,
    middleware::from_fn_with_state,
    response::{IntoResponse, Response},
    routing::{MethodRouter, get},
};
use bottega::Request as PictureRequest;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Serialize, de::DeserializeOwned};

use crate::{
    guard::{admit, guard, steering},
    limits::{JSON_BYTES_MAX, JSON_TIME},
    openapi, page,
    problem::Problem,
    redact::redacted_json,
    state::DoorState,
    tokens::Role,
};

/// The schema of a type, as a generator has it.
pub(crate) type SchemaOf = fn(&mut SchemaGenerator) -> Schema;

/// What a route takes in its body.
#[derive(Clone, Copy)]
pub(crate) enum Taken {
    Nothing,
    Json(SchemaOf),
    Bytes,
}

/// What a route answers.
#[derive(Clone, Copy)]
pub(crate) enum Answer {
    Json(SchemaOf),
    /// Bytes of this kind.
    Media(&'static str),
    Nothing,
}

/// A route.
pub(crate) struct Route {
    pub(crate) method: &'static str,
    /// Parts in braces are parameters.
    pub(crate) path: &'static str,
    /// Who may ask.
    pub(crate) role: Role,
    /// What it is for.
    pub(crate) summary: &'static str,
    pub(crate) taken: Taken,
    pub(crate) status: StatusCode,
    pub(crate) answer: Answer,
    handler: MethodRouter<Arc<DoorState>>,
}

impl Route {
    /// One that tells something to all who may look on.
    fn told(path: &'static str, summary: &'static str, answer: Answer, handler: MethodRouter<Arc<DoorState>>) -> Self {
        let (method, role, taken, status) = ("get", Role::See, Taken::Nothing, StatusCode::OK);
        Self { method, path, role, summary, taken, status, answer, handler }
    }

    /// One that changes something.
    fn done(
        method: &'static str,
        path: &'static str,
        summary: &'static str,
        taken: Taken,
        answer: Answer,
        handler: MethodRouter<Arc<DoorState>>,
    ) -> Self {
        let status = if matches!(answer, Answer::Nothing) { StatusCode::NO_CONTENT } else { StatusCode::OK };
        Self { method, path, role: Role::Steer, summary, taken, status, answer, handler }
    }

    fn with_status(self, status: StatusCode) -> Self {
        Self { status, ..self }
    }
}

/// All routes of the API.
pub(crate) fn all() -> Vec<Route> {
    let mut all = vec![
        Route::told(
            "/api/openapi.json",
            "This API, as OpenAPI 3.1.",
            Answer::Media("application/json"),
            get(async || json_text(StatusCode::OK, openapi::document().to_string())),
        ),
        Route::told(
            "/api/schema/request",
            "The JSON Schema of a request: every field, what it means.",
            Answer::Media("application/schema+json"),
            get(async || json_text(StatusCode::OK, PictureRequest::schema().to_value().to_string())),
        ),
    ];
    all.extend(jobs::routes());
    all.extend(pictures::routes());
    all.push(events::route());
    all.extend(uploads::routes());
    all.extend(machines::routes());
    all
}

/// The page and the API of a door.
pub(crate) fn router(state: &Arc<DoorState>) -> Router {
    let mut api = Router::new();
    for Route { path, role, handler, .. } in all() {
        let handler = if role == Role::Steer { handler.layer(from_fn(steering)) } else { handler };
        api = api.route(path, handler);
    }
    let unknown = async || Problem::unknown("there is no such route", "GET /api/openapi.json has all");
    let wrong_method = async || {
        let detail = "the route does not know this method";
        Problem::new(StatusCode::METHOD_NOT_ALLOWED, detail, "GET /api/openapi.json has all")
    };
    api.route("/api/{*unknown}", axum::routing::any(unknown))
        .method_not_allowed_fallback(wrong_method)
        .layer(from_fn_with_state(Arc::clone(state), admit))
        .merge(page::routes())
        .fallback(unknown)
        .layer(from_fn_with_state(Arc::clone(state), guard))
        .with_state(Arc::clone(state))
}

fn schema<T: JsonSchema>(generator: &mut SchemaGenerator) -> Schema {
    generator.subschema_for::<T>()
}

/// An answer of JSON, without paths of this machine.
fn json(what: &impl Serialize) -> Response {
    json_text(StatusCode::OK, redacted_json(what))
}

fn json_text(status: StatusCode, text: String) -> Response {
    let headers = [(header::CONTENT_TYPE, "application/json"), (header::CACHE_CONTROL, "no-store")];
    (status, headers, text).into_response()
}

/// The body of a request, all of it.
async fn body(request: Request, bytes_max: usize, patience: Duration) -> Result<Vec<u8>, Problem> {
    let too_large = || {
        let detail = format!("the body has more than {bytes_max} bytes");
        Problem::new(StatusCode::PAYLOAD_TOO_LARGE, detail, "send less at a time")
    };
    let length = request.headers().get(header::CONTENT_LENGTH).and_then(|length| length.to_str().ok()?.parse().ok());
    if length.is_some_and(|length: u64| length > bytes_max as u64) {
        return Err(too_large());
    }
    let read = to_bytes(request.into_body(), bytes_max);
    match tokio::time::timeout(patience, read).await {
        Ok(Ok(bytes)) => Ok(bytes.into()),
        Ok(Err(error)) if is_length_limit(&error) => Err(too_large()),
        Ok(Err(_)) => Err(Problem::new(StatusCode::BAD_REQUEST, "the body does not come to its end", "send all of it")),
        Err(_) => {
            let detail = format!("the body did not come in {} s", patience.as_secs());
            Err(Problem::new(StatusCode::REQUEST_TIMEOUT, detail, "send it faster, or less at a time"))
        }
    }
}

fn is_length_limit(error: &axum::Error) -> bool {
    let mut source = std::error::Error::source(error);
    while let Some(error) = source {
        if error.to_string().contains("length limit") {
            return true;
        }
        source = error.source();
    }
    false
}

/// The body of a request, as JSON.
async fn json_body<T: DeserializeOwned>(request: Request<Body>) -> Result<T, Problem> {
    let kind = request.headers().get(header::CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default();
    if kind.split(';').next().unwrap_or_default().trim() != "application/json" {
        let detail = "the body is not said to be JSON";
        return Err(Problem::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, detail, "send `Content-Type: application/json`"));
    }
    let bytes = body(request, JSON_BYTES_MAX, JSON_TIME).await?;
    serde_json::from_slice(&bytes).map_err(|error| {
        let status = if error.is_data() { StatusCode::UNPROCESSABLE_ENTITY } else { StatusCode::BAD_REQUEST };
        Problem::new(status, format!("the body: {error}"), "GET /api/openapi.json says what is allowed")
    })
}

/// A parameter of the path. What is none is no such thing.
struct Param<T>(T);

impl<S: Send + Sync, T: DeserializeOwned + Send> FromRequestParts<S> for Param<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let read = axum::extract::Path::<T>::from_request_parts(parts, state).await;
        read.map(|axum::extract::Path(value)| Self(value)).map_err(|rejection: PathRejection| {
            Problem::unknown(format!("the path names no such thing: {}", rejection.body_text()), "")
        })
    }
}
