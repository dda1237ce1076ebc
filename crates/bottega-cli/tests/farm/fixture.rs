//! A farm on this machine, and requests to it.

use std::{
    collections::BTreeMap,
    fs,
    net::TcpListener,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    sync::{Condvar, Mutex, PoisonError},
    thread,
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::{Login, NatsOptions, NatsUplink, Tls};
use bottega_farm::FarmCodec;
use serde_json::Value;
use tempfile::TempDir;

use super::support::{bottega, signal, text};

pub(super) const WAIT: Duration = Duration::from_secs(180);
pub(super) const PICTURE: [&str; 6] = ["--size", "96x72", "--seed", "5", "--quiet", "--set=work.zones=24"];
/// Samples per pixel of a picture that takes some seconds, and of one that takes much longer.
pub(super) const FEW: &str = "--spp=384";
pub(super) const MANY: &str = "--spp=1200";

/// A place for a farm on this machine. Two farms run beside each other, since each waits most of its time.
pub(super) struct Place {
    is_alone: bool,
}

/// The number of running farms, and whether one waits to be alone.
static PLACES: (Mutex<(usize, bool)>, Condvar) = (Mutex::new((0, false)), Condvar::new());

impl Place {
    const ALL: usize = 2;

    pub(super) fn beside_another() -> Self {
        let places = PLACES.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_full = |(running, is_claimed): &mut (usize, bool)| *is_claimed || *running >= Self::ALL;
        let mut places = PLACES.1.wait_while(places, is_full).unwrap_or_else(PoisonError::into_inner);
        places.0 += 1;
        Self { is_alone: false }
    }

    fn alone() -> Self {
        let places = PLACES.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut places = PLACES.1.wait_while(places, |places| places.1).unwrap_or_else(PoisonError::into_inner);
        places.1 = true;
        drop(PLACES.1.wait_while(places, |places| places.0 > 0).unwrap_or_else(PoisonError::into_inner));
        Self { is_alone: true }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut places = PLACES.0.lock().unwrap_or_else(PoisonError::into_inner);
        if self.is_alone {
            places.1 = false;
        } else {
            places.0 -= 1;
        }
        drop(places);
        PLACES.1.notify_all();
    }
}

/// A process that ends with the test.
pub(super) struct Process(pub(super) Child);

impl Process {
    pub(super) fn kill(&mut self) {
        // It may have ended by itself.
        _ = self.0.kill();
        _ = self.0.wait();
    }

    /// Asks the process to end, and waits for its end.
    pub(super) fn end(&mut self) -> bool {
        self.signal("-TERM");
        self.wait()
    }

    pub(super) fn signal(&self, what: &str) {
        assert!(signal(what, self.0.id()));
    }

    #[track_caller]
    pub(super) fn wait(&mut self) -> bool {
        let begun = Instant::now();
        loop {
            if let Some(status) = self.0.try_wait().expect("a child") {
                return status.success();
            }
            assert!(begun.elapsed() < WAIT, "a process does not end");
            thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// A farm on this machine, with a state of its own.
pub(super) struct Farm {
    folder: TempDir,
    pub(super) port: u16,
    server: PathBuf,
    pub(super) up: Option<Process>,
    /// Further arguments of `bottega up`.
    more: Vec<String>,
    _place: Place,
}

impl Farm {
    pub(super) fn start(server: &Path) -> Self {
        Self::start_with(server, &[])
    }

    /// - `more`: further arguments of `bottega up`.
    pub(super) fn start_with(server: &Path, more: &[&str]) -> Self {
        Self::start_at(Place::beside_another(), server, more)
    }

    /// Starts a farm that has the processors for itself, because its time is measured.
    pub(super) fn start_alone(server: &Path) -> Self {
        Self::start_at(Place::alone(), server, &[])
    }

    fn start_at(place: Place, server: &Path, more: &[&str]) -> Self {
        let more = more.iter().map(|word| (*word).to_owned()).collect();
        let folder = tempfile::tempdir().expect("a folder");
        let port = TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("an address").port();
        let mut farm = Self { folder, port, server: server.to_owned(), up: None, more, _place: place };
        farm.up();
        farm
    }

    /// Starts the server, and waits until it is there.
    pub(super) fn up(&mut self) {
        let words = self.up_words(&self.more.iter().map(String::as_str).collect::<Vec<_>>());
        let up = self.spawn(&words.iter().map(String::as_str).collect::<Vec<_>>(), "up.log");
        self.up = Some(up);
        self.until_says("up.log", "bottega join");
    }

    pub(super) fn up_words(&self, more: &[&str]) -> Vec<String> {
        let listen = format!("127.0.0.1:{}", self.port);
        let words = ["up", "--listen", &listen, "--server", text(&self.server)];
        words.iter().chain(more).map(|word| (*word).to_owned()).collect()
    }

    /// Kills the server itself, as a power failure does.
    pub(super) fn kill_server(&self) {
        self.signal_server("-KILL");
    }

    pub(super) fn signal_server(&self, what: &str) {
        let number = fs::read_to_string(self.path("state/bottega/server/server.pid")).unwrap_or_default();
        if let Ok(number) = number.trim().parse() {
            // It may be gone already.
            signal(what, number);
        }
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(super) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = bottega(arguments);
        command.env("XDG_STATE_HOME", self.path("state")).env_remove("BOTTEGA_FARM");
        command
    }

    pub(super) fn spawn(&self, arguments: &[&str], log: &str) -> Process {
        self.spawn_in("state", arguments, log)
    }

    /// - `state`: the folder of its state, where it is another machine.
    pub(super) fn spawn_in(&self, state: &str, arguments: &[&str], log: &str) -> Process {
        let log = fs::File::create(self.path(log)).expect("a log");
        let mut command = self.command(arguments);
        command.env("XDG_STATE_HOME", self.path(state));
        command.stdout(log.try_clone().expect("a log")).stderr(log).stdin(Stdio::null());
        Process(command.spawn().expect("the program starts"))
    }

    pub(super) fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("the program starts")
    }

    pub(super) fn succeed(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).expect("text")
    }

    /// The lines that let machines in: with all rights, and as guests.
    pub(super) fn lines(&self) -> [String; 2] {
        let said = self.said("up.log");
        let mut lines = said.lines().filter_map(|line| line.trim().strip_prefix("bottega join "));
        [(); 2].map(|()| lines.next().expect("a line").to_owned())
    }

    /// A machine that has joined.
    pub(super) fn join(&self, name: &str) -> Process {
        self.join_by(name, None)
    }

    pub(super) fn join_by(&self, name: &str, line: Option<&str>) -> Process {
        let cache = self.path(&format!("cache-{name}"));
        let arguments = ["join", "--threads", "1", "--cache", text(&cache)];
        let machine = self.spawn(&[&arguments, line.as_slice()].concat(), name);
        self.until_says(name, "waiting for work");
        machine
    }

    pub(super) fn render(&self, output: &str, more: &[&str]) -> Process {
        self.render_by(output, FEW, more)
    }

    pub(super) fn render_by(&self, output: &str, samples: &str, more: &[&str]) -> Process {
        let path = self.path(output);
        let arguments = ["render", "goblets.glb", "-o", text(&path), "--threads", "1", "--farm", samples];
        self.spawn(&[&arguments, &PICTURE[..], more].concat(), &format!("{}.log", output.replace('/', "-")))
    }

    /// Returns the picture of a single machine.
    pub(super) fn plain(&self) -> Vec<[u32; 3]> {
        self.plain_by(FEW)
    }

    /// It is rendered once for all tests, which use the same scene.
    pub(super) fn plain_by(&self, samples: &'static str) -> Vec<[u32; 3]> {
        static PAINTED: Mutex<BTreeMap<&str, Vec<[u32; 3]>>> = Mutex::new(BTreeMap::new());
        let mut painted = PAINTED.lock().unwrap_or_else(PoisonError::into_inner);
        let of_samples = painted.entry(samples).or_insert_with(|| {
            let path = self.path("plain.exr");
            self.succeed(&[&["render", "goblets.glb", "-o", text(&path), samples], &PICTURE[..]].concat());
            bits(&path)
        });
        of_samples.clone()
    }

    pub(super) fn said(&self, log: &str) -> String {
        fs::read_to_string(self.path(log)).unwrap_or_default()
    }

    pub(super) fn until(&self, what: &str, mut is_so: impl FnMut() -> bool) {
        let begun = Instant::now();
        while !is_so() {
            assert!(begun.elapsed() < WAIT, "{what} does not come to pass; logs:\n{}", self.logs());
            thread::sleep(Duration::from_millis(50));
        }
    }

    /// Returns the name of a machine that has joined, from its log.
    pub(super) fn name_of(&self, log: &str) -> String {
        let said = self.said(log);
        let name = said.split_once(" as ").and_then(|(_, rest)| rest.split(';').next());
        name.unwrap_or_else(|| panic!("no name in {said:?}")).to_owned()
    }

    pub(super) fn until_says(&self, log: &str, words: &str) {
        self.until(words, || self.said(log).contains(words));
    }

    pub(super) fn logs(&self) -> String {
        let files = fs::read_dir(self.folder.path()).expect("a folder").flatten();
        let files = files.filter(|file| file.path().is_file() && !file.path().to_string_lossy().ends_with(".exr"));
        files.map(|file| format!("{:?}: {}\n", file.file_name(), self.said(text(&file.path())))).collect()
    }

    pub(super) fn job(&self, number: u32) -> Value {
        serde_json::from_str(&self.succeed(&["jobs", "show", &number.to_string(), "--json"])).expect("JSON")
    }

    /// Waits until this much of a job is painted, but not all.
    pub(super) fn until_painted(&self, number: u32, share: f64) {
        self.until("some of it is painted", || {
            let shown = self.run(&["jobs", "show", &number.to_string(), "--json"]);
            let job: Value = serde_json::from_slice(&shown.stdout).unwrap_or_default();
            job["done"].as_f64().is_some_and(|done| done >= share)
        });
        assert_eq!(self.job(number)["state"], "active", "it was painted too soon to disturb it");
    }

    pub(super) fn until_state(&self, number: u32, state: &str) {
        self.until(state, || self.job(number)["state"] == state);
    }

    pub(super) fn log_of(&self, number: u32) -> String {
        self.succeed(&["jobs", "log", &number.to_string()])
    }
}

impl Drop for Farm {
    fn drop(&mut self) {
        if thread::panicking() {
            eprintln!("logs of the farm:\n{}", self.logs());
        }
        self.up = None;
        self.kill_server();
    }
}

pub(super) fn bits(path: &Path) -> Vec<[u32; 3]> {
    let picture = bottega_image::read_picture(path).expect("a picture");
    picture.data.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// Returns the millions of samples that a machine reports as painted.
pub(super) fn painted(log: &str) -> f64 {
    let words = log.split(", ").filter_map(|part| part.split(" M samples").next()?.parse::<f64>().ok());
    words.sum()
}

pub(super) fn link(farm: &Farm) -> NatsUplink<FarmCodec> {
    let members = fs::read(farm.path("state/bottega/server/members.json")).expect("members");
    let members: Value = serde_json::from_slice(&members).expect("JSON");
    let seed = members["seed"].as_str().expect("a seed").to_owned();
    NatsUplink::connect(&options(farm, Login::NKey(seed)), FarmCodec).expect("a link")
}

pub(super) fn options(farm: &Farm, login: Login) -> NatsOptions {
    let [line, _] = farm.lines();
    let pin = line["bottega://t".len() + 32..].split('@').next().and_then(|pin| pin.parse().ok()).expect("a pin");
    NatsOptions {
        servers: vec![format!("nats://127.0.0.1:{}", farm.port)],
        login,
        tls: Tls { is_required: true, pin: Some(pin), ..Tls::default() },
        farm: "bottega".to_owned(),
        member: "test".to_owned(),
        is_guest: false,
    }
}
