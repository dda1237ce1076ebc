//! Conversions of values between Rust and Python.

use std::path::PathBuf;

use pyo3::prelude::*;
use serde::Serialize;

/// Converts a value to plain Python objects: dictionaries, lists, numbers, strings.
pub(crate) fn to_python<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    // Values of the library cannot fail to serialize: they have no maps with non-string keys.
    let text = serde_json::to_string(value).unwrap_or_default();
    py.import("json")?.call_method1("loads", (text,))
}

/// Converts a string or a path-like object to a path.
pub(crate) fn path_of(value: &Bound<'_, PyAny>) -> PyResult<PathBuf> {
    value.py().import("os")?.call_method1("fspath", (value,))?.extract()
}
