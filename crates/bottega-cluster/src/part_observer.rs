//! The observer of a job in which this process has a part: it remembers what others are to be told.

use std::sync::{
    Arc, Mutex, MutexGuard, PoisonError,
    atomic::{AtomicBool, Ordering},
};

use bottega_engines::Survey;
use bottega_farm::{
    AgentRow, FarmMessage, ImportanceMap, MasterHandle, Observer, Partition, Progress, RoundSummary, Theft, ZoneRow,
};

use crate::{job_board::Lead, messages::MessageRecorder, requeue::SettledZones, society::SeenSociety};

/// Lines that wait to be written into the log of a job at most.
const LOG_WAITING_MAX: usize = 64;

/// An observer that remembers how far the job is, and what is to be written into its log.
pub(crate) struct LoggingObserver {
    pub(crate) inner: Arc<dyn Observer>,
    pub(crate) lead: Mutex<Lead>,
    /// Whether there is something to see.
    pub(crate) seen: AtomicBool,
    pub(crate) log: Mutex<Vec<String>>,
    /// The Master, where this process leads.
    pub(crate) master: Mutex<Option<MasterHandle>>,
    /// Zones that may be painted again.
    pub(crate) settled: Mutex<SettledZones>,
    pub(crate) society: Mutex<SeenSociety>,
    /// Until it is kept for those who look on.
    pub(crate) importance: Mutex<Option<Arc<ImportanceMap>>>,
    pub(crate) recorder: Arc<MessageRecorder>,
}

impl LoggingObserver {
    pub(crate) fn society(&self) -> MutexGuard<'_, SeenSociety> {
        self.society.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn lead(&self) -> Lead {
        let lead = self.lead.lock().unwrap_or_else(PoisonError::into_inner).clone();
        Lead { seen: lead.zones_done > 0 || self.seen.load(Ordering::Relaxed), ..lead }
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
        let Progress { zones_done, zones, cost_done, left, .. } = *progress;
        let seconds_left = left.map(|left| left.as_secs_f64());
        *self.lead.lock().unwrap_or_else(PoisonError::into_inner) =
            Lead { leader: None, done: cost_done, zones_done, zones, seconds_left, seen: false };
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
        let mut log = self.log.lock().unwrap_or_else(PoisonError::into_inner);
        if log.len() < LOG_WAITING_MAX {
            log.push(format!("{agent} is left out: {reason}"));
        }
        drop(log);
        self.inner.left_out(agent, reason);
    }

    fn too_few(&self, present: usize, needed: usize) {
        self.inner.too_few(present, needed);
    }

    fn not_kept(&self, error: &std::io::Error) {
        self.inner.not_kept(error);
    }
}
