//! Messages to a Master that are late, doubled, out of sequence or simply wrong.

use std::{sync::Arc, time::Duration};

use bottega_agents::{
    AclMessage, Action, AgentId, Event, Performative, Revision, StateMachine, Time, bus::BlobId, store::MemoryStore,
};
use bottega_engines::Tunables;
use bottega_farm::{
    AdaptationRule, AuctionRule, Bid, Choice, Expert, FarmAction, FarmCompletion, FarmContent, FarmEffect, FarmEvent,
    FarmMessage, FarmValue, Foreknowledge, Goal, GoalRules, Holding, ImportanceFunction, Level, LifeCycle, Master,
    MasterConfig, ONTOLOGY, Optimization, Order, Painting, PartitionSettings, RelativePower, RenderAgent,
    RenderAgentConfig, Report, ResultRef, Timing, WorkId, WorkSettings, ZoneId, ZoneState, analyze,
};
use bottega_image::Rect;
use proptest::prelude::*;

use crate::common::survey::{survey, tunables};

/// A Master over a store of its own. Its messages and effects are recorded.
struct Stage {
    master: Master,
    store: MemoryStore<FarmValue>,
    sent: Vec<FarmMessage>,
    composed: Vec<ZoneId>,
    now: Time,
}

fn settings() -> WorkSettings {
    let frame = Rect::of_size(64, 64);
    let (goal, optimization) = (Goal::Samples, Optimization::Off);
    WorkSettings { picture: frame, frame, samples: 40, goal, tunables: tunables(), optimization }
}

impl Stage {
    fn new() -> Self {
        let (work, settings) = (WorkId(1), settings());
        let partition = PartitionSettings::for_agents(Level::Divided, 2, settings.frame);
        let knowledge = Foreknowledge::default();
        let all = analyze(work, &settings, &survey(16, 16), ImportanceFunction::Paper, &partition, &knowledge, false)
            .unwrap();
        let config = Self::config();
        let master = Master::recover(config, all.work, all.rows);
        let now = Time::since_start(Duration::from_secs(1));
        let mut stage = Self { master, store: MemoryStore::default(), sent: Vec::new(), composed: Vec::new(), now };
        stage.feed(Event::Start);
        stage
    }

    fn config() -> MasterConfig {
        MasterConfig {
            id: AgentId::new("master"),
            work: WorkId(1),
            auction: AuctionRule::FinishingTime,
            prefetch: 2,
            shares_tail: true,
            verify: 1,
            compares_by_look: false,
            secret: 7,
            credits: Arc::default(),
            goals: GoalRules::default(),
            timing: Timing::default(),
            registration: None,
        }
    }

    fn feed(&mut self, event: FarmEvent) {
        let mut events = vec![event];
        while !events.is_empty() {
            let mut actions = Vec::new();
            self.master.handle(self.now, events.remove(0), &mut actions);
            for action in actions {
                match action {
                    Action::Send(message) => self.sent.push(message),
                    Action::Store { ticket, request } => {
                        let mut replies = Vec::new();
                        self.store.handle((), ticket, request, &mut replies);
                        let replies = replies.into_iter();
                        events.extend(replies.map(|it| Event::Store { ticket: it.ticket, reply: it.reply }));
                    }
                    Action::Effect(FarmEffect::Compose { zone, .. }) => self.composed.push(zone),
                    _ => {}
                }
            }
        }
    }

    fn tell(&mut self, from: &str, performative: Performative, content: FarmContent) {
        self.feed(Event::Message(message(from, performative, content)));
    }

    fn subscribe(&mut self, name: &str) {
        let content = FarmContent::Subscription { power: RelativePower::REFERENCE, lanes: 1.0 };
        self.tell(name, Performative::Subscribe, content);
    }

    /// The first order that was sent to an agent.
    fn order(&self, agent: &str) -> Order {
        let to = AgentId::new(agent);
        let orders = self.sent.iter().filter(|message| message.receivers.contains(&to));
        let order = |message: &FarmMessage| match &message.content {
            FarmContent::Profile(order) | FarmContent::Award(order) => Some(order.clone()),
            _ => None,
        };
        orders.filter_map(order).next().expect("an order")
    }

    /// The last order that was sent to an agent.
    fn last_order(&self, agent: &str) -> Order {
        let to = AgentId::new(agent);
        let orders = self.sent.iter().rev().filter(|message| message.receivers.contains(&to));
        let order = |message: &FarmMessage| match &message.content {
            FarmContent::Profile(order) | FarmContent::Award(order) => Some(order.clone()),
            _ => None,
        };
        orders.filter_map(order).next().expect("an order")
    }

    /// A new Master over the same blackboard.
    fn rebirth(&mut self) {
        self.master = Master::new(Self::config());
        self.feed(Event::Start);
    }

    fn last_word(&self) -> Performative {
        self.sent.last().expect("an answer").performative
    }

    fn state(&self, zone: ZoneId) -> ZoneState {
        self.master.board().zone(zone).expect("a zone").1.state
    }
}

fn message(from: &str, performative: Performative, content: FarmContent) -> FarmMessage {
    AclMessage {
        performative,
        sender: AgentId::new(from),
        receivers: vec![AgentId::new("master")],
        content,
        language: "bottega-typed",
        ontology: ONTOLOGY,
        protocol: "fipa-contract-net",
        conversation_id: 1,
        reply_with: 1,
        in_reply_to: 0,
        reply_by: None,
    }
}

fn painting(order: &Order, samples: u32) -> Painting {
    Painting {
        choice: Choice::unchanged(&order.work.settings),
        result: ResultRef { fence: order.fence, samples, digest: BlobId([1; 32]) },
        time_measured: Duration::from_millis(5),
        goal: 40,
        time_left: Duration::from_millis(95),
        busy: Duration::from_millis(5),
        is_measured: true,
        was_ready: true,
        error: None,
    }
}

fn report(order: &Order, painting: Painting) -> FarmContent {
    FarmContent::Report(Arc::new(Report {
        zone: order.row.zone,
        fence: order.fence,
        outcome: Ok(painting),
        reasons: None,
    }))
}

#[test]
fn a_good_report_is_confirmed_and_its_double_too_without_effect() {
    let mut stage = Stage::new();
    stage.subscribe("a");
    let order = stage.order("a");
    for _ in 0..2 {
        stage.tell("a", Performative::Inform, report(&order, painting(&order, 2)));
        assert_eq!(stage.state(order.row.zone), ZoneState::Profiled);
        let confirmed = |message: &&FarmMessage| message.performative == Performative::Confirm;
        assert!(stage.sent.iter().rev().take(3).any(|message| confirmed(&message)));
    }
    assert_eq!(stage.master.board().zone(order.row.zone).unwrap().1.attempt, 0);
}

#[test]
fn a_report_under_an_old_or_foreign_order_is_refused() {
    let mut stage = Stage::new();
    stage.subscribe("a");
    let order = stage.order("a");
    let mut old = order.clone();
    old.fence = Revision(order.fence.0 - 1);
    stage.tell("a", Performative::Inform, report(&old, painting(&old, 2)));
    assert_eq!((stage.last_word(), stage.state(order.row.zone)), (Performative::Disconfirm, ZoneState::Profiling));
    stage.tell("stranger", Performative::Inform, report(&order, painting(&order, 2)));
    assert_eq!((stage.last_word(), stage.state(order.row.zone)), (Performative::Disconfirm, ZoneState::Profiling));
    let mut nowhere = order.clone();
    std::sync::Arc::make_mut(&mut nowhere.row).zone = ZoneId(4_000_000);
    stage.tell("a", Performative::Inform, report(&nowhere, painting(&nowhere, 2)));
    assert_eq!(stage.last_word(), Performative::Disconfirm);
}

#[test]
fn settings_and_samples_that_nobody_allowed_are_refused_and_the_zone_is_open_again() {
    type Spoil = fn(&mut Painting);
    let spoils: [Spoil; 8] = [
        |it| it.choice.samples = 39,
        |it| it.choice.tunables = Tunables { max_depth: 9, light_samples: 1 },
        |it| it.result.samples = 41,
        |it| it.result.samples = 0,
        |it| it.result.fence = Revision(99),
        |it| it.time_left = Duration::MAX,
        |it| it.time_measured = Duration::MAX,
        |it| it.error = Some(f64::NAN),
    ];
    for spoil in spoils {
        let mut stage = Stage::new();
        stage.subscribe("a");
        let order = stage.order("a");
        let mut spoiled = painting(&order, 2);
        spoil(&mut spoiled);
        stage.tell("a", Performative::Inform, report(&order, spoiled));
        assert!(stage.sent.iter().any(|message| message.performative == Performative::Disconfirm), "{spoiled:?}");
        let row = stage.master.board().zone(order.row.zone).unwrap().1;
        assert_eq!(row.attempt, 1);
        assert!(row.result.is_none());
    }
}

#[test]
fn who_fails_three_times_is_left_out_unless_nobody_else_is_here() {
    let mut stage = Stage::new();
    stage.subscribe("a");
    let fail = |stage: &mut Stage| {
        let order = stage.last_order("a");
        let (zone, fence) = (order.row.zone, order.fence);
        let report = Report { zone, fence, outcome: Err("no paint".to_owned()), reasons: None };
        stage.tell("a", Performative::Failure, FarmContent::Report(Arc::new(report)));
        zone
    };
    let left_out = |stage: &Stage, agent: &str| {
        let to = AgentId::new(agent);
        stage.sent.iter().any(|it| it.receivers.contains(&to) && matches!(it.content, FarmContent::LeftOut { .. }))
    };
    (0..4).for_each(|_| _ = fail(&mut stage));
    assert!(!left_out(&stage, "a"), "it is the only one");
    stage.subscribe("b");
    let zone = fail(&mut stage);
    assert!(left_out(&stage, "a"));
    assert_ne!(stage.state(zone), ZoneState::Failed, "the failures of one who is left out do not count");
    let attempts: u32 = stage.master.board().zones().map(|row| row.attempt).sum();
    assert_eq!(attempts, 0);
    // It is known on the blackboard, and refused with the reason; a new Master knows it too.
    let row = stage.master.board().agent(&AgentId::new("a")).expect("a row");
    assert!(row.left_out.as_ref().is_some_and(|reason| reason.contains("no paint")), "{row:?}");
    stage.subscribe("a");
    let last = stage.sent.last().expect("an answer");
    assert!(matches!(&last.content, FarmContent::LeftOut { reason } if reason.contains("no paint")), "{last:?}");
    stage.rebirth();
    stage.subscribe("a");
    assert!(matches!(stage.sent.last().expect("an answer").content, FarmContent::LeftOut { .. }));
    // When all others are gone it may try again: then the failing zone is reported.
    stage.tell("b", Performative::Cancel, FarmContent::Unsubscription);
    let before = stage.sent.len();
    stage.subscribe("a");
    assert!(stage.sent[before..].iter().any(|message| message.performative == Performative::Agree));
}

#[test]
fn an_order_that_stands_still_is_taken_back_and_one_that_goes_on_slowly_is_not() {
    let mut stage = Stage::new();
    stage.subscribe("a");
    stage.subscribe("b");
    let order = stage.order("a");
    let (zone, fence) = (order.row.zone, order.fence);
    let alive = |progress| {
        let orders = vec![Holding { zone, fence, progress }];
        FarmContent::Alive { power: RelativePower::REFERENCE, orders }
    };
    // One step per minute for an hour.
    for minute in 0..60 {
        stage.now = Time::since_start(Duration::from_secs(60 * minute));
        stage.tell("a", Performative::Inform, alive(minute + 1));
        stage.tell(
            "b",
            Performative::Inform,
            FarmContent::Alive { power: RelativePower::REFERENCE, orders: Vec::new() },
        );
    }
    assert_eq!(stage.master.board().zone(zone).unwrap().0, fence, "the order still counts");
    // It was given four zones to profile, and a minute for each.
    for _ in 0..60 {
        stage.now = stage.now + Duration::from_secs(5);
        stage.tell("a", Performative::Inform, alive(60));
        stage.tell(
            "b",
            Performative::Inform,
            FarmContent::Alive { power: RelativePower::REFERENCE, orders: Vec::new() },
        );
    }
    let withdrawn = |message: &FarmMessage| message.content == FarmContent::Withdrawn { zone, fence };
    assert!(stage.sent.iter().any(withdrawn), "the agent is informed");
    assert!(stage.master.board().zone(zone).unwrap().0 > fence, "the order does not count any more");
}

#[test]
fn a_zone_that_was_given_to_another_is_not_taken_from_the_first() {
    let mut stage = Stage::new();
    stage.subscribe("a");
    let first = stage.order("a");
    stage.tell("a", Performative::Cancel, FarmContent::Unsubscription);
    stage.subscribe("b");
    let (revision, row) = stage.master.board().zone(first.row.zone).unwrap();
    assert!(row.agent == Some(AgentId::new("b")) && revision > first.fence);
    stage.tell("a", Performative::Inform, report(&first, painting(&first, 2)));
    assert_eq!(stage.last_word(), Performative::Disconfirm);
    assert_eq!(stage.state(first.row.zone), ZoneState::Profiling);
}

#[test]
fn a_message_out_of_place_is_not_understood() {
    let mut stage = Stage::new();
    stage.tell("a", Performative::Request, FarmContent::LifeCycle(LifeCycle::Terminate));
    assert_eq!(stage.last_word(), Performative::NotUnderstood);
    // This message is not answered; otherwise two agents would exchange answers for ever.
    let before = stage.sent.len();
    stage.tell("a", Performative::NotUnderstood, FarmContent::Nothing);
    assert_eq!(stage.sent.len(), before);
}

/// An agent whose benchmark is done.
fn agent() -> RenderAgent {
    let mut agent = RenderAgent::new(RenderAgentConfig {
        id: AgentId::new("agent"),
        master: bottega_farm::MasterSource::Known(AgentId::new("master")),
        adaptation: AdaptationRule::Paper,
        prefetch: 2,
        auction: Default::default(),
        heartbeat: Duration::from_secs(1),
        expert: Expert::path_tracing(),
        knowledge: Foreknowledge::default(),
    });
    let mut actions: Vec<FarmAction> = Vec::new();
    let benchmarked = FarmCompletion::Benchmarked { power: RelativePower::REFERENCE, lanes: f64::NAN };
    agent.handle(Time::ZERO, Event::Start, &mut actions);
    agent.handle(Time::ZERO, Event::Completed(benchmarked), &mut actions);
    agent
}

#[test]
fn an_order_is_left_when_it_comes_after_its_time_and_taken_when_it_comes_again() {
    let mut stage = Stage::new();
    stage.subscribe("agent");
    let is_order = |message: &&FarmMessage| matches!(message.content, FarmContent::Profile(_));
    let order = stage.sent.iter().find(is_order).expect("an order").clone();
    let reply_by = order.reply_by.expect("orders have a deadline");
    let (late, second) = (reply_by + Duration::from_nanos(1), Duration::from_secs(1));
    let mut agent = agent();
    agent.handle(late, Event::Message(order.clone()), &mut Vec::new());
    assert_eq!(agent.held_zones().count(), 0);
    agent.handle(late, Event::Message(AclMessage { reply_by: Some(late + second), ..order }), &mut Vec::new());
    assert_eq!(agent.held_zones().count(), 1);
}

fn contents(order: Order) -> impl Strategy<Value = FarmContent> {
    let fence = order.fence.0;
    prop_oneof![
        (any::<f64>(), any::<f64>())
            .prop_map(|(power, lanes)| FarmContent::Subscription { power: RelativePower::new(power), lanes }),
        Just(FarmContent::Subscribed),
        Just(FarmContent::Unsubscription),
        Just(FarmContent::LeftOut { reason: "why not".to_owned() }),
        Just(FarmContent::Nothing),
        (0u32..6, 0u32..6, any::<u64>()).prop_map(|(room, zone, nanos)| FarmContent::Bids {
            room,
            bids: vec![Bid { zone: ZoneId(zone), finish: Duration::from_nanos(nanos) }],
        }),
        (0u32..6, 0..fence + 20, 0u32..50, any::<bool>()).prop_map(move |(zone, fence, samples, well)| {
            let (zone, fence) = (ZoneId(zone), Revision(fence));
            let order = Order { fence, ..order.clone() };
            let outcome = if well { Ok(painting(&order, samples)) } else { Err("no".to_owned()) };
            FarmContent::Report(Arc::new(Report { zone, fence, outcome, reasons: None }))
        }),
        prop::collection::vec((0u32..6, 0u64..20), 0..4).prop_map(|orders| FarmContent::Alive {
            power: RelativePower::REFERENCE,
            orders: orders
                .into_iter()
                .map(|(zone, fence)| Holding { zone: ZoneId(zone), fence: Revision(fence), progress: fence })
                .collect(),
        }),
        Just(FarmContent::LifeCycle(LifeCycle::Suspend)),
        prop::collection::vec(0u32..9, 0..4).prop_map(|zones| FarmContent::Offers(
            zones
                .into_iter()
                .map(|zone| bottega_farm::Offer {
                    zone: ZoneId(zone),
                    complexity: f64::NAN,
                    time_estimated: Duration::MAX,
                })
                .collect()
        )),
    ]
}

fn any_message() -> impl Strategy<Value = FarmMessage> {
    let mut stage = Stage::new();
    stage.subscribe("a");
    let performative = prop::sample::select(Performative::ALL.to_vec());
    let usual = prop::sample::select(vec![Performative::Inform, Performative::Propose, Performative::Subscribe]);
    (prop_oneof![performative, usual], prop::sample::select(vec!["a", "b", "c"]), contents(stage.order("a")))
        .prop_map(|(performative, from, content)| message(from, performative, content))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn no_messages_break_a_master(messages in prop::collection::vec(any_message(), 0..40)) {
        let mut stage = Stage::new();
        stage.subscribe("a");
        for message in messages {
            stage.feed(Event::Message(message));
        }
        let mut composed = stage.composed.clone();
        composed.sort();
        composed.dedup();
        prop_assert_eq!(composed.len(), stage.composed.len(), "no zone is composed twice");
    }

    #[test]
    fn no_messages_break_an_agent(messages in prop::collection::vec(any_message(), 0..40)) {
        let mut agent = agent();
        for message in messages {
            agent.handle(Time::ZERO, Event::Message(message), &mut Vec::new());
        }
    }
}
