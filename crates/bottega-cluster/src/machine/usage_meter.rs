//! The resource usage of a machine per job: processor time, and energy if known.
//!
//! The counter of a processor package covers everything that its machine does: a job is assigned the share that its process
//! has of all processor time in the meantime. Declared watts are those of the machine with all processors busy: the job is
//! assigned its share of the time of all processors.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

use bottega::devices::processors;
use bottega_platform::processor_time::{machine_seconds, own_seconds};

use crate::{
    job::usage::{EnergySource, JobUsage},
    machine::power_counters::PowerCounters,
};

/// The most jobs that are remembered; older ones are dropped.
const JOBS_MAX: usize = 4;

/// The processor times of a process and its machine at a moment.
#[derive(Clone, Copy, Debug, Default)]
struct Moment {
    /// Processor time of this process, in seconds.
    own: f64,
    /// Processor time of the whole machine, in seconds; `None`: unknown.
    all: Option<f64>,
}

/// A meter of the processor time and energy that this process uses, per job.
#[derive(Clone, Debug)]
pub struct UsageMeter {
    state: Arc<Mutex<MeterState>>,
}

#[derive(Debug)]
struct MeterState {
    counters: PowerCounters,
    watts: Option<f64>,
    last: Option<Moment>,
    jobs: BTreeMap<u64, CountedJob>,
    /// A counter that increases with each measurement, to find the oldest job.
    turn: u64,
}

#[derive(Clone, Copy, Debug, Default)]
struct CountedJob {
    turn: u64,
    seconds: f64,
    joules: Option<f64>,
}

impl UsageMeter {
    /// Makes a meter without usage.
    ///
    /// - `watts`: the power of the machine in watts, with all processors busy; used if it has no counters. `None`: its energy is
    ///   then unknown.
    pub fn new(watts: Option<f64>) -> Self {
        let state =
            MeterState { counters: PowerCounters::of_machine(), watts, last: None, jobs: BTreeMap::new(), turn: 0 };
        Self { state: Arc::new(Mutex::new(state)) }
    }

    /// Assigns the usage since the last call to a job. The first call assigns nothing, because it begins the measurement.
    ///
    /// - `work`: the unique number of the job, [`Job::origin`](crate::job::record::Job::origin); `None`: to no job.
    pub fn count(&self, work: Option<u64>) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.count(work, moment());
    }

    /// Returns the usage of the last jobs, at most four of them, in the order of their unique numbers.
    pub fn usages(&self) -> Vec<JobUsage> {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.jobs.iter().map(|(work, job)| state.usage(*work, job)).collect()
    }
}

impl MeterState {
    fn count(&mut self, work: Option<u64>, now: Option<Moment>) {
        let microjoules = self.counters.advance();
        let before = std::mem::replace(&mut self.last, now);
        let Some(((before, now), work)) = before.zip(now).zip(work) else { return };
        let own = (now.own - before.own).max(0.0);
        let all = now.all.zip(before.all).map(|(now, before)| now - before);
        let joules = if self.counters.is_empty() {
            self.watts.map(|watts| watts * own / processors() as f64)
        } else {
            microjoules.zip(all).map(|(used, all)| used as f64 * 1e-6 * share(own, all))
        };
        self.turn += 1;
        let is_new = !self.jobs.contains_key(&work);
        let job = self.jobs.entry(work).or_default();
        job.turn = self.turn;
        job.seconds += own;
        job.joules = if is_new { joules } else { job.joules.zip(joules).map(|(sum, more)| sum + more) };
        if self.jobs.len() > JOBS_MAX
            && let Some(oldest) = self.jobs.iter().min_by_key(|(_, job)| job.turn).map(|(work, _)| *work)
        {
            self.jobs.remove(&oldest);
        }
    }

    fn usage(&self, work: u64, job: &CountedJob) -> JobUsage {
        let source = if self.counters.is_empty() { EnergySource::Watts } else { EnergySource::Counters };
        JobUsage {
            work,
            processor_ms: (1e3 * job.seconds) as u64,
            millijoules: job.joules.map(|joules| (1e3 * joules) as u64),
            source: job.joules.map(|_| source),
            processors: processors(),
        }
    }
}

/// Returns the share of one process in the total, in 0..=1. Clamped, because the two clocks are read one after the other.
fn share(own: f64, all: f64) -> f64 {
    if all > 0.0 { (own / all).min(1.0) } else { 0.0 }
}

/// Returns the current times; `None`: unsupported by this system.
fn moment() -> Option<Moment> {
    own_seconds().map(|own| Moment { own, all: machine_seconds() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(watts: Option<f64>) -> MeterState {
        MeterState { counters: PowerCounters::default(), watts, last: None, jobs: BTreeMap::new(), turn: 0 }
    }

    fn at(own: f64) -> Option<Moment> {
        Some(Moment { own, all: None })
    }

    #[test]
    fn time_is_counted_for_the_job_that_had_it() {
        let mut meter = state(None);
        for (work, own) in [(Some(1), 5.0), (Some(1), 7.0), (Some(2), 8.0), (None, 20.0), (Some(1), 21.5)] {
            meter.count(work, at(own));
        }
        let usages: Vec<(u64, u64)> =
            meter.jobs.iter().map(|(work, job)| meter.usage(*work, job)).map(|it| (it.work, it.processor_ms)).collect();
        assert_eq!(usages, [(1, 3500), (2, 1000)]);
        let usage = meter.usage(1, &meter.jobs[&1]);
        assert_eq!((usage.millijoules, usage.source), (None, None), "nobody knows what it draws");
    }

    #[test]
    fn watts_are_those_of_all_processors_at_work() {
        let mut meter = state(Some(100.0));
        meter.count(Some(1), at(0.0));
        meter.count(Some(1), at(6.0 * processors() as f64));
        let usage = meter.usage(1, &meter.jobs[&1]);
        assert_eq!((usage.millijoules, usage.source), (Some(600_000), Some(EnergySource::Watts)));
    }

    #[test]
    fn the_jobs_counted_last_are_remembered() {
        let mut meter = state(None);
        for work in 1..=6 {
            meter.count(Some(work), at(work as f64));
        }
        assert_eq!(meter.jobs.keys().copied().collect::<Vec<_>>(), [3, 4, 5, 6]);
    }

    #[test]
    fn a_process_has_its_share_of_what_its_machine_did() {
        assert_eq!((share(2.0, 8.0), share(2.0, 1.0), share(2.0, 0.0)), (0.25, 1.0, 0.0));
    }

    #[test]
    fn this_process_is_seen_to_work() {
        let meter = UsageMeter::new(None);
        meter.count(Some(7));
        let mut sum = 0u64;
        let begun = own_seconds().unwrap();
        while own_seconds().unwrap() - begun < 0.05 {
            sum = sum.wrapping_add(std::hint::black_box(1));
        }
        meter.count(Some(7));
        assert!(meter.usages()[0].processor_ms >= 50, "{:?}", meter.usages());
    }
}
