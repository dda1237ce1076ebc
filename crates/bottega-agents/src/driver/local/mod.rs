//! The local platform: agents in one process on a few threads, with mailboxes in memory and real time.
//!
//! One lock guards mailboxes and timers; no machine runs under it. A thread without work sleeps until a mailbox fills
//! or the next deadline arrives: nothing polls.

mod bus;
mod state;

use std::{
    collections::VecDeque,
    panic,
    sync::{Arc, Condvar, Mutex, PoisonError},
    thread,
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

pub use bus::LocalBus;
pub use state::{MAILBOX_MESSAGES_MAX, Mailbox, Performer, Uplink};
use state::{PlatformShared, PlatformState, Slot};

use super::alarm::Alarm;
use crate::{
    AgentId, Event, StateMachine, Time,
    bus::{OutsideAction, carry_out},
    entry_store::EntryStore,
    store::MemoryStore,
    wire::Calendar,
};

/// Maximum number of events an agent handles before the next agent's turn.
const TURN_EVENTS_MAX: usize = 32;

/// Minimum delay of a machine that sets a deadline in the past.
const WAKE_AFTER_MIN: Duration = Duration::from_millis(1);

/// A platform in one process, which runs its agents on a few threads.
pub struct LocalPlatform<M: StateMachine> {
    shared: Arc<PlatformShared<M>>,
    threads: Vec<thread::JoinHandle<()>>,
}

impl<M: StateMachine + Send + 'static> LocalPlatform<M>
where
    M::Content: Clone + Send + 'static,
    M::Value: Clone + Send + 'static,
    M::Effect: Send + 'static,
    M::Completion: Send + 'static,
{
    /// Starts a number of threads (at least one), which sleep until there are agents.
    ///
    /// # Errors
    /// A thread cannot be started.
    pub fn new(threads: usize) -> std::io::Result<Self> {
        Self::build(threads, Box::new(MemoryStore::default()), None)
    }

    /// Starts threads like [`Self::new`], with a store that may be shared with other processes, or be persistent.
    ///
    /// - `store`: gets the [`Mailbox::number`] of the requesting agent as the client.
    ///
    /// # Errors
    /// A thread cannot be started.
    pub fn with_store(threads: usize, store: Box<dyn EntryStore<M::Value, usize> + Send>) -> std::io::Result<Self> {
        Self::build(threads, store, None)
    }

    /// Starts threads like [`Self::new`], with a link to other processes: agents not found here are looked for there,
    /// and the store is shared by all. Queues, blobs and presence stay within the process. `None`: no link.
    ///
    /// # Errors
    /// A thread cannot be started.
    pub fn linked(threads: usize, uplink: Option<Arc<dyn Uplink<M>>>) -> std::io::Result<Self> {
        Self::build(threads, Box::new(MemoryStore::default()), uplink)
    }

    fn build(
        threads: usize,
        store: Box<dyn EntryStore<M::Value, usize> + Send>,
        uplink: Option<Arc<dyn Uplink<M>>>,
    ) -> std::io::Result<Self> {
        let shared = Arc::new(PlatformShared {
            state: Mutex::new(PlatformState::new()),
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

    /// Adds an agent, whose first event is [`Event::Start`]. Returns its mailbox.
    ///
    /// - `performer`: begins the effects that the agent requests.
    ///
    /// # Errors
    /// The name was used by another agent, running or stopped.
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
        // It must be reachable before it sends its first message
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

    /// Makes an agent of this platform the gateway: it gets all messages to agents that are not here or have stopped,
    /// and presence events before any message from outside. Returns false if the agent is not here; then there is no
    /// gateway.
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

    /// Delivers writes of other processes to watching agents. Must be called from time to time if the store is shared.
    pub fn poll_store(&self) {
        self.shared.with_store(|store, replies| store.poll(replies));
    }

    /// Returns the bus of the platform, through which other threads send messages.
    pub fn bus(&self) -> LocalBus<M> {
        LocalBus(Arc::clone(&self.shared))
    }

    /// Returns the number of lost messages: those to full mailboxes, and, without gateway and link, those to agents
    /// that are not here or have stopped.
    pub fn messages_lost(&self) -> u64 {
        self.shared.lock().messages_lost
    }

    /// Returns the platform's current time.
    pub fn now(&self) -> Time {
        self.shared.now()
    }

    /// Returns the conversion between the platform's time and the calendar, by the clock of the machine.
    pub fn calendar(&self) -> Calendar {
        Calendar::new(unix_time().saturating_sub(self.now().elapsed()))
    }

    /// Waits until every agent has stopped, then ends the threads.
    ///
    /// # Panics
    /// If a machine or a performer has panicked.
    pub fn wait(mut self) {
        let mut state = self.shared.lock();
        while state.alive > 0 && !state.panicked {
            state = self.shared.finished.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        drop(state);
        self.close();
    }

    /// Ends the threads after their current events, whether or not agents have stopped.
    ///
    /// # Panics
    /// If a machine or a performer has panicked.
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
        // Performers may hold mailboxes, which hold the platform: break the cycle, outside of the lock
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

/// The error that an agent has this name, or had it before it stopped: names are never reused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is already an agent `{0}`")]
pub struct NameTaken(pub AgentId);

/// Notifies the platform of a machine's panic, so that waiting threads end.
struct PanicNotice<'a, M: StateMachine>(&'a PlatformShared<M>);

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

fn work<M: StateMachine>(shared: &Arc<PlatformShared<M>>)
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
                    Some(OutsideAction::Effect(effect)) => performer(effect, &mailbox),
                    Some(OutsideAction::Stop) => stopped = true,
                    None => {}
                }
            }
        }
        rest(shared, agent, machine, performer, stopped);
    }
}

/// Waits for an agent with work. `None`: the platform closes.
fn next_agent<M: StateMachine>(shared: &PlatformShared<M>) -> Option<usize> {
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
fn rest<M: StateMachine>(shared: &PlatformShared<M>, agent: usize, machine: M, performer: Performer<M>, stopped: bool) {
    // Postpone a deadline in the past, which was just handled, to avoid a busy loop
    let deadline = machine.next_deadline().map(|at| at.max(shared.now() + WAKE_AFTER_MIN));
    let mut state = shared.lock();
    if stopped {
        state.retire(agent);
        let last = state.alive == 0;
        drop(state);
        shared.store.lock().unwrap_or_else(PoisonError::into_inner).forget(&agent);
        // Drop the machine outside of the lock: its destructor may do anything
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
    // A thread that sleeps until a later deadline must check again; this one may be busy by then
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

#[allow(clippy::disallowed_methods, reason = "this is where a platform gets the date from")]
fn unix_time() -> Duration {
    // Treat a clock before 1970 as 1970
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}
