//! The painting of a zone by an agent.

use std::time::Duration;

use bottega_agents::{BlobId, Revision};

use crate::Choice;

/// Refers to the running sums of a zone; they themselves never travel in a message or a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ResultRef {
    /// The award under which they were made.
    pub fence: Revision,
    /// Samples a pixel that they hold.
    pub samples: u32,
    /// Digest of the sums: where to find them and whether they are whole.
    pub digest: BlobId,
}

/// The painted part of a zone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Painting {
    /// The settings chosen.
    pub choice: Choice,
    /// Where the samples are.
    pub result: ResultRef,
    /// T, in reference-machine time.
    pub time_measured: Duration,
    /// The same in the painter's own time.
    pub busy: Duration,
    /// Whether these times are measurements of painting alone: nothing was loaded, compiled or started meanwhile, as far as the painter
    /// knows.
    pub is_measured: bool,
    /// Whether its agent had what all zones need when it was given the order: else it got ready in a part of the time since then.
    pub was_ready: bool,
    /// How many samples it should have next; not more than it has: it is finished, or the Master decides.
    pub goal: u32,
    /// T_est for the samples that are still missing, in reference-machine time; where none are, of one more.
    pub time_left: Duration,
    /// The estimated relative error, where somebody asked for it.
    pub error: Option<f64>,
}

impl Painting {
    /// Whether two agents made the same of a zone: all that does not depend on who painted it.
    pub fn is_same(&self, other: &Self) -> bool {
        let made = |it: &Self| (it.choice, it.result.samples, it.result.digest, it.goal, it.error.map(f64::to_bits));
        made(self) == made(other)
    }

    /// Whether two agents may have made the same of a zone with engines that give no two of them the same bits, as far as
    /// can be told without the pixels. What they estimate of the error, and the samples wanted for it, differ by chance.
    pub(crate) fn may_look_like(&self, other: &Self) -> bool {
        let close = |a: f64, b: f64| a.max(b) <= 2.0 * a.min(b);
        let errors = match (self.error, other.error) {
            (Some(one), Some(other)) => one == other || close(one, other),
            (one, other) => one.is_none() == other.is_none(),
        };
        let goals = self.goal == other.goal || close(f64::from(self.goal) + 4.0, f64::from(other.goal) + 4.0);
        (self.choice, self.result.samples) == (other.choice, other.result.samples) && errors && goals
    }
}
