//! The progress of a job, as honest as it can be known.

use std::{collections::BTreeMap, time::Duration};

use bottega_agents::Time;

use crate::{ZoneId, ZoneRow};

/// The progress of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Zones painted or given up.
    pub zones_done: usize,
    /// All zones.
    pub zones: usize,
    /// Samples painted, over all pixels.
    pub samples_done: u64,
    /// All samples, as far as decided: rules may still lower it.
    pub samples: u64,
    /// Predicted share of all cost that is done, 0..=1: by T_est where a zone is profiled, by the importance map where
    /// not.
    pub cost_done: f64,
    /// Time since painting began.
    pub elapsed: Duration,
    /// Time left if the rest goes on as what is done; `None` while nothing is.
    pub left: Option<Duration>,
}

/// The time of a job, by what it was spent on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Times {
    /// Wall time from beginning to end.
    pub total: Duration,
    /// Wall time of the survey.
    pub survey: Duration,
    /// Wall time in which the engine made what all zones need.
    pub preparation: Duration,
    /// Processor time of profiling and painting.
    pub painting: Duration,
    /// Time that composition took.
    pub composition: Duration,
}

/// What a zone adds to the sums.
#[derive(Clone, Copy, Debug, Default)]
struct Share {
    complexity: f64,
    /// T_est of all its samples, in seconds, where it is profiled.
    time: Option<f64>,
    done: f64,
    samples: u64,
    samples_done: u64,
    settled: bool,
}

/// Keeps the sums over all zones in step with their rows.
#[derive(Debug, Default)]
pub(super) struct Tally {
    shares: BTreeMap<ZoneId, Share>,
    begun: Option<Time>,
    now: Option<Time>,
    progress: Progress,
    complexity: f64,
    complexity_done: f64,
    timed: f64,
    timed_complexity: f64,
    timed_done: f64,
    untimed_done: f64,
}

impl Tally {
    /// Takes in a row.
    ///
    /// - `samples_wanted`: of the user, where the zone has no choice yet.
    /// - `samples_done`: at least those of the row; more when it is painted in passes.
    pub(super) fn see(&mut self, now: Time, row: &ZoneRow, samples_wanted: u32, samples_done: u32) {
        let samples = row.choice.map_or(samples_wanted, |choice| row.goal_samples(&choice)).max(1);
        let samples_done = samples_done.max(row.samples_done()).min(samples);
        // T_est is for what the painting before left over.
        let left = samples - row.samples_done().min(samples - 1);
        let scale = row.choice.map(|_| f64::from(samples) / f64::from(left));
        let time = row.time_estimated.zip(scale).map(|(time, scale)| time.as_secs_f64() * scale);
        // Of a zone that is painted the row does not say how much of it T_est was for.
        let before = self.shares.get(&row.zone).and_then(|share| share.time);
        let time = if row.is_settled() { before } else { time };
        let share = Share {
            complexity: row.complexity,
            time,
            done: if row.is_settled() { 1.0 } else { f64::from(samples_done) / f64::from(samples) },
            samples: row.size() * u64::from(samples),
            samples_done: row.size() * u64::from(samples_done),
            settled: row.is_settled(),
        };
        if let Some(before) = self.shares.insert(row.zone, share) {
            self.add(&before, -1.0);
            self.progress.samples -= before.samples;
            self.progress.samples_done -= before.samples_done;
            self.progress.zones_done -= usize::from(before.settled);
        }
        self.add(&share, 1.0);
        self.progress.samples += share.samples;
        self.progress.samples_done += share.samples_done;
        self.progress.zones_done += usize::from(share.settled);
        self.begun.get_or_insert(now);
        self.now = Some(now);
    }

    fn add(&mut self, share: &Share, sign: f64) {
        self.complexity += sign * share.complexity;
        self.complexity_done += sign * share.complexity * share.done;
        match share.time {
            Some(time) => {
                self.timed += sign * time;
                self.timed_complexity += sign * share.complexity;
                self.timed_done += sign * time * share.done;
            }
            None => self.untimed_done += sign * share.complexity * share.done,
        }
    }

    /// How far the job is.
    pub(super) fn progress(&self) -> Progress {
        // Zones that are not profiled cost as those that are, by complexity.
        let rate = if self.timed_complexity > 1e-9 { self.timed / self.timed_complexity } else { 1.0 };
        let all = self.timed + (self.complexity - self.timed_complexity) * rate;
        let done = self.timed_done + self.untimed_done * rate;
        let zones = self.shares.len();
        let whole = self.progress.zones_done == zones;
        let cost_done = if whole || all <= 0.0 { f64::from(u8::from(whole)) } else { (done / all).clamp(0.0, 1.0) };
        let elapsed = self.now.unwrap_or_default() - self.begun.unwrap_or_default();
        let left = elapsed.as_secs_f64() * (1.0 - cost_done) / cost_done;
        let left = Duration::try_from_secs_f64(left).ok().filter(|_| cost_done > 0.0);
        Progress { zones, cost_done, elapsed, left, ..self.progress }
    }
}
