//! A fake farm, and a client that speaks HTTP byte by byte.

use std::{
    collections::BTreeMap,
    io::{BufRead, BufReader, Read, Write},
    net::{SocketAddr, TcpListener, TcpStream},
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

use bottega::{
    Request,
    events::{AgentEvent, Event, ZoneEvent},
    viewport::Viewport,
};
use bottega_cluster::{
    LogLine,
    client::SharedViewport,
    deed_log::DeedLog,
    energy::{JobEnergy, MachineEnergy},
    messages::{MessageEvent, SeenMessages},
    presence::PresenceState,
    rules_of_job::{JobRules, ZoneRules},
    uploads::{Submission, UploadOffer, UploadState},
    usage::EnergySource,
    view::JobView,
    web_secrets::TokenRole,
    web_tokens::{TokenHolder, WebToken},
};
use bottega_image::{Aov, AovSet, ExrOptions, Film, Layout, Metadata, Rect, SampleValues, Tile, write_exr};
use bottega_web::{
    Door, DoorOptions, JobAgents, JobOrder, LiveJob, MachineStatus, PictureFile, Problem, ShownFarm, ShownKind,
};

pub(crate) const SEE: &str = "00000000000000000000000000000005";
pub(crate) const STEER: &str = "00000000000000000000000000000007";
/// The folder of the fake farm's files, which no answer may reveal.
pub(crate) const HIDDEN: &str = "/home/anna/secret";

/// A farm of two jobs and a machine, which records the calls that it gets.
#[derive(Default)]
pub(crate) struct FakeFarm {
    pub(crate) live: Arc<LiveJob>,
    pub(crate) calls: Mutex<Vec<String>>,
    pub(crate) pieces: Mutex<BTreeMap<String, usize>>,
    /// Tokens that were made, by name.
    made: Mutex<BTreeMap<String, TokenRole>>,
}

impl FakeFarm {
    pub(crate) fn note(&self, what: String) {
        self.calls.lock().unwrap_or_else(PoisonError::into_inner).push(what);
    }

    pub(crate) fn noted(&self) -> Vec<String> {
        std::mem::take(&mut self.calls.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn known(number: u32) -> Result<(), Problem> {
        let unknown = || Problem::unknown(format!("the farm has no job {number}"), "");
        if [1, 2].contains(&number) { Ok(()) } else { Err(unknown()) }
    }
}

pub(crate) fn zone(id: u32, state: &str) -> Event {
    let (state, agent) = (state.to_owned(), Some("agent@machine".to_owned()));
    Event::Zone(Box::new(ZoneEvent { id, state, agent, rect: [0, 0, 8, 8], ..ZoneEvent::default() }))
}

/// Job 1 is painted, its scene lies in a hidden folder; job 2 is done.
pub(crate) fn job(number: u32) -> JobView {
    let is_over = number == 2;
    let folder = if is_over { String::new() } else { format!("{HIDDEN}/") };
    JobView {
        number,
        state: if is_over { "done" } else { "active" },
        reason: Some(format!("cannot read `{HIDDEN}/x.png`: it is not there")).filter(|_| !is_over),
        done: if is_over { 1.0 } else { 0.25 },
        zones_done: 1,
        zones: 4,
        seconds_left: Some(3.0).filter(|_| !is_over),
        seen: true,
        priority: 10,
        require: Vec::new(),
        machines: 1,
        leader: Some("machine".to_owned()),
        from: "machine".to_owned(),
        submitted: 1,
        scene: format!("{folder}scene.glb"),
        output: format!("{folder}picture.exr"),
        animation: None,
        stirs: 0,
        kept: is_over,
        is_over,
    }
}

impl ShownFarm for FakeFarm {
    fn kind(&self) -> ShownKind {
        ShownKind::Farm
    }

    fn request(&self, number: u32) -> Result<serde_json::Value, Problem> {
        Self::known(number)
            .map(|()| serde_json::json!({ "scene": { "file": "scene.glb" }, "film": { "size": [96, 72] } }))
    }

    fn jobs(&self) -> Result<Vec<JobView>, Problem> {
        Ok(vec![job(1), job(2)])
    }

    fn job(&self, number: u32) -> Result<JobView, Problem> {
        Self::known(number).map(|()| job(number))
    }

    fn rows(&self, number: u32) -> Result<Vec<Event>, Problem> {
        Self::known(number).map(|()| vec![zone(2, "open"), zone(1, "done")])
    }

    fn agents(&self, number: u32) -> Result<JobAgents, Problem> {
        let agent = AgentEvent {
            agent: "agent@machine".to_owned(),
            power: 1.5,
            lanes: 4.0,
            credit: 0.25,
            reliability: 0.9,
            seconds: None,
            failures: 0,
            left_out: Some(format!("it cannot read {HIDDEN}/rules.fcl")),
        };
        Self::known(number).map(|()| JobAgents { agents: vec![agent], ..JobAgents::default() })
    }

    fn energy(&self, number: u32) -> Result<JobEnergy, Problem> {
        let machine = MachineEnergy {
            machine: "machine".to_owned(),
            processor_seconds: 12.5,
            kwh: Some(0.5),
            cost: None,
            source: Some(EnergySource::Counters),
        };
        let energy =
            JobEnergy { processor_seconds: 12.5, kwh: Some(0.5), machines: vec![machine], ..JobEnergy::default() };
        Self::known(number).map(|()| energy)
    }

    fn messages(&self, number: u32, from: u64) -> Result<SeenMessages, Problem> {
        let message = MessageEvent {
            sender: "master@work-1".to_owned(),
            receivers: vec!["render-1@machine".to_owned()],
            performative: "inform".to_owned(),
            content: format!("it cannot read {HIDDEN}/x.png"),
            ..MessageEvent::default()
        };
        Self::known(number).map(|()| SeenMessages { first: from, messages: vec![message], lost: 0 })
    }

    fn rules(&self, number: u32) -> Result<JobRules, Problem> {
        Self::known(number).map(|()| JobRules::default())
    }

    fn zone_rules(&self, number: u32, zone: u32) -> Result<ZoneRules, Problem> {
        let reasons = Some("path_tracing: 12 0.83".to_owned());
        Self::known(number).map(|()| ZoneRules { zone, reasons, verdicts: Vec::new() })
    }

    fn log(&self, number: u32) -> Result<Vec<LogLine>, Problem> {
        Self::known(number).map(|()| vec![LogLine { at: 1, text: format!("cannot read {HIDDEN}/a.glb: gone") }])
    }

    fn preview(&self, number: u32) -> Result<Option<Vec<u8>>, Problem> {
        Self::known(number).map(|()| (number == 1).then(|| b"\x89PNG picture".to_vec()))
    }

    fn importance(&self, number: u32) -> Result<Option<Vec<u8>>, Problem> {
        self.preview(number)
    }

    fn picture(&self, number: u32) -> Result<PictureFile, Problem> {
        Self::known(number)?;
        if number == 1 {
            return Ok(PictureFile { name: "picture.exr".to_owned(), bytes: layered_picture() });
        }
        // Larger than what a connection buffers.
        Ok(PictureFile { name: "pic\"\r\nture.exr".to_owned(), bytes: vec![7; 64 << 20] })
    }

    fn live(&self, number: u32) -> Result<Arc<LiveJob>, Problem> {
        Self::known(number).map(|()| Arc::clone(&self.live))
    }

    fn machines(&self) -> Result<Vec<MachineStatus>, Problem> {
        Ok(vec![MachineStatus {
            name: "machine".to_owned(),
            state: "active",
            ordered: "active",
            activity: "busy",
            threads: 4,
            devices: vec!["A GPU".to_owned()],
            job: Some(1),
            version: "0.1".to_owned(),
            takes_orders: true,
            is_guest: false,
            tags: vec!["gpu".to_owned()],
            reliability: Some(0.5),
            agents: Vec::new(),
            refusals: Vec::new(),
            energy: None,
        }])
    }

    fn steer(&self, number: u32, order: JobOrder, by: &str) -> Result<(), Problem> {
        Self::known(number)?;
        self.note(format!("{number} {order:?} by {by}"));
        Ok(())
    }

    fn requeue(&self, number: u32, zone: u32, by: &str) -> Result<(), Problem> {
        Self::known(number)?;
        self.note(format!("{number} requeue {zone} by {by}"));
        Ok(())
    }

    fn tell(&self, machine: &str, standing: PresenceState, by: &str) -> Result<(), Problem> {
        self.note(format!("{machine} {standing:?} by {by}"));
        Ok(())
    }

    fn offer(&self, offer: &UploadOffer) -> Result<UploadState, Problem> {
        let pieces = self.pieces.lock().unwrap_or_else(PoisonError::into_inner);
        let missing = offer.chunks.iter().filter(|chunk| !pieces.contains_key(*chunk)).cloned().collect();
        Ok(UploadState { digest: offer.digest.clone(), missing, chunk_bytes: 4 << 20 })
    }

    fn put_piece(&self, digest: &str, bytes: &[u8]) -> Result<(), Problem> {
        self.pieces.lock().unwrap_or_else(PoisonError::into_inner).insert(digest.to_owned(), bytes.len());
        Ok(())
    }

    fn submit(&self, submission: Submission, by: &str) -> Result<Vec<u32>, Problem> {
        self.note(format!("submit {} by {by}", submission.files.len()));
        Ok(if submission.request.get("frames").is_some() { vec![3, 4, 5] } else { vec![3] })
    }

    fn share(&self, _: &Arc<Viewport>) -> Option<SharedViewport> {
        None
    }

    fn uploaded_here(&self, _submission: Submission) -> Result<Request, Problem> {
        let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/cornell-box.glb");
        let mut request = Request::new(scene);
        (request.film.size, request.goal.samples) = (Some([16, 12]), Some(2));
        Ok(request)
    }

    fn holder(&self, token: &str) -> Option<TokenHolder> {
        let own = [(SEE, TokenRole::See), (STEER, TokenRole::Steer)];
        let own = own.into_iter().find(|(own, _)| *own == token).map(|(_, role)| (role.word().to_owned(), role));
        let made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let made = made.iter().find(|(name, _)| made_token(name) == token).map(|(name, role)| (name.clone(), *role));
        own.or(made).map(|(name, role)| TokenHolder { name, role })
    }

    fn own_token(&self, role: TokenRole) -> String {
        if role == TokenRole::See { SEE } else { STEER }.to_owned()
    }

    fn tokens(&self) -> Result<Vec<WebToken>, Problem> {
        let made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let token = |(name, role): (&String, &TokenRole)| WebToken {
            name: name.clone(),
            role: *role,
            made: Some(1),
            by: Some("somebody".to_owned()),
        };
        Ok(made.iter().map(token).collect())
    }

    fn make_token(&self, name: &str, role: TokenRole, by: &str) -> Result<String, Problem> {
        self.note(format!("make {name} by {by}"));
        self.made.lock().unwrap_or_else(PoisonError::into_inner).insert(name.to_owned(), role);
        Ok(made_token(name))
    }

    fn revoke_token(&self, name: &str, by: &str) -> Result<(), Problem> {
        self.note(format!("revoke {name} by {by}"));
        self.made.lock().unwrap_or_else(PoisonError::into_inner).remove(name);
        Ok(())
    }
}

/// The token that the farm makes for a name.
pub(crate) fn made_token(name: &str) -> String {
    format!("0000000000000000000000000000-{name}")
}

/// An OpenEXR file of two pixels with a layer, `albedo`.
fn layered_picture() -> Vec<u8> {
    let rect = Rect::of_size(2, 1);
    let layout = Layout::new(AovSet::NONE.with(Aov::Albedo));
    let mut tile = Tile::new(rect, layout.clone());
    for x in 0..2 {
        let values = SampleValues { radiance: [x as f32; 3], albedo: [0.2, 0.4, 0.6], ..SampleValues::default() };
        tile.add(x, 0, &values);
    }
    let mut film = Film::new(rect, layout);
    film.add_tile(&tile, |_, _| 1.0);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("picture.exr");
    write_exr(&path, &film, &Metadata::new(), ExrOptions::default()).expect("it is written");
    std::fs::read(path).expect("it is there")
}

/// A door to a fake farm.
pub(crate) fn open() -> (Arc<FakeFarm>, Door) {
    open_with(None)
}

/// - `log`: the log of actions and their clients.
pub(crate) fn open_with(log: Option<DeedLog>) -> (Arc<FakeFarm>, Door) {
    let farm = Arc::new(FakeFarm::default());
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let (certificate, names) = ((String::new(), String::new()), vec!["farm.example".to_owned()]);
    let options = DoorOptions { listener, certificate, names, log };
    let door = Door::open(Arc::clone(&farm) as _, options).expect("a door");
    (farm, door)
}

/// The answer of a door.
#[derive(Debug)]
pub(crate) struct DoorAnswer {
    pub(crate) status: u16,
    pub(crate) head: String,
    pub(crate) body: Vec<u8>,
}

impl DoorAnswer {
    pub(crate) fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }

    pub(crate) fn json(&self) -> serde_json::Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|error| panic!("{error}: {}", self.text()))
    }

    /// A header by its name in small letters.
    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        let mut fields = self.head.lines().skip(1).filter_map(|line| line.split_once(": "));
        fields.find(|(field, _)| field.eq_ignore_ascii_case(name)).map(|(_, value)| value)
    }
}

/// A connection with a request on its way.
pub(crate) fn send(at: SocketAddr, bytes: &[u8]) -> TcpStream {
    let mut stream = TcpStream::connect(at).expect("the door is open");
    stream.set_read_timeout(Some(Duration::from_secs(30))).expect("a time limit");
    // The door may close it before it has taken all.
    _ = stream.write_all(bytes);
    stream
}

/// The head of an answer.
pub(crate) fn head(reader: &mut impl BufRead) -> (u16, String) {
    let mut head = String::new();
    while !head.ends_with("\r\n\r\n") {
        if reader.read_line(&mut head).unwrap_or(0) == 0 {
            break;
        }
    }
    (head.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0), head)
}

/// Sends a request unchanged. Returns the whole answer.
pub(crate) fn raw(at: SocketAddr, bytes: &[u8]) -> DoorAnswer {
    let mut reader = BufReader::new(send(at, bytes));
    let (status, head) = head(&mut reader);
    let mut body = Vec::new();
    // A connection that is reset after the answer has delivered all of it.
    _ = reader.read_to_end(&mut body);
    let mut answer = DoorAnswer { status, head, body };
    if answer.header("transfer-encoding") == Some("chunked") {
        answer.body = unchunked(&answer.body);
    }
    answer
}

fn unchunked(mut body: &[u8]) -> Vec<u8> {
    let mut all = Vec::new();
    while let Some(end) = body.windows(2).position(|pair| pair == b"\r\n") {
        let size = usize::from_str_radix(&String::from_utf8_lossy(&body[..end]), 16).unwrap_or(0);
        let from = end + 2;
        if size == 0 || body.len() < from + size {
            break;
        }
        all.extend(&body[from..from + size]);
        body = &body[(from + size + 2).min(body.len())..];
    }
    all
}

/// A request with further header lines, each with its line end.
pub(crate) fn ask(at: SocketAddr, method: &str, path: &str, headers: &str, body: &[u8]) -> DoorAnswer {
    let length = if body.is_empty() { String::new() } else { format!("Content-Length: {}\r\n", body.len()) };
    let head = format!("{method} {path} HTTP/1.1\r\nHost: {at}\r\nConnection: close\r\n{length}{headers}\r\n");
    raw(at, &[head.as_bytes(), body].concat())
}

pub(crate) fn bearer(token: &str) -> String {
    format!("Authorization: Bearer {token}\r\n")
}

/// Makes a request of a client that may look on.
pub(crate) fn get(at: SocketAddr, path: &str) -> DoorAnswer {
    ask(at, "GET", path, &bearer(SEE), b"")
}

/// Makes a request of a client that may steer, with JSON.
pub(crate) fn post(at: SocketAddr, method: &str, path: &str, json: &str) -> DoorAnswer {
    let headers = format!("{}Content-Type: application/json\r\n", bearer(STEER));
    ask(at, method, path, &headers, json.as_bytes())
}
