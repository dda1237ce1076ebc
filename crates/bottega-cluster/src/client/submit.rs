//! Submits a picture to a farm, renders it together with the other machines, and receives the result.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    thread,
    time::Duration,
};

use bottega::{
    Event, Picture, Request, Session, SessionOptions, StopSwitch, Watcher, denoise,
    devices::{DeviceChoice, beside_processors, threads},
    engines::SceneFiles,
    request::EnvironmentLight,
    session::{PaintingSetup, Reporter},
    text::shown,
};
use bottega_farm::{JobError, JobReport};
use bottega_image::Rect;

use crate::{
    build::build,
    client::transfer::{self, SentPieces},
    error::Error,
    files::sent_files::SentFiles,
    job::{
        board::{JobBoard, ended_badly},
        record::{Job, JobSpec, JobState, for_others, unix_seconds},
        refusals::RefusalWatch,
    },
    machine::{
        member::Member,
        part::{Leading, PartOutcome, take_part},
    },
    names::fresh_number,
    server::{
        address::FarmAddress,
        link::{Credentials, FarmLink, link},
        patience::{meanwhile, patiently},
    },
};

/// Interval between checks of a job that this process does not take part in.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// A job that this process submitted. When it is dropped, this process leaves the farm.
pub struct SubmittedJob {
    member: Member,
    /// The number of the job at the farm.
    pub number: u32,
    work: u64,
}

/// The outcome of a job, before its picture is written.
enum JobOutcome {
    /// This process led the job and has the pixels; no [`Leading`] if it stopped early.
    Local(Box<JobReport>, Option<Leading>),
    /// Another process led it: the bytes of the picture file.
    Remote(Vec<u8>),
}

/// The outcome of a picture on a farm.
pub enum RenderOutcome {
    /// This process led the job; the picture is written. It is incomplete if the user stopped early or zones failed.
    Local(Box<Picture>),
    /// Another machine led the job; the picture is written to this file.
    Remote(PathBuf),
}

/// A picture to be rendered with the machines of a farm: its scene is loaded, and its request is checked.
pub struct FarmPicture {
    session: Session,
    files: SceneFiles,
}

/// Renders a picture with the machines of a farm, and writes it to the output file of the request. Returns its outcome.
///
/// - `farm`: the address; `None`: the farm that runs on this machine.
/// - `credentials`: for NATS servers of other operators.
/// - `watcher`: receives the events of the work.
/// - `stop`: ends the work: cancels the job, and writes the samples so far if this process led it.
///
/// # Errors
/// There is no such farm, it does not admit this machine or admits it as a guest, the request cannot be rendered, the farm has
/// no room for the scene, the job failed or was cancelled or removed, the user stopped before there was a picture, or the picture
/// cannot be written.
pub fn render(
    farm: Option<&FarmAddress>,
    credentials: &Credentials,
    request: &Request,
    options: SessionOptions,
    watcher: Arc<dyn Watcher>,
    stop: &StopSwitch,
) -> Result<RenderOutcome, Error> {
    FarmPicture::open(request, options)?.render(farm, credentials, watcher, stop)
}

impl FarmPicture {
    /// Loads the scene of a request on this machine, and checks the request. Returns the picture, to be rendered.
    ///
    /// # Errors
    /// The request cannot be rendered.
    pub fn open(request: &Request, options: SessionOptions) -> Result<Self, Error> {
        let (session, files) = Session::open_for_farm(request, options)?;
        Ok(Self { session, files })
    }

    /// Returns the part of the picture that is rendered, in pixels.
    pub fn crop(&self) -> Rect {
        self.session.settings().crop
    }

    /// Renders the picture, and returns its outcome; see [`render`].
    ///
    /// # Errors
    /// Those of [`render`].
    pub fn render(
        self,
        farm: Option<&FarmAddress>,
        credentials: &Credentials,
        watcher: Arc<dyn Watcher>,
        stop: &StopSwitch,
    ) -> Result<RenderOutcome, Error> {
        let Self { session, files } = self;
        let (request, name) = (session.request().clone(), session.name().map(str::to_owned));
        let reporter = Arc::new(Reporter::new(watcher));
        let (painting, setup) = session.begin(Arc::clone(&reporter))?;
        let job = SubmittedJob::submit((farm, credentials), &request, &files, name.as_deref(), stop, &reporter)?;
        match job.paint(setup, &reporter)? {
            JobOutcome::Local(report, leading) => {
                let picture = painting.finish(*report, stop).and_then(|picture| picture.write().map(|()| picture));
                let picture = picture.map_err(|error| job.unwritten(&error.into()))?;
                let failed = picture.report().failed.len();
                if let Some(leading) = leading
                    && let Err(error) = job.complete(&leading, failed, &reporter)
                {
                    reporter.warn(format!("the picture is written, but the farm could not be informed: {error}"));
                }
                Ok(RenderOutcome::Local(Box::new(picture.close()?)))
            }
            JobOutcome::Remote(picture) => {
                painting.leave();
                let output = request.output.file.clone().unwrap_or_default();
                write_picture(&output, &picture).map_err(|error| unfetched(job.number, &error))?;
                if let Some(lacking) = denoise::lacking(&request, &output, &picture) {
                    reporter.warn(lacking);
                }
                if let Some(journal) = painting.journal()
                    && let Err(error) = std::fs::remove_file(journal)
                {
                    reporter.warn(format!("cannot remove {}: {error}", journal.display()));
                }
                reporter.tell(Event::Fetched { output: shown(&output) });
                Ok(RenderOutcome::Remote(output))
            }
        }
    }
}

/// Submits a picture to a farm, without waiting for it; parameters as for [`render`]. Returns the number of its job. Without an
/// output file the picture is called `picture.exr`.
///
/// # Errors
/// There is no such farm, it does not admit this machine or admits it as a guest, the request cannot be rendered, the farm has
/// no room for the scene, or the user stopped while it was sent.
pub fn submit(
    farm: Option<&FarmAddress>,
    credentials: &Credentials,
    request: &Request,
    watcher: Arc<dyn Watcher>,
    stop: &StopSwitch,
) -> Result<u32, Error> {
    let reporter = Reporter::new(watcher);
    let mut request = request.by_engine_of_scene();
    // The farm keeps the picture under a name, whose extension says the format.
    request.output.file.get_or_insert_with(|| PathBuf::from(super::PICTURE));
    let request = &request;
    let files = Session::examine(request)?;
    files.warnings.iter().for_each(|warning| reporter.warn(warning.clone()));
    let job = SubmittedJob::submit((farm, credentials), request, &files, None, stop, &reporter)?;
    Ok(job.number)
}

impl SubmittedJob {
    /// Sends the scene and submits the job.
    ///
    /// - `journal`: the name of the picture in the journal beside the output, if there is one.
    fn submit(
        (farm, credentials): (Option<&FarmAddress>, &Credentials),
        request: &Request,
        files: &SceneFiles,
        journal: Option<&str>,
        stop: &StopSwitch,
        reporter: &Reporter,
    ) -> Result<Self, Error> {
        let FarmLink { uplink, name, .. } = link(farm, credentials)?;
        let board = JobBoard { uplink };
        board.refuse_guests()?;
        board.sweep();
        let (order, sent) = order(&board, &name, request, files, stop, reporter)?;
        let order = JobSpec { journal: journal.map(str::to_owned), ..order };
        let mut job = new_job(request, files, &name);
        if let Some(lacking) = board.lacks_tagged(&job.require) {
            job.say(lacking.clone());
            reporter.warn(lacking);
        }
        let number = board.submit(&job, &order)?;
        sent.keep();
        reporter.tell(Event::Submitted { job: number, last_job: None });
        let member = Member::new(board, name, (threads(request), devices_of(request)), stop);
        Ok(Self { member, number, work: job.work })
    }

    /// Renders together with the other machines until the picture is complete or the user stops. Warns of machines that
    /// refuse the job.
    fn paint(&self, setup: PaintingSetup, reporter: &Reporter) -> Result<JobOutcome, Error> {
        let mut watch = RefusalWatch::default();
        let tell = || {
            let presences = self.member.board.presences();
            for (machine, refusal) in watch.new_refusals(&presences, |work| work == self.work) {
                reporter.warn(format!("{} is left out: {}", machine.name, refusal.reason));
            }
        };
        meanwhile(LOOK_EVERY, tell, || self.paint_with_others(setup, reporter))
    }

    fn paint_with_others(&self, mut setup: PaintingSetup, reporter: &Reporter) -> Result<JobOutcome, Error> {
        let Member { board, stop, .. } = &self.member;
        let say = |line: &str| reporter.say(line);
        let mut said_paused = false;
        let mut helped = None;
        loop {
            let job = board.get(self.number).ok_or_else(|| {
                Error::failed(format!("job {} is gone", self.number), "somebody has removed it; submit it again")
            })?;
            if let Some(error) = ended_badly(self.number, &job.state) {
                return Err(error);
            }
            if job.state == JobState::Done {
                let picture = patiently(stop, say, || board.picture(&job))?;
                return picture.map(JobOutcome::Remote).ok_or_else(|| {
                    Error::failed("the job is done, but its picture is missing", "see `bottega jobs log`")
                });
            }
            let is_led = board.lead(self.number).is_some_and(|lead| lead.leader.is_some());
            if job.state == JobState::Paused || helped == Some(job.turn()) && is_led {
                if job.state == JobState::Paused && !std::mem::replace(&mut said_paused, true) {
                    reporter.say(&format!("paused; continue with `bottega jobs resume {}`", self.number));
                }
                if stop.is_requested() {
                    return Err(self.called_off());
                }
                thread::sleep(LOOK_EVERY);
                continue;
            }
            said_paused = false;
            helped = None;
            let part = || take_part(&self.member, self.number, &job, &mut setup, || false);
            match patiently(stop, say, part) {
                Ok(PartOutcome::Led(report, leading)) => return Ok(JobOutcome::Local(report, Some(leading))),
                Ok(PartOutcome::Left(Some(report))) if stop.is_requested() => {
                    self.call_off();
                    return Ok(JobOutcome::Local(report, None));
                }
                Ok(PartOutcome::Left(None)) if stop.is_requested() => return Err(self.called_off()),
                Ok(PartOutcome::Left(_)) => {}
                Ok(PartOutcome::Helped) => helped = Some(job.turn()),
                // Let the machines that can render it continue.
                Err(Error::Bottega(bottega::Error::Job(JobError::LeftOut { reason }))) => {
                    reporter.warn(format!("this machine is left out: {reason}"));
                    helped = Some(job.turn());
                }
                Err(error) if error.may_pass() => return Err(self.called_off()),
                Err(error) => return Err(error),
            }
        }
    }

    /// Marks the job as over: its picture is written on this machine.
    fn complete(&self, leading: &Leading, failed: usize, reporter: &Reporter) -> Result<(), Error> {
        let state = match failed {
            0 => JobState::Done,
            failed => JobState::Failed { reason: format!("{failed} zones could not be painted") },
        };
        let Member { board, stop, .. } = &self.member;
        patiently(stop, |line| reporter.say(line), || board.complete(self.number, leading.work, &state, false))
    }

    /// Returns the error for a picture that could not be written here. The next leader of the job stores the picture at the
    /// farm.
    fn unwritten(&self, error: &Error) -> Error {
        let number = self.number;
        Error::failed(
            error.error_chain(),
            format!(
                "the farm has all that is painted: the next machine that leads job {number} stores the picture, and \
                 `bottega jobs fetch {number} -o FILE` writes it to a disk with space; `bottega jobs cancel {number}` cancels the job"
            ),
        )
    }

    fn called_off(&self) -> Error {
        self.call_off();
        Error::failed("stopped before there was a picture", "ask again")
    }

    /// Cancels the job on behalf of its submitter.
    fn call_off(&self) {
        let off = self.member.board.change(self.number, |job| {
            let is_over = job.state.is_over();
            if !is_over {
                job.say("cancelled by its submitter");
                job.state = JobState::Cancelled;
            }
            !is_over
        });
        if let Err(error) = off {
            tracing::warn!(%error, "cannot cancel the job");
        }
    }
}

impl Drop for SubmittedJob {
    fn drop(&mut self) {
        self.member.board.leave(&self.member.name);
    }
}

/// Returns the error for a picture that the farm has and that could not be written on this machine.
pub(crate) fn unfetched(number: u32, error: &Error) -> Error {
    let remedy =
        format!("the farm has the picture: `bottega jobs fetch {number} -o FILE` writes it to a disk with space");
    Error::failed(error.error_chain(), remedy)
}

/// Writes the picture file of another process, completely or not at all. Creates its folder.
///
/// - `bytes`: the contents of the file.
///
/// # Errors
/// The folder or the file cannot be written.
pub fn write_picture(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let folder = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(|source| Error::write(path.to_owned(), source))?;
    Ok(bottega_image::write_whole(path, bytes)?)
}

/// Returns the record of a new job.
pub(crate) fn new_job(request: &Request, files: &SceneFiles, from: &str) -> Job {
    let number = fresh_number();
    let mut job = Job {
        version: build().identity().to_owned(),
        commit: build().commit().to_owned(),
        origin: number,
        work: number,
        stirs: 0,
        kept: false,
        scene: shown(&request.scene.file),
        output: request.output.file.as_deref().map(shown).unwrap_or_default(),
        from: from.to_owned(),
        submitted: unix_seconds(),
        priority: request.farm.priority,
        require: request.farm.require.clone(),
        animation: None,
        state: JobState::Active,
        log: Vec::new(),
    };
    job.say(format!("submitted by {from}"));
    files.method.iter().for_each(|method| job.say(method.clone()));
    job
}

/// Returns the devices of this machine that render the request, without the CPU.
pub(crate) fn devices_of(request: &Request) -> Vec<String> {
    beside_processors(&DeviceChoice::of(&request.devices.names).unwrap_or_default())
}

/// Returns the job's spec in a form that other machines understand, and sends the scene. The files are withdrawn when the
/// returned [`SentPieces`] is dropped without `keep`.
///
/// - `me`: the process that submits.
pub(crate) fn order<'a>(
    board: &'a JobBoard,
    me: &'a str,
    request: &Request,
    needed: &SceneFiles,
    stop: &StopSwitch,
    reporter: &Reporter,
) -> Result<(JobSpec, SentPieces<'a>), Error> {
    if request.goal.time.is_some() {
        return Err(Error::usage(
            "a farm supports a number of samples or an error as the goal, not a time",
            "leave out the time, or the farm",
        ));
    }
    let environment = match &request.environment.light {
        Some(EnvironmentLight::File(path)) => Some(path.as_path()),
        _ => None,
    };
    let (files, transfer) = SentFiles::read(&request.scene.file, &needed.files, environment)?;
    let sent = transfer::send(&transfer, board, me, stop, reporter)?;
    let request = for_others(request, &needed.rules);
    request.to_value().map_err(|source| bottega::Error::Request { origin: "the options".to_owned(), source })?;
    Ok((JobSpec { request, files, engine: needed.engine.clone(), journal: None }, sent))
}
