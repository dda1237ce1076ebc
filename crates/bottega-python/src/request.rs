//! Requests as JSON.

use bottega::Request;
use pyo3::prelude::*;

use crate::errors;

/// The request of a JSON text.
pub(crate) fn request_of(json: &str) -> PyResult<Request> {
    Request::from_json(json.as_bytes()).map_err(|error| errors::raised_by_request(&error))
}

/// Reads a request of a JSON text and checks it. Returns it with every default, as one line.
///
/// Raises `RequestError`, which names the field.
#[pyfunction]
pub(crate) fn check_request(json: &str) -> PyResult<String> {
    request_of(json)?.to_line().map_err(|error| errors::raised_by_request(&error))
}

/// The JSON Schema of requests.
#[pyfunction]
pub(crate) fn schema() -> String {
    serde_json::to_string(&Request::schema()).unwrap_or_default()
}
