//! The state that the threads of a job share: the engine, the easel, the progress.

use std::{
    collections::BTreeMap,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use bottega_agents::{AclMessage, Mailbox, Revision, Time};
use bottega_engines::{CancelSwitch, RenderEngine, TaskProgress};

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
    /// Surveys and zones that the engine has not reported.
    pub(super) outstanding: usize,
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

    /// Waits for the end, and for the engine to give back what it has; when all is painted, not for one that hangs.
    pub(super) fn wait(&self) -> Option<End> {
        let mut state = self.state();
        let mut looks = 0;
        while state.outstanding > 0 || state.end.is_none() && !self.stop.is_requested() {
            // Who presses the stop switch tells of it.
            let time = if state.end.is_some() || self.stop.is_requested() { LOOK_EVERY } else { LOOK_SELDOM };
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
