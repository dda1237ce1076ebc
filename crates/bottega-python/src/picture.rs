//! The Python class of pictures.

use std::sync::Arc;

use bottega::{Picture, events::ZoneEvent};
use numpy::PyArray3;
use pyo3::{
    exceptions::PyKeyError,
    prelude::*,
    types::{PyBytes, PyDict, PySlice},
};
use serde::Serialize;

use crate::{
    arrays::film_values,
    errors,
    values::{path_of, to_python},
};

/// A rendered picture, complete or partial: arrays by layer, metadata, and the report of its job.
///
/// Arrays are float32, linear light (Rec. 709), row 0 on top. They are read-only views of the picture's memory.
/// `picture.color.copy()` gives a writable copy.
#[pyclass(name = "Picture", module = "bottega", frozen)]
pub(crate) struct PyPicture {
    picture: Arc<Picture>,
}

/// The report of a picture's job.
#[derive(Serialize)]
struct PictureReport {
    is_whole: bool,
    failed_zones: Vec<u32>,
    messages: u64,
    seconds: f64,
    painting_seconds: f64,
    composition_seconds: f64,
    zones: Vec<ZoneEvent>,
}

impl PyPicture {
    pub(crate) fn new(picture: Picture) -> Self {
        Self { picture: Arc::new(picture) }
    }
}

#[pymethods]
impl PyPicture {
    /// The names of the layers, such as `("color", "alpha", "error", "samples", "albedo")`.
    #[getter]
    fn layers(&self) -> Vec<String> {
        self.picture.film().layout().parts().into_iter().map(|(name, _)| name.to_owned()).collect()
    }

    /// Returns a layer by its name: float32, (height, width, channels), or (height, width) if it has one channel. A read-only
    /// view.
    fn __getitem__<'py>(slf: &Bound<'py, Self>, layer: &str) -> PyResult<Bound<'py, PyAny>> {
        let parts = slf.get().picture.film().layout().parts();
        let Some((_, range)) = parts.iter().find(|(name, _)| *name == layer) else {
            let names: Vec<&str> = parts.iter().map(|(name, _)| *name).collect();
            return Err(PyKeyError::new_err(format!("no layer `{layer}`; the picture has {}", names.join(", "))));
        };
        let py = slf.py();
        let all = film_values(py, &slf.get().picture)?;
        if range.len() == 1 {
            return all.get_item((py.Ellipsis(), range.start));
        }
        let slice = PySlice::new(py, range.start as isize, range.end as isize, 1);
        all.get_item((py.Ellipsis(), slice))
    }

    fn __contains__(&self, layer: &str) -> bool {
        self.picture.film().layout().parts().iter().any(|(name, _)| *name == layer)
    }

    /// Radiance R G B: float32, (height, width, 3), linear light. A read-only view.
    #[getter]
    fn color<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        Self::__getitem__(slf, "color")
    }

    /// All values of each pixel, layer after layer, and last its weight: float32, (height, width, values). A read-only view.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        film_values(py, &self.picture)
    }

    /// Rows and columns of the rendered part.
    #[getter]
    fn shape(&self) -> (u32, u32) {
        let rect = self.picture.film().rect();
        (rect.height(), rect.width())
    }

    /// The rendered part of the whole picture: x0, y0, x1, y1; x1 and y1 are one past it.
    #[getter]
    fn crop(&self) -> (u32, u32, u32, u32) {
        let rect = self.picture.film().rect();
        (rect.x0, rect.y0, rect.x1, rect.y1)
    }

    /// True if all zones are painted: rendering was not stopped, and no zone has failed.
    #[getter]
    fn is_whole(&self) -> bool {
        self.picture.is_whole()
    }

    /// Metadata of the picture, as in its files: text by name.
    #[getter]
    fn metadata<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        self.picture.metadata().iter().try_for_each(|(name, text)| all.set_item(name, text))?;
        Ok(all)
    }

    /// The report of the job: `zones` (a row of the Blackboard each), `seconds`, `painting_seconds` (summed over all
    /// processors), `composition_seconds`, `messages`, `failed_zones`, `is_whole`.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let report = self.picture.report();
        let values = PictureReport {
            is_whole: self.picture.is_whole(),
            failed_zones: report.failed.iter().map(|zone| zone.0).collect(),
            messages: report.messages,
            seconds: report.times.total.as_secs_f64(),
            painting_seconds: report.times.painting.as_secs_f64(),
            composition_seconds: report.times.composition.as_secs_f64(),
            zones: report.rows.iter().map(ZoneEvent::from).collect(),
        };
        to_python(py, &values)
    }

    /// The request of the picture, as a `Request`.
    #[getter]
    fn request<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = self.picture.request().to_line().map_err(|error| errors::raised_by_request(&error))?;
        py.import("bottega._requests")?.getattr("Request")?.call_method1("from_json", (text,))
    }

    /// Writes the picture to a file, .exr (linear light, all layers) or .png (tone-mapped), with the `output` settings of its
    /// request.
    ///
    /// Raises `PictureError` if it cannot be written.
    fn save(&self, py: Python<'_>, path: &Bound<'_, PyAny>) -> PyResult<()> {
        let path = path_of(path)?;
        py.detach(|| self.picture.save(path)).map_err(|error| errors::raised(&error))
    }

    /// Returns the picture as the bytes of a PNG file, as notebooks show it.
    fn to_png<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| self.picture.to_png()).map_err(|error| errors::raised(&error))?;
        Ok(PyBytes::new(py, &bytes))
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        self.to_png(py)
    }

    /// Returns the color, for `numpy.asarray(picture)`.
    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        slf: &Bound<'py, Self>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut color = Self::color(slf)?;
        if let Some(dtype) = dtype {
            let is_other = color.getattr("dtype")?.ne(slf.py().import("numpy")?.call_method1("dtype", (dtype,))?)?;
            if is_other {
                return color.call_method1("astype", (dtype,));
            }
        }
        if copy == Some(true) {
            color = color.call_method0("copy")?;
        }
        Ok(color)
    }

    fn __repr__(&self) -> String {
        let (height, width) = self.shape();
        let state = if self.is_whole() { "" } else { ", not whole" };
        format!("<bottega.Picture {width}x{height}, layers {}{state}>", self.layers().join(" "))
    }
}
