//! The state of a local platform, its locks, mailboxes, and the link to other processes.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::Instant,
};

use super::super::{alarm::Alarm, queues::Queues};
use crate::{
    AclMessage, AgentId, Event, EventOf, StateMachine, StoreRequest, Ticket, Time,
    bus::{Blob, BlobId},
    entry_store::EntryStore,
    store::AddressedStore,
};

/// Maximum number of messages in a mailbox; further ones are lost, as on any network.
///
/// Completions and replies of the store are not counted: the agent requested each of them.
pub const MAILBOX_MESSAGES_MAX: usize = 1 << 16;

pub(super) struct Slot<M: StateMachine> {
    pub(super) id: AgentId,
    /// `None` while a thread runs it, and after it has stopped.
    pub(super) machine: Option<(M, Performer<M>)>,
    pub(super) mailbox: VecDeque<EventOf<M>>,
    pub(super) messages: usize,
    /// True while in the ready queue, or running.
    pub(super) scheduled: bool,
    pub(super) deadline: Option<Time>,
    pub(super) stopped: bool,
}

pub(super) struct PlatformState<M: StateMachine> {
    pub(super) slots: Vec<Slot<M>>,
    pub(super) index: BTreeMap<AgentId, usize>,
    pub(super) ready: VecDeque<usize>,
    pub(super) timers: BTreeSet<(Time, usize)>,
    pub(super) queues: Queues<M::Content>,
    pub(super) blobs: BTreeMap<BlobId, Blob>,
    pub(super) presence_watchers: BTreeSet<usize>,
    /// Number of agents that have not stopped.
    pub(super) alive: usize,
    pub(super) messages_lost: u64,
    /// The index of the agent that gets messages to agents elsewhere.
    pub(super) gateway: Option<usize>,
    pub(super) closing: bool,
    pub(super) panicked: bool,
}

pub(super) type Store<V> = Box<dyn EntryStore<V, usize> + Send>;

pub(super) struct PlatformShared<M: StateMachine> {
    pub(super) state: Mutex<PlatformState<M>>,
    /// Locked before `state` if both are, so that replies arrive in order, and a slow store only delays those that use
    /// it.
    pub(super) store: Mutex<Store<M::Value>>,
    /// Notified when there is work, or the platform closes.
    pub(super) work: Alarm,
    /// Notified when the last agent has stopped, or the platform closes.
    pub(super) finished: Condvar,
    pub(super) started: Instant,
    /// The link to other processes.
    pub(super) uplink: Option<Arc<dyn Uplink<M>>>,
}

impl<M: StateMachine> PlatformShared<M> {
    pub(super) fn lock(&self) -> MutexGuard<'_, PlatformState<M>> {
        // No machine runs under the lock, so the state is consistent after a panic
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn now(&self) -> Time {
        Time::since_start(self.started.elapsed())
    }

    /// Runs a function on the store and delivers its replies.
    pub(super) fn with_store(
        &self,
        change: impl FnOnce(&mut Store<M::Value>, &mut Vec<AddressedStore<M::Value, usize>>),
    ) {
        // A store that panicked is responsible for its own invariants
        let mut store = self.store.lock().unwrap_or_else(PoisonError::into_inner);
        let mut replies = Vec::new();
        change(&mut store, &mut replies);
        if replies.is_empty() {
            return;
        }
        let mut state = self.lock();
        for AddressedStore { to, ticket, reply } in replies {
            state.deliver(to, Event::Store { ticket, reply });
        }
        drop(state);
        self.work.notify_all();
    }
}

impl<M: StateMachine> PlatformState<M> {
    /// Makes the state of a platform without agents.
    pub(super) fn new() -> Self {
        Self {
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
        }
    }

    /// Puts an event into a mailbox. Returns true if a worker must be woken.
    pub(super) fn deliver(&mut self, to: usize, event: EventOf<M>) -> bool {
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

    /// Adds a watcher of presence, and reports the agents present.
    pub(super) fn watch_presence(&mut self, watcher: usize) {
        self.presence_watchers.insert(watcher);
        for agent in 0..self.slots.len() {
            if agent != watcher && !self.slots[agent].stopped {
                let agent = self.slots[agent].id.clone();
                self.deliver(watcher, Event::Presence { agent, present: true });
            }
        }
    }

    pub(super) fn schedule(&mut self, agent: usize) -> bool {
        let slot = &mut self.slots[agent];
        if slot.scheduled {
            return false;
        }
        slot.scheduled = true;
        self.ready.push_back(agent);
        true
    }

    pub(super) fn set_deadline(&mut self, agent: usize, deadline: Option<Time>) {
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

    /// Moves agents with expired deadlines into the ready queue.
    pub(super) fn wake_due(&mut self, now: Time) {
        while let Some(&(at, agent)) = self.timers.first() {
            if at > now {
                return;
            }
            self.timers.pop_first();
            self.slots[agent].deadline = None;
            self.deliver(agent, Event::Deadline);
        }
    }

    pub(super) fn tell_presence(&mut self, agent: usize, present: bool) {
        let id = self.slots[agent].id.clone();
        for watcher in self.presence_watchers.clone() {
            if watcher != agent {
                self.deliver(watcher, Event::Presence { agent: id.clone(), present });
            }
        }
    }

    pub(super) fn retire(&mut self, agent: usize) {
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

/// The mailbox of an agent, for threads outside of the platform, such as an engine that reports progress.
pub struct Mailbox<M: StateMachine> {
    pub(super) shared: Arc<PlatformShared<M>>,
    pub(super) agent: usize,
}

impl<M: StateMachine> Clone for Mailbox<M> {
    fn clone(&self) -> Self {
        Self { shared: Arc::clone(&self.shared), agent: self.agent }
    }
}

impl<M: StateMachine> Mailbox<M> {
    /// Reports the completion of an effect. Dropped if the agent has stopped.
    pub fn complete(&self, completion: M::Completion) {
        self.shared.lock().deliver(self.agent, Event::Completed(completion));
        self.shared.work.notify_all();
    }

    /// Delivers an event from another process. Dropped if the agent has stopped; a message is also dropped if the
    /// mailbox is full.
    pub fn deliver(&self, event: EventOf<M>) {
        self.shared.lock().deliver(self.agent, event);
        self.shared.work.notify_all();
    }

    /// Returns the index of the agent in its platform.
    pub fn number(&self) -> usize {
        self.agent
    }

    /// Returns true if the agent has stopped, or its platform is closing.
    pub fn is_closed(&self) -> bool {
        let state = self.shared.lock();
        state.closing || state.slots[self.agent].stopped
    }

    /// Returns the platform's current time.
    pub fn now(&self) -> Time {
        self.shared.now()
    }
}

/// A function that begins the effects of one agent. It must return quickly; long work belongs on another thread, which
/// reports its completion to the [`Mailbox`].
pub type Performer<M> = Box<dyn FnMut(<M as StateMachine>::Effect, &Mailbox<M>) + Send>;

/// A link of a local platform to other processes, for messages to agents elsewhere and a shared store.
///
/// No method blocks, except as stated. Results arrive in a mailbox.
pub trait Uplink<M: StateMachine>: Send + Sync {
    /// Connects a new agent: messages from elsewhere go into its mailbox. Blocks until that is done, or is known to be
    /// impossible at present.
    fn add(&self, agent: &AgentId, mailbox: Mailbox<M>);

    /// Sends a message to one receiver elsewhere, or loses it.
    ///
    /// - `now`: the time of this platform, to which `reply_by` of the message refers.
    fn publish(&self, now: Time, message: &AclMessage<M::Content>, receiver: &AgentId);

    /// Sends a store request for the agent with this mailbox, which gets the replies.
    fn ask_store(&self, mailbox: Mailbox<M>, ticket: Ticket, request: StoreRequest<M::Value>);
}
