//! Photometric profiles of lamps.

use std::path::{Path, PathBuf};

use bottega::{
    Error,
    scene::{IesInterpolation, IesProfile, SceneError},
};
use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::errors::{raised, wrong};

/// The luminous intensity of a lamp by direction, from a file of IES LM-63.
#[pyclass(name = "IesProfile", module = "bottega", frozen)]
pub(crate) struct PyIesProfile {
    profile: IesProfile,
}

#[pymethods]
impl PyIesProfile {
    /// Reads a file.
    #[new]
    #[expect(clippy::needless_pass_by_value, reason = "Python's paths come as values")]
    fn new(path: PathBuf) -> PyResult<Self> {
        IesProfile::read(&path).map(|profile| Self { profile }).map_err(scene_error)
    }

    /// Reads the text of a file. `name`: names it in errors.
    #[staticmethod]
    #[pyo3(signature = (text, name = "text"))]
    fn of_text(text: &str, name: &str) -> PyResult<Self> {
        let read = IesProfile::of_bytes(text.as_bytes(), Path::new(name));
        read.map(|profile| Self { profile }).map_err(scene_error)
    }

    /// Luminous flux in lumens: the integral of the intensity over all directions.
    #[getter]
    fn lumens(&self) -> f64 {
        self.profile.lumens()
    }

    /// Greatest intensity in candela.
    #[getter]
    fn peak(&self) -> f64 {
        self.profile.peak()
    }

    /// Returns the intensity of a direction in candela. `vertical`: degrees from straight down; `horizontal`: degrees around.
    fn candela(&self, vertical: f64, horizontal: f64) -> f64 {
        self.profile.candela(vertical, horizontal)
    }

    /// Returns the intensity over its peak as an image of directions, (height, width). `interpolation`: `linear`, or `cubic` as
    /// in Blender.
    #[pyo3(signature = (interpolation = "linear"))]
    fn pixels<'py>(&self, py: Python<'py>, interpolation: &str) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let interpolation = match interpolation {
            "linear" => IesInterpolation::Linear,
            "cubic" => IesInterpolation::Cubic,
            other => return Err(wrong("interpolation", &format!("it is {other:?}; 'linear' or 'cubic' is needed"))),
        };
        let picture = self.profile.picture(interpolation);
        let shape = [picture.height as usize, picture.width as usize];
        picture.values.into_pyarray(py).reshape(shape)
    }

    fn __repr__(&self) -> String {
        format!("<bottega.IesProfile {:.0} lm, {:.0} cd>", self.profile.lumens(), self.profile.peak())
    }
}

fn scene_error(error: SceneError) -> PyErr {
    raised(&Error::from(error))
}
