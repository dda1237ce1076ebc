//! The speed of the agents of a job: as they say, corrected by how long what is done took them.
//!
//! An agent says how much reference-machine time it paints in a second: V_cp and lanes. Agents may share processors with each other or
//! with other programs, so that all of them together paint less. What is done tells by how much, and must be counted with what is
//! under way: when the first of two zones that an agent paints at once is done, the other is half done. So each zone in hand is given
//! its share of its agent's time, as the agent says it, and a zone that is done sets its T_est against what it was given.

use std::{collections::BTreeMap, time::Duration};

use bottega_agents::{AgentId, Time};

use crate::{AgentRow, ZoneId, ZoneRow, ZoneState};

/// What is remembered of what was painted before, at each zone that is done: some twenty of them count.
const REMEMBERED: f64 = 0.95;
/// An agent that has had nothing in hand for so long is not counted on: it may have gone without a word.
const IDLE_MAX: Duration = Duration::from_secs(15);
/// However long a zone has been in hand, this share of it is still to be painted.
const UNPAINTED_MIN: f64 = 0.05;

/// The agents of a job, and what they have in hand.
#[derive(Debug, Default)]
pub(crate) struct Throughput {
    agents: BTreeMap<AgentId, AgentPace>,
    /// Who has each zone in hand.
    holders: BTreeMap<ZoneId, Vec<AgentId>>,
    /// Whether agents begin what they have in hand one after the other, and not all at once.
    is_in_turn: bool,
    all: Painted,
}

/// Reference-machine time of zones that are done, and what their agents should have painted in the time that it took, by their own
/// word; both in seconds.
#[derive(Clone, Copy, Debug, Default)]
struct Painted {
    estimated: f64,
    given: f64,
}

#[derive(Debug, Default)]
struct AgentPace {
    /// Reference-machine seconds that it paints in a second, as it says.
    speed: f64,
    hands: BTreeMap<ZoneId, HeldZone>,
    /// Until when its time is given to what it has in hand.
    given_until: Time,
    painted: Painted,
}

/// A zone in the hand of an agent.
#[derive(Clone, Copy, Debug)]
struct HeldZone {
    /// How many orders its agent had been given before.
    turn: u64,
    /// T_est of what it is to be painted, in seconds; `None`: it is a profile.
    estimated: Option<f64>,
    /// What it was given so far of what the agent says that it paints, in seconds.
    given: f64,
}

impl Painted {
    fn add(&mut self, other: Self) {
        self.estimated = REMEMBERED * self.estimated + other.estimated;
        self.given = REMEMBERED * self.given + other.given;
    }

    /// By how much faster than they say agents are, where `prior` is expected of the first `weight` seconds.
    fn ratio(&self, prior: f64, weight: f64) -> f64 {
        (self.estimated + prior * weight) / (self.given + weight).max(1e-9)
    }
}

impl AgentPace {
    /// Gives its time until `now` to what it has in hand.
    fn give(&mut self, now: Time, is_in_turn: bool) {
        let seconds = now.since(self.given_until.min(now)).as_secs_f64();
        if !self.hands.is_empty() {
            self.given_until = self.given_until.max(now);
        }
        let given = seconds * self.speed;
        if is_in_turn {
            if let Some(first) = self.hands.values_mut().min_by_key(|zone| zone.turn) {
                first.given += given;
            }
        } else {
            let share = given / self.hands.len().max(1) as f64;
            self.hands.values_mut().for_each(|zone| zone.given += share);
        }
    }
}

impl Throughput {
    /// - `is_in_turn`: whether agents begin what they have in hand one after the other.
    pub(crate) fn new(is_in_turn: bool) -> Self {
        Self { is_in_turn, ..Self::default() }
    }

    /// Takes in how fast an agent says that it is.
    pub(crate) fn see_agent(&mut self, row: &AgentRow) {
        let speed = if row.left_out.is_none() { row.lanes / row.power.get() } else { 0.0 };
        self.agents.entry(row.agent.clone()).or_default().speed = if speed.is_finite() { speed } else { 0.0 };
    }

    /// Takes in the row of a zone.
    pub(crate) fn see_zone(&mut self, now: Time, row: &ZoneRow) {
        let held_before = self.holders.remove(&row.zone).unwrap_or_default();
        let holders: Vec<AgentId> = row.holders().cloned().collect();
        for agent in held_before.iter().filter(|agent| !holders.contains(agent)) {
            let is_painter = row.state == ZoneState::Done && row.agent.as_ref() == Some(agent);
            let Some(pace) = self.agents.get_mut(agent) else { continue };
            pace.give(now, self.is_in_turn);
            let Some(held) = pace.hands.remove(&row.zone) else { continue };
            // Whoever paints it may have decided for other samples.
            let estimated = row.time_estimated.map(|time| time.as_secs_f64()).or(held.estimated);
            let is_measured = is_painter && held.estimated.is_some() && held.given > 0.0;
            if let Some(estimated) = estimated.filter(|_| is_measured) {
                let painted = Painted { estimated, given: held.given };
                pace.painted.add(painted);
                self.all.add(painted);
            }
        }
        for (number, agent) in (0..).zip(&holders) {
            let pace = self.agents.entry(agent.clone()).or_default();
            if pace.hands.contains_key(&row.zone) {
                continue;
            }
            pace.give(now, self.is_in_turn);
            if pace.hands.is_empty() {
                pace.given_until = now;
            }
            let turn = pace.hands.values().map(|held| held.turn + 1).max().unwrap_or(number);
            let estimated = row.time_estimated.filter(|_| row.state == ZoneState::Awarded);
            let estimated = estimated.map(|time| time.as_secs_f64());
            pace.hands.insert(row.zone, HeldZone { turn, estimated, given: 0.0 });
        }
        if !holders.is_empty() {
            self.holders.insert(row.zone, holders);
        }
    }

    /// How long so much takes all agents that are there; `None`: nobody is known.
    ///
    /// - `seconds`: reference-machine time of all that is not done, what is in hand with it.
    /// - `zone_seconds`: that of a zone on the average: so much must be painted before agents are taken to be otherwise than they say.
    pub(crate) fn time_for(&self, now: Time, seconds: f64, zone_seconds: f64) -> Option<f64> {
        let weight = zone_seconds.max(1e-6);
        let ratio = self.all.ratio(1.0, weight);
        let is_there = |pace: &&AgentPace| !pace.hands.is_empty() || now.since(pace.given_until.min(now)) < IDLE_MAX;
        let (mut speed, mut under_way) = (0.0, 0.0);
        for pace in self.agents.values().filter(is_there) {
            let own = pace.painted.ratio(ratio, weight);
            speed += pace.speed * own;
            let left = now.since(pace.given_until.min(now)).as_secs_f64() * pace.speed;
            let first = pace.hands.values().map(|held| held.turn).min();
            for held in pace.hands.values() {
                let share = match self.is_in_turn {
                    true => f64::from(u8::from(Some(held.turn) == first)),
                    false => (pace.hands.len() as f64).recip(),
                };
                let most = (1.0 - UNPAINTED_MIN) * held.estimated.unwrap_or(0.0);
                under_way += (own * (held.given + left * share)).min(most);
            }
        }
        (speed > 0.0).then(|| (seconds - under_way).max(0.0) / speed)
    }
}
