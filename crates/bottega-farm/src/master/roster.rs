//! The agents of a Master, in the orders in which they are asked.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Duration,
};

use bottega_agents::{AgentId, Time};

use crate::{AgentRow, auction::Field};

/// Agents that a Master takes at most.
pub(super) const MEMBERS_MAX: usize = 1 << 14;
/// Zones to profile that an agent has in hand at most. They are short; more of them hide the way of a message.
const PROFILE_WINDOW: usize = 4;

/// One agent.
#[derive(Clone, Debug)]
pub(super) struct Member {
    pub(super) row: AgentRow,
    /// When it last said something.
    pub(super) heard: Time,
    /// It refused, or said nothing: not asked before.
    rests_until: Option<Time>,
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

/// All agents that are here.
#[derive(Clone, Debug, Default)]
pub(super) struct Roster {
    /// Zones that an agent has in hand before it is asked no more.
    window: usize,
    members: BTreeMap<AgentId, Member>,
    /// Those who may bid, the first to be idle first.
    free: BTreeSet<(Time, AgentId)>,
    /// Those who may profile, by how soon they would be through.
    profiling: BTreeSet<(u64, AgentId)>,
    /// Those who have zones in hand, by when they will have painted them.
    laden: BTreeSet<(Time, AgentId)>,
    resting: BTreeSet<(Time, AgentId)>,
    passed_over: BTreeSet<AgentId>,
    /// Speed and readiness of all, for the auction.
    field: Field,
}

impl Roster {
    /// Nobody yet.
    ///
    /// - `window`: zones that an agent has in hand before it is asked no more.
    pub(super) fn new(window: usize) -> Self {
        Self { window, ..Self::default() }
    }

    /// Takes an agent, or what is new of it. Returns whether it was not here. `None`: there is no room.
    pub(super) fn join(&mut self, now: Time, row: AgentRow) -> Option<bool> {
        let agent = row.agent.clone();
        if let Some(member) = self.members.get_mut(&agent) {
            member.heard = now;
            member.row = row;
            self.place(&agent);
            return Some(false);
        }
        if self.members.len() >= MEMBERS_MAX {
            return None;
        }
        let member = Member {
            row,
            heard: now,
            rests_until: None,
            passed_over: false,
            round: None,
            hands: 0,
            load: Duration::ZERO,
            ready: now,
            places: Places::default(),
        };
        self.members.insert(agent.clone(), member);
        self.place(&agent);
        Some(true)
    }

    pub(super) fn leave(&mut self, agent: &AgentId) -> Option<Member> {
        let member = self.members.remove(agent)?;
        self.unplace(agent, member.places);
        self.resting.retain(|(_, other)| other != agent);
        self.passed_over.remove(agent);
        self.field.remove(agent);
        Some(member)
    }

    fn unplace(&mut self, agent: &AgentId, places: Places) {
        if let Some(key) = places.free {
            self.free.remove(&(key, agent.clone()));
        }
        if let Some(key) = places.profiling {
            self.profiling.remove(&(key, agent.clone()));
        }
        if let Some(key) = places.laden {
            self.laden.remove(&(key, agent.clone()));
        }
    }

    /// Puts an agent into the orders where it belongs now.
    fn place(&mut self, agent: &AgentId) {
        let Some(member) = self.members.get_mut(agent) else { return };
        let own = member.own();
        let willing = member.rests_until.is_none();
        let may_bid = member.hands < self.window && willing && !member.passed_over && member.round.is_none();
        let places = Places {
            free: may_bid.then_some(member.ready),
            profiling: (member.hands < PROFILE_WINDOW).then(|| ((member.hands as f64 + 1.0) * own).to_bits()),
            laden: (member.hands > 0).then_some(member.ready),
        };
        let before = std::mem::replace(&mut member.places, places);
        self.field.set(agent, willing.then_some((own, member.ready, !member.load.is_zero())));
        if places == before {
            return;
        }
        self.unplace(agent, before);
        if let Some(key) = places.free {
            self.free.insert((key, agent.clone()));
        }
        if let Some(key) = places.profiling {
            self.profiling.insert((key, agent.clone()));
        }
        if let Some(key) = places.laden {
            self.laden.insert((key, agent.clone()));
        }
    }

    pub(super) fn get(&self, agent: &AgentId) -> Option<&Member> {
        self.members.get(agent)
    }

    /// An agent has spoken.
    pub(super) fn hear(&mut self, now: Time, agent: &AgentId) {
        if let Some(member) = self.members.get_mut(agent) {
            member.heard = now;
        }
    }

    /// Changes what an agent's row says. Returns the row.
    pub(super) fn update(&mut self, agent: &AgentId, change: impl FnOnce(&mut AgentRow)) -> Option<AgentRow> {
        let member = self.members.get_mut(agent)?;
        change(&mut member.row);
        let row = member.row.clone();
        self.place(agent);
        Some(row)
    }

    /// What an agent has in hand from now on. What is new begins behind what it had; when something is finished it is
    /// taken to begin with the rest.
    pub(super) fn set_hands(&mut self, now: Time, agent: &AgentId, (hands, load): (usize, Duration)) {
        let Some(member) = self.members.get_mut(agent) else { return };
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
        self.place(agent);
    }

    /// The bid of these agents is awaited in a round.
    pub(super) fn call(&mut self, round: u64, agents: impl IntoIterator<Item = AgentId>) {
        for agent in agents {
            if let Some(member) = self.members.get_mut(&agent) {
                member.round = Some(round);
                self.place(&agent);
            }
        }
    }

    /// An agent's round is over.
    pub(super) fn release(&mut self, agent: &AgentId) {
        if let Some(member) = self.members.get_mut(agent) {
            member.round = None;
            self.place(agent);
        }
    }

    /// An agent refused or said nothing: it is not asked before `until`.
    pub(super) fn rest(&mut self, agent: &AgentId, until: Time) {
        if let Some(member) = self.members.get_mut(agent) {
            if let Some(before) = member.rests_until.replace(until) {
                self.resting.remove(&(before, agent.clone()));
            }
            self.resting.insert((until, agent.clone()));
            self.place(agent);
        }
    }

    /// An agent bid and won nothing.
    pub(super) fn pass_over(&mut self, agent: &AgentId) {
        if let Some(member) = self.members.get_mut(agent) {
            member.passed_over = true;
            self.passed_over.insert(agent.clone());
            self.place(agent);
        }
    }

    /// An agent that was passed over may bid again.
    pub(super) fn reconsider(&mut self, agent: &AgentId) {
        if let Some(member) = self.members.get_mut(agent).filter(|member| member.passed_over) {
            member.passed_over = false;
            self.passed_over.remove(agent);
            self.place(agent);
        }
    }

    /// Something has changed: who was passed over may bid again.
    pub(super) fn ask_again(&mut self) {
        for agent in std::mem::take(&mut self.passed_over) {
            if let Some(member) = self.members.get_mut(&agent) {
                member.passed_over = false;
                self.place(&agent);
            }
        }
    }

    /// Who has rested long enough may bid again.
    pub(super) fn wake(&mut self, now: Time) {
        while let Some((until, agent)) = self.resting.first().filter(|(until, _)| *until <= now).cloned() {
            self.resting.remove(&(until, agent.clone()));
            if let Some(member) = self.members.get_mut(&agent) {
                member.rests_until = None;
                self.place(&agent);
            }
        }
    }

    pub(super) fn names(&self) -> Vec<AgentId> {
        self.members.keys().cloned().collect()
    }

    /// Agents that have said nothing since `since`.
    pub(super) fn silent(&self, since: Time) -> Vec<AgentId> {
        self.members.values().filter(|member| member.heard < since).map(|member| member.row.agent.clone()).collect()
    }

    /// Of those who have room for a zone to profile the one that would be through first.
    pub(super) fn freest(&self) -> Option<AgentId> {
        self.profiling.first().map(|(_, agent)| agent.clone())
    }

    /// Who may bid, the first to be idle first; `count_max` of them.
    pub(super) fn bidders(&self, count_max: usize) -> Vec<AgentId> {
        self.free.iter().take(count_max).map(|(_, agent)| agent.clone()).collect()
    }

    /// Whether anybody may bid.
    pub(super) fn has_bidders(&self) -> bool {
        !self.free.is_empty()
    }

    /// Some of those who have nothing at all to do.
    pub(super) fn idle(&self, count_max: usize) -> Vec<AgentId> {
        let free = self.free.iter().filter_map(|(_, agent)| self.members.get(agent));
        free.filter(|member| member.is_idle()).take(count_max).map(|member| member.row.agent.clone()).collect()
    }

    /// Those who will need longest, and those who need longer than was expected.
    pub(super) fn laggards(&self, now: Time, count_max: usize) -> impl Iterator<Item = &Member> {
        let late = self.laden.iter().take_while(move |(ready, _)| *ready < now).take(count_max);
        let last = self.laden.iter().rev().take_while(move |(ready, _)| *ready >= now).take(count_max);
        late.chain(last).filter_map(|(_, agent)| self.members.get(agent))
    }

    /// Speed and readiness of all who could take a zone.
    pub(super) fn field(&self) -> &Field {
        &self.field
    }
}

impl Member {
    /// Whether it has nothing at all to do, and would do something.
    pub(super) fn is_idle(&self) -> bool {
        self.hands == 0 && self.rests_until.is_none() && self.round.is_none()
    }

    /// Its own time for a second of the reference machine's, all its processors together.
    pub(super) fn own(&self) -> f64 {
        self.row.power.get() / self.row.lanes.max(1e-6)
    }
}
