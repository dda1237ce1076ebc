//! Machines in virtual time. A machine divides its processors evenly among all its jobs, like the built-in engine.

use std::{collections::BTreeSet, time::Duration};

use bottega_agents::{Revision, Time};

use crate::ZoneId;

/// Remaining work that counts as rounding error, in seconds.
const REST: f64 = 1e-9;
/// Minimum duration of a job.
const SHORTEST: Duration = Duration::from_micros(1);

/// A paint job.
#[derive(Clone, Debug)]
pub(super) struct PaintJob {
    /// The index of the agent that paints.
    pub(super) agent: usize,
    pub(super) zone: ZoneId,
    pub(super) fence: Revision,
    /// Samples per pixel at the end of the job.
    pub(super) samples: u32,
    /// The flaw of the samples it continues; 0: correct.
    pub(super) flaw: u64,
    /// True if the job begins with the first sample.
    pub(super) first: bool,
    pub(super) begun: Time,
    /// Remaining processor time at speed 1, in seconds.
    pub(super) left: f64,
    /// Maximum number of processors that it can use.
    pub(super) width: f64,
    /// Processor time spent so far, in seconds of this machine.
    pub(super) busy: f64,
}

#[derive(Clone, Debug)]
struct Machine {
    processors: f64,
    /// Relative speed: 1 is the measured machine, 2 is twice as fast.
    speed: f64,
    jobs: Vec<PaintJob>,
    /// The time up to which the jobs are advanced.
    settled: Time,
    next: Option<Time>,
}

/// All machines of a simulation.
#[derive(Clone, Debug, Default)]
pub(super) struct Machines {
    machines: Vec<Machine>,
    /// The times at which machines next finish a job.
    next: BTreeSet<(Time, usize)>,
}

impl Machines {
    pub(super) fn add(&mut self, processors: f64, speed: f64) {
        self.machines.push(Machine { processors, speed, jobs: Vec::new(), settled: Time::ZERO, next: None });
    }

    /// Returns the time at which the next job is done.
    pub(super) fn next(&self) -> Option<Time> {
        self.next.first().map(|(time, _)| *time)
    }

    pub(super) fn begin(&mut self, now: Time, machine: usize, job: PaintJob) {
        self.alter(now, machine, |machine| machine.jobs.push(job));
    }

    pub(super) fn set_speed(&mut self, now: Time, machine: usize, factor: f64) {
        self.alter(now, machine, |machine| machine.speed *= factor);
    }

    /// Returns the speed of a machine's processors.
    pub(super) fn speed(&self, machine: usize) -> f64 {
        self.machines[machine].speed
    }

    /// Removes cancelled jobs of a machine.
    pub(super) fn drop_jobs(
        &mut self,
        now: Time,
        machine: usize,
        unwanted: impl Fn(&PaintJob) -> bool,
    ) -> Vec<PaintJob> {
        let mut dropped = Vec::new();
        self.alter(now, machine, |machine| {
            dropped.extend(machine.jobs.extract_if(.., |job| unwanted(job)));
        });
        dropped
    }

    /// Returns the remaining processor time of a job at speed 1, in seconds.
    pub(super) fn left(&mut self, now: Time, machine: usize, zone: ZoneId, fence: Revision) -> Option<f64> {
        self.alter(now, machine, |_| {});
        let mut jobs = self.machines[machine].jobs.iter();
        jobs.find(|job| (job.zone, job.fence) == (zone, fence)).map(|job| job.left)
    }

    /// Removes the jobs that are done at `now` and appends them to `done`.
    pub(super) fn take_done(&mut self, now: Time, done: &mut Vec<PaintJob>) {
        while let Some(&(at, machine)) = self.next.first().filter(|(at, _)| *at <= now) {
            let before = done.len();
            self.alter(at.max(now), machine, |machine| {
                done.extend(machine.jobs.extract_if(.., |job| job.left <= REST));
            });
            // Work left by rounding is done a moment later
            debug_assert!(done.len() > before || self.machines[machine].next > Some(at));
        }
    }

    fn alter(&mut self, now: Time, index: usize, change: impl FnOnce(&mut Machine)) {
        let machine = &mut self.machines[index];
        machine.settle(now);
        change(machine);
        let next = machine.end_of_first().map(|after| now + after);
        if next != machine.next {
            if let Some(before) = std::mem::replace(&mut machine.next, next) {
                self.next.remove(&(before, index));
            }
            self.next.extend(next.map(|next| (next, index)));
        }
    }
}

impl Machine {
    /// Calls `each` with every job and its number of processors: an even share, plus what others cannot use.
    fn share_out(&mut self, mut each: impl FnMut(&mut PaintJob, f64)) {
        self.jobs.sort_by(|a, b| a.width.total_cmp(&b.width).then(a.begun.cmp(&b.begun)).then(a.zone.cmp(&b.zone)));
        let (mut processors, mut jobs) = (self.processors, self.jobs.len());
        for job in &mut self.jobs {
            let share = (processors / jobs as f64).min(job.width);
            processors -= share;
            jobs -= 1;
            each(job, share);
        }
    }

    fn settle(&mut self, now: Time) {
        let (elapsed, speed) = (now.since(self.settled).as_secs_f64(), self.speed);
        self.settled = now;
        if elapsed > 0.0 {
            self.share_out(|job, share| {
                job.busy += share * elapsed;
                job.left -= share * elapsed * speed;
            });
        }
    }

    fn end_of_first(&mut self) -> Option<Duration> {
        let (mut soonest, speed) = (f64::INFINITY, self.speed);
        self.share_out(|job, share| soonest = soonest.min(job.left.max(0.0) / (share * speed)));
        (!self.jobs.is_empty()).then(|| Duration::try_from_secs_f64(soonest).unwrap_or(Duration::MAX).max(SHORTEST))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(zone: u32, work: f64, width: f64) -> PaintJob {
        let (zone, fence) = (ZoneId(zone), Revision(1));
        PaintJob {
            agent: 0,
            zone,
            fence,
            samples: 1,
            flaw: 0,
            first: true,
            begun: Time::ZERO,
            left: work,
            width,
            busy: 0.0,
        }
    }

    fn at(seconds: f64) -> Time {
        Time::since_start(Duration::from_secs_f64(seconds))
    }

    /// The end of each job of one machine, in order: zone and time.
    fn ends(machines: &mut Machines) -> Vec<(u32, f64)> {
        let mut ends = Vec::new();
        while let Some(now) = machines.next() {
            let mut done = Vec::new();
            machines.take_done(now, &mut done);
            ends.extend(done.iter().map(|job| (job.zone.0, (now.elapsed().as_secs_f64() * 1e3).round() / 1e3)));
        }
        ends
    }

    #[test]
    fn two_jobs_share_the_processors_of_a_machine() {
        let mut machines = Machines::default();
        machines.add(2.0, 1.0);
        machines.begin(Time::ZERO, 0, job(1, 4.0, f64::INFINITY));
        machines.begin(at(1.0), 0, job(2, 1.0, f64::INFINITY));
        // The first has 2 left when the second comes; each has one processor until the second is done.
        assert_eq!(ends(&mut machines), [(2, 2.0), (1, 2.5)]);
    }

    #[test]
    fn what_a_narrow_job_cannot_use_the_other_gets() {
        let mut machines = Machines::default();
        machines.add(4.0, 1.0);
        machines.begin(Time::ZERO, 0, job(1, 3.0, 1.0));
        machines.begin(Time::ZERO, 0, job(2, 6.0, f64::INFINITY));
        assert_eq!(ends(&mut machines), [(2, 2.0), (1, 3.0)]);
    }

    #[test]
    fn a_machine_that_becomes_slower_needs_longer_for_what_is_left() {
        let mut machines = Machines::default();
        machines.add(1.0, 2.0);
        machines.begin(Time::ZERO, 0, job(1, 4.0, 1.0));
        machines.set_speed(at(1.0), 0, 0.25);
        assert_eq!(ends(&mut machines), [(1, 5.0)]);
        machines.begin(at(6.0), 0, job(2, 1.0, 1.0));
        assert_eq!(machines.drop_jobs(at(7.0), 0, |job| job.agent == 0).len(), 1);
        assert_eq!(machines.next(), None);
    }
}
