//! The agents of a Master, in the orders in which they are asked.

use std::{collections::BTreeSet, time::Duration};

use bottega_agents::{AgentId, Revision, Time};
use rustc_hash::FxHashMap;

use super::watched::{LongestOrder, WatchedZones};
use crate::{AgentRow, Holding, MemberId, ZoneId, auction::Field};

/// Agents that a Master takes at most.
pub(super) const MEMBERS_MAX: usize = 1 << 14;
/// Zones to profile that an agent has in hand at most. They are short; more of them hide the way of a message.
const PROFILE_WINDOW: usize = 4;

/// An agent needs another zone when this share of what it has in hand is not painted yet.
const AHEAD_SHARE: f64 = 0.25;
/// And no later than this before it will have painted that.
const AHEAD_MIN: Duration = Duration::from_millis(20);

/// Later than anything.
fn never() -> Time {
    Time::since_start(Duration::MAX)
}

/// Agents that are looked at for one zone.
const FREE_LOOKED_AT: usize = 64;
/// Failures of an agent whose zones are remembered.
const FAILED_KEPT: usize = 16;

/// One agent.
#[derive(Clone, Debug)]
pub(super) struct Member {
    pub(super) id: MemberId,
    pub(super) row: AgentRow,
    /// Whether what it says of its speed is weighed by how far its promises held.
    weighs_promises: bool,
    /// When it last said something.
    pub(super) heard: Time,
    /// It refused, or said nothing: not asked before.
    rests_until: Option<Time>,
    /// It refused, or said nothing, when it was last asked.
    is_unwilling: bool,
    /// It bid and won nothing: not asked again until something has changed.
    passed_over: bool,
    /// The round in which its bid is awaited.
    pub(super) round: Option<u64>,
    /// Zones in hand, those too whose award is being written.
    hands: usize,
    /// T_est of these.
    load: Duration,
    /// When it will have painted them, as far as can be known.
    pub(super) ready: Time,
    /// When it last reported on an order.
    reported: Time,
    /// Its orders, as it tells of them.
    watched: WatchedZones,
    /// The orders that it has failed on since it last painted something.
    pub(super) failed: Vec<(ZoneId, Revision)>,
    /// Of which composition of the roster it was told its neighbors.
    told: u64,
    /// Where it stands in the orders.
    places: Places,
}

/// An agent's keys in the orders of the roster; `None`: it is not in that one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Places {
    free: Option<Time>,
    profiling: Option<u64>,
    laden: Option<Time>,
}

/// Agents by a key. It is kept only while somebody asks for it: most of the time nobody does.
#[derive(Clone, Debug, Default)]
struct Order<K> {
    agents: BTreeSet<(K, MemberId)>,
    is_kept: bool,
    was_asked_for: bool,
}

impl<K: Copy + Ord> Order<K> {
    fn alter(&mut self, id: MemberId, before: Option<K>, after: Option<K>) {
        if !self.is_kept || before == after {
            return;
        }
        if let Some(key) = before {
            self.agents.remove(&(key, id));
        }
        self.agents.extend(after.map(|key| (key, id)));
    }

    /// Somebody will ask.
    fn keep(&mut self, all: impl Iterator<Item = (K, MemberId)>) {
        self.was_asked_for = true;
        if !self.is_kept {
            self.is_kept = true;
            self.agents.extend(all);
        }
    }

    /// Ends it unless somebody has asked since the last time.
    fn rest(&mut self) {
        if !std::mem::take(&mut self.was_asked_for) && std::mem::take(&mut self.is_kept) {
            self.agents.clear();
        }
    }
}

/// All agents that are here.
#[derive(Clone, Debug, Default)]
pub(super) struct Roster {
    /// Zones that an agent has in hand before it is asked no more.
    window: usize,
    /// Whether what agents say of their speed is weighed by how far their promises held.
    weighs_promises: bool,
    /// By number. Who has gone keeps its number; its place is empty.
    members: Vec<Option<Member>>,
    count: usize,
    /// How often somebody has come or gone.
    changes: u64,
    names: Vec<AgentId>,
    /// A hash map, for speed: never gone through.
    numbers: FxHashMap<AgentId, MemberId>,
    /// Those who may bid, by when they need another zone: see [`Member::due`].
    free: BTreeSet<(Time, MemberId)>,
    /// Those who may profile, by how soon they would be through.
    profiling: Order<u64>,
    /// Those who have zones in hand, by when they will have painted them.
    laden: Order<Time>,
    resting: BTreeSet<(Time, MemberId)>,
    passed_over: BTreeSet<MemberId>,
    /// Speed and readiness of all, for the auction.
    field: Field,
}

impl Roster {
    /// Nobody yet.
    ///
    /// - `window`: zones that an agent has in hand before it is asked no more.
    /// - `weighs_promises`: whether what agents say of their speed is weighed by how far their promises held.
    pub(super) fn new(window: usize, weighs_promises: bool) -> Self {
        Self { window, weighs_promises, ..Self::default() }
    }

    /// The number of an agent that is here, or was, or that a row names.
    pub(super) fn find(&self, agent: &AgentId) -> Option<MemberId> {
        self.numbers.get(agent).copied()
    }

    /// The same; the agent gets a number if it has none.
    pub(super) fn number(&mut self, agent: &AgentId) -> MemberId {
        self.find(agent).unwrap_or_else(|| {
            let id = MemberId(u32::try_from(self.names.len()).expect("fewer than 2³² agents"));
            self.names.push(agent.clone());
            self.members.push(None);
            self.numbers.insert(agent.clone(), id);
            id
        })
    }

    /// The name of a number that was given.
    pub(super) fn name(&self, id: MemberId) -> &AgentId {
        &self.names[id.index()]
    }

    /// Takes an agent, or what is new of it. `None`: there is no room.
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

    /// Puts an agent into the orders where it belongs now.
    fn place(&mut self, id: MemberId) {
        let Some(member) = self.members[id.index()].as_mut() else { return };
        let own = member.own();
        let willing = member.rests_until.is_none();
        let may_bid = member.hands < self.window && willing && !member.passed_over && member.round.is_none();
        let places = Places {
            free: may_bid.then(|| member.due()),
            profiling: (member.hands < PROFILE_WINDOW).then(|| ((member.hands as f64 + 1.0) * own).to_bits()),
            laden: (member.hands > 0).then_some(member.ready),
        };
        let before = std::mem::replace(&mut member.places, places);
        self.field.set(id, willing.then_some((own, (!member.load.is_zero()).then_some(member.ready))));
        self.alter(id, before, places);
    }

    fn alter(&mut self, id: MemberId, before: Places, after: Places) {
        self.profiling.alter(id, before.profiling, after.profiling);
        self.laden.alter(id, before.laden, after.laden);
        if before.free != after.free {
            if let Some(key) = before.free {
                self.free.remove(&(key, id));
            }
            self.free.extend(after.free.map(|key| (key, id)));
        }
    }

    /// Lets go of the orders that nobody has asked for since the last time.
    pub(super) fn rest_orders(&mut self) {
        self.profiling.rest();
        self.laden.rest();
        self.field.rest();
    }

    /// An agent that is here.
    pub(super) fn get(&self, id: MemberId) -> Option<&Member> {
        self.members[id.index()].as_ref()
    }

    /// An agent that is here, by name.
    pub(super) fn get_by_name(&self, agent: &AgentId) -> Option<&Member> {
        self.find(agent).and_then(|id| self.get(id))
    }

    /// An agent has spoken.
    pub(super) fn hear(&mut self, now: Time, id: MemberId) {
        if let Some(member) = self.members[id.index()].as_mut() {
            member.heard = now;
        }
    }

    /// Changes what an agent's row says. Returns the row.
    pub(super) fn update(&mut self, id: MemberId, change: impl FnOnce(&mut AgentRow)) -> Option<&AgentRow> {
        change(&mut self.members[id.index()].as_mut()?.row);
        self.place(id);
        self.get(id).map(|member| &member.row)
    }

    /// What an agent has in hand from now on. What is new begins behind what it had; when something is finished it is
    /// taken to begin with the rest.
    pub(super) fn set_hands(&mut self, now: Time, id: MemberId, (hands, load): (usize, Duration)) {
        let Some(member) = self.members[id.index()].as_mut() else { return };
        if (hands, load) == (member.hands, member.load) {
            return;
        }
        let own = member.own();
        let scale = |time: Duration| crate::adaptation::scaled(time, own);
        member.ready = if load > member.load {
            member.ready.max(now) + scale(load - member.load)
        } else if hands < member.hands {
            now + scale(load)
        } else {
            member.ready
        };
        (member.hands, member.load) = (hands, load);
        self.place(id);
    }

    /// The bid of these agents is awaited in a round.
    pub(super) fn call(&mut self, round: u64, agents: &[MemberId]) {
        for &id in agents {
            if let Some(member) = self.members[id.index()].as_mut() {
                member.round = Some(round);
                self.place(id);
            }
        }
    }

    /// An agent's round is over.
    pub(super) fn release(&mut self, id: MemberId) {
        if let Some(member) = self.members[id.index()].as_mut() {
            member.round = None;
            self.place(id);
        }
    }

    /// An agent refused or said nothing: it is not asked before `until`.
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

    /// An agent has bid.
    pub(super) fn note_bid(&mut self, id: MemberId) {
        if let Some(member) = self.members[id.index()].as_mut() {
            member.is_unwilling = false;
        }
    }

    /// An agent bid and won nothing. If it needs a zone, it is not asked again until something has changed.
    pub(super) fn pass_over(&mut self, now: Time, id: MemberId) {
        if let Some(member) = self.members[id.index()].as_mut().filter(|member| member.due() <= now) {
            member.passed_over = true;
            self.passed_over.insert(id);
            self.place(id);
        }
    }

    /// An agent that was passed over may bid again.
    pub(super) fn reconsider(&mut self, id: MemberId) {
        if let Some(member) = self.members[id.index()].as_mut().filter(|member| member.passed_over) {
            member.passed_over = false;
            self.passed_over.remove(&id);
            self.place(id);
        }
    }

    /// Something has changed: who was passed over may bid again, but for `except`.
    pub(super) fn ask_again(&mut self, except: &BTreeSet<MemberId>) {
        for id in std::mem::take(&mut self.passed_over) {
            if except.contains(&id) {
                self.passed_over.insert(id);
            } else if let Some(member) = self.members[id.index()].as_mut() {
                member.passed_over = false;
                self.place(id);
            }
        }
    }

    /// Who has rested long enough may bid again.
    pub(super) fn wake(&mut self, now: Time) {
        while let Some((until, id)) = self.resting.first().filter(|(until, _)| *until <= now).copied() {
            self.resting.remove(&(until, id));
            if let Some(member) = self.members[id.index()].as_mut() {
                member.rests_until = None;
                self.place(id);
            }
        }
    }

    /// Takes how far the orders of an agent are: see [`WatchedZones::see`].
    pub(super) fn watch(&mut self, now: Time, id: MemberId, hands: &[Holding]) -> Option<LongestOrder> {
        self.members[id.index()].as_mut()?.watched.see(now, hands)
    }

    /// An agent has failed on an order. Returns whether that was not known.
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

    /// An agent has painted something.
    pub(super) fn forget_failures(&mut self, id: MemberId) {
        if let Some(member) = self.members[id.index()].as_mut() {
            member.failed.clear();
        }
    }

    /// Whether an agent may be given another zone.
    pub(super) fn has_room(&self, id: MemberId) -> bool {
        self.get(id).is_some_and(|member| member.hands < self.window)
    }

    /// The neighbors of an agent, if others have come or gone since it was told of them: all others where they are few, else
    /// those at distances of powers of two around the ring of numbers, so that work spreads to everybody in few steps.
    pub(super) fn new_neighbors(&mut self, id: MemberId, count_max: usize) -> Option<Vec<MemberId>> {
        let changes = self.changes;
        let member = self.members[id.index()].as_mut().filter(|member| member.told != changes)?;
        member.told = changes;
        let (ring, is_small) = (self.members.len(), self.count <= count_max + 1);
        let next = |start: usize| {
            let around = (start..start + ring).map(|place| self.members[place % ring].as_ref());
            around.flatten().map(|member| member.id).find(|&other| other != id)
        };
        if is_small {
            return Some(self.iter().map(|member| member.id).filter(|&other| other != id).collect());
        }
        let distances = (0..count_max).map(|k| (ring >> (k + 1)).max(1)).rev();
        let mut neighbors: Vec<MemberId> = distances.filter_map(|distance| next(id.index() + distance)).collect();
        neighbors.dedup();
        Some(neighbors)
    }

    /// How many are here.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// All who are here.
    pub(super) fn iter(&self) -> impl Iterator<Item = &Member> {
        self.members.iter().flatten()
    }

    /// Their names.
    pub(super) fn present(&self) -> Vec<AgentId> {
        self.iter().map(|member| member.row.agent.clone()).collect()
    }

    /// Agents that have said nothing since `since`.
    pub(super) fn silent(&self, since: Time) -> Vec<MemberId> {
        self.iter().filter(|member| member.heard < since).map(|member| member.id).collect()
    }

    /// Of those who have room for a zone to profile the one that would be through first.
    pub(super) fn freest(&mut self) -> Option<MemberId> {
        let all = self.members.iter().flatten();
        self.profiling.keep(all.filter_map(|member| Some((member.places.profiling?, member.id))));
        self.profiling.agents.first().map(|(_, id)| *id)
    }

    /// Who may bid, those first who need another zone first; `count_max` of them.
    pub(super) fn bidders(&self, count_max: usize) -> Vec<MemberId> {
        self.free.iter().take(count_max).map(|(_, id)| *id).collect()
    }

    /// The first to be idle of those who may bid and of whom `is_wanted` holds, as far as is looked.
    pub(super) fn first_free(&self, is_wanted: impl Fn(&AgentId) -> bool) -> Option<MemberId> {
        let free = self.free.iter().take(FREE_LOOKED_AT).map(|(_, id)| *id);
        free.into_iter().find(|id| is_wanted(self.name(*id)))
    }

    /// Whether anybody was passed over and not asked again since.
    pub(super) fn has_passed_over(&self) -> bool {
        !self.passed_over.is_empty()
    }

    /// Whether anybody may bid.
    pub(super) fn has_free(&self) -> bool {
        !self.free.is_empty()
    }

    /// When the next of those who may bid needs another zone.
    pub(super) fn next_due(&self) -> Option<Time> {
        self.free.first().map(|(due, _)| *due).filter(|due| *due < never())
    }

    /// Whether anybody who may bid needs another zone.
    pub(super) fn is_due(&self, now: Time) -> bool {
        self.next_due().is_some_and(|due| due <= now)
    }

    /// An agent has reported on an order. Returns how long it had it, by this Master's clock.
    ///
    /// - `sent`: when the order was given, if that is known; else it was given before the last report.
    pub(super) fn report(&mut self, now: Time, id: MemberId, sent: Option<Time>) -> Option<Duration> {
        let member = self.members[id.index()].as_mut()?;
        let before = std::mem::replace(&mut member.reported, now);
        Some(now - sent.map_or(before, |sent| sent.max(before)))
    }

    /// Some of those who have nothing at all to do.
    pub(super) fn idle(&self, count_max: usize) -> Vec<MemberId> {
        let free = self.free.iter().filter_map(|(_, id)| self.get(*id));
        free.filter(|member| member.is_idle()).take(count_max).map(|member| member.id).collect()
    }

    /// To be called before [`Self::laggards`].
    pub(super) fn keep_laggards(&mut self) {
        let all = self.members.iter().flatten();
        self.laden.keep(all.filter_map(|member| Some((member.places.laden?, member.id))));
    }

    /// Those who will need longest, and those who need longer than was expected.
    pub(super) fn laggards(&self, now: Time, count_max: usize) -> impl Iterator<Item = &Member> {
        let late = self.laden.agents.iter().take_while(move |(ready, _)| *ready < now).take(count_max);
        let last = self.laden.agents.iter().rev().take_while(move |(ready, _)| *ready >= now).take(count_max);
        late.chain(last).filter_map(|(_, id)| self.get(*id))
    }

    /// Speed and readiness of all who could take a zone.
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
            hands: 0,
            load: Duration::ZERO,
            ready: now,
            reported: now,
            watched: WatchedZones::default(),
            failed: Vec::new(),
            told: 0,
            places: Places::default(),
        }
    }

    /// Whether it has nothing at all to do, and would do something.
    pub(super) fn is_idle(&self) -> bool {
        self.hands == 0 && self.rests_until.is_none() && self.round.is_none()
    }

    /// Whether it did not refuse when it was last asked.
    pub(super) fn is_willing(&self) -> bool {
        !self.is_unwilling
    }

    /// Whether it bid and won nothing, and nothing has changed since.
    pub(super) fn is_passed_over(&self) -> bool {
        self.passed_over
    }

    /// Its own time for a second of the reference machine's, all its processors together, as it says.
    pub(super) fn promised_own(&self) -> f64 {
        self.row.power.get() / self.row.lanes.max(1e-6)
    }

    /// The same, as it is believed.
    pub(super) fn own(&self) -> f64 {
        self.promised_own() / self.worth()
    }

    /// What its word is worth.
    pub(super) fn worth(&self) -> f64 {
        if self.weighs_promises { self.row.credit.worth() } else { 1.0 }
    }

    /// When it needs another zone: a while before it will have painted what it has in hand, for it may be faster than was
    /// thought, and an award takes its time.
    fn due(&self) -> Time {
        if self.hands == 0 {
            return self.ready;
        }
        if self.load.is_zero() {
            // It looks at zones of which nobody knows how long they take; that is short.
            return never();
        }
        let load = crate::adaptation::scaled(self.load, self.own());
        let ahead = load.mul_f64(AHEAD_SHARE) + AHEAD_MIN;
        Time::since_start(self.ready.elapsed().saturating_sub(ahead))
    }
}
