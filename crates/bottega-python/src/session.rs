//! The Python class of sessions.

use std::{
    path::PathBuf,
    sync::{Arc, Mutex},
};

use bottega::{Error, Picture, Request, Session, SessionOptions, StopSwitch, scene::Loaded};
use bottega_cluster::client::{FarmPicture, RenderOutcome};
use numpy::{IntoPyArray, PyArray3};
use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{PyBytes, PyDict},
};

use crate::{
    errors,
    farm::{FarmLogin, PyFarm},
    image_file::decoded,
    live::{LivePicture, locked},
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
    /// A picture to be rendered with a farm.
    WithFarm(Box<(FarmPicture, FarmLogin)>),
    /// Rendering has begun, and may have ended.
    Used,
}

/// A session: a loaded scene with its request checked, to be rendered once.
#[pyclass(name = "Session", module = "bottega._native", frozen)]
pub(crate) struct PySession {
    stage: Mutex<Stage>,
    stop: StopSwitch,
    /// The picture meanwhile; `None`: no caller reads it.
    live: Option<Arc<LivePicture>>,
}

/// Opens a session of the library, for a scene in memory if one is given.
fn open(request: &Request, scene: Option<Loaded>, options: SessionOptions) -> Result<Session, Error> {
    match scene {
        None => Session::open_with(request, options),
        Some(scene) => Session::of_scene_with(request, scene, options),
    }
}

#[pymethods]
impl PySession {
    #[new]
    #[pyo3(signature = (
        request, scene=None, *, farm=None, live=false, resume=false, preview=None, record=None, timeline=None
    ))]
    fn new(
        py: Python<'_>,
        request: &str,
        scene: Option<&Bound<'_, PyScene>>,
        farm: Option<&Bound<'_, PyFarm>>,
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
        let (stage, crop) = if let Some(farm) = farm {
            let opened = Caller::new(py).wait_for(move |_, _| FarmPicture::open(&request, options))?.whole()?;
            let picture = opened.map_err(|error| errors::raised_by_farm(&error))?;
            let crop = picture.crop();
            (Stage::WithFarm(Box::new((picture, farm.get().login()))), crop)
        } else {
            let opened = Caller::new(py).wait_for(move |_, _| open(&request, scene, options))?.whole()?;
            let session = opened.map_err(|error| errors::raised(&error))?;
            let crop = session.settings().crop;
            (Stage::Open(Box::new(session)), crop)
        };
        let live = live.then(|| Arc::new(LivePicture::new(crop)));
        Ok(Self { stage: Mutex::new(stage), stop: StopSwitch::new(), live })
    }

    /// Renders the picture and waits for it.
    #[pyo3(signature = (on_event=None, warn_level=2))]
    fn render(&self, py: Python<'_>, on_event: Option<Bound<'_, PyAny>>, warn_level: u8) -> PyResult<PyPicture> {
        refuse_forked()?;
        let Stage::Open(session) = std::mem::replace(&mut *locked(&self.stage), Stage::Used) else {
            return Err(used());
        };
        let ending =
            self.caller(py, on_event, warn_level).wait_for(move |watcher, stop| session.render(watcher, stop))?;
        ended(py, ending)
    }

    /// Renders the picture with the farm of the session and waits for it. Returns the file that it is written to.
    #[pyo3(signature = (on_event=None))]
    fn render_with_farm(&self, py: Python<'_>, on_event: Option<Bound<'_, PyAny>>) -> PyResult<PathBuf> {
        refuse_forked()?;
        let Stage::WithFarm(picture) = std::mem::replace(&mut *locked(&self.stage), Stage::Used) else {
            return Err(used());
        };
        let (picture, FarmLogin { address, credentials }) = *picture;
        let rendered = self
            .caller(py, on_event, 2)
            .wait_for(move |watcher, stop| picture.render(address.as_ref(), &credentials, watcher, stop))?
            .whole()?;
        match rendered.map_err(|error| errors::raised_by_farm(&error))? {
            RenderOutcome::Local(picture) => Ok(picture.request().output.file.clone().unwrap_or_default()),
            RenderOutcome::Remote(file) => Ok(file),
        }
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

impl PySession {
    /// Returns the call that renders the picture.
    fn caller<'py>(&self, py: Python<'py>, on_event: Option<Bound<'py, PyAny>>, warn_level: u8) -> Caller<'py> {
        Caller { py, on_event, stop: self.stop.clone(), live: self.live.clone(), warn_level, waits_for_end: true }
    }
}

fn used() -> PyErr {
    errors::failed("a session paints its picture once", "open another: bottega.Session(request)")
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
