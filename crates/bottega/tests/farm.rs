//! A farm of real processes on real NATS servers: the same bits, whoever paints and whoever dies.
//!
//! The servers are those that `BOTTEGA_NATS_SERVERS` names, or the system's. Without one the tests say that they are
//! skipped.

mod farm_agents;
mod support;

use std::{
    env, fs,
    net::TcpListener,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    sync::{Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::{Login, NatsOptions, NatsUplink, Tls};
use bottega_farm::FarmCodec;
use serde_json::Value;
use support::{bottega, text};
use tempfile::TempDir;

/// Farms are timed by the clock: one at a time has the processors.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
const WAIT: Duration = Duration::from_secs(60);
const PICTURE: [&str; 6] = ["--size", "96x72", "--seed", "5", "--quiet", "--zones=24"];
/// Samples a pixel of a picture that takes some seconds, and of one that takes much longer.
const FEW: &str = "--spp=384";
const MANY: &str = "--spp=2000";

fn servers() -> Vec<PathBuf> {
    let named = env::var_os("BOTTEGA_NATS_SERVERS");
    let named: Vec<PathBuf> = named.iter().flat_map(env::split_paths).filter(|path| path.is_file()).collect();
    let places = env::var_os("PATH").unwrap_or_default();
    let places = env::split_paths(&places).chain(["/usr/sbin".into(), "/usr/local/bin".into()]);
    let system = places.map(|folder| folder.join("nats-server")).find(|path| path.is_file());
    let found = if named.is_empty() { system.into_iter().collect() } else { named };
    if found.is_empty() {
        eprintln!("SKIPPED: there is no nats-server; `cargo xtask test` installs one");
    }
    found
}

/// A process that ends with the test.
struct Process(Child);

impl Process {
    fn kill(&mut self) {
        // It may have ended by itself.
        _ = self.0.kill();
        _ = self.0.wait();
    }

    /// Asks it to end, and waits for that.
    fn end(&mut self) -> bool {
        let asked = Command::new("kill").arg("-TERM").arg(self.0.id().to_string()).status();
        assert!(asked.expect("kill runs").success());
        self.wait()
    }

    fn wait(&mut self) -> bool {
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
struct Farm {
    folder: TempDir,
    port: u16,
    server: PathBuf,
    up: Option<Process>,
    _alone: MutexGuard<'static, ()>,
}

impl Farm {
    fn start(server: &Path) -> Self {
        let alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = tempfile::tempdir().expect("a folder");
        let port = TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("an address").port();
        let mut farm = Self { folder, port, server: server.to_owned(), up: None, _alone: alone };
        farm.up();
        farm
    }

    /// Starts the server, and waits until it is there.
    fn up(&mut self) {
        let listen = format!("127.0.0.1:{}", self.port);
        let up = self.spawn(&["up", "--listen", &listen, "--server", text(&self.server)], "up.log");
        self.up = Some(up);
        self.until_says("up.log", "bottega join");
    }

    /// The server itself, as if its machine had lost power.
    fn kill_server(&self) {
        let number = fs::read_to_string(self.path("state/bottega/server/server.pid")).unwrap_or_default();
        if !number.trim().is_empty() {
            // It may be gone already.
            _ = Command::new("kill").args(["-KILL", number.trim()]).stderr(Stdio::null()).status();
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = bottega(arguments);
        command.env("XDG_STATE_HOME", self.path("state")).env_remove("BOTTEGA_FARM");
        command
    }

    fn spawn(&self, arguments: &[&str], log: &str) -> Process {
        let log = fs::File::create(self.path(log)).expect("a log");
        let mut command = self.command(arguments);
        command.stdout(log.try_clone().expect("a log")).stderr(log).stdin(Stdio::null());
        Process(command.spawn().expect("the program starts"))
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("the program starts")
    }

    fn succeed(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).expect("text")
    }

    /// The lines that let one in: into everything, and to paint.
    fn lines(&self) -> [String; 2] {
        let said = self.said("up.log");
        let mut lines = said.lines().filter_map(|line| line.trim().strip_prefix("bottega join "));
        [(); 2].map(|()| lines.next().expect("a line").to_owned())
    }

    /// A machine that has joined.
    fn join(&self, name: &str) -> Process {
        self.join_by(name, None)
    }

    fn join_by(&self, name: &str, line: Option<&str>) -> Process {
        let cache = self.path(&format!("cache-{name}"));
        let arguments = ["join", "--threads", "1", "--cache", text(&cache)];
        let machine = self.spawn(&[&arguments, line.as_slice()].concat(), name);
        self.until_says(name, "waiting for work");
        machine
    }

    fn render(&self, output: &str, more: &[&str]) -> Process {
        self.render_by(output, FEW, more)
    }

    fn render_by(&self, output: &str, samples: &str, more: &[&str]) -> Process {
        let path = self.path(output);
        let arguments = ["render", "goblets.glb", "-o", text(&path), "--threads", "1", "--farm", samples];
        self.spawn(&[&arguments, &PICTURE[..], more].concat(), &format!("{output}.log"))
    }

    /// The picture of one machine alone.
    fn plain(&self) -> Vec<[u32; 3]> {
        self.plain_by(FEW)
    }

    fn plain_by(&self, samples: &str) -> Vec<[u32; 3]> {
        let path = self.path("plain.exr");
        self.succeed(&[&["render", "goblets.glb", "-o", text(&path), samples], &PICTURE[..]].concat());
        bits(&path)
    }

    fn said(&self, log: &str) -> String {
        fs::read_to_string(self.path(log)).unwrap_or_default()
    }

    fn until(&self, what: &str, is_so: impl Fn() -> bool) {
        let begun = Instant::now();
        while !is_so() {
            assert!(begun.elapsed() < WAIT, "{what} does not come to pass; logs:\n{}", self.logs());
            thread::sleep(Duration::from_millis(50));
        }
    }

    fn until_says(&self, log: &str, words: &str) {
        self.until(words, || self.said(log).contains(words));
    }

    fn logs(&self) -> String {
        let files = fs::read_dir(self.folder.path()).expect("a folder").flatten();
        let files = files.filter(|file| file.path().is_file() && !file.path().to_string_lossy().ends_with(".exr"));
        files.map(|file| format!("{:?}: {}\n", file.file_name(), self.said(text(&file.path())))).collect()
    }

    fn job(&self, number: u32) -> Value {
        serde_json::from_str(&self.succeed(&["jobs", "show", &number.to_string(), "--json"])).expect("JSON")
    }

    /// Waits until so much of a job is painted, and not all.
    fn until_painted(&self, number: u32, share: f64) {
        self.until("some of it is painted", || {
            let shown = self.run(&["jobs", "show", &number.to_string(), "--json"]);
            let job: Value = serde_json::from_slice(&shown.stdout).unwrap_or_default();
            job["done"].as_f64().is_some_and(|done| done >= share)
        });
        assert_eq!(self.job(number)["state"], "active", "it was painted too soon to disturb it");
    }

    fn until_state(&self, number: u32, state: &str) {
        self.until(state, || self.job(number)["state"] == state);
    }

    fn log_of(&self, number: u32) -> String {
        self.succeed(&["jobs", "log", &number.to_string()])
    }
}

impl Drop for Farm {
    fn drop(&mut self) {
        self.up = None;
        self.kill_server();
    }
}

fn bits(path: &Path) -> Vec<[u32; 3]> {
    let picture = bottega_image::read_picture(path).expect("a picture");
    picture.data.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// Millions of samples that a machine says it has painted.
fn painted(log: &str) -> f64 {
    let words = log.split(", ").filter_map(|part| part.split(" M samples").next()?.parse::<f64>().ok());
    words.sum()
}

#[test]
fn three_machines_and_any_server_give_the_bits_of_one() {
    for server in servers() {
        let farm = Farm::start(&server);
        let plain = farm.plain();
        let (mut one, mut two) = (farm.join("one"), farm.join("two"));
        assert!(farm.render("a.exr", &[]).wait(), "{}", farm.logs());
        assert!(bits(&farm.path("a.exr")) == plain, "{server:?}: {}", farm.logs());
        assert!(!farm.path("a.exr.bottega-journal").exists());
        assert_eq!(farm.job(1)["state"], "done");
        assert!(one.end() && two.end(), "{}", farm.logs());
        for machine in ["one", "two"] {
            assert!(painted(&farm.said(machine)) > 0.1, "{server:?}: {}", farm.logs());
        }
        // What was kept for it has gone.
        let blobs = farm.path("state/bottega/server/jetstream");
        assert!(blobs.is_dir());
        let uplink = link(&farm);
        let mut left = Vec::new();
        uplink.blobs().forget_all(|name| {
            left.push(name.to_owned());
            false
        });
        assert!(left.iter().all(|name| !name.starts_with("work-")), "{left:?}");
    }
}

#[test]
fn machines_that_are_compared_give_the_same_bits_and_one_alone_waits_for_another() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain();
    let (path, is_loud) = (farm.path("a.exr"), |word: &&&str| **word != "--quiet");
    let words =
        ["render", "goblets.glb", "-o", text(&path), "--threads", "1", "--farm", FEW, "--verify", "2", "--json"];
    let words: Vec<&str> = words.iter().chain(PICTURE.iter().filter(is_loud)).copied().collect();
    let mut asker = farm.spawn(&words, "a.exr.log");
    farm.until_says("a.exr.log", "cannot be compared: 1 are there, 2 are needed");
    assert!(!farm.path("a.exr").exists());
    let (mut one, mut two) = (farm.join("one"), farm.join("two"));
    assert!(asker.wait(), "{}", farm.logs());
    assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
    assert!(!farm.said("a.exr.log").contains("left out"), "{}", farm.logs());
    assert!(one.end() && two.end(), "{}", farm.logs());
}

fn link(farm: &Farm) -> NatsUplink<FarmCodec> {
    let members = fs::read(farm.path("state/bottega/server/members.json")).expect("members");
    let members: Value = serde_json::from_slice(&members).expect("JSON");
    let seed = members["seed"].as_str().expect("a seed").to_owned();
    NatsUplink::connect(&options(farm, Login::NKey(seed)), FarmCodec).expect("a link")
}

fn options(farm: &Farm, login: Login) -> NatsOptions {
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

#[test]
fn a_machine_that_is_killed_costs_time_and_no_pixel() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain();
    let (mut one, _two) = (farm.join("one"), farm.join("two"));
    let mut render = farm.render("a.exr", &[]);
    farm.until_painted(1, 0.2);
    one.kill();
    assert!(render.wait(), "{}", farm.logs());
    assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
}

#[test]
fn when_the_one_who_leads_is_killed_another_goes_on_with_what_is_painted() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain();
    let (_one, _two) = (farm.join("one"), farm.join("two"));
    let mut render = farm.render("a.exr", &[]);
    farm.until_painted(1, 0.3);
    let before = farm.job(1)["zones_done"].as_u64().expect("a number");
    render.kill();
    let killed = Instant::now();
    farm.until("somebody else leads", || farm.log_of(1).matches(" leads").count() == 2);
    assert!(killed.elapsed() < Duration::from_secs(5), "{:?}", killed.elapsed());
    farm.until("it knows what is painted", || farm.job(1)["zones_done"].as_u64() >= Some(before));
    farm.until_state(1, "done");
    let path = farm.path("b.exr");
    farm.succeed(&["jobs", "fetch", "1", "-o", text(&path)]);
    assert!(bits(&path) == plain, "{}", farm.logs());
    farm.succeed(&["jobs", "remove", "1"]);
    assert!(farm.succeed(&["jobs", "list", "--json"]).is_empty());
}

#[test]
fn when_the_server_goes_all_wait_and_go_on_when_it_is_back() {
    let Some(server) = servers().pop() else { return };
    let mut farm = Farm::start(&server);
    let plain = farm.plain();
    let _one = farm.join("one");
    let mut render = farm.render("a.exr", &[]);
    farm.until_painted(1, 0.2);
    assert!(farm.up.take().expect("a server").end());
    thread::sleep(Duration::from_secs(5));
    farm.up();
    assert!(render.wait(), "{}", farm.logs());
    assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
}

#[test]
fn whoever_is_killed_every_few_seconds_the_picture_has_the_same_bits() {
    let Some(server) = servers().pop() else { return };
    let mut farm = Farm::start(&server);
    let plain = farm.plain_by(MANY);
    let mut machines = [farm.join("m0"), farm.join("m1"), farm.join("m2")];
    assert!(farm.render_by("a.exr", MANY, &["--detach"]).wait(), "{}", farm.logs());
    let mut killed = Vec::new();
    for turn in 0.. {
        thread::sleep(Duration::from_secs(3));
        let shown = farm.run(&["jobs", "show", "1", "--json"]);
        let job: Value = serde_json::from_slice(&shown.stdout).unwrap_or_default();
        if job["state"] == "done" {
            break;
        }
        assert!(turn < 60, "{}", farm.logs());
        match turn % 3 {
            0 => {
                let leader = job["leader"].as_str().unwrap_or_default().to_owned();
                killed.push(format!("machine, while {leader} led"));
                let next = turn / 3 % 3;
                machines[next].kill();
                machines[next] = farm.join(&format!("m{next}-{turn}"));
            }
            1 => {
                killed.push("server".to_owned());
                farm.kill_server();
            }
            _ => {
                killed.push("up".to_owned());
                farm.up = None;
                farm.up();
            }
        }
    }
    assert!(killed.len() >= 2, "it was painted too soon: {killed:?}");
    let path = farm.path("a.exr");
    farm.succeed(&["jobs", "fetch", "1"]);
    assert!(bits(&path) == plain, "{}", farm.logs());
}

/// A server that somebody else runs, and whose disk is full.
#[test]
fn when_the_server_has_no_room_the_job_waits_until_it_has() {
    let Some(server) = servers().pop() else { return };
    let alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().expect("a folder");
    let port = TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("an address").port();
    let start = |room: &str| {
        let config = folder.path().join("nats.conf");
        let store = folder.path().join("store");
        let words = format!(
            "listen: \"127.0.0.1:{port}\"\nauthorization {{ token: \"word\" }}\n\
             jetstream {{ store_dir: {store:?}, max_file_store: {room} }}\n"
        );
        fs::write(&config, words).expect("a configuration");
        let mut command = Command::new(&server);
        command.arg("--config").arg(&config).stdout(Stdio::null()).stderr(Stdio::null());
        Process(command.spawn().expect("a server"))
    };
    let picture = ["render", "goblets.glb", "--size", "640x480", "--spp", "4", "--zones", "64", "--quiet", "-o"];
    let [plain, farm] = ["plain.exr", "farm.exr"].map(|name| folder.path().join(name));
    support::succeed(&[&picture[..], &[text(&plain)]].concat());
    let mut small = start("3M");
    thread::sleep(Duration::from_secs(1));
    let log = fs::File::create(folder.path().join("log")).expect("a log");
    let address = format!("--farm=nats://word@127.0.0.1:{port}");
    let mut command = bottega(&[&picture[..], &[text(&farm), &address]].concat());
    command.env("XDG_STATE_HOME", folder.path()).stderr(log);
    let mut render = Process(command.spawn().expect("the program starts"));
    let begun = Instant::now();
    let said = || fs::read_to_string(folder.path().join("log")).unwrap_or_default();
    while !said().contains("as with a full disk") {
        assert!(begun.elapsed() < WAIT, "{}", said());
        thread::sleep(Duration::from_millis(100));
    }
    small.kill();
    let _large = start("1G");
    assert!(render.wait(), "{}", said());
    assert!(bits(&farm) == bits(&plain));
    drop(alone);
}

#[test]
fn a_leader_that_was_stopped_for_a_while_finds_another_and_does_no_harm() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain();
    let _one = farm.join("one");
    let mut render = farm.render("a.exr", &[]);
    farm.until_painted(1, 0.2);
    let signal = |what: &str| {
        let sent = Command::new("kill").args([what, &render.0.id().to_string()]).status();
        assert!(sent.expect("kill runs").success());
    };
    signal("-STOP");
    farm.until("another one leads", || farm.log_of(1).matches(" leads").count() == 2);
    signal("-CONT");
    assert!(render.wait(), "{}", farm.logs());
    assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
}

#[test]
fn jobs_are_asked_for_paused_resumed_called_off_and_had() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain();
    assert!(farm.render("a.exr", &["--detach"]).wait(), "{}", farm.logs());
    assert!(farm.render("b.exr", &["--detach", "--priority", "30"]).wait(), "{}", farm.logs());
    farm.succeed(&["jobs", "pause", "1"]);
    let _one = farm.join("one");
    farm.until_painted(2, 0.1);
    assert_eq!((farm.job(1)["machines"].as_u64(), farm.job(2)["machines"].as_u64()), (Some(0), Some(1)));
    farm.succeed(&["jobs", "pause", "2"]);
    farm.until("nobody paints it", || farm.job(2)["leader"].is_null());
    farm.succeed(&["jobs", "resume", "2"]);
    farm.until_state(2, "done");
    let path = farm.path("b.exr");
    farm.succeed(&["jobs", "fetch", "2"]);
    assert!(bits(&path) == plain, "{}", farm.logs());
    assert!(!farm.run(&["jobs", "remove", "1"]).status.success(), "it is not over");
    farm.succeed(&["jobs", "cancel", "1"]);
    assert_eq!(farm.job(1)["state"], "cancelled");
    for (arguments, words) in [
        (["jobs", "fetch", "1"], "the job is cancelled"),
        (["jobs", "resume", "1"], "is over: cancelled"),
        (["jobs", "show", "7"], "has no job 7"),
    ] {
        let output = farm.run(&arguments);
        let told = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ");
        assert!(output.status.code() == Some(1) && told.contains(words), "{arguments:?}: {told}");
    }
}

#[test]
fn what_cannot_be_is_told() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let [line, guest_line] = farm.lines();
    let wrong_secret = line.replacen("://t", "://t0123", 1).replacen(&line[14..18], "", 1);
    let wrong_server =
        line.replacen(&line[line.find('@').expect("an @") - 4..], &format!("0000@127.0.0.1:{}", farm.port), 1);
    let other = format!("nats://x@127.0.0.1:{}", farm.port);
    let as_guest = format!("--farm={guest_line}");
    for (arguments, code, words) in [
        (vec!["join", &wrong_secret], 1, "the line that it printed"),
        (vec!["join", &wrong_server], 1, "the line that it printed"),
        (vec!["join", &other], 1, "the line that it printed"),
        (vec!["join", &line[..40]], 2, "copy all of the line"),
        (vec!["join", &line, "--creds", "x"], 2, "leave out --creds"),
        (vec!["render", "goblets.glb", "-o", "/tmp/x.exr", &as_guest], 1, "may paint for the farm"),
        (vec!["jobs", "list", "--farm", &other, "--nkey", "/nowhere"], 1, "cannot read"),
        (vec!["join", "nats://127.0.0.1:1"], 1, "bottega up"),
        (vec!["join", "http://x"], 2, "an address such as"),
        (vec!["jobs", "list", "--farm", "nats://x@127.0.0.1:1/a b"], 1, "letters, digits"),
        (vec!["up", "--listen", "127.0.0.1:0", "--server", "/nowhere"], 1, "cannot start"),
        (vec!["render", "goblets.glb", "-o", "/tmp/x.exr", "--detach"], 2, "--farm"),
        (vec!["render", "goblets.glb", "-o", "/tmp/x.exr", "--verify", "2"], 2, "--farm"),
    ] {
        let output = farm.run(&arguments);
        let told = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ");
        assert!(output.status.code() == Some(code) && told.contains(words), "{arguments:?}: {told}");
    }
    // A job of another version is left to others, who are told.
    let job = r#"{"version":"0.0.1","work":9,"scene":"s","output":"o.exr","from":"f","submitted":1,"priority":10,
        "state":"active","log":[]}"#;
    assert!(link(&farm).notices().update("job/9", job.as_bytes(), 0).expect("a notice").is_some());
    let _one = farm.join("one");
    farm.until_says("one", "install bottega 0.0.1 here");
    farm.until("it is in the log", || farm.log_of(9).contains("is left out: the job is for version 0.0.1"));
    // What is no job at all disturbs nobody.
    assert!(link(&farm).notices().update("job/10", b"{", 0).expect("a notice").is_some());
    assert_eq!(farm.succeed(&["jobs", "list", "--json"]).lines().count(), 1);
}

#[test]
fn a_guest_paints_and_can_do_nothing_else() {
    for server in servers() {
        let farm = Farm::start(&server);
        let plain = farm.plain();
        let [_, guest_line] = farm.lines();
        let mut guest = farm.join_by("guest", Some(&guest_line));
        farm.until_says("guest", "as a guest");
        assert!(farm.render("a.exr", &[]).wait(), "{}", farm.logs());
        assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
        let steer = farm.run(&["jobs", "cancel", "1", "--farm", &guest_line]);
        assert!(!steer.status.success());
        assert!(farm.succeed(&["jobs", "list", "--farm", &guest_line]).contains("done"), "it may look");
        hostile(&farm);
        assert!(guest.end(), "{}", farm.logs());
        assert!(painted(&farm.said("guest")) > 0.1, "{server:?}: {}", farm.logs());
    }
}

/// What a guest tries that takes its own key, and no program of ours: all of it comes to nothing.
fn hostile(farm: &Farm) {
    let members = fs::read_dir(farm.path("state/bottega/members")).expect("members").flatten();
    let file = members.map(|file| file.path()).find(|path| text(path).ends_with("-guest.json")).expect("a guest");
    let guest: Value = serde_json::from_slice(&fs::read(file).expect("a membership")).expect("JSON");
    let [seed, member] = ["seed", "member"].map(|it| guest[it].as_str().expect("text").to_owned());
    let link = link(farm);
    let before = link.notices().get("job/1").expect("a job");
    let own = NatsOptions { member: member.clone(), is_guest: true, ..options(farm, Login::NKey(seed.clone())) };
    let evil = NatsUplink::connect(&own, FarmCodec).expect("a link");
    // Jobs, leads, and the seats of others.
    for name in ["job/1", "job/77", "lead/1", "seat/other/other.1"] {
        assert!(evil.notices().put(name, b"{}").is_err(), "{name}");
        assert!(evil.notices().update(name, b"{}", 0).is_err(), "{name}");
        assert!(evil.notices().remove(name).is_err(), "{name}");
    }
    // Scenes, orders and pictures.
    assert!(evil.blobs().put("file/x", b"evil").is_err());
    // Its own seat, and pixels, which are believed only with their digest.
    assert!(evil.notices().put(&format!("seat/{member}/{member}.1"), b"{}").is_ok());
    assert!(evil.tiles().put("work-1/tile-x", b"pixels").is_ok());
    assert_eq!(link.notices().get("job/1").map(|job| job.revision), Some(before.revision));
    assert!(link.notices().get("job/77").is_none() && link.notices().get("seat/other/other.1").is_none());
    assert_eq!(link.blobs().has("file/x"), Ok(false));
    let (heard, refused) = forbidden_subjects(farm, &seed, &member);
    assert!(heard.is_empty(), "{heard:?}");
    assert!(refused >= 10, "only {refused} were refused");
}

/// Speaks as others, writes rows, touches streams and listens to others. Returns what was heard of it by somebody who may
/// hear everything, and how often the server refused.
fn forbidden_subjects(farm: &Farm, seed: &str, member: &str) -> (Vec<String>, usize) {
    use std::sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    };
    use tokio_stream::StreamExt;
    let up = fs::read(farm.path("state/bottega/server/members.json")).expect("members");
    let up: Value = serde_json::from_slice(&up).expect("JSON");
    let address = format!("tls://127.0.0.1:{}", farm.port);
    let refused = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&refused);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    let heard = runtime.block_on(async {
        let connect = |seed: &str| {
            let pin = options(farm, Login::Nobody).tls.pin.expect("a pin");
            async_nats::ConnectOptions::with_nkey(seed.to_owned())
                .require_tls(true)
                .tls_client_config(pin.client_config())
        };
        let witness = connect(up["seed"].as_str().expect("a seed")).connect(&address).await.expect("a link");
        let mut all = witness.subscribe("bottega.>").await.expect("a subscription");
        let mut rows = witness.subscribe("$KV.bottega-bottega.>").await.expect("a subscription");
        witness.flush().await.expect("an answer");
        let evil = connect(seed).custom_inbox_prefix(format!("_INBOX_{member}")).event_callback(move |event| {
            let count = Arc::clone(&count);
            async move {
                if event.to_string().contains("ermissions") {
                    count.fetch_add(1, Ordering::Relaxed);
                }
            }
        });
        let evil = evil.connect(&address).await.expect("a link");
        for subject in [
            "bottega.bottega.to.other.render-1=40other.from.work-1.master=40work-1",
            "bottega.bottega.to.work-1.master=40work-1.from.other.render-1=40other",
            "$KV.bottega-bottega.work.1.zone.0",
            "$KV.bottega-bottega-notices.job.1",
            "$JS.API.STREAM.DELETE.KV_bottega-bottega",
            "$JS.API.STREAM.PURGE.KV_bottega-bottega",
            "$JS.API.STREAM.UPDATE.KV_bottega-bottega",
            "$JS.API.STREAM.CREATE.evil",
            "$O.bottega-bottega.M.x",
            "bottega-enrol.trusted",
        ] {
            evil.publish(subject, "evil".into()).await.expect("sent");
        }
        for subject in ["bottega.>", "_INBOX.>", "$KV.>", "bottega-enrol.>"] {
            drop(evil.subscribe(subject).await.expect("asked"));
        }
        evil.flush().await.expect("an answer");
        tokio::time::sleep(Duration::from_millis(300)).await;
        let mut heard = Vec::new();
        while let Ok(Some(message)) = tokio::time::timeout(Duration::from_millis(50), all.next()).await {
            heard.push(message.subject.to_string());
        }
        while let Ok(Some(message)) = tokio::time::timeout(Duration::from_millis(50), rows.next()).await {
            heard.push(message.subject.to_string());
        }
        heard
    });
    (heard, refused.load(Ordering::Relaxed))
}

#[test]
fn an_animation_has_the_pictures_of_its_frames() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let (_one, _two) = (farm.join("one"), farm.join("two"));
    let alone = farm.path("alone-##.exr");
    let picture = ["--size", "48x36", "--spp", "64", "--quiet"];
    let frames = ["render", "goblets.glb", "--frames", "3..6", "--fps", "12"];
    farm.succeed(&[&frames[..], &picture, &["-o", text(&alone)]].concat());
    let together = farm.path("together.exr");
    farm.succeed(&[&frames[..], &picture, &["-o", text(&together), "--farm", "--threads", "1"]].concat());
    for frame in 3..=6 {
        let alone = bits(&farm.path(&format!("alone-{frame:02}.exr")));
        assert!(bits(&farm.path(&format!("together.{frame:04}.exr"))) == alone, "{frame}: {}", farm.logs());
    }
    assert!(farm.succeed(&["jobs", "list", "--json"]).is_empty(), "nobody needs the jobs any more");
    farm.until_says("one", "done");
}
