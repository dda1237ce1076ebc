//! Clients of a platform that check that it keeps what it has confirmed.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex},
    time::Duration,
};

use bottega_agents::{
    AclMessage, Action, ActionOf, AgentId, Event, EventOf, Performative as P, Random, StateMachine, Time,
    gateway::{ChannelEffect, ChannelReport, PlainContent},
    platform::{
        AmsAgentDescription, DfAgentDescription, FailureReason, Function, LifeCycleState, ManagementContent as M,
        ONTOLOGY, Outcome, SearchConstraints, ServiceDescription, ServiceEntry,
    },
    protocol::{Answer, RequestInitiator},
};

/// Time to wait for an answer.
const PATIENCE: Duration = Duration::from_secs(40);
/// Time between two requests: all messages of the first have arrived by then.
const PAUSE: Duration = Duration::from_secs(20);
/// The type of the offered services.
pub(crate) const KIND: &str = "smithy";

/// The findings of the clients, for the test to check at the end.
#[derive(Debug, Default)]
pub(crate) struct Notes {
    /// Violations that clients have seen.
    pub(crate) wrong: Vec<String>,
    /// Number of finished requests, by outcome.
    pub(crate) ends: BTreeMap<&'static str, u32>,
    /// Unanswered requests, by their times.
    pub(crate) unanswered: Vec<(Time, AgentId)>,
    /// The entry that each registrar knows to exist. Absent: it is not sure.
    pub(crate) entered: BTreeMap<AgentId, Option<DfAgentDescription>>,
    /// The last state set for each agent; absent: unknown.
    pub(crate) states: BTreeMap<AgentId, LifeCycleState>,
    /// The knowledge of each subscriber: the service's name by agent.
    pub(crate) views: BTreeMap<AgentId, BTreeMap<String, String>>,
    /// Basic services that were taken.
    pub(crate) supplied: Vec<ServiceEntry>,
}

pub(crate) type Shared = Arc<Mutex<Notes>>;

/// The next step of a client, and its reaction to the answer.
pub(crate) trait Plan {
    /// The next request, and its receiver.
    fn next(&mut self, now: Time, random: &mut Random) -> (AgentId, Function);
    /// The conversation has ended with this outcome.
    fn ended(
        &mut self,
        requested_at: Time,
        now: Time,
        function: &Function,
        answer: &Answer<PlainContent>,
        notes: &mut Notes,
    );
}

/// A client that sends one request after the other.
pub(crate) struct Client<W> {
    pub(crate) me: AgentId,
    wish: W,
    notes: Shared,
    random: Random,
    conversation: u64,
    open: Option<(RequestInitiator, Function, Time)>,
    /// The outcomes of conversations.
    ends: BTreeMap<u64, &'static str>,
    next: Time,
    /// The time after which no request is sent.
    until: Time,
}

impl<W: Plan> Client<W> {
    pub(crate) fn new(me: AgentId, wish: W, notes: Shared, seed: u64, until: Time) -> Self {
        let random = Random::new(seed);
        Self { me, wish, notes, random, conversation: 0, open: None, ends: BTreeMap::new(), next: Time::ZERO, until }
    }

    fn end(&mut self, now: Time, answer: &Answer<PlainContent>) {
        let Some((_, function, requested_at)) = self.open.take() else { return };
        let word = word(answer);
        let mut notes = self.notes.lock().unwrap();
        *notes.ends.entry(word).or_default() += 1;
        if *answer == Answer::Silence {
            notes.unanswered.push((requested_at, self.me.clone()));
        }
        self.ends.insert(self.conversation, word);
        self.wish.ended(requested_at, now, &function, answer, &mut notes);
        self.next = now + PAUSE.mul_f64(1.0 + self.random.unit());
    }

    fn hear(&mut self, now: Time, message: &AclMessage<PlainContent>) {
        let Some((initiator, ..)) = &mut self.open else { return self.hear_again(message) };
        match initiator.handle_message(message) {
            Ok(Some(answer)) => self.end(now, &answer),
            Ok(None) => {}
            Err(_) => self.hear_again(message),
        }
    }

    /// A second answer must equal the first: both come from a request that was taken twice.
    fn hear_again(&mut self, message: &AclMessage<PlainContent>) {
        let Some(first) = self.ends.get(&message.conversation_id) else { return };
        let again = match (&message.performative, &message.content) {
            (P::Inform, _) => "done",
            (P::Failure, PlainContent::Management(M::Failed(_, FailureReason::AlreadyRegistered))) => "already",
            _ => return,
        };
        if (*first, again) == ("done", "already") {
            let wrong = format!("{} in conversation {}: {again} after {first}", self.me, message.conversation_id);
            self.notes.lock().unwrap().wrong.push(wrong);
        }
    }
}

/// The kind of an answer.
fn word(answer: &Answer<PlainContent>) -> &'static str {
    use FailureReason as F;
    match answer {
        Answer::Inform(_) => "done",
        Answer::Refuse(_) => "refused",
        Answer::NotUnderstood(_) => "not understood",
        Answer::Silence => "silence",
        Answer::Failure(PlainContent::Management(M::Failed(_, F::AlreadyRegistered))) => "already",
        Answer::Failure(PlainContent::Management(M::Failed(_, F::NotRegistered))) => "not there",
        Answer::Failure(_) => "failed",
    }
}

impl<W: Plan> StateMachine for Client<W> {
    type Content = PlainContent;
    type Value = String;
    type Effect = ChannelEffect;
    type Completion = ChannelReport;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        match event {
            Event::Start => self.next = now + PAUSE.mul_f64(self.random.unit()),
            Event::Message(message) => self.hear(now, &message),
            _ => {}
        }
        if let Some((initiator, ..)) = &mut self.open
            && let Some(silence) = initiator.handle_time(now)
        {
            self.end(now, &silence);
        }
        if self.open.is_none() && self.next <= now && now < self.until {
            let (to, function) = self.wish.next(now, &mut self.random);
            self.conversation += 1;
            let content = PlainContent::Management(M::Action(function.clone()));
            let request = AclMessage {
                language: "fipa-sl0",
                ontology: ONTOLOGY,
                conversation_id: self.conversation,
                reply_with: self.conversation,
                reply_by: Some(now + PATIENCE),
                ..AclMessage::new(P::Request, self.me.clone(), to, content)
            };
            let mut send = Vec::new();
            self.open = Some((RequestInitiator::request(request, &mut send), function, now));
            actions.extend(send.into_iter().map(Action::Send));
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        match &self.open {
            Some((initiator, ..)) => initiator.next_deadline(),
            None => Some(self.next).filter(|next| *next < self.until),
        }
    }
}

/// A client that registers with a directory, modifies its entry, deregisters and searches for itself.
pub(crate) struct Registrar {
    pub(crate) me: AgentId,
    pub(crate) df: AgentId,
    pub(crate) known: Known,
    pub(crate) version: u32,
    /// Number of hops of a search.
    pub(crate) depth: i64,
}

/// The knowledge that a client has of its entry.
#[derive(Clone, Debug)]
pub(crate) enum Known {
    Unsure,
    Absent,
    There(Box<DfAgentDescription>),
}

impl Registrar {
    fn offer(&mut self, now: Time, random: &mut Random) -> DfAgentDescription {
        self.version += 1;
        let service = ServiceDescription {
            name: Some(format!("{}-{}", self.me.name, self.version)),
            service_type: Some(KIND.to_owned()),
            ..Default::default()
        };
        let lease = Duration::from_millis(5000 + random.below(60_000) as u64);
        let lease_time = (random.below(3) == 0).then(|| now + lease);
        DfAgentDescription { name: Some(self.me.clone()), services: vec![service], lease_time, ..Default::default() }
    }

    /// `true`: the entry must exist; `false`: it must not; `None`: either.
    fn must_be(&self, from: Time, to: Time) -> Option<bool> {
        match &self.known {
            Known::Unsure => None,
            Known::Absent => Some(false),
            Known::There(offer) => match offer.lease_time {
                None => Some(true),
                Some(end) if to < end => Some(true),
                Some(end) if end < from => Some(false),
                Some(_) => None,
            },
        }
    }

    fn judge(&self, found: &[DfAgentDescription], requested_at: Time, now: Time, notes: &mut Notes) {
        for offer in found {
            if offer.lease_time.is_some_and(|end| end < requested_at) {
                notes.wrong.push(format!("{} finds an offer whose lease ended: {offer:?}", self.me));
            }
        }
        let own = found.iter().find(|offer| offer.name.as_ref() == Some(&self.me));
        if self.must_be(requested_at, now).is_some_and(|must| must != own.is_some()) {
            notes.wrong.push(format!("{} knows {:?} at {now:?} and finds {own:?}", self.me, self.known));
        }
        if let (Known::There(known), Some(own)) = (&self.known, own)
            && known.services[0].name != own.services[0].name
        {
            notes.wrong.push(format!("{} knows {known:?} and finds {own:?}", self.me));
        }
    }
}

impl Plan for Registrar {
    fn next(&mut self, now: Time, random: &mut Random) -> (AgentId, Function) {
        let constraints = SearchConstraints { max_results: Some(-1), max_depth: Some(self.depth), search_id: None };
        let service = ServiceDescription { service_type: Some(KIND.to_owned()), ..Default::default() };
        let template = DfAgentDescription { services: vec![service], ..Default::default() };
        let name_alone = DfAgentDescription { name: Some(self.me.clone()), ..Default::default() };
        let function = match random.below(7) {
            0 | 1 => Function::Register(self.offer(now, random)),
            2 => Function::Modify(self.offer(now, random)),
            3 => Function::Deregister(name_alone),
            _ => Function::Search(template, constraints),
        };
        (self.df.clone(), function)
    }

    fn ended(
        &mut self,
        requested_at: Time,
        now: Time,
        function: &Function,
        answer: &Answer<PlainContent>,
        notes: &mut Notes,
    ) {
        let wrong = |notes: &mut Notes, what: &str| {
            notes.wrong.push(format!("{} knows {:?} at {now:?} and hears {what}", self.me, self.known));
        };
        let must = self.must_be(requested_at, now);
        let known = match (function, word(answer)) {
            (Function::Register(offer) | Function::Modify(offer), "done") => {
                match (function, must) {
                    (Function::Register(_), Some(true)) => wrong(notes, "that it was registered"),
                    (Function::Modify(_), Some(false)) => wrong(notes, "that it was modified"),
                    _ => {}
                }
                Known::There(Box::new(offer.clone()))
            }
            (Function::Register(_), "already") => {
                if must == Some(false) {
                    wrong(notes, "that it is there already");
                }
                if self.must_be(requested_at, now + PAUSE) == Some(true) {
                    return;
                }
                // A process that takes the same request when the lease has ended enters it.
                Known::Unsure
            }
            (Function::Modify(_), "not there") => {
                if must == Some(true) {
                    wrong(notes, "that it is not there");
                }
                Known::Absent
            }
            // The request was taken twice, and the entry was gone the second time.
            (Function::Deregister(_), "done" | "not there") => Known::Absent,
            (Function::Search(..), "done") => {
                if let Answer::Inform(PlainContent::Management(M::Done(_, Outcome::Offers(found)))) = answer {
                    self.judge(found, requested_at, now, notes);
                }
                return;
            }
            (Function::Search(..), _) => return,
            (_, "silence" | "failed") => Known::Unsure,
            (_, other) => return wrong(notes, other),
        };
        match &known {
            Known::Unsure => _ = notes.entered.remove(&self.me),
            Known::Absent => _ = notes.entered.insert(self.me.clone(), None),
            Known::There(offer) => _ = notes.entered.insert(self.me.clone(), Some((**offer).clone())),
        }
        self.known = known;
    }
}

/// A client that suspends and resumes agents of the platform.
pub(crate) struct Boss {
    pub(crate) ams: AgentId,
    pub(crate) agents: Vec<AgentId>,
}

impl Plan for Boss {
    fn next(&mut self, _: Time, random: &mut Random) -> (AgentId, Function) {
        let agent = self.agents[random.below(self.agents.len())].clone();
        let state = [LifeCycleState::Active, LifeCycleState::Suspended][random.below(2)];
        let entry = AmsAgentDescription { name: Some(agent), ownership: None, state: Some(state) };
        (self.ams.clone(), Function::ModifyAgent(entry))
    }

    fn ended(&mut self, _: Time, _: Time, function: &Function, answer: &Answer<PlainContent>, notes: &mut Notes) {
        let Function::ModifyAgent(AmsAgentDescription { name: Some(agent), state: Some(state), .. }) = function else {
            unreachable!("nothing else is requested")
        };
        match word(answer) {
            "done" => _ = notes.states.insert(agent.clone(), *state),
            "silence" | "failed" => _ = notes.states.remove(agent),
            // Its process has not started yet.
            "not there" => {}
            other => notes.wrong.push(format!("the boss hears: {other}, {answer:?}")),
        }
    }
}

/// A client that supplies basic services, and checks that they are listed.
pub(crate) struct Supplier {
    pub(crate) start: AgentId,
    pub(crate) number: u32,
}

impl Plan for Supplier {
    fn next(&mut self, _: Time, random: &mut Random) -> (AgentId, Function) {
        self.number += 1;
        let entry = ServiceEntry {
            id: format!("s{}", self.number),
            service_type: "t".to_owned(),
            addresses: vec!["http://nowhere/acc".to_owned()],
        };
        let supplies = random.below(3) == 0;
        let function = if supplies { Function::SupplyBasicService(entry) } else { Function::GetServiceRoot };
        (self.start.clone(), function)
    }

    fn ended(&mut self, _: Time, _: Time, function: &Function, answer: &Answer<PlainContent>, notes: &mut Notes) {
        match (function, answer, word(answer)) {
            (Function::SupplyBasicService(entry), _, "done" | "already") => notes.supplied.push(entry.clone()),
            (_, Answer::Inform(PlainContent::Management(M::Done(_, Outcome::ServiceRoot(root)))), _) => {
                let missing: Vec<_> = notes.supplied.iter().filter(|entry| !root.contains(entry)).cloned().collect();
                notes.wrong.extend(missing.iter().map(|entry| format!("the service root has no {}", entry.id)));
            }
            (_, _, "silence" | "failed") => {}
            (_, _, other) => notes.wrong.push(format!("the supplier hears: {other}, {answer:?}")),
        }
    }
}

/// Subscribes to all offers of a kind.
pub(crate) struct Subscriber {
    pub(crate) me: AgentId,
    pub(crate) df: AgentId,
    pub(crate) notes: Shared,
    pub(crate) conversation: u64,
    /// The time to subscribe again without updates.
    pub(crate) again: Option<Time>,
}

impl Subscriber {
    fn subscribe(&mut self, now: Time, actions: &mut Vec<ActionOf<Self>>) {
        self.again = Some(now + PATIENCE);
        let service = ServiceDescription { service_type: Some(KIND.to_owned()), ..Default::default() };
        let template = DfAgentDescription { services: vec![service], ..Default::default() };
        let constraints = SearchConstraints { max_results: Some(-1), ..Default::default() };
        let content = PlainContent::Management(M::Subscription(template, constraints));
        actions.push(Action::Send(AclMessage {
            language: "fipa-sl",
            ontology: ONTOLOGY,
            protocol: "fipa-subscribe",
            conversation_id: self.conversation,
            reply_with: self.conversation,
            ..AclMessage::new(P::Subscribe, self.me.clone(), self.df.clone(), content)
        }));
    }

    fn learn(&self, offers: &[DfAgentDescription]) {
        let mut notes = self.notes.lock().unwrap();
        let view = notes.views.entry(self.me.clone()).or_default();
        for offer in offers {
            let name = offer.name.as_ref().map(|name| name.name.to_lowercase()).unwrap_or_default();
            match offer.services.first() {
                Some(service) => _ = view.insert(name, service.name.clone().unwrap_or_default()),
                None => _ = view.remove(&name),
            }
        }
    }
}

impl StateMachine for Subscriber {
    type Content = PlainContent;
    type Value = String;
    type Effect = ChannelEffect;
    type Completion = ChannelReport;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        match event {
            Event::Start => self.subscribe(now, actions),
            Event::Deadline if self.again.is_some_and(|again| again <= now) => self.subscribe(now, actions),
            Event::Message(message) if message.conversation_id == self.conversation => {
                match (&message.content, message.performative) {
                    (PlainContent::Management(M::Updates(_, _, offers)), P::Inform) => {
                        self.again = None;
                        self.learn(offers);
                    }
                    (_, P::Failure | P::Refuse | P::NotUnderstood) => {
                        // The subscription is over: the next one begins without knowledge.
                        self.conversation += 1;
                        self.notes.lock().unwrap().views.remove(&self.me);
                        self.again = Some(now + Duration::from_secs(5));
                    }
                    _ => {}
                }
            }
            _ => {}
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        self.again
    }
}
