//! The painted samples of a zone.

use std::time::Duration;

use bottega_agents::{BlobId, Revision};

use crate::Choice;

/// A reference to the running sums of a zone. The sums themselves are never in a message or a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ResultRef {
    /// The fencing token of the order under which the samples were painted.
    pub fence: Revision,
    /// Samples per pixel in the sums.
    pub samples: u32,
    /// Digest of the sums: their address and checksum.
    pub digest: BlobId,
}

/// The painted samples of a zone, by reference, with their settings and times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Painting {
    /// The settings used.
    pub choice: Choice,
    /// The reference to the samples.
    pub result: ResultRef,
    /// T: the painting time, in reference-machine time.
    pub time_measured: Duration,
    /// Processor time of the painting on the agent's machine, before conversion to reference time.
    pub busy: Duration,
    /// `true`: these times measure painting alone; as far as the agent knows nothing was loaded, compiled or started
    /// meanwhile.
    pub is_measured: bool,
    /// `true`: the agent had finished the preparation for all zones when it got the order. Otherwise part of the time
    /// since then is preparation.
    pub was_ready: bool,
    /// The number of samples per pixel to reach next. If it is not above the number in `result`, the zone is finished,
    /// or the Master decides when it continues.
    pub goal: u32,
    /// T_est of the missing samples, in reference-machine time; if none are missing, of one more sample.
    pub time_left: Duration,
    /// The estimated relative error, if requested.
    pub error: Option<f64>,
}

impl Painting {
    /// Returns true if both paintings agree in everything that does not depend on the agent.
    pub fn is_same(&self, other: &Self) -> bool {
        let made = |it: &Self| (it.choice, it.result.samples, it.result.digest, it.goal, it.error.map(f64::to_bits));
        made(self) == made(other)
    }

    /// Returns true if both may be paintings of the same zone by engines that are not bit-identical, judged without the
    /// pixels. Estimated errors and goals vary by chance, so they may differ by about a factor of 2.
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
