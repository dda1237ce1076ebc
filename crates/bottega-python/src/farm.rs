//! The Python class of a farm: jobs, machines, pictures.

use std::{
    path::PathBuf,
    sync::Mutex,
    time::{Duration, Instant},
};

use bottega::{
    events::{Event, ZoneEvent},
    request::PRIORITY_MAX,
};
use bottega_cluster::{
    Credentials, Error, FarmAddress, Job, JobBoard, JobState, client,
    job_film::JobFilm,
    job_preview::JobPreview,
    jobs, link,
    names::host_name,
    view::{JobView, MachineView},
};
use numpy::{IntoPyArray, PyArray3};
use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};

use crate::{
    errors,
    image_file::decoded,
    live::{layers_of, locked},
    process::refuse_forked,
    request::request_of,
    values::{path_of, to_python},
    waiting::Caller,
};

/// Interval between checks for Ctrl-C.
const SIGNALS_EVERY: Duration = Duration::from_millis(100);

/// Returns the author of orders, for the log of a job.
fn by() -> String {
    format!("Python on {}", host_name())
}

/// The login at a farm: its address, `None` for the one on this machine, and the credentials of this process.
#[derive(Clone)]
pub(crate) struct FarmLogin {
    pub(crate) address: Option<FarmAddress>,
    pub(crate) credentials: Credentials,
}

/// A farm to which this process is linked.
#[pyclass(name = "Farm", module = "bottega._native", frozen)]
pub(crate) struct PyFarm {
    login: FarmLogin,
    board: JobBoard,
    /// The job that was seen last, so that its pixels are fetched once.
    seen: Mutex<SeenJob>,
}

/// The data of a job that was fetched.
#[derive(Default)]
struct SeenJob {
    number: u32,
    preview: Option<JobPreview>,
    film: JobFilm,
}

impl PyFarm {
    /// Returns how the farm is reached.
    pub(crate) fn login(&self) -> FarmLogin {
        self.login.clone()
    }

    /// Returns the jobs and machines of the farm.
    pub(crate) fn board(&self) -> &JobBoard {
        &self.board
    }

    /// Calls the farm without the interpreter's lock.
    fn ask<T: Send>(&self, py: Python<'_>, ask: impl FnOnce(&JobBoard) -> Result<T, Error> + Send) -> PyResult<T> {
        refuse_forked()?;
        py.detach(|| ask(&self.board)).map_err(|error| errors::raised_by_farm(&error))
    }

    /// Calls a function with a job and what was fetched of it before.
    fn see<T: Send>(
        &self,
        py: Python<'_>,
        number: u32,
        see: impl FnOnce(&JobBoard, &Job, &mut SeenJob) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        self.ask(py, |board| {
            let job = jobs::known(board, number)?;
            let mut seen = locked(&self.seen);
            if seen.number != number {
                *seen = SeenJob { number, ..SeenJob::default() };
            }
            see(board, &job, &mut seen)
        })
    }
}

/// Returns the farms that announce themselves on the local network within `seconds`, as dictionaries.
#[pyfunction]
pub(crate) fn farms<'py>(py: Python<'py>, seconds: f64) -> PyResult<Bound<'py, PyAny>> {
    let within = Duration::try_from_secs_f64(seconds)
        .map_err(|error| errors::wrong("seconds", &format!("it is {seconds}: {error}; a number from 0 is needed")))?;
    let found = Caller::new(py).wait_for(move |_, _| bottega_cluster::farms(within))?.whole()?;
    to_python(py, &found.map_err(|error| errors::raised_by_farm(&error))?)
}

#[pymethods]
impl PyFarm {
    #[new]
    #[pyo3(signature = (address=None, *, creds=None, nkey=None, tls_ca=None, tls_own=None))]
    fn new(
        py: Python<'_>,
        address: Option<&str>,
        creds: Option<PathBuf>,
        nkey: Option<PathBuf>,
        tls_ca: Option<PathBuf>,
        tls_own: Option<(PathBuf, PathBuf)>,
    ) -> PyResult<Self> {
        refuse_forked()?;
        let address = address
            .map(str::parse::<FarmAddress>)
            .transpose()
            .map_err(|problem| errors::farm(format!("this is not the address of a farm: {problem}"), None))?;
        let credentials = Credentials { creds, nkey, tls_ca, tls_own };
        let login = FarmLogin { address, credentials };
        let FarmLogin { address, credentials } = login.clone();
        let linked = Caller::new(py).wait_for(move |_, _| link(address.as_ref(), &credentials))?.whole()?;
        let uplink = linked.map_err(|error| errors::raised_by_farm(&error))?.uplink;
        Ok(Self { login, board: JobBoard { uplink }, seen: Mutex::default() })
    }

    /// Submits a picture and does not wait for it. Returns the number of the job.
    #[pyo3(signature = (request, on_event=None))]
    fn submit(&self, py: Python<'_>, request: &str, on_event: Option<Bound<'_, PyAny>>) -> PyResult<u32> {
        refuse_forked()?;
        let request = request_of(request)?;
        let FarmLogin { address, credentials } = self.login();
        let caller = Caller { on_event, waits_for_end: true, ..Caller::new(py) };
        let submitted = caller
            .wait_for(move |watcher, stop| client::submit(address.as_ref(), &credentials, &request, watcher, stop))?
            .whole()?;
        let number = submitted.map_err(|error| errors::raised_by_farm(&error))?;
        py.detach(|| jobs::wait_until_known(&self.board, number));
        Ok(number)
    }

    /// Returns all jobs, as dictionaries.
    fn jobs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let all = self.ask(py, |board| Ok(JobView::all(board)))?;
        to_python(py, &all)
    }

    /// Returns the machines that are present, as dictionaries.
    fn machines<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let all = self.ask(py, |board| Ok(MachineView::all(board)))?;
        to_python(py, &all.iter().map(MachineView::to_value).collect::<Vec<_>>())
    }

    /// Returns the log of a job: a list of `{"at", "text"}`.
    fn log<'py>(&self, py: Python<'py>, number: u32) -> PyResult<Bound<'py, PyAny>> {
        let job = self.ask(py, |board| jobs::known(board, number))?;
        to_python(py, &job.log)
    }

    /// Writes the picture of a finished job to a file. Returns the file.
    #[pyo3(signature = (number, path=None))]
    fn fetch(&self, py: Python<'_>, number: u32, path: Option<&Bound<'_, PyAny>>) -> PyResult<PathBuf> {
        let path = path.map(path_of).transpose()?;
        self.ask(py, |board| jobs::fetch(board, number, path))
    }

    /// Pauses a job until it is resumed.
    fn pause(&self, py: Python<'_>, number: u32) -> PyResult<()> {
        self.ask(py, |board| jobs::steer(board, number, &JobState::Paused, &by()))
    }

    /// Resumes a paused job.
    fn resume(&self, py: Python<'_>, number: u32) -> PyResult<()> {
        self.ask(py, |board| jobs::steer(board, number, &JobState::Active, &by()))
    }

    /// Cancels a job.
    fn cancel(&self, py: Python<'_>, number: u32) -> PyResult<()> {
        self.ask(py, |board| jobs::steer(board, number, &JobState::Cancelled, &by()))
    }

    /// Changes the weight of a job among those that share the machines.
    fn set_priority(&self, py: Python<'_>, number: u32, priority: u32) -> PyResult<()> {
        if !(1..=PRIORITY_MAX).contains(&priority) {
            return Err(PyValueError::new_err(format!("`priority` is {priority}; 1 to {PRIORITY_MAX} is allowed")));
        }
        self.ask(py, |board| {
            jobs::known(board, number)?;
            jobs::set_priority(board, number, priority, &by())
        })
    }

    /// Requests that a zone that is done or has failed is rendered again.
    fn requeue(&self, py: Python<'_>, number: u32, zone: u32) -> PyResult<()> {
        self.ask(py, |board| {
            jobs::known(board, number)?;
            board.requeue(number, zone, &by())
        })
    }

    /// Returns the rows of a job's zones on the Blackboard, as dictionaries.
    fn zones<'py>(&self, py: Python<'py>, number: u32) -> PyResult<Bound<'py, PyAny>> {
        let rows = self.ask(py, |board| board.rows(&jobs::known(board, number)?))?;
        let mut zones: Vec<ZoneEvent> =
            rows.into_iter().filter_map(|row| if let Event::Zone(zone) = row { Some(*zone) } else { None }).collect();
        zones.sort_by_key(|zone| zone.id);
        to_python(py, &zones)
    }

    /// Returns the preview of a job: uint8, (height, width, 3), sRGB; `None`: nothing is painted.
    fn preview<'py>(&self, py: Python<'py>, number: u32) -> PyResult<Option<Bound<'py, PyArray3<u8>>>> {
        let png = self.see(py, number, |board, job, seen| {
            let mut preview = seen.preview.take().map_or_else(|| JobPreview::new(board, job), Ok)?;
            let png = preview.renew(board, job);
            seen.preview = Some(preview);
            png
        })?;
        let array = py.detach(|| png.as_deref().map(decoded).transpose()).map_err(PyValueError::new_err)?;
        Ok(array.map(|array| array.into_pyarray(py)))
    }

    /// Returns copies of the layers of a job that is not over, by name; `None`: nothing is painted.
    fn layers<'py>(&self, py: Python<'py>, number: u32) -> PyResult<Option<Bound<'py, PyDict>>> {
        let film = self.see(py, number, |board, job, seen| Ok(seen.film.renew(board, job)?.cloned()))?;
        film.map(|film| layers_of(py, &film)).transpose()
    }

    /// Waits until something changes in the jobs and machines of the farm, at most `seconds`. Returns the number of changes.
    ///
    /// - `seen`: the number that was returned before.
    fn wait(&self, py: Python<'_>, seen: u64, seconds: f64) -> PyResult<u64> {
        refuse_forked()?;
        let end = Instant::now() + Duration::try_from_secs_f64(seconds.min(1e6)).unwrap_or_default();
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let count = py.detach(|| self.board.uplink.notices().wait(seen, left.min(SIGNALS_EVERY)));
            if count != seen || left.is_zero() {
                return Ok(count);
            }
            py.check_signals()?;
        }
    }

    /// Removes a job that is over.
    fn remove(&self, py: Python<'_>, number: u32) -> PyResult<()> {
        self.ask(py, |board| jobs::remove(board, number))
    }
}
