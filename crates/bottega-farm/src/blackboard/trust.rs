//! Row updates for untrusted agents: votes, discarded samples, forgiven attempts.

use bottega_agents::{AgentId, machine_of};

use super::zone::{ZoneRow, ZoneState};

impl ZoneRow {
    /// Returns true if no agent on the machine of `agent` has voted on the zone's current step.
    pub fn is_new_to(&self, agent: &AgentId) -> bool {
        self.votes.iter().all(|vote| machine_of(&vote.agent.name) != machine_of(&agent.name))
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

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use bottega_agents::{BlobId, Revision};
    use bottega_engines::Tunables;
    use bottega_image::{Rect, Sides};

    use super::*;
    use crate::{Choice, NeighborDifference, Painting, ResultRef, Vote, WorkId, ZoneId};

    #[test]
    fn another_process_of_a_machine_that_has_voted_does_not_confirm_it() {
        let painting = Painting {
            choice: Choice { tunables: Tunables { max_depth: 4, light_samples: 1 }, samples: 4, bands: Sides::all(0) },
            result: ResultRef { fence: Revision(1), samples: 4, digest: BlobId([0; 32]) },
            time_measured: Duration::ZERO,
            busy: Duration::ZERO,
            is_measured: true,
            was_ready: true,
            goal: 4,
            time_left: Duration::ZERO,
            error: None,
        };
        let agent = |name: &str| AgentId::new(name);
        let zone = ZoneRow::open(WorkId(1), ZoneId(0), Rect::of_size(8, 8), 1.0, NeighborDifference::all(0.0));
        let voted = ZoneRow { votes: vec![Vote { agent: agent("render-1@attic.01"), painting }], ..zone };
        let others = ["render-1@attic.01", "render-2@attic.02", "render-1@cellar.01"];
        let is_new = others.map(|name| voted.is_new_to(&agent(name)));
        assert_eq!(is_new, [false, false, true]);
    }
}
