//! The difference of two pictures.

use bottega::difference::Difference;
use numpy::{IntoPyArray, ndarray::Array2};
use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};

use crate::{errors, image_file::picture_of, values::to_python};

/// Compares two pictures, as `bottega diff` does.
///
/// - `picture`, `reference`: arrays of linear light, (height, width, 3), or values that `numpy.asarray` converts to such.
///
/// Returns a dictionary: `rmse`, `mae`, `rel_mse`, `rel_mse_trimmed`, `flip`, `flip_visible_share`, `mean_ratio`, and `flip_map`, float32,
/// (height, width).
#[pyfunction]
pub(crate) fn diff<'py>(
    py: Python<'py>,
    picture: &Bound<'py, PyAny>,
    reference: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let (picture, reference) = (picture_of("picture", picture)?, picture_of("reference", reference)?);
    let (width, height) = picture.size();
    let mut difference = py
        .detach(|| Difference::between(&picture, &reference))
        .map_err(|error| PyValueError::new_err(errors::text(&error)))?;
    let map = std::mem::take(&mut difference.flip_map);
    let map = Array2::from_shape_vec((height as usize, width as usize), map);
    let measures = to_python(py, &difference)?.cast_into::<PyDict>()?;
    measures.set_item("flip_map", map.map_err(|error| PyValueError::new_err(error.to_string()))?.into_pyarray(py))?;
    Ok(measures)
}
