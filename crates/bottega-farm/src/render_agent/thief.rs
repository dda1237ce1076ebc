//! The neighbors of an agent, and which of them to ask for zones next.

use bottega_agents::AgentId;

/// The part of an agent that asks its neighbors for zones.
#[derive(Clone, Debug, Default)]
pub(super) struct Thief {
    neighbors: Vec<AgentId>,
    /// Index of the neighbor to ask next.
    next: usize,
    /// Number of refusals since the last success or retry.
    refusals: usize,
    /// True while it waits for an answer, or for promised zones.
    waits: bool,
}

impl Thief {
    /// Replaces the neighbors by those that the Master lists.
    pub(super) fn set_neighbors(&mut self, me: &AgentId, agents: &[AgentId]) {
        let agents = agents.iter().filter(|agent| *agent != me).cloned().collect();
        *self = Self { neighbors: agents, ..Self::default() };
    }

    /// Notes that a zone has come, or that unanswered requests count as lost and neighbors may have new zones.
    pub(super) fn reset(&mut self) {
        (self.waits, self.refusals) = (false, 0);
    }

    /// Notes that a neighbor gives zones. They come from the Master.
    pub(super) fn note_success(&mut self) {
        self.refusals = 0;
    }

    /// Notes a refusal. Returns true if it is the last neighbor's.
    pub(super) fn note_refusal(&mut self, sender: &AgentId) -> bool {
        if !self.neighbors.contains(sender) {
            return false;
        }
        self.waits = false;
        self.refusals += 1;
        self.refusals == self.neighbors.len()
    }

    /// Returns the neighbor to ask now; `None`: waiting, or all have refused.
    pub(super) fn next_neighbor(&mut self) -> Option<&AgentId> {
        if self.waits || self.refusals >= self.neighbors.len() {
            return None;
        }
        self.waits = true;
        self.next = (self.next + 1) % self.neighbors.len();
        self.neighbors.get(self.next)
    }
}
