//! The watchdog: detects work that waits although workers are free.
//!
//! Every claim in a farm has a deadline after which another worker takes it. The watchdog catches faults that nobody
//! thought of: it knows no claims, only whether there is work and a free worker, and whether anything starts. A Master
//! watches its zones with it, a farm its jobs, and the simulator every run.

use std::time::Duration;

use bottega_agents::Time;

/// Maximum time that a free worker waits while there is work, unless something is wrong.
pub const STALLED_AFTER: Duration = Duration::from_secs(30);

/// A detector of work that waits although workers are free.
#[derive(Clone, Debug, Default)]
pub struct Watchdog {
    /// Start of the current wait, and the number of moves at that time.
    since: Option<(Time, u64)>,
}

impl Watchdog {
    /// Takes in the current situation. Returns the time without a start once it reaches [`STALLED_AFTER`], which then
    /// begins again; else `None`.
    ///
    /// - `is_in_vain`: true if there is unassigned work and a free worker.
    /// - `moves`: a number that changes whenever work starts or ends.
    pub fn look(&mut self, now: Time, is_in_vain: bool, moves: u64) -> Option<Duration> {
        if !is_in_vain {
            self.since = None;
            return None;
        }
        let (since, _) = *self.since.take_if(|(_, before)| *before == moves).get_or_insert((now, moves));
        let waited = now - since;
        let is_stalled = waited >= STALLED_AFTER;
        self.since = Some((if is_stalled { now } else { since }, moves));
        is_stalled.then_some(waited)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: u64) -> Time {
        Time::since_start(Duration::from_secs(seconds))
    }

    #[test]
    fn a_machine_that_is_free_while_work_waits_is_noticed_after_half_a_minute_and_again() {
        let mut watchdog = Watchdog::default();
        let noticed: Vec<u64> = (0..100).filter(|&now| watchdog.look(at(now), true, 7).is_some()).collect();
        assert_eq!(noticed, [30, 60, 90]);
    }

    #[test]
    fn any_beginning_and_any_busy_machine_restarts_the_time() {
        let mut watchdog = Watchdog::default();
        for now in 0..100 {
            assert_eq!(watchdog.look(at(now), true, now / 29), None, "something begins every 29 s");
        }
        for now in 100..200 {
            assert_eq!(watchdog.look(at(now), now % 29 > 0, 0), None, "all are busy now and then");
        }
    }
}
