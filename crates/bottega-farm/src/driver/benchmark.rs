//! The benchmark of this machine: how fast a processor is, and how much of it other programs take meanwhile.

use std::time::Duration;

use bottega_engines::SpeedProbe;

use crate::RelativePower;

/// The processor time of one run on the reference machine, for which the weights of the predicted time were fitted.
const REFERENCE_TIME: Duration = Duration::from_millis(14);
/// Minimum number of runs of the benchmark.
const TURNS_MIN: u32 = 3;
/// Minimum total time of these runs.
const TIME_MIN: Duration = Duration::from_millis(250);
/// Total time after which no further run starts.
const TIME_MAX: Duration = Duration::from_millis(1500);
/// Number of runs that show the present load: one fewer than show the speed.
const LOAD_TURNS: u32 = 2;
/// A machine with at most this load is quiet.
const QUIET: f64 = 1.1;
/// Maximum load: clock time over processor time of the benchmark.
const LOAD_MAX: f64 = 64.0;

/// The speed of this machine by its benchmark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineSpeed {
    /// V_cp by processor time, so other programs change it little.
    pub power: RelativePower,
    /// Clock time per processor time while the machine was measured: 1 on a quiet machine, 2 where other programs took
    /// half of the processor.
    pub load: f64,
}

impl MachineSpeed {
    /// The reference machine, quiet.
    pub const REFERENCE: Self = Self { power: RelativePower::REFERENCE, load: 1.0 };

    /// Returns true if other programs took next to no processor time while the machine was measured.
    pub fn is_quiet(&self) -> bool {
        self.load <= QUIET
    }

    /// Returns the quieter one of two measurements of a machine: there caches and clock rates were disturbed least.
    #[must_use]
    pub fn quieter(self, other: Self) -> Self {
        if other.load < self.load { other } else { self }
    }
}

/// The clocks that a benchmark reads.
pub struct BenchmarkClocks<N, P> {
    /// A function that returns the clock time since a fixed moment.
    pub now: N,
    /// A function that returns the processor time of the calling thread; `None`: the system does not report it.
    pub processor: P,
}

/// Times of the runs of a probe.
#[derive(Clone, Copy, Debug)]
struct ProbeTimes {
    /// The shortest processor time of a run.
    best: Duration,
    /// Sums over all runs.
    clock: Duration,
    processor: Duration,
}

impl ProbeTimes {
    /// Returns the clock time per processor time, 1..=[`LOAD_MAX`].
    fn load(&self) -> f64 {
        let load = self.clock.as_secs_f64() / self.processor.as_secs_f64();
        if load.is_finite() { load.clamp(1.0, LOAD_MAX) } else { 1.0 }
    }
}

impl<N: Fn() -> Duration, P: Fn() -> Option<Duration>> BenchmarkClocks<N, P> {
    /// Measures the machine by rendering a fixed small picture on the calling thread, in 0.25 s to 2 s. Returns its
    /// speed; [`MachineSpeed::REFERENCE`] if the picture cannot be rendered.
    pub fn benchmark(&self) -> MachineSpeed {
        let probe = SpeedProbe::new().ok();
        let measured = probe.and_then(|probe| self.measure(|| Some(std::hint::black_box(probe.paint().ok()?))));
        measured.unwrap_or(MachineSpeed::REFERENCE)
    }

    /// Measures the load of the machine now by two runs of the same picture, in some 30 ms. Returns the clock time per
    /// processor time, as in [`MachineSpeed::load`]; 1 if the picture cannot be rendered.
    pub fn present_load(&self) -> f64 {
        let probe = SpeedProbe::new().ok();
        let paint = |probe: SpeedProbe| {
            let is_enough = |turn, _| turn >= LOAD_TURNS;
            self.run(|| Some(std::hint::black_box(probe.paint().ok()?)), is_enough)
        };
        probe.and_then(paint).map_or(1.0, |times| times.load())
    }

    fn measure(&self, paint: impl FnMut() -> Option<f32>) -> Option<MachineSpeed> {
        let is_enough = |turn, spent| turn >= TURNS_MIN && spent >= TIME_MIN || spent >= TIME_MAX;
        let times = self.run(paint, is_enough)?;
        let power = RelativePower::new(times.best.as_secs_f64() / REFERENCE_TIME.as_secs_f64());
        Some(MachineSpeed { power, load: times.load() })
    }

    /// Runs `paint` until it is enough. Where the system reports no processor time, each run counts as the shortest one by the
    /// clock.
    ///
    /// - `is_enough`: by the number of runs, and their clock time.
    fn run(
        &self,
        mut paint: impl FnMut() -> Option<f32>,
        is_enough: impl Fn(u32, Duration) -> bool,
    ) -> Option<ProbeTimes> {
        let mut times = ProbeTimes { best: Duration::MAX, clock: Duration::ZERO, processor: Duration::ZERO };
        let mut is_reported = true;
        for turn in 1.. {
            // Time one run by both clocks
            let (clock_before, processor_before) = ((self.now)(), (self.processor)());
            paint()?;
            let (clock, processor) = ((self.now)().saturating_sub(clock_before), (self.processor)());
            let own = processor.zip(processor_before).map(|(after, before)| after.saturating_sub(before));
            is_reported &= own.is_some();
            // Use the best of several runs: sleeping processors and other programs disturb some
            let own = own.unwrap_or(clock);
            times.best = times.best.min(own);
            (times.clock, times.processor) = (times.clock + clock, times.processor + own);
            if is_enough(turn, times.clock) {
                let processor = if is_reported { times.processor } else { times.best * turn };
                return Some(ProbeTimes { processor, ..times });
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    /// Measures a machine on which a run takes `processor` ms, and each of the clock times of `runs` in turn.
    fn measured(processor: u64, reports: bool, runs: &[u64]) -> MachineSpeed {
        let (clock, own, turn) = (Cell::new(Duration::ZERO), Cell::new(Duration::ZERO), Cell::new(0));
        let clocks = BenchmarkClocks { now: || clock.get(), processor: || reports.then(|| own.get()) };
        let paint = || {
            clock.set(clock.get() + Duration::from_millis(runs[turn.get() % runs.len()]));
            own.set(own.get() + Duration::from_millis(processor));
            turn.set(turn.get() + 1);
            Some(0.5)
        };
        clocks.measure(paint).expect("it can be measured")
    }

    #[test]
    fn other_programs_change_the_load_and_not_the_speed() {
        let quiet = measured(14, true, &[14]);
        assert_eq!((quiet.power.get(), quiet.load), (1.0, 1.0));
        let busy = measured(14, true, &[28, 42]);
        assert!(busy.power.get() == 1.0 && (2.2..2.8).contains(&busy.load) && !busy.is_quiet(), "{busy:?}");
        assert_eq!((busy.quieter(quiet), quiet.quieter(busy)), (quiet, quiet));
    }

    #[test]
    fn without_processor_times_the_shortest_run_counts() {
        let busy = measured(7, false, &[28, 14, 28]);
        assert!(busy.power.get() == 1.0 && (1.5..1.8).contains(&busy.load), "{busy:?}");
    }
}
