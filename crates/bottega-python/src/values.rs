//! Values of JSON as Python has them.

use std::path::PathBuf;

use pyo3::prelude::*;
use serde::Serialize;

/// A value as plain objects of Python: dictionaries, lists, numbers, text.
pub(crate) fn to_python<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    // Nothing of ours fails to serialize: there are no maps with odd keys.
    let text = serde_json::to_string(value).unwrap_or_default();
    py.import("json")?.call_method1("loads", (text,))
}

/// A path, of text or of what `os.fspath` takes.
pub(crate) fn path_of(value: &Bound<'_, PyAny>) -> PyResult<PathBuf> {
    value.py().import("os")?.call_method1("fspath", (value,))?.extract()
}
