//! Runs a whole job in this process: all agents on one thread, the engine on its own.
//!
//! The only module with threads. It opens no file and no socket, and has its time from the platform. Engines compute on
//! their own threads and report into the mailboxes of the agents; so one thread is enough for all agents, and it sleeps
//! while there is nothing to say.

mod assist;
mod easel;
mod fetchers;
mod link;
mod machine;
mod observer;
mod progress;
mod settings;
mod stop;

use std::{
    collections::BTreeMap,
    hash::{BuildHasher, Hasher, RandomState},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread,
    time::Duration,
};

use bottega_agents::{AgentId, LocalPlatform, Mailbox, Revision, StateMachine, Time, Uplink, driver::Performer};
use bottega_engines::{CancelSwitch, RenderEngine, TaskProgress};
use bottega_image::{Film, Rect, Tile};

use self::easel::Easel;
use self::fetchers::Fetchers;
use self::machine::{Preparation, benchmark};
pub use self::{
    assist::assist,
    link::Link,
    observer::Observer,
    progress::Progress,
    settings::{AGENTS_MAX, JobError, JobSettings, VERIFY_MAX},
    stop::StopSwitch,
};
use crate::{
    Analyst, AnalystConfig, FarmAction, FarmAgent, FarmCompletion, FarmContent, FarmEffect, FarmEvent, FarmValue, Goal,
    GoalRules, Kept, Mask, Master, MasterConfig, PartitionSettings, RelativePower, RenderAgent, RenderAgentConfig,
    ResultRef, Timing, WorkId, WorkRow, WorkSettings, ZoneId, ZoneRow, ZoneStore,
};

const WORK: WorkId = WorkId(1);
/// How often is looked at the end whether the engine gives back what it has, and before it for what nobody tells of.
const LOOK_EVERY: Duration = Duration::from_millis(100);
const LOOK_SELDOM: Duration = Duration::from_secs(2);
/// So often is looked at the end whether the engine gives back what it has.
const LOOKS_MAX: u32 = 100;
/// Machines go without a word, processes hardly.
const AMONG_MACHINES: Timing = Timing {
    bids: Duration::from_millis(500),
    heartbeat: Duration::from_millis(500),
    lease: Duration::from_millis(2500),
};
/// For so many agents a picture is cut where others may join.
const AGENTS_EXPECTED: usize = 8;

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
    /// The Master elsewhere wants nothing of the agents here.
    LeftOut(String),
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
    /// To the other machines that paint the work.
    link: Option<Link>,
    fetchers: Fetchers,
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
    /// What the engine is painting: how to end it, and how far it is.
    orders: BTreeMap<(ZoneId, Revision), (CancelSwitch, TaskProgress)>,
    /// Agents that live here, in the work of a Master elsewhere.
    present: usize,
    /// Agents of these that the Master has left out.
    dismissed: usize,
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
    lead(settings, engine, observer, stop, store, kept, None)
}

/// The same with the other machines to which `link` leads, if it is given: agents elsewhere join by [`assist`].
///
/// What another process has led so far is on the blackboard: this one goes on from there. When the picture is safe, the
/// blackboard is to be cleared: [`Link::forget`].
pub fn lead(
    settings: &JobSettings,
    engine: Arc<dyn RenderEngine>,
    observer: Arc<dyn Observer>,
    stop: &StopSwitch,
    store: Option<Box<dyn ZoneStore>>,
    kept: Option<Kept>,
    link: Option<Link>,
) -> Result<JobReport, JobError> {
    let work = settings.work()?;
    if settings.verify > 1 && link.is_none() {
        return Err(JobError::Verify { reason: "the agents of one process have the same engine" });
    }
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
        Some(Kept { mut work, mut rows, tiles }) => {
            // What an earlier run left on the blackboard of a farm is not gone on with: the number is another one.
            if let Some(link) = &link {
                work.work = link.work;
                rows.iter_mut().for_each(|row| row.work = link.work);
            }
            (Some((work, rows)), tiles)
        }
        None => (None, Default::default()),
    };
    let easel = Easel::new(settings, tiles, store);
    let shared = Arc::new(Shared::new(settings, easel, engine, observer, stop, link));
    let platform = LocalPlatform::linked(1, shared.uplink())?;
    let master = populate(&platform, settings, work, kept, &shared)?;
    let on_stop = Arc::downgrade(&shared);
    stop.when_requested(move || {
        if let Some(shared) = on_stop.upgrade() {
            master.complete(FarmCompletion::Stop);
            shared.cancel_orders();
        }
    });
    let end = shared.wait();
    stop.forget();
    let total = platform.now().elapsed();
    platform.stop();
    if let Some(link) = &shared.link {
        // The last words of the Master let the others go.
        link.uplink.flush();
    }
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
    let link = shared.link.as_ref();
    let here = link.map_or("bottega", |link| &link.name);
    let number = link.map_or(WORK, |link| link.work);
    let master = link.map_or_else(|| AgentId::new("master@bottega"), Link::master);
    let analyst = AgentId::new(format!("analyst@{here}"));
    let timing = link.map_or_else(Timing::default, |_| AMONG_MACHINES);
    let JobSettings { auction, prefetch, .. } = *settings;
    // Agents of one process have the same processors: an idle one leaves its own to the others.
    let master_config = MasterConfig {
        id: master.clone(),
        work: number,
        auction,
        prefetch,
        shares_tail: link.is_some(),
        verify: settings.verify,
        compares_by_look: !shared.engine.describe().exact_by_pixel,
        secret: secret(),
        goals: GoalRules::default(),
        timing,
    };
    let mailbox = match kept {
        Some((work, rows)) => {
            let config = MasterConfig { work: work.work, ..master_config };
            add(&master, Master::recover(config, work, rows).into())?
        }
        None => {
            // Nobody knows how many will come from elsewhere; and whoever leads cuts the same zones.
            let agents = link.map_or(settings.agents, |_| AGENTS_EXPECTED);
            let mut partition = PartitionSettings::for_agents(settings.level, agents, work.frame);
            partition.zone_count = settings.zones.unwrap_or(partition.zone_count).max(1);
            let config = AnalystConfig {
                id: analyst.clone(),
                master: master.clone(),
                work: number,
                settings: work,
                importance: settings.importance,
                partition,
            };
            add(&analyst, Analyst::new(config).into())?;
            add(&master, Master::new(master_config).into())?
        }
    };
    add_render_agents(settings, &master, here, shared, &add)?;
    Ok(mailbox)
}

/// A number that nobody can guess.
fn secret() -> u64 {
    // Made of random bytes of the operating system.
    RandomState::new().build_hasher().finish()
}

/// Brings the Render Agents of this process to life, who work for `master`.
fn add_render_agents(
    settings: &JobSettings,
    master: &AgentId,
    here: &str,
    shared: &Arc<Shared>,
    add: &dyn Fn(&AgentId, FarmAgent) -> Result<FarmMailbox, JobError>,
) -> Result<(), JobError> {
    let engine = shared.engine.describe();
    for (i, expert) in (0..settings.agents).zip(settings.experts.iter().cycle()) {
        let id = AgentId::new(format!("render-{}@{here}", i + 1));
        let agent = RenderAgent::new(RenderAgentConfig {
            id: id.clone(),
            master: master.clone(),
            adaptation: settings.adaptation,
            prefetch: settings.prefetch,
            heartbeat: shared.link.as_ref().map_or_else(Timing::default, |_| AMONG_MACHINES).heartbeat,
            expert: expert.clone().for_engine(&engine).choosing(settings.engine_choice.clone()),
        });
        add(&id, agent.into())?;
    }
    Ok(())
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
        if let FarmEvent::Message(message) = &event {
            self.shared.observer.heard(now, message);
        }
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
    let notice = Notice(Arc::clone(shared), id.name.starts_with("master@"));
    Box::new(move |effect, mailbox| notice.0.perform(effect, mailbox))
}

impl Shared {
    fn new(
        settings: &JobSettings,
        easel: Easel,
        engine: Arc<dyn RenderEngine>,
        observer: Arc<dyn Observer>,
        stop: &StopSwitch,
        link: Option<Link>,
    ) -> Self {
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
        }
    }

    fn uplink(&self) -> Option<Arc<dyn Uplink<Seen>>> {
        self.link.as_ref().map(|link| Arc::clone(&link.uplink) as _)
    }

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

    /// Waits for the end, and for the engine to give back what it has; when all is painted, not for one that hangs.
    fn wait(&self) -> Option<End> {
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
            FarmEffect::Look(orders) => mailbox.complete(FarmCompletion::Looked(self.look(&orders))),
            FarmEffect::Dismissed { reason } => self.dismissed(reason),
            FarmEffect::LeftOut { agent, reason } => self.observer.left_out(&agent, &reason),
            FarmEffect::TooFew { present, needed } => self.observer.too_few(present, needed),
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
            FarmEffect::AgentChanged(row) => self.observer.agent_changed(&row),
            FarmEffect::Compare { zone, results } => self.compare(zone, results, mailbox),
            FarmEffect::Compose { zone, result, mask } => {
                let shared = Arc::clone(self);
                let to = mailbox.clone();
                self.with_tile(zone, result, move |found| shared.compose(zone, &result, &mask, found, &to));
            }
            FarmEffect::Finish { failed } => self.end(End::Finished(failed)),
            FarmEffect::Abandon { reason } => self.end(End::Abandoned(reason)),
        }
    }

    /// Looks at two paintings of a zone, when both are here.
    fn compare(self: &Arc<Self>, zone: ZoneId, results: [ResultRef; 2], mailbox: &FarmMailbox) {
        self.begin_outstanding();
        let (shared, to) = (Arc::clone(self), mailbox.clone());
        let look = move || {
            let outcome = results.each_ref().map(|result| shared.tile_of(zone, result));
            let outcome = match outcome {
                [Ok(one), Ok(other)] => Ok(one.looks_like(&other)),
                [Err(reason), _] | [_, Err(reason)] if shared.stop.is_requested() => {
                    tracing::debug!(reason, "stopped before two paintings were compared");
                    return shared.end_outstanding();
                }
                [one, _] => Err(results[usize::from(one.is_ok())]),
            };
            to.complete(FarmCompletion::Compared { zone, results, outcome });
            shared.end_outstanding();
        };
        if let Err(error) = self.fetchers.begin(look) {
            self.end_outstanding();
            self.end(End::Abandoned(format!("cannot start a thread: {error}")));
        }
    }

    /// The tile that a result speaks of, wherever it is.
    fn tile_of(&self, zone: ZoneId, result: &ResultRef) -> Result<Tile, String> {
        let here = self.easel().tile(zone, result);
        let link = self.link.as_ref().ok_or("its tile is not here");
        here.map_or_else(|| link?.get(result, &self.stop), Ok)
    }

    fn compose(&self, zone: ZoneId, result: &ResultRef, mask: &Mask, found: Result<(), String>, mailbox: &FarmMailbox) {
        let before = mailbox.now();
        let outcome = found.and_then(|()| self.easel().compose(zone, result, mask));
        self.easel().composition_took(mailbox.now() - before);
        mailbox.complete(FarmCompletion::Composed { zone, outcome });
    }

    /// Does something with a zone's tile on the easel: at once where it is there already, else when it has come from the
    /// machine that painted it.
    fn with_tile(
        self: &Arc<Self>,
        zone: ZoneId,
        result: ResultRef,
        then: impl FnOnce(Result<(), String>) + Send + 'static,
    ) {
        let Some(link) = self.link.clone().filter(|_| !self.easel().has(zone, &result)) else { return then(Ok(())) };
        self.begin_outstanding();
        let shared = Arc::clone(self);
        let fetch = move || {
            let found = link.get(&result, &shared.stop).map(|tile| {
                let kept = shared.easel().take_in(zone, &result, tile);
                shared.tell_kept(kept);
            });
            then(found);
            shared.end_outstanding();
        };
        if let Err(error) = self.fetchers.begin(fetch) {
            self.end_outstanding();
            self.end(End::Abandoned(format!("cannot start a thread: {error}")));
        }
    }

    fn tell_kept(&self, kept: std::io::Result<()>) {
        if let Err(error) = kept {
            tracing::warn!(%error, "the work could not be kept");
            self.observer.not_kept(&error);
        }
    }
}
