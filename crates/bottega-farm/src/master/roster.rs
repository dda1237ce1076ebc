//! The roster: the agents of a Master, ordered for the selection of bidders, painters and helpers.

use std::{collections::BTreeSet, time::Duration};

use bottega_agents::{AgentId, Revision, Time};
use rustc_hash::FxHashMap;

use super::watched::{LongestOrder, WatchedZones};
use crate::{AgentRow, Holding, MemberId, ZoneId, auction::Field};

/// Maximum number of agents of a Master.
pub(super) const MEMBERS_MAX: usize = 1 << 14;
/// Maximum number of zones that an agent profiles at once. Profiles are short; several at once hide the latency of
/// messages.
const PROFILE_WINDOW: usize = 4;

/// An agent needs another zone when this share of its load is left.
const AHEAD_SHARE: f64 = 0.25;
/// Minimum time before the end of its load at which it needs another zone.
const AHEAD_MIN: Duration = Duration::from_millis(20);

/// Returns a time later than all others.
fn never() -> Time {
    Time::since_start(Duration::MAX)
}

/// Maximum number of free agents tested for one zone.
const FREE_LOOKED_AT: usize = 64;
/// Maximum number of remembered failures per agent.
const FAILED_KEPT: usize = 16;

/// A subscribed agent.
#[derive(Clone, Debug)]
pub(super) struct Member {
    pub(super) id: MemberId,
    pub(super) row: AgentRow,
    /// True if the agent's reported speed is weighted by its reliability.
    weighs_promises: bool,
    /// Time of the agent's last message.
    pub(super) heard: Time,
    /// The agent refused or did not answer: not called before this time.
    rests_until: Option<Time>,
    /// The agent refused, or did not answer, when it was last called.
    is_unwilling: bool,
    /// The agent bid and won nothing: not called again until something changes.
    passed_over: bool,
    /// The round that waits for its bid.
    pub(super) round: Option<u64>,
    /// Number of zones it holds, including awards that are being written.
    held: usize,
    /// The sum of their T_est.
    load: Duration,
    /// The expected time at which the agent will have painted them.
    pub(super) ready: Time,
    /// Time of the agent's last report.
    reported: Time,
    /// Progress of the agent's orders, from its heartbeats.
    watched: WatchedZones,
    /// The orders of the agent that failed since its last success.
    pub(super) failed: Vec<(ZoneId, Revision)>,
    /// The value of [`Roster::changes`] when its neighbors were last sent.
    neighbors_sent: u64,
    /// The agent's keys in the sorted sets of the roster.
    places: Places,
}

/// An agent's keys in the orders of the roster; `None`: not contained.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Places {
    free: Option<Time>,
    supplied: Option<Time>,
    profiling: Option<u64>,
    laden: Option<Time>,
}

/// Agents ordered by a key. Maintained only while in use, which is seldom.
#[derive(Clone, Debug, Default)]
struct AgentOrdering<K> {
    agents: BTreeSet<(K, MemberId)>,
    is_kept: bool,
    was_used: bool,
}

impl<K: Copy + Ord> AgentOrdering<K> {
    fn alter(&mut self, id: MemberId, before: Option<K>, after: Option<K>) {
        if !self.is_kept || before == after {
            return;
        }
        if let Some(key) = before {
            self.agents.remove(&(key, id));
        }
        self.agents.extend(after.map(|key| (key, id)));
    }

    /// Marks the order as in use; builds it from `all` if needed.
    fn keep(&mut self, all: impl Iterator<Item = (K, MemberId)>) {
        self.was_used = true;
        if !self.is_kept {
            self.is_kept = true;
            self.agents.extend(all);
        }
    }

    /// Drops the order unless it was used since the last call.
    fn rest(&mut self) {
        if !std::mem::take(&mut self.was_used) && std::mem::take(&mut self.is_kept) {
            self.agents.clear();
        }
    }
}

/// All agents of the Master.
#[derive(Clone, Debug, Default)]
pub(super) struct Roster {
    /// Maximum number of zones that an agent may hold.
    window: usize,
    /// Number of zones that an agent works on at once.
    prefetch: usize,
    /// True if reported speeds are weighted by reliability.
    weighs_promises: bool,
    /// By number. Agents that have left keep their number, with an empty slot.
    members: Vec<Option<Member>>,
    count: usize,
    /// Number of arrivals and departures.
    changes: u64,
    names: Vec<AgentId>,
    /// A hash map for speed; never iterated.
    numbers: FxHashMap<AgentId, MemberId>,
    /// Agents that may bid and lack zones, by the time at which they need another one: see [`Member::due`].
    free: BTreeSet<(Time, MemberId)>,
    /// Agents that may bid and lack none, by the expected time at which they finish those they hold.
    supplied: BTreeSet<(Time, MemberId)>,
    /// Agents that may profile, by the time they take for their profiles.
    profiling: AgentOrdering<u64>,
    /// Agents that hold zones, by the expected time at which they finish them.
    laden: AgentOrdering<Time>,
    resting: BTreeSet<(Time, MemberId)>,
    passed_over: BTreeSet<MemberId>,
    /// Speeds and loads of all agents, for the auction.
    field: Field,
}

impl Roster {
    /// Makes an empty roster.
    ///
    /// - `window`: maximum number of zones that an agent may hold.
    /// - `prefetch`: number of zones that an agent works on at once.
    /// - `weighs_promises`: true to weight reported speeds by reliability.
    pub(super) fn new(window: usize, prefetch: usize, weighs_promises: bool) -> Self {
        Self { window, prefetch, weighs_promises, ..Self::default() }
    }

    /// Returns the number of an agent that is here, has been here, or is named in a row.
    pub(super) fn find(&self, agent: &AgentId) -> Option<MemberId> {
        self.numbers.get(agent).copied()
    }

    /// Returns the number of an agent; a new one if it has none.
    pub(super) fn number(&mut self, agent: &AgentId) -> MemberId {
        self.find(agent).unwrap_or_else(|| {
            let id = MemberId(u32::try_from(self.names.len()).expect("fewer than 2³² agents"));
            self.names.push(agent.clone());
            self.members.push(None);
            self.numbers.insert(agent.clone(), id);
            id
        })
    }

    /// Returns the name of a numbered agent.
    pub(super) fn name(&self, id: MemberId) -> &AgentId {
        &self.names[id.index()]
    }

    /// Adds an agent or updates its row. `None`: the roster is full.
    pub(super) fn join(&mut self, now: Time, row: AgentRow) -> Option<MemberId> {
        let known = self.find(&row.agent).filter(|id| self.members[id.index()].is_some());
        if known.is_none() && self.count >= MEMBERS_MAX {
            return None;
        }
        let id = self.number(&row.agent);
        match &mut self.members[id.index()] {
            Some(member) => {
                member.heard = now;
                member.row = row;
            }
            member => {
                self.count += 1;
                self.changes += 1;
                *member = Some(Member { weighs_promises: self.weighs_promises, ..Member::new(id, now, row) });
            }
        }
        self.place(id);
        Some(id)
    }

    /// Removes an agent that has left or was excluded. Returns its entry.
    pub(super) fn leave(&mut self, id: MemberId) -> Option<Member> {
        let member = self.members[id.index()].take()?;
        self.count -= 1;
        self.changes += 1;
        self.alter(id, member.places, Places::default());
        if let Some(until) = member.rests_until {
            self.resting.remove(&(until, id));
        }
        self.passed_over.remove(&id);
        self.field.remove(id);
        Some(member)
    }

    /// Updates an agent's keys in all orders.
    fn place(&mut self, id: MemberId) {
        let Some(member) = self.members[id.index()].as_mut() else { return };
        let own = member.own();
        // Compute the agent's keys: whether it may bid, whether it lacks zones, and when it is ready
        let willing = member.rests_until.is_none();
        let may_bid = willing && !member.passed_over && member.round.is_none();
        let is_supplied = may_bid && (self.prefetch..self.window).contains(&member.held);
        let places = Places {
            free: (may_bid && member.held < self.prefetch).then(|| member.due()),
            supplied: is_supplied.then_some(member.ready),
            profiling: (member.held < PROFILE_WINDOW).then(|| ((member.held as f64 + 1.0) * own).to_bits()),
            laden: (member.held > 0).then_some(member.ready),
        };
        // Move it from its old places to the new ones
        let before = std::mem::replace(&mut member.places, places);
        self.field.set(id, willing.then_some((own, (!member.load.is_zero()).then_some(member.ready))));
        self.alter(id, before, places);
    }

    fn alter(&mut self, id: MemberId, before: Places, after: Places) {
        self.profiling.alter(id, before.profiling, after.profiling);
        self.laden.alter(id, before.laden, after.laden);
        for (set, before, after) in
            [(&mut self.free, before.free, after.free), (&mut self.supplied, before.supplied, after.supplied)]
        {
            if before != after {
                if let Some(key) = before {
                    set.remove(&(key, id));
                }
                set.extend(after.map(|key| (key, id)));
            }
        }
    }

    /// Drops the orders not used since the last call.
    pub(super) fn rest_orders(&mut self) {
        self.profiling.rest();
        self.laden.rest();
        self.field.rest();
    }

    /// Returns a present agent.
    pub(super) fn get(&self, id: MemberId) -> Option<&Member> {
        self.members[id.index()].as_ref()
    }

    /// Returns a present agent, by name.
    pub(super) fn get_by_name(&self, agent: &AgentId) -> Option<&Member> {
        self.find(agent).and_then(|id| self.get(id))
    }

    /// Notes that an agent has sent a message.
    pub(super) fn hear(&mut self, now: Time, id: MemberId) {
        if let Some(member) = self.members[id.index()].as_mut() {
            member.heard = now;
        }
    }

    /// Changes an agent's row. Returns the new row.
    pub(super) fn update(&mut self, id: MemberId, change: impl FnOnce(&mut AgentRow)) -> Option<&AgentRow> {
        change(&mut self.members[id.index()].as_mut()?.row);
        self.place(id);
        self.get(id).map(|member| &member.row)
    }

    /// Sets the number of zones that an agent holds and the sum of their T_est. New zones start after those it held;
    /// when one is finished, the expected time is computed again from now, and an agent that was passed over may bid
    /// again.
    pub(super) fn set_load(&mut self, now: Time, id: MemberId, (held, load): (usize, Duration)) {
        let Some(member) = self.members[id.index()].as_mut() else { return };
        if (held, load) == (member.held, member.load) {
            return;
        }
        let own = member.own();
        let scale = |time: Duration| crate::adaptation::scaled(time, own);
        // New zones start after those in hand; a finished one sets the clock again
        member.ready = if load > member.load {
            member.ready.max(now) + scale(load - member.load)
        } else if held < member.held {
            now + scale(load)
        } else {
            member.ready
        };
        if held < member.held && std::mem::take(&mut member.passed_over) {
            self.passed_over.remove(&id);
        }
        (member.held, member.load) = (held, load);
        self.place(id);
    }

    /// Marks agents as called in a round.
    pub(super) fn call(&mut self, round: u64, agents: &[MemberId]) {
        for &id in agents {
            if let Some(member) = self.members[id.index()].as_mut() {
                member.round = Some(round);
                self.place(id);
            }
        }
    }

    /// Marks an agent's round as over.
    pub(super) fn release(&mut self, id: MemberId) {
        if let Some(member) = self.members[id.index()].as_mut() {
            member.round = None;
            self.place(id);
        }
    }

    /// Notes that an agent refused or did not answer: it is not called before `until`.
    pub(super) fn rest(&mut self, id: MemberId, until: Time) {
        if let Some(member) = self.members[id.index()].as_mut() {
            if let Some(before) = member.rests_until.replace(until) {
                self.resting.remove(&(before, id));
            }
            self.resting.insert((until, id));
            member.is_unwilling = true;
            self.place(id);
        }
    }

    /// Notes that an agent has bid.
    pub(super) fn note_bid(&mut self, id: MemberId) {
        if let Some(member) = self.members[id.index()].as_mut() {
            member.is_unwilling = false;
        }
    }

    /// Notes that an agent bid and won nothing. If it needs a zone, it is not called again until something changes.
    pub(super) fn pass_over(&mut self, now: Time, id: MemberId) {
        let lacks = self.lacks(id) > 0;
        if let Some(member) = self.members[id.index()].as_mut().filter(|member| lacks && member.due() <= now) {
            member.passed_over = true;
            self.passed_over.insert(id);
            self.place(id);
        }
    }

    /// Lets an agent bid again that was passed over.
    pub(super) fn reconsider(&mut self, id: MemberId) {
        if let Some(member) = self.members[id.index()].as_mut().filter(|member| member.passed_over) {
            member.passed_over = false;
            self.passed_over.remove(&id);
            self.place(id);
        }
    }

    /// Lets all agents bid again that were passed over, except those in `except`.
    pub(super) fn call_again(&mut self, except: &BTreeSet<MemberId>) {
        for id in std::mem::take(&mut self.passed_over) {
            if except.contains(&id) {
                self.passed_over.insert(id);
            } else if let Some(member) = self.members[id.index()].as_mut() {
                member.passed_over = false;
                self.place(id);
            }
        }
    }

    /// Lets agents bid again whose rest is over.
    pub(super) fn wake(&mut self, now: Time) {
        while let Some((until, id)) = self.resting.first().filter(|(until, _)| *until <= now).copied() {
            self.resting.remove(&(until, id));
            if let Some(member) = self.members[id.index()].as_mut() {
                member.rests_until = None;
                self.place(id);
            }
        }
    }

    /// Takes in the progress of an agent's orders: see [`WatchedZones::see`].
    pub(super) fn watch(&mut self, now: Time, id: MemberId, orders: &[Holding]) -> Option<LongestOrder> {
        self.members[id.index()].as_mut()?.watched.see(now, orders)
    }

    /// Notes that an agent failed on an order. Returns true if this is new.
    pub(super) fn note_failure(&mut self, id: MemberId, order: (ZoneId, Revision)) -> bool {
        let member = self.members[id.index()].as_mut().filter(|member| !member.failed.contains(&order));
        let is_new = member.is_some();
        if let Some(member) = member {
            let old = (member.failed.len() + 1).saturating_sub(FAILED_KEPT);
            member.failed.drain(..old);
            member.failed.push(order);
        }
        is_new
    }

    /// Clears an agent's failures, after a success.
    pub(super) fn forget_failures(&mut self, id: MemberId) {
        if let Some(member) = self.members[id.index()].as_mut() {
            member.failed.clear();
        }
    }

    /// Returns true if an agent may be given another zone.
    pub(super) fn has_room(&self, id: MemberId) -> bool {
        self.get(id).is_some_and(|member| member.held < self.window)
    }

    /// Returns the neighbors of an agent, if they have changed since they were last sent: all other agents if they
    /// are few, else those at distances of powers of two around the ring of numbers, so that work reaches every agent
    /// in few steps.
    pub(super) fn new_neighbors(&mut self, id: MemberId, count_max: usize) -> Option<Vec<MemberId>> {
        let changes = self.changes;
        let member = self.members[id.index()].as_mut().filter(|member| member.neighbors_sent != changes)?;
        member.neighbors_sent = changes;
        let (ring, is_small) = (self.members.len(), self.count <= count_max + 1);
        let next = |start: usize| {
            let around = (start..start + ring).map(|place| self.members[place % ring].as_ref());
            around.flatten().map(|member| member.id).find(|&other| other != id)
        };
        if is_small {
            return Some(self.iter().map(|member| member.id).filter(|&other| other != id).collect());
        }
        // Take those at distances of powers of two around the ring
        let distances = (0..count_max).map(|k| (ring >> (k + 1)).max(1)).rev();
        let mut neighbors: Vec<MemberId> = distances.filter_map(|distance| next(id.index() + distance)).collect();
        neighbors.dedup();
        Some(neighbors)
    }

    /// Returns the number of agents.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Iterates over all agents, in the order of their numbers.
    pub(super) fn iter(&self) -> impl Iterator<Item = &Member> {
        self.members.iter().flatten()
    }

    /// Returns the names of all agents.
    pub(super) fn present(&self) -> Vec<AgentId> {
        self.iter().map(|member| member.row.agent.clone()).collect()
    }

    /// Returns the agents without a message since `since`.
    pub(super) fn silent(&self, since: Time) -> Vec<MemberId> {
        self.iter().filter(|member| member.heard < since).map(|member| member.id).collect()
    }

    /// Returns the agent that can profile another zone soonest.
    pub(super) fn freest(&mut self) -> Option<MemberId> {
        let all = self.members.iter().flatten();
        self.profiling.keep(all.filter_map(|member| Some((member.places.profiling?, member.id))));
        self.profiling.agents.first().map(|(_, id)| *id)
    }

    /// Returns agents that may bid: all that lack zones, up to `count_max`, those that need one soonest first; and
    /// others, so that there are `count_min`.
    pub(super) fn bidders(&self, count_min: usize, count_max: usize) -> Vec<MemberId> {
        let mut bidders: Vec<MemberId> = self.free.iter().take(count_max).map(|(_, id)| *id).collect();
        let others = count_min.saturating_sub(bidders.len());
        bidders.extend(self.supplied.iter().take(others).map(|(_, id)| *id));
        bidders
    }

    /// Returns the number of zones that an agent may still win.
    pub(super) fn room(&self, id: MemberId) -> u32 {
        self.get(id).map_or(0, |member| self.window.saturating_sub(member.held) as u32)
    }

    /// Returns the number of zones that an agent lacks to have as many as it works on at once.
    pub(super) fn lacks(&self, id: MemberId) -> u32 {
        self.get(id).map_or(0, |member| self.prefetch.saturating_sub(member.held) as u32)
    }

    /// Returns the first free agent for which `is_wanted` holds, among the first [`FREE_LOOKED_AT`].
    pub(super) fn first_free(&self, is_wanted: impl Fn(&AgentId) -> bool) -> Option<MemberId> {
        let free = self.free.iter().take(FREE_LOOKED_AT).map(|(_, id)| *id);
        free.into_iter().find(|id| is_wanted(self.name(*id)))
    }

    /// Returns true if any agent is passed over.
    pub(super) fn has_passed_over(&self) -> bool {
        !self.passed_over.is_empty()
    }

    /// Returns true if any agent may bid.
    pub(super) fn has_free(&self) -> bool {
        !self.free.is_empty()
    }

    /// Returns the time at which the next agent that may bid needs a zone.
    pub(super) fn next_due(&self) -> Option<Time> {
        self.free.first().map(|(due, _)| *due).filter(|due| *due < never())
    }

    /// Returns true if an agent that may bid needs a zone now.
    pub(super) fn is_due(&self, now: Time) -> bool {
        self.next_due().is_some_and(|due| due <= now)
    }

    /// Notes a report of an agent. Returns the time since its order, by this Master's clock.
    ///
    /// - `sent`: the time of the order; `None`: unknown, and the last report counts instead.
    pub(super) fn report(&mut self, now: Time, id: MemberId, sent: Option<Time>) -> Option<Duration> {
        let member = self.members[id.index()].as_mut()?;
        let before = std::mem::replace(&mut member.reported, now);
        Some(now - sent.map_or(before, |sent| sent.max(before)))
    }

    /// Returns up to `count_max` idle agents.
    pub(super) fn idle(&self, count_max: usize) -> Vec<MemberId> {
        let free = self.free.iter().filter_map(|(_, id)| self.get(*id));
        free.filter(|member| member.is_idle()).take(count_max).map(|member| member.id).collect()
    }

    /// Prepares [`Self::laggards`]; must be called first.
    pub(super) fn keep_laggards(&mut self) {
        let all = self.members.iter().flatten();
        self.laden.keep(all.filter_map(|member| Some((member.places.laden?, member.id))));
    }

    /// Returns the agents that are late, and those that will finish last.
    pub(super) fn laggards(&self, now: Time, count_max: usize) -> impl Iterator<Item = &Member> {
        let late = self.laden.agents.iter().take_while(move |(ready, _)| *ready < now).take(count_max);
        let last = self.laden.agents.iter().rev().take_while(move |(ready, _)| *ready >= now).take(count_max);
        late.chain(last).filter_map(|(_, id)| self.get(*id))
    }

    /// Returns the speeds and loads of all agents that could take a zone.
    pub(super) fn field(&self) -> &Field {
        &self.field
    }
}

impl Member {
    fn new(id: MemberId, now: Time, row: AgentRow) -> Self {
        Self {
            id,
            row,
            weighs_promises: false,
            heard: now,
            rests_until: None,
            is_unwilling: false,
            passed_over: false,
            round: None,
            held: 0,
            load: Duration::ZERO,
            ready: now,
            reported: now,
            watched: WatchedZones::default(),
            failed: Vec::new(),
            neighbors_sent: 0,
            places: Places::default(),
        }
    }

    /// Returns true if the agent holds nothing, is in no round and is not resting.
    pub(super) fn is_idle(&self) -> bool {
        self.held == 0 && self.rests_until.is_none() && self.round.is_none()
    }

    /// Returns true if the agent did not refuse when it was last called.
    pub(super) fn is_willing(&self) -> bool {
        !self.is_unwilling
    }

    /// Returns true if the agent bid and won nothing, and nothing has changed since.
    pub(super) fn is_passed_over(&self) -> bool {
        self.passed_over
    }

    /// Returns the agent's own seconds per second of the reference machine, with all its processors together, as it reports
    /// them.
    pub(super) fn promised_own(&self) -> f64 {
        self.row.power.get() / self.row.lanes.max(1e-6)
    }

    /// Returns the agent's own seconds per second of the reference machine, weighted by its reliability.
    pub(super) fn own(&self) -> f64 {
        self.promised_own() / self.worth()
    }

    /// Returns the factor on the agent's promises: see [`Credit::worth`](crate::Credit::worth).
    pub(super) fn worth(&self) -> f64 {
        if self.weighs_promises { self.row.credit.worth() } else { 1.0 }
    }

    /// Returns the time at which it needs another zone: some time before it finishes what it holds, because it may be
    /// faster than expected and an award takes time.
    fn due(&self) -> Time {
        if self.held == 0 {
            return self.ready;
        }
        if self.load.is_zero() {
            // It holds only profiles, which are short and of unknown length
            return never();
        }
        let load = crate::adaptation::scaled(self.load, self.own());
        let ahead = load.mul_f64(AHEAD_SHARE) + AHEAD_MIN;
        Time::since_start(self.ready.elapsed().saturating_sub(ahead))
    }
}
