//! The observer of a job that this process takes part in: collects what the leader publishes.

use std::{
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use bottega_engines::Survey;
use bottega_farm::{
    AgentRow, FarmMessage, ImportanceMap, MasterHandle, Observer, Partition, Progress, RoundSummary, Theft, ZoneRow,
};

use crate::job::{
    activity::ActivityLog, board::Lead, messages::MessageRecorder, requeue::SettledZones, society::SeenSociety,
};

/// The most lines waiting for the job's log.
const LOG_WAITING_MAX: usize = 64;
/// The least share of a predicted remaining time that is shown until the next zone is done.
const LEFT_SHARE_MIN: f64 = 0.1;

/// The last progress report of a job, and its time.
#[derive(Clone, Copy)]
pub(crate) struct SeenProgress {
    progress: Progress,
    at: Instant,
}

impl SeenProgress {
    fn lead(&self) -> Lead {
        let Progress { zones_done, zones, cost_done, left, .. } = self.progress;
        // Count down until the next report, but never to 0.
        let seconds =
            |left: Duration| left.saturating_sub(self.at.elapsed()).max(left.mul_f64(LEFT_SHARE_MIN)).as_secs_f64();
        Lead { done: cost_done, zones_done, zones, seconds_left: left.map(seconds), ..Lead::default() }
    }
}

/// An observer that records the progress of a job and the lines for its log.
pub(crate) struct LoggingObserver {
    pub(crate) inner: Arc<dyn Observer>,
    /// The number of the painting.
    pub(crate) work: u64,
    pub(crate) activity: ActivityLog,
    pub(crate) progress: Mutex<Option<SeenProgress>>,
    /// True if zones wait for more machines.
    pub(crate) lacks_machines: AtomicBool,
    /// True if a preview exists.
    pub(crate) seen: AtomicBool,
    pub(crate) log: Mutex<Vec<String>>,
    /// The Master, if this process leads.
    pub(crate) master: Mutex<Option<MasterHandle>>,
    /// Zones that can be painted again.
    pub(crate) settled: Mutex<SettledZones>,
    pub(crate) society: Mutex<SeenSociety>,
    /// The importance map, until it is stored for observers.
    pub(crate) importance: Mutex<Option<Arc<ImportanceMap>>>,
    pub(crate) recorder: Arc<MessageRecorder>,
}

impl LoggingObserver {
    /// Returns the record of agents and auction.
    pub(crate) fn society(&self) -> MutexGuard<'_, SeenSociety> {
        self.society.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the progress, for the notice of the lead.
    pub(crate) fn lead(&self) -> Lead {
        let seen = *self.progress.lock().unwrap_or_else(PoisonError::into_inner);
        let lead = seen.as_ref().map(SeenProgress::lead).unwrap_or_default();
        let (seen, lacks_machines) = (self.seen.load(Ordering::Relaxed), self.lacks_machines.load(Ordering::Relaxed));
        Lead { work: self.work, seen: lead.zones_done > 0 || seen, lacks_machines, ..lead }
    }

    fn say(&self, line: String) {
        let mut log = self.log.lock().unwrap_or_else(PoisonError::into_inner);
        if log.len() < LOG_WAITING_MAX {
            log.push(line);
        }
    }
}

impl Observer for LoggingObserver {
    fn surveyed(&self, survey: &Arc<Survey>) {
        self.inner.surveyed(survey);
    }

    fn analyzed(&self, map: &Arc<ImportanceMap>, partition: &Arc<Partition>) {
        *self.importance.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(map));
        self.inner.analyzed(map, partition);
    }

    fn leads(&self, master: &MasterHandle) {
        *self.master.lock().unwrap_or_else(PoisonError::into_inner) = Some(master.clone());
    }

    fn zone_changed(&self, row: &ZoneRow) {
        self.settled.lock().unwrap_or_else(PoisonError::into_inner).see(row);
        self.inner.zone_changed(row);
    }

    fn agent_changed(&self, row: &AgentRow) {
        self.society().see_agent(row);
        self.inner.agent_changed(row);
    }

    fn round_closed(&self, round: &RoundSummary) {
        self.society().see_round(round);
        self.inner.round_closed(round);
    }

    fn stolen(&self, theft: &Theft) {
        self.society().see_theft(theft);
        self.inner.stolen(theft);
    }

    fn progress(&self, progress: &Progress) {
        let seen = SeenProgress { progress: *progress, at: Instant::now() };
        *self.progress.lock().unwrap_or_else(PoisonError::into_inner) = Some(seen);
        // Painting continues, so there are enough machines.
        self.lacks_machines.store(false, Ordering::Relaxed);
        self.inner.progress(progress);
    }

    fn message(&self, now: bottega_agents::Time, message: &FarmMessage) {
        self.recorder.see_said(now, message);
        self.inner.message(now, message);
    }

    fn heard(&self, now: bottega_agents::Time, message: &FarmMessage) {
        self.recorder.see_heard(now, message);
        self.inner.heard(now, message);
    }

    fn left_out(&self, agent: &bottega_agents::AgentId, reason: &str) {
        self.say(format!("{agent} is left out: {reason}"));
        self.inner.left_out(agent, reason);
    }

    fn too_few(&self, present: usize, needed: usize) {
        self.lacks_machines.store(true, Ordering::Relaxed);
        self.inner.too_few(present, needed);
    }

    fn stalled(&self, waited: Duration, zones: usize, free: usize) {
        self.say(format!(
            "no zone was started for {} s, though {zones} zones waited and {free} agents were free: the Master restarts from the Blackboard",
            waited.as_secs()
        ));
        self.inner.stalled(waited, zones, free);
    }

    fn under_way(&self, count: usize) {
        self.activity.under_way(count);
        self.inner.under_way(count);
    }

    fn store_failed(&self, error: &std::io::Error) {
        self.inner.store_failed(error);
    }
}
