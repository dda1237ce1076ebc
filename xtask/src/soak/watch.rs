//! A check for jobs that wait while a machine is free for them, as seen from outside the farm.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use anyhow::{Result, ensure};
use serde_json::Value;

/// The maximum time without progress of a job while a machine is free.
const IDLE_MAX: Duration = Duration::from_secs(40);

/// The check for all jobs.
#[derive(Default)]
pub(super) struct IdleWatch {
    /// The time since which each job made no progress, and its progress.
    jobs: BTreeMap<u64, (Instant, String)>,
    /// The number of restarts per job.
    stirs: BTreeMap<u64, u64>,
    /// The longest time that a job waited.
    pub(super) longest: Duration,
}

impl IdleWatch {
    /// Takes the current state of jobs and machines.
    pub(super) fn look(&mut self, jobs: &[Value], machines: &[Value]) -> Result<()> {
        let now = Instant::now();
        let mut waiting = BTreeMap::new();
        for job in jobs {
            let Some(number) = job["job"].as_u64() else { continue };
            let stirs = self.stirs.entry(number).or_default();
            *stirs = (*stirs).max(job["stirs"].as_u64().unwrap_or(0));
            let is_its = |machine: &&Value| machine["job"].as_u64() == Some(number);
            let is_busy = machines.iter().filter(is_its).any(|machine| machine["activity"] == "busy");
            let is_free = |machine: &&Value| {
                machine["state"] == "active"
                    && machine["ordered"] == "active"
                    && machine["activity"] == "waiting"
                    && (machine["job"].is_null() || is_its(machine))
                    && machine["is_guest"] != true
            };
            if job["state"] != "active" || is_busy || !machines.iter().any(|machine| is_free(&machine)) {
                continue;
            }
            let how_far = format!("{} {} {} {}", job["done"], job["zones_done"], job["leader"], job["stirs"]);
            let since =
                self.jobs.get(&number).filter(|(_, before)| *before == how_far).map_or(now, |(since, _)| *since);
            let waited = now - since;
            self.longest = self.longest.max(waited);
            ensure!(
                waited < IDLE_MAX,
                "job {number} waits for {waited:?} while machines are free: {job}, {machines:?}"
            );
            waiting.insert(number, (since, how_far));
        }
        self.jobs = waiting;
        Ok(())
    }

    /// Returns the number of restarts of all jobs.
    pub(super) fn stirs(&self) -> u64 {
        self.stirs.values().sum()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_job_waits_while_a_machine_is_free_and_none_is_busy_with_it() {
        let job = json!({ "job": 1, "state": "active", "done": 0.5, "zones_done": 3, "leader": "a", "stirs": 0 });
        let machine = |job: Option<u64>, activity: &str| json!({ "state": "active", "ordered": "active", "activity": activity, "job": job, "is_guest": false });
        let waits = |machines: &[Value]| {
            let mut watch = IdleWatch::default();
            watch.look(std::slice::from_ref(&job), machines).unwrap();
            watch.jobs.contains_key(&1)
        };
        assert!(waits(&[machine(None, "waiting")]));
        assert!(waits(&[machine(Some(1), "waiting"), machine(Some(2), "busy")]));
        assert!(!waits(&[machine(None, "waiting"), machine(Some(1), "busy")]));
        assert!(!waits(&[machine(Some(2), "waiting")]));
    }
}
