//! A platform of two processes that may die, with clients on a faulty network: in virtual time, over many seeds.
//!
//! The processes are whole: gateway, AMS, DF, Start Service and agents, as on a node; only threads and sockets are simulated.

mod clients;
mod process;
mod wires;

use std::{
    collections::BTreeMap,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use bottega_agents::{
    ActionOf, AgentId, Event, EventOf, Faults, Random, Simulator, StateMachine, Time,
    gateway::{ChannelEffect, ChannelReport, Gateway, GatewayConfig, PlainContent},
    platform::{
        Ams, AmsConfig, Df, DfConfig, Functions, LifeCycleState, Service, ServiceEntry, StandardAgent, StartService,
    },
    wire::Calendar,
};
use clients::{Boss, Client, KIND, Known, Notes, Plan, Registrar, Shared, Subscriber, Supplier};
use process::{Inner, Process};
use wires::{Weather, Wires};

fn seconds(seconds: u64) -> Time {
    Time::since_start(Duration::from_secs(seconds))
}

fn address(process: &str) -> String {
    format!("http://{process}/acc")
}

/// An agent that lives in these processes.
fn agent(name: &str, processes: &[&str]) -> AgentId {
    let addresses: Vec<String> = processes.iter().map(|process| address(process)).collect();
    AgentId { name: name.into(), addresses: addresses.into() }
}

fn calendar() -> Calendar {
    Calendar::new(Duration::from_secs(1_795_000_000))
}

/// An agent that can only be suspended.
struct Idle {
    agent: StandardAgent<Nothing>,
    is_suspended: Arc<AtomicBool>,
}

struct Nothing;

impl StateMachine for Nothing {
    type Content = PlainContent;
    type Value = String;
    type Effect = ChannelEffect;
    type Completion = ChannelReport;

    fn handle(&mut self, _: Time, _: EventOf<Self>, _: &mut Vec<ActionOf<Self>>) {}

    fn next_deadline(&self) -> Option<Time> {
        None
    }
}

impl StateMachine for Idle {
    type Content = PlainContent;
    type Value = String;
    type Effect = ChannelEffect;
    type Completion = ChannelReport;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        if event == Event::Start {
            self.is_suspended.store(false, Ordering::Relaxed);
        }
        self.agent.handle(now, event, actions);
        self.is_suspended.store(self.agent.is_suspended(), Ordering::Relaxed);
    }

    fn next_deadline(&self) -> Option<Time> {
        self.agent.next_deadline()
    }
}

fn service<F: Functions + Send + 'static>(id: &AgentId, functions: F) -> (AgentId, Inner) {
    let service = Service::<F, PlainContent, String, ChannelEffect, ChannelReport>::new(id.clone(), functions);
    (id.clone(), Box::new(service))
}

/// The part that a process serves of a platform.
#[derive(Clone)]
struct Serves {
    platform: &'static str,
    process: &'static str,
    federates: Vec<AgentId>,
    /// The agents of the process, and where they report whether they are suspended.
    residents: Vec<(AgentId, Arc<AtomicBool>)>,
}

/// Makes a process with all parts of a node.
fn node(serves: &Serves, salt: u64) -> Process {
    let Serves { platform, process, federates, residents } = serves;
    let id = |local: &str| agent(&format!("{local}@{platform}"), &[process]);
    let (acc, ams, df, start) = (id("acc"), id("ams"), id("df"), id("start"));
    let services = vec![ams.clone(), df.clone(), start.clone(), acc.clone()];
    let gateway = Gateway::<PlainContent, String>::new(GatewayConfig {
        id: acc.clone(),
        platform: (*platform).to_owned(),
        addresses: vec![address(process)],
        calendar: calendar(),
        services: services.clone(),
        administrators: Vec::new(),
        salt,
        first_forms: Default::default(),
    });
    let white = Ams::new(AmsConfig {
        id: ams.clone(),
        platform: (*platform).to_owned(),
        services,
        administrators: vec![AgentId::new("boss@j")],
        addresses: vec![address(process)],
        enters_residents: true,
        unlisted: Vec::new(),
    });
    let yellow = Df::new(DfConfig {
        id: df.clone(),
        calendar: calendar(),
        lease_max: None,
        administrators: Vec::new(),
        federates: federates.clone(),
        salt,
    });
    let basic = ServiceEntry { id: "ams".into(), service_type: "fipa-ams".into(), addresses: vec![address(process)] };
    let mut agents: Vec<(AgentId, Inner)> = vec![
        (acc, Box::new(gateway)),
        service(&ams, white),
        service(&df, yellow),
        service(&start, StartService::new(vec![basic])),
    ];
    agents.extend(residents.iter().map(|(id, is_suspended)| {
        let agent = StandardAgent::new(id.clone(), ams.clone(), Nothing);
        (id.clone(), Box::new(Idle { agent, is_suspended: Arc::clone(is_suspended) }) as Inner)
    }));
    Process::new(platform, agents)
}

/// A process of strangers.
fn strangers(platform: &str, clients: Vec<(AgentId, Inner)>) -> Process {
    let acc = agent(&format!("acc@{platform}"), &[platform]);
    let gateway = Gateway::<PlainContent, String>::new(GatewayConfig {
        id: acc.clone(),
        platform: platform.to_owned(),
        addresses: vec![address(platform)],
        calendar: calendar(),
        services: Vec::new(),
        administrators: Vec::new(),
        salt: 99,
        first_forms: Default::default(),
    });
    let mut agents: Vec<(AgentId, Inner)> = vec![(acc, Box::new(gateway))];
    agents.extend(clients);
    Process::new(platform, agents)
}

const REGISTRARS: usize = 4;
const SUBSCRIBERS: usize = 2;

/// The state of the second process after the last fault.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Second {
    Lives,
    IsDead,
}

struct Play {
    simulator: Simulator<Process, Wires>,
    notes: Shared,
    suspended: BTreeMap<AgentId, Arc<AtomicBool>>,
    /// The time at which the faults end.
    until: Time,
}

/// Starts all processes.
fn stage(seed: u64, weather: Weather, faults: Faults) -> Play {
    let notes: Shared = Arc::new(Mutex::new(Notes::default()));
    let (until, calm) = (weather.until, weather.until + Duration::from_secs(150));
    let at = ["b1", "b2", "c", "j", "mute"].map(|process| (address(process), AgentId::new(process)));
    let mut simulator = Simulator::new(seed, faults, Wires::new(seed, weather, at.into()));
    let suspended: Vec<(AgentId, Arc<AtomicBool>)> =
        ["r1", "r2"].map(|name| (AgentId::new(format!("{name}@b")), Arc::default())).into();
    // One that answers, one that takes messages and is silent, one where nobody listens.
    let federates = vec![agent("df@c", &["c"]), agent("df@m", &["mute"]), agent("df@s", &["nowhere"])];
    let add = |simulator: &mut Simulator<Process, Wires>, serves: Serves, salt: u64| {
        let mut life = 0;
        simulator.add(&AgentId::new(serves.process), false, move || {
            life += 1;
            node(&serves, salt << 8 | life)
        });
    };
    let second = |number: usize| vec![suspended[number].clone()];
    let (b1, b2) = (second(0), second(1));
    add(&mut simulator, Serves { platform: "b", process: "b1", federates: federates.clone(), residents: b1 }, 1);
    add(&mut simulator, Serves { platform: "b", process: "b2", federates, residents: b2 }, 2);
    let df = agent("df@b", &["b1", "b2"]);
    add(&mut simulator, Serves { platform: "c", process: "c", federates: vec![df], residents: Vec::new() }, 3);
    simulator.add(&AgentId::new("mute"), false, || {
        strangers("m", vec![(agent("df@m", &["mute"]), Box::new(Nothing) as Inner)])
    });
    let people = Arc::clone(&notes);
    simulator.add(&AgentId::new("j"), false, move || strangers("j", clients(seed, calm, &people)));
    Play { simulator, notes, suspended: suspended.into_iter().collect(), until }
}

fn clients(seed: u64, until: Time, notes: &Shared) -> Vec<(AgentId, Inner)> {
    fn client<W: Plan + Send + 'static>(
        name: &str,
        wish: W,
        notes: &Shared,
        seed: u64,
        until: Time,
    ) -> (AgentId, Inner) {
        let me = agent(name, &["j"]);
        (me.clone(), Box::new(Client::new(me, wish, Arc::clone(notes), seed, until)))
    }
    // Some clients know one address first, some the other.
    let service = |local: &str, number: usize| {
        let ways = if number.is_multiple_of(2) { ["b1", "b2"] } else { ["b2", "b1"] };
        agent(&format!("{local}@b"), &ways)
    };
    let mut all: Vec<(AgentId, Inner)> = Vec::new();
    for number in 0..REGISTRARS {
        let name = format!("reg{number}@j");
        let me = agent(&name, &["j"]);
        // The last one searches with many hops.
        let depth = if number + 1 == REGISTRARS { 2 } else { 0 };
        let wish = Registrar { me, df: service("df", number), known: Known::Absent, version: 0, depth };
        all.push(client(&name, wish, notes, seed * 31 + number as u64, until));
    }
    let agents = ["r1@b", "r2@b"].map(AgentId::new).to_vec();
    all.push(client("boss@j", Boss { ams: service("ams", 0), agents }, notes, seed * 31 + 20, until));
    all.push(client("sup@j", Supplier { start: service("start", 1), number: 0 }, notes, seed * 31 + 21, until));
    for number in 0..SUBSCRIBERS {
        let me = agent(&format!("sub{number}@j"), &["j"]);
        let (df, notes) = (service("df", number), Arc::clone(notes));
        all.push((me.clone(), Box::new(Subscriber { me, df, notes, conversation: 1, again: None })));
    }
    all
}

/// Runs until no faults and no messages are left.
fn play(seed: u64, weather: Weather, faults: Faults, dies_every: Option<Duration>, second: Second) -> Play {
    let mut play = stage(seed, weather, faults);
    let mut random = Random::new(seed ^ 0xdead);
    let ids = ["b1", "b2"].map(AgentId::new);
    let mut now = seconds(5);
    if let Some(mean) = dies_every {
        while now < play.until {
            now = now + mean.mul_f64(2.0 * random.unit());
            if now >= play.until {
                break;
            }
            play.simulator.run_until(now);
            // Sometimes both.
            let who = random.below(7);
            let dead: Vec<&AgentId> =
                ids.iter().enumerate().filter(|(number, _)| who == 6 || who % 2 == *number).map(|(_, id)| id).collect();
            dead.iter().for_each(|id| play.simulator.crash(id));
            now = now + Duration::from_secs_f64(20.0 * random.unit() * random.unit());
            play.simulator.run_until(now);
            dead.iter().for_each(|id| play.simulator.start(id));
        }
    }
    play.simulator.run_until(play.until);
    if second == Second::IsDead {
        play.simulator.crash(&ids[1]);
    }
    play.simulator.run_until(play.until + Duration::from_secs(400));
    play
}

/// The entries of platform b's store under this folder, by name.
fn pages(play: &Play, folder: &str) -> BTreeMap<String, String> {
    let prefix = bottega_agents::Key::from(format!("b:{folder}"));
    let all = play.simulator.store().with_prefix(&prefix).filter(|entry| !entry.value.is_empty());
    let name = |key: &bottega_agents::Key| key.to_string().split_off(prefix.to_string().len());
    all.map(|entry| (name(&entry.key), entry.value.clone())).collect()
}

fn check(play: &Play, second: Second, seed: u64) -> Vec<String> {
    let notes = play.notes.lock().unwrap();
    let mut wrong = notes.wrong.clone();
    let calm = play.until + Duration::from_secs(30);
    wrong.extend(
        notes
            .unanswered
            .iter()
            .filter(|(requested_at, _)| *requested_at > calm)
            .map(|who| format!("no answer: {who:?}")),
    );
    let entered = pages(play, "df/agent/");
    let now = play.simulator.now();
    for (agent, offer) in &notes.entered {
        let must = offer.as_ref().is_some_and(|offer| offer.lease_time.is_none_or(|end| now < end));
        let is = entered.get(&*agent.name);
        let says = |text: &String| offer.iter().all(|offer| text.contains(offer.services[0].name.as_deref().unwrap()));
        if must != is.is_some() || must && !is.is_some_and(says) {
            wrong.push(format!("{agent} registered {offer:?}, and the directory has {is:?}"));
        }
    }
    let offers: BTreeMap<&String, &String> = entered.iter().filter(|(_, text)| text.contains(KIND)).collect();
    for subscriber in (0..SUBSCRIBERS).map(|number| agent(&format!("sub{number}@j"), &[])) {
        let nothing = BTreeMap::new();
        let view = notes.views.get(&subscriber).unwrap_or(&nothing);
        let same = view.len() == offers.len()
            && view.iter().all(|(name, service)| offers.get(name).is_some_and(|text| text.contains(service)));
        if !same {
            wrong.push(format!("{subscriber} believes {view:?}, and it is {offers:?}"));
        }
    }
    let white = pages(play, "ams/agent/");
    for (number, (agent, is_suspended)) in play.suspended.iter().enumerate() {
        if second == Second::IsDead && number == 1 {
            continue;
        }
        let Some(entry) = white.get(&*agent.name) else {
            wrong.push(format!("{agent} lives and is not in the white pages"));
            continue;
        };
        let is_suspended = is_suspended.load(Ordering::Relaxed);
        if is_suspended != entry.contains("suspended") {
            wrong.push(format!("{agent} is suspended: {is_suspended}, and its entry says {entry}"));
        }
        if let Some(state) = notes.states.get(agent)
            && (*state == LifeCycleState::Suspended) != is_suspended
        {
            wrong.push(format!("{agent} is suspended: {is_suspended}, and was last made {state:?}"));
        }
    }
    let nodes = pages(play, "ams/node/");
    for process in ["b1", "b2"] {
        if !nodes.contains_key(&address(process)) {
            wrong.push(format!("{process} is not among the processes of the platform: {nodes:?}"));
        }
    }
    wrong.into_iter().map(|wrong| format!("seed {seed}: {wrong}")).collect()
}

fn weather(seed: u64) -> Weather {
    Weather {
        lost: 0.08 * (seed % 3) as f64,
        unanswered: 0.05 * (seed / 3 % 3) as f64,
        twice: 0.05 * (seed % 2) as f64,
        late: Duration::from_millis(2000 * (seed / 2 % 2) + 100),
        until: seconds(400),
    }
}

/// Faults only on the way to the store: agents of a process always hear each other.
fn faults(seed: u64, until: Time) -> Faults {
    Faults {
        latency_min: Duration::from_millis(1),
        latency_extra_mean: Duration::from_millis(20 * (seed % 3)),
        loss: 0.04 * (seed / 2 % 3) as f64,
        until,
        ..Faults::NONE
    }
}

#[test]
fn in_good_weather_all_is_well() {
    let weather = Weather { lost: 0.0, unanswered: 0.0, twice: 0.0, late: Duration::ZERO, until: seconds(400) };
    let play = play(1, weather, Faults::NONE, None, Second::Lives);
    assert_eq!(check(&play, Second::Lives, 1), Vec::<String>::new());
    let notes = play.notes.lock().unwrap();
    assert!(notes.ends["done"] > 80 && !notes.ends.contains_key("silence") && !notes.ends.contains_key("failed"));
    assert!(notes.supplied.len() > 3 && notes.views.len() == SUBSCRIBERS, "{notes:#?}");
}

#[test]
fn whatever_goes_wrong_what_a_platform_has_said_is_so() {
    let (mut wrong, mut ends) = (Vec::new(), BTreeMap::<&str, u32>::new());
    for seed in 0..300_u64 {
        let second = if seed % 4 == 1 { Second::IsDead } else { Second::Lives };
        let dies_every = (!seed.is_multiple_of(5)).then(|| Duration::from_secs(20 + seed % 3 * 30));
        let weather = weather(seed);
        let play = play(seed, weather, faults(seed, weather.until), dies_every, second);
        wrong.extend(check(&play, second, seed));
        for (end, count) in &play.notes.lock().unwrap().ends {
            *ends.entry(end).or_default() += count;
        }
    }
    assert!(wrong.is_empty(), "{} of {ends:?}:\n{}", wrong.len(), wrong[..wrong.len().min(40)].join("\n"));
    // There were faults.
    for end in ["done", "already", "not there", "failed", "silence"] {
        assert!(ends.get(end).is_some_and(|count| *count > 10), "{ends:?}");
    }
}
