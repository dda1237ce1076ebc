//! A poll of the jobs of a farm that detects their ends and stalls.

use std::{
    collections::BTreeMap,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use bottega::StopSwitch;
use bottega_cluster::{JobBoard, unix_seconds, view::JobView};

use super::{
    args::NotificationArgs,
    message::{JobFacts, Notification},
    notifier::Notifier,
    target::WorkEvent,
};
use crate::error::CliError;

/// The interval between polls of the jobs.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// The interval at which a request to stop is checked.
const STOP_EVERY: Duration = Duration::from_millis(100);

/// The time since which no zone was finished.
#[derive(Clone, Copy, Debug)]
pub(super) struct StallClock {
    since: Instant,
    zones_done: usize,
    is_reported: bool,
}

impl StallClock {
    pub(super) fn new(now: Instant) -> Self {
        Self { since: now, zones_done: 0, is_reported: false }
    }

    /// Returns `true` when a stall must be reported: once, until another zone is finished.
    pub(super) fn look(&mut self, now: Instant, zones_done: usize, after: Duration) -> bool {
        if zones_done != self.zones_done {
            *self = Self { zones_done, ..Self::new(now) };
        }
        let is_stalled = now.saturating_duration_since(self.since) >= after;
        is_stalled && !std::mem::replace(&mut self.is_reported, is_stalled)
    }
}

/// Describes a stall.
pub(super) fn stall_reason(after: Duration, machines: usize) -> String {
    let whom = if machines == 0 { ", and no machine paints it" } else { "" };
    format!("no zone was finished for {} s{whom}", after.as_secs_f64())
}

/// The last known state of a job.
struct SeenJob {
    is_over: bool,
    clock: StallClock,
}

/// The last known state of all jobs.
pub(super) struct FarmWatch {
    after: Duration,
    /// `None` before the first poll.
    seen: Option<BTreeMap<u32, SeenJob>>,
}

impl FarmWatch {
    /// Makes a watch that has seen no job.
    ///
    /// - `after`: the time without a finished zone after which a job counts as stalled.
    pub(super) fn new(after: Duration) -> Self {
        Self { after, seen: None }
    }

    /// Takes the current state of the jobs. Returns the events to report; the first poll does not report jobs that are already
    /// over.
    pub(super) fn look(&mut self, now: Instant, jobs: &[JobView]) -> Vec<(WorkEvent, u32)> {
        let mut events = Vec::new();
        let before = self.seen.take();
        let is_first = before.is_none();
        let mut before = before.unwrap_or_default();
        let mut seen = BTreeMap::new();
        for job in jobs {
            let fresh = || SeenJob { is_over: is_first && job.is_over, clock: StallClock::new(now) };
            let mut known = before.remove(&job.number).unwrap_or_else(fresh);
            match job.state {
                "done" if !known.is_over => events.push((WorkEvent::Done, job.number)),
                "failed" if !known.is_over => events.push((WorkEvent::Failed, job.number)),
                "active" if known.clock.look(now, job.zones_done, self.after) => {
                    events.push((WorkEvent::Stalled, job.number));
                }
                // The clock does not run while the job is paused.
                "paused" => known.clock = StallClock { zones_done: job.zones_done, ..StallClock::new(now) },
                _ => {}
            }
            seen.insert(job.number, SeenJob { is_over: job.is_over, ..known });
        }
        self.seen = Some(seen);
        events
    }
}

/// Returns the facts of a job.
pub(super) fn facts(job: &JobView, reason: Option<String>) -> JobFacts {
    JobFacts {
        job: Some(job.number),
        last_job: None,
        scene: job.scene.clone(),
        output: job.output.clone(),
        from: job.from.clone(),
        zones_done: job.zones_done,
        zones: job.zones,
        seconds: unix_seconds().saturating_sub(job.submitted) as f64,
        reason,
    }
}

/// Reports events of all jobs of a farm until the user stops. Returns at once if there are no subscriptions.
pub(crate) fn watch_farm(args: &NotificationArgs, board: JobBoard, stop: &StopSwitch) -> Result<(), CliError> {
    if args.is_empty() {
        return Ok(());
    }
    let tell_loss = Arc::new(|why: String| tracing::warn!("{why}"));
    let notifier = Notifier::start(args.subscriptions(), args.secret()?, tell_loss)?;
    let (after, stop) = (args.stalled_after(), stop.clone());
    let run = move || {
        let mut watch = FarmWatch::new(after);
        while !stop.is_requested() {
            // While the server is unreachable the state is unknown, and jobs do not count as stalled.
            if board.uplink.is_connected() {
                let jobs = JobView::all(&board);
                for (event, number) in watch.look(Instant::now(), &jobs) {
                    let Some(job) = jobs.iter().find(|job| job.number == number) else { continue };
                    let stalled = (event == WorkEvent::Stalled).then(|| stall_reason(after, job.machines));
                    let facts = facts(job, stalled.or_else(|| job.reason.clone()));
                    notifier.send(Notification::new(event, facts, unix_seconds()));
                }
            }
            let begun = Instant::now();
            while begun.elapsed() < LOOK_EVERY && !stop.is_requested() {
                thread::sleep(STOP_EVERY);
            }
        }
    };
    thread::Builder::new()
        .name("farm-watch".to_owned())
        .spawn(run)
        .map(|_| ())
        .map_err(|error| CliError::failed(format!("cannot start a thread: {error}"), "let fewer programs run at once"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const AFTER: Duration = Duration::from_secs(60);

    fn job(number: u32, state: &'static str, zones_done: usize) -> JobView {
        JobView {
            number,
            state,
            reason: None,
            done: 0.0,
            zones_done,
            zones: 9,
            seconds_left: None,
            seen: false,
            priority: 10,
            require: Vec::new(),
            machines: 1,
            leader: None,
            from: "anna".to_owned(),
            submitted: 0,
            scene: "s.glb".to_owned(),
            output: "p.exr".to_owned(),
            animation: None,
            stirs: 0,
            kept: false,
            is_over: !matches!(state, "active" | "paused"),
        }
    }

    #[test]
    fn each_end_is_reported_once_except_of_jobs_that_were_over_before() {
        let mut watch = FarmWatch::new(AFTER);
        let now = Instant::now();
        assert_eq!(watch.look(now, &[job(1, "done", 9), job(2, "active", 1), job(3, "active", 1)]), []);
        let events = watch.look(now, &[job(1, "done", 9), job(2, "done", 9), job(3, "failed", 1), job(4, "done", 9)]);
        // A job that started and ended between two polls is reported, too.
        assert_eq!(events, [(WorkEvent::Done, 2), (WorkEvent::Failed, 3), (WorkEvent::Done, 4)]);
        assert_eq!(watch.look(now, &[job(2, "done", 9), job(3, "cancelled", 1), job(4, "done", 9)]), []);
    }

    #[test]
    fn a_job_stalls_when_no_zone_is_finished_and_again_after_one_was() {
        let mut watch = FarmWatch::new(AFTER);
        let start = Instant::now();
        let mut look = |seconds: u64, job: JobView| watch.look(start + Duration::from_secs(seconds), &[job]);
        assert_eq!(look(0, job(1, "active", 0)), []);
        assert_eq!(look(50, job(1, "active", 1)), []);
        assert_eq!(look(109, job(1, "active", 1)), [], "a zone was finished 59 s ago");
        assert_eq!(look(110, job(1, "active", 1)), [(WorkEvent::Stalled, 1)]);
        assert_eq!(look(300, job(1, "active", 1)), [], "it was reported");
        assert_eq!(look(310, job(1, "active", 2)), []);
        assert_eq!(look(370, job(1, "active", 2)), [(WorkEvent::Stalled, 1)]);
        assert_eq!(look(380, job(1, "paused", 2)), []);
        assert_eq!(look(900, job(1, "paused", 2)), [], "somebody paused it");
        assert_eq!(look(910, job(1, "active", 2)), []);
        assert_eq!(look(960, job(1, "active", 2)), [(WorkEvent::Stalled, 1)]);
    }
}
