//! A picture while it is rendered: the latest preview, and the layers of the pixels that are painted.

use std::sync::{Mutex, MutexGuard, PoisonError};

use bottega_image::{Film, Rect, Tile};
use numpy::{
    IntoPyArray,
    ndarray::{Array2, Array3},
};
use pyo3::{prelude::*, types::PyDict};

/// The unfinished picture: rendering threads write it, and any thread of Python reads it.
pub(crate) struct LivePicture {
    crop: Rect,
    /// The latest preview: the bytes of a PNG file.
    preview: Mutex<Option<Vec<u8>>>,
    /// The pixels that are painted; `None`: none yet.
    film: Mutex<Option<Film>>,
}

/// Locks a mutex, also after a thread has panicked with it.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl LivePicture {
    /// Makes the state of a picture that has not begun. `crop`: the part that is rendered.
    pub(crate) fn new(crop: Rect) -> Self {
        Self { crop, preview: Mutex::default(), film: Mutex::default() }
    }

    pub(crate) fn previewed(&self, png: Vec<u8>) {
        *locked(&self.preview) = Some(png);
    }

    /// Takes over the pixels of a rectangle.
    pub(crate) fn painted(&self, tile: &Tile) {
        let mut film = locked(&self.film);
        film.get_or_insert_with(|| Film::new(self.crop, tile.layout().clone())).replace_tile(tile);
    }

    /// Returns the latest preview, the bytes of a PNG file; `None`: there is none.
    pub(crate) fn preview(&self) -> Option<Vec<u8>> {
        locked(&self.preview).clone()
    }

    /// Returns copies of all layers by name: float32, (height, width, channels), or (height, width) for one channel; 0 where
    /// nothing is painted. `None`: nothing is painted.
    pub(crate) fn layers<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let film = py.detach(|| locked(&self.film).clone());
        film.map(|film| layers_of(py, &film)).transpose()
    }
}

/// Returns copies of all layers of a film by name: float32, (height, width, channels), or (height, width) for one channel.
pub(crate) fn layers_of<'py>(py: Python<'py>, film: &Film) -> PyResult<Bound<'py, PyDict>> {
    let (height, width) = (film.rect().height() as usize, film.rect().width() as usize);
    let stride = film.layout().stride() + 1;
    let layers = PyDict::new(py);
    for (name, range) in film.layout().parts() {
        let value =
            |y: usize, x: usize, channel: usize| film.values()[(y * width + x) * stride + range.start + channel];
        if range.len() == 1 {
            let layer = Array2::from_shape_fn((height, width), |(y, x)| value(y, x, 0));
            layers.set_item(name, layer.into_pyarray(py))?;
        } else {
            let layer = Array3::from_shape_fn((height, width, range.len()), |(y, x, channel)| value(y, x, channel));
            layers.set_item(name, layer.into_pyarray(py))?;
        }
    }
    Ok(layers)
}
