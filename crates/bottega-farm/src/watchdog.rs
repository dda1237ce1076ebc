//! The watch over work that waits though somebody is free for it.
//!
//! Every claim in a farm has a deadline, after which another takes it. The watchdog is for faults that nobody has thought of: it knows
//! of no claims, only that there is work, that somebody is free, and whether anything begins. A Master watches its zones by it, a
//! farm its jobs, and the simulator every run.

use std::time::Duration;

use bottega_agents::Time;

/// Nobody who is free waits for longer than this while there is work, unless something is wrong.
pub const STALLED_AFTER: Duration = Duration::from_secs(30);

/// Notices that nothing begins.
#[derive(Clone, Debug, Default)]
pub struct Watchdog {
    /// Since when somebody has been free in vain, and how much had begun by then.
    since: Option<(Time, u64)>,
}

impl Watchdog {
    /// Takes in how things stand now. Returns how long nothing has begun, once that is [`STALLED_AFTER`]; the time then begins anew.
    ///
    /// - `is_in_vain`: whether there is work that nobody does, and somebody who is free for it.
    /// - `moves`: a number that is another one whenever something has begun or ended.
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
    fn whoever_is_free_in_vain_is_noticed_after_half_a_minute_and_again() {
        let mut watchdog = Watchdog::default();
        let noticed: Vec<u64> = (0..100).filter(|&now| watchdog.look(at(now), true, 7).is_some()).collect();
        assert_eq!(noticed, [30, 60, 90]);
    }

    #[test]
    fn whatever_begins_and_whoever_is_busy_begins_the_time_anew() {
        let mut watchdog = Watchdog::default();
        for now in 0..100 {
            assert_eq!(watchdog.look(at(now), true, now / 29), None, "something begins every 29 s");
        }
        for now in 100..200 {
            assert_eq!(watchdog.look(at(now), now % 29 > 0, 0), None, "all are busy now and then");
        }
    }
}
