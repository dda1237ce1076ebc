//! The Python class of a farm: jobs, machines, pictures.

use std::path::PathBuf;

use bottega_cluster::{
    Credentials, Error, FarmAddress, JobBoard, JobState, client, jobs, link,
    names::host_name,
    view::{JobView, MachineView},
};
use pyo3::prelude::*;

use crate::{
    errors,
    process::refuse_forked,
    request::request_of,
    values::{path_of, to_python},
    waiting::Caller,
};

/// Returns the author of orders, for the log of a job.
fn by() -> String {
    format!("Python on {}", host_name())
}

/// How a farm is reached: its address, `None` for the one on this machine, and the credentials of this process.
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
}

impl PyFarm {
    /// Returns how the farm is reached.
    pub(crate) fn login(&self) -> FarmLogin {
        self.login.clone()
    }

    /// Calls the farm without the interpreter's lock.
    fn ask<T: Send>(&self, py: Python<'_>, ask: impl FnOnce(&JobBoard) -> Result<T, Error> + Send) -> PyResult<T> {
        refuse_forked()?;
        py.detach(|| ask(&self.board)).map_err(|error| errors::raised_by_farm(&error))
    }
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
            .map_err(|problem| errors::farm(format!("this is no address of a farm: {problem}"), None))?;
        let credentials = Credentials { creds, nkey, tls_ca, tls_own };
        let login = FarmLogin { address, credentials };
        let FarmLogin { address, credentials } = login.clone();
        let linked = Caller::new(py).wait_for(move |_, _| link(address.as_ref(), &credentials))?.whole()?;
        let uplink = linked.map_err(|error| errors::raised_by_farm(&error))?.uplink;
        Ok(Self { login, board: JobBoard { uplink } })
    }

    /// Submits a picture and does not wait for it. Returns the number of the job.
    #[pyo3(signature = (request, on_event=None))]
    fn submit(&self, py: Python<'_>, request: &str, on_event: Option<Bound<'_, PyAny>>) -> PyResult<u32> {
        refuse_forked()?;
        let request = request_of(request)?;
        let FarmLogin { address, credentials } = self.login();
        let caller = Caller { on_event, waits_for_end: true, ..Caller::new(py) };
        let asked = caller
            .wait_for(move |watcher, stop| client::submit(address.as_ref(), &credentials, &request, watcher, stop))?
            .whole()?;
        let number = asked.map_err(|error| errors::raised_by_farm(&error))?;
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

    /// Removes a job that is over.
    fn remove(&self, py: Python<'_>, number: u32) -> PyResult<()> {
        self.ask(py, |board| jobs::remove(board, number))
    }
}
