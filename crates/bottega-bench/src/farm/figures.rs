//! The results of a run.

use std::ops::RangeInclusive;

use serde_json::{Value, json};

use super::watch::Wait;

/// The observations of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct FarmRun {
    pub(super) server: String,
    pub(super) agents: u32,
    pub(super) processes: u32,
    pub(super) zones: usize,
    /// Mean time per zone, in seconds.
    pub(super) zone_seconds: f64,
    /// Time from the first order to the complete image, in seconds.
    pub(super) seconds: f64,
    /// Times at which awards and profiles were on the blackboard, in microseconds.
    pub(super) awards: Vec<u64>,
    pub(super) profiles: Vec<u64>,
    pub(super) waits: Vec<Wait>,
    pub(super) answers: Vec<Wait>,
    /// Messages and bytes over all links, in both directions.
    pub(super) messages: u64,
    pub(super) bytes: u64,
}

/// The evaluated results of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Figures {
    pub(super) awards_per_second: f64,
    pub(super) profiles_per_second: f64,
    /// The maximum rate at which this many agents can request awards.
    pub(super) wanted_per_second: f64,
    /// Time from a bid to its award, in milliseconds: median, 99th percentile, maximum.
    pub(super) answer: [f64; 3],
    /// Time from a report to the next award, likewise; and the number of such waits.
    pub(super) wait: [f64; 3],
    pub(super) waits: usize,
    /// Messages and bytes per zone in both directions, including profile and pixels.
    pub(super) messages_per_zone: f64,
    pub(super) bytes_per_zone: f64,
}

impl Figures {
    pub(super) fn of(run: &FarmRun) -> Self {
        let steady = steady(&run.awards);
        let sorted = |waits: &[Wait]| {
            let waits = waits.iter().filter(|wait| steady.contains(&wait.at));
            let mut waits: Vec<u64> = waits.map(|wait| wait.took).collect();
            waits.sort_unstable();
            waits
        };
        let of = |waits: &[u64]| [0.5, 0.99, 1.0].map(|share| quantile(waits, share) as f64 / 1e3);
        let waits = sorted(&run.waits);
        let zones = run.zones.max(1) as f64;
        Self {
            awards_per_second: rate(&run.awards),
            profiles_per_second: rate(&run.profiles),
            wanted_per_second: f64::from(run.agents) / run.zone_seconds,
            answer: of(&sorted(&run.answers)),
            wait: of(&waits),
            waits: waits.len(),
            messages_per_zone: run.messages as f64 / zones,
            bytes_per_zone: run.bytes as f64 / zones,
        }
    }

    pub(super) fn as_json(&self, run: &FarmRun) -> Value {
        let [median, p99, longest] = self.wait;
        let [answer_median, answer_p99, answer_longest] = self.answer;
        json!({
            "server": run.server,
            "agents": run.agents,
            "processes": run.processes,
            "zones": run.zones,
            "zone_seconds": run.zone_seconds,
            "seconds": run.seconds,
            "awards": run.awards.len(),
            "awards_per_second": self.awards_per_second,
            "wanted_per_second": self.wanted_per_second,
            "profiles_per_second": self.profiles_per_second,
            "award_ms": {"p50": answer_median, "p99": answer_p99, "max": answer_longest},
            "award_wait_ms": {"p50": median, "p99": p99, "max": longest, "count": self.waits},
            "messages_per_zone": self.messages_per_zone,
            "bytes_per_zone": self.bytes_per_zone,
        })
    }

    pub(super) fn as_text(&self, run: &FarmRun) -> String {
        let [median, p99, longest] = self.wait;
        let [answer_median, answer_p99, answer_longest] = self.answer;
        format!(
            "{} agents in {} processes, NATS {}, {} zones of {:.3} s, {:.1} s in all\n\
             awards      {:8.0} a second, of {:.0} that the agents can ask for\n\
             award       {answer_median:8.1} ms in the median, {answer_p99:.1} ms for 99 of 100, {answer_longest:.1} ms at most: from a bid to the award in hand\n\
             wait        {median:8.1} ms in the median, {p99:.1} ms for 99 of 100, {longest:.1} ms at most: from a report to the next award in hand\n\
             profiles    {:8.0} a second\n\
             a zone is   {:8.1} messages and {:.0} bytes, to and from the server\n",
            run.agents,
            run.processes,
            run.server,
            run.zones,
            run.zone_seconds,
            run.seconds,
            self.awards_per_second,
            self.wanted_per_second,
            self.profiles_per_second,
            self.messages_per_zone,
            self.bytes_per_zone,
        )
    }
}

/// Returns the time span without the first and the last tenth of the events.
fn steady(times: &[u64]) -> RangeInclusive<u64> {
    let mut sorted = times.to_vec();
    sorted.sort_unstable();
    quantile(&sorted, 0.1)..=quantile(&sorted, 0.9)
}

/// Returns the rate of events per second in that span.
fn rate(times: &[u64]) -> f64 {
    let steady = steady(times);
    let count = times.iter().filter(|at| steady.contains(at)).count();
    let seconds = (steady.end() - steady.start()) as f64 / 1e6;
    if seconds > 0.0 { count.saturating_sub(1) as f64 / seconds } else { 0.0 }
}

/// Returns a quantile; 0 if there are no values.
fn quantile(sorted: &[u64], share: f64) -> u64 {
    let last = sorted.len().saturating_sub(1) as f64;
    sorted.get((last * share).ceil() as usize).copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_and_the_last_tenth_do_not_count() {
        // A hundred per second, with a slow start and end.
        let middle = (0..=80).map(|i| 10_000_000 + i * 10_000);
        let times: Vec<u64> = (0..10).chain(middle).chain((0..10).map(|i| 90_000_000 + i)).collect();
        assert!((rate(&times) - 100.0).abs() < 1.0, "{}", rate(&times));
        assert_eq!(rate(&[]), 0.0);
        assert_eq!(rate(&[5]), 0.0);
        let waits = (0..100).map(|i| Wait { at: times[i], took: if i < 10 { 1 << 40 } else { 2000 } }).collect();
        let run = FarmRun { awards: times, waits, agents: 10, zone_seconds: 0.1, zones: 100, ..FarmRun::default() };
        let figures = Figures::of(&run);
        assert_eq!(figures.wait, [2.0; 3]);
        assert_eq!(figures.wanted_per_second, 100.0);
    }

    #[test]
    fn of_a_hundred_the_ninety_ninth_is_at_the_quantile() {
        let sorted: Vec<u64> = (0..=100).collect();
        assert_eq!([0.0, 0.5, 0.99, 1.0].map(|share| quantile(&sorted, share)), [0, 50, 99, 100]);
    }
}
