//! Errors of the API as RFC 9457 problems, `application/problem+json`.

use axum::{
    http::{HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use bottega_cluster::Error;
use schemars::JsonSchema;
use serde::Serialize;

use crate::redact::redacted_json;

/// Value of `Retry-After` in answers 429 and 503, in seconds.
const RETRY_SECONDS: u32 = 2;

/// The reason why a request failed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Problem {
    /// The HTTP status code.
    pub status: u16,
    /// The meaning of the status code, such as `Not Found`.
    pub title: String,
    /// The problem of this request.
    pub detail: String,
    /// Advice for the client; missing: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
}

impl Problem {
    /// Makes a problem.
    ///
    /// - `status`: the HTTP status.
    /// - `detail`: the problem of this request.
    /// - `remedy`: advice for the client; empty: none.
    pub fn new(status: StatusCode, detail: impl Into<String>, remedy: impl Into<String>) -> Self {
        let title = status.canonical_reason().unwrap_or_default().to_owned();
        let remedy = Some(remedy.into()).filter(|remedy: &String| !remedy.is_empty());
        Self { status: status.as_u16(), title, detail: detail.into(), remedy }
    }

    /// Makes the problem of a request for something that does not exist (404).
    ///
    /// - `what`: the problem, such as `there is no job 7`.
    /// - `remedy`: advice for the client; empty: none.
    pub fn unknown(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, what, remedy)
    }

    /// Makes the problem of a request that conflicts with the current state (409); parameters as for [`Self::new`].
    pub fn conflict(detail: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::new(StatusCode::CONFLICT, detail, remedy)
    }
}

impl From<Error> for Problem {
    /// Maps usage errors to 422, temporary failures of the farm to 503, and refusals to 409.
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
                // Close the connection of a refused client.
                headers.insert(header::CONNECTION, HeaderValue::from_static("close"));
            }
            _ => {}
        }
        response
    }
}
