//! A farm seen through its notices, rows and blobs. Only recently read data is kept, so any process of the farm serves the
//! same.

use std::{
    collections::{BTreeMap, HashMap},
    path::Path,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use axum::http::StatusCode;
use bottega::{Request, events::Event, viewport::Viewport};
use bottega_cluster::{
    Job, JobBoard, JobState, LogLine,
    blackboard::RowUpdate,
    cache::Cache,
    client::{SharedViewport, share_viewport},
    energy::JobEnergy,
    job_preview::JobPreview,
    jobs,
    machines::MachineOrder,
    messages::SeenMessages,
    names::host_name,
    presence::{Presence, PresenceState},
    rules_of_job::{JobRules, ZoneRules},
    society::Society,
    uploads::{Submission, UploadOffer, UploadState},
    view::JobView,
    web_secrets::{TokenRole, WebSecrets},
    web_tokens::{TokenHolder, WebToken},
};

use crate::{
    live::LiveJob,
    message_log::MessageLog,
    problem::Problem,
    source::{AuctionSum, JobAgents, JobOrder, MachineRefusal, MachineStatus, PictureFile, ShownFarm, ShownKind},
};

/// Interval between checks of a watched job.
const LOOK_EVERY: Duration = Duration::from_millis(500);
/// Largest number of previews kept.
const PREVIEWS_MAX: usize = 8;
/// Largest number of jobs whose messages are kept.
const MESSAGES_OF_MAX: usize = 4;
/// Interval of the requests to the farm to collect a job's messages.
const WATCH_EVERY: Duration = Duration::from_secs(2);
/// Shortest interval between two renewals of a preview.
const PREVIEW_EVERY: Duration = Duration::from_millis(700);

/// A source of data that shows the farm to which this process is linked.
pub struct LinkedFarm {
    board: JobBoard,
    secrets: WebSecrets,
    cache: Cache,
    live: Arc<Mutex<HashMap<u32, FollowedJob>>>,
    previews: Mutex<HashMap<u64, Arc<Mutex<FreshPreview>>>>,
    messages: Mutex<HashMap<u64, Arc<Mutex<ReadMessages>>>>,
}

/// The messages of a job read so far.
#[derive(Default)]
struct ReadMessages {
    log: MessageLog,
    pieces: usize,
    /// Time of the last request to the farm to collect messages; `None`: there was none.
    requested_at: Option<Instant>,
}

/// A job that clients watch.
struct FollowedJob {
    /// Identity of the job, the same for all repetitions of its rendering.
    origin: u64,
    live: Arc<LiveJob>,
    /// True once the thread that follows the job has ended.
    has_ended: Arc<AtomicBool>,
}

/// A preview, with its last PNG file and the time it was made.
struct FreshPreview {
    preview: JobPreview,
    png: Option<Vec<u8>>,
    renewed: Option<Instant>,
    was_over: bool,
}

impl LinkedFarm {
    /// Makes a source from the job records of a farm.
    ///
    /// - `secrets`: the secrets from which its own tokens are derived.
    pub fn new(board: JobBoard, secrets: WebSecrets) -> Self {
        Self {
            board,
            secrets,
            cache: Cache::of_user(),
            live: Arc::default(),
            previews: Mutex::default(),
            messages: Mutex::default(),
        }
    }

    fn known(&self, number: u32) -> Result<Job, Problem> {
        self.board.shown_job(number).map_err(|error| {
            if self.board.uplink.is_connected() {
                Problem::unknown(error.error_chain(), "GET /api/jobs lists the jobs")
            } else {
                Problem::new(StatusCode::SERVICE_UNAVAILABLE, "the farm's server does not answer", "wait for it")
            }
        })
    }

    fn preview_of(&self, job: &Job) -> Result<Arc<Mutex<FreshPreview>>, Problem> {
        let mut previews = lock(&self.previews);
        if let Some(known) = previews.get(&job.work) {
            return Ok(Arc::clone(known));
        }
        if previews.len() >= PREVIEWS_MAX {
            let age = |fresh: &Arc<Mutex<FreshPreview>>| fresh.try_lock().ok().and_then(|fresh| fresh.renewed);
            let oldest = previews.iter().min_by_key(|(_, fresh)| age(fresh)).map(|(work, _)| *work);
            oldest.and_then(|work| previews.remove(&work));
        }
        let preview = JobPreview::new(&self.board, job)?;
        let fresh = Arc::new(Mutex::new(FreshPreview { preview, png: None, renewed: None, was_over: false }));
        previews.insert(job.work, Arc::clone(&fresh));
        Ok(fresh)
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn view(board: &JobBoard, number: u32, job: &Job, machines: &[Presence]) -> JobView {
    let count = machines.iter().filter(|machine| machine.job == Some(number)).count();
    JobView::of(number, job, &board.lead(number).unwrap_or_default(), count)
}

/// Publishes the changes of a job until it is over, removed, or no client watches it.
fn follow(board: &JobBoard, number: u32, live: &Arc<LiveJob>, is_wanted: &dyn Fn() -> bool) {
    let mut said: Option<LogLine> = None;
    // Publishes the view and the new log lines of the job
    let mut look = || {
        let job = board.get(number)?;
        if live.begin_painting(job.work) {
            said = None;
        }
        live.tell_job(&view(board, number, &job, &board.presences()));
        let from = job.log.iter().rposition(|line| Some(line) == said.as_ref()).map_or(0, |last| last + 1);
        for line in &job.log[from..] {
            live.tell(&Event::Note { message: line.text.clone() });
        }
        said = job.log.last().cloned();
        Some(job)
    };
    let Some(mut job) = look() else { return live.tell_removed() };
    loop {
        let (mut looked, mut now) = (Instant::now(), Some(job.clone()));
        // Publish rows of zones and agents as they change, and the job now and then
        let watched = board.watch_rows(&job, |update| {
            if let RowUpdate::Row(row) = update {
                live.tell(&row);
            }
            if looked.elapsed() > LOOK_EVERY && !job.state.is_over() {
                looked = Instant::now();
                now = look();
                let goes_on = |now: &Job| !now.state.is_over() && now.work == job.work;
                return is_wanted() && now.as_ref().is_some_and(goes_on);
            }
            true
        });
        if let Err(error) = watched {
            tracing::debug!(%error, number, "cannot follow the rows of the job");
        }
        if job.state.is_over() || !is_wanted() {
            return;
        }
        match now {
            None => return live.tell_removed(),
            // If the job is over, publish its last rows. Else it is rendered again or the connection was lost: start again.
            Some(now) => job = now,
        }
        thread::sleep(LOOK_EVERY);
    }
}

impl ShownFarm for LinkedFarm {
    fn kind(&self) -> ShownKind {
        ShownKind::Farm
    }

    fn jobs(&self) -> Result<Vec<JobView>, Problem> {
        let machines = self.board.presences();
        Ok(self.board.shown_jobs().iter().map(|(number, job)| view(&self.board, *number, job, &machines)).collect())
    }

    fn job(&self, number: u32) -> Result<JobView, Problem> {
        Ok(view(&self.board, number, &self.known(number)?, &self.board.presences()))
    }

    fn request(&self, number: u32) -> Result<serde_json::Value, Problem> {
        Ok(self.board.request_again(&self.known(number)?)?)
    }

    fn rows(&self, number: u32) -> Result<Vec<Event>, Problem> {
        Ok(self.board.rows(&self.known(number)?)?)
    }

    fn agents(&self, number: u32) -> Result<JobAgents, Problem> {
        self.known(number)?;
        let Society { auction, agents, .. } = self.board.society(number).unwrap_or_default();
        let auction = AuctionSum {
            rounds: auction.rounds,
            contested: auction.contested,
            outbid: auction.outbid,
            credit_decided: auction.credit_decided,
            bids: auction.bids,
            awards: auction.awards,
            thefts: auction.thefts,
            stolen: auction.stolen,
        };
        Ok(JobAgents { agents, auction })
    }

    fn energy(&self, number: u32) -> Result<JobEnergy, Problem> {
        Ok(self.board.energy(number, &self.known(number)?, &self.board.tariff())?)
    }

    fn messages(&self, number: u32, from: u64) -> Result<SeenMessages, Problem> {
        let job = self.known(number)?;
        let read = {
            let mut by_work = lock(&self.messages);
            if by_work.len() >= MESSAGES_OF_MAX && !by_work.contains_key(&job.work) {
                by_work.clear();
            }
            Arc::clone(by_work.entry(job.work).or_default())
        };
        let mut read = lock(&read);
        if !job.state.is_over() && read.requested_at.is_none_or(|time| time.elapsed() > WATCH_EVERY) {
            self.board.watch_messages(number)?;
            read.requested_at = Some(Instant::now());
        }
        while let Some(piece) = self.board.messages(&job, read.pieces)? {
            read.pieces += 1;
            read.log.lost = piece.lost;
            piece.messages.into_iter().for_each(|message| read.log.push(message));
        }
        Ok(read.log.since(from))
    }

    fn rules(&self, number: u32) -> Result<JobRules, Problem> {
        Ok(self.board.rules(&self.known(number)?)?)
    }

    fn zone_rules(&self, number: u32, zone: u32) -> Result<ZoneRules, Problem> {
        let found = self.board.zone_rules(&self.known(number)?, zone)?;
        let remedy = "GET /api/jobs/{id}/zones lists the zones";
        found.ok_or_else(|| Problem::unknown(format!("job {number} has no zone {zone}"), remedy))
    }

    fn log(&self, number: u32) -> Result<Vec<LogLine>, Problem> {
        Ok(self.known(number)?.log)
    }

    fn preview(&self, number: u32) -> Result<Option<Vec<u8>>, Problem> {
        let job = self.known(number)?;
        let fresh = self.preview_of(&job)?;
        let mut fresh = lock(&fresh);
        let is_over = job.state.is_over();
        let is_old = fresh.renewed.is_none_or(|at| at.elapsed() > PREVIEW_EVERY);
        let is_stale = fresh.png.is_none() || is_old || is_over != fresh.was_over;
        if is_stale {
            fresh.png = fresh.preview.renew(&self.board, &job)?;
            (fresh.renewed, fresh.was_over) = (Some(Instant::now()), is_over);
        }
        Ok(fresh.png.clone())
    }

    fn importance(&self, number: u32) -> Result<Option<Vec<u8>>, Problem> {
        Ok(self.board.importance(&self.known(number)?)?)
    }

    fn picture(&self, number: u32) -> Result<PictureFile, Problem> {
        let job = self.known(number)?;
        let lacking = |why: String, remedy: &str| Problem::conflict(why, remedy);
        if !job.kept {
            return Err(match &job.state {
                JobState::Done => lacking(format!("{} wrote the picture itself", job.from), "look there"),
                state => lacking(format!("job {number} is {}", state.word()), "wait until it is done"),
            });
        }
        let bytes = self.board.picture(&job)?;
        let bytes = bytes.ok_or_else(|| lacking("the farm has no picture of this job".to_owned(), "ask again"))?;
        let name = Path::new(&job.output).file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(PictureFile { name, bytes })
    }

    fn live(&self, number: u32) -> Result<Arc<LiveJob>, Problem> {
        let Job { origin, state, .. } = self.known(number)?;
        let mut followed = lock(&self.live);
        // Drop jobs that no client watches and whose thread has ended
        followed.retain(|_, job| Arc::strong_count(&job.live) > 1);
        let known = followed.get(&number).filter(|job| job.origin == origin);
        // A job that was over may be rendered again
        let goes_on = |job: &&FollowedJob| state.is_over() || !job.has_ended.load(Ordering::Relaxed);
        if let Some(job) = known.filter(goes_on) {
            return Ok(Arc::clone(&job.live));
        }
        let live = known.map_or_else(Arc::default, |job| Arc::clone(&job.live));
        let has_ended = Arc::new(AtomicBool::new(false));
        followed.insert(number, FollowedJob { origin, live: Arc::clone(&live), has_ended: Arc::clone(&has_ended) });
        let (board, watched, followed_jobs) = (self.board.clone(), Arc::clone(&live), Arc::clone(&self.live));
        // The job's thread and the table hold the other two references.
        let is_wanted = move |live: &Arc<LiveJob>| {
            let mut followed_jobs = lock(&followed_jobs);
            let is_wanted = Arc::strong_count(live) > 2;
            if !is_wanted && followed_jobs.get(&number).is_some_and(|job| Arc::ptr_eq(&job.live, live)) {
                followed_jobs.remove(&number);
            }
            is_wanted
        };
        let begun = thread::Builder::new().name(format!("job-{number}")).spawn(move || {
            let since = Instant::now();
            // The first client may not have subscribed yet.
            let is_wanted = || since.elapsed() < LOOK_EVERY || is_wanted(&watched);
            follow(&board, number, &watched, &is_wanted);
            has_ended.store(true, Ordering::Relaxed);
        });
        match begun {
            Ok(_) => Ok(live),
            Err(error) => {
                followed.remove(&number);
                Err(Problem::new(
                    StatusCode::SERVICE_UNAVAILABLE,
                    format!("cannot start a thread: {error}"),
                    "try again",
                ))
            }
        }
    }

    fn machines(&self) -> Result<Vec<MachineStatus>, Problem> {
        let (board, reliabilities) = (&self.board, self.board.reliabilities());
        let tariff = board.tariff();
        let mut societies: BTreeMap<u32, Society> = BTreeMap::new();
        let presences = board.shown_machines(board.presences()).into_iter();
        let machine = |presence: Presence| {
            let society = presence
                .job
                .map(|job| &*societies.entry(job).or_insert_with(|| board.society(job).unwrap_or_default()));
            let is_of_it = |agent: &str| agent.contains(&*presence.name);
            let agents =
                society.map(|society| society.agents.iter().filter(|row| is_of_it(&row.agent)).cloned().collect());
            let energy = society.and_then(|society| {
                let own =
                    society.usages.get_key_value(&presence.name).map(|(name, usage)| (name.clone(), usage.clone()));
                JobEnergy::of(&own.into_iter().collect(), &[], &tariff).machines.pop()
            });
            let machine = presence.name.split('.').next().unwrap_or_default();
            let refusal = |refusal: &bottega_cluster::presence::Refusal| MachineRefusal {
                job: refusal.job,
                reason: refusal.reason.clone(),
            };
            MachineStatus {
                state: presence.standing.word(),
                ordered: board.order_to(&presence.name).standing.word(),
                activity: presence.activity.word(),
                threads: presence.threads,
                devices: presence.devices,
                job: presence.job,
                takes_orders: presence.takes_orders,
                is_guest: presence.is_guest,
                tags: presence.tags,
                reliability: reliabilities.get(machine).copied(),
                agents: agents.unwrap_or_default(),
                refusals: presence.refusals.iter().map(refusal).collect(),
                energy,
                version: presence.version,
                name: presence.name,
            }
        };
        Ok(presences.map(machine).collect())
    }

    fn steer(&self, number: u32, order: JobOrder, by: &str) -> Result<(), Problem> {
        let (board, by) = (&self.board, &of_page(by));
        self.known(number)?;
        match order {
            JobOrder::Pause => jobs::steer(board, number, &JobState::Paused, by),
            JobOrder::Resume => jobs::steer(board, number, &JobState::Active, by),
            JobOrder::Cancel => jobs::steer(board, number, &JobState::Cancelled, by),
            JobOrder::Priority(priority) => jobs::set_priority(board, number, priority, by),
            JobOrder::Remove => jobs::remove(board, number),
        }?;
        Ok(())
    }

    fn requeue(&self, number: u32, zone: u32, by: &str) -> Result<(), Problem> {
        self.known(number)?;
        self.board.requeue(number, zone, &of_page(by))?;
        // Resume publishing to clients that watch a job which was over.
        let is_watched = lock(&self.live).contains_key(&number);
        if is_watched {
            self.live(number)?;
        }
        Ok(())
    }

    fn tell(&self, machine: &str, standing: PresenceState, by: &str) -> Result<(), Problem> {
        let present = self.board.shown_machines(self.board.presences());
        let presence = present.iter().find(|presence| presence.name == machine);
        let presence = presence.ok_or_else(|| {
            Problem::unknown(format!("there is no machine `{machine}`"), "GET /api/machines lists the machines")
        })?;
        if !presence.takes_orders {
            let problem = format!("{machine} takes no commands: it is the process that submitted its job");
            return Err(Problem::conflict(problem, "it ends with its job"));
        }
        Ok(self.board.tell(machine, &MachineOrder { standing, by: of_page(by) })?)
    }

    fn offer(&self, offer: &UploadOffer) -> Result<UploadState, Problem> {
        Ok(self.board.offer_upload(offer)?)
    }

    fn put_piece(&self, digest: &str, bytes: &[u8]) -> Result<(), Problem> {
        Ok(self.board.put_piece(digest, bytes)?)
    }

    fn submit(&self, submission: Submission, by: &str) -> Result<Vec<u32>, Problem> {
        let from = format!("web-{}", host_name());
        Ok(self.board.submit_uploaded(submission, &from, by, &self.cache)?)
    }

    fn uploaded_here(&self, submission: Submission) -> Result<Request, Problem> {
        Ok(self.board.uploaded_here(submission, &self.cache)?)
    }

    fn share(&self, viewport: &Arc<Viewport>) -> Option<SharedViewport> {
        let shared = share_viewport(viewport, &self.board);
        shared.inspect_err(|error| tracing::warn!(%error, "the machines do not help a viewport")).ok()
    }

    fn holder(&self, token: &str) -> Option<TokenHolder> {
        self.board.token_holder(&self.secrets, token)
    }

    fn own_token(&self, role: TokenRole) -> String {
        self.board.own_token(&self.secrets, role)
    }

    fn tokens(&self) -> Result<Vec<WebToken>, Problem> {
        Ok(self.board.web_tokens())
    }

    fn make_token(&self, name: &str, role: TokenRole, by: &str) -> Result<String, Problem> {
        Ok(self.board.make_token(name, role, by)?)
    }

    fn revoke_token(&self, name: &str, by: &str) -> Result<(), Problem> {
        if !self.board.web_tokens().iter().any(|token| token.name == name) {
            let shown = name.escape_debug();
            return Err(Problem::unknown(format!("there is no token `{shown}`"), "GET /api/tokens lists the tokens"));
        }
        if !self.secrets.is_shared() && TokenRole::ALL.iter().any(|role| role.word() == name) {
            let detail = format!("`{name}` is known to this page alone, and nobody would learn its replacement");
            return Err(Problem::conflict(detail, "it ends with the process that serves the page"));
        }
        Ok(self.board.revoke_token(name, by)?)
    }
}

/// Returns the author of an order, for the farm's logs.
fn of_page(by: &str) -> String {
    format!("{by}, by the page that {} serves", host_name())
}
