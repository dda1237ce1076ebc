//! The Python class of interactive views of scenes in memory.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use bottega::{
    Request,
    scene::{Camera, Loaded},
    viewport::{LinearFrameState, Viewport},
};
use bottega_cluster::client::{SharedViewport, share_viewport};
use numpy::{PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::{
    errors::{self, wrong},
    farm::PyFarm,
    process::refuse_forked,
    request::request_of,
    scene::{PyScene, parsed},
    values::to_python,
    waiting::Caller,
};

/// Interval between checks for Ctrl-C.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// An interactive view of a scene in memory: linear frames that become finer. The Python class `bottega.Viewport` wraps it.
#[pyclass(name = "Viewport", module = "bottega._native", frozen)]
pub(crate) struct PyViewport {
    scene: Py<PyScene>,
    /// The farm whose free machines render samples, too.
    farm: Option<Py<PyFarm>>,
    state: Mutex<ViewportState>,
}

/// The state of a view: the scene shown, and the viewport that shows it.
struct ViewportState {
    request: Request,
    /// The camera that is seen through; `None`: the one that the request names.
    camera: Option<Camera>,
    /// The running viewport; `None`: it has not started, or was stopped.
    running: Option<RunningViewport>,
}

struct RunningViewport {
    viewport: Arc<Viewport>,
    /// The help of the farm's machines, which ends when this is dropped.
    shared: Option<SharedViewport>,
    /// Number of the last frame that was copied.
    copied: u64,
}

/// A frame as Python gets it: number, look, samples per pixel, true if denoised.
type FrameInfo = (u64, u64, u32, bool);

impl PyViewport {
    fn state(&self) -> MutexGuard<'_, ViewportState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the scene as it is now, with the camera of the view.
    fn snapshot(&self, camera: Option<&Camera>) -> PyResult<Loaded> {
        let scene = self.scene.get();
        let Some(camera) = camera else { return scene.finished() };
        let editor = scene.editor();
        editor.check_camera("of the viewport", camera).map_err(|error| errors::edit(&error))?;
        let mut snapshot = editor.snapshot();
        snapshot.cameras.insert(0, camera.clone());
        drop(editor);
        Ok(scene.loaded(snapshot))
    }

    /// Shows the scene as it is now, if the viewport runs.
    fn show(&self, state: &ViewportState) -> PyResult<Option<u64>> {
        let Some(running) = &state.running else { return Ok(None) };
        let snapshot = self.snapshot(state.camera.as_ref())?;
        running.viewport.show(&state.request, snapshot).map(Some).map_err(|error| errors::raised(&error))
    }
}

#[pymethods]
impl PyViewport {
    #[new]
    #[pyo3(signature = (scene, request, farm=None))]
    fn new(scene: Py<PyScene>, request: &str, farm: Option<Py<PyFarm>>) -> PyResult<Self> {
        let request = request_of(request)?;
        Ok(Self { scene, farm, state: Mutex::new(ViewportState { request, camera: None, running: None }) })
    }

    /// Starts rendering the scene as it is now.
    fn start(&self, py: Python<'_>) -> PyResult<()> {
        refuse_forked()?;
        let (request, camera) = {
            let state = self.state();
            if state.running.is_some() {
                return Ok(());
            }
            (state.request.clone(), state.camera.clone())
        };
        let snapshot = self.snapshot(camera.as_ref())?;
        // The lock is not held meanwhile: other threads of Python may use the viewport.
        let opened = Caller::new(py).wait_for(move |_, _| Viewport::of_scene(&request, snapshot))?.whole()?;
        let viewport = Arc::new(opened.map_err(|error| errors::raised(&error))?);
        let share = |farm: &Py<PyFarm>| {
            let board = farm.get().board();
            py.detach(|| share_viewport(&viewport, board)).map_err(|error| errors::raised_by_farm(&error))
        };
        let shared = self.farm.as_ref().map(share).transpose()?;
        if let Some(other) = self.state().running.replace(RunningViewport { viewport, shared, copied: 0 }) {
            other.viewport.close();
        }
        Ok(())
    }

    /// Ends rendering, without waiting for the step that is running.
    fn stop(&self) {
        if let Some(running) = self.state().running.take() {
            running.viewport.close();
        }
    }

    /// Returns true if the viewport has started and was not stopped.
    fn is_running(&self) -> bool {
        self.state().running.is_some()
    }

    /// Returns the machines of the farm that render samples, and those that cannot, as dictionaries.
    fn machines<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let machines = self.state().running.as_ref().and_then(|running| Some(running.shared.as_ref()?.machines()));
        to_python(py, &machines.unwrap_or_default())
    }

    /// Returns why no machine of the farm helps, if the scene cannot be sent to them.
    fn farm_problem(&self) -> Option<String> {
        self.state().running.as_ref()?.shared.as_ref()?.problem()
    }

    /// Shows the scene as it is now. Returns the number of the new look; `None`: the viewport does not run.
    fn update(&self) -> PyResult<Option<u64>> {
        self.show(&self.state())
    }

    /// Changes the view: request and camera, as JSON texts; `null`: the camera that the request names.
    fn look(&self, request: &str, camera: &str) -> PyResult<Option<u64>> {
        let request = request_of(request)?;
        let camera: Option<Camera> = parsed("camera", camera)?;
        if let Some(camera) = &camera {
            let checked = self.scene.get().editor().check_camera("of the viewport", camera);
            checked.map_err(|error| errors::edit(&error))?;
        }
        let mut state = self.state();
        (state.request, state.camera) = (request, camera);
        self.show(&state)
    }

    /// Waits until there is a frame that was not copied. Returns false after `seconds`, or if the viewport does not run.
    fn wait(&self, py: Python<'_>, seconds: f64) -> PyResult<bool> {
        let (viewport, copied) = match &self.state().running {
            Some(running) => (Arc::clone(&running.viewport), running.copied),
            None => return Ok(false),
        };
        let until = Duration::try_from_secs_f64(seconds)
            .map_err(|error| wrong("seconds", &format!("it is {seconds}: {error}; a number from 0 is needed")))?;
        let begun = Instant::now();
        loop {
            let left = until.saturating_sub(begun.elapsed());
            if py.detach(|| viewport.wait(copied, left.min(LOOK_EVERY))) {
                return Ok(self.is_running());
            }
            py.check_signals()?;
            if left.is_zero() {
                return Ok(false);
            }
        }
    }

    /// Copies the current frame: float32, (height, width, 4), linear R G B A, the lowest row first. `None`: there is none yet.
    fn frame_into(&self, array: &Bound<'_, PyAny>) -> PyResult<Option<FrameInfo>> {
        const ARGUMENT: &str = "array";
        let needed = "a writeable, contiguous array is needed: np.empty((height, width, 4), np.float32)";
        let Ok(array) = array.cast::<PyArray3<f32>>() else {
            let text = match array.getattr("dtype").and_then(|dtype| Ok((dtype, array.getattr("shape")?))) {
                Ok((dtype, shape)) => format!("its dtype is {dtype} and its shape {shape}"),
                Err(_) => format!("it is a {}", array.get_type().name()?),
            };
            return Err(wrong(ARGUMENT, &format!("{text}; {needed}")));
        };
        let &[height, width, channels] = array.shape() else { return Err(wrong(ARGUMENT, needed)) };
        let Ok(mut values) = array.try_readwrite() else {
            return Err(wrong(ARGUMENT, &format!("it is read-only, or in use; {needed}")));
        };
        let mut state = self.state();
        let Some(running) = &mut state.running else {
            return Err(errors::failed("the viewport does not run", "viewport.start()"));
        };
        let Ok(slice) = values.as_slice_mut() else {
            return Err(wrong(ARGUMENT, &format!("its values are not contiguous; {needed}")));
        };
        if channels != 4 {
            return Err(wrong(ARGUMENT, &format!("its shape is ({height}, {width}, {channels}); {needed}")));
        }
        let size = (u32::try_from(width).unwrap_or(0), u32::try_from(height).unwrap_or(0));
        let copied = running.viewport.copy_linear(size, slice).map_err(|error| errors::raised(&error))?;
        Ok(copied.map(|LinearFrameState { number, look, samples, is_denoised }| {
            running.copied = number;
            (number, look, samples, is_denoised)
        }))
    }
}
