//! NumPy arrays that are views of the library's memory.
#![allow(unsafe_code, reason = "an array of NumPy borrows the values of a film; see `film_values`")]

use std::sync::Arc;

use bottega::Picture;
use numpy::{PyArray3, PyArrayMethods, ndarray::ArrayView3};
use pyo3::{exceptions::PyValueError, prelude::*};

/// Keeps a picture alive for the arrays that view it.
#[pyclass(name = "PictureKeeper", module = "bottega._native", frozen)]
struct PictureKeeper {
    picture: Arc<Picture>,
}

/// Returns all values of a picture's film, `[height × width × (stride + 1)]`, as a read-only view. The array keeps the picture
/// alive.
///
/// # Errors
/// The film has the wrong number of values, which is a bug.
pub(crate) fn film_values<'py>(py: Python<'py>, picture: &Arc<Picture>) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let keeper = Bound::new(py, PictureKeeper { picture: Arc::clone(picture) })?;
    let film = keeper.get().picture.film();
    let shape = (film.rect().height() as usize, film.rect().width() as usize, film.layout().stride() + 1);
    let view =
        ArrayView3::from_shape(shape, film.values()).map_err(|error| PyValueError::new_err(error.to_string()))?;
    // SAFETY: the array's base is `keeper`, which holds the picture and is frozen, so the picture outlives the array. The
    // picture is shared and a film has no inner mutability, so nothing writes to its values or moves them.
    let array = unsafe { PyArray3::borrow_from_array(&view, keeper.clone().into_any()) };
    array.readwrite().make_nonwriteable();
    Ok(array)
}
