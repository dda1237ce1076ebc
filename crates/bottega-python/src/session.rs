//! The Python class of sessions.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bottega::{Error, Picture, Request, Session, SessionOptions, StopSwitch, scene::Loaded};
use numpy::{IntoPyArray, PyArray3, ndarray::Array3};
use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{PyBytes, PyDict},
};

use crate::{
    errors,
    live::LivePicture,
    picture::PyPicture,
    process::refuse_forked,
    request::request_of,
    scene::PyScene,
    values::path_of,
    waiting::{Caller, Ending},
};

/// The stage of a session.
enum Stage {
    Open(Box<Session>),
    /// Rendering has begun, and may have ended.
    Used,
}

/// A session: a loaded scene with its request checked, to be rendered once.
#[pyclass(name = "Session", module = "bottega._native", frozen)]
pub(crate) struct PySession {
    stage: Mutex<Stage>,
    stop: StopSwitch,
    /// The picture meanwhile; `None`: nobody asks for it.
    live: Option<Arc<LivePicture>>,
}

/// Opens a session of the library, for a scene in memory if one is given.
fn open(request: &Request, scene: Option<Loaded>, options: SessionOptions) -> Result<Session, Error> {
    match scene {
        None => Session::open_with(request, options),
        Some(scene) => Session::of_scene_with(request, scene, options),
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[pymethods]
impl PySession {
    #[new]
    #[pyo3(signature = (request, scene=None, *, live=false, resume=false, preview=None, record=None, timeline=None))]
    fn new(
        py: Python<'_>,
        request: &str,
        scene: Option<&Bound<'_, PyScene>>,
        live: bool,
        resume: bool,
        preview: Option<&Bound<'_, PyAny>>,
        record: Option<&Bound<'_, PyAny>>,
        timeline: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        refuse_forked()?;
        let request = request_of(request)?;
        let preview = preview.map(path_of).transpose()?;
        let record = record.map(path_of).transpose()?;
        let timeline = timeline.map(path_of).transpose()?;
        let options = SessionOptions { resume, preview, shows: live, record, timeline, ..SessionOptions::default() };
        let scene = scene.map(|scene| scene.get().finished()).transpose()?;
        let opened = Caller::new(py).wait_for(move |_, _| open(&request, scene, options))?.whole()?;
        let session = opened.map_err(|error| errors::raised(&error))?;
        let live = live.then(|| Arc::new(LivePicture::new(session.settings().crop)));
        Ok(Self { stage: Mutex::new(Stage::Open(Box::new(session))), stop: StopSwitch::new(), live })
    }

    /// Renders the picture and waits for it.
    #[pyo3(signature = (on_event=None, warn_level=2))]
    fn render(&self, py: Python<'_>, on_event: Option<Bound<'_, PyAny>>, warn_level: u8) -> PyResult<PyPicture> {
        refuse_forked()?;
        let Stage::Open(session) = std::mem::replace(&mut *locked(&self.stage), Stage::Used) else {
            return Err(errors::failed("a session paints its picture once", "open another: bottega.Session(request)"));
        };
        let stop = self.stop.clone();
        let caller = Caller { py, on_event, stop, live: self.live.clone(), warn_level, waits_for_end: true };
        let ending = caller.wait_for(move |watcher, stop| session.render(watcher, stop))?;
        ended(py, ending)
    }

    /// Requests that rendering stops.
    fn stop(&self) {
        self.stop.request();
    }

    /// Returns the latest preview as the bytes of a PNG file; `None`: there is none.
    fn preview_png<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        self.live.as_ref()?.preview().map(|bytes| PyBytes::new(py, &bytes))
    }

    /// Returns copies of the layers painted so far, by name; `None`: nothing is painted.
    fn layers<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        self.live.as_ref().map_or(Ok(None), |live| live.layers(py))
    }

    /// Returns the latest preview: uint8, (height, width, 3), sRGB; `None`: there is none.
    fn preview<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<u8>>>> {
        let Some(png) = self.live.as_ref().and_then(|live| live.preview()) else { return Ok(None) };
        let array = py.detach(|| decoded(&png)).map_err(PyValueError::new_err)?;
        Ok(Some(array.into_pyarray(py)))
    }
}

/// Returns the picture, or its exception; after Ctrl-C, an exception with the picture painted so far.
pub(crate) fn ended(py: Python<'_>, ending: Ending<Result<Picture, Error>>) -> PyResult<PyPicture> {
    match ending {
        Ending::Whole(picture) => picture.map(PyPicture::new).map_err(|error| errors::raised(&error)),
        Ending::Interrupted(picture) => {
            let picture = picture.ok().map(|picture| Py::new(py, PyPicture::new(picture))).transpose()?;
            Err(errors::interrupted(picture.map(Py::into_any)))
        }
    }
}

/// Decodes a PNG file of 8-bit RGB.
fn decoded(file: &[u8]) -> Result<Array3<u8>, String> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().map_err(|error| error.to_string())?;
    let mut pixels = vec![0; reader.output_buffer_size().unwrap_or_default()];
    let frame = reader.next_frame(&mut pixels).map_err(|error| error.to_string())?;
    let shape = (frame.height as usize, frame.width as usize, 3);
    Array3::from_shape_vec(shape, pixels).map_err(|error| error.to_string())
}
