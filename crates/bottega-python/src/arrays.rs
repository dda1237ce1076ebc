//! Arrays of NumPy that look into memory of ours.
#![allow(unsafe_code, reason = "an array of NumPy borrows the values of a film; see `film_values`")]

use bottega::Picture;
use numpy::{
    PyArray3, PyArrayMethods,
    ndarray::{ArrayView3, ShapeError},
};
use pyo3::{exceptions::PyValueError, prelude::*};

use crate::picture::PyPicture;

/// All values of a picture's film, `[height × width × (stride + 1)]`, without a copy and read-only. The array keeps the picture alive.
///
/// # Errors
/// The film is not of its own size, which is a bug.
pub(crate) fn film_values<'py>(owner: &Bound<'py, PyPicture>) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let view = view_of(owner.get().picture()).map_err(|error| PyValueError::new_err(error.to_string()))?;
    // SAFETY: the array's base is `owner`, so the picture outlives the array. `PyPicture` is frozen and gives out no `&mut Picture`, so
    // nothing writes to the film's values or moves them while `owner` lives.
    let array = unsafe { PyArray3::borrow_from_array(&view, owner.clone().into_any()) };
    array.readwrite().make_nonwriteable();
    Ok(array)
}

fn view_of(picture: &Picture) -> Result<ArrayView3<'_, f32>, ShapeError> {
    let film = picture.film();
    let (rect, stride) = (film.rect(), film.layout().stride() + 1);
    ArrayView3::from_shape((rect.height() as usize, rect.width() as usize, stride), film.values())
}
