//! The gateway of a platform: translates messages between its agents and other platforms.
//!
//! The gateway is an agent itself. It receives the platform's messages to agents elsewhere, and reports of the
//! transport about incoming ones. It routes them ([`Acc`]), keeps the thread of each conversation with foreign agents,
//! which name conversations by text, and answers messages that cannot be understood. Agents get agent-management
//! content as types, and everything else as the [`WireMessage`] itself, if their content type supports it.

mod forms;
mod incoming;
mod outgoing;
mod threads;

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    marker::PhantomData,
    sync::Arc,
    time::Duration,
};

pub use forms::FirstForms;
use forms::Forms;
use threads::Threads;

use crate::{
    Action, ActionOf, AgentId, Event, EventOf, Performative, StateMachine, StoreReply, StoreRequest, Ticket, Time,
    acc::{Acc, Letter, Outbound, Routed},
    platform::{AmsPages, CarriesManagement, ManagementContent},
    wire::{Calendar, Form, WireMessage},
};

/// A content type that can carry foreign messages as text.
pub trait CarriesForeign: CarriesManagement {
    /// Returns a foreign message as content. `None`: agents of this platform do not accept it; the sender gets a
    /// not-understood, unless the message is an answer.
    fn from_foreign(message: WireMessage) -> Option<Self>;

    /// Returns the message as text for a foreign agent; `None`: the content is not foreign. Content and user-defined
    /// parameters are taken from it; so are language, ontology, encoding and protocol where it sets them. The rest is
    /// taken from the message around it.
    fn foreign(&self) -> Option<&WireMessage>;
}

/// The content type of a platform whose agents have no ontology of their own.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "most of what is said between agents is of management")]
pub enum PlainContent {
    /// A message of agent management (FIPA00023).
    Management(ManagementContent),
    /// Any other content, as text.
    Foreign(Arc<WireMessage>),
}

impl From<ManagementContent> for PlainContent {
    fn from(content: ManagementContent) -> Self {
        Self::Management(content)
    }
}

impl CarriesManagement for PlainContent {
    fn management(&self) -> Option<&ManagementContent> {
        match self {
            Self::Management(content) => Some(content),
            Self::Foreign(_) => None,
        }
    }
}

impl CarriesForeign for PlainContent {
    fn from_foreign(message: WireMessage) -> Option<Self> {
        Some(Self::Foreign(Arc::new(message)))
    }

    fn foreign(&self) -> Option<&WireMessage> {
        match self {
            Self::Management(_) => None,
            Self::Foreign(message) => Some(message),
        }
    }
}

/// An effect that a gateway requests from its transport.
#[derive(Clone, Debug, PartialEq)]
pub enum ChannelEffect {
    /// Send this message to the first of its addresses that accepts it. Failure is reported by
    /// [`ChannelReport::Failed`].
    Send(Box<Outbound>),
    /// The gateway has handled a message; for observers.
    Passed(Passage),
}

/// A report of the transport to the gateway.
#[derive(Clone, Debug, PartialEq)]
pub enum ChannelReport {
    /// A message has arrived.
    Arrived(Box<Letter>),
    /// A message could not be delivered to any of its addresses.
    Failed {
        /// The message that could not be sent.
        outbound: Box<Outbound>,
        /// The error at the last address, or the reason why none was tried.
        reason: String,
    },
}

/// The way of a message through the gateway.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// To an agent of this process.
    In,
    /// To another platform, or to another process of this one.
    Out,
    /// Discarded: a duplicate, a loop, a forgery, or a message without a sender.
    Dropped,
    /// Undeliverable: no address is known, the message cannot be written, or no address has accepted it; in the last
    /// case the same message went [`Way::Out`] before.
    Lost,
}

impl Way {
    /// All ways, in the order of the variants.
    pub const ALL: [Self; 4] = [Self::In, Self::Out, Self::Dropped, Self::Lost];

    /// Returns the name of the way in the JSON lines of a trace, such as `in`.
    pub fn word(self) -> &'static str {
        match self {
            Self::In => "in",
            Self::Out => "out",
            Self::Dropped => "dropped",
            Self::Lost => "lost",
        }
    }
}

/// A message that the gateway delivered, sent, dropped or could not send, with its time, way and receiver.
#[derive(Clone, Debug, PartialEq)]
pub struct Passage {
    /// The time at which the gateway handled the message, on the platform's clock.
    pub time: Time,
    /// The way that the message took.
    pub way: Way,
    /// The receiver. Each receiver of a message has a passage of its own.
    pub to: AgentId,
    /// The message, with its content.
    pub message: Arc<WireMessage>,
}

/// The configuration of a gateway: the names and addresses of its platform.
#[derive(Clone, Debug)]
pub struct GatewayConfig {
    /// The identifier of the gateway itself.
    pub id: AgentId,
    /// The name of the platform.
    pub platform: String,
    /// The transport addresses at which other platforms reach this process.
    pub addresses: Vec<String>,
    /// The conversion between the platform's time and dates in messages.
    pub calendar: Calendar,
    /// The services of the platform: they understand agent management only.
    pub services: Vec<AgentId>,
    /// Agents of the platform that may change all entries of its directories: messages from outside with such a sender
    /// are dropped.
    pub administrators: Vec<AgentId>,
    /// A secret number. It makes the names of the gateway's conversations differ from those of other processes, and the
    /// digests by which duplicates are detected unpredictable.
    pub salt: u64,
    /// The representations of messages to other platforms that do not answer one.
    pub first_forms: FirstForms,
}

/// The gateway between the agents of a platform and foreign agents. See the [module](self).
///
/// `C` is the content of the platform's messages, `V` the type of the texts in its store.
pub struct Gateway<C, V>
where
    C: CarriesForeign,
    V: From<String> + AsRef<str>,
{
    config: GatewayConfig,
    acc: Acc,
    threads: Threads,
    forms: Forms,
    /// The addresses of all processes that serve the platform, with this one's first.
    nodes: Vec<String>,
    /// The watches whose existing entries are known.
    known: BTreeSet<Ticket>,
    /// The time at which the watches are requested again.
    watch_again: Time,
    /// Events that arrived before the threads were known: without them, messages go out under wrong names.
    early: VecDeque<EventOf<Self>>,
    /// Entries of threads that the store has not confirmed, with the times at which they are written again.
    unconfirmed: BTreeMap<Ticket, Unconfirmed>,
    next_ticket: u64,
    #[allow(clippy::type_complexity, reason = "a marker")]
    vocabulary: PhantomData<fn() -> (C, V)>,
}

/// An entry that is being written.
#[derive(Clone, Debug)]
struct Unconfirmed {
    key: String,
    text: String,
    again: Time,
}

/// Time after which an unconfirmed entry is written again.
const AGAIN_AFTER: Duration = Duration::from_secs(2);
/// Timeout for the store's existing entries.
const PAGES_WITHIN: Duration = Duration::from_secs(10);
/// Maximum number of events that wait for the pages; further ones are lost.
const EARLY_MAX: usize = 1 << 12;

const WATCH_PAGES: Ticket = Ticket(0);
const WATCH_THREADS: Ticket = Ticket(1);

type GatewayActions<C, V> = Vec<Action<C, V, ChannelEffect>>;

impl<C, V> Gateway<C, V>
where
    C: CarriesForeign,
    V: From<String> + AsRef<str>,
{
    /// Makes the gateway of a platform. At [`Event::Start`] it begins to read the white pages and its conversations
    /// from the store; messages wait until they are known.
    pub fn new(config: GatewayConfig) -> Self {
        let acc = Acc::new(config.platform.clone(), config.addresses.clone(), config.calendar, config.salt);
        Self {
            acc,
            threads: Threads::default(),
            forms: Forms::new(&config.first_forms),
            nodes: config.addresses.clone(),
            known: BTreeSet::new(),
            watch_again: Time::ZERO,
            early: VecDeque::new(),
            unconfirmed: BTreeMap::new(),
            next_ticket: WATCH_THREADS.0 + 1,
            vocabulary: PhantomData,
            config,
        }
    }

    fn is_service(&self, agent: &AgentId) -> bool {
        self.config.services.contains(agent)
    }

    /// Returns the identifier of an agent for other platforms: services have the addresses of every process.
    fn with_addresses(&self, agent: &AgentId) -> AgentId {
        let addresses = if self.is_service(agent) { self.nodes.clone() } else { self.config.addresses.clone() };
        AgentId { name: agent.name.clone(), addresses: addresses.into() }
    }

    fn passed(&self, now: Time, way: Way, to: &AgentId, message: &WireMessage, actions: &mut GatewayActions<C, V>) {
        let message = Arc::new(message.clone());
        actions.push(Action::Effect(ChannelEffect::Passed(Passage { time: now, way, to: to.clone(), message })));
    }

    /// Carries out the decisions of the channel.
    fn route(&mut self, now: Time, form: &str, routed: Vec<Routed>, actions: &mut GatewayActions<C, V>) {
        for one in routed {
            match one {
                Routed::Deliver { to, message } => self.deliver(now, form, &to, message, actions),
                Routed::Forward(outbound) => self.send(now, outbound, actions),
            }
        }
    }

    fn send(&self, now: Time, outbound: Outbound, actions: &mut GatewayActions<C, V>) {
        for receiver in &outbound.envelope.intended_receivers {
            self.passed(now, Way::Out, receiver, &outbound.message, actions);
        }
        actions.push(Action::Effect(ChannelEffect::Send(Box::new(outbound))));
    }

    fn reported(&mut self, now: Time, report: ChannelReport, actions: &mut GatewayActions<C, V>) {
        match report {
            ChannelReport::Arrived(letter) => match self.acc.receive(now, &letter) {
                Ok(routed) => {
                    let form = &letter.envelope.acl_representation;
                    if let (Some(sender), Some(form)) = (&letter.message.sender, Form::of_name(form)) {
                        self.forms.hear(sender, form);
                    }
                    self.route(now, form, routed, actions);
                }
                Err(_) => {
                    let to = letter.envelope.to.first().unwrap_or(&self.config.id);
                    self.passed(now, Way::Dropped, to, &letter.message, actions);
                }
            },
            ChannelReport::Failed { outbound, reason } => {
                for receiver in &outbound.envelope.intended_receivers {
                    self.passed(now, Way::Lost, receiver, &outbound.message, actions);
                }
                let routed = self.acc.undelivered(now, &outbound, &reason);
                self.route(now, &outbound.envelope.acl_representation, routed, actions);
            }
        }
    }

    fn watch(&mut self, now: Time, actions: &mut GatewayActions<C, V>) {
        self.watch_again = now + PAGES_WITHIN;
        for (ticket, prefix) in [(WATCH_PAGES, AmsPages::PREFIX), (WATCH_THREADS, threads::PREFIX)] {
            actions.push(Action::Store { ticket, request: StoreRequest::Watch { prefix: prefix.into() } });
        }
    }

    fn is_ready(&self) -> bool {
        self.known.len() == 2
    }

    /// Writes an entry, until the store confirms it: without its thread a subscription gets its updates under a wrong
    /// name.
    fn put(&mut self, now: Time, key: String, text: String, actions: &mut GatewayActions<C, V>) {
        let ticket = Ticket(self.next_ticket);
        self.next_ticket += 1;
        let request = StoreRequest::Put { key: key.as_str().into(), value: text.clone().into() };
        actions.push(Action::Store { ticket, request });
        // Keep only the last text of a key
        self.unconfirmed.retain(|_, other| other.key != key);
        self.unconfirmed.insert(ticket, Unconfirmed { key, text, again: now + AGAIN_AFTER });
    }

    fn put_again(&mut self, now: Time, actions: &mut GatewayActions<C, V>) {
        let late: Vec<Unconfirmed> =
            self.unconfirmed.extract_if(.., |_, entry| entry.again <= now).map(|(_, entry)| entry).collect();
        for Unconfirmed { key, text, .. } in late {
            self.put(now, key, text, actions);
        }
    }

    fn learn(&mut self, key: &str, text: &str) {
        if self.threads.learn(key, text) {
            return;
        }
        match AmsPages::read(key, text) {
            Some(AmsPages::Agent { name, agent }) => {
                let elsewhere = agent.filter(|agent| {
                    !agent.addresses.is_empty() && !agent.addresses.iter().any(|at| self.config.addresses.contains(at))
                });
                self.acc.learn(name, elsewhere);
            }
            Some(AmsPages::Node { address, present }) => {
                self.nodes.retain(|node| node != address || self.config.addresses.contains(node));
                if present && !self.nodes.iter().any(|node| node == address) {
                    self.nodes.push(address.to_owned());
                }
            }
            None => {}
        }
    }
}

impl<C, V> StateMachine for Gateway<C, V>
where
    C: CarriesForeign,
    V: From<String> + AsRef<str>,
{
    type Content = C;
    type Value = V;
    type Effect = ChannelEffect;
    type Completion = ChannelReport;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        match event {
            Event::Start => self.watch(now, actions),
            Event::Message(_) | Event::Completed(_) if !self.is_ready() => {
                if self.early.len() < EARLY_MAX {
                    self.early.push_back(event);
                }
            }
            Event::Message(message) => self.leave(now, &message, actions),
            Event::Completed(report) => self.reported(now, report, actions),
            Event::Store { reply: StoreReply::Changed(entry), .. } => {
                self.learn(&entry.key.to_string(), entry.value.as_ref());
            }
            Event::Store { ticket, reply: StoreReply::CaughtUp } => {
                self.known.insert(ticket);
                if self.is_ready() {
                    std::mem::take(&mut self.early).into_iter().for_each(|early| self.handle(now, early, actions));
                }
            }
            Event::Store { ticket, reply: StoreReply::Written { .. } } => _ = self.unconfirmed.remove(&ticket),
            Event::Presence { agent, present: true } => self.acc.add(agent),
            Event::Presence { agent, present: false } => self.acc.remove(&agent),
            Event::Store { .. } | Event::Deadline => {}
        }
        if !self.is_ready() && self.watch_again <= now {
            self.watch(now, actions);
        }
        self.put_again(now, actions);
    }

    fn next_deadline(&self) -> Option<Time> {
        let watch = (!self.is_ready()).then_some(self.watch_again);
        self.unconfirmed.values().map(|entry| entry.again).chain(watch).min()
    }
}

/// Returns true for performatives that are answers: they never get a not-understood.
fn is_answer(act: Performative) -> bool {
    use Performative as P;
    matches!(act, P::Inform | P::Agree | P::Refuse | P::Failure | P::NotUnderstood | P::Confirm | P::Disconfirm)
}
