//! The memory of a platform of one process, its locks, and the ways in and out: mailboxes and the link to other
//! processes. These know each other, for what comes back over the link goes into a mailbox.

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

/// The most messages that wait in a mailbox; what comes on top is lost, as on any network.
///
/// Completions and answers of the store are not counted: each was asked for by the agent itself.
pub const MAILBOX_MESSAGES_MAX: usize = 1 << 16;

pub(super) struct Slot<M: StateMachine> {
    pub(super) id: AgentId,
    /// Absent while a thread runs it, and when it has stopped.
    pub(super) machine: Option<(M, Performer<M>)>,
    pub(super) mailbox: VecDeque<EventOf<M>>,
    pub(super) messages: usize,
    /// In the ready queue, or running.
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
    /// Agents that have not stopped.
    pub(super) alive: usize,
    pub(super) messages_lost: u64,
    /// Gets what is for agents that are not here.
    pub(super) gateway: Option<usize>,
    pub(super) closing: bool,
    pub(super) panicked: bool,
}

pub(super) type Store<V> = Box<dyn EntryStore<V, usize> + Send>;

pub(super) struct PlatformShared<M: StateMachine> {
    pub(super) state: Mutex<PlatformState<M>>,
    /// Locked before `state` where both are, so that replies arrive in the order of what they tell, and that a store
    /// which takes its time holds up nobody who does not need it.
    pub(super) store: Mutex<Store<M::Value>>,
    /// There is work for a worker, or the platform closes.
    pub(super) work: Alarm,
    /// The last agent stopped, or the platform closes.
    pub(super) finished: Condvar,
    pub(super) started: Instant,
    /// What lies beyond this process.
    pub(super) uplink: Option<Arc<dyn Uplink<M>>>,
}

impl<M: StateMachine> PlatformShared<M> {
    pub(super) fn lock(&self) -> MutexGuard<'_, PlatformState<M>> {
        // No machine runs under the lock, so a panic elsewhere leaves the state whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn now(&self) -> Time {
        Time::since_start(self.started.elapsed())
    }

    /// Does something with the store and delivers what it says.
    pub(super) fn with_store(
        &self,
        change: impl FnOnce(&mut Store<M::Value>, &mut Vec<AddressedStore<M::Value, usize>>),
    ) {
        // A store that panicked is as good as one that cannot be asked; its own invariants are its business.
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
    /// Without agents.
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

    /// Puts an event into a mailbox. Returns whether a worker must be woken.
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

    /// From now on it is told who comes and goes, and now who is here.
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

    /// Moves agents whose deadline has come into the ready queue.
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

/// The mailbox of one agent, for threads outside of the platform: an engine that reports, a user who interrupts.
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
    /// Reports an effect. Dropped when the agent has stopped.
    pub fn complete(&self, completion: M::Completion) {
        self.shared.lock().deliver(self.agent, Event::Completed(completion));
        self.shared.work.notify_all();
    }

    /// Delivers an event from beyond this process. It is dropped when the agent has stopped.
    pub fn deliver(&self, event: EventOf<M>) {
        self.shared.lock().deliver(self.agent, event);
        self.shared.work.notify_all();
    }

    /// Returns the number of the agent among those of its platform.
    pub fn number(&self) -> usize {
        self.agent
    }

    /// Whether the agent has stopped, so that nothing can be delivered to it.
    pub fn is_closed(&self) -> bool {
        let state = self.shared.lock();
        state.closing || state.slots[self.agent].stopped
    }

    /// The platform's time.
    pub fn now(&self) -> Time {
        self.shared.now()
    }
}

/// Begins effects of one agent. It must return soon; what takes long belongs on another thread, which reports its
/// end through the [`Mailbox`].
pub type Performer<M> = Box<dyn FnMut(<M as StateMachine>::Effect, &Mailbox<M>) + Send>;

/// Links a platform in one process with others: for messages to agents who are elsewhere, and for a store that all share.
///
/// No method waits. What comes back goes into a mailbox.
pub trait Uplink<M: StateMachine>: Send + Sync {
    /// An agent has come to life here: what others send to it goes into its mailbox. Returns when that is so, or when
    /// it is known that it cannot be for now.
    fn add(&self, agent: &AgentId, mailbox: Mailbox<M>);

    /// Brings a message to one of its receivers, who is not here, or loses it.
    fn publish(&self, now: Time, message: &AclMessage<M::Content>, receiver: &AgentId);

    /// Asks the store for the agent with this mailbox.
    fn ask_store(&self, mailbox: Mailbox<M>, ticket: Ticket, request: StoreRequest<M::Value>);
}
