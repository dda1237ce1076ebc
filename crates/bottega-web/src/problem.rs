//! Problems as clients are told: RFC 9457, `application/problem+json`.

use axum::{
    http::{HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use bottega_cluster::Error;
use schemars::JsonSchema;
use serde::Serialize;

use crate::redact::redacted_json;

/// After how many seconds one may try again whom the door turned away for its own sake.
const RETRY_SECONDS: u32 = 2;

/// Why a request was not answered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Problem {
    /// The HTTP status.
    pub status: u16,
    /// What the status means.
    pub title: String,
    /// What went wrong this time.
    pub detail: String,
    /// What can be done about it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
}

impl Problem {
    /// A problem with its remedy; an empty one is none.
    pub fn new(status: StatusCode, detail: impl Into<String>, remedy: impl Into<String>) -> Self {
        let title = status.canonical_reason().unwrap_or_default().to_owned();
        let remedy = Some(remedy.into()).filter(|remedy: &String| !remedy.is_empty());
        Self { status: status.as_u16(), title, detail: detail.into(), remedy }
    }

    /// There is no such thing.
    pub fn unknown(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, what, remedy)
    }

    /// What is asked for cannot be now.
    pub fn conflict(detail: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::new(StatusCode::CONFLICT, detail, remedy)
    }
}

impl From<Error> for Problem {
    /// What was asked wrongly is 422, what the farm does not do now 503, and what it refuses 409.
    fn from(error: Error) -> Self {
        let status = match &error {
            error if error.is_usage() => StatusCode::UNPROCESSABLE_ENTITY,
            error if error.may_pass() => StatusCode::SERVICE_UNAVAILABLE,
            _ => StatusCode::CONFLICT,
        };
        let remedy = match &error {
            Error::Bottega(bottega::Error::Request { .. }) => {
                Some("GET /api/schema/request says what a request may hold".to_owned())
            }
            error => error.remedy(),
        };
        Self::new(status, error.error_chain(), remedy.unwrap_or_default())
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let headers = [(header::CONTENT_TYPE, "application/problem+json"), (header::CACHE_CONTROL, "no-store")];
        let mut response = (status, headers, redacted_json(&self)).into_response();
        let headers = response.headers_mut();
        match status {
            StatusCode::UNAUTHORIZED => {
                headers.insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer realm=\"bottega\""));
            }
            StatusCode::SERVICE_UNAVAILABLE | StatusCode::TOO_MANY_REQUESTS => {
                headers.insert(header::RETRY_AFTER, HeaderValue::from(RETRY_SECONDS));
                // One who is turned away holds no connection.
                headers.insert(header::CONNECTION, HeaderValue::from_static("close"));
            }
            _ => {}
        }
        response
    }
}
