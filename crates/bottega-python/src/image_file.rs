//! Pictures read from files.

use bottega::{Error, request::PIXELS_MAX};
use bottega_image::{Picture, ReadLimits, read_image};
use numpy::{IntoPyArray, PyArray3, PyArrayMethods, ndarray::Array3};
use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};

use crate::{errors, values::path_of};

/// A picture read from a file: its color and metadata.
#[pyclass(name = "ImageFile", module = "bottega", frozen, get_all)]
pub(crate) struct PyImageFile {
    /// Radiance R G B: float32, (height, width, 3), linear light.
    color: Py<PyArray3<f32>>,
    /// Metadata of the file: text by name.
    metadata: Py<PyDict>,
    /// Position of the upper left pixel in the whole picture: x, y; (0, 0) unless the file is a crop.
    offset: (i32, i32),
    /// Width and height of the whole picture.
    full_size: (u32, u32),
}

/// Reads the color of a picture: .exr, .png or .hdr. PNG values are converted to linear light.
///
/// Raises `PictureError` if the file cannot be read.
#[pyfunction]
pub(crate) fn read(py: Python<'_>, path: &Bound<'_, PyAny>) -> PyResult<PyImageFile> {
    let path = path_of(path)?;
    let limits = ReadLimits { max_pixels: PIXELS_MAX };
    let file = py.detach(|| read_image(path, limits)).map_err(|error| errors::raised(&Error::from(error)))?;
    let metadata = PyDict::new(py);
    file.metadata.iter().try_for_each(|(name, text)| metadata.set_item(name, text))?;
    let (offset, full_size) = (file.offset, file.full_size);
    Ok(PyImageFile { color: array_of(py, file.picture)?.unbind(), metadata: metadata.unbind(), offset, full_size })
}

/// Returns the pixels of a picture as an array, (height, width, 3), without a copy.
pub(crate) fn array_of(py: Python<'_>, picture: Picture) -> PyResult<Bound<'_, PyArray3<f32>>> {
    let (width, height) = picture.size();
    let array = Array3::from_shape_vec((height as usize, width as usize, 3), picture.data.into_flattened());
    Ok(array.map_err(|error| PyValueError::new_err(error.to_string()))?.into_pyarray(py))
}

/// Converts an array, (height, width, 3), or a value that `numpy.asarray` accepts, to a picture.
pub(crate) fn picture_of(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Picture> {
    let numpy = value.py().import("numpy")?;
    let array = numpy.call_method1("ascontiguousarray", (value, "float32"))?;
    let array = array.cast_into::<PyArray3<f32>>().map_err(|_| {
        PyValueError::new_err(format!("`{argument}`: an array of shape (height, width, 3) is needed, or a file"))
    })?;
    let array = array.readonly();
    let view = array.as_array();
    let (height, width, channels) = view.dim();
    let sides = [width, height].map(|side| u32::try_from(side).ok());
    let ([Some(width), Some(height)], 3) = (sides, channels) else {
        let problem =
            format!("`{argument}`: its shape is ({height}, {width}, {channels}), and (height, width, 3) is needed");
        return Err(PyValueError::new_err(problem));
    };
    let data = view.rows().into_iter().map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    Ok(Picture { width, height, data })
}
