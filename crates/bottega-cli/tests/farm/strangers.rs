//! Agents of other platforms that paint: one with JADE's messages over a real socket, and the one in Python, with Mitsuba.

use std::{
    cell::Cell,
    fs,
    io::{Read, Write},
    net::{SocketAddr, TcpStream},
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use super::jade::{Jade, Line, TAKEN, is};
use bottega_agents::{
    Performative as P,
    sl::{self, Term},
    wire::WireMessage,
};
use bottega_image::{ExrOptions, Metadata, read_picture};

use super::{
    fixture::{Farm, Process},
    support::{servers, text},
};

const ROOM: &str = r#"<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="6"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="39"/>
    <transform name="to_world"><lookat origin="0.3, -4, 1.4" target="0, 0, 0.6" up="0, 0, 1"/></transform>
    <sampler type="independent"><integer name="sample_count" value="16"/></sampler>
    <film type="hdrfilm"><integer name="width" value="96"/><integer name="height" value="72"/><rfilter type="box"/></film>
  </sensor>
  <bsdf type="twosided" id="gray"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></bsdf>
  <shape type="sphere"><point name="center" x="0" y="0" z="0.7"/><float name="radius" value="0.7"/><ref id="gray"/></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="5"/></transform><ref id="gray"/></shape>
  <emitter type="constant"><rgb name="radiance" value="0.7, 0.8, 1"/></emitter>
</scene>"#;

fn room(farm: &Farm) -> PathBuf {
    let path = farm.path("room.xml");
    fs::write(&path, ROOM).expect("a file");
    path
}

/// The address of the farm's platform.
fn platform(farm: &Farm) -> SocketAddr {
    farm.until_says("up.log", "FIPA platform at ");
    let said = farm.said("up.log");
    let at = said.split("FIPA platform at http://").nth(1).and_then(|text| text.split('/').next());
    at.and_then(|at| at.parse().ok()).expect("an address")
}

/// A job that admits strangers.
fn paint(farm: &Farm, name: &str, spp: &str, more: &[&str]) -> Process {
    let (scene, output) = (room(farm), farm.path(name));
    let words =
        ["render", text(&scene), "-o", text(&output), "--farm", "--strangers", "--spp", spp, "--set=work.zones=12"];
    farm.spawn(&[&words[..], &["--threads", "1", "--quiet"], more].concat(), &format!("{name}.log"))
}

/// An agent on a platform that speaks as JADE does.
struct Stranger {
    jade: Jade,
    at: SocketAddr,
    number: Cell<u32>,
}

impl Stranger {
    fn say(&self, act: &str, to: &str, conversation: &str, content: &str) {
        self.number.set(self.number.get() + 1);
        let number = self.number.get();
        let message = self.jade.says_to(9, self.at, |body| {
            let (begin, end) = (body.find("(REQUEST").expect("a message"), body.rfind(")\r\n--").expect("its end"));
            let head = body[..begin].replace("df@bottega", to);
            let content = content.replace('"', "\\\"");
            format!(
                "{head}({act}\n :sender  ( agent-identifier :name probe@jade  :addresses (sequence {} ))\n :receiver  (set ( \
                 agent-identifier :name {to}  :addresses (sequence http://{}/acc )) )\n :content  \"{content}\" \n \
                 :reply-with  rw-{number}  :language  fipa-sl  :ontology  bottega-painting  :protocol  fipa-contract-net\n \
                 :conversation-id  {conversation} {}",
                self.jade.address(),
                self.at,
                &body[end..]
            )
        });
        assert_eq!(Line::to_address(self.at).ask(&message), TAKEN);
    }

    /// The next message that is one of these acts; others are passed over.
    fn hears(&self, acts: &[P]) -> WireMessage {
        loop {
            let message = self.jade.hear().message;
            if acts.contains(&message.performative) {
                return message;
            }
        }
    }
}

fn expressions(message: &WireMessage) -> Vec<Term> {
    sl::parse(message.content.as_deref().unwrap_or_default()).expect("SL")
}

/// The value of a parameter, wherever it stands.
fn find<'a>(term: &'a Term, key: &str) -> Option<&'a Term> {
    let Term::List(terms) = term else { return None };
    let direct = terms.windows(2).find(|pair| pair[0] == Term::Bare(format!(":{key}"))).map(|pair| &pair[1]);
    direct.or_else(|| terms.iter().find_map(|term| find(term, key)))
}

fn value(message: &WireMessage, key: &str) -> String {
    let terms = expressions(message);
    let found = terms.iter().find_map(|term| find(term, key)).and_then(Term::as_str);
    found.unwrap_or_else(|| panic!("no {key} in {message:?}")).to_owned()
}

/// The status of a PUT.
fn put(url: &str, bytes: &[u8]) -> String {
    let (host, path) = url.trim_start_matches("http://").split_once('/').expect("a path");
    let mut stream = TcpStream::connect(host).expect("the desk listens");
    let head =
        format!("PUT /{path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\nContent-Length: {}\r\n\r\n", bytes.len());
    stream.write_all(head.as_bytes()).expect("sent");
    // It may be refused before all of it is sent.
    _ = stream.write_all(bytes);
    let mut answer = String::new();
    _ = stream.read_to_string(&mut answer);
    answer.split(' ').nth(1).unwrap_or_default().to_owned()
}

/// A picture of one color, as the bytes of an EXR file.
fn plain(folder: &Path, width: u32, height: u32, value: f32) -> Vec<u8> {
    let path = folder.join("zone.exr");
    let picture = bottega_image::Picture { width, height, data: vec![[value; 3]; (width * height) as usize] };
    bottega_image::write_picture_exr(&path, &picture, &Metadata::default(), ExrOptions::default()).expect("written");
    fs::read(path).expect("read")
}

/// A request or an award, as the JADE agent sees it.
struct ObservedZone {
    zone: String,
    order: String,
    deliver: String,
    size: (u32, u32),
}

impl ObservedZone {
    fn of(message: &WireMessage) -> Self {
        let number = |key: &str| value(message, key).parse::<u32>().expect("a number");
        Self {
            zone: value(message, "zone"),
            order: value(message, "order"),
            deliver: value(message, "deliver"),
            size: (number("x1") - number("x0"), number("y1") - number("y0")),
        }
    }

    fn done(&self) -> String {
        format!(
            "((done (action (agent-identifier :name probe@jade) (paint :zone {} :order {}))))",
            self.zone, self.order
        )
    }
}

#[test]
fn a_stranger_in_the_words_of_jade_is_called_promises_and_paints_and_what_is_wrong_is_refused() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let at = platform(&farm);
    let stranger = Stranger { jade: Jade::start(), at, number: Cell::new(0) };
    let mut render = paint(&farm, "a.exr", "3000", &[]);
    let master = "master-1@bottega";
    farm.until("the Master is in the yellow pages", || {
        farm.succeed(&["platform", "services", "--at", &format!("http://{at}/acc")]).contains(master)
    });
    // Messages of agents that have not subscribed are ignored.
    stranger.say("INFORM", master, "c-0", "((done (action S (paint :zone 1 :order 2))))");
    assert!(is(&stranger.jade.hear().message, P::Refuse).contains("(not-subscribed)"));
    let wish = "((iota ?w (paints :agent (agent-identifier :name probe@jade) :power 0.1 :work ?w)))";
    stranger.say("SUBSCRIBE", master, "c-1", wish);
    is(&stranger.jade.hear().message, P::Agree);
    let work = stranger.hears(&[P::Inform]);
    assert_eq!((value(&work, "scene"), value(&work, "samples")), ("room.xml".to_owned(), "3000".to_owned()));
    // A call with a wrong answer, and another one with a correct answer.
    let bid = |zone: &str, seconds: &str| {
        format!(
            "((action (agent-identifier :name probe@jade) (paint :zones (sequence (zone :number {zone} :seconds \
             {seconds})))) (room 1))"
        )
    };
    let mut is_rejected = false;
    let award = loop {
        let message = stranger.hears(&[P::CallForProposal, P::AcceptProposal, P::Request, P::RejectProposal]);
        match message.performative {
            P::CallForProposal => {
                let zone = if is_rejected { value(&message, "number") } else { "4000".to_owned() };
                let conversation = message.conversation_id.clone().expect("a conversation");
                stranger.say("PROPOSE", master, &conversation, &bid(&zone, "0.001"));
            }
            P::RejectProposal => is_rejected |= is(&message, P::RejectProposal).contains("(not-offered"),
            P::AcceptProposal => break message,
            // The first samples of a zone.
            _ => {
                let seen = ObservedZone::of(&message);
                let (width, height) = seen.size;
                assert_eq!(put(&seen.deliver, &plain(&farm.path("."), width, height, 0.5)), "201");
                stranger.say("INFORM", master, &message.conversation_id.expect("a conversation"), &seen.done());
            }
        }
    };
    assert!(is_rejected);
    let (seen, conversation) = (ObservedZone::of(&award), award.conversation_id.clone().expect("a conversation"));
    let (width, height) = seen.size;
    // Wrong sizes, bytes that are not a picture, another key, too much, and a report before the work is done.
    assert_eq!(put(&seen.deliver, &plain(&farm.path("."), width + 1, height, 0.5)), "422");
    assert_eq!(put(&seen.deliver, &plain(&farm.path("."), width, height, f32::NAN)), "422");
    assert_eq!(put(&seen.deliver, b"no picture"), "422");
    assert_eq!(put(&seen.deliver.replace("/results/", "/results/0"), b"x"), "404");
    assert_eq!(put(&seen.deliver, &vec![0; 100 << 20]), "413");
    stranger.say("INFORM", master, &conversation, &seen.done());
    assert!(is(&stranger.hears(&[P::Disconfirm]), P::Disconfirm).contains("(nothing-delivered)"));
    assert_eq!(put(&seen.deliver, &plain(&farm.path("."), width, height, 0.5)), "201");
    stranger.say("INFORM", master, &conversation, &seen.done());
    farm.until("it is on the Blackboard", || {
        let rows = farm.succeed(&["blackboard", "1", "--json"]);
        rows.lines().any(|row| row.contains("probe@stranger-jade") && row.contains("\"done\""))
    });
    // Its reports for zones of others, or for finished zones, do not count.
    stranger.say("INFORM", master, &conversation, &seen.done());
    assert!(is(&stranger.hears(&[P::Disconfirm]), P::Disconfirm).contains("(not-your-order)"));
    // It leaves, and the picture is completed all the same.
    stranger.say("CANCEL", master, "c-1", wish);
    assert!(is(&stranger.hears(&[P::Inform]), P::Inform).starts_with("((done (iota"));
    assert!(render.wait(), "{}", farm.logs());
    let log = farm.log_of(1);
    assert!(log.contains("agents of other platforms may take part: master-1@bottega"), "{log}");
    let picture = read_picture(farm.path("a.exr")).expect("a picture");
    assert!(picture.data.contains(&[0.5; 3]), "what it painted is in the picture");
}

#[test]
fn a_stranger_that_paints_something_else_is_found_out() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let at = platform(&farm);
    let _one = farm.join("one");
    let stranger = Stranger { jade: Jade::start(), at, number: Cell::new(0) };
    let mut render = paint(&farm, "a.exr", "3000", &["--verify=2"]);
    farm.until("the Master is in the yellow pages", || {
        farm.succeed(&["platform", "services", "--at", &format!("http://{at}/acc")]).contains("master-1@bottega")
    });
    stranger.say("SUBSCRIBE", "master-1@bottega", "c-1", "((iota ?w (paints :work ?w)))");
    loop {
        let message = stranger.hears(&[P::Request, P::AcceptProposal, P::Failure, P::Inform]);
        match message.performative {
            P::Failure => break assert!(is(&message, P::Failure).contains("left-out"), "{message:?}"),
            P::Inform if is(&message, P::Inform).starts_with("((done") => break,
            P::Inform => {}
            _ => {
                let seen = ObservedZone::of(&message);
                put(&seen.deliver, &plain(&farm.path("."), seen.size.0, seen.size.1, 9.0));
                let conversation = message.conversation_id.expect("a conversation");
                stranger.say("INFORM", "master-1@bottega", &conversation, &seen.done());
            }
        }
    }
    assert!(render.wait(), "{}", farm.logs());
    assert!(farm.log_of(1).contains("probe@stranger-jade is left out: what it painted of"), "{}", farm.log_of(1));
    let picture = read_picture(farm.path("a.exr")).expect("a picture");
    assert!(picture.data.iter().flatten().all(|value| *value < 5.0), "nothing of it is in the picture");
}

/// The Python in which Mitsuba is.
fn python() -> PathBuf {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let of_all = set("BOTTEGA_ENGINE_PYTHON").map(|it| if it.is_dir() { it.join("bin/python3") } else { it });
    set("BOTTEGA_MITSUBA_PYTHON").or(of_all).unwrap_or_else(|| "python3".into())
}

#[test]
fn the_agent_in_python_wins_zones_and_the_picture_agrees_with_ours() {
    let Some(server) = servers().pop() else { return };
    let has_mitsuba = Command::new(python()).args(["-c", "import mitsuba"]).stderr(Stdio::null()).status();
    if !has_mitsuba.is_ok_and(|status| status.success()) {
        return eprintln!("SKIPPED: there is no Mitsuba for {}; `cargo xtask test` installs it", python().display());
    }
    let farm = Farm::start(&server);
    let at = platform(&farm);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/stranger/stranger.py");
    let said = farm.path("stranger.log");
    let log = fs::File::create(&said).expect("a log");
    let mut agent = Command::new(python());
    agent.arg(script).args(["--platform", &format!("http://{at}/acc"), "--verbose"]);
    agent.stdout(log.try_clone().expect("a log")).stderr(log);
    let mut agent = Process(agent.spawn().expect("Python starts"));
    // The stranger is there first: it takes long to start on a busy machine.
    farm.until_says("stranger.log", "waits for a picture");
    let mut render = paint(&farm, "a.exr", "2000", &[]);
    assert!(render.wait(), "{}", farm.logs());
    assert!(agent.wait(), "{}", farm.logs());
    let log = farm.said("stranger.log");
    assert!(log.contains("takes part") && log.contains("the picture is painted, "), "{log}");
    let rows = farm.succeed(&["blackboard", "1", "--json"]);
    let of_stranger = rows.lines().filter(|row| row.contains("mitsuba@stranger-")).count();
    assert!(of_stranger > 0 && of_stranger < rows.lines().count(), "both paint: {}", farm.logs());
    let plain = farm.path("plain.exr");
    let words =
        ["render", text(&room(&farm)), "-o", text(&plain), "--spp=2000", "--seed=3", "--quiet"].map(str::to_owned);
    farm.succeed(&words.iter().map(String::as_str).collect::<Vec<_>>());
    let diff = farm.succeed(&["diff", text(&farm.path("a.exr")), text(&plain), "--json"]);
    let diff: serde_json::Value = serde_json::from_str(&diff).expect("JSON");
    let flip = diff["flip"].as_f64().expect("a number");
    assert!(flip < 0.03, "{diff}");
    let [one, other] = [farm.path("a.exr"), plain].map(|path| {
        let picture = read_picture(path).expect("a picture");
        picture.data.iter().flatten().map(|value| f64::from(*value)).sum::<f64>() / picture.data.len() as f64
    });
    assert!((one / other - 1.0).abs() < 0.01, "{one} {other}");
}
