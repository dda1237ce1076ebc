//! Runs a whole job in this process: all agents on one thread, the engine on its own.
//!
//! The only module with threads. It opens no file and no socket, and has its time from the platform. Engines compute on
//! their own threads and report into the mailboxes of the agents; so one thread is enough for all agents, and it sleeps
//! while there is nothing to say.

mod easel;
mod machine;
mod progress;
mod settings;
mod stop;

use std::{
    collections::BTreeMap,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread,
    time::Duration,
};

use bottega_agents::{AgentId, LocalPlatform, Mailbox, Revision, StateMachine, Time, driver::Performer};
use bottega_engines::{CancelSwitch, RenderEngine, Survey};
use bottega_image::{Film, Rect};

use self::easel::Easel;
use self::machine::{Preparation, benchmark};
pub use self::{
    progress::Progress,
    settings::{AGENTS_MAX, JobError, JobSettings},
    stop::StopSwitch,
};
use crate::{
    Analyst, AnalystConfig, FarmAction, FarmAgent, FarmCompletion, FarmContent, FarmEffect, FarmEvent, FarmMessage,
    FarmValue, Goal, GoalRules, ImportanceMap, Kept, Master, MasterConfig, Partition, PartitionSettings, RelativePower,
    RenderAgent, RenderAgentConfig, Timing, WorkId, WorkRow, WorkSettings, ZoneId, ZoneRow, ZoneStore,
};

const WORK: WorkId = WorkId(1);

/// Sees a job go on. All methods are called from the job's threads and must return soon.
pub trait Observer: Send + Sync {
    /// The engine has had a look at the whole picture: the first that there is to see. Not called when a work is resumed.
    fn surveyed(&self, _survey: &Arc<Survey>) {}
    /// The Analyst has made map and zones. Not called when a work is resumed.
    fn analyzed(&self, _map: &Arc<ImportanceMap>, _partition: &Arc<Partition>) {}
    /// A zone's row has changed.
    fn zone_changed(&self, _row: &ZoneRow) {}
    /// Something was painted.
    fn progress(&self, _progress: &Progress) {}
    /// An agent sends a message.
    fn message(&self, _now: Time, _message: &FarmMessage) {}
    /// The job could not be kept: it goes on, but cannot be resumed.
    fn not_kept(&self, _error: &std::io::Error) {}
}

/// An observer that looks away.
impl Observer for () {}

/// What came of a job.
#[derive(Debug)]
pub struct JobReport {
    /// The picture, or what there is of it.
    pub film: Film,
    /// Whether it was stopped before the end.
    pub stopped: bool,
    /// Zones that no agent could paint.
    pub failed: Vec<ZoneId>,
    /// The rows of all zones, by id, as they were last.
    pub rows: Vec<ZoneRow>,
    /// Where the time went.
    pub times: Times,
    /// Messages that agents sent.
    pub messages: u64,
}

impl JobReport {
    /// What bands cost: the share of all painted pixels that lie beyond the zones for which they were painted.
    ///
    /// - `frame`: the pixels of the picture that were painted.
    pub fn band_share(&self, frame: &Rect) -> f64 {
        let painted = |row: &ZoneRow| row.choice.map_or(row.size(), |choice| row.painted(&choice, frame).area());
        let all: u64 = self.rows.iter().map(painted).sum();
        let own: u64 = self.rows.iter().map(ZoneRow::size).sum();
        all.saturating_sub(own) as f64 / all.max(1) as f64
    }
}

/// Where the time of a job went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Times {
    /// Wall time from beginning to end.
    pub total: Duration,
    /// Wall time of the survey.
    pub survey: Duration,
    /// Wall time in which the engine made what all zones need.
    pub preparation: Duration,
    /// Processor time of profiling and painting.
    pub painting: Duration,
    /// Time that composition took.
    pub composition: Duration,
}

/// How a job ended.
#[derive(Clone, Debug)]
enum End {
    Finished(Vec<ZoneId>),
    Abandoned(String),
}

/// What the performers of all agents share.
struct Shared {
    engine: Arc<dyn RenderEngine>,
    observer: Arc<dyn Observer>,
    easel: Mutex<Easel>,
    state: Mutex<State>,
    changed: Condvar,
    stop: StopSwitch,
    processors: usize,
    agents: usize,
}

#[derive(Default)]
struct State {
    end: Option<End>,
    /// Surveys and zones that the engine has not reported.
    outstanding: usize,
    survey: Duration,
    preparation: Preparation,
    /// How long that took.
    preparing: Duration,
    benchmark: Option<RelativePower>,
    messages: u64,
    /// Switches of what the engine is painting.
    orders: BTreeMap<(ZoneId, Revision), CancelSwitch>,
}

type FarmMailbox = Mailbox<Seen>;

/// Runs a job to its end, or until `stop` is requested.
///
/// - `store`: where the job is kept, if at all.
/// - `kept`: what an earlier run of the same job left; it goes on from there.
///
/// With optimization off every pixel has the same bits for any number of agents, any level of partition and any
/// interruption, if the engine says [`exact_by_pixel`](bottega_engines::EngineDescription::exact_by_pixel).
pub fn run(
    settings: &JobSettings,
    engine: Arc<dyn RenderEngine>,
    observer: Arc<dyn Observer>,
    stop: &StopSwitch,
    store: Option<Box<dyn ZoneStore>>,
    kept: Option<Kept>,
) -> Result<JobReport, JobError> {
    let work = settings.work()?;
    let mut kept = kept;
    if let Some(Kept { work: WorkRow { settings, .. }, .. }) = &mut kept {
        // The time begins anew with each run.
        if let (Goal::Time(_), Goal::Time(_)) = (settings.goal, work.goal) {
            settings.goal = work.goal;
        }
        if *settings != work {
            return Err(JobError::OtherWork);
        }
    }
    let (kept, tiles) = match kept {
        Some(Kept { work, rows, tiles }) => (Some((work, rows)), tiles),
        None => (None, Default::default()),
    };
    let shared = Arc::new(Shared {
        easel: Mutex::new(Easel::new(settings, tiles, store)),
        engine,
        observer,
        state: Mutex::default(),
        changed: Condvar::new(),
        stop: stop.clone(),
        processors: settings.processors.max(1),
        agents: settings.agents,
    });
    let platform = LocalPlatform::new(1)?;
    let master = populate(&platform, settings, work, kept, &shared)?;
    let on_stop = Arc::downgrade(&shared);
    stop.when_requested(move || {
        if let Some(shared) = on_stop.upgrade() {
            master.complete(FarmCompletion::Stop);
            shared.engine.cancel();
            shared.changed.notify_all();
        }
    });
    let end = shared.wait();
    stop.forget();
    let total = platform.now().elapsed();
    platform.stop();
    report(&shared, end, total)
}

fn report(shared: &Shared, end: Option<End>, total: Duration) -> Result<JobReport, JobError> {
    let (survey, preparation, messages) = {
        let state = shared.state();
        (state.survey, state.preparing, state.messages)
    };
    let mut easel = shared.easel();
    if let (Some(End::Abandoned(reason)), false) = (&end, shared.stop.is_requested()) {
        return Err(JobError::Abandoned { reason: reason.clone() });
    }
    let (stopped, failed) = match end {
        Some(End::Finished(failed)) => (false, failed),
        _ => (true, Vec::new()),
    };
    if stopped {
        easel.compose_unfinished();
    }
    let times = Times { total, survey, preparation, ..easel.times() };
    Ok(JobReport { film: easel.take_film(), stopped, failed, rows: easel.rows(), times, messages })
}

/// Brings all agents to life. Returns the Master's mailbox.
fn populate(
    platform: &LocalPlatform<Seen>,
    settings: &JobSettings,
    work: WorkSettings,
    kept: Option<(WorkRow, Vec<ZoneRow>)>,
    shared: &Arc<Shared>,
) -> Result<FarmMailbox, JobError> {
    let add = |id: &AgentId, agent: FarmAgent| {
        let seen = Seen { agent, shared: Arc::clone(shared) };
        platform.add(id, seen, performer(id, shared)).map_err(|taken| JobError::Abandoned { reason: taken.to_string() })
    };
    let (master, analyst) = (AgentId::new("master@bottega"), AgentId::new("analyst@bottega"));
    let timing = Timing::default();
    let JobSettings { auction, prefetch, .. } = *settings;
    // All agents have the same processors: an idle one leaves its own to the others.
    let master_config = MasterConfig {
        id: master.clone(),
        work: WORK,
        auction,
        prefetch,
        shares_tail: false,
        goals: GoalRules::default(),
        timing,
    };
    let mailbox = match kept {
        Some((work, rows)) => {
            let config = MasterConfig { work: work.work, ..master_config };
            add(&master, Master::recover(config, work, rows).into())?
        }
        None => {
            let mut partition = PartitionSettings::for_agents(settings.level, settings.agents, work.frame);
            partition.zone_count = settings.zones.unwrap_or(partition.zone_count).max(1);
            let config = AnalystConfig {
                id: analyst.clone(),
                master: master.clone(),
                work: WORK,
                settings: work,
                importance: settings.importance,
                partition,
            };
            add(&analyst, Analyst::new(config).into())?;
            add(&master, Master::new(master_config).into())?
        }
    };
    let engine = shared.engine.describe();
    for (i, expert) in (0..settings.agents).zip(settings.experts.iter().cycle()) {
        let id = AgentId::new(format!("render-{}@bottega", i + 1));
        let agent = RenderAgent::new(RenderAgentConfig {
            id: id.clone(),
            master: master.clone(),
            adaptation: settings.adaptation,
            prefetch,
            heartbeat: timing.heartbeat,
            expert: expert.clone().for_engine(&engine),
        });
        add(&id, agent.into())?;
    }
    Ok(mailbox)
}

/// What an agent of the farm does, with all its messages seen by the observer.
struct Seen {
    agent: FarmAgent,
    shared: Arc<Shared>,
}

impl StateMachine for Seen {
    type Content = FarmContent;
    type Value = FarmValue;
    type Effect = FarmEffect;
    type Completion = FarmCompletion;

    fn handle(&mut self, now: Time, event: FarmEvent, actions: &mut Vec<FarmAction>) {
        let before = actions.len();
        self.agent.handle(now, event, actions);
        for action in &actions[before..] {
            if let FarmAction::Send(message) = action {
                self.shared.state().messages += message.receivers.len() as u64;
                self.shared.observer.message(now, message);
            }
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        self.agent.next_deadline()
    }
}

/// Carries out the effects of one agent. When it goes without the job having ended, the job has: an agent has panicked.
fn performer(id: &AgentId, shared: &Arc<Shared>) -> Performer<Seen> {
    struct Notice(Arc<Shared>, bool);
    impl Drop for Notice {
        fn drop(&mut self) {
            if self.1 || thread::panicking() {
                self.0.end(End::Abandoned("an agent of the farm ended before the work".to_owned()));
            }
        }
    }
    let notice = Notice(Arc::clone(shared), id.name.starts_with("master"));
    Box::new(move |effect, mailbox| notice.0.perform(effect, mailbox))
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn easel(&self) -> MutexGuard<'_, Easel> {
        self.easel.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The first end counts.
    fn end(&self, end: End) {
        self.state().end.get_or_insert(end);
        self.changed.notify_all();
    }

    /// Waits for the end, and for the engine to give back what it has.
    fn wait(&self) -> Option<End> {
        let mut state = self.state();
        while state.outstanding > 0 || state.end.is_none() && !self.stop.is_requested() {
            // The stop switch is not under this lock: look again now and then.
            let woken = self.changed.wait_timeout(state, Duration::from_millis(100));
            state = woken.unwrap_or_else(PoisonError::into_inner).0;
        }
        state.end.clone()
    }

    fn begin_outstanding(&self) {
        self.state().outstanding += 1;
    }

    fn end_outstanding(&self) {
        self.state().outstanding -= 1;
        self.changed.notify_all();
    }

    fn perform(self: &Arc<Self>, effect: FarmEffect, mailbox: &FarmMailbox) {
        match effect {
            FarmEffect::Survey { width, height, .. } => self.survey(width, height, mailbox),
            FarmEffect::Analyzed { map, partition } => self.observer.analyzed(&map, &partition),
            FarmEffect::Benchmark => {
                let power = *self.state().benchmark.get_or_insert_with(|| benchmark(|| mailbox.now()));
                let lanes = self.processors as f64 / self.agents as f64;
                mailbox.complete(FarmCompletion::Benchmarked { power, lanes });
            }
            FarmEffect::Fetch(work) => self.fetch(work, mailbox),
            FarmEffect::Paint(order) => self.paint(order, mailbox),
            FarmEffect::Drop { zone, fence } => self.drop_order(zone, fence),
            FarmEffect::BeginFilm(work) => {
                let kept = self.easel().begin(&work);
                self.tell_kept(kept);
            }
            FarmEffect::ZoneChanged(row) => {
                let (kept, progress) = self.easel().zone_changed(&row, mailbox.now());
                self.tell_kept(kept);
                self.observer.zone_changed(&row);
                self.observer.progress(&progress);
            }
            FarmEffect::Compose { zone, result, mask } => {
                let before = mailbox.now();
                let outcome = self.easel().compose(zone, &result, &mask);
                self.easel().composition_took(mailbox.now() - before);
                mailbox.complete(FarmCompletion::Composed { zone, outcome });
            }
            FarmEffect::Finish { failed } => self.end(End::Finished(failed)),
            FarmEffect::Abandon { reason } => self.end(End::Abandoned(reason)),
        }
    }

    fn tell_kept(&self, kept: std::io::Result<()>) {
        if let Err(error) = kept {
            tracing::warn!(%error, "the work could not be kept");
            self.observer.not_kept(&error);
        }
    }
}
