//! The dashboard of one process, which appears as a farm with one job: `bottega render --dashboard`.

use std::{
    net::SocketAddr,
    path::Path,
    sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError},
};

use axum::http::StatusCode;
use bottega::{
    Event, Request, StopSwitch,
    json::{self, JsonError},
    viewport::Viewport,
};
use bottega_cluster::{
    Activity, LogLine,
    client::SharedViewport,
    energy::{JobEnergy, Tariff},
    messages::{MessageEvent, SeenMessages},
    names::host_name,
    ports::{Port, bind},
    presence::PresenceState,
    rules_of_job::{JobRules, ZoneRules},
    unix_seconds,
    uploads::{Submission, UploadOffer, UploadState},
    usage_meter::UsageMeter,
    view::JobView,
    web_secrets::{TokenRole, WebSecrets},
    web_tokens::{TokenHolder, WebToken},
};

use crate::{
    error::ServeError,
    live::LiveJob,
    message_log::MessageLog,
    problem::Problem,
    server::{Door, DoorOptions},
    source::{JobAgents, JobOrder, MachineStatus, PictureFile, ShownFarm, ShownKind},
};

/// Number of the only job.
const NUMBER: u32 = 1;
/// Number of the only work.
const WORK: u64 = 1;
/// Largest number of log lines kept.
const LOG_LINES_MAX: usize = 200;

/// A web server that shows the picture of this process to clients, until the process ends.
#[derive(Clone)]
pub struct Dashboard {
    painted: Arc<PaintedJob>,
    door: Arc<Door>,
}

/// The job of this process.
struct PaintedJob {
    state: Mutex<PaintedState>,
    live: Arc<LiveJob>,
    secrets: WebSecrets,
    stop: StopSwitch,
    meter: UsageMeter,
    messages: Mutex<MessageLog>,
    /// The request that is being rendered.
    request: OnceLock<Request>,
}

struct PaintedState {
    view: JobView,
    zones: std::collections::BTreeMap<u32, Event>,
    agents: std::collections::BTreeMap<String, Event>,
    log: Vec<LogLine>,
    preview: Option<Vec<u8>>,
    threads: usize,
    /// Names of the devices that render together with the CPU threads.
    devices: Vec<String>,
    /// The output file, once it is written.
    written: Option<String>,
}

impl Dashboard {
    /// Starts a server on `address` (port 0: any free one), on a thread of its own. Returns the dashboard; it is served until the
    /// process ends, by TLS unless `address` is a loopback address.
    ///
    /// - `stop`: the switch by which clients stop rendering.
    ///
    /// # Errors
    /// The address cannot be listened on, no tokens or certificate can be made, or the operating system refuses a thread.
    pub fn serve(address: SocketAddr, stop: &StopSwitch) -> Result<Self, ServeError> {
        let state = Mutex::new(PaintedState::new());
        let (live, messages, meter) = (Arc::default(), Mutex::default(), UsageMeter::new(None));
        let listener = bind(Port::Dashboard, address)?;
        let secrets = WebSecrets::fresh().map_err(|error| ServeError::Secrets(error.error_chain()))?;
        let (certificate, stop) = (secrets.certificate.clone(), stop.clone());
        let painted = Arc::new(PaintedJob { state, live, secrets, stop, meter, messages, request: OnceLock::new() });
        let options = DoorOptions { listener, certificate, names: Vec::new(), log: None };
        let door = Door::open(Arc::clone(&painted) as _, options)?;
        Ok(Self { painted, door: Arc::new(door) })
    }

    /// Returns the URL of the dashboard, with a token that allows steering.
    pub fn url(&self) -> String {
        self.door.steering_url()
    }

    /// Sets the request that is being rendered, which viewports of its scene need. Only the first call has an effect.
    pub fn show_request(&self, request: &Request) {
        _ = self.painted.request.set(request.clone());
    }

    /// Publishes an event to connected clients, and keeps its state for later ones.
    pub fn publish(&self, event: &Event) {
        self.painted.live.tell(event);
        let mut state = self.painted.state();
        self.painted.meter.count(Some(WORK).filter(|_| state.threads > 0 && !state.view.is_over));
        state.take(event);
        self.painted.live.tell_job(&state.view);
    }

    /// Publishes a message between agents. The dashboard keeps the last 50 000 messages.
    pub fn show_message(&self, message: MessageEvent) {
        self.painted.messages.lock().unwrap_or_else(PoisonError::into_inner).push(message);
    }

    /// Sets the preview. Clients learn of it by an [`Event::Preview`], which the caller publishes.
    ///
    /// - `png`: the bytes of a PNG file.
    pub fn set_preview(&self, png: Vec<u8>) {
        let mut state = self.painted.state();
        (state.preview, state.view.seen) = (Some(png), true);
    }
}

impl PaintedState {
    fn new() -> Self {
        let view = JobView {
            number: NUMBER,
            state: "active",
            reason: None,
            done: 0.0,
            zones_done: 0,
            zones: 0,
            seconds_left: None,
            seen: false,
            priority: 0,
            require: Vec::new(),
            machines: 1,
            leader: Some(host_name()),
            from: host_name(),
            submitted: unix_seconds(),
            scene: String::new(),
            output: String::new(),
            animation: None,
            stirs: 0,
            kept: false,
            is_over: false,
        };
        let (zones, agents) = Default::default();
        Self { view, zones, agents, log: Vec::new(), preview: None, threads: 0, devices: Vec::new(), written: None }
    }

    /// Updates the state by an event.
    fn take(&mut self, event: &Event) {
        match event {
            Event::Started { scene, output, threads, gpus, .. } => {
                self.devices.clone_from(gpus);
                (self.threads, self.view.zones, self.view.zones_done) = (*threads, 0, 0);
                (self.view.scene, self.view.output) = (scene.clone(), output.clone());
                self.zones.clear();
                self.agents.clear();
            }
            Event::Zone(zone) => _ = self.zones.insert(zone.id, event.clone()),
            Event::Agent(agent) => _ = self.agents.insert(agent.agent.clone(), event.clone()),
            Event::Progress(progress) => {
                (self.view.zones, self.view.zones_done) = (progress.zones, progress.zones_done);
                (self.view.done, self.view.seconds_left) = (progress.share, progress.seconds_left);
            }
            Event::Note { message } | Event::Warning { message } => self.say(message),
            Event::Finished { output, .. } | Event::Fetched { output } => {
                (self.view.state, self.view.done) = ("done", 1.0);
                self.end(output);
            }
            Event::Interrupted { output, .. } => {
                self.view.state = "cancelled";
                self.end(output);
            }
            _ => {}
        }
    }

    fn end(&mut self, output: &str) {
        self.view.seconds_left = None;
        (self.view.kept, self.view.is_over, self.view.machines) = (true, true, 0);
        self.written = Some(output.to_owned());
        self.say(self.view.state);
    }

    fn say(&mut self, text: &str) {
        self.log.push(LogLine { at: unix_seconds(), text: text.to_owned() });
        let old = self.log.len().saturating_sub(LOG_LINES_MAX);
        self.log.drain(..old);
    }
}

impl PaintedJob {
    fn state(&self) -> MutexGuard<'_, PaintedState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn only(&self, number: u32) -> Result<MutexGuard<'_, PaintedState>, Problem> {
        if number == NUMBER {
            return Ok(self.state());
        }
        Err(Problem::unknown(format!("there is no job {number}"), "this process has only job 1"))
    }
}

/// Returns the problem of a request that only a farm can fulfil.
fn no_farm() -> Problem {
    Problem::conflict("this is the picture of one process, not a farm", "ask `bottega up`")
}

impl ShownFarm for PaintedJob {
    fn kind(&self) -> ShownKind {
        ShownKind::Picture
    }

    fn jobs(&self) -> Result<Vec<JobView>, Problem> {
        Ok(vec![self.state().view.clone()])
    }

    fn job(&self, number: u32) -> Result<JobView, Problem> {
        Ok(self.only(number)?.view.clone())
    }

    fn request(&self, number: u32) -> Result<serde_json::Value, Problem> {
        drop(self.only(number)?);
        Err(no_farm())
    }

    fn rows(&self, number: u32) -> Result<Vec<Event>, Problem> {
        let state = self.only(number)?;
        Ok(state.zones.values().chain(state.agents.values()).cloned().collect())
    }

    fn agents(&self, number: u32) -> Result<JobAgents, Problem> {
        let state = self.only(number)?;
        let agents = state.agents.values().filter_map(|event| match event {
            Event::Agent(agent) => Some(agent.clone()),
            _ => None,
        });
        Ok(JobAgents { agents: agents.collect(), ..JobAgents::default() })
    }

    fn energy(&self, number: u32) -> Result<JobEnergy, Problem> {
        let state = self.only(number)?;
        if !state.view.is_over {
            self.meter.count(Some(WORK));
        }
        let rows: Vec<Event> = state.zones.values().cloned().collect();
        let home = rows.iter().find_map(|row| match row {
            Event::Zone(zone) => zone.agent.as_deref()?.split('@').nth(1).map(str::to_owned),
            _ => None,
        });
        let home = home.unwrap_or_else(host_name);
        let usages = self.meter.usages().into_iter().map(|usage| (home.clone(), usage)).collect();
        Ok(JobEnergy::of(&usages, &rows, &Tariff::default()))
    }

    fn messages(&self, number: u32, from: u64) -> Result<SeenMessages, Problem> {
        drop(self.only(number)?);
        Ok(self.messages.lock().unwrap_or_else(PoisonError::into_inner).since(from))
    }

    fn rules(&self, number: u32) -> Result<JobRules, Problem> {
        drop(self.only(number)?);
        Err(Problem::conflict(
            "the page of one process does not show the rules",
            "`bottega rules` shows and evaluates them",
        ))
    }

    fn zone_rules(&self, number: u32, _zone: u32) -> Result<ZoneRules, Problem> {
        self.rules(number).map(|_| ZoneRules::default())
    }

    fn log(&self, number: u32) -> Result<Vec<LogLine>, Problem> {
        Ok(self.only(number)?.log.clone())
    }

    fn preview(&self, number: u32) -> Result<Option<Vec<u8>>, Problem> {
        Ok(self.only(number)?.preview.clone())
    }

    fn importance(&self, number: u32) -> Result<Option<Vec<u8>>, Problem> {
        self.only(number).map(|_| None)
    }

    fn picture(&self, number: u32) -> Result<PictureFile, Problem> {
        let written = self.only(number)?.written.clone();
        let written = written.ok_or_else(|| Problem::conflict("the picture is not done", "wait until it is"))?;
        let path = Path::new(&written);
        let bytes = std::fs::read(path).map_err(|error| {
            Problem::conflict(format!("cannot read `{written}`: {error}"), "it was moved or removed")
        })?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(PictureFile { name, bytes })
    }

    fn live(&self, number: u32) -> Result<Arc<LiveJob>, Problem> {
        self.only(number).map(|_| Arc::clone(&self.live))
    }

    fn machines(&self) -> Result<Vec<MachineStatus>, Problem> {
        let state = self.state();
        let agents = state.agents.values().filter_map(|event| match event {
            Event::Agent(agent) => Some(agent.clone()),
            _ => None,
        });
        Ok(vec![MachineStatus {
            name: host_name(),
            state: PresenceState::Active.word(),
            ordered: PresenceState::Active.word(),
            activity: if state.view.is_over { Activity::Waiting } else { Activity::Busy }.word(),
            threads: state.threads,
            devices: state.devices.clone(),
            job: Some(NUMBER).filter(|_| !state.view.is_over),
            version: bottega_cluster::build::build().identity().to_owned(),
            takes_orders: false,
            is_guest: false,
            tags: Vec::new(),
            reliability: None,
            agents: agents.collect(),
            refusals: Vec::new(),
            energy: None,
        }])
    }

    fn steer(&self, number: u32, order: JobOrder, _by: &str) -> Result<(), Problem> {
        let is_over = self.only(number)?.view.is_over;
        match order {
            JobOrder::Cancel if !is_over => {
                self.stop.request();
                Ok(())
            }
            JobOrder::Cancel => Err(Problem::conflict("the picture is done", "")),
            _ => Err(no_farm()),
        }
    }

    fn requeue(&self, _number: u32, _zone: u32, _by: &str) -> Result<(), Problem> {
        Err(no_farm())
    }

    fn tell(&self, _machine: &str, _standing: PresenceState, _by: &str) -> Result<(), Problem> {
        Err(no_farm())
    }

    fn offer(&self, _offer: &UploadOffer) -> Result<UploadState, Problem> {
        Err(no_farm())
    }

    fn put_piece(&self, _digest: &str, _bytes: &[u8]) -> Result<(), Problem> {
        Err(no_farm())
    }

    fn submit(&self, _submission: Submission, _by: &str) -> Result<Vec<u32>, Problem> {
        Err(no_farm())
    }

    /// Returns the request of this process's picture, with `film.size` and `view` of `submission`; other scenes cannot be viewed
    /// here.
    fn uploaded_here(&self, submission: Submission) -> Result<Request, Problem> {
        let painted =
            self.request.get().filter(|_| submission.files.is_empty() && submission.files_of_job == Some(NUMBER));
        let mut request = painted.cloned().ok_or_else(no_farm)?;
        let refused = |error: JsonError| {
            let remedy = "GET /api/schema/request says what is allowed";
            Problem::new(StatusCode::UNPROCESSABLE_ENTITY, error.to_string(), remedy)
        };
        if let Some(view) = submission.request.get("view") {
            request.view = json::from_value(view.clone()).map_err(|error| refused(error.within("view")))?;
        }
        if let Some(size) = submission.request.pointer("/film/size") {
            request.film.size = json::from_value(size.clone()).map_err(|error| refused(error.within("film.size")))?;
            request.film.crop = None;
        }
        request.output.file = None;
        Ok(request)
    }

    fn share(&self, _: &Arc<Viewport>) -> Option<SharedViewport> {
        None
    }

    fn holder(&self, token: &str) -> Option<TokenHolder> {
        let is = |role: TokenRole| blake3::hash(self.own_token(role).as_bytes()) == blake3::hash(token.as_bytes());
        let role = TokenRole::ALL.into_iter().rev().find(|role| is(*role))?;
        Some(TokenHolder { name: role.word().to_owned(), role })
    }

    fn own_token(&self, role: TokenRole) -> String {
        self.secrets.token(role, 0)
    }

    fn tokens(&self) -> Result<Vec<WebToken>, Problem> {
        let token = |role: TokenRole| WebToken { name: role.word().to_owned(), role, made: None, by: None };
        Ok(TokenRole::ALL.map(token).to_vec())
    }

    fn make_token(&self, _name: &str, _role: TokenRole, _by: &str) -> Result<String, Problem> {
        Err(no_farm())
    }

    fn revoke_token(&self, _name: &str, _by: &str) -> Result<(), Problem> {
        Err(no_farm())
    }
}
