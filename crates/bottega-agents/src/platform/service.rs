//! The framework of the platform's services: requests come in, entries of the store change, answers go out.
//!
//! A service's knowledge is a mirror of entries of the store, which it watches. A change is a compare-and-set with the
//! known revision: of two replicas that decide at the same time one loses, reads again and decides again. So any number
//! of services can serve the same pages, and a restarted one knows what its predecessor knew. An entry with empty text
//! counts as removed.

use std::{
    collections::{BTreeMap, VecDeque},
    marker::PhantomData,
    time::Duration,
};

use super::management::{
    CarriesManagement, FailureReason, Function, ManagementContent, NotUnderstoodReason, Outcome, RefuseReason,
};
use crate::{
    AclMessage, Action, ActionOf, AgentId, Entry, Event, EventOf, Key, Performative, Revision, StateMachine,
    StoreReply, StoreRequest, Ticket, Time,
};

/// Maximum number of attempts at a change that conflicts with others.
const TRIES_MAX: u32 = 16;
/// Timeout for the store.
const STORE_WAIT_MAX: Duration = Duration::from_secs(10);
/// Maximum number of requests that wait for the store.
const OPEN_MAX: usize = 1 << 12;
/// Maximum length of an entry's text, in bytes, unless a service sets its own.
pub const ENTRY_BYTES_MAX: usize = 1 << 16;

/// A message of agent management, to or from a service.
pub type Said = AclMessage<ManagementContent>;

/// The reason why a function has no result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoResult {
    /// The function was refused, for this reason.
    Refuse(RefuseReason),
    /// The function has failed, for this reason.
    Failure(FailureReason),
}

impl From<RefuseReason> for NoResult {
    fn from(reason: RefuseReason) -> Self {
        Self::Refuse(reason)
    }
}

impl From<FailureReason> for NoResult {
    fn from(reason: FailureReason) -> Self {
        Self::Failure(reason)
    }
}

/// A change of an entry, written only if the entry still has the revision that the service knows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// The key of the entry.
    pub key: Key,
    /// The new text; empty: the entry is removed.
    pub text: String,
}

/// The next step in the execution of a function.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// The function is finished, without a change.
    Done(Outcome),
    /// Write this change; then it is finished with this outcome.
    Write(Change, Outcome),
    /// The service answers later by itself.
    Later,
}

/// Messages and changes that a service issues in addition to its answers.
#[derive(Debug, Default)]
pub struct ServiceOutbox {
    /// The messages to send.
    pub send: Vec<Said>,
    /// The changes, each with a mark for [`Functions::settled`].
    pub writes: Vec<(u64, Change)>,
}

/// The functions of a service, without the protocol.
pub trait Functions {
    /// The key prefixes of the entries that it mirrors.
    const PREFIXES: &'static [&'static str];
    /// Maximum length of an entry's text, in bytes.
    const ENTRY_BYTES_MAX: usize = ENTRY_BYTES_MAX;

    /// Takes in the current text of an entry, and its revision. Empty text: the entry was removed.
    fn learn(&mut self, now: Time, key: &str, revision: Revision, text: &str, todo: &mut ServiceOutbox);

    /// Returns the next step of a function requested by `request`. May be called again for the same request if the
    /// pages have changed meanwhile.
    ///
    /// - `todo`: gets further messages and changes.
    ///
    /// # Errors
    /// The function is refused or has failed, without any change.
    fn perform(
        &mut self,
        now: Time,
        request: &Said,
        function: &Function,
        todo: &mut ServiceOutbox,
    ) -> Result<Step, NoResult>;

    /// Returns the refusal of a function whose entry is longer than [`Self::ENTRY_BYTES_MAX`].
    fn too_large(&self, function: &Function) -> RefuseReason;

    /// Returns the key of the entry on which the function's outcome depends; `None`: it is not a single one.
    fn entry_of(&self, _function: &Function) -> Option<Key> {
        None
    }

    /// Handles a message that is not a request. Returns false if it is not understood.
    fn hear(&mut self, _now: Time, _message: &Said, _todo: &mut ServiceOutbox) -> bool {
        false
    }

    /// Notes that an agent is present in this process (`_present`), or has left it.
    fn presence(&mut self, _now: Time, _agent: &AgentId, _present: bool, _todo: &mut ServiceOutbox) {}

    /// Notes that a change of this service was written, or was not: because the entry had another revision, or the
    /// store did not confirm it.
    ///
    /// - `_mark`: that of the change in [`ServiceOutbox::writes`].
    /// - `_made`: true if it was written.
    fn settled(&mut self, _now: Time, _mark: u64, _made: bool, _todo: &mut ServiceOutbox) {}

    /// Does what is due. Called when all pages have been read, and at the time of [`Self::next_deadline`].
    fn tick(&mut self, _now: Time, _todo: &mut ServiceOutbox) {}

    /// Returns the time at which [`Self::tick`] must be called; `None`: never.
    fn next_deadline(&self) -> Option<Time> {
        None
    }
}

/// A change in progress.
#[derive(Clone, Debug)]
struct Open {
    change: Change,
    until: Time,
    cause: Cause,
}

#[derive(Clone, Debug)]
enum Cause {
    Request {
        request: Said,
        outcome: Outcome,
        tries: u32,
    },
    /// Read the entry without writing, because the mirror may be outdated.
    Look {
        request: Said,
        tries: u32,
    },
    Own(u64),
}

/// A service as an agent: receives requests and answers them.
///
/// `C` is the platform's content type, `V` the value type of its store; `E` and `R` are the types of effects and
/// completions, which services do not use.
#[derive(Clone, Debug)]
pub struct Service<F, C, V, E, R> {
    id: AgentId,
    functions: F,
    /// The revisions of the mirrored entries.
    revisions: BTreeMap<Key, Revision>,
    /// Number of prefixes whose existing entries are known.
    caught_up: usize,
    /// The time at which the watch is requested again.
    watch_again: Time,
    /// Requests that arrived before the pages were known.
    early: VecDeque<Said>,
    open: BTreeMap<Ticket, Open>,
    next_ticket: u64,
    #[allow(clippy::type_complexity, reason = "a marker")]
    vocabulary: PhantomData<fn() -> (C, V, E, R)>,
}

impl<F: Functions, C, V, E, R> Service<F, C, V, E, R>
where
    C: CarriesManagement,
    V: From<String> + AsRef<str>,
{
    /// Makes the service, as agent `id`. At [`Event::Start`] it begins to read its pages; requests wait until they are
    /// known.
    pub fn new(id: AgentId, functions: F) -> Self {
        Self {
            id,
            functions,
            revisions: BTreeMap::new(),
            caught_up: 0,
            watch_again: Time::ZERO,
            early: VecDeque::new(),
            open: BTreeMap::new(),
            // The first tickets belong to the watches
            next_ticket: F::PREFIXES.len() as u64,
            vocabulary: PhantomData,
        }
    }

    /// Returns the functions, for inspection.
    pub fn functions(&self) -> &F {
        &self.functions
    }

    /// Returns true when all pages are known.
    pub fn is_ready(&self) -> bool {
        self.caught_up >= F::PREFIXES.len()
    }

    fn watch(&mut self, now: Time, actions: &mut Vec<Action<C, V, E>>) {
        self.caught_up = 0;
        self.watch_again = now + STORE_WAIT_MAX;
        for (ticket, prefix) in (0..).zip(F::PREFIXES) {
            let request = StoreRequest::Watch { prefix: (*prefix).into() };
            actions.push(Action::Store { ticket: Ticket(ticket), request });
        }
    }

    fn hear(&mut self, now: Time, message: Said, todo: &mut ServiceOutbox, actions: &mut Vec<Action<C, V, E>>) {
        let function = match &message.content {
            ManagementContent::Action(function) if message.performative == Performative::Request => function.clone(),
            _ => {
                if !self.functions.hear(now, &message, todo) {
                    todo.send.extend(self.not_understood(&message));
                }
                return;
            }
        };
        self.perform(now, message, &function, 0, false, todo, actions);
    }

    fn perform(
        &mut self,
        now: Time,
        request: Said,
        function: &Function,
        tries: u32,
        looked: bool,
        todo: &mut ServiceOutbox,
        actions: &mut Vec<Action<C, V, E>>,
    ) {
        let step = if tries > TRIES_MAX || self.open.len() >= OPEN_MAX {
            Err(internal("too many requests at the same time"))
        } else {
            self.functions.perform(now, &request, function, todo)
        };
        match step {
            // The answer is immediate, so there is no agree
            Ok(Step::Done(outcome)) => todo.send.push(self.done(&request, outcome)),
            Ok(Step::Later) => {}
            Ok(Step::Write(change, outcome)) if change.text.len() <= F::ENTRY_BYTES_MAX => {
                self.write(now, change, Cause::Request { request, outcome, tries }, actions);
            }
            Ok(Step::Write(..)) => {
                todo.send.push(self.no_result(&request, self.functions.too_large(function).into()));
            }
            // A write detects an outdated mirror by itself; before a failure, read the entry
            Err(NoResult::Failure(FailureReason::AlreadyRegistered | FailureReason::NotRegistered))
                if !looked && let Some(key) = self.functions.entry_of(function) =>
            {
                let ticket =
                    self.open(now, Change { key: key.clone(), text: String::new() }, Cause::Look { request, tries });
                actions.push(Action::Store { ticket, request: StoreRequest::Get { key } });
            }
            Err(reason) => todo.send.push(self.no_result(&request, reason)),
        }
    }

    fn write(&mut self, now: Time, change: Change, cause: Cause, actions: &mut Vec<Action<C, V, E>>) {
        let expected_revision = self.revisions.get(&change.key).copied().unwrap_or(Revision::ABSENT);
        let (key, value) = (change.key.clone(), V::from(change.text.clone()));
        let request = StoreRequest::CompareAndSet { key, expected_revision, value };
        let ticket = self.open(now, change, cause);
        actions.push(Action::Store { ticket, request });
    }

    fn open(&mut self, now: Time, change: Change, cause: Cause) -> Ticket {
        let ticket = Ticket(self.next_ticket);
        self.next_ticket += 1;
        self.open.insert(ticket, Open { change, until: now + STORE_WAIT_MAX, cause });
        ticket
    }

    /// Takes in an entry that the store has just returned.
    fn learn_now(&mut self, now: Time, key: Key, entry: Option<Entry<V>>, todo: &mut ServiceOutbox) {
        match entry {
            Some(entry) => {
                self.learn(now, &key, entry.revision, entry.value.as_ref(), todo);
                // Keep the revision of removed entries too, for the next attempt
                self.revisions.insert(key, entry.revision);
            }
            None => {
                self.revisions.remove(&key);
                self.functions.learn(now, &key.to_string(), Revision::ABSENT, "", todo);
            }
        }
    }

    /// Takes in an entry, unless a later revision is known.
    fn learn(&mut self, now: Time, key: &Key, revision: Revision, text: &str, todo: &mut ServiceOutbox) {
        if self.revisions.get(key).is_some_and(|known| *known >= revision) {
            return;
        }
        if text.is_empty() {
            self.revisions.remove(key);
        } else {
            self.revisions.insert(key.clone(), revision);
        }
        self.functions.learn(now, &key.to_string(), revision, text, todo);
    }

    fn store_says(
        &mut self,
        now: Time,
        ticket: Ticket,
        reply: StoreReply<V>,
        todo: &mut ServiceOutbox,
        actions: &mut Vec<Action<C, V, E>>,
    ) {
        match reply {
            StoreReply::Changed(entry) => self.learn(now, &entry.key, entry.revision, entry.value.as_ref(), todo),
            StoreReply::CaughtUp => {
                self.caught_up += 1;
                if self.is_ready() {
                    self.functions.tick(now, todo);
                    for message in std::mem::take(&mut self.early) {
                        self.hear(now, message, todo, actions);
                    }
                }
            }
            StoreReply::Got { key, entry } => {
                let Some(Open { cause: Cause::Look { request, tries }, .. }) = self.open.remove(&ticket) else {
                    return;
                };
                self.learn_now(now, key, entry, todo);
                let ManagementContent::Action(function) = &request.content else { return };
                let function = function.clone();
                self.perform(now, request, &function, tries + 1, true, todo, actions);
            }
            StoreReply::Written { key, revision } => {
                let Some(open) = self.open.remove(&ticket) else { return };
                self.learn(now, &key, revision, &open.change.text, todo);
                match open.cause {
                    Cause::Request { request, outcome, .. } => todo.send.push(self.done(&request, outcome)),
                    Cause::Look { .. } => {}
                    Cause::Own(mark) => self.functions.settled(now, mark, true, todo),
                }
            }
            StoreReply::Conflict { key, entry } => {
                let Some(open) = self.open.remove(&ticket) else { return };
                self.learn_now(now, key, entry, todo);
                match open.cause {
                    Cause::Request { request, tries, .. } => {
                        let ManagementContent::Action(function) = &request.content else { return };
                        let function = function.clone();
                        self.perform(now, request, &function, tries + 1, false, todo, actions);
                    }
                    Cause::Look { .. } => {}
                    Cause::Own(mark) => self.functions.settled(now, mark, false, todo),
                }
            }
            StoreReply::Unavailable => self.give_up(now, ticket, todo),
        }
    }

    fn give_up(&mut self, now: Time, ticket: Ticket, todo: &mut ServiceOutbox) {
        let Some(open) = self.open.remove(&ticket) else { return };
        match open.cause {
            Cause::Request { request, .. } | Cause::Look { request, .. } => {
                todo.send.push(self.no_result(&request, internal("the store does not answer")));
            }
            Cause::Own(mark) => self.functions.settled(now, mark, false, todo),
        }
    }

    fn done(&self, request: &Said, outcome: Outcome) -> Said {
        let ManagementContent::Action(function) = &request.content else { unreachable!("only actions are performed") };
        request.reply(Performative::Inform, self.id.clone(), ManagementContent::Done(function.clone(), outcome))
    }

    fn no_result(&self, request: &Said, reason: NoResult) -> Said {
        let ManagementContent::Action(function) = &request.content else { unreachable!("only actions are performed") };
        let function = function.clone();
        match reason {
            NoResult::Refuse(reason) => {
                request.reply(Performative::Refuse, self.id.clone(), ManagementContent::Refused(function, reason))
            }
            NoResult::Failure(reason) => {
                request.reply(Performative::Failure, self.id.clone(), ManagementContent::Failed(function, reason))
            }
        }
    }

    /// Returns the not-understood reply; none in reply to an answer, to avoid endless replies.
    fn not_understood(&self, message: &Said) -> Option<Said> {
        use Performative as P;
        let reason = match message.performative {
            P::Inform | P::Agree | P::Refuse | P::Failure | P::NotUnderstood | P::Confirm | P::Disconfirm => {
                return None;
            }
            P::Request => NotUnderstoodReason::UnrecognisedValue("content".into()),
            act => NotUnderstoodReason::UnsupportedAct(act),
        };
        Some(message.reply(P::NotUnderstood, self.id.clone(), ManagementContent::NotUnderstood(reason)))
    }

    fn message(
        &mut self,
        now: Time,
        message: AclMessage<C>,
        todo: &mut ServiceOutbox,
        actions: &mut Vec<Action<C, V, E>>,
    ) {
        let Some(content) = message.content.management().cloned() else {
            // The content is not management; the reply is the same for any
            let nothing = message.map(|_| ManagementContent::Cancel);
            let act = nothing.performative;
            todo.send.extend(self.not_understood(&nothing).map(|answer| {
                let reason = match act {
                    Performative::Request => NotUnderstoodReason::UnrecognisedValue("content".into()),
                    act => NotUnderstoodReason::UnsupportedAct(act),
                };
                AclMessage { content: ManagementContent::NotUnderstood(reason), ..answer }
            }));
            return;
        };
        let message = message.map(|_| content);
        if self.is_ready() {
            self.hear(now, message, todo, actions);
        } else if self.early.len() < OPEN_MAX {
            self.early.push_back(message);
        }
    }

    fn look_at_the_clock(&mut self, now: Time, todo: &mut ServiceOutbox, actions: &mut Vec<Action<C, V, E>>) {
        if !self.is_ready() && self.watch_again <= now {
            self.watch(now, actions);
        }
        let late: Vec<Ticket> =
            self.open.iter().filter(|(_, open)| open.until <= now).map(|(ticket, _)| *ticket).collect();
        for ticket in late {
            self.give_up(now, ticket, todo);
        }
        if self.is_ready() && self.functions.next_deadline().is_some_and(|at| at <= now) {
            self.functions.tick(now, todo);
        }
    }
}

fn internal(message: &str) -> NoResult {
    FailureReason::InternalError(message.to_owned()).into()
}

impl<F: Functions, C, V, E, R> StateMachine for Service<F, C, V, E, R>
where
    C: CarriesManagement,
    V: From<String> + AsRef<str>,
{
    type Content = C;
    type Value = V;
    type Effect = E;
    type Completion = R;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        let mut todo = ServiceOutbox::default();
        match event {
            Event::Start => {
                self.watch(now, actions);
                actions.push(Action::WatchPresence);
            }
            Event::Message(message) => self.message(now, message, &mut todo, actions),
            Event::Store { ticket, reply } => self.store_says(now, ticket, reply, &mut todo, actions),
            Event::Presence { agent, present } => self.functions.presence(now, &agent, present, &mut todo),
            Event::Completed(_) | Event::Deadline => {}
        }
        self.look_at_the_clock(now, &mut todo, actions);
        for (mark, change) in todo.writes {
            self.write(now, change, Cause::Own(mark), actions);
        }
        actions.extend(todo.send.into_iter().map(|message| Action::Send(message.map(C::from))));
    }

    fn next_deadline(&self) -> Option<Time> {
        let store = self.open.values().map(|open| open.until).min();
        let own = if self.is_ready() { self.functions.next_deadline() } else { Some(self.watch_again) };
        store.into_iter().chain(own).min()
    }
}
