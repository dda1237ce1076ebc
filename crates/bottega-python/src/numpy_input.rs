//! Arrays of NumPy as slices: checks of kind, dtype, shape and layout. Nothing is copied.

use bottega::{glam::Affine3A, scene::MatrixRows};
use numpy::{
    Element, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods, dtype,
};
use pyo3::prelude::*;

use crate::errors::{self, wrong};

/// An array whose values can be read as they lie in memory.
pub(crate) struct InputArray<'py, T: Element> {
    array: PyReadonlyArrayDyn<'py, T>,
    argument: &'static str,
}

impl<'py, T: Element> InputArray<'py, T> {
    /// Checks that a value is a contiguous array of `T` with any shape.
    pub(crate) fn of_any_shape(argument: &'static str, value: &Bound<'py, PyAny>) -> PyResult<Self> {
        let needed = dtype::<T>(value.py());
        let Ok(array) = value.cast::<PyUntypedArray>() else {
            let kind = value.get_type().name()?;
            let remedy = format!("pass an array: np.asarray(values, np.{needed})");
            return Err(wrong(argument, &format!("it is a {kind}, not an array of NumPy; {remedy}")));
        };
        if !array.dtype().is_equiv_to(&needed) {
            let problem = format!(
                "its dtype is {}, and {needed} is needed; convert it: array.astype(np.{needed})",
                array.dtype()
            );
            return Err(wrong(argument, &problem));
        }
        if !array.is_c_contiguous() {
            let problem = format!(
                "its values are not contiguous (strides {:?}); copy them: np.ascontiguousarray(array)",
                array.strides()
            );
            return Err(wrong(argument, &problem));
        }
        let array = value.cast::<PyArrayDyn<T>>().map_err(|error| wrong(argument, &error.to_string()))?;
        let borrowed = array.try_readonly();
        let array = borrowed.map_err(|_| wrong(argument, "it is being written to; pass it afterwards"))?;
        Ok(Self { array, argument })
    }

    /// Checks that a value is a contiguous array of `T` with `COLUMNS` columns; 1: one dimension.
    pub(crate) fn table(argument: &'static str, value: &Bound<'py, PyAny>, columns: usize) -> PyResult<Self> {
        let this = Self::of_any_shape(argument, value)?;
        let shape = this.array.shape();
        let is_right = if columns == 1 { shape.len() == 1 } else { shape.len() == 2 && shape[1] == columns };
        if is_right {
            return Ok(this);
        }
        let needed = if columns == 1 { "(N,)".to_owned() } else { format!("(N, {columns})") };
        Err(wrong(argument, &format!("its shape is {shape:?}, and {needed} is needed; reshape it")))
    }

    /// Like [`Self::table`], for an argument that may be missing.
    pub(crate) fn maybe(
        argument: &'static str,
        value: Option<&Bound<'py, PyAny>>,
        columns: usize,
    ) -> PyResult<Option<Self>> {
        value.map(|value| Self::table(argument, value, columns)).transpose()
    }

    pub(crate) fn shape(&self) -> &[usize] {
        self.array.shape()
    }

    /// Returns all values, row after row.
    pub(crate) fn values(&self) -> PyResult<&[T]> {
        self.array.as_slice().map_err(|error| wrong(self.argument, &error.to_string()))
    }

    /// Returns the rows of a table.
    pub(crate) fn rows<const COLUMNS: usize>(&self) -> PyResult<&[[T; COLUMNS]]> {
        Ok(self.values()?.as_chunks().0)
    }
}

/// Returns the rows of a table that may be missing.
pub(crate) fn maybe_rows<'a, T: Element, const COLUMNS: usize>(
    table: Option<&'a InputArray<'_, T>>,
) -> PyResult<Option<&'a [[T; COLUMNS]]>> {
    table.map(InputArray::rows).transpose()
}

/// Converts one matrix or several, (4, 4), (3, 4), (N, 4, 4) or (N, 3, 4), of real numbers to transformations.
pub(crate) fn transforms(value: &Bound<'_, PyAny>) -> PyResult<Vec<Affine3A>> {
    const ARGUMENT: &str = "transforms";
    let numpy = value.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (value,))?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if !["f", "i", "u"].contains(&&*kind) {
        let dtype = array.getattr("dtype")?.str()?;
        return Err(wrong(ARGUMENT, &format!("its dtype is {dtype}; real numbers, such as float32, are needed")));
    }
    let array = numpy.call_method1("ascontiguousarray", (array, "float32"))?;
    let array = InputArray::<f32>::of_any_shape(ARGUMENT, &array)?;
    let rows = match *array.shape() {
        [rows, 4] | [_, rows, 4] if rows == 3 || rows == 4 => rows,
        ref shape => {
            let problem = format!("its shape is {shape:?}, and (N, 4, 4) or (N, 3, 4) is needed, or a single matrix");
            return Err(wrong(ARGUMENT, &problem));
        }
    };
    let values: &[[f32; 4]] = array.rows()?;
    let matrices = match rows {
        3 => MatrixRows::Three(values.as_chunks().0),
        _ => MatrixRows::Four(values.as_chunks().0),
    };
    matrices.to_transforms().map_err(|error| errors::edit(&error))
}
