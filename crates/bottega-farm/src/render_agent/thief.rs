//! The neighbors of an agent, and which of them to ask for zones next.

use bottega_agents::AgentId;

/// The part of an agent that asks its neighbors for zones.
#[derive(Clone, Debug, Default)]
pub(super) struct Thief {
    pub(super) neighbors: Vec<AgentId>,
    /// Index of the neighbor to ask next.
    next: usize,
    /// Number of refusals since the last success or retry.
    pub(super) refusals: usize,
    /// True while it waits for an answer, or for promised zones.
    pub(super) waits: bool,
}

impl Thief {
    /// Replaces the neighbors by those that the Master lists.
    pub(super) fn meet(&mut self, me: &AgentId, agents: &[AgentId]) {
        let agents = agents.iter().filter(|agent| *agent != me).cloned().collect();
        *self = Self { neighbors: agents, ..Self::default() };
    }

    /// Notes that a zone has come.
    pub(super) fn is_served(&mut self) {
        (self.waits, self.refusals) = (false, 0);
    }

    /// Starts again after a heartbeat: unanswered requests are lost, and neighbors may have new zones.
    pub(super) fn try_again(&mut self) {
        self.is_served();
    }

    /// The neighbor to ask now; `None`: waiting, or all have refused.
    pub(super) fn whom(&mut self) -> Option<&AgentId> {
        if self.waits || self.refusals >= self.neighbors.len() {
            return None;
        }
        self.waits = true;
        self.next = (self.next + 1) % self.neighbors.len();
        self.neighbors.get(self.next)
    }
}
