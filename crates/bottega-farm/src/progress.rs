//! Progress of a job and its remaining time.

use std::{collections::BTreeMap, time::Duration};

use bottega_agents::Time;

use crate::{AgentRow, ZoneId, ZoneRow, ZoneState, throughput::Throughput};

/// Share of the expected cost that must be profiled before the remaining time is computed from T_est.
const SHARE_PROFILED: f64 = 0.25;
/// Minimum remaining time while zones are unfinished, in seconds.
const LEFT_MIN: f64 = 0.1;

/// The progress of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Number of zones painted or given up.
    pub zones_done: usize,
    /// Number of zones.
    pub zones: usize,
    /// Number of painted samples, over all pixels.
    pub samples_done: u64,
    /// Number of all samples, over all pixels, as chosen so far: rules may still lower it.
    pub samples: u64,
    /// Predicted share of the cost that is done, 0..=1: by T_est for profiled zones, by earlier works or the importance
    /// map for others.
    pub cost_done: f64,
    /// Time from the first row of a zone that was seen to the latest one.
    pub elapsed: Duration,
    /// Remaining time, always positive: from T_est and the agents' speeds, or else from the elapsed time and the share
    /// done. `None`: not known yet, or all zones are finished and the picture is being composed.
    pub left: Option<Duration>,
}

/// The times that a job spent in its phases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Times {
    /// Wall time from start to end.
    pub total: Duration,
    /// Wall time of the survey.
    pub survey: Duration,
    /// Wall time of the engine's preparation for all zones.
    pub preparation: Duration,
    /// Processor time of profiling and painting.
    pub painting: Duration,
    /// Clock time of composing zones, summed over all zones.
    pub composition: Duration,
}

/// The contribution of a zone to the sums.
#[derive(Clone, Copy, Debug, Default)]
struct Share {
    /// Expected time before profiling, in seconds; its complexity if there is no prediction.
    expected: f64,
    /// T_est of all its samples, in seconds, if profiled.
    time: Option<f64>,
    /// Share of the zone's samples that are painted, 0..=1.
    done: f64,
    samples: u64,
    samples_done: u64,
    settled: bool,
}

/// Running sums over the rows of all zones.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    shares: BTreeMap<ZoneId, Share>,
    /// True if this machine has experience from earlier works, so the remaining time is known before painting starts.
    is_experienced: bool,
    /// Expected time per unit of complexity of each of the Analyst's zones, in seconds.
    expectations: BTreeMap<ZoneId, f64>,
    throughput: Throughput,
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
    /// Makes the tally of a work without zones.
    ///
    /// - `is_experienced`: true if this machine has experience from earlier works.
    /// - `at_once`: number of zones that an agent works on at once, of those it holds.
    pub(crate) fn new(is_experienced: bool, at_once: usize) -> Self {
        Self { is_experienced, throughput: Throughput::new(at_once), ..Self::default() }
    }

    /// Takes in the row of an agent, for its speed.
    pub(crate) fn see_agent(&mut self, row: &AgentRow) {
        self.throughput.see_agent(row);
    }

    /// Takes in the row of a zone.
    ///
    /// - `samples_wanted`: the user's samples per pixel, for zones without a choice.
    /// - `samples_done`: samples per pixel painted; more than in the row during passes.
    pub(crate) fn see(&mut self, now: Time, row: &ZoneRow, samples_wanted: u32, samples_done: u32) {
        self.throughput.see_zone(now, row);
        let samples = row.choice.map_or(samples_wanted, |choice| row.goal_samples(&choice)).max(1);
        let samples_done = samples_done.max(row.samples_done()).min(samples);
        // T_est covers the samples left by the last painting.
        let left = samples - row.samples_done().min(samples - 1);
        let scale = row.choice.map(|_| f64::from(samples) / f64::from(left));
        let is_unpainted = matches!(row.state, ZoneState::Open | ZoneState::Profiled) && row.result.is_none();
        if let Some(time) = row.time_estimated.filter(|_| is_unpainted) {
            let rate = time.as_secs_f64() / row.complexity.max(1e-9);
            self.expectations.entry(row.zone).or_insert(rate);
        }
        let expected = row.complexity * self.expectations.get(&row.root()).copied().unwrap_or(1.0);
        let time = row.time_estimated.zip(scale).map(|(time, scale)| time.as_secs_f64() * scale);
        // The row of a settled zone does not say which samples T_est was for.
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

    /// Returns the remaining time of all agents for this much reference-machine time; `None` unless predictions come
    /// from experience or enough zones are profiled.
    fn left_by_estimates(&self, left: f64, all: f64) -> Option<f64> {
        let is_learnt = self.is_experienced && !self.expectations.is_empty();
        let is_profiled = self.timed_expected > SHARE_PROFILED * self.expected;
        let zone = all / self.shares.len().max(1) as f64;
        (is_learnt || is_profiled).then(|| self.throughput.time_for(self.now.unwrap_or_default(), left, zone))?
    }

    /// Returns the current progress.
    pub(crate) fn progress(&self) -> Progress {
        // Scale the expected cost of unprofiled zones as measured on the profiled ones
        let rate = if self.timed_expected > 1e-9 { self.timed / self.timed_expected } else { 1.0 };
        let all = self.timed + (self.expected - self.timed_expected) * rate;
        let done = self.timed_done + self.untimed_done * rate;
        let zones = self.shares.len();
        let whole = self.progress.zones_done == zones;
        let cost_done = if whole || all <= 0.0 { f64::from(u8::from(whole)) } else { (done / all).clamp(0.0, 1.0) };
        let elapsed = self.now.unwrap_or_default() - self.begun.unwrap_or_default();
        // Fall back on elapsed time and share done if agents' speeds are unknown
        let by_elapsed = elapsed.as_secs_f64() * (1.0 - cost_done) / cost_done;
        let by_elapsed = Some(by_elapsed).filter(|_| cost_done > 0.0);
        let left = self.left_by_estimates((all - done).max(0.0), all).or(by_elapsed).filter(|_| !whole);
        let left = left.and_then(|left| Duration::try_from_secs_f64(left.max(LEFT_MIN)).ok());
        Progress { zones, cost_done, elapsed, left, ..self.progress }
    }
}

#[cfg(test)]
mod tests {
    use bottega_agents::{AgentId, BlobId, Revision};
    use bottega_engines::Tunables;
    use bottega_image::{Rect, Sides};

    use super::*;
    use crate::{Choice, NeighborDifference, RelativePower, ResultRef, WorkId};

    const SECOND: Duration = Duration::from_secs(1);

    /// Ten zones of 100 samples each, unprofiled.
    fn open() -> Vec<ZoneRow> {
        let row =
            |zone| ZoneRow::open(WorkId(1), ZoneId(zone), Rect::of_size(8, 8), 64.0, NeighborDifference::default());
        (0..10).map(row).collect()
    }

    /// A zone after five samples, whose rest takes the reference machine 1.9 s.
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
    fn time_left_goes_by_what_agents_say_and_then_by_what_they_do() {
        let (mut tally, rows) = (Tally::new(false, 2), open());
        let agents = ["a", "b"].map(AgentId::new);
        for agent in &agents {
            tally.see_agent(&AgentRow::new(agent.clone(), RelativePower::new(0.5), 1.0));
        }
        let at = |seconds: u32| Time::ZERO + seconds * SECOND;
        rows.iter().for_each(|row| tally.see(at(0), row, 100, 0));
        assert_eq!(seconds_left(&tally), None, "nobody knows anything yet");
        // Profiling took far longer than that number of samples of whole zones.
        rows.iter().for_each(|row| tally.see(at(10), &profiled(row), 100, 0));
        let left = seconds_left(&tally).unwrap();
        assert!((left - 19.0 / 4.0).abs() < 1.0, "{left} s: two agents, each twice as fast as the reference machine");
        // Each takes 4 s for a zone, four times as long as it says: in 12 s each paints three.
        for (turn, pair) in rows[..6].chunks(2).enumerate() {
            for (row, agent) in pair.iter().zip(&agents) {
                let awarded = ZoneRow { state: ZoneState::Awarded, agent: Some(agent.clone()), ..profiled(row) };
                tally.see(at(10 + 4 * turn as u32), &awarded, 100, 0);
            }
            for (row, agent) in pair.iter().zip(&agents) {
                let done = ZoneRow { state: ZoneState::Done, agent: Some(agent.clone()), ..profiled(row) };
                tally.see(at(14 + 4 * turn as u32), &done, 100, 100);
            }
        }
        let later = seconds_left(&tally).unwrap();
        assert!((later - 8.0).abs() < 1.5, "{later} s for four zones");
    }

    #[test]
    fn time_left_is_never_0_before_the_end_and_not_known_when_all_is_painted() {
        let (mut tally, rows) = (Tally::new(false, 2), open());
        let agent = AgentId::new("a");
        tally.see_agent(&AgentRow::new(agent.clone(), RelativePower::new(1e-4), 1.0));
        for (second, row) in (0..).zip(&rows) {
            let now = Time::ZERO + second * SECOND;
            tally.see(now, &profiled(row), 100, 0);
            tally.see(now, &ZoneRow { state: ZoneState::Awarded, agent: Some(agent.clone()), ..profiled(row) }, 100, 0);
            assert!(seconds_left(&tally).is_none_or(|left| left >= LEFT_MIN));
        }
        for row in &rows {
            assert!(seconds_left(&tally).is_some_and(|left| left >= LEFT_MIN));
            tally.see(Time::ZERO + 100 * SECOND, &ZoneRow { state: ZoneState::Done, ..profiled(row) }, 100, 100);
        }
        assert_eq!(seconds_left(&tally), None);
    }
}
