//! The watch for stalled jobs, which wait although machines are free for them.
//!
//! `bottega up` watches, and so does each process that takes part in a job or waits for one. The first to notice a stall
//! restarts all processes of the painting and writes this into the job's log. That clears their in-memory state, which is
//! the usual cause; if the job stalls repeatedly, it is rendered again from its first sample.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Instant,
};

use bottega_agents::Time;
use bottega_farm::Watchdog;

use crate::job::{
    activity::Activity,
    board::{JobBoard, Lead},
    presence::{Presence, PresenceState},
    record::{Job, JobState, PaintingTurn},
};

/// The number of restarts after which a job that still stalls is rendered again from its first sample.
const STIRS_MAX: u32 = 3;

/// Watches all jobs of a farm.
pub(crate) struct StallWatch {
    begun: Instant,
    jobs: BTreeMap<u32, (PaintingTurn, Watchdog)>,
}

/// A snapshot of a job's activity.
#[derive(Clone, Debug, PartialEq)]
struct JobSight {
    /// Machines that are free for it.
    free: Vec<String>,
    /// True if a machine is busy for it.
    is_worked_at: bool,
    /// A hash that changes when any of its work starts or ends.
    moves: u64,
}

impl StallWatch {
    /// Returns a watch that has seen no job yet.
    pub(crate) fn new() -> Self {
        Self { begun: Instant::now(), jobs: BTreeMap::new() }
    }

    /// Checks all jobs, and restarts those that have stalled. Call it about once a second.
    pub(crate) fn look(&mut self, board: &JobBoard) {
        // Without a connection, nothing is known and nothing can be done.
        if board.uplink.is_guest() || !board.uplink.is_connected() {
            self.jobs.clear();
            return;
        }
        let machines = board.presences();
        let jobs = board.all();
        let active: BTreeSet<u32> =
            jobs.iter().filter(|(_, job)| job.state == JobState::Active).map(|(number, _)| *number).collect();
        self.jobs.retain(|number, _| active.contains(number));
        let now = Time::since_start(self.begun.elapsed());
        for (number, job) in jobs.iter().filter(|(number, _)| active.contains(number)) {
            let lead = board.lead(*number).unwrap_or_default();
            let sight = JobSight::new(*number, job, &lead, &machines);
            let (turn, watchdog) = self.jobs.entry(*number).or_insert_with(|| (job.turn(), Watchdog::default()));
            if *turn != job.turn() {
                (*turn, *watchdog) = (job.turn(), Watchdog::default());
            }
            let is_in_vain = !sight.is_worked_at && !sight.free.is_empty();
            if let Some(waited) = watchdog.look(now, is_in_vain, sight.moves) {
                let free = sight.free.join(" and ");
                let seconds = waited.as_secs();
                board.stir(
                    *number,
                    job,
                    &format!("no work was started for {seconds} s, though {free} could have painted it"),
                );
            }
        }
    }
}

impl JobSight {
    /// Returns the snapshot of a job.
    ///
    /// - `machines`: all machines.
    fn new(number: u32, job: &Job, lead: &Lead, machines: &[Presence]) -> Self {
        let is_led = lead.leader.is_some();
        let lead = lead.clone().of(job.work);
        let of_job = |machine: &&Presence| machine.job == Some(number);
        let may_paint = |machine: &&Presence| {
            machine.standing == PresenceState::Active
                && (machine.takes_orders || of_job(machine))
                && (is_led || !machine.is_guest)
                && job.require.iter().all(|tag| machine.tags.contains(tag))
                && !machine.refusals.iter().any(|refusal| refusal.work == job.work)
        };
        let is_idle =
            |machine: &&Presence| machine.activity != Activity::Busy && (machine.job.is_none() || of_job(machine));
        let free = machines.iter().filter(may_paint).filter(is_idle).map(|machine| machine.name.clone());
        let progress = [lead.zones_done as u64, lead.zones as u64, lead.done.to_bits()];
        let moves = machines.iter().filter(of_job).map(|machine| machine.moves).chain(progress);
        Self {
            // Where results are compared, the machines present have done all that they may.
            free: if lead.lacks_machines { Vec::new() } else { free.collect() },
            is_worked_at: machines.iter().filter(of_job).any(|machine| machine.activity == Activity::Busy),
            moves: moves.fold(0, |sum: u64, more| sum.wrapping_mul(31).wrapping_add(more)),
        }
    }
}

impl JobBoard {
    /// Restarts all processes of a painting; after several restarts, starts it again from its first sample. Does nothing if
    /// another process has done so.
    ///
    /// - `seen`: the job as it was when it was found stalled.
    fn stir(&self, number: u32, seen: &Job, why: &str) {
        let is_last = seen.stirs + 1 >= STIRS_MAX;
        let how = if is_last { "restarting it from its first sample" } else { "all machines start it again" };
        let changed = self.change(number, |job| {
            let is_as_seen = job.turn() == seen.turn() && job.state == JobState::Active;
            if is_as_seen {
                job.say(format!("{why}: {how}"));
                if is_last { job.paint_again() } else { job.stirs += 1 }
            }
            is_as_seen
        });
        match changed {
            Ok(job) if job.turn() != seen.turn() => {
                tracing::warn!(job = number, "{why}: {how}");
                if is_last {
                    self.forget_painting(seen);
                }
            }
            Ok(_) => {}
            Err(error) => tracing::debug!(%error, job = number, "cannot restart it"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::presence::Refusal;

    fn job() -> Job {
        serde_json::from_value(serde_json::json!({
            "version": "1", "origin": 7, "work": 7, "scene": "s", "output": "o.exr", "from": "f", "submitted": 1,
            "priority": 10, "require": ["fast"], "state": "active", "log": [],
        }))
        .unwrap()
    }

    fn presence(name: &str, job: Option<u32>, activity: Activity) -> Presence {
        Presence { tags: vec!["fast".to_owned()], activity, ..Presence::new(name, 1, job) }
    }

    fn lead() -> Lead {
        Lead { leader: Some("a".to_owned()), work: 7, ..Lead::default() }
    }

    #[test]
    fn a_machine_is_free_if_it_waits_and_may_paint_the_job() {
        let refusal = Refusal { job: 1, work: 7, reason: String::new() };
        let machines = [
            presence("a", Some(1), Activity::Waiting),
            presence("b", None, Activity::Waiting),
            presence("c", Some(2), Activity::Waiting),
            Presence { tags: Vec::new(), ..presence("d", None, Activity::Waiting) },
            Presence { refusals: vec![refusal], ..presence("e", None, Activity::Waiting) },
            Presence { standing: PresenceState::Suspended, ..presence("f", None, Activity::Waiting) },
            Presence { takes_orders: false, ..presence("g", None, Activity::Waiting) },
            Presence { is_guest: true, ..presence("h", None, Activity::Waiting) },
        ];
        let sight = JobSight::new(1, &job(), &lead(), &machines);
        assert_eq!(sight.free, ["a", "b", "h"]);
        assert!(!sight.is_worked_at);
        assert_eq!(JobSight::new(1, &job(), &Lead::default(), &machines).free, ["a", "b"], "guests paint for somebody");
        let lacking = Lead { lacks_machines: true, ..lead() };
        assert!(JobSight::new(1, &job(), &lacking, &machines).free.is_empty());
    }

    #[test]
    fn busy_machines_and_progress_are_noticed() {
        let busy = [presence("a", Some(1), Activity::Busy), presence("b", Some(2), Activity::Busy)];
        assert!(JobSight::new(1, &job(), &lead(), &busy).is_worked_at);
        assert!(!JobSight::new(3, &job(), &lead(), &busy).is_worked_at);
        let moved = [Presence { moves: 9, ..busy[0].clone() }, busy[1].clone()];
        let moves = |machines: &[Presence], lead: &Lead| JobSight::new(1, &job(), lead, machines).moves;
        assert_ne!(moves(&busy, &lead()), moves(&moved, &lead()));
        assert_ne!(moves(&busy, &lead()), moves(&busy, &Lead { zones_done: 1, ..lead() }));
    }
}
