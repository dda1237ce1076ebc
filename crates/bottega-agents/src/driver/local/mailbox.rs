//! The way into one agent from outside of its platform.

use std::sync::Arc;

use super::state::Shared;
use crate::{Event, EventOf, StateMachine, Time};

/// The mailbox of one agent, for threads outside of the platform: an engine that reports, a user who interrupts.
pub struct Mailbox<M: StateMachine> {
    pub(super) shared: Arc<Shared<M>>,
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

    /// Brings something from beyond this process. Dropped when the agent has stopped.
    pub(in crate::driver) fn deliver(&self, event: EventOf<M>) {
        self.shared.lock().deliver(self.agent, event);
        self.shared.work.notify_all();
    }

    /// Whether the agent has stopped: nothing that is delivered is of use any more.
    pub(in crate::driver) fn is_closed(&self) -> bool {
        let state = self.shared.lock();
        state.closing || state.slots[self.agent].stopped
    }

    /// The platform's time.
    pub fn now(&self) -> Time {
        self.shared.now()
    }
}
