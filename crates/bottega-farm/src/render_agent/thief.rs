//! The neighbors of an agent, and which of them it asks for zones next.

use bottega_agents::AgentId;

/// The part of an agent that asks its neighbors for zones.
#[derive(Clone, Debug, Default)]
pub(super) struct Thief {
    pub(super) neighbors: Vec<AgentId>,
    /// Whom it asks next.
    next: usize,
    /// How many have refused since it last got something, or tried again.
    pub(super) refusals: usize,
    /// Whether an answer is awaited, or the zones that were promised.
    pub(super) waits: bool,
}

impl Thief {
    /// Takes the neighbors that the Master names.
    pub(super) fn meet(&mut self, me: &AgentId, agents: &[AgentId]) {
        let agents = agents.iter().filter(|agent| *agent != me).cloned().collect();
        *self = Self { neighbors: agents, ..Self::default() };
    }

    /// A zone has come.
    pub(super) fn is_served(&mut self) {
        (self.waits, self.refusals) = (false, 0);
    }

    /// A heartbeat has gone by: what was not answered will not be, and who had nothing may have something.
    pub(super) fn try_again(&mut self) {
        self.is_served();
    }

    /// Whom to ask now.
    pub(super) fn whom(&mut self) -> Option<&AgentId> {
        if self.waits || self.refusals >= self.neighbors.len() {
            return None;
        }
        self.waits = true;
        self.next = (self.next + 1) % self.neighbors.len();
        self.neighbors.get(self.next)
    }
}
