//! An animation rendered by a farm: each frame is a job. Each machine takes a frame of its own while there are enough; the
//! last frames are rendered by all machines together.

use std::{
    collections::BTreeMap,
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use bottega::{
    Event, Request, Session, StopSwitch, Watcher, denoise,
    devices::{DeviceChoice, threads},
    session::Reporter,
};

use crate::{
    client::submit::{devices_of, new_job, order, unfetched, write_picture},
    error::Error,
    files::cache::Cache,
    job::{
        board::{JobBoard, ended_badly},
        record::{AnimationFrame, Job, JobSpec, JobState, for_others},
        refusals::RefusalWatch,
    },
    machine::{
        member::Member,
        prepared_job::WorkerDevices,
        worker::{Worker, WorkerMessage},
    },
    server::{
        address::FarmAddress,
        link::{Credentials, FarmLink, link},
        patience::patiently,
    },
};

/// Interval between checks for finished frames.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// A submitted frame.
struct WantedFrame {
    frame: i32,
    /// The number of the painting.
    work: u64,
    output: PathBuf,
}

/// Renders an animation with the machines of a farm, and writes each frame to its output file. A frame that fails does not end
/// the others.
///
/// - `farm`: the address; `None`: the farm that runs on this machine.
/// - `credentials`: for NATS servers of other operators.
/// - `resume`: submits only the frames whose output is missing or incomplete.
/// - `watcher`: receives the events of the work.
/// - `stop`: ends the work of this machine and the wait for the frames; those that are not done are cancelled, without error.
///
/// # Errors
/// There is no such farm, it does not admit this machine or admits it as a guest, the request is invalid, the denoiser is not
/// installed, the farm has no room for the scene, a frame cannot be rendered or written, or its job was cancelled or removed.
pub fn render_frames(
    farm: Option<&FarmAddress>,
    credentials: &Credentials,
    request: &Request,
    resume: bool,
    watcher: Arc<dyn Watcher>,
    stop: &StopSwitch,
) -> Result<(), Error> {
    // Check denoising here, where the user sees the error: this machine also renders.
    denoise::ready(request)?;
    let reporter = Arc::new(Reporter::new(watcher));
    let FarmLink { uplink, name, .. } = link(farm, credentials)?;
    let board = JobBoard { uplink };
    let wanted = submit(request, resume, &board, &name, stop, &reporter)?;
    paint_with_others(request, wanted, board, name, stop, &reporter)
}

/// Submits an animation to a farm, without waiting for it; parameters as for [`render_frames`]. `watcher` receives the numbers
/// of the jobs.
///
/// # Errors
/// There is no such farm, it does not admit this machine or admits it as a guest, the request is invalid, the first frame cannot
/// be rendered, or the farm has no room for the scene.
pub fn submit_frames(
    farm: Option<&FarmAddress>,
    credentials: &Credentials,
    request: &Request,
    resume: bool,
    watcher: Arc<dyn Watcher>,
    stop: &StopSwitch,
) -> Result<(), Error> {
    let FarmLink { uplink, name, .. } = link(farm, credentials)?;
    submit(request, resume, &JobBoard { uplink }, &name, stop, &Reporter::new(watcher)).map(drop)
}

/// Renders frames with the other machines and collects the results, until all are done or the user stops.
fn paint_with_others(
    request: &Request,
    wanted: BTreeMap<u32, WantedFrame>,
    board: JobBoard,
    name: String,
    stop: &StopSwitch,
    reporter: &Arc<Reporter>,
) -> Result<(), Error> {
    let member = Member::new(board.clone(), name, (threads(request), devices_of(request)), stop);
    let only = wanted.keys().copied().collect();
    let over = Arc::new(AtomicBool::new(false));
    let collector = {
        let (request, reporter) = (request.clone(), Arc::clone(reporter));
        let (stop, over) = (stop.clone(), Arc::clone(&over));
        thread::Builder::new().name("frames".to_owned()).spawn(move || {
            let collected = collect(&request, &board, wanted, &reporter, &stop);
            over.store(true, Ordering::Relaxed);
            collected
        })
    };
    let collector = collector
        .map_err(|error| Error::failed(format!("cannot start a thread: {error}"), "let fewer programs run at once"))?;
    let say = {
        let reporter = Arc::clone(reporter);
        move |said: WorkerMessage<'_>| match said {
            WorkerMessage::Line(line) => reporter.say(line),
            WorkerMessage::Failure(error) => reporter.warn(error.error_chain_with_remedy()),
        }
    };
    let cache = Cache::of_user();
    let devices = DeviceChoice::of(&request.devices.names).unwrap_or_default();
    let own = WorkerDevices {
        threads: request.devices.threads,
        devices,
        memory_mb: request.devices.memory_mb,
        rules: Vec::new(),
    };
    let mut worker = Worker::new(member, cache, own, Some(only), Box::new(say));
    while !stop.is_requested() && !over.load(Ordering::Relaxed) {
        worker.work_once();
    }
    worker.leave();
    match collector.join() {
        Ok(collected) => collected,
        // The panic was reported on its own thread.
        Err(panic) => std::panic::resume_unwind(panic),
    }
}

/// Submits the frames that are missing. The first frame is examined before any is submitted.
fn submit(
    request: &Request,
    resume: bool,
    board: &JobBoard,
    me: &str,
    stop: &StopSwitch,
    reporter: &Reporter,
) -> Result<BTreeMap<u32, WantedFrame>, Error> {
    board.refuse_guests()?;
    let request = &request.by_engine_of_scene();
    request.validate().map_err(bottega::Error::from)?;
    let missing = request.missing_frames(resume)?;
    let Some(&first) = missing.first() else { return Ok(BTreeMap::new()) };
    let first = request.at_frame(first)?;
    let files = Session::examine(&first)?;
    for warning in &files.warnings {
        reporter.warn(warning.clone());
    }
    board.sweep();
    let (order, sent) = order(board, me, &first, &files, stop, reporter)?;
    if let Some(lacking) = board.lacks_tagged(&request.farm.require) {
        reporter.warn(lacking);
    }
    let mut wanted = BTreeMap::new();
    let jobs = frame_jobs(request, &missing, |of_frame| new_job(of_frame, &files, me))?;
    for (frame, of_frame, job) in jobs {
        let spec = JobSpec { request: for_others(&of_frame, &files.rules), ..order.clone() };
        let number = board.submit(&job, &spec)?;
        let output = of_frame.output.file.unwrap_or_default();
        wanted.insert(number, WantedFrame { frame, work: job.work, output });
    }
    sent.keep();
    if let (Some((&first, _)), Some((&last, _))) = (wanted.first_key_value(), wanted.last_key_value()) {
        reporter.tell(Event::Submitted { job: first, last_job: Some(last) });
    }
    Ok(wanted)
}

/// Returns the jobs of an animation, one per frame, with their requests.
///
/// - `new_job`: makes the job for the request of a frame.
///
/// # Errors
/// The output name has no placeholder for the frame number.
pub(crate) fn frame_jobs(
    request: &Request,
    frames: &[i32],
    new_job: impl Fn(&Request) -> Job,
) -> Result<Vec<(i32, Request, Job)>, Error> {
    let mut animation: Option<String> = None;
    let mut jobs = Vec::new();
    for &frame in frames {
        let of_frame = request.at_frame(frame)?;
        let mut job = new_job(&of_frame);
        job.scene = format!("{}, frame {frame}", job.scene);
        let animation = animation.get_or_insert_with(|| format!("{:016x}", job.work)).clone();
        job.animation = Some(AnimationFrame { animation, frame, frames: frames.len() as u32 });
        jobs.push((frame, of_frame, job));
    }
    Ok(jobs)
}

/// Writes the pictures as they are finished, until all are done or the user stops.
fn collect(
    request: &Request,
    board: &JobBoard,
    mut wanted: BTreeMap<u32, WantedFrame>,
    reporter: &Reporter,
    stop: &StopSwitch,
) -> Result<(), Error> {
    let (all, say) = (wanted.len(), |line: &str| reporter.say(line));
    let (mut failure, mut watch) = (None, RefusalWatch::default());
    while !wanted.is_empty() && !stop.is_requested() {
        let mut over = Vec::new();
        let presences = board.presences();
        for (machine, refusal) in watch.new_refusals(&presences, |work| wanted.values().any(|frame| frame.work == work))
        {
            reporter.warn(format!("{} leaves frames out: {}", machine.name, refusal.reason));
        }
        for (&number, WantedFrame { frame, output, .. }) in &wanted {
            let Some(job) = board.get(number) else {
                over.push(number);
                failure = Some(Error::failed(format!("frame {frame} is gone"), "somebody has removed its job"));
                continue;
            };
            if let Some(error) = ended_badly(number, &job.state) {
                over.push(number);
                failure = Some(error);
            } else if job.state == JobState::Done
                && let Some(picture) = patiently(stop, say, || board.picture(&job))?
            {
                if let Err(error) = write_picture(output, &picture) {
                    failure = Some(unfetched(number, &error));
                    over.push(number);
                    continue;
                }
                if let Some(lacking) = denoise::lacking(request, output, &picture) {
                    reporter.warn(lacking);
                }
                patiently(stop, say, || board.remove(number))?;
                over.push(number);
                let done = all - wanted.len() + over.len();
                reporter.tell(Event::Frame { output: output.display().to_string(), done, all });
            }
        }
        over.iter().for_each(|number| _ = wanted.remove(number));
        thread::sleep(LOOK_EVERY);
    }
    for &number in wanted.keys() {
        board.change(number, |job| {
            job.say("cancelled by its submitter");
            job.state = JobState::Cancelled;
            true
        })?;
    }
    match failure {
        Some(error) => Err(error),
        None => Ok(()),
    }
}
