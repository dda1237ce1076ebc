//! Observers of a job.

use std::{sync::Arc, time::Duration};

use bottega_agents::{AgentId, Revision, Time};
use bottega_engines::Survey;

use crate::{
    AgentRow, FarmCompletion, FarmMessage, ImportanceMap, Partition, Progress, RoundSummary, Theft, ZoneId, ZoneRow,
};

/// A Master, as somebody beside it may ask it for something.
#[derive(Clone)]
pub struct MasterHandle {
    pub(super) ask: Arc<dyn Fn(FarmCompletion) + Send + Sync>,
}

impl MasterHandle {
    /// Has a zone painted again that is done or given up.
    ///
    /// - `fence`: the token of the samples that are to go, so that no others do; `None`: it was given up.
    pub fn requeue(&self, zone: ZoneId, fence: Option<Revision>) {
        (self.ask)(FarmCompletion::Requeue { zone, fence });
    }
}

/// Sees a job go on. All methods are called from the job's threads and must return soon.
pub trait Observer: Send + Sync {
    /// This process leads the job: what may be asked of its Master.
    fn leads(&self, _master: &MasterHandle) {}
    /// The engine has had a look at the whole picture: the first that there is to see. Not called when a work is resumed.
    fn surveyed(&self, _survey: &Arc<Survey>) {}
    /// The Analyst has made map and zones. Not called when a work is resumed.
    fn analyzed(&self, _map: &Arc<ImportanceMap>, _partition: &Arc<Partition>) {}
    /// A zone's row has changed.
    fn zone_changed(&self, _row: &ZoneRow) {}
    /// An agent's row has changed: its power, its lanes or its credit.
    fn agent_changed(&self, _row: &AgentRow) {}
    /// A round of the auction has ended.
    fn round_closed(&self, _round: &RoundSummary) {}
    /// An agent has taken zones from another.
    fn stolen(&self, _theft: &Theft) {}
    /// Something was painted.
    fn progress(&self, _progress: &Progress) {}
    /// An agent sends a message.
    fn message(&self, _now: Time, _message: &FarmMessage) {}
    /// An agent is given a message.
    fn heard(&self, _now: Time, _message: &FarmMessage) {}
    /// An agent is left out of the job from now on; the others go on.
    fn left_out(&self, _agent: &AgentId, _reason: &str) {}
    /// Zones wait for more machines, `needed` in all, to compare what these paint.
    fn too_few(&self, _present: usize, _needed: usize) {}
    /// Nothing was begun for so long, though `zones` waited and `free` agents could have painted them: the Master begins again.
    fn stalled(&self, _waited: Duration, _zones: usize, _free: usize) {}
    /// So many things are under way in this process: surveys, what all zones need, zones, tiles that are fetched. Told whenever one
    /// begins or ends.
    fn under_way(&self, _count: usize) {}
    /// The job could not be kept: it goes on, but cannot be resumed.
    fn not_kept(&self, _error: &std::io::Error) {}
}

/// An observer that looks away.
impl Observer for () {}
