//! Row updates for untrusted agents: votes, discarded samples, forgiven attempts.

use bottega_agents::AgentId;

use super::zone::{ZoneRow, ZoneState};

impl ZoneRow {
    /// Returns true if no agent of the process of `agent` has voted on the zone's current step. Each process that joined counts
    /// as a machine, also several on one computer.
    pub fn is_new_to(&self, agent: &AgentId) -> bool {
        self.votes.iter().all(|vote| vote.agent.home() != agent.home())
    }

    /// Returns the row without its samples, votes and times: the zone is open again. The chosen settings stay, because
    /// the neighbors' bands were made for them.
    #[must_use]
    pub fn unpainted(&self) -> Self {
        Self {
            state: ZoneState::Open,
            result: None,
            time_estimated: None,
            time_measured: None,
            goal: None,
            error: None,
            votes: Vec::new(),
            word_of: None,
            ..self.clone()
        }
    }

    /// Returns the row with this many attempts fewer, for failures that were not the zone's fault. A zone that was
    /// given up waits again.
    #[must_use]
    pub fn forgiven(&self, attempts: u32) -> Self {
        let attempt = self.attempt.saturating_sub(attempts);
        let state = match self.state {
            ZoneState::Failed if self.result.is_some() => ZoneState::Profiled,
            ZoneState::Failed => ZoneState::Open,
            state => state,
        };
        Self { state, attempt, ..self.clone() }
    }
}
