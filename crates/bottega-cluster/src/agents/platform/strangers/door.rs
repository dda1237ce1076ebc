//! The Master of a job towards agents of other platforms, by FIPA's protocols.
//!
//! It is a state machine like all agents. Behind it, each such agent is represented by a
//! [`Visitor`](bottega_farm::Visitor), which takes part in the job like our own agents.

use std::{collections::BTreeMap, time::Duration};

use bottega_agents::{
    AclMessage, Action, ActionOf, AgentId, Event, EventOf, Performative, Revision, StateMachine, Time,
    gateway::PlainContent,
    platform::{DfAgentDescription, Function, ManagementContent, Page, PageAsk, directory_request},
    sl,
    sl::Term,
};
use bottega_farm::{Offer, PaintOrder, ResultRef, VisitorEffect, VisitorReport, WorkRow, ZoneId};

use super::{
    super::{
        talk::{self, Message},
        terms::{Unread, reason, unrecognised_content},
    },
    messages::{foreign, index, key_of, offer, say, talk_terms},
    ontology::{
        Applicant, Model, call_terms, named_order_term, no_order_term, order_term, read_application, read_done,
        read_order, read_proposal, work_term,
    },
};

/// The most agents of other platforms in a job.
const GUESTS_MAX: usize = 256;
/// The most unanswered calls for proposals per agent.
const CALLS_MAX: usize = 16;

/// An action that a door requests.
#[derive(Clone, Debug)]
pub(super) enum DoorEffect {
    /// Lets an agent take part, for the first time or again.
    Admit { agent: String, applicant: Applicant },
    /// Passes on a report of an agent.
    Tell { agent: String, report: VisitorReport },
    /// Expects the result of an order under a key.
    Expect { key: String, order: Box<PaintOrder> },
    /// Stops expecting a result under a key.
    Forget { key: String },
}

/// A report to a door.
#[derive(Clone, Debug)]
pub(super) enum DoorReport {
    /// A message for an agent.
    Visitor { agent: String, effect: VisitorEffect },
    /// A result was delivered under a key.
    Delivered { key: String, result: ResultRef },
    /// The job is over; with the reason if it is not finished.
    Over { why: Option<&'static str> },
}

/// A call for proposals that was sent to an agent.
#[derive(Clone, Debug)]
struct OpenCall {
    /// The identifier of the FIPA conversation.
    conversation: u64,
    /// The number of the call within the farm.
    number: u64,
    /// The zones offered; empty once it has been answered.
    offers: Vec<Offer>,
    until: Time,
}

/// An order that an agent has.
#[derive(Clone, Debug)]
struct OpenOrder {
    key: String,
    conversation: u64,
    /// The time from which it can paint: when it has delivered its previous order.
    since: Time,
    delivered: Option<(ResultRef, Duration)>,
}

/// An agent of another platform that takes part.
#[derive(Clone, Debug)]
struct Guest {
    /// The name and addresses of the agent.
    agent: AgentId,
    subscription: Message,
    wish: Term,
    applicant: Applicant,
    is_welcome: bool,
    calls: Vec<OpenCall>,
    orders: BTreeMap<(ZoneId, Revision), OpenOrder>,
}

/// The configuration of a door.
pub(super) struct DoorConfig {
    pub(super) id: AgentId,
    pub(super) df: AgentId,
    pub(super) model: Model,
    /// The start of the URLs to which pixels are delivered.
    pub(super) deliver: String,
    /// The secret from which delivery keys are derived.
    pub(super) secret: u64,
}

/// The state machine of a door.
pub(super) struct MasterDoor {
    config: DoorConfig,
    guests: BTreeMap<String, Guest>,
    yellow: Page<DfAgentDescription>,
    is_over: bool,
    next_number: u64,
}

type DoorActions = Vec<ActionOf<MasterDoor>>;

impl MasterDoor {
    /// Returns the door of a job that starts.
    pub(super) fn new(config: DoorConfig) -> Self {
        let mut yellow = Page::absent();
        yellow.want(Some(offer(&config.id, config.model.number)));
        Self { config, guests: BTreeMap::new(), yellow, is_over: false, next_number: 1 }
    }

    fn number(&mut self) -> u64 {
        self.next_number += 1;
        self.next_number - 1
    }

    /// Handles a message.
    fn hear(&mut self, now: Time, message: &Message, actions: &mut DoorActions) {
        let Some(wire) = foreign(message) else { return };
        let read = match talk_terms(wire) {
            Ok(terms) => self.answer(now, message, &terms, actions),
            // The conversation says what is refused or cancelled.
            Err(_) if matches!(message.performative, Performative::Refuse | Performative::Cancel) => {
                self.answer(now, message, &[], actions)
            }
            Err(why) => Err(why),
        };
        if let Err(why) = read
            && !matches!(message.performative, Performative::NotUnderstood | Performative::Refuse)
        {
            actions.push(Action::Send(talk::rejection(message, &self.config.id, None, why)));
        }
    }

    fn answer(
        &mut self,
        now: Time,
        message: &Message,
        terms: &[Term],
        actions: &mut DoorActions,
    ) -> Result<(), Unread> {
        match message.performative {
            Performative::Subscribe => self.subscribe(message, terms, actions),
            Performative::Propose => self.propose(now, message, terms, actions),
            Performative::Refuse => self.refuse(message, actions),
            Performative::Inform => self.done(now, message, terms, actions),
            Performative::Failure => self.failed(message, terms, actions),
            Performative::Cancel => self.leave(message, actions),
            Performative::NotUnderstood | Performative::Agree => Ok(()),
            act => Err(talk::unsupported(act)),
        }
    }

    fn guest(&mut self, message: &Message) -> Result<&mut Guest, Unread> {
        let guest = self.guests.get_mut(&index(&message.sender));
        guest.ok_or_else(|| Unread::Refused(reason("not-subscribed", [])))
    }

    fn subscribe(&mut self, message: &Message, terms: &[Term], actions: &mut DoorActions) -> Result<(), Unread> {
        let [wish] = terms else { return Err(unrecognised_content()) };
        let applicant = read_application(wish)?;
        let agent = index(&message.sender);
        if self.guests.len() >= GUESTS_MAX && !self.guests.contains_key(&agent) {
            return Err(Unread::Refused(reason("too-many", [])));
        }
        actions.push(Action::Send(talk::agree(message, &self.config.id, wish)));
        let guest = Guest {
            agent: message.sender.clone(),
            subscription: message.clone(),
            wish: wish.clone(),
            applicant,
            is_welcome: false,
            calls: Vec::new(),
            orders: BTreeMap::new(),
        };
        let before = self.guests.insert(agent.clone(), guest);
        for order in before.into_iter().flat_map(|guest| guest.orders.into_values()) {
            actions.push(Action::Effect(DoorEffect::Forget { key: order.key }));
        }
        // An agent that subscribes again has lost its orders.
        actions.push(Action::Effect(DoorEffect::Tell { agent: agent.clone(), report: VisitorReport::Leaves }));
        actions.push(Action::Effect(DoorEffect::Admit { agent, applicant }));
        Ok(())
    }

    fn propose(
        &mut self,
        now: Time,
        message: &Message,
        terms: &[Term],
        actions: &mut DoorActions,
    ) -> Result<(), Unread> {
        let guest = self.guest(message)?;
        let called = guest.calls.iter().position(|call| call.conversation == message.conversation_id);
        let call = called.map(|place| &mut guest.calls[place]).filter(|call| !call.offers.is_empty());
        let Some(call) = call.map(|call| OpenCall { offers: std::mem::take(&mut call.offers), ..*call }) else {
            self.reject(message, reason("not-called", []), actions);
            return Ok(());
        };
        let agent = index(&guest.agent);
        let tell = |report| Action::Effect(DoorEffect::Tell { agent: agent.clone(), report });
        if call.until < now {
            self.reject(message, reason("too-late", []), actions);
            return Ok(());
        }
        match read_proposal(terms, &call.offers) {
            Ok((room, bids)) => {
                actions.push(tell(VisitorReport::Bids { call: call.number, room, bids }));
            }
            Err(Unread::Refused(why) | Unread::NotUnderstood(why)) => {
                actions.push(tell(VisitorReport::Refuses { call: call.number }));
                self.reject(message, why, actions);
            }
        }
        Ok(())
    }

    fn reject(&self, message: &Message, why: Term, actions: &mut DoorActions) {
        let terms = [no_order_term(&message.sender), why];
        let rejection = talk::answer(message, &self.config.id, Performative::RejectProposal, &terms);
        actions.push(Action::Send(rejection));
    }

    fn refuse(&mut self, message: &Message, actions: &mut DoorActions) -> Result<(), Unread> {
        let guest = self.guest(message)?;
        let called = guest.calls.iter().position(|call| call.conversation == message.conversation_id);
        if let Some(place) = called {
            let report = VisitorReport::Refuses { call: guest.calls.remove(place).number };
            actions.push(Action::Effect(DoorEffect::Tell { agent: index(&guest.agent), report }));
            return Ok(());
        }
        // It may refuse an order.
        self.give_up(message, "the order was refused", actions)
    }

    fn done(&mut self, now: Time, message: &Message, terms: &[Term], actions: &mut DoorActions) -> Result<(), Unread> {
        let [done] = terms else { return Err(unrecognised_content()) };
        let order = read_done(done)?;
        let me = self.config.id.clone();
        let guest = self.guest(message)?;
        let refute = |why: &str| {
            let terms = [done.clone(), Term::call(why, [])];
            Action::Send(talk::answer(message, &me, Performative::Disconfirm, &terms))
        };
        match guest.orders.get(&order).map(|open| open.delivered) {
            None => actions.push(refute("not-your-order")),
            Some(None) => actions.push(refute("nothing-delivered")),
            Some(Some(outcome)) => {
                let agent = index(&guest.agent);
                if let Some(open) = guest.orders.remove(&order) {
                    actions.push(Action::Effect(DoorEffect::Forget { key: open.key }));
                }
                // Its next order can start now.
                guest.orders.values_mut().for_each(|open| open.since = open.since.max(now));
                let report = VisitorReport::Painted { zone: order.0, fence: order.1, outcome: Ok(outcome) };
                actions.push(Action::Effect(DoorEffect::Tell { agent, report }));
            }
        }
        Ok(())
    }

    fn failed(&mut self, message: &Message, terms: &[Term], actions: &mut DoorActions) -> Result<(), Unread> {
        let why = terms.get(1).map_or_else(|| "it gives no reason".to_owned(), sl::print_term);
        let why: String = why.chars().take(200).collect();
        match terms.first().map(read_order) {
            Some(Ok(order)) => self.fail(message, order, &why, actions),
            _ => self.give_up(message, &why, actions),
        }
    }

    fn fail(
        &mut self,
        message: &Message,
        order: (ZoneId, Revision),
        why: &str,
        actions: &mut DoorActions,
    ) -> Result<(), Unread> {
        let guest = self.guest(message)?;
        let agent = index(&guest.agent);
        if let Some(open) = guest.orders.remove(&order) {
            actions.push(Action::Effect(DoorEffect::Forget { key: open.key }));
            let report = VisitorReport::Painted { zone: order.0, fence: order.1, outcome: Err(why.to_owned()) };
            actions.push(Action::Effect(DoorEffect::Tell { agent, report }));
        }
        Ok(())
    }

    /// Fails the order of a conversation.
    fn give_up(&mut self, message: &Message, why: &str, actions: &mut DoorActions) -> Result<(), Unread> {
        let guest = self.guest(message)?;
        let of_conversation = |open: &OpenOrder| open.conversation == message.conversation_id;
        let order = guest.orders.iter().find(|(_, open)| of_conversation(open)).map(|(order, _)| *order);
        order.map_or(Ok(()), |order| self.fail(message, order, why, actions))
    }

    fn leave(&mut self, message: &Message, actions: &mut DoorActions) -> Result<(), Unread> {
        let guest = self.guest(message)?;
        if guest.subscription.conversation_id != message.conversation_id {
            return Err(Unread::Refused(reason("not-subscribed", [])));
        }
        let agent = index(&message.sender);
        self.end(&agent, None, actions);
        Ok(())
    }

    /// Ends the participation of an agent, and tells it.
    ///
    /// - `why`: why the Master excludes it; `None`: the job is over or it has left.
    fn end(&mut self, agent: &str, why: Option<Term>, actions: &mut DoorActions) {
        let Some(guest) = self.guests.remove(agent) else { return };
        let (subscription, me) = (&guest.subscription, &self.config.id);
        actions.push(Action::Send(match why {
            Some(why) => talk::answer(subscription, me, Performative::Failure, &[guest.wish.clone(), why]),
            None => talk::over(subscription, me),
        }));
        for open in guest.orders.into_values() {
            actions.push(Action::Effect(DoorEffect::Forget { key: open.key }));
        }
        let report = VisitorReport::Leaves;
        actions.push(Action::Effect(DoorEffect::Tell { agent: agent.to_owned(), report }));
    }

    /// Sends a message to an agent.
    fn put(&mut self, now: Time, agent: &str, effect: VisitorEffect, actions: &mut DoorActions) {
        match effect {
            VisitorEffect::Welcome(work) => self.welcome(agent, &work, actions),
            VisitorEffect::Offers { call, offers, room, within } => {
                self.call(now, agent, (call, &offers, room, within), actions);
            }
            VisitorEffect::Rejected { call } => self.rejected(agent, call, actions),
            VisitorEffect::Paint { order, call } => self.order(now, agent, order, call, actions),
            VisitorEffect::Withdrawn { zone, fence } => self.withdraw(agent, (zone, fence), actions),
            VisitorEffect::LeftOut { reason: why } => {
                self.end(agent, Some(Term::call("left-out", [Term::text(&*why)])), actions);
            }
        }
    }

    fn welcome(&mut self, agent: &str, work: &WorkRow, actions: &mut DoorActions) {
        let (me, model) = (&self.config.id, &self.config.model);
        let Some(guest) = self.guests.get_mut(agent).filter(|guest| !guest.is_welcome) else { return };
        guest.is_welcome = true;
        let report = Term::call("=", [guest.wish.clone(), work_term(model, work)]);
        actions.push(Action::Send(talk::answer(&guest.subscription, me, Performative::Inform, &[report])));
    }

    fn call(
        &mut self,
        now: Time,
        agent: &str,
        (number, offers, room, within): (u64, &[Offer], u32, Duration),
        actions: &mut DoorActions,
    ) {
        let conversation = self.number();
        let me = self.config.id.clone();
        let Some(guest) = self.guests.get_mut(agent) else { return };
        let seconds =
            |offer: &Offer| guest.applicant.power.to_own(offer.time_estimated).as_secs_f64() / guest.applicant.lanes;
        let terms = call_terms(&guest.agent, offers, room, seconds);
        let until = now + within;
        let act = Performative::CallForProposal;
        let call = say(&me, &guest.agent, act, "fipa-contract-net", conversation, &terms);
        actions.push(Action::Send(AclMessage { reply_by: Some(until), ..call }));
        guest.calls.push(OpenCall { conversation, number, offers: offers.to_vec(), until });
        if guest.calls.len() > CALLS_MAX {
            guest.calls.remove(0);
        }
    }

    fn rejected(&mut self, agent: &str, call: u64, actions: &mut DoorActions) {
        let me = self.config.id.clone();
        let Some(guest) = self.guests.get_mut(agent) else { return };
        let Some(place) = guest.calls.iter().position(|open| open.number == call) else { return };
        let conversation = guest.calls.remove(place).conversation;
        let terms = [no_order_term(&guest.agent), Term::call("given-to-others", [])];
        let act = Performative::RejectProposal;
        actions.push(Action::Send(say(&me, &guest.agent, act, "fipa-contract-net", conversation, &terms)));
    }

    fn order(&mut self, now: Time, agent: &str, order: Box<PaintOrder>, call: Option<u64>, actions: &mut DoorActions) {
        let fresh = self.number();
        let (me, seed) = (self.config.id.clone(), self.config.model.seed);
        let key = key_of(self.config.secret, agent, order.zone, order.fence);
        let deliver = format!("{}/{key}", self.config.deliver);
        let Some(guest) = self.guests.get_mut(agent) else { return };
        let called = call.and_then(|number| guest.calls.iter().find(|call| call.number == number));
        let (act, protocol, conversation) = match called {
            Some(call) => (Performative::AcceptProposal, "fipa-contract-net", call.conversation),
            // The first samples of a zone, or an order that is repeated.
            None => (Performative::Request, "fipa-request", fresh),
        };
        let term = order_term(&guest.agent, &order, seed, &deliver);
        actions.push(Action::Send(say(&me, &guest.agent, act, protocol, conversation, &[term])));
        let open = OpenOrder { key: key.clone(), conversation, since: now, delivered: None };
        guest.orders.insert((order.zone, order.fence), open);
        actions.push(Action::Effect(DoorEffect::Expect { key, order }));
    }

    fn withdraw(&mut self, agent: &str, order: (ZoneId, Revision), actions: &mut DoorActions) {
        let me = self.config.id.clone();
        let Some(guest) = self.guests.get_mut(agent) else { return };
        let Some(open) = guest.orders.remove(&order) else { return };
        let term = named_order_term(&guest.agent, order.0, order.1);
        let act = Performative::Cancel;
        actions.push(Action::Send(say(&me, &guest.agent, act, "fipa-request", open.conversation, &[term])));
        actions.push(Action::Effect(DoorEffect::Forget { key: open.key }));
    }

    fn delivered(&mut self, now: Time, key: &str, result: ResultRef) {
        let orders = self.guests.values_mut().flat_map(|guest| guest.orders.values_mut());
        for open in orders.filter(|open| open.key == key) {
            open.delivered = Some((result, now.since(open.since)));
        }
    }

    /// Ends the participation of an agent that cannot be reached.
    fn lost(&mut self, receiver: &AgentId, actions: &mut DoorActions) {
        let agent = index(receiver);
        if self.guests.contains_key(&agent) {
            tracing::info!(agent, "a stranger is unreachable and no longer takes part");
            self.end(&agent, Some(Term::call("unreachable", [])), actions);
        }
    }

    fn over(&mut self, why: Option<&str>, actions: &mut DoorActions) {
        self.is_over = true;
        self.yellow.want(None);
        for agent in self.guests.keys().cloned().collect::<Vec<_>>() {
            self.end(&agent, why.map(|why| Term::call("work-ended", [Term::text(why)])), actions);
        }
    }

    fn keep_page(&mut self, now: Time, actions: &mut DoorActions) {
        let number = self.next_number;
        let Some(ask) = self.yellow.next(now, number) else { return };
        self.next_number += 1;
        let entry = DfAgentDescription { name: Some(self.config.id.clone()), ..Default::default() };
        let function = match ask {
            PageAsk::Enter(offer) => Function::Register(offer),
            PageAsk::Change(offer) => Function::Modify(offer),
            PageAsk::TakeOut => Function::Deregister(entry),
        };
        actions.push(Action::Send(directory_request(number, &self.config.id, &self.config.df, function)));
    }
}

impl StateMachine for MasterDoor {
    type Content = PlainContent;
    type Value = String;
    type Effect = DoorEffect;
    type Completion = DoorReport;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut DoorActions) {
        match event {
            Event::Message(message) => match &message.content {
                PlainContent::Management(content) => {
                    let answered = self.yellow.hear(now, &message);
                    if let ManagementContent::Undelivered { receiver, .. } = content {
                        self.lost(&receiver.clone(), actions);
                    }
                    if self.is_over && answered == Some(PageAsk::TakeOut) {
                        actions.push(Action::Stop);
                    }
                }
                PlainContent::Foreign(_) => self.hear(now, &message, actions),
            },
            Event::Completed(DoorReport::Visitor { agent, effect }) => self.put(now, &agent, effect, actions),
            Event::Completed(DoorReport::Delivered { key, result }) => self.delivered(now, &key, result),
            Event::Completed(DoorReport::Over { why }) => self.over(why, actions),
            Event::Start | Event::Deadline | Event::Store { .. } | Event::Presence { .. } => {}
        }
        self.keep_page(now, actions);
    }

    fn next_deadline(&self) -> Option<Time> {
        self.yellow.next_deadline()
    }
}
