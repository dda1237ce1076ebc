//! The driver of a job in one process: all agents on one thread, the engine on its own threads.
//!
//! The only module with threads. It opens no files and no sockets, and gets its time from the platform. Engines compute on
//! their own threads and report to the mailboxes of the agents, so one thread is enough for all agents; it sleeps while
//! there are no messages.

mod assist;
mod benchmark;
mod composer;
mod effects;
mod fetchers;
mod job_agent;
mod learner;
mod link;
mod machine;
mod observer;
mod paint;
mod populate;
mod settings;
mod shared;
mod stop;
mod tiles;
mod transport;

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use bottega_agents::LocalPlatform;
use bottega_engines::RenderEngine;
use bottega_image::{Film, Rect};

pub use self::{
    assist::assist,
    benchmark::{BenchmarkClocks, MachineSpeed},
    job_agent::JobAgent,
    link::Link,
    observer::{MasterHandle, Observer},
    settings::{AGENTS_MAX, JobError, JobSettings, PREFETCH_MAX, VERIFY_MAX},
    stop::StopSwitch,
    transport::{JobTransport, JobUplink, TransportError},
};
use self::{
    composer::Composer,
    populate::populate,
    shared::{End, Shared},
};
use crate::{FarmCompletion, Forecast, Goal, JobLesson, JournalContents, Times, WorkRow, ZoneId, ZoneRow, ZoneStore};

/// The report of a job that has ended: its picture, rows and times.
#[derive(Debug)]
pub struct JobReport {
    /// The picture, possibly incomplete.
    pub film: Film,
    /// True if the job was stopped before its end. False if its time limit ended it and each pixel has a value.
    pub stopped: bool,
    /// The zones that no agent could paint; empty if the job was stopped.
    pub failed: Vec<ZoneId>,
    /// The last row of each zone, in the order of their ids.
    pub rows: Vec<ZoneRow>,
    /// The time spent on each phase.
    pub times: Times,
    /// Number of messages that the agents of this process sent, counted once for each receiver; without those to the
    /// directories.
    pub messages: u64,
    /// The accuracy of the times predicted before profiling. `None`: too few zones were painted as a whole, or another
    /// process had started the work.
    pub forecast: Option<Forecast>,
    /// The number of earlier jobs that this machine has learned from.
    pub jobs_learnt: u64,
    /// The measured zone times of each machine, by its name, for later predictions.
    pub lessons: BTreeMap<String, JobLesson>,
}

impl JobReport {
    /// Returns the cost of bands: the share of all rendered pixels that lie outside the zones for which they were rendered.
    ///
    /// - `frame`: the pixels of the picture that were rendered.
    pub fn band_share(&self, frame: &Rect) -> f64 {
        let painted = |row: &ZoneRow| row.choice.map_or(row.size(), |choice| row.painted(&choice, frame).area());
        let all: u64 = self.rows.iter().map(painted).sum();
        let own: u64 = self.rows.iter().map(ZoneRow::size).sum();
        all.saturating_sub(own) as f64 / all.max(1) as f64
    }
}

/// Runs a job to its end, or until `stop` is requested, and returns its picture and rows. Blocks meanwhile.
///
/// - `engine`: renders the zones.
/// - `observer`: is informed of the progress.
/// - `store`: the store of the job's progress; `None`: it is not stored.
/// - `kept`: the progress of an earlier run of the same job, which this run continues.
///
/// With optimization off, each pixel is bit-identical for any number of agents, any level of partition and any
/// interruption, if the engine is [`exact_by_pixel`](bottega_engines::EngineDescription::exact_by_pixel).
///
/// # Errors
/// The settings are invalid, [`JobSettings::verify`] is above 1, `kept` has other settings, the engine cannot survey or
/// prepare the scene, an agent ends before the work, or a thread cannot be started.
pub fn run(
    settings: &JobSettings,
    engine: Arc<dyn RenderEngine>,
    observer: Arc<dyn Observer>,
    stop: &StopSwitch,
    store: Option<Box<dyn ZoneStore>>,
    kept: Option<JournalContents>,
) -> Result<JobReport, JobError> {
    lead(settings, engine, observer, stop, store, kept, None)
}

/// Leads a job together with the other machines on `link`, if it is given: their agents join by [`assist`]. The other
/// parameters and the result are those of [`run`].
///
/// If another process has led the job before, this one continues from the Blackboard. Once the picture is stored, clear
/// the Blackboard: [`Link::forget`].
///
/// # Errors
/// As for [`run`]; but [`JobSettings::verify`] may be above 1 with a link.
pub fn lead(
    settings: &JobSettings,
    engine: Arc<dyn RenderEngine>,
    observer: Arc<dyn Observer>,
    stop: &StopSwitch,
    store: Option<Box<dyn ZoneStore>>,
    kept: Option<JournalContents>,
    link: Option<Link>,
) -> Result<JobReport, JobError> {
    // Validate the settings, and the progress of an earlier run
    let work = settings.work()?;
    if settings.verify > 1 && link.is_none() {
        return Err(JobError::Verify { reason: "the agents of one process have the same engine" });
    }
    let mut kept = kept;
    if let Some(JournalContents { work: WorkRow { settings, .. }, .. }) = &mut kept {
        // The time limit counts from the start of each run.
        if let (Goal::Time(_), Goal::Time(_)) = (settings.goal, work.goal) {
            settings.goal = work.goal;
        }
        if *settings != work {
            return Err(JobError::OtherWork);
        }
    }
    let (kept, tiles) = match kept {
        Some(JournalContents { mut work, mut rows, tiles }) => {
            // Renumber the rows for this work: rows of the earlier run on the Blackboard are not used.
            if let Some(link) = &link {
                work.work = link.work;
                rows.iter_mut().for_each(|row| row.work = link.work);
            }
            (Some((work, rows)), tiles)
        }
        None => (None, Default::default()),
    };
    let composer = Composer::new(settings, tiles, store);
    // The user or a time limit ends the work; on a farm, the time limit is not checked here. Engines that cannot stop between
    // samples finish their zones.
    let limit = match (settings.goal, &link) {
        (Goal::Time(limit), None) if engine.describe().resumes_samples => Some(limit),
        _ => None,
    };
    let ended = StopSwitch::new();
    // Create the platform and the agents
    let shared = Arc::new(Shared::new(settings, composer, engine, observer, &ended, link));
    let uplink = shared.uplink()?;
    let platform = LocalPlatform::linked(1, uplink.clone().map(|uplink| uplink as _))?;
    let master = populate(&platform, settings, work, kept, &shared)?;
    let leader = master.clone();
    shared.observer.leads(&MasterHandle { ask: Arc::new(move |completion| leader.complete(completion)) });
    // Forward a stop to the Master and the engine
    let on_stop = Arc::downgrade(&shared);
    ended.when_requested(move || {
        if let Some(shared) = on_stop.upgrade() {
            master.complete(FarmCompletion::Stop);
            shared.cancel_orders();
        }
    });
    let by_user = ended.clone();
    stop.when_requested(move || by_user.request());
    // Wait for the end
    let end = shared.wait(|| limit.map(|limit| limit.saturating_sub(platform.now().elapsed())));
    stop.forget();
    ended.forget();
    let total = platform.now().elapsed();
    // Stop the agents, and send their last messages
    platform.stop();
    if let Some(uplink) = uplink {
        uplink.close();
    }
    if let Some(link) = &shared.link {
        // The Master's last messages dismiss the other processes.
        link.transport.flush();
    }
    report(&shared, end, total, stop.is_requested())
}

/// Returns the report of a job.
///
/// - `by_user`: `true` if the user has stopped the work.
fn report(shared: &Shared, end: Option<End>, total: Duration, by_user: bool) -> Result<JobReport, JobError> {
    let (survey, preparation, messages) = {
        let state = shared.state();
        (state.survey, state.preparing, state.messages)
    };
    let mut composer = shared.composer();
    // Return an error if the job was abandoned
    if let (Some(End::Abandoned(reason)), false) = (&end, shared.stop.is_requested()) {
        return Err(JobError::Abandoned { reason: reason.clone() });
    }
    let (stopped, failed) = match end {
        Some(End::Finished(failed)) => (false, failed),
        _ => (true, Vec::new()),
    };
    // Complete the film
    if stopped {
        composer.compose_unfinished();
    }
    // A picture ended by its time limit is complete: fill unrendered pixels from the survey.
    let look = shared.state().look.clone();
    let is_whole = stopped && !by_user && composer.fill(look.as_deref());
    let stopped = stopped && !is_whole;
    // Collect times and lessons
    let times = Times { total, survey, preparation, ..composer.times() };
    let learner = shared.learner();
    let (forecast, lessons) = (learner.forecast(), learner.lessons(composer.samples_wanted()));
    let (film, rows, jobs_learnt) =
        (composer.take_film().finished(), composer.rows(), shared.knowledge.experience.jobs());
    Ok(JobReport { film, stopped, failed, rows, times, messages, forecast, jobs_learnt, lessons })
}
