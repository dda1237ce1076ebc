//! The log of the work bin's fill level over time, in bounded memory.

use std::time::Duration;

use super::time::Time;

/// Maximum number of time steps kept.
const STEPS_MAX: usize = 512;
/// Initial length of a step.
const STEP_MIN: Duration = Duration::from_millis(1);

/// The fill level of the work bin since the allocator was made, or in a part of that time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BinReport {
    /// Mean number of waiting units over time.
    pub mean_waiting: f64,
    /// Time in which the bin was full, so that submitters had to wait.
    pub full: Duration,
    /// Time in which no unit waited: resources took everything at once, or had nothing to do.
    pub empty: Duration,
    /// Time steps of equal length, in order; the last one may be incomplete, and so may the first one in a report of a
    /// part of the time.
    pub steps: Vec<BinStep>,
}

/// The fill level of the work bin during one time step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BinStep {
    /// The start of the step.
    pub from: Time,
    /// The end of the step.
    pub to: Time,
    /// Mean number of waiting units in the step; of the whole step if the report begins within it.
    pub waiting: f64,
    /// Capacity at the end of the step.
    pub capacity: usize,
}

impl BinReport {
    /// Returns the difference from an earlier report; times count from there.
    pub(crate) fn since(&self, before: &Self, then: Duration, now: Duration) -> Self {
        let start = Time::at(then);
        let seconds = now.saturating_sub(then).as_secs_f64().max(f64::MIN_POSITIVE);
        let waited = self.mean_waiting * now.as_secs_f64() - before.mean_waiting * then.as_secs_f64();
        let moved = |step: &BinStep| BinStep {
            from: Time::at(step.from.since(start)),
            to: Time::at(step.to.since(start)),
            ..*step
        };
        Self {
            mean_waiting: (waited / seconds).max(0.0),
            full: self.full.saturating_sub(before.full),
            empty: self.empty.saturating_sub(before.empty),
            steps: self.steps.iter().filter(|step| step.to > start).map(moved).collect(),
        }
    }
}

/// The log. When there are too many steps, pairs of them are merged.
#[derive(Debug)]
pub(crate) struct BinLog {
    now: Time,
    waiting: usize,
    capacity: usize,
    step: Duration,
    steps: Vec<LogStep>,
    full: Duration,
    empty: Duration,
    /// Units times seconds.
    waited: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct LogStep {
    waited: f64,
    capacity: usize,
}

impl BinLog {
    pub(crate) fn new(capacity: usize) -> Self {
        Self {
            now: Time::ZERO,
            waiting: 0,
            capacity,
            step: STEP_MIN,
            steps: Vec::new(),
            full: Duration::ZERO,
            empty: Duration::ZERO,
            waited: 0.0,
        }
    }

    /// Notes the number of waiting units and the capacity from `now` on.
    pub(crate) fn note(&mut self, now: Time, waiting: usize, capacity: usize) {
        if (waiting, capacity) == (self.waiting, self.capacity) && now.since(self.now) < self.step {
            return;
        }
        self.advance(now);
        (self.waiting, self.capacity) = (waiting, capacity);
    }

    fn advance(&mut self, now: Time) {
        let spent = now.since(self.now);
        if spent.is_zero() {
            return;
        }
        if self.waiting >= self.capacity {
            self.full += spent;
        } else if self.waiting == 0 {
            self.empty += spent;
        }
        self.waited += self.waiting as f64 * spent.as_secs_f64();
        while self.index_of(now) >= STEPS_MAX {
            self.halve();
        }
        let (mut at, last) = (self.now, self.index_of(now));
        while at < now {
            let index = self.index_of(at);
            let end = Time::at(self.step * (index as u32 + 1)).min(now);
            if self.steps.len() <= index {
                self.steps.resize(index + 1, LogStep::default());
            }
            let step = &mut self.steps[index];
            step.waited += self.waiting as f64 * end.since(at).as_secs_f64();
            step.capacity = self.capacity;
            at = end;
            debug_assert!(index <= last, "steps are in the order of time");
        }
        self.now = now;
    }

    fn index_of(&self, at: Time) -> usize {
        (at.nanos() / self.step.as_nanos().max(1) as u64) as usize
    }

    fn halve(&mut self) {
        let joined = |pair: &[LogStep]| LogStep {
            waited: pair.iter().map(|step| step.waited).sum(),
            capacity: pair.last().map_or(0, |step| step.capacity),
        };
        self.steps = self.steps.chunks(2).map(joined).collect();
        self.step *= 2;
    }

    /// Returns the report until `now`.
    pub(crate) fn report(&mut self, now: Time) -> BinReport {
        self.advance(now);
        let length = self.step.as_secs_f64();
        let step = |(step, index): (&LogStep, u32)| {
            let (from, to) = (Time::at(self.step * index), Time::at(self.step * (index + 1)).min(now));
            let seconds = to.since(from).as_secs_f64().clamp(f64::MIN_POSITIVE, length);
            BinStep { from, to, waiting: step.waited / seconds, capacity: step.capacity }
        };
        BinReport {
            mean_waiting: self.waited / now.since(Time::ZERO).as_secs_f64().max(f64::MIN_POSITIVE),
            full: self.full,
            empty: self.empty,
            steps: self.steps.iter().zip(0..).map(step).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> Time {
        Time::at(Duration::from_millis(ms))
    }

    #[test]
    fn it_tells_how_long_the_bin_was_full_and_empty() {
        let mut log = BinLog::new(10);
        log.note(at(100), 10, 10);
        log.note(at(300), 5, 10);
        let report = log.report(at(500));
        assert_eq!((report.empty, report.full), (Duration::from_millis(100), Duration::from_millis(200)));
        assert!((report.mean_waiting - 6.0).abs() < 1e-9, "{}", report.mean_waiting);
        assert_eq!(report.steps.len(), 500);
        assert_eq!((report.steps[0].waiting, report.steps[499].waiting), (0.0, 5.0));
    }

    #[test]
    fn a_day_is_kept_in_bounded_memory_and_nothing_of_it_is_lost() {
        let mut log = BinLog::new(100);
        let mut sum = 0.0;
        for second in 0..86_400_u64 {
            let waiting = (second % 97) as usize;
            log.note(at(1000 * second), waiting, 100);
            sum += waiting as f64;
        }
        let report = log.report(at(86_400_000));
        assert!(report.steps.len() <= STEPS_MAX && report.steps.len() > STEPS_MAX / 4, "{}", report.steps.len());
        let steps: f64 = report.steps.iter().map(|step| step.waiting * step.to.since(step.from).as_secs_f64()).sum();
        assert!((steps - sum).abs() < 1e-3 * sum, "{steps} {sum}");
        assert!((report.mean_waiting * 86_400.0 - sum).abs() < 1e-6 * sum);
        assert!(report.steps.windows(2).all(|pair| pair[0].to == pair[1].from));
    }
}
