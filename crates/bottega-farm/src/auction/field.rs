//! How fast and how soon free all agents are: what decides when the work can end.

use std::collections::BTreeMap;

use bottega_agents::{AgentId, Time};

/// All agents that could take a zone. Dense, because each round looks at all of them.
#[derive(Clone, Debug, Default)]
pub struct Field {
    slots: BTreeMap<AgentId, usize>,
    names: Vec<AgentId>,
    paces: Vec<Pace>,
}

/// One agent.
#[derive(Clone, Copy, Debug)]
struct Pace {
    /// Its own time for a second of the reference machine's, all its processors together.
    own: f64,
    /// When it will have painted what it has in hand, in seconds.
    ready: f64,
    /// Whether it has anything in hand.
    laden: bool,
}

impl Pace {
    /// How long it will be busy yet. Who should have been ready and is not is taken to need as much again as it is late.
    fn busy(&self, now: f64) -> f64 {
        let left = self.ready - now;
        if self.laden { left.abs() } else { left.max(0.0) }
    }

    fn finish(&self, now: f64, time: f64) -> f64 {
        self.busy(now) + self.own * time
    }
}

impl Field {
    /// What an agent is from now on; `None`: it takes nothing now.
    ///
    /// - `pace`: its own time for a second of the reference machine's; when it will be ready; whether it has anything in
    ///   hand.
    pub fn set(&mut self, agent: &AgentId, pace: Option<(f64, Time, bool)>) {
        let Some((own, ready, laden)) = pace else { return self.remove(agent) };
        let pace = Pace { own: own.max(1e-12), ready: ready.elapsed().as_secs_f64(), laden };
        match self.slots.get(agent) {
            Some(&slot) => self.paces[slot] = pace,
            None => {
                self.slots.insert(agent.clone(), self.paces.len());
                self.names.push(agent.clone());
                self.paces.push(pace);
            }
        }
    }

    /// It is gone.
    pub fn remove(&mut self, agent: &AgentId) {
        let Some(slot) = self.slots.remove(agent) else { return };
        self.names.swap_remove(slot);
        self.paces.swap_remove(slot);
        if let Some(moved) = self.names.get(slot) {
            self.slots.insert(moved.clone(), slot);
        }
    }

    /// Reference-machine seconds that all of them together paint in a second.
    pub fn speed(&self) -> f64 {
        self.paces.iter().map(|pace| pace.own.recip()).sum()
    }

    /// When all the work will be done if it is spread without loss, in seconds from now; infinite when there is nobody.
    ///
    /// Agents that will be busy beyond that time cannot help before it, so they are left out.
    ///
    /// - `now`: in seconds.
    /// - `open`: reference-machine seconds of all that nobody has in hand.
    pub fn end(&self, now: f64, open: f64) -> f64 {
        let mut end = f64::INFINITY;
        // Each look leaves out those who are later than the end before; a few make no difference.
        for _ in 0..8 {
            let (mut speed, mut done) = (0.0, 0.0);
            for pace in self.paces.iter().filter(|pace| pace.busy(now) <= end) {
                speed += pace.own.recip();
                done += pace.busy(now) / pace.own;
            }
            let before = std::mem::replace(&mut end, (open + done) / speed);
            if speed == 0.0 {
                return f64::INFINITY;
            }
            if before - end <= 1e-3 * end {
                break;
            }
        }
        end
    }

    /// When an agent would have finished a zone, in seconds from now; infinite when it is not here.
    ///
    /// - `time`: the zone's, in reference-machine seconds.
    pub fn finish(&self, now: f64, time: f64, agent: &AgentId) -> f64 {
        self.slots.get(agent).map_or(f64::INFINITY, |&slot| self.paces[slot].finish(now, time))
    }

    /// Who would have finished a zone soonest, and when, in seconds from now. `None`: there is nobody.
    ///
    /// - `time`: the zone's, in reference-machine seconds.
    /// - `except`: who is not asked.
    pub fn soonest(&self, now: f64, time: f64, except: impl Fn(&AgentId) -> bool) -> Option<(f64, &AgentId)> {
        let mut soonest: Option<(f64, &AgentId)> = None;
        for (pace, name) in self.paces.iter().zip(&self.names) {
            let finish = pace.finish(now, time);
            if soonest.is_none_or(|(best, _)| finish < best) && !except(name) {
                soonest = Some((finish, name));
            }
        }
        soonest
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn at(seconds: f64) -> Time {
        Time::since_start(Duration::from_secs_f64(seconds))
    }

    #[test]
    fn who_is_busy_beyond_the_end_does_not_move_it() {
        let mut field = Field::default();
        assert_eq!(field.end(0.0, 1.0), f64::INFINITY);
        for (name, own, ready) in [("a", 1.0, 0.0), ("b", 0.5, 2.0), ("c", 1.0, 900.0)] {
            field.set(&AgentId::new(name), Some((own, at(ready), true)));
        }
        // Two seconds of the first alone, then both: 2 + (11 - 2) / 3.
        assert!((field.end(0.0, 11.0) - 5.0).abs() < 1e-9, "{}", field.end(0.0, 11.0));
        let soonest =
            |field: &Field, now: f64, but: &str| field.soonest(now, 3.0, |name| &*name.name == but).unwrap().0;
        assert_eq!(soonest(&field, 0.0, ""), 3.0);
        assert_eq!(soonest(&field, 0.0, "a"), 3.5);
        // The first is two seconds late.
        assert_eq!(soonest(&field, 2.0, ""), 1.5);
        assert_eq!(soonest(&field, 2.0, "b"), 5.0);
        field.set(&AgentId::new("a"), None);
        assert_eq!(soonest(&field, 0.0, ""), 3.5);
        assert!((field.end(0.0, 11.0) - 7.5).abs() < 1e-9);
    }
}
