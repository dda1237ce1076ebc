//! Pictures.

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

/// A picture that is painted, whole or as far as it was: arrays by layer, and what is known of how it was made.
///
/// Arrays are float32, of linear light (Rec. 709), row 0 on top. They look into the picture's memory: nothing is copied, and nothing can
/// be written. `picture.color.copy()` gives an array of your own.
#[pyclass(name = "Picture", module = "bottega", frozen)]
pub(crate) struct PyPicture {
    picture: Arc<Picture>,
}

/// How the agents painted a picture.
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

    /// A layer by its name: float32, (height, width, channels), or (height, width) where it has one channel. A look into the picture,
    /// read-only.
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

    /// Radiance R G B: float32, (height, width, 3), linear light. A look into the picture, read-only.
    #[getter]
    fn color<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        Self::__getitem__(slf, "color")
    }

    /// All that a pixel holds, layer after layer, and last its weight: float32, (height, width, values). A look into the picture,
    /// read-only.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        film_values(py, &self.picture)
    }

    /// Rows and columns: those of the part that was painted.
    #[getter]
    fn shape(&self) -> (u32, u32) {
        let rect = self.picture.film().rect();
        (rect.height(), rect.width())
    }

    /// The part of the whole picture that was painted: x0, y0, x1, y1; x1 and y1 are one past it.
    #[getter]
    fn crop(&self) -> (u32, u32, u32, u32) {
        let rect = self.picture.film().rect();
        (rect.x0, rect.y0, rect.x1, rect.y1)
    }

    /// Whether all of it is painted: it was not stopped, and no zone has failed.
    #[getter]
    fn is_whole(&self) -> bool {
        self.picture.is_whole()
    }

    /// What the picture says of how it was made, as its files do: text by name.
    #[getter]
    fn metadata<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        self.picture.metadata().iter().try_for_each(|(name, text)| all.set_item(name, text))?;
        Ok(all)
    }

    /// How the agents painted it: `zones` (a row of the Blackboard each), `seconds`, `painting_seconds` (all processors together),
    /// `composition_seconds`, `messages`, `failed_zones`, `is_whole`.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let report = self.picture.report();
        let told = PictureReport {
            is_whole: self.picture.is_whole(),
            failed_zones: report.failed.iter().map(|zone| zone.0).collect(),
            messages: report.messages,
            seconds: report.times.total.as_secs_f64(),
            painting_seconds: report.times.painting.as_secs_f64(),
            composition_seconds: report.times.composition.as_secs_f64(),
            zones: report.rows.iter().map(ZoneEvent::from).collect(),
        };
        to_python(py, &told)
    }

    /// The request that it is of, as a `Request`.
    #[getter]
    fn request<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = self.picture.request().to_line().map_err(|error| errors::raised_by_request(&error))?;
        py.import("bottega._requests")?.getattr("Request")?.call_method1("from_json", (text,))
    }

    /// Writes it to a file, .exr (linear light, all layers) or .png (tone-mapped), with the `output` settings of its request.
    ///
    /// Raises `PictureError` where it cannot be written.
    fn save(&self, py: Python<'_>, path: &Bound<'_, PyAny>) -> PyResult<()> {
        let path = path_of(path)?;
        py.detach(|| self.picture.save(path)).map_err(|error| errors::raised(&error))
    }

    /// The bytes of a PNG file of it: what a notebook shows.
    fn to_png<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| self.picture.to_png()).map_err(|error| errors::raised(&error))?;
        Ok(PyBytes::new(py, &bytes))
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        self.to_png(py)
    }

    /// The color, for `numpy.asarray(picture)`.
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
