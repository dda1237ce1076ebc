//! The field: speeds and loads of all agents, from which the expected end of the work follows.

use std::{
    cell::{Cell, RefCell},
    collections::{BTreeMap, BTreeSet},
};

use bottega_agents::Time;

use super::member::MemberId;

/// The agents that can take zones, with their speeds and loads.
#[derive(Clone, Debug, Default)]
pub struct Field {
    /// By [`MemberId`]: the index of the agent's entry in `members` and `paces`.
    slots: Vec<Option<usize>>,
    members: Vec<MemberId>,
    /// Dense, because all of them are read now and then.
    paces: Vec<Pace>,
    /// The same agents as classes of equal speed; built on demand, see [`Field::rest`].
    classes: RefCell<Classes>,
    /// The last computed end.
    known: Cell<ExpectedEnd>,
}

/// A computed end of all work, with its inputs.
#[derive(Clone, Copy, Debug, Default)]
struct ExpectedEnd {
    /// `now` when it was computed, in seconds.
    at: f64,
    /// Reference-machine seconds of the zones that no agent held.
    open: f64,
    /// The end, in seconds from `at`.
    end: f64,
    /// Remaining uses before it is computed again.
    uses: usize,
}

/// A computed end is used once per this many agents.
const USES_SHARE: usize = 64;
/// Maximum share of the time until the end, and of the open work, that may have passed since it was computed.
const USES_TIME: f64 = 0.01;

/// Speed and load of one agent.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pace {
    /// Own seconds per second of the reference machine, with all its processors together.
    own: f64,
    /// The time at which the agent will have painted what it holds, in seconds; `None`: it holds nothing.
    ready: Option<f64>,
}

impl Pace {
    /// Returns the remaining busy time, in seconds. An agent that is late is expected to need as long again as it is
    /// late.
    fn busy(&self, now: f64) -> f64 {
        self.ready.map_or(0.0, |ready| (ready - now).abs())
    }

    /// Returns the time until it has painted one more zone that takes `time` reference-machine seconds, in seconds
    /// from now.
    fn finish(&self, now: f64, time: f64) -> f64 {
        self.busy(now) + self.own * time
    }

    /// Returns the speed class: speeds within a class differ by a sixteenth at most. Positive floats order as their
    /// bits do.
    fn class(&self) -> u64 {
        self.own.to_bits() >> 48
    }
}

/// All agents by speed class, the fastest first.
#[derive(Clone, Debug, Default)]
struct Classes {
    all: BTreeMap<u64, Class>,
    /// `true`: `all` is kept up to date.
    is_kept: bool,
    /// `true`: used since the last [`Field::rest`].
    was_used: bool,
}

/// Agents of nearly the same speed.
#[derive(Clone, Debug)]
struct Class {
    /// The fastest agent's own seconds per reference second: a lower bound for the class.
    own: f64,
    /// Agents that hold nothing, the fastest first.
    idle: BTreeSet<(u64, MemberId)>,
    /// Agents that hold zones, by the bits of `ready`.
    busy: BTreeSet<(u64, MemberId)>,
}

impl Classes {
    fn insert(&mut self, member: MemberId, pace: &Pace) {
        if !self.is_kept {
            return;
        }
        let empty = || Class { own: pace.own, idle: BTreeSet::new(), busy: BTreeSet::new() };
        let class = self.all.entry(pace.class()).or_insert_with(empty);
        class.own = class.own.min(pace.own);
        match pace.ready {
            None => class.idle.insert((pace.own.to_bits(), member)),
            Some(ready) => class.busy.insert((ready.to_bits(), member)),
        };
    }

    fn remove(&mut self, member: MemberId, pace: &Pace) {
        let Some(class) = self.all.get_mut(&pace.class()) else { return };
        match pace.ready {
            None => class.idle.remove(&(pace.own.to_bits(), member)),
            Some(ready) => class.busy.remove(&(ready.to_bits(), member)),
        };
        if class.idle.is_empty() && class.busy.is_empty() {
            self.all.remove(&pace.class());
        }
    }
}

impl Field {
    /// Sets the speed and load of an agent; `None` removes it: it takes no zones now.
    ///
    /// - `pace`: the seconds that the agent needs for one second of work of the reference machine, and the time at
    ///   which it will have painted what it holds, if it holds anything.
    pub fn set(&mut self, member: MemberId, pace: Option<(f64, Option<Time>)>) {
        let Some((own, ready)) = pace else { return self.remove(member) };
        // Update the agent's entry, or add one
        let pace = Pace { own: own.max(1e-12), ready: ready.map(|ready| ready.elapsed().as_secs_f64()) };
        if self.slots.len() <= member.index() {
            self.slots.resize(member.index() + 1, None);
        }
        match self.slots[member.index()] {
            Some(slot) => {
                let before = std::mem::replace(&mut self.paces[slot], pace);
                if before == pace {
                    return;
                }
                self.classes.get_mut().remove(member, &before);
            }
            None => {
                self.slots[member.index()] = Some(self.paces.len());
                self.members.push(member);
                self.paces.push(pace);
            }
        }
        self.classes.get_mut().insert(member, &pace);
    }

    /// Removes an agent that has left; no effect if it is not in the field.
    pub fn remove(&mut self, member: MemberId) {
        let Some(slot) = self.slots.get_mut(member.index()).and_then(Option::take) else { return };
        self.members.swap_remove(slot);
        let pace = self.paces.swap_remove(slot);
        if let Some(moved) = self.members.get(slot) {
            self.slots[moved.index()] = Some(slot);
        }
        self.classes.get_mut().remove(member, &pace);
    }

    /// Frees the index of the agents by speed, unless [`Field::soonest`] or [`Field::anybody_sooner`] has used it since
    /// the last call.
    pub fn rest(&mut self) {
        let classes = self.classes.get_mut();
        if !std::mem::take(&mut classes.was_used) && std::mem::take(&mut classes.is_kept) {
            classes.all.clear();
        }
    }

    fn pace(&self, member: MemberId) -> Option<&Pace> {
        self.slots.get(member.index()).copied().flatten().map(|slot| &self.paces[slot])
    }

    /// Returns the reference-machine seconds that all agents together paint per second.
    pub fn speed(&self) -> f64 {
        self.paces.iter().map(|pace| pace.own.recip()).sum()
    }

    /// Returns the expected end of all work if the work is divided without loss, in seconds from now; infinite without
    /// agents. Reuses the last value while little has changed.
    ///
    /// Agents that are busy beyond that time cannot help before it and are left out.
    ///
    /// - `now`: in seconds since the start of the platform, as in all functions of the field.
    /// - `open`: reference-machine seconds of all zones that no agent holds.
    pub fn end(&self, now: f64, open: f64) -> f64 {
        // Reuse the last value while time and open work are close to its inputs
        let ExpectedEnd { at, open: open_then, end, uses } = self.known.get();
        let (passed, taken) = (now - at, open_then - open);
        if uses > 0 && passed >= 0.0 && passed < USES_TIME * end && taken.abs() <= USES_TIME * open_then {
            self.known.set(ExpectedEnd { uses: uses - 1, ..self.known.get() });
            return end - passed;
        }
        // Compute it again
        let end = self.compute_end(now, open);
        self.known.set(ExpectedEnd { at: now, open, end, uses: self.paces.len() / USES_SHARE });
        end
    }

    /// [`Field::end`] without reuse.
    fn compute_end(&self, now: f64, open: f64) -> f64 {
        let mut end = f64::INFINITY;
        // Iterate: each pass leaves out the agents that are busy beyond the last end. Eight passes suffice in practice.
        for _ in 0..8 {
            // Sum the speeds, and the work that the busy agents already hold
            let (mut speed, mut done) = (0.0, 0.0);
            for pace in self.paces.iter().filter(|pace| pace.busy(now) <= end) {
                speed += pace.own.recip();
                done += pace.busy(now) / pace.own;
            }
            // Divide all work by the total speed
            let before = std::mem::replace(&mut end, (open + done) / speed);
            if speed == 0.0 {
                return f64::INFINITY;
            }
            // Stop when the end no longer falls
            if before - end <= 1e-3 * end {
                break;
            }
        }
        end
    }

    /// Returns the time until an agent finishes one more zone, in seconds from now; infinite if it is not in the field.
    ///
    /// - `now`: in seconds since the start of the platform.
    /// - `time`: the time of the zone, in reference-machine seconds.
    pub fn finish(&self, now: f64, time: f64, member: MemberId) -> f64 {
        self.pace(member).map_or(f64::INFINITY, |pace| pace.finish(now, time))
    }

    /// Returns the time until one more zone is finished, in seconds from now, and the agent that finishes it soonest.
    /// `None`: there are no agents.
    ///
    /// - `now`: in seconds since the start of the platform.
    /// - `time`: the time of the zone, in reference-machine seconds.
    pub fn soonest(&self, now: f64, time: f64) -> Option<(f64, MemberId)> {
        let mut soonest = None;
        self.look(now, time, f64::INFINITY, |finish, member| {
            soonest = Some((finish, member));
            finish
        });
        soonest
    }

    /// Returns true if any agent not left out finishes one more zone before `limit`.
    ///
    /// - `now`: in seconds since the start of the platform.
    /// - `time`: the time of the zone, in reference-machine seconds.
    /// - `limit`: in seconds from now.
    /// - `except`: a function that returns true for the agents to leave out.
    pub fn anybody_sooner(&self, now: f64, time: f64, limit: f64, except: impl Fn(MemberId) -> bool) -> bool {
        let mut found = false;
        self.look(now, time, limit, |_, member| {
            if except(member) {
                return limit;
            }
            found = true;
            f64::NEG_INFINITY
        });
        found
    }

    /// Calls `see` with each agent that finishes a zone before the limit, likely ones first. `see` returns the new
    /// limit.
    fn look(&self, now: f64, time: f64, mut limit: f64, mut see: impl FnMut(f64, MemberId) -> f64) {
        let moment = now.max(0.0).to_bits();
        let mut classes = self.classes.borrow_mut();
        classes.was_used = true;
        // Build the index by speed at the first use
        if !std::mem::replace(&mut classes.is_kept, true) {
            self.members.iter().zip(&self.paces).for_each(|(&member, pace)| classes.insert(member, pace));
        }
        // Visit the classes, the fastest first; stop when no agent of a class can beat the limit
        for class in classes.all.values() {
            let least = class.own * time;
            if least >= limit {
                return;
            }
            // Visit its idle agents, the fastest first
            for &(own, member) in &class.idle {
                let finish = f64::from_bits(own) * time;
                if finish >= limit {
                    break;
                }
                limit = see(finish, member);
            }
            // Visit its busy agents from `now` in both directions: `ready` before `now` means late
            let (coming, late) = ((moment, MemberId::FIRST).., ..(moment, MemberId::FIRST));
            for members in
                [&mut class.busy.range(coming) as &mut dyn Iterator<Item = _>, &mut class.busy.range(late).rev()]
            {
                for &(ready, member) in members {
                    let busy = (f64::from_bits(ready) - now).abs();
                    if busy + least >= limit {
                        break;
                    }
                    let finish = self.finish(now, time, member);
                    if finish < limit {
                        limit = see(finish, member);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;

    fn at(seconds: f64) -> Time {
        Time::since_start(Duration::from_secs_f64(seconds))
    }

    #[test]
    fn who_is_busy_beyond_the_end_does_not_move_it() {
        let mut field = Field::default();
        assert_eq!(field.end(0.0, 1.0), f64::INFINITY);
        for (member, own, ready) in [(0, 1.0, 0.0), (1, 0.5, 2.0), (2, 1.0, 900.0)] {
            field.set(MemberId(member), Some((own, Some(at(ready)))));
        }
        // Two seconds of the first alone, then both: 2 + (11 - 2) / 3.
        assert!((field.end(0.0, 11.0) - 5.0).abs() < 1e-9, "{}", field.end(0.0, 11.0));
        assert_eq!(field.soonest(0.0, 3.0), Some((3.0, MemberId(0))));
        assert!(field.anybody_sooner(0.0, 3.0, 3.6, |member| member == MemberId(0)));
        assert!(!field.anybody_sooner(0.0, 3.0, 3.5, |member| member == MemberId(0)));
        // The first is two seconds late.
        assert_eq!(field.soonest(2.0, 3.0), Some((1.5, MemberId(1))));
        field.set(MemberId(0), None);
        assert_eq!(field.soonest(0.0, 3.0), Some((3.5, MemberId(1))));
        assert!((field.end(0.0, 11.0) - 7.5).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn the_soonest_of_all_is_found(
            sets in prop::collection::vec((0_u32..20, prop::option::weighted(0.9, (0.1..4.0, prop::option::of(0.0..20.0)))), 1..100),
            (now, time) in (0.0..20.0, 0.0..10.0),
        ) {
            let (mut field, mut all) = (Field::default(), BTreeMap::new());
            for (member, pace) in sets {
                let pace = pace.map(|(own, ready): (f64, Option<f64>)| (own, ready.map(at)));
                field.set(MemberId(member), pace);
                match pace {
                    Some(pace) => _ = all.insert(member, pace),
                    None => _ = all.remove(&member),
                }
            }
            let busy = |ready: Option<Time>| ready.map_or(0.0, |ready| f64::abs(ready.elapsed().as_secs_f64() - now));
            let finish = |&(own, ready): &(f64, Option<Time>)| busy(ready) + own * time;
            let least = all.values().map(finish).min_by(f64::total_cmp);
            let found = field.soonest(now, time);
            prop_assert_eq!(found.map(|(finish, _)| finish), least);
            if let Some((least, first)) = found {
                let others = all.iter().filter(|(member, _)| MemberId(**member) != first).map(|(_, pace)| finish(pace));
                let sooner = others.min_by(f64::total_cmp).is_some_and(|second| second < least + 1.0);
                prop_assert_eq!(field.anybody_sooner(now, time, least + 1.0, |member| member == first), sooner);
            }
        }
    }
}
