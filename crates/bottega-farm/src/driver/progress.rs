//! The progress of a job, as honest as it can be known.

use std::{collections::BTreeMap, time::Duration};

use bottega_agents::{AgentId, Time};

use crate::{AgentRow, ZoneId, ZoneRow, ZoneState};

/// When zones of so much of the cost are profiled, T_est tells the time that is left.
const SHARE_PROFILED: f64 = 0.25;

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
    /// Time left: by T_est and how fast agents are at first, more and more by how long that took what is done; `None` while neither
    /// is known.
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
    /// What is expected of it before it is profiled, in seconds; or its complexity, where nothing is.
    expected: f64,
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
    /// Whether what is expected was learnt in works before: then the time that is left is known before anything is painted.
    is_experienced: bool,
    /// What is expected of a zone a unit of its complexity, in seconds.
    expectations: BTreeMap<ZoneId, f64>,
    /// Reference-machine seconds that agents paint in a second.
    speeds: BTreeMap<AgentId, f64>,
    begun: Option<Time>,
    now: Option<Time>,
    progress: Progress,
    expected: f64,
    timed: f64,
    timed_expected: f64,
    timed_done: f64,
    untimed_done: f64,
}

impl Tally {
    /// - `is_experienced`: whether this machine has learnt in works before how long zones take.
    pub(super) fn new(is_experienced: bool) -> Self {
        Self { is_experienced, ..Self::default() }
    }

    /// Takes in how fast an agent is.
    pub(super) fn see_agent(&mut self, row: &AgentRow) {
        let speed = if row.left_out.is_none() { row.lanes / row.power.get() } else { 0.0 };
        self.speeds.insert(row.agent.clone(), speed);
    }

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
        if let (ZoneState::Open, None, Some(time)) = (row.state, row.result, row.time_estimated) {
            let rate = time.as_secs_f64() / row.complexity.max(1e-9);
            self.expectations.entry(row.zone).or_insert(rate);
        }
        let expected = row.complexity * self.expectations.get(&row.root()).copied().unwrap_or(1.0);
        let time = row.time_estimated.zip(scale).map(|(time, scale)| time.as_secs_f64() * scale);
        // Of a zone that is painted the row does not say how much of it T_est was for.
        let before = self.shares.get(&row.zone).and_then(|share| share.time);
        let time = if row.is_settled() { before } else { time };
        let share = Share {
            expected,
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
        self.expected += sign * share.expected;
        match share.time {
            Some(time) => {
                self.timed += sign * time;
                self.timed_expected += sign * share.expected;
                self.timed_done += sign * time * share.done;
            }
            None => self.untimed_done += sign * share.expected * share.done,
        }
    }

    /// How long so much reference-machine time takes all agents, where what is expected can be believed: it was learnt before, or
    /// enough zones are profiled.
    fn left_by_estimates(&self, seconds: f64) -> Option<f64> {
        let speed: f64 = self.speeds.values().sum();
        let is_learnt = self.is_experienced && !self.expectations.is_empty();
        let is_profiled = self.timed_expected > SHARE_PROFILED * self.expected;
        ((is_learnt || is_profiled) && speed > 0.0).then(|| seconds.max(0.0) / speed)
    }

    /// How far the job is.
    pub(super) fn progress(&self) -> Progress {
        // Zones that are not profiled cost as those that are, by what is expected of both.
        let rate = if self.timed_expected > 1e-9 { self.timed / self.timed_expected } else { 1.0 };
        let all = self.timed + (self.expected - self.timed_expected) * rate;
        let done = self.timed_done + self.untimed_done * rate;
        let zones = self.shares.len();
        let whole = self.progress.zones_done == zones;
        let cost_done = if whole || all <= 0.0 { f64::from(u8::from(whole)) } else { (done / all).clamp(0.0, 1.0) };
        let elapsed = self.now.unwrap_or_default() - self.begun.unwrap_or_default();
        let left = elapsed.as_secs_f64() * (1.0 - cost_done) / cost_done;
        let left = Some(left).filter(|_| cost_done > 0.0);
        // What was done so far tells little in the beginning: profiles come first, and paint less in a second than whole zones.
        let left = match (left, self.left_by_estimates(all - done)) {
            (Some(left), Some(estimated)) => {
                let seen = cost_done * cost_done;
                Some(seen * left + (1.0 - seen) * estimated)
            }
            (left, estimated) => left.or(estimated),
        };
        let left = left.and_then(|left| Duration::try_from_secs_f64(left).ok());
        Progress { zones, cost_done, elapsed, left, ..self.progress }
    }
}

#[cfg(test)]
mod tests {
    use bottega_agents::{BlobId, Revision};
    use bottega_engines::Tunables;
    use bottega_image::{Rect, Sides};

    use super::*;
    use crate::{Choice, NeighborDifference, RelativePower, ResultRef, WorkId};

    const SECOND: Duration = Duration::from_secs(1);

    /// Ten zones of 100 samples that nobody has seen.
    fn open() -> Vec<ZoneRow> {
        let row =
            |zone| ZoneRow::open(WorkId(1), ZoneId(zone), Rect::of_size(8, 8), 64.0, NeighborDifference::default());
        (0..10).map(row).collect()
    }

    /// The same after five samples; what is left takes the reference machine 1.9 s each.
    fn profiled(row: &ZoneRow) -> ZoneRow {
        let tunables = Tunables { max_depth: 8, light_samples: 1 };
        let result = ResultRef { fence: Revision(1), samples: 5, digest: BlobId([0; 32]) };
        ZoneRow {
            state: ZoneState::Profiled,
            choice: Some(Choice { tunables, samples: 100, bands: Sides::all(0) }),
            result: Some(result),
            time_estimated: Some(SECOND * 19 / 10),
            ..row.clone()
        }
    }

    fn seconds_left(tally: &Tally) -> Option<f64> {
        tally.progress().left.map(|left| left.as_secs_f64())
    }

    #[test]
    fn time_left_goes_by_estimates_before_much_is_painted() {
        let (mut tally, rows) = (Tally::new(false), open());
        for agent in ["a", "b"] {
            tally.see_agent(&AgentRow::new(AgentId::new(agent), RelativePower::new(0.5), 1.0));
        }
        rows.iter().for_each(|row| tally.see(Time::ZERO, row, 100, 0));
        assert_eq!(seconds_left(&tally), None, "nobody knows anything yet");
        // Profiling took far longer than so many samples of whole zones do.
        rows.iter().for_each(|row| tally.see(Time::ZERO + 10 * SECOND, &profiled(row), 100, 0));
        let left = seconds_left(&tally).unwrap();
        assert!((left - 19.0 / 4.0).abs() < 1.0, "{left} s: two agents, each twice as fast as the reference machine");
        // Half of it took 30 s more: they are slower than they are said to be, and what was seen is believed more and more.
        for row in &rows[..5] {
            let done = ZoneRow { state: ZoneState::Done, ..profiled(row) };
            tally.see(Time::ZERO + 40 * SECOND, &done, 100, 100);
        }
        let later = seconds_left(&tally).unwrap();
        assert!(later > 2.0 * left && later < 40.0, "{later} s");
    }
}
