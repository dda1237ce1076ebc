//! A machine that works for a farm: takes part in the job that needs it most, and leads it if no other process does.

use std::{
    collections::BTreeSet,
    path::PathBuf,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use bottega::{
    StopSwitch,
    devices::{beside_processors, compiling, processors},
};
use bottega_agents::driver::nats::LiveSubscription;
use bottega_engines::external::KeptEngines;
use bottega_platform::folders::state_folder;

pub use crate::machine::prepared_job::WorkerDevices;
use crate::{
    error::Error,
    files::cache::{CACHE_BYTES, Cache},
    job::{
        board::{JobBoard, RENEW_EVERY},
        machines::MachineOrder,
        presence::{Presence, PresenceState, Refusal},
        record::{Job, JobState, PaintingTurn},
    },
    machine::{
        member::Member,
        owner::{MemoryLimit, OwnerConditions, OwnerWatch},
        part::{PartOutcome, take_part},
        prepared_job::PreparedJob,
        shares::{JobClaim, choose, should_move},
        usage_meter::UsageMeter,
        viewport_helper::ViewportHelper,
    },
    server::{
        link::FarmLink,
        patience::{meanwhile, patiently, patiently_until},
    },
    viewport::calls::HeardCalls,
};

/// A message of a worker to its user.
pub enum WorkerMessage<'a> {
    /// A line about its current action.
    Line(&'a str),
    /// The reason why it refuses a job, or does not help a viewport.
    Failure(&'a Error),
}

/// The options of a machine that joins a farm.
#[derive(Clone, Debug, Default)]
pub struct JoinOptions {
    /// The threads and devices to render with.
    pub own: WorkerDevices,
    /// The folder of the scene cache; `None`: the folder `cache` in Bottega's state folder.
    pub cache: Option<PathBuf>,
    /// The size of the cache in bytes; the least recently used files are removed first. `None`: 20 GiB.
    pub cache_bytes: Option<u64>,
    /// `true`: leaves the farm when one job is over.
    pub once: bool,
    /// The owner's conditions for working.
    pub owner: OwnerConditions,
    /// The tags of the machine, which jobs can require.
    pub tags: Vec<String>,
    /// The most memory that this process and the engines it starts may use, in bytes; it leaves a job that needs more. `None`: no
    /// limit.
    pub memory_bytes: Option<u64>,
    /// The power of the machine with all processors busy, in watts; used if its processors have no readable energy counters.
    /// `None`: its energy is then unknown.
    pub watts: Option<f64>,
}

/// Works for a farm until the user stops, a command makes this machine leave, or, with `options.once`, one job is over. Then
/// leaves the farm.
///
/// - `say`: shows messages to the user.
pub fn join(link: FarmLink, options: JoinOptions, stop: &StopSwitch, say: Box<dyn Fn(WorkerMessage<'_>) + Sync>) {
    let FarmLink { uplink, name, .. } = link;
    let JoinOptions { own, cache, cache_bytes, once, owner, tags, memory_bytes, watts } = options;
    let threads = own.threads.map_or_else(processors, usize::from);
    let devices = (threads, beside_processors(&own.devices));
    let member = Member::new(JobBoard { uplink }, name, devices, stop);
    let member = Member { tags, meter: UsageMeter::new(watts), ..member };
    let folder = cache.unwrap_or_else(|| state_folder().join("cache"));
    let cache = Cache::new(folder, cache_bytes.unwrap_or(CACHE_BYTES));
    let mut worker = Worker::new(member, cache, own, None, say);
    worker.owner = OwnerWatch::start(&owner);
    worker.memory = memory_bytes.map(MemoryLimit::new);
    // Guests have no right to the live messages of a farm.
    if !worker.member.board.uplink.is_guest() {
        worker.calls = Some(HeardCalls::listen(worker.member.board.uplink.live()));
    }
    worker.work(once);
    worker.leave();
}

/// Interval between checks for work.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// The time for which a machine stays with a job before it considers another: loading a scene is expensive.
const STAYS: Duration = Duration::from_secs(5);

/// A machine that works for a farm.
pub(crate) struct Worker {
    member: Member,
    cache: Cache,
    own: WorkerDevices,
    /// The last job, whose scene stays loaded.
    prepared: Option<PreparedJob>,
    /// The only jobs to work on, for the process that submitted them, which obeys no commands; none: any job.
    only: Option<BTreeSet<u32>>,
    /// A finished painting, whose picture its leader still has to store.
    helped: Option<PaintingTurn>,
    /// The watch over the owner's conditions, if any.
    owner: Option<OwnerWatch>,
    /// The limit of this machine's memory, if any.
    memory: Option<MemoryLimit>,
    /// The calls of viewports, if this machine helps them.
    calls: Option<(Arc<HeardCalls>, LiveSubscription)>,
    say: Box<dyn Fn(WorkerMessage<'_>) + Sync>,
    /// Lets other engines keep their scene between the frames of an animation.
    _engines: KeptEngines,
}

impl Worker {
    /// Makes a worker of this machine.
    ///
    /// - `cache`: the scene cache.
    /// - `own`: the threads and devices to render with.
    /// - `only`: the only jobs to work on; none: any.
    /// - `say`: shows messages to the user.
    pub(crate) fn new(
        member: Member,
        cache: Cache,
        own: WorkerDevices,
        only: Option<BTreeSet<u32>>,
        say: Box<dyn Fn(WorkerMessage<'_>) + Sync>,
    ) -> Self {
        let _engines = KeptEngines::begin();
        Self {
            member,
            cache,
            own,
            _engines,
            prepared: None,
            only,
            helped: None,
            owner: None,
            memory: None,
            calls: None,
            say,
        }
    }

    /// Leaves the farm.
    pub(crate) fn leave(&self) {
        self.member.board.leave(&self.member.name);
    }

    /// Obeys commands and works, until the user stops or a command makes it leave.
    ///
    /// - `once`: returns when one job is over.
    pub(crate) fn work(&mut self, once: bool) {
        let mut before = PresenceState::Active;
        while !self.member.stop.is_requested() {
            let MachineOrder { standing, by } = order_to(&self.member.board, &self.member.name, self.owner.as_ref());
            if before != standing {
                match standing {
                    PresenceState::Active if by.is_empty() => {
                        (self.say)(WorkerMessage::Line("resumed; waiting for work"));
                    }
                    PresenceState::Active => {
                        (self.say)(WorkerMessage::Line(&format!("resumed by {by}; waiting for work")));
                    }
                    PresenceState::Suspended => (self.say)(WorkerMessage::Line(&format!("suspended by {by}"))),
                    PresenceState::Terminated => (self.say)(WorkerMessage::Line(&format!("terminated by {by}"))),
                }
            }
            before = standing;
            if standing == PresenceState::Suspended {
                self.rest();
            } else if standing == PresenceState::Terminated || self.work_once() && once {
                return;
            }
        }
    }

    /// Pauses for a moment, or until another command.
    fn rest(&mut self) {
        // Free the memory, too.
        self.prepared = None;
        let Member { board, name, stop, .. } = &self.member;
        board.attend(&Presence { standing: PresenceState::Suspended, ..self.member.presence(None) });
        let begun = Instant::now();
        while begun.elapsed() < RENEW_EVERY
            && !stop.is_requested()
            && order_to(board, name, self.owner.as_ref()).standing == PresenceState::Suspended
        {
            thread::sleep(LOOK_EVERY);
        }
    }

    /// Returns a function that is `true` if the command is no longer to work.
    fn is_called_off(&self) -> impl Fn() -> bool + Send + 'static {
        let (board, me, takes_orders) = (self.member.board.clone(), self.member.name.clone(), self.only.is_none());
        let owner = self.owner.clone();
        move || takes_orders && order_to(&board, &me, owner.as_ref()).standing != PresenceState::Active
    }

    /// Returns true if this machine can work on a job.
    fn can_work_on(&self, number: u32, job: &Job) -> bool {
        may(&self.only, &self.member, number, job) && !self.is_done_with(number, job)
    }

    /// Takes part in a job, or waits a moment if there is none. Returns `true` if a job was finished.
    pub(crate) fn work_once(&mut self) -> bool {
        let Member { board, name, .. } = &self.member;
        let others: Vec<Presence> = board.presences().into_iter().filter(|machine| machine.name != *name).collect();
        let waiting = waiting_jobs(board, |number, job| self.can_work_on(number, job));
        let chosen = choose(&waiting, &others).and_then(|number| Some((number, board.get(number)?)));
        // Usage since the last job belongs to no job.
        self.member.meter.count(None);
        let Some((number, job)) = chosen else {
            board.attend(&Presence { takes_orders: self.only.is_none(), ..self.member.presence(None) });
            match self.called_viewport() {
                Some(viewport) => self.help(viewport),
                None => self.wait(),
            }
            return false;
        };
        match self.take_part(number, &job) {
            Ok(is_over) => is_over,
            // The farm did not answer until another command came.
            Err(error) if error.may_pass() => false,
            // A problem with one job is no reason to leave the farm.
            Err(error) => {
                let Member { board, name, refusals, .. } = &self.member;
                let reason = error.error_chain_with_remedy();
                board.log(number, &format!("{name} is left out: {reason}"));
                (self.say)(WorkerMessage::Failure(&error));
                refusals.add(Refusal { job: number, work: job.work, reason });
                board.attend(&Presence { takes_orders: self.only.is_none(), ..self.member.presence(None) });
                true
            }
        }
    }

    /// Returns true if a painting needs no more help, though its job is not over yet.
    fn is_done_with(&self, number: u32, job: &Job) -> bool {
        let is_led = || self.member.board.lead(number).is_some_and(|lead| lead.leader.is_some());
        self.helped == Some(job.turn()) && is_led()
    }

    /// Waits until the presence must be renewed, or until there may be work.
    fn wait(&self) {
        self.member.watch_stalls();
        let (begun, is_called_off) = (Instant::now(), self.is_called_off());
        while begun.elapsed() < RENEW_EVERY && !self.member.stop.is_requested() {
            thread::sleep(LOOK_EVERY);
            let has_job = || !waiting_jobs(&self.member.board, |number, job| self.can_work_on(number, job)).is_empty();
            if is_called_off() || self.called_viewport().is_some() || has_job() {
                return;
            }
        }
    }

    /// Returns a viewport that this machine can help.
    fn called_viewport(&self) -> Option<u64> {
        self.calls.as_ref().and_then(|(calls, _)| calls.open())
    }

    /// Renders samples for a viewport until it is closed, or there is a job.
    fn help(&mut self, viewport: u64) {
        // Free the scene of the last job: two may not fit in memory.
        self.prepared = None;
        let Some((calls, _)) = &self.calls else { return };
        (self.say)(WorkerMessage::Line("rendering samples for a viewport"));
        let is_called_off = self.is_called_off();
        let (board, only, member, memory) = (&self.member.board, &self.only, &self.member, &self.memory);
        let is_wanted_elsewhere = || {
            member.stop.is_requested()
                || is_called_off()
                || memory.as_ref().is_some_and(MemoryLimit::is_passed)
                || !waiting_jobs(board, |number, job| may(only, member, number, job)).is_empty()
        };
        let helper = ViewportHelper { member, cache: &self.cache, own: &self.own, calls, viewport };
        match helper.help(&is_wanted_elsewhere) {
            Ok(()) if memory.as_ref().is_some_and(MemoryLimit::is_passed) => {
                memory.iter().for_each(MemoryLimit::forget);
                calls.refuse(viewport);
            }
            Ok(()) => {}
            Err(error) => {
                calls.refuse(viewport);
                (self.say)(WorkerMessage::Failure(&error));
            }
        }
    }

    fn take_part(&mut self, number: u32, job: &Job) -> Result<bool, Error> {
        let teller = &self.say;
        let say = |line: &str| teller(WorkerMessage::Line(line));
        let Member { board, stop, .. } = &self.member;
        let occupation = self.member.activity.occupy();
        let presence = Presence { takes_orders: self.only.is_none(), ..self.member.presence(Some(number)) };
        // Load the scene, unless it is loaded already
        if self.prepared.as_ref().is_none_or(|prepared| prepared.origin != job.origin) {
            // Free the old scene first: two may not fit in memory.
            self.prepared = None;
            let open = || PreparedJob::open(&self.member, job, &self.cache, &self.own);
            // Renew the presence meanwhile, and report devices that compile kernels.
            let (meter, teller) = (&self.member.meter, &self.say);
            let mut reported = BTreeSet::new();
            let stay_present = || {
                meter.count(Some(job.origin));
                board.attend(&presence);
                for (device, _) in compiling() {
                    if !reported.contains(&device) {
                        teller(WorkerMessage::Line(&format!("{device} compiles its kernels for this scene")));
                        reported.insert(device);
                    }
                }
            };
            let is_enough = || stop.is_requested() || !self.is_wanted(number, job);
            self.prepared = Some(meanwhile(RENEW_EVERY, stay_present, || patiently_until(is_enough, say, open))?);
        }
        // Announce that it takes part.
        board.attend(&presence);
        drop(occupation);
        let Some(prepared) = &self.prepared else { return Ok(false) };
        // Render the job together with the other machines
        let before = prepared.samples_done();
        (self.say)(WorkerMessage::Line(&format!("job {number}: painting {}", job.scene)));
        let part = || take_part(&self.member, number, job, &mut prepared.setup(), self.elsewhere(number));
        let is_enough = || stop.is_requested() || !self.is_wanted(number, job);
        let part = patiently_until(is_enough, say, part)?;
        if let (PartOutcome::Left(_), Some(limit)) = (&part, &self.memory)
            && limit.is_passed()
        {
            // Free the scene before the next job.
            self.prepared = None;
            limit.forget();
            return Err(limit.error());
        }
        // Store the picture, if this machine has led the job
        let is_over = !matches!(part, PartOutcome::Left(_));
        if let PartOutcome::Led(mut report, leading) = part {
            let state = match report.failed.len() {
                0 => {
                    let metadata = prepared.finish(board, (number, job), &mut report);
                    let picture = (&report.film, &metadata);
                    patiently(stop, say, || prepared.keep_picture(board, job, picture, &self.cache))?;
                    JobState::Done
                }
                failed => JobState::Failed { reason: format!("{failed} zones could not be painted") },
            };
            patiently(stop, say, || board.complete(number, leading.work, &state, state == JobState::Done))?;
        } else if is_over {
            self.helped = Some(job.turn());
        }
        let how = if is_over { "done" } else { "left" };
        let samples = (prepared.samples_done() - before) as f64 / 1e6;
        (self.say)(WorkerMessage::Line(&format!("job {number}: {how}, {samples:.1} M samples here")));
        Ok(is_over)
    }

    /// Returns true if a painting is still wanted, and this machine may work on it.
    fn is_wanted(&self, number: u32, job: &Job) -> bool {
        let is_same = |now: Job| now.state == JobState::Active && now.turn() == job.turn();
        self.member.board.get(number).is_some_and(is_same) && !self.is_called_off()()
    }

    /// Returns a function that is `true` if this machine must stop, or another job has too few machines for its priority.
    fn elsewhere(&self, number: u32) -> impl Fn() -> bool + Send + 'static {
        let (board, me) = (self.member.board.clone(), self.member.name.clone());
        let (only, member, memory) = (self.only.clone(), self.member.clone(), self.memory.clone());
        let (begun, is_called_off) = (Instant::now(), self.is_called_off());
        move || {
            let waiting = || waiting_jobs(&board, |number, job| may(&only, &member, number, job));
            memory.as_ref().is_some_and(MemoryLimit::is_passed)
                || is_called_off()
                || begun.elapsed() > STAYS && should_move(&me, number, &waiting(), &board.presences())
        }
    }
}

/// Returns the command to a machine; if it is to work, its owner may suspend it.
fn order_to(board: &JobBoard, me: &str, owner: Option<&OwnerWatch>) -> MachineOrder {
    let order = board.order_to(me);
    match owner.and_then(OwnerWatch::reason) {
        Some(reason) if order.standing == PresenceState::Active => {
            MachineOrder { standing: PresenceState::Suspended, by: format!("its owner: {reason}") }
        }
        _ => order,
    }
}

fn may(only: &Option<BTreeSet<u32>>, member: &Member, number: u32, job: &Job) -> bool {
    let is_meant = match only {
        Some(only) => only.contains(&number),
        None => job.require.iter().all(|tag| member.tags.contains(tag)),
    };
    is_meant && !member.refusals.has(job.work)
}

/// Returns the jobs that need machines.
fn waiting_jobs(board: &JobBoard, is_wanted: impl Fn(u32, &Job) -> bool) -> Vec<JobClaim> {
    let jobs = board.all().into_iter();
    let is_led = |number: u32| board.lead(number).is_some_and(|lead| lead.leader.is_some());
    // A guest cannot lead: it needs a leader.
    let is_possible = |number: u32| !board.uplink.is_guest() || is_led(number);
    let active =
        jobs.filter(|(number, job)| job.state == JobState::Active && is_wanted(*number, job) && is_possible(*number));
    active.map(|(number, job)| JobClaim { number, priority: job.priority }).collect()
}
