//! The state that the threads of a job share: the engine, the easel, the progress.

use std::{
    collections::BTreeMap,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use bottega_agents::{AclMessage, Mailbox, Revision, Time};
use bottega_engines::{CancelSwitch, RenderEngine, Survey, TaskProgress};

use super::{
    easel::Composer,
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

/// How often is looked at the end whether the engine gives back what it has, and before it for what nobody tells of.
const LOOK_EVERY: Duration = Duration::from_millis(100);
const LOOK_SELDOM: Duration = Duration::from_secs(2);
/// How often is looked whether there is something to show when the time is up.
const LOOK_OFTEN: Duration = Duration::from_millis(5);
/// So often is looked at the end whether the engine gives back what it has.
const LOOKS_MAX: u32 = 100;

/// How a job ended.
#[derive(Clone, Debug)]
pub(super) enum End {
    Finished(Vec<ZoneId>),
    Abandoned(String),
    /// The Master elsewhere wants nothing of the agents here.
    LeftOut(String),
}

/// What the performers of all agents share.
pub(super) struct Shared {
    pub(super) engine: Arc<dyn RenderEngine>,
    pub(super) observer: Arc<dyn Observer>,
    pub(super) easel: Mutex<Composer>,
    pub(super) state: Mutex<State>,
    pub(super) changed: Condvar,
    pub(super) stop: StopSwitch,
    pub(super) processors: usize,
    pub(super) agents: usize,
    /// To the other machines that paint the work.
    pub(super) link: Option<Link>,
    pub(super) fetchers: Fetchers,
    /// What this machine knows of how long zones take.
    pub(super) knowledge: Foreknowledge,
    learner: Mutex<Learner>,
}

#[derive(Default)]
pub(super) struct State {
    pub(super) end: Option<End>,
    /// Surveys, preparations and zones that the engine has not reported.
    pub(super) outstanding: usize,
    /// How many of these are surveys and preparations, of which nothing is kept when the work is stopped.
    pub(super) preparations: usize,
    /// What the whole picture looks like, coarsely.
    pub(super) look: Option<Arc<Survey>>,
    pub(super) survey: Duration,
    pub(super) preparation: Preparation,
    /// How long that took.
    pub(super) preparing: Duration,
    pub(super) messages: u64,
    /// What the engine is painting: how to end it, and how far it is.
    pub(super) orders: BTreeMap<(ZoneId, Revision), (CancelSwitch, TaskProgress)>,
    /// Agents that live here, in the work of a Master elsewhere.
    pub(super) present: usize,
    /// Agents of these that the Master has left out.
    pub(super) dismissed: usize,
}

pub(super) type FarmMailbox = Mailbox<JobAgent>;

/// Whether the engine has made what all zones need.
#[derive(Default)]
pub(super) enum Preparation {
    #[default]
    NotBegun,
    /// Agents that wait for it.
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
        // What is said to the directories is no part of painting.
        let counts = !matches!(message.content, FarmContent::Management(_));
        self.state().messages += if counts { message.receivers.len() as u64 } else { 0 };
        self.observer.message(now, message);
    }
}

impl Shared {
    pub(super) fn new(
        settings: &JobSettings,
        easel: Composer,
        engine: Arc<dyn RenderEngine>,
        observer: Arc<dyn Observer>,
        stop: &StopSwitch,
        link: Option<Link>,
    ) -> Self {
        let knowledge = Foreknowledge {
            experience: Arc::clone(&settings.experience),
            technique: Arc::clone(&settings.technique),
            benchmark: settings.benchmark,
        };
        Self {
            easel: Mutex::new(easel),
            engine,
            observer,
            state: Mutex::default(),
            changed: Condvar::new(),
            stop: stop.clone(),
            processors: settings.processors.max(1),
            agents: settings.agents,
            link,
            fetchers: Fetchers::default(),
            learner: Mutex::new(Learner::new(&settings.technique)),
            knowledge,
        }
    }

    /// The link for the agents of this process, with the pages of the platform.
    pub(super) fn uplink(&self) -> std::io::Result<Option<Arc<dyn JobUplink>>> {
        self.link.as_ref().map(|link| link.transport.begin(&link.name)).transpose()
    }

    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn learner(&self) -> MutexGuard<'_, Learner> {
        self.learner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn easel(&self) -> MutexGuard<'_, Composer> {
        self.easel.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The first end counts.
    pub(super) fn end(&self, end: End) {
        self.state().end.get_or_insert(end);
        self.changed.notify_all();
    }

    /// Waits for the end, and for the engine to give back what it has; when all is painted, not for one that hangs. When the time is
    /// up the work is stopped, as soon as there is something to show of each pixel.
    ///
    /// - `time_left`: of the time that was asked for, if one was.
    pub(super) fn wait(&self, time_left: impl Fn() -> Option<Duration>) -> Option<End> {
        let mut state = self.state();
        let mut looks = 0;
        loop {
            let is_stopped = self.stop.is_requested();
            // What others help to prepare ends with the link to them.
            let is_left = is_stopped && self.link.is_none();
            let awaited = state.outstanding - if is_left { state.preparations } else { 0 };
            if awaited == 0 && (state.end.is_some() || is_stopped) {
                break;
            }
            // Who presses the stop switch tells of it.
            let mut time = if state.end.is_some() || is_stopped { LOOK_EVERY } else { LOOK_SELDOM };
            if let Some(left) = time_left().filter(|_| state.end.is_none() && !is_stopped) {
                if left.is_zero() {
                    let has_look = state.look.is_some();
                    drop(state);
                    let is_time = has_look || self.easel().has_all();
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

    pub(super) fn begin_outstanding(&self) {
        let count = {
            let mut state = self.state();
            state.outstanding += 1;
            state.outstanding
        };
        self.observer.under_way(count);
    }

    /// A survey or a preparation begins.
    pub(super) fn begin_preparation(&self) {
        self.begin_outstanding();
        // After that: there are never more of them than of all.
        self.state().preparations += 1;
    }

    pub(super) fn end_preparation(&self) {
        self.state().preparations -= 1;
        self.end_outstanding();
    }

    pub(super) fn end_outstanding(&self) {
        let count = {
            let mut state = self.state();
            state.outstanding -= 1;
            state.outstanding
        };
        self.changed.notify_all();
        self.observer.under_way(count);
    }

    /// The Master has left an agent of this process out. When it has left out all who paint for a Master elsewhere, this
    /// process has no part in the work any more; one that leads goes on with others.
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
