//! The part of this process in a job: leads it if no other process does, and else renders for its leader.

use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use bottega::session::PaintingSetup;
use bottega_engines::RenderEngine;
use bottega_farm::{Goal, JobReport, JobSettings, StopSwitch, WorkId};
use bottega_image::Canvas;

use crate::{
    error::Error,
    job::{
        activity::Occupation,
        board::{JobBoard, Lead, Lease, RENEW_EVERY},
        experience::taught,
        first_look::FirstLook,
        presence::Presence,
        record::{Job, JobState, PaintingTurn},
        refusals::RefusalWatch,
        society::SeenSociety,
        transport::job_link,
    },
    machine::{member::Member, part_observer::LoggingObserver, together::JobPeers},
};

/// Interval between checks for a stop or another command.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// The outcome of a part in a job.
pub(crate) enum PartOutcome {
    /// This process led the job to its end. It keeps the lead until the picture is stored.
    Led(Box<JobReport>, Leading),
    /// The leader has dismissed this process: all zones are painted.
    Helped,
    /// Stopped early by the user or a command; with the report if it led.
    Left(Option<Box<JobReport>>),
}

/// Takes part in a job until it is finished or stopped.
///
/// - `elsewhere`: returns `true` if another job needs this process; polled.
pub(crate) fn take_part(
    member: &Member,
    number: u32,
    job: &Job,
    setup: &mut PaintingSetup,
    elsewhere: impl Fn() -> bool + Send + 'static,
) -> Result<PartOutcome, Error> {
    let Member { board, name, activity, .. } = member;
    let occupation = activity.occupy();
    // Learn first: it may take longer than a lease lasts.
    learn_from_others(board, job, &*setup.engine)?;
    // Claim the lead
    let lease = board.claim(number, job.work, name)?;
    let leads = lease.is_some();
    let is_submitter = job.from == *name;
    if leads {
        board.log(number, &format!("{name} leads"));
    }
    let this = StopSwitch::new();
    // Observe the job, and renew lease and presence on another thread
    let observer = Arc::new(LoggingObserver {
        inner: Arc::clone(&setup.observer),
        work: job.work,
        activity: activity.clone(),
        progress: Mutex::default(),
        lacks_machines: AtomicBool::default(),
        seen: AtomicBool::default(),
        log: Mutex::default(),
        master: Mutex::default(),
        settled: Mutex::default(),
        society: Mutex::new(SeenSociety::after(board.society(number))),
        importance: Mutex::default(),
        recorder: Arc::default(),
    });
    let guard = Guard {
        member: member.clone(),
        number,
        work: job.work,
        origin: job.origin,
        turn: job.turn(),
        is_submitter,
        lease,
        has_claimed: false,
        this: this.clone(),
        observer: Arc::clone(&observer),
        learner: Some(Arc::clone(&setup.engine)),
        elsewhere: Box::new(elsewhere),
        over: Arc::default(),
        is_silent: false,
        watch: RefusalWatch::default(),
    };
    let watch = PartWatch::begin(guard)?;
    // Render the first look, and share the preparation with other machines
    let begun = Instant::now();
    if leads && let Some(look) = FirstLook::take(&setup.settings, &*setup.engine) {
        observer.seen.store(board.keep_first_look(job.work, &look), Ordering::Relaxed);
    }
    prepare_together(member, number, job, setup, &this);
    let prepared = begun.elapsed();
    if this.is_requested() {
        return Ok(PartOutcome::Left(None));
    }
    // Render zones, as the leader or for it
    let link = job_link(Arc::clone(&board.uplink), WorkId(job.work), Some(number), name.clone());
    let settings = JobSettings {
        experience: board.own_experience(name),
        experience_of_farm: Arc::new(board.experience_of_farm()),
        ..with_less_time(&setup.settings, prepared)
    };
    let (settings, engine) = (&settings, Arc::clone(&setup.engine));
    // From here on the process counts as busy only while zones are in progress.
    drop(occupation);
    if leads {
        let settings = &JobSettings { credits: board.credits(), ..settings.clone() };
        let (store, kept) = (setup.store.take(), setup.kept.take());
        let leading = Arc::clone(&observer);
        let report = bottega_farm::lead(settings, engine, observer, &this, store, kept, Some(link));
        activity.under_way(0);
        // Break the cycle: the Master refers to the agents, and they to this observer.
        *leading.master.lock().unwrap_or_else(PoisonError::into_inner) = None;
        let mut report = Box::new(report.map_err(Error::job)?);
        board.keep_lessons(&report.lessons);
        if let Some(line) = taught(&report) {
            board.log(number, &line);
        }
        report.times.total += prepared;
        report.times.preparation += prepared;
        return Ok(if report.stopped {
            PartOutcome::Left(Some(report))
        } else {
            // Stay busy until the picture is stored.
            PartOutcome::Led(report, Leading { work: job.work, _occupation: activity.occupy(), _watch: watch })
        });
    }
    let helped = bottega_farm::assist(settings, engine, observer, &this, link);
    activity.under_way(0);
    let helped = helped.map_err(Error::job)?;
    Ok(if helped { PartOutcome::Helped } else { PartOutcome::Left(None) })
}

/// Returns the settings with less time, if the goal is a time.
fn with_less_time(settings: &JobSettings, spent: Duration) -> JobSettings {
    /// The least time in which a picture can be rendered.
    const LEAST: Duration = Duration::from_millis(1);
    let goal = match settings.goal {
        Goal::Time(time) => Goal::Time(time.saturating_sub(spent).max(LEAST)),
        goal => goal,
    };
    JobSettings { goal, ..settings.clone() }
}

/// Computes with the other machines what all zones need, as far as that work can be divided.
fn prepare_together(member: &Member, number: u32, job: &Job, setup: &PaintingSetup, this: &StopSwitch) {
    let Member { board, name, .. } = member;
    // Guests may only render, and where results are compared no machine is trusted.
    if board.uplink.is_guest() || setup.settings.verify > 1 || setup.engine.learnt().is_some() {
        return;
    }
    let together = JobPeers::new(member, number, job.work, this);
    if let Err(error) = setup.engine.prepare_with(&together) {
        tracing::debug!(%error, "cannot share the preparation; zones prepare what they need");
    }
    let [here, total] = together.shares();
    if total > 0 {
        board.log(number, &format!("{name} did {here} of {total} parts of the work before the first zone"));
    }
}

/// Loads the data that another machine's engine has shared about the picture, if any.
fn learn_from_others(board: &JobBoard, job: &Job, engine: &dyn RenderEngine) -> Result<(), Error> {
    // It has the data already.
    if engine.learnt().is_some() {
        return Ok(());
    }
    if let Some(bytes) = board.learnt(job.work)?
        && let Err(error) = engine.learn_from(&bytes)
    {
        tracing::warn!(%error, "cannot use the data that the farm keeps for the engine; the engine computes it again");
    }
    Ok(())
}

/// The lead of a finished painting, held until it is dropped.
pub(crate) struct Leading {
    /// The number of the painting.
    pub(crate) work: u64,
    _occupation: Occupation,
    _watch: PartWatch,
}

/// A thread that renews the lease and presence of a part in a job, and stops the part when it is over.
struct PartWatch {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl PartWatch {
    fn begin(guard: Guard) -> Result<Self, Error> {
        let over = Arc::clone(&guard.over);
        let thread = thread::Builder::new().name("watch".to_owned()).spawn(move || guard.run()).map_err(|error| {
            Error::failed(format!("cannot start a thread: {error}"), "let fewer programs run at once")
        })?;
        Ok(Self { over, thread: Some(thread) })
    }
}

impl Drop for PartWatch {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // The thread has reported a panic itself.
            _ = thread.join();
        }
    }
}

struct Guard {
    member: Member,
    number: u32,
    /// The number of the painting, and that of the job.
    work: u64,
    origin: u64,
    turn: PaintingTurn,
    /// True if this process submitted the job.
    is_submitter: bool,
    lease: Option<Lease>,
    /// True if this process has taken over the lead: it leads once its agents have left.
    has_claimed: bool,
    this: StopSwitch,
    observer: Arc<LoggingObserver>,
    /// The engine, until it has shared its data with other machines.
    learner: Option<Arc<dyn RenderEngine>>,
    elsewhere: Box<dyn Fn() -> bool + Send>,
    over: Arc<AtomicBool>,
    /// True if the farm did not answer the last time.
    is_silent: bool,
    /// Refusals of guests, which cannot write into the job's log.
    watch: RefusalWatch,
}

impl Guard {
    fn run(mut self) {
        let mut renewed: Option<Instant> = None;
        while !self.over.load(Ordering::Relaxed) {
            if renewed.is_none_or(|at| at.elapsed() >= RENEW_EVERY) {
                renewed = Some(Instant::now());
                self.renew();
                self.keep_log();
                self.requeue();
                self.tell_society();
                self.tell_messages();
                self.keep_importance();
                self.clear_pages();
                self.member.watch_stalls();
            }
            if !self.this.is_requested() && self.must_leave() {
                self.this.request();
            }
            self.leave_to_others();
            self.teach();
            thread::sleep(LOOK_EVERY);
        }
        self.release();
    }

    /// Makes the Master paint zones again that users requested.
    fn requeue(&self) {
        let master = self.observer.master.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some(master) = master.filter(|_| self.lease.is_some()) {
            let settled = self.observer.settled.lock().unwrap_or_else(PoisonError::into_inner);
            self.member.board.hand_on_requeues(self.number, &settled, &master);
        }
    }

    fn must_leave(&mut self) -> bool {
        let Member { board, stop, .. } = &self.member;
        let is_wanted = |job: Job| job.state == JobState::Active && job.turn() == self.turn;
        stop.is_requested() || !board.get(self.number).is_some_and(is_wanted) || (self.elsewhere)() || self.claims()
    }

    /// Gives up the lead of a restarted painting, so that the next leader need not wait for this process, which may hang.
    fn leave_to_others(&mut self) {
        if self.member.board.get(self.number).is_some_and(|job| job.turn() != self.turn)
            && let Some(mut lease) = self.lease.take()
            && let Err(error) = self.member.board.renew(&mut lease, &self.observer.lead())
        {
            tracing::debug!(%error, "cannot give up the lead");
        }
    }

    /// Claims the lead if it is free. The first process to claim gets it; the others continue painting and report to the
    /// new leader.
    fn claims(&mut self) -> bool {
        let Member { board, name, .. } = &self.member;
        let is_led = || board.lead(self.number).is_some_and(|lead| lead.leader.is_some());
        if self.lease.is_some() || is_led() {
            return false;
        }
        match board.claim(self.number, self.work, name) {
            Ok(lease) => self.lease = lease,
            Err(error) => tracing::debug!(%error, "cannot take the lead"),
        }
        self.has_claimed = self.lease.is_some();
        self.has_claimed
    }

    /// Shares the engine's data with other machines, once.
    fn teach(&mut self) {
        if self.lease.is_none() {
            return;
        }
        let Some(bytes) = self.learner.as_ref().and_then(|learner| learner.learnt()) else { return };
        self.learner = None;
        let (board, work) = (self.member.board.clone(), self.work);
        // Use a thread: it may take longer than a lease lasts.
        let sent = thread::Builder::new().name("teach".to_owned()).spawn(move || board.teach(work, &bytes));
        if let Err(error) = sent {
            tracing::debug!(%error, "cannot share the data of the engine");
        }
    }

    fn renew(&mut self) {
        let Member { board, name, meter, .. } = &self.member;
        meter.count(Some(self.origin));
        board.attend(&Presence { takes_orders: !self.is_submitter, ..self.member.presence(Some(self.number)) });
        let lead = Lead { leader: Some(name.clone()), ..self.observer.lead() };
        let Some(lease) = &mut self.lease else { return };
        let renewed = board.renew(lease, &lead);
        let was_silent = std::mem::replace(&mut self.is_silent, renewed.is_err());
        match renewed {
            Ok(true) if was_silent => tracing::warn!("the farm answers again"),
            Ok(true) => {}
            Ok(false) => {
                tracing::warn!(job = self.number, "another process leads the job now");
                self.lease = None;
                self.this.request();
            }
            Err(error) if !was_silent && error.is_full => tracing::warn!(
                %error,
                "the farm's server does not store data, its disk may be full; waiting for it; see how much each job holds: bottega jobs list"
            ),
            Err(error) if !was_silent => tracing::warn!(%error, "the farm does not answer: waiting for it"),
            Err(_) => {}
        }
    }

    /// Writes into the job's log which machines are left out, and why. Only the leader does so.
    fn keep_log(&mut self) {
        if self.lease.is_none() {
            return;
        }
        let board = &self.member.board;
        let mut lines = std::mem::take(&mut *self.observer.log.lock().unwrap_or_else(PoisonError::into_inner));
        let presences = board.presences();
        let refusals = self.watch.new_refusals(&presences, |work| work == self.work).into_iter();
        lines.extend(
            refusals
                .filter(|(machine, _)| machine.is_guest)
                .map(|(machine, refusal)| format!("{} is left out: {}", machine.name, refusal.reason)),
        );
        let is_known =
            |line: &str| board.get(self.number).is_some_and(|job| job.log.iter().any(|entry| entry.text == line));
        for line in lines.iter().filter(|line| !is_known(line)) {
            board.log(self.number, line);
        }
    }

    /// Publishes the agents and the auction. Only the leader does so.
    fn tell_society(&self) {
        if self.lease.is_some() {
            let board = &self.member.board;
            let mut society = self.observer.society();
            society.see_usages(self.origin, &board.presences());
            society.see_usages(self.origin, &[self.member.presence(Some(self.number))]);
            society.tell(board, self.number);
        }
    }

    /// Stores the agents' messages while an observer watches. Only the leader does so.
    fn tell_messages(&self) {
        if self.lease.is_some() {
            self.observer.recorder.tell(&self.member.board, self.number, self.work);
        }
    }

    /// Deregisters agents of lost machines. Only the leader does so.
    fn clear_pages(&self) {
        if self.lease.is_some() && self.member.board.uplink.is_connected() {
            self.member.board.clear_pages();
        }
    }

    /// Stores the importance map for observers. Only the leader does so.
    fn keep_importance(&self) {
        if self.lease.is_none() {
            return;
        }
        let Some(map) = self.observer.importance.lock().unwrap_or_else(PoisonError::into_inner).take() else { return };
        let (board, work) = (self.member.board.clone(), self.work);
        // Use a thread: it may take longer than a lease lasts.
        let kept = thread::Builder::new().name("importance".to_owned()).spawn(move || {
            let (width, height) = map.size();
            match Canvas::gray_map(width, height, &map.grey()).to_png() {
                Ok(png) => board.keep_importance(work, &png),
                Err(error) => tracing::debug!(%error, "cannot publish the importance map"),
            }
        });
        if let Err(error) = kept {
            tracing::debug!(%error, "cannot publish the importance map");
        }
    }

    /// Releases the lease early, so that no process waits for it to expire; unless this process has just claimed it.
    fn release(&mut self) {
        self.member.meter.count(Some(self.origin));
        self.tell_society();
        self.tell_messages();
        if self.lease.is_some() {
            self.observer.society().keep_credits(&self.member.board);
        }
        if let Some(lease) = self.lease.as_mut().filter(|_| !self.has_claimed || self.member.stop.is_requested())
            && let Err(error) = self.member.board.renew(lease, &Lead { leader: None, ..self.observer.lead() })
        {
            tracing::debug!(%error, "cannot give up the lead");
        }
    }
}
