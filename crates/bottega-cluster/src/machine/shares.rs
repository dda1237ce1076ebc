//! The assignment of machines to jobs, in proportion to the jobs' priorities.

use crate::job::presence::Presence;

/// A job that needs machines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct JobClaim {
    pub(crate) number: u32,
    pub(crate) priority: u32,
}

/// Returns the number of the job that a free machine should take: the one with the fewest machines for its priority, and the
/// older one of equals. `None`: no job needs machines.
///
/// - `machines`: all other machines.
pub(crate) fn choose(jobs: &[JobClaim], machines: &[Presence]) -> Option<u32> {
    jobs.iter()
        .map(|job| (share(job, machines_of(job.number, machines) + 1), job.number))
        .min_by(|a, b| {
            let by_share = a.0.total_cmp(&b.0);
            by_share.then(a.1.cmp(&b.1))
        })
        .map(|(_, number)| number)
}

/// Returns true if the machine `me` should leave job `number` for another one. Of the machines of one job, only the last
/// by name moves, so that they do not all move at once.
///
/// - `machines`: all machines, including this one.
pub(crate) fn should_move(me: &str, number: u32, jobs: &[JobClaim], machines: &[Presence]) -> bool {
    let Some(own) = jobs.iter().find(|job| job.number == number) else { return true };
    let is_last = machines.iter().filter(|machine| machine.job == Some(number)).all(|machine| &*machine.name <= me);
    let mine = share(own, machines_of(number, machines));
    let others = jobs.iter().filter(|job| job.number != number);
    is_last && others.map(|job| share(job, machines_of(job.number, machines) + 1)).any(|share| share < mine)
}

/// Returns the number of machines that work on a job.
fn machines_of(number: u32, machines: &[Presence]) -> usize {
    machines.iter().filter(|machine| machine.job == Some(number)).count()
}

fn share(job: &JobClaim, machines: usize) -> f64 {
    machines as f64 / f64::from(job.priority.max(1))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn settle(jobs: &[JobClaim], count: usize) -> Vec<Presence> {
        let machine = |i: usize| Presence::new(&format!("m{i:03}"), 1, None);
        let mut presences: Vec<Presence> = (0..count).map(machine).collect();
        for i in 0..count {
            presences[i].job = choose(jobs, &presences);
        }
        presences
    }

    #[test]
    fn machines_are_shared_by_priority() {
        let jobs = [JobClaim { number: 1, priority: 10 }, JobClaim { number: 2, priority: 30 }];
        let presences = settle(&jobs, 12);
        assert_eq!((machines_of(1, &presences), machines_of(2, &presences)), (3, 9));
    }

    proptest! {
        #[test]
        fn when_a_job_comes_or_goes_machines_move_and_then_rest(
            priorities in prop::collection::vec(1_u32..50, 1..6),
            machines in 1_usize..30,
            before in 1_usize..6,
        ) {
            let numbered = priorities.iter().zip(1..);
            let jobs: Vec<JobClaim> = numbered.map(|(&priority, number)| JobClaim { number, priority }).collect();
            let mut presences = settle(&jobs[..before.min(jobs.len())], machines);
            let mut moves = 0;
            while let Some(i) = (0..machines).find(|&i| should_move(&presences[i].name, presences[i].job.unwrap(), &jobs, &presences)) {
                presences[i].job = None;
                presences[i].job = choose(&jobs, &presences);
                moves += 1;
                prop_assert!(moves <= machines * jobs.len(), "machines go round in circles");
            }
            let all: u32 = priorities.iter().sum();
            for job in &jobs {
                let fair = machines as f64 * f64::from(job.priority) / f64::from(all);
                prop_assert!(machines_of(job.number, &presences) as f64 + 1.0 > fair.floor());
            }
        }
    }
}
