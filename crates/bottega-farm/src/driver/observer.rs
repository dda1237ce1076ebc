//! Observers of a job.

use std::{sync::Arc, time::Duration};

use bottega_agents::{AgentId, Revision, Time};
use bottega_engines::Survey;

use crate::{
    AgentRow, FarmCompletion, FarmMessage, ImportanceMap, Partition, Progress, RoundSummary, Theft, ZoneId, ZoneRow,
};

/// A handle for requests to a Master from outside its agents.
#[derive(Clone)]
pub struct MasterHandle {
    pub(super) ask: Arc<dyn Fn(FarmCompletion) + Send + Sync>,
}

impl MasterHandle {
    /// Requests that a finished or failed zone is painted again. Returns at once. The Master ignores the request if the
    /// zone is held or has other samples by then.
    ///
    /// - `fence`: the fencing token of the samples to discard: newer samples are kept; `None`: the zone has failed.
    pub fn requeue(&self, zone: ZoneId, fence: Option<Revision>) {
        (self.ask)(FarmCompletion::Requeue { zone, fence });
    }
}

/// An observer of a job's progress. All methods are called from the job's threads and must return soon.
pub trait Observer: Send + Sync {
    /// This process leads the job; its Master takes requests.
    fn leads(&self, _master: &MasterHandle) {}
    /// The survey is finished, the first image of the picture. Not called when a work is resumed.
    fn surveyed(&self, _survey: &Arc<Survey>) {}
    /// The Analyst has made the importance map and the zones. Not called when a work is resumed.
    fn analyzed(&self, _map: &Arc<ImportanceMap>, _partition: &Arc<Partition>) {}
    /// The row of a zone has changed.
    fn zone_changed(&self, _row: &ZoneRow) {}
    /// The row of an agent has changed: its power, its lanes or its credit.
    fn agent_changed(&self, _row: &AgentRow) {}
    /// A round of the auction has ended.
    fn round_closed(&self, _round: &RoundSummary) {}
    /// An agent has stolen zones from another.
    fn stolen(&self, _theft: &Theft) {}
    /// Samples were rendered.
    fn progress(&self, _progress: &Progress) {}
    /// An agent has sent a message.
    fn message(&self, _now: Time, _message: &FarmMessage) {}
    /// An agent has received a message.
    fn heard(&self, _now: Time, _message: &FarmMessage) {}
    /// An agent is excluded from the job from now on; the others continue.
    fn left_out(&self, _agent: &AgentId, _reason: &str) {}
    /// Zones wait for more machines, `needed` in all, so that results can be compared.
    fn too_few(&self, _present: usize, _needed: usize) {}
    /// The job has stalled: nothing was started for the given time, though zones waited and agents were free. The Master
    /// starts from the Blackboard again.
    fn stalled(&self, _waited: Duration, _zones: usize, _free: usize) {}
    /// The number of operations in progress in this process: surveys, preparations, zones, and fetched tiles. Called
    /// whenever one starts or ends.
    fn under_way(&self, _count: usize) {}
    /// The job's progress could not be stored: it continues, but cannot be resumed.
    fn store_failed(&self, _error: &std::io::Error) {}
}

/// An observer that ignores everything.
impl Observer for () {}
