//! Pictures read from files.

use std::path::PathBuf;

use bottega::{Error, request::PIXELS_MAX};
use bottega_image::{FileLayer, ImageError, LayerPlanes, Picture, ReadLimits, read_channels, read_image};
use numpy::{
    IntoPyArray, PyArray3, PyArrayMethods,
    ndarray::{Array2, Array3},
};
use pyo3::{
    exceptions::{PyKeyError, PyValueError},
    prelude::*,
    types::PyDict,
};

use crate::{errors, values::path_of};

/// A picture read from a file: its color and metadata, and the layers of an OpenEXR file by name.
#[pyclass(name = "ImageFile", module = "bottega", frozen)]
pub(crate) struct PyImageFile {
    path: PathBuf,
    /// Radiance R G B: float32, (height, width, 3), linear light.
    #[pyo3(get)]
    color: Py<PyArray3<f32>>,
    /// Metadata of the file: text by name.
    #[pyo3(get)]
    metadata: Py<PyDict>,
    /// Position of the upper left pixel in the whole picture: x, y; (0, 0) unless the file is a crop.
    #[pyo3(get)]
    offset: (i32, i32),
    /// Width and height of the whole picture.
    #[pyo3(get)]
    full_size: (u32, u32),
}

/// Name of the layer that is the channel A of the file.
const ALPHA: &str = "alpha";

#[pymethods]
impl PyImageFile {
    /// The names of the layers, such as `("color", "alpha", "depth")`.
    #[getter]
    fn layers(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let names = py.detach(|| {
            let bytes = self.bytes()?;
            let others = FileLayer::all(&self.path, &bytes)?.into_iter().map(|layer| layer.name);
            let has_alpha = self.layer(ALPHA)?.is_some();
            Ok(["color"].into_iter().chain(has_alpha.then_some(ALPHA)).map(str::to_owned).chain(others).collect())
        });
        names.map_err(|error: ImageError| errors::raised(&Error::from(error)))
    }

    /// Reads a layer by its name: float32, (height, width, channels), or (height, width) if it has one channel.
    ///
    /// Raises `KeyError` if the file has no such layer, `PictureError` if it cannot be read any more.
    fn __getitem__<'py>(&self, py: Python<'py>, layer: &str) -> PyResult<Bound<'py, PyAny>> {
        if layer == "color" {
            return Ok(self.color.bind(py).clone().into_any());
        }
        let read = py.detach(|| self.layer(layer)).map_err(|error| errors::raised(&Error::from(error)))?;
        match read {
            Some(LayerPlanes { planes, size: [width, height] }) => {
                let [rows, columns, channels] = [height as usize, width as usize, planes.len()];
                let values =
                    (0..rows * columns).flat_map(|pixel| planes.iter().map(move |plane| plane[pixel])).collect();
                if channels == 1 {
                    let array = Array2::from_shape_vec((rows, columns), values);
                    return Ok(array
                        .map_err(|error| PyValueError::new_err(error.to_string()))?
                        .into_pyarray(py)
                        .into_any());
                }
                let array = Array3::from_shape_vec((rows, columns, channels), values);
                Ok(array.map_err(|error| PyValueError::new_err(error.to_string()))?.into_pyarray(py).into_any())
            }
            None => {
                let names = self.layers(py)?.join(", ");
                Err(PyKeyError::new_err(format!("no layer `{layer}`; the file has {names}")))
            }
        }
    }

    fn __contains__(&self, py: Python<'_>, layer: &str) -> PyResult<bool> {
        Ok(self.layers(py)?.iter().any(|name| name == layer))
    }
}

impl PyImageFile {
    fn bytes(&self) -> Result<Vec<u8>, ImageError> {
        std::fs::read(&self.path).map_err(|source| ImageError::Read { path: self.path.clone(), source })
    }

    /// Reads the channels of a layer beside the color; `None`: the file has no such layer.
    fn layer(&self, name: &str) -> Result<Option<LayerPlanes>, ImageError> {
        if name == ALPHA {
            let (file, mut planes) = read_channels(&self.path, LIMITS, &["A".to_owned()])?;
            let (width, height) = file.picture.size();
            return Ok(planes.pop().flatten().map(|plane| LayerPlanes { planes: vec![plane], size: [width, height] }));
        }
        let bytes = self.bytes()?;
        let layer = FileLayer::all(&self.path, &bytes)?.into_iter().find(|layer| layer.name == name);
        layer.map(|layer| layer.read_planes(&self.path, &bytes)).transpose()
    }
}

/// The greatest picture that is read.
const LIMITS: ReadLimits = ReadLimits { max_pixels: PIXELS_MAX };

/// Reads the color of a picture: .exr, .png or .hdr. PNG values are converted to linear light.
///
/// Raises `PictureError` if the file cannot be read.
#[pyfunction]
pub(crate) fn read(py: Python<'_>, path: &Bound<'_, PyAny>) -> PyResult<PyImageFile> {
    let path = path_of(path)?;
    let file = py.detach(|| read_image(&path, LIMITS)).map_err(|error| errors::raised(&Error::from(error)))?;
    let metadata = PyDict::new(py);
    file.metadata.iter().try_for_each(|(name, text)| metadata.set_item(name, text))?;
    let (offset, full_size) = (file.offset, file.full_size);
    Ok(PyImageFile {
        path,
        color: array_of(py, file.picture)?.unbind(),
        metadata: metadata.unbind(),
        offset,
        full_size,
    })
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

/// Decodes a PNG file of 8-bit RGB.
pub(crate) fn decoded(file: &[u8]) -> Result<Array3<u8>, String> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().map_err(|error| error.to_string())?;
    let mut pixels = vec![0; reader.output_buffer_size().unwrap_or_default()];
    let frame = reader.next_frame(&mut pixels).map_err(|error| error.to_string())?;
    let shape = (frame.height as usize, frame.width as usize, 3);
    Array3::from_shape_vec(shape, pixels).map_err(|error| error.to_string())
}
