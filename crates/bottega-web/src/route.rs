//! The type of API routes, and helpers of their handlers: reading bodies, writing answers.

use std::{sync::Arc, time::Duration};

use axum::{
    body::{Body, to_bytes},
    extract::{FromRequestParts, Request, State, path::ErrorKind, rejection::PathRejection},
    http::{StatusCode, header, request::Parts},
    response::{IntoResponse, Response},
    routing::MethodRouter,
};
use bottega_cluster::web_secrets::TokenRole;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Serialize, de::DeserializeOwned};

use crate::{
    limits::{JSON_BYTES_MAX, JSON_TIME},
    problem::Problem,
    redact::redacted_json,
    state::DoorState,
};

/// The result of a handler.
pub(crate) type RouteResult = Result<Response, Problem>;
/// The shared state of the door, as handlers receive it.
pub(crate) type AtDoor = State<Arc<DoorState>>;

/// A function that adds the schema of a type to a generator.
pub(crate) type SchemaOf = fn(&mut SchemaGenerator) -> Schema;

/// The body of a route's requests.
#[derive(Clone, Copy)]
pub(crate) enum RouteBody {
    Nothing,
    Json(SchemaOf),
    Bytes,
}

/// The body of a route's answers.
#[derive(Clone, Copy)]
pub(crate) enum RouteAnswer {
    Json(SchemaOf),
    /// Bytes of this media type.
    Media(&'static str),
    Nothing,
}

/// A route of the API.
pub(crate) struct Route {
    pub(crate) method: &'static str,
    /// The path; parts in braces are parameters.
    pub(crate) path: &'static str,
    /// The role that a token needs.
    pub(crate) role: TokenRole,
    /// True if no token is needed.
    pub(crate) is_open: bool,
    /// The summary for the OpenAPI document.
    pub(crate) summary: &'static str,
    pub(crate) taken: RouteBody,
    pub(crate) status: StatusCode,
    pub(crate) answer: RouteAnswer,
    pub(crate) handler: MethodRouter<Arc<DoorState>>,
}

impl Route {
    /// Makes a route that returns data to holders of any token.
    pub(crate) fn query(
        path: &'static str,
        summary: &'static str,
        answer: RouteAnswer,
        handler: MethodRouter<Arc<DoorState>>,
    ) -> Self {
        let (method, role, taken, status) = ("get", TokenRole::See, RouteBody::Nothing, StatusCode::OK);
        Self { method, path, role, is_open: false, summary, taken, status, answer, handler }
    }

    /// Makes a route that changes something.
    pub(crate) fn action(
        method: &'static str,
        path: &'static str,
        summary: &'static str,
        taken: RouteBody,
        answer: RouteAnswer,
        handler: MethodRouter<Arc<DoorState>>,
    ) -> Self {
        let status = if matches!(answer, RouteAnswer::Nothing) { StatusCode::NO_CONTENT } else { StatusCode::OK };
        Self { method, path, role: TokenRole::Steer, is_open: false, summary, taken, status, answer, handler }
    }

    /// Returns the route with access without a token.
    pub(crate) fn for_all(self) -> Self {
        Self { is_open: true, ..self }
    }

    pub(crate) fn with_status(self, status: StatusCode) -> Self {
        Self { status, ..self }
    }
}

pub(crate) fn schema<T: JsonSchema>(generator: &mut SchemaGenerator) -> Schema {
    generator.subschema_for::<T>()
}

/// Returns a JSON answer, without paths of this machine.
pub(crate) fn json(what: &impl Serialize) -> Response {
    json_text(StatusCode::OK, redacted_json(what))
}

pub(crate) fn json_text(status: StatusCode, text: String) -> Response {
    let headers = [(header::CONTENT_TYPE, "application/json"), (header::CACHE_CONTROL, "no-store")];
    (status, headers, text).into_response()
}

/// Reads the whole body of a request.
///
/// - `bytes_max`: largest size of the body, in bytes.
/// - `patience`: time limit.
///
/// # Errors
/// The body is too large, or does not arrive in time.
pub(crate) async fn body(request: Request, bytes_max: usize, patience: Duration) -> Result<Vec<u8>, Problem> {
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
        Ok(Err(_)) => Err(Problem::new(StatusCode::BAD_REQUEST, "the body is incomplete", "send all of it")),
        Err(_) => {
            let detail = format!("the body did not arrive in {} s", patience.as_secs());
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

/// Reads the body of a request as JSON.
///
/// # Errors
/// Those of [`body`], or the content type or the contents are not the expected JSON.
pub(crate) async fn json_body<T: DeserializeOwned>(request: Request<Body>) -> Result<T, Problem> {
    let kind = request.headers().get(header::CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default();
    if kind.split(';').next().unwrap_or_default().trim() != "application/json" {
        let detail = "the content type of the body is not JSON";
        return Err(Problem::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, detail, "send `Content-Type: application/json`"));
    }
    let bytes = body(request, JSON_BYTES_MAX, JSON_TIME).await?;
    bottega::json::from_slice(&bytes).map_err(|error| {
        let status = if error.is_data() { StatusCode::UNPROCESSABLE_ENTITY } else { StatusCode::BAD_REQUEST };
        let what = if error.field().is_empty() { "the body: " } else { "" };
        Problem::new(status, format!("{what}{error}"), "GET /api/openapi.json says what is allowed")
    })
}

/// A parameter of the path. A value of the wrong type is answered with 404.
pub(crate) struct Param<T>(pub(crate) T);

impl<S: Send + Sync, T: DeserializeOwned + Send> FromRequestParts<S> for Param<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let read = axum::extract::Path::<T>::from_request_parts(parts, state).await;
        read.map(|axum::extract::Path(value)| Self(value)).map_err(|rejection: PathRejection| {
            Problem::unknown(format!("the path is invalid: {}", wrong_part(&rejection)), "")
        })
    }
}

/// Returns the readable reason why the path's parameters are invalid.
fn wrong_part(rejection: &PathRejection) -> String {
    let PathRejection::FailedToDeserializePathParams(failed) = rejection else {
        return "its parts are missing".to_owned();
    };
    match failed.kind() {
        ErrorKind::ParseErrorAtKey { value, .. }
        | ErrorKind::ParseErrorAtIndex { value, .. }
        | ErrorKind::ParseError { value, .. }
        | ErrorKind::DeserializeError { value, .. } => {
            let shown: String = value.chars().filter(|c| !c.is_control()).take(80).collect();
            format!("a number is needed in place of `{shown}`")
        }
        ErrorKind::InvalidUtf8InPathParam { .. } => "a part of it is not Unicode".to_owned(),
        _ => "its parts are not those of the route".to_owned(),
    }
}
