//! The state shared by the threads of a job: engine, pixels, progress.

use std::{
    collections::BTreeMap,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use bottega_agents::{AclMessage, Mailbox, Revision, Time};
use bottega_engines::{CancelSwitch, RenderEngine, Survey, TaskProgress};

use super::{
    composer::Composer,
    fetchers::Fetchers,
    job_agent::{JobAgent, JobWatch},
    learner::Learner,
    link::Link,
    observer::Observer,
    settings::JobSettings,
    stop::StopSwitch,
    transport::JobUplink,
};
use crate::{FarmContent, Foreknowledge, WorkId, ZoneId};

/// Intervals between checks: at the end, if the engine has returned its work; and before, for events without a notification.
const LOOK_EVERY: Duration = Duration::from_millis(100);
const LOOK_SELDOM: Duration = Duration::from_secs(2);
/// Interval between checks if there is an image to show once the time is up.
const LOOK_OFTEN: Duration = Duration::from_millis(5);
/// The most checks at the end if the engine has returned its work.
const LOOKS_MAX: u32 = 100;

/// The end of a job.
#[derive(Clone, Debug)]
pub(super) enum End {
    Finished(Vec<ZoneId>),
    Abandoned(String),
    /// The Master of another process has excluded all agents of this one.
    LeftOut(String),
}

/// The state shared by the performers of all agents.
pub(super) struct Shared {
    pub(super) engine: Arc<dyn RenderEngine>,
    pub(super) observer: Arc<dyn Observer>,
    pub(super) composer: Mutex<Composer>,
    pub(super) state: Mutex<State>,
    pub(super) changed: Condvar,
    pub(super) stop: StopSwitch,
    pub(super) processors: usize,
    /// Clock time per processor time of this machine at the start of the job, because of other programs.
    pub(super) load: f64,
    pub(super) agents: usize,
    /// The connection to the other machines of the work; none: there are no others.
    pub(super) link: Option<Link>,
    pub(super) fetchers: Fetchers,
    /// The data from which this machine predicts zone times.
    pub(super) knowledge: Foreknowledge,
    learner: Mutex<Learner>,
}

/// The part of the shared state under one lock.
#[derive(Default)]
pub(super) struct State {
    pub(super) end: Option<End>,
    /// Surveys, preparations and zones that the engine has not reported yet.
    pub(super) outstanding: usize,
    /// The number of surveys and preparations among these, whose results are not needed once the work is stopped.
    pub(super) preparations: usize,
    /// The survey of the picture.
    pub(super) look: Option<Arc<Survey>>,
    pub(super) survey: Duration,
    pub(super) preparation: Preparation,
    /// The time that the preparation took.
    pub(super) preparing: Duration,
    pub(super) messages: u64,
    /// The running orders of the engine: the switch to cancel each, and its progress.
    pub(super) orders: BTreeMap<(ZoneId, Revision), (CancelSwitch, TaskProgress)>,
    /// The number of agents here for a Master elsewhere.
    pub(super) present: usize,
    /// The number of these agents that the Master has excluded.
    pub(super) dismissed: usize,
}

pub(super) type FarmMailbox = Mailbox<JobAgent>;

/// The state of the engine's preparation for all zones.
#[derive(Default)]
pub(super) enum Preparation {
    #[default]
    NotBegun,
    /// The preparation is in progress; holds the agents that wait for it.
    UnderWay(Vec<(WorkId, FarmMailbox)>),
    Done,
}

impl JobWatch for Shared {
    fn heard(&self, now: Time, message: &AclMessage<FarmContent>) {
        if let FarmContent::Report(report) = &message.content {
            self.learner().hear(report);
        }
        self.observer.heard(now, message);
    }

    fn said(&self, now: Time, message: &AclMessage<FarmContent>) {
        // Messages to the directories do not count.
        let counts = !matches!(message.content, FarmContent::Management(_));
        self.state().messages += if counts { message.receivers.len() as u64 } else { 0 };
        self.observer.message(now, message);
    }
}

impl Shared {
    /// Returns the state of a job at its start.
    pub(super) fn new(
        settings: &JobSettings,
        composer: Composer,
        engine: Arc<dyn RenderEngine>,
        observer: Arc<dyn Observer>,
        stop: &StopSwitch,
        link: Option<Link>,
    ) -> Self {
        let knowledge = Foreknowledge {
            experience: Arc::clone(&settings.experience),
            of_farm: Arc::clone(&settings.experience_of_farm),
            technique: Arc::clone(&settings.technique),
            subject: settings.subject.clone(),
            benchmark: settings.benchmark.power,
        };
        Self {
            composer: Mutex::new(composer),
            engine,
            observer,
            state: Mutex::default(),
            changed: Condvar::new(),
            stop: stop.clone(),
            processors: settings.processors.max(1),
            load: settings.benchmark.load,
            agents: settings.agents,
            link,
            fetchers: Fetchers::default(),
            learner: Mutex::new(Learner::new(&settings.technique, &settings.subject)),
            knowledge,
        }
    }

    /// Returns the uplink for the agents of this process, with the directories of the platform.
    pub(super) fn uplink(&self) -> std::io::Result<Option<Arc<dyn JobUplink>>> {
        self.link.as_ref().map(|link| link.transport.begin(&link.name)).transpose()
    }

    /// Locks the state.
    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Locks the learner.
    pub(super) fn learner(&self) -> MutexGuard<'_, Learner> {
        self.learner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Locks the pixels.
    pub(super) fn composer(&self) -> MutexGuard<'_, Composer> {
        self.composer.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends the job. Only the first call counts.
    pub(super) fn end(&self, end: End) {
        self.state().end.get_or_insert(end);
        self.changed.notify_all();
    }

    /// Waits for the end of the job, and for the engine to return its work; once all zones are finished, not for an engine
    /// that hangs. When the time is up, stops the work as soon as each pixel has an image.
    ///
    /// - `time_left`: the rest of the time limit; `None`: there is none.
    pub(super) fn wait(&self, time_left: impl Fn() -> Option<Duration>) -> Option<End> {
        let mut state = self.state();
        let mut looks = 0;
        loop {
            // Stop waiting at the end, once the engine has returned its work
            let is_stopped = self.stop.is_requested();
            // A preparation shared with other machines ends with their link.
            let is_left = is_stopped && self.link.is_none();
            let awaited = state.outstanding - if is_left { state.preparations } else { 0 };
            if awaited == 0 && (state.end.is_some() || is_stopped) {
                break;
            }
            // A stop or an end notifies the condition variable.
            let mut time = if state.end.is_some() || is_stopped { LOOK_EVERY } else { LOOK_SELDOM };
            // Stop the work when its time is up
            if let Some(left) = time_left().filter(|_| state.end.is_none() && !is_stopped) {
                if left.is_zero() {
                    let has_look = state.look.is_some();
                    drop(state);
                    let is_time = has_look || self.composer().has_all();
                    if is_time {
                        self.stop.request();
                    }
                    state = self.state();
                    if is_time {
                        continue;
                    }
                }
                time = time.min(left.max(LOOK_OFTEN));
            }
            // Wait for a change, and give up on an engine that hangs
            let (woken, result) = self.changed.wait_timeout(state, time).unwrap_or_else(PoisonError::into_inner);
            state = woken;
            looks += u32::from(result.timed_out() && state.end.is_some());
            if looks >= LOOKS_MAX {
                tracing::warn!(outstanding = state.outstanding, "the engine does not give back what it has");
                break;
            }
        }
        state.end.clone()
    }

    /// Counts an operation as started.
    pub(super) fn begin_outstanding(&self) {
        let count = {
            let mut state = self.state();
            state.outstanding += 1;
            state.outstanding
        };
        self.observer.under_way(count);
    }

    /// Counts a survey or a preparation as started.
    pub(super) fn begin_preparation(&self) {
        self.begin_outstanding();
        // Afterwards, so that `preparations` never exceeds `outstanding`.
        self.state().preparations += 1;
    }

    /// Counts a survey or a preparation as ended.
    pub(super) fn end_preparation(&self) {
        self.state().preparations -= 1;
        self.end_outstanding();
    }

    /// Counts an operation as ended.
    pub(super) fn end_outstanding(&self) {
        let count = {
            let mut state = self.state();
            state.outstanding -= 1;
            state.outstanding
        };
        self.changed.notify_all();
        self.observer.under_way(count);
    }

    /// Records that the Master has excluded an agent of this process. Once it has excluded all agents that work for a
    /// Master elsewhere, this process leaves the work; a process that leads continues with others.
    pub(super) fn dismissed(&self, reason: String) {
        tracing::warn!(reason, "the Master has left an agent out");
        let all_out = {
            let mut state = self.state();
            state.dismissed += 1;
            state.present > 0 && state.dismissed >= state.present
        };
        if all_out {
            self.end(End::LeftOut(reason));
        }
    }
}
