//! Measured materials of files, for surfaces.

use std::{path::PathBuf, sync::Arc};

use bottega::{
    Error,
    scene::{LoadOptions, Measured, Surface},
};
use pyo3::prelude::*;

use crate::errors::{failed, raised};

/// The tables of a measured material (`.bsdf`). Surfaces share it.
#[pyclass(name = "MeasuredFile", module = "bottega", frozen, eq)]
#[derive(PartialEq)]
pub(crate) struct PyMeasuredFile {
    measured: Arc<Measured>,
}

#[pymethods]
impl PyMeasuredFile {
    /// Reads a file.
    #[new]
    #[expect(clippy::needless_pass_by_value, reason = "Python's paths come as values")]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let limit = LoadOptions::default().max_memory_bytes;
        let read = py.detach(|| Measured::read(&path, limit));
        Ok(Self { measured: Arc::new(read.map_err(|error| raised(&Error::from(error)))?) })
    }

    /// Makes it from the JSON text of a measured surface.
    #[staticmethod]
    fn of_json(json: &str) -> PyResult<Self> {
        match serde_json::from_str(json) {
            Ok(Surface::Measured(measured)) => Ok(Self { measured }),
            _ => Err(failed("the text is not a measured surface", "take it from `MeasuredFile.json`")),
        }
    }

    /// Returns a surface with its tables as JSON text.
    fn json(&self) -> PyResult<String> {
        let surface = Surface::Measured(Arc::clone(&self.measured));
        serde_json::to_string(&surface).map_err(|error| failed(&error.to_string(), "read the file again"))
    }

    /// The name of the file.
    #[getter]
    fn name(&self) -> &str {
        &self.measured.name
    }

    fn __repr__(&self) -> String {
        format!("<bottega.MeasuredFile {:?}>", self.measured.name)
    }
}
