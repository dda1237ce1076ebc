//! Trust in a zone's row: who painted it, where they are not trusted.

use bottega_agents::AgentId;

use super::zone::{ZoneRow, ZoneState};

impl ZoneRow {
    /// Whether no agent of the same machine has said what it makes of its present step.
    pub fn is_new_to(&self, agent: &AgentId) -> bool {
        self.votes.iter().all(|vote| vote.agent.home() != agent.home())
    }

    /// The row of a zone whose samples are of no use: nothing is painted of it, but with what it is to be painted stays,
    /// for its neighbours' bands were made for that.
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

    /// The row without so many attempts, which were not its fault.
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
