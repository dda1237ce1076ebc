//! The Python functions for requests as JSON.

use bottega::Request;
use pyo3::prelude::*;

use crate::errors;

/// Reads a request from a JSON text.
pub(crate) fn request_of(json: &str) -> PyResult<Request> {
    Request::from_json(json.as_bytes()).map_err(|error| errors::raised_by_request(&error))
}

/// Reads a request from a JSON text and checks it. Returns it with all defaults, as one line.
///
/// Raises `RequestError`, whose `field` is the path of the wrong field.
#[pyfunction]
pub(crate) fn check_request(json: &str) -> PyResult<String> {
    request_of(json)?.to_line().map_err(|error| errors::raised_by_request(&error))
}

/// Returns the JSON Schema of requests.
#[pyfunction]
pub(crate) fn schema() -> String {
    serde_json::to_string(&Request::schema()).unwrap_or_default()
}
