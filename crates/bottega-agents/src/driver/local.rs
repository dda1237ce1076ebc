//! Agents in one process: a few threads, mailboxes in memory, real time.
//!
//! One lock guards mailboxes, store and timers; no machine ever runs under it. A thread without work sleeps until a
//! mailbox fills or the next deadline comes: nothing polls.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    panic,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant},
};

use super::{alarm::Alarm, queues::Queues, uplink::Uplink};
use crate::{
    AclMessage, AgentId, Event, EventOf, Key, StateMachine, StoreRequest, Ticket, Time,
    bus::{BLOBS_MAX, Beyond, Blob, BlobId, Bus, carry_out},
    entry_store::EntryStore,
    store::{Addressed, MemoryStore},
};

/// The most messages that wait in a mailbox; what comes on top is lost, as on any network.
///
/// Completions and answers of the store are not counted: each was asked for by the agent itself.
pub const MAILBOX_MESSAGES_MAX: usize = 1 << 16;

/// How many events an agent may take before the next agent has its turn.
const TURN_EVENTS_MAX: usize = 32;

/// The shortest time after which a machine is woken again that names a deadline in the past.
const WAKE_AFTER_MIN: Duration = Duration::from_millis(1);

/// Begins effects of one agent. It must return soon; what takes long belongs on another thread, which reports its
/// end through the [`Mailbox`].
pub type Performer<M> = Box<dyn FnMut(<M as StateMachine>::Effect, &Mailbox<M>) + Send>;

struct Slot<M: StateMachine> {
    id: AgentId,
    /// Absent while a thread runs it, and when it has stopped.
    machine: Option<(M, Performer<M>)>,
    mailbox: VecDeque<EventOf<M>>,
    messages: usize,
    /// In the ready queue, or running.
    scheduled: bool,
    deadline: Option<Time>,
    stopped: bool,
}

struct State<M: StateMachine> {
    slots: Vec<Slot<M>>,
    index: BTreeMap<AgentId, usize>,
    ready: VecDeque<usize>,
    timers: BTreeSet<(Time, usize)>,
    queues: Queues<M::Content>,
    blobs: BTreeMap<BlobId, Blob>,
    presence_watchers: BTreeSet<usize>,
    /// Agents that have not stopped.
    alive: usize,
    messages_lost: u64,
    /// Gets what is for agents that are not here.
    gateway: Option<usize>,
    closing: bool,
    panicked: bool,
}

type Store<V> = Box<dyn EntryStore<V, usize> + Send>;

struct Shared<M: StateMachine> {
    state: Mutex<State<M>>,
    /// Locked before `state` where both are, so that replies arrive in the order of what they tell, and that a store
    /// which takes its time holds up nobody who does not need it.
    store: Mutex<Store<M::Value>>,
    /// There is work for a worker, or the platform closes.
    work: Alarm,
    /// The last agent stopped, or the platform closes.
    finished: Condvar,
    started: Instant,
    /// What lies beyond this process.
    uplink: Option<Arc<dyn Uplink<M>>>,
}

impl<M: StateMachine> Shared<M> {
    fn lock(&self) -> MutexGuard<'_, State<M>> {
        // No machine runs under the lock, so a panic elsewhere leaves the state whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now(&self) -> Time {
        Time::since_start(self.started.elapsed())
    }

    /// Does something with the store and delivers what it says.
    fn with_store(&self, change: impl FnOnce(&mut Store<M::Value>, &mut Vec<Addressed<M::Value, usize>>)) {
        // A store that panicked is as good as one that cannot be asked; its own invariants are its business.
        let mut store = self.store.lock().unwrap_or_else(PoisonError::into_inner);
        let mut replies = Vec::new();
        change(&mut store, &mut replies);
        if replies.is_empty() {
            return;
        }
        let mut state = self.lock();
        for Addressed { to, ticket, reply } in replies {
            state.deliver(to, Event::Store { ticket, reply });
        }
        drop(state);
        self.work.notify_all();
    }
}

impl<M: StateMachine> State<M> {
    /// Puts an event into a mailbox. Returns whether a worker must be woken.
    fn deliver(&mut self, to: usize, event: EventOf<M>) -> bool {
        let slot = &mut self.slots[to];
        if slot.stopped {
            return false;
        }
        if matches!(event, Event::Message(_)) {
            if slot.messages == MAILBOX_MESSAGES_MAX {
                self.messages_lost += 1;
                return false;
            }
            slot.messages += 1;
        }
        slot.mailbox.push_back(event);
        self.schedule(to)
    }

    /// From now on it is told who comes and goes, and now who is here.
    fn watch_presence(&mut self, watcher: usize) {
        self.presence_watchers.insert(watcher);
        for agent in 0..self.slots.len() {
            if agent != watcher && !self.slots[agent].stopped {
                let agent = self.slots[agent].id.clone();
                self.deliver(watcher, Event::Presence { agent, present: true });
            }
        }
    }

    fn schedule(&mut self, agent: usize) -> bool {
        let slot = &mut self.slots[agent];
        if slot.scheduled {
            return false;
        }
        slot.scheduled = true;
        self.ready.push_back(agent);
        true
    }

    fn set_deadline(&mut self, agent: usize, deadline: Option<Time>) {
        let slot = &mut self.slots[agent];
        if slot.deadline == deadline {
            return;
        }
        if let Some(old) = slot.deadline {
            self.timers.remove(&(old, agent));
        }
        slot.deadline = deadline;
        if let Some(new) = deadline {
            self.timers.insert((new, agent));
        }
    }

    /// Moves agents whose deadline has come into the ready queue.
    fn wake_due(&mut self, now: Time) {
        while let Some(&(at, agent)) = self.timers.first() {
            if at > now {
                return;
            }
            self.timers.pop_first();
            self.slots[agent].deadline = None;
            self.deliver(agent, Event::Deadline);
        }
    }

    fn tell_presence(&mut self, agent: usize, present: bool) {
        let id = self.slots[agent].id.clone();
        for watcher in self.presence_watchers.clone() {
            if watcher != agent {
                self.deliver(watcher, Event::Presence { agent: id.clone(), present });
            }
        }
    }

    fn retire(&mut self, agent: usize) {
        self.set_deadline(agent, None);
        let slot = &mut self.slots[agent];
        slot.stopped = true;
        slot.mailbox.clear();
        let id = slot.id.clone();
        self.queues.forget(&id);
        self.presence_watchers.remove(&agent);
        self.alive -= 1;
        self.tell_presence(agent, false);
    }
}

/// The bus of a [`LocalPlatform`]: may be cloned and used by any thread.
pub struct LocalBus<M: StateMachine>(Arc<Shared<M>>);

impl<M: StateMachine> Clone for LocalBus<M> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<M: StateMachine> LocalBus<M>
where
    M::Content: Clone,
    M::Value: Clone,
{
    fn with(&self, change: impl FnOnce(&mut State<M>)) {
        change(&mut self.0.lock());
        self.0.work.notify_all();
    }
}

impl<M: StateMachine> Bus for LocalBus<M>
where
    M::Content: Clone,
    M::Value: Clone,
{
    type Content = M::Content;
    type Value = M::Value;

    fn publish(&mut self, message: AclMessage<M::Content>) {
        let mut elsewhere = Vec::new();
        self.with(|state| {
            for receiver in &message.receivers {
                // Of one who has stopped the gateway tells the sender.
                let here = |to: usize| state.gateway.is_none_or(|gateway| gateway != to && !state.slots[to].stopped);
                match state.index.get(receiver) {
                    Some(&to) if here(to) => _ = state.deliver(to, Event::Message(message.clone())),
                    _ => elsewhere.push(receiver.clone()),
                }
            }
            match (state.gateway, &self.0.uplink) {
                _ if elsewhere.is_empty() => {}
                (Some(gateway), _) => {
                    let receivers = std::mem::take(&mut elsewhere);
                    state.deliver(gateway, Event::Message(AclMessage { receivers, ..message.clone() }));
                }
                (None, Some(_)) => {}
                (None, None) => state.messages_lost += elsewhere.len() as u64,
            }
        });
        if let Some(uplink) = &self.0.uplink {
            elsewhere.iter().for_each(|receiver| uplink.publish(self.0.now(), &message, receiver));
        }
    }

    fn enqueue(&mut self, queue: &Key, message: AclMessage<M::Content>) {
        let addressed = self.0.lock().queues.enqueue(queue, message);
        if let Some(message) = addressed {
            self.publish(message);
        }
    }

    fn join(&mut self, queue: &Key, agent: &AgentId) {
        let waiting = self.0.lock().queues.join(queue, agent);
        for message in waiting {
            self.publish(message);
        }
    }

    fn ask_store(&mut self, from: &AgentId, ticket: Ticket, request: StoreRequest<M::Value>) {
        let from = self.0.lock().index.get(from).copied();
        let Some(agent) = from else { return };
        match &self.0.uplink {
            Some(uplink) => uplink.ask_store(Mailbox { shared: Arc::clone(&self.0), agent }, ticket, request),
            None => self.0.with_store(|store, replies| store.handle(agent, ticket, request, replies)),
        }
    }

    fn watch_presence(&mut self, from: &AgentId) {
        self.with(|state| {
            if let Some(&watcher) = state.index.get(from) {
                state.watch_presence(watcher);
            }
        });
    }

    fn put_blob(&mut self, id: BlobId, blob: Blob) -> bool {
        let mut state = self.0.lock();
        if state.blobs.len() >= BLOBS_MAX && !state.blobs.contains_key(&id) {
            return false;
        }
        state.blobs.insert(id, blob);
        true
    }

    fn blob(&self, id: BlobId) -> Option<Blob> {
        self.0.lock().blobs.get(&id).cloned()
    }
}

/// The mailbox of one agent, for threads outside of the platform: an engine that reports, a user who interrupts.
pub struct Mailbox<M: StateMachine> {
    shared: Arc<Shared<M>>,
    agent: usize,
}

impl<M: StateMachine> Clone for Mailbox<M> {
    fn clone(&self) -> Self {
        Self { shared: Arc::clone(&self.shared), agent: self.agent }
    }
}

impl<M: StateMachine> Mailbox<M> {
    /// Reports an effect. Dropped when the agent has stopped.
    pub fn complete(&self, completion: M::Completion) {
        self.shared.lock().deliver(self.agent, Event::Completed(completion));
        self.shared.work.notify_all();
    }

    /// Brings something from beyond this process. Dropped when the agent has stopped.
    pub(super) fn deliver(&self, event: EventOf<M>) {
        self.shared.lock().deliver(self.agent, event);
        self.shared.work.notify_all();
    }

    /// Whether the agent has stopped: nothing that is delivered is of use any more.
    pub(super) fn is_closed(&self) -> bool {
        let state = self.shared.lock();
        state.closing || state.slots[self.agent].stopped
    }

    /// The platform's time.
    pub fn now(&self) -> Time {
        self.shared.now()
    }
}

/// A platform in one process.
pub struct LocalPlatform<M: StateMachine> {
    shared: Arc<Shared<M>>,
    threads: Vec<thread::JoinHandle<()>>,
}

impl<M: StateMachine + Send + 'static> LocalPlatform<M>
where
    M::Content: Clone + Send + 'static,
    M::Value: Clone + Send + 'static,
    M::Effect: Send + 'static,
    M::Completion: Send + 'static,
{
    /// Starts so many threads (at least one), which sleep until there are agents.
    ///
    /// # Errors
    /// When the operating system gives no thread.
    pub fn new(threads: usize) -> std::io::Result<Self> {
        Self::build(threads, Box::new(MemoryStore::default()), None)
    }

    /// The same over a store that may be shared with other processes, or outlast this one.
    ///
    /// # Errors
    /// When the operating system gives no thread.
    pub fn with_store(threads: usize, store: Box<dyn EntryStore<M::Value, usize> + Send>) -> std::io::Result<Self> {
        Self::build(threads, store, None)
    }

    /// The same with a link to other processes: who is not here is sought there, and the store is the one that all share.
    /// Queues, blobs and presence stay within the process.
    ///
    /// # Errors
    /// When the operating system gives no thread.
    pub fn linked(threads: usize, uplink: Option<Arc<dyn Uplink<M>>>) -> std::io::Result<Self> {
        Self::build(threads, Box::new(MemoryStore::default()), uplink)
    }

    fn build(
        threads: usize,
        store: Box<dyn EntryStore<M::Value, usize> + Send>,
        uplink: Option<Arc<dyn Uplink<M>>>,
    ) -> std::io::Result<Self> {
        let state = State {
            slots: Vec::new(),
            index: BTreeMap::new(),
            ready: VecDeque::new(),
            timers: BTreeSet::new(),
            queues: Queues::default(),
            blobs: BTreeMap::new(),
            presence_watchers: BTreeSet::new(),
            alive: 0,
            messages_lost: 0,
            gateway: None,
            closing: false,
            panicked: false,
        };
        let shared = Arc::new(Shared {
            state: Mutex::new(state),
            store: Mutex::new(store),
            work: Alarm::default(),
            finished: Condvar::new(),
            started: start_of_time(),
            uplink,
        });
        let mut platform = Self { shared: Arc::clone(&shared), threads: Vec::new() };
        for number in 0..threads.max(1) {
            let shared = Arc::clone(&shared);
            let worker = thread::Builder::new().name(format!("agents-{number}"));
            platform.threads.push(worker.spawn(move || work(&shared))?);
        }
        Ok(platform)
    }

    /// Brings an agent to life. Its first event is [`Event::Start`].
    ///
    /// # Errors
    /// When the name is taken, by an agent that lives or has lived.
    pub fn add(&self, id: &AgentId, machine: M, performer: Performer<M>) -> Result<Mailbox<M>, NameTaken> {
        let mut state = self.shared.lock();
        if state.index.contains_key(id) {
            return Err(NameTaken(id.clone()));
        }
        let agent = state.slots.len();
        state.index.insert(id.clone(), agent);
        state.slots.push(Slot {
            id: id.clone(),
            machine: Some((machine, performer)),
            mailbox: VecDeque::new(),
            messages: 0,
            scheduled: false,
            deadline: None,
            stopped: false,
        });
        state.alive += 1;
        let mailbox = Mailbox { shared: Arc::clone(&self.shared), agent };
        // It must be reachable before it says its first word.
        drop(state);
        if let Some(uplink) = &self.shared.uplink {
            uplink.add(id, mailbox.clone());
        }
        let mut state = self.shared.lock();
        state.deliver(agent, Event::Start);
        state.tell_presence(agent, true);
        drop(state);
        self.shared.work.notify_all();
        Ok(mailbox)
    }

    /// From now on this agent gets all messages to agents that are not here, and is told who is, before anything that
    /// comes from outside can reach it. `false`: it is not here itself.
    pub fn set_gateway(&self, agent: &AgentId) -> bool {
        let mut state = self.shared.lock();
        state.gateway = state.index.get(agent).copied();
        let known = state.gateway.is_some();
        if let Some(gateway) = state.gateway {
            state.watch_presence(gateway);
        }
        drop(state);
        self.shared.work.notify_all();
        known
    }

    /// Tells agents what other processes wrote into the store. To be called now and then where it is shared.
    pub fn poll_store(&self) {
        self.shared.with_store(|store, replies| store.poll(replies));
    }

    /// The bus, for threads outside of the platform.
    pub fn bus(&self) -> LocalBus<M> {
        LocalBus(Arc::clone(&self.shared))
    }

    /// Messages that nobody got: no such agent, or its mailbox was full.
    pub fn messages_lost(&self) -> u64 {
        self.shared.lock().messages_lost
    }

    /// The platform's time.
    pub fn now(&self) -> Time {
        self.shared.now()
    }

    /// Waits until every agent has stopped, then ends the threads. Goes on with the panic of a machine, if one did.
    pub fn wait(mut self) {
        let mut state = self.shared.lock();
        while state.alive > 0 && !state.panicked {
            state = self.shared.finished.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        drop(state);
        self.close();
    }

    /// Ends the threads after the events they have in hand, whether agents have stopped or not.
    pub fn stop(mut self) {
        self.close();
    }
}

impl<M: StateMachine> LocalPlatform<M> {
    fn close(&mut self) {
        self.shared.lock().closing = true;
        self.shared.work.notify_all();
        let mut first_panic = None;
        for thread in self.threads.drain(..) {
            if let Err(panic) = thread.join() {
                first_panic.get_or_insert(panic);
            }
        }
        // Performers may hold mailboxes, which hold the platform: cut the circle, outside of the lock.
        let retire = |slot: &mut Slot<M>| {
            slot.stopped = true;
            slot.mailbox.clear();
            slot.machine.take()
        };
        let machines: Vec<_> = self.shared.lock().slots.iter_mut().map(retire).collect();
        drop(machines);
        if let Some(panic) = first_panic
            && !thread::panicking()
        {
            panic::resume_unwind(panic);
        }
    }
}

impl<M: StateMachine> Drop for LocalPlatform<M> {
    fn drop(&mut self) {
        if !self.threads.is_empty() {
            self.close();
        }
    }
}

/// An agent's name is its identity and is never given twice.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is already an agent `{0}`")]
pub struct NameTaken(pub AgentId);

/// Tells the platform when a machine panics, so that nobody waits for it.
struct PanicNotice<'a, M: StateMachine>(&'a Shared<M>);

impl<M: StateMachine> Drop for PanicNotice<'_, M> {
    fn drop(&mut self) {
        if thread::panicking() {
            let mut state = self.0.lock();
            state.panicked = true;
            state.closing = true;
            drop(state);
            self.0.work.notify_all();
            self.0.finished.notify_all();
        }
    }
}

fn work<M: StateMachine>(shared: &Arc<Shared<M>>)
where
    M::Content: Clone,
    M::Value: Clone,
{
    let _notice = PanicNotice(shared);
    let mut turn = VecDeque::new();
    let mut actions = Vec::new();
    while let Some(agent) = next_agent(shared) {
        let (mut machine, mut performer, id) = {
            let mut state = shared.lock();
            let slot = &mut state.slots[agent];
            let count = slot.mailbox.len().min(TURN_EVENTS_MAX);
            turn.extend(slot.mailbox.drain(..count));
            slot.messages -= turn.iter().filter(|event| matches!(event, Event::Message(_))).count();
            let (machine, performer) = slot.machine.take().expect("an agent in the ready queue is at rest");
            (machine, performer, slot.id.clone())
        };
        let mut bus = LocalBus(Arc::clone(shared));
        let mailbox = Mailbox { shared: Arc::clone(shared), agent };
        let mut stopped = false;
        for event in turn.drain(..) {
            if stopped {
                break;
            }
            machine.handle(shared.now(), event, &mut actions);
            for action in actions.drain(..) {
                match carry_out(&mut bus, &id, action) {
                    Some(Beyond::Effect(effect)) => performer(effect, &mailbox),
                    Some(Beyond::Stop) => stopped = true,
                    None => {}
                }
            }
        }
        rest(shared, agent, machine, performer, stopped);
    }
}

/// Waits for an agent that has something to do. `None`: the platform closes.
fn next_agent<M: StateMachine>(shared: &Shared<M>) -> Option<usize> {
    let mut state = shared.lock();
    loop {
        if state.closing {
            return None;
        }
        let now = shared.now();
        state.wake_due(now);
        if let Some(agent) = state.ready.pop_front() {
            return Some(agent);
        }
        state = match state.timers.first() {
            Some(&(at, _)) => {
                let waited = shared.work.wait_timeout(state, at.since(now));
                waited.unwrap_or_else(PoisonError::into_inner).0
            }
            None => shared.work.wait(state).unwrap_or_else(PoisonError::into_inner),
        };
    }
}

/// Puts a machine back after its turn.
fn rest<M: StateMachine>(shared: &Shared<M>, agent: usize, machine: M, performer: Performer<M>, stopped: bool) {
    // A deadline in the past was just answered: do not turn in place.
    let deadline = machine.next_deadline().map(|at| at.max(shared.now() + WAKE_AFTER_MIN));
    let mut state = shared.lock();
    if stopped {
        state.retire(agent);
        let last = state.alive == 0;
        drop(state);
        shared.store.lock().unwrap_or_else(PoisonError::into_inner).forget(&agent);
        // The machine is dropped outside of the lock: it may hold anything.
        drop((machine, performer));
        if last {
            shared.finished.notify_all();
        }
        shared.work.notify_all();
        return;
    }
    state.set_deadline(agent, deadline);
    let slot = &mut state.slots[agent];
    slot.machine = Some((machine, performer));
    slot.scheduled = false;
    let again = !slot.mailbox.is_empty() && state.schedule(agent);
    // Who sleeps until a later deadline must look again; this thread may be busy by then.
    let earliest = deadline.is_some() && state.timers.first().is_some_and(|(_, first)| *first == agent);
    drop(state);
    if again || earliest {
        shared.work.notify_one();
    }
}

#[allow(clippy::disallowed_methods, reason = "this is where agents get their time from")]
fn start_of_time() -> Instant {
    Instant::now()
}
