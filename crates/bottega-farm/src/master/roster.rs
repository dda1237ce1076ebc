//! The agents of a Master.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Duration,
};

use bottega_agents::{AgentId, Time};

use crate::{AgentRow, Contender, ZoneId};

/// Agents that a Master takes at most.
pub(super) const MEMBERS_MAX: usize = 1 << 14;

/// One agent.
#[derive(Clone, Debug)]
pub(super) struct Member {
    pub(super) row: AgentRow,
    /// When it last said something.
    pub(super) heard: Time,
    /// Not asked before: it refused, or said nothing.
    pub(super) rests_until: Time,
    /// It bid and won nothing: not asked again until something has changed.
    pub(super) passed_over: bool,
    /// Its zones with T_est, those too whose award is being written.
    pub(super) hands: BTreeMap<ZoneId, Duration>,
}

/// All agents that are here.
#[derive(Clone, Debug, Default)]
pub(super) struct Roster {
    members: BTreeMap<AgentId, Member>,
}

impl Roster {
    /// Takes an agent, or what is new of it. Returns whether it was not here. `None`: there is no room.
    pub(super) fn join(&mut self, now: Time, row: AgentRow) -> Option<bool> {
        if let Some(member) = self.members.get_mut(&row.agent) {
            member.heard = now;
            member.row = row;
            return Some(false);
        }
        if self.members.len() >= MEMBERS_MAX {
            return None;
        }
        let member = Member { row, heard: now, rests_until: Time::ZERO, passed_over: false, hands: BTreeMap::new() };
        self.members.insert(member.row.agent.clone(), member);
        Some(true)
    }

    pub(super) fn leave(&mut self, agent: &AgentId) -> Option<Member> {
        self.members.remove(agent)
    }

    pub(super) fn get(&self, agent: &AgentId) -> Option<&Member> {
        self.members.get(agent)
    }

    pub(super) fn get_mut(&mut self, agent: &AgentId) -> Option<&mut Member> {
        self.members.get_mut(agent)
    }

    pub(super) fn names(&self) -> Vec<AgentId> {
        self.members.keys().cloned().collect()
    }

    /// Agents that have said nothing since `since`.
    pub(super) fn silent(&self, since: Time) -> Vec<AgentId> {
        self.members.values().filter(|member| member.heard < since).map(|member| member.row.agent.clone()).collect()
    }

    /// Of those who have fewer than `window` zones in hand the one that would be free first.
    pub(super) fn freest(&self, window: usize) -> Option<AgentId> {
        let free = self.members.values().filter(|member| member.hands.len() < window);
        let busy =
            |member: &Member| (member.hands.len() as f64 + 1.0) * member.row.power.get() / member.row.lanes.max(1e-6);
        free.min_by(|a, b| busy(a).total_cmp(&busy(b))).map(|member| member.row.agent.clone())
    }

    /// Who may bid: those with fewer than `window` zones in hand who do not rest, the least laden first.
    pub(super) fn bidders(&self, now: Time, window: usize, count_max: usize) -> BTreeSet<AgentId> {
        let may_bid =
            |member: &&Member| member.hands.len() < window && member.rests_until <= now && !member.passed_over;
        let mut free: Vec<(Duration, &AgentId)> =
            self.members.values().filter(may_bid).map(|member| (member.load(), &member.row.agent)).collect();
        free.sort();
        free.into_iter().take(count_max).map(|(_, agent)| agent.clone()).collect()
    }

    /// What an auction must know of all who could take a zone, now or when they have room.
    pub(super) fn contenders(&self, now: Time) -> BTreeMap<AgentId, Contender> {
        let contender = |member: &Member| Contender { row: member.row.clone(), load: member.load() };
        let willing = self.members.iter().filter(|(_, member)| member.rests_until <= now);
        willing.map(|(agent, member)| (agent.clone(), contender(member))).collect()
    }

    /// Something has changed: who was passed over may bid again.
    pub(super) fn ask_again(&mut self) {
        self.members.values_mut().for_each(|member| member.passed_over = false);
    }
}

impl Member {
    fn load(&self) -> Duration {
        self.hands.values().sum()
    }
}
