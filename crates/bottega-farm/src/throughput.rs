//! The painting speed of all agents of a job, corrected by the measured times of finished zones.
//!
//! An agent reports the reference-machine time that it paints per second: lanes / V_cp. Agents may share processors
//! with each other or with other programs, so that all together paint less. The finished zones show by how much, but
//! zones in progress must count too: when the first of two zones painted in parallel is done, the other is half done.
//! So each held zone is given its share of its agent's reported output, and a finished zone compares its T_est with the
//! output it was given.

use std::{collections::BTreeMap, time::Duration};

use bottega_agents::{AgentId, Time};

use crate::{AgentRow, ZoneId, ZoneRow, ZoneState};

/// Weight of earlier zones at each finished one; about the last twenty count.
const REMEMBERED: f64 = 0.95;
/// Time without zones after which an agent is not counted: it may have left silently.
const IDLE_MAX: Duration = Duration::from_secs(15);
/// Minimum share of a held zone that counts as unpainted, however long it has been held.
const UNPAINTED_MIN: f64 = 0.05;

/// The speeds of a job's agents and the zones that they hold.
#[derive(Debug, Default)]
pub(crate) struct Throughput {
    agents: BTreeMap<AgentId, AgentPace>,
    /// The agents that hold each zone.
    holders: BTreeMap<ZoneId, Vec<AgentId>>,
    /// Number of zones that an agent works on at once, the first ones that it holds; others wait.
    at_once: usize,
    all: Painted,
}

/// Decaying sums over finished zones, in reference-machine seconds: T_est, and the output their agents report for the
/// time spent on them.
#[derive(Clone, Copy, Debug, Default)]
struct Painted {
    estimated: f64,
    given: f64,
}

#[derive(Debug, Default)]
struct AgentPace {
    /// Reference-machine seconds per second, as reported.
    speed: f64,
    held: BTreeMap<ZoneId, HeldZone>,
    /// The time up to which its output is assigned to its zones.
    given_until: Time,
    painted: Painted,
}

/// A zone held by an agent.
#[derive(Clone, Copy, Debug)]
struct HeldZone {
    /// The position of the zone in the order in which the agent received zones.
    turn: u64,
    /// T_est of the zone's samples, in seconds; `None`: a profile.
    estimated: Option<f64>,
    /// Reported output assigned to it so far, in reference-machine seconds.
    given: f64,
}

impl Painted {
    fn add(&mut self, other: Self) {
        self.estimated = REMEMBERED * self.estimated + other.estimated;
        self.given = REMEMBERED * self.given + other.given;
    }

    /// Returns the actual over the reported speed, with `prior` as the ratio of the first `weight` seconds.
    fn ratio(&self, prior: f64, weight: f64) -> f64 {
        (self.estimated + prior * weight) / (self.given + weight).max(1e-9)
    }
}

/// The zones that an agent works on.
#[derive(Clone, Copy, Debug)]
struct BegunZones {
    /// The turn of the last held zone that is painted, not profiled.
    until: Option<u64>,
    count: usize,
}

impl BegunZones {
    /// Returns the share of the agent's output that a zone gets.
    fn share(self, zone: &HeldZone) -> f64 {
        let is_begun = zone.estimated.is_none() || self.until.is_some_and(|until| zone.turn <= until);
        if is_begun { (self.count.max(1) as f64).recip() } else { 0.0 }
    }
}

impl AgentPace {
    /// Assigns the agent's output until `now` to the zones it holds.
    fn give(&mut self, now: Time, at_once: usize) {
        let seconds = now.since(self.given_until.min(now)).as_secs_f64();
        if !self.held.is_empty() {
            self.given_until = self.given_until.max(now);
        }
        let given = seconds * self.speed;
        let begun = self.begun(at_once);
        self.held.values_mut().for_each(|zone| zone.given += given * begun.share(zone));
    }

    /// Returns the zones that it works on: all profiles, and `at_once` others.
    fn begun(&self, at_once: usize) -> BegunZones {
        let mut turns: Vec<u64> =
            self.held.values().filter(|zone| zone.estimated.is_some()).map(|zone| zone.turn).collect();
        turns.sort_unstable();
        let profiles = self.held.len() - turns.len();
        turns.truncate(at_once);
        BegunZones { until: turns.last().copied(), count: profiles + turns.len() }
    }
}

impl Throughput {
    /// Makes a throughput without agents.
    ///
    /// - `at_once`: number of zones that an agent works on at once.
    pub(crate) fn new(at_once: usize) -> Self {
        Self { at_once, ..Self::default() }
    }

    /// Takes in the reported speed of an agent.
    pub(crate) fn see_agent(&mut self, row: &AgentRow) {
        let speed = if row.left_out.is_none() { row.lanes / row.power.get() } else { 0.0 };
        self.agents.entry(row.agent.clone()).or_default().speed = if speed.is_finite() { speed } else { 0.0 };
    }

    /// Takes in the row of a zone.
    pub(crate) fn see_zone(&mut self, now: Time, row: &ZoneRow) {
        let held_before = self.holders.remove(&row.zone).unwrap_or_default();
        let holders: Vec<AgentId> = row.holders().cloned().collect();
        // Agents that no longer hold it: count the zone if the agent finished it
        for agent in held_before.iter().filter(|agent| !holders.contains(agent)) {
            let is_painter = row.state == ZoneState::Done && row.agent.as_ref() == Some(agent);
            let Some(pace) = self.agents.get_mut(agent) else { continue };
            pace.give(now, self.at_once);
            let Some(held) = pace.held.remove(&row.zone) else { continue };
            // The painter's own rules may have changed the number of samples.
            let estimated = row.time_estimated.map(|time| time.as_secs_f64()).or(held.estimated);
            let is_measured = is_painter && held.estimated.is_some() && held.given > 0.0;
            if let Some(estimated) = estimated.filter(|_| is_measured) {
                let painted = Painted { estimated, given: held.given };
                pace.painted.add(painted);
                self.all.add(painted);
            }
        }
        // Agents that hold it now: start assigning output to it
        for (number, agent) in (0..).zip(&holders) {
            let pace = self.agents.entry(agent.clone()).or_default();
            if pace.held.contains_key(&row.zone) {
                continue;
            }
            pace.give(now, self.at_once);
            if pace.held.is_empty() {
                pace.given_until = now;
            }
            let turn = pace.held.values().map(|held| held.turn + 1).max().unwrap_or(number);
            let estimated = row.time_estimated.filter(|_| row.state == ZoneState::Awarded);
            let estimated = estimated.map(|time| time.as_secs_f64());
            pace.held.insert(row.zone, HeldZone { turn, estimated, given: 0.0 });
        }
        if !holders.is_empty() {
            self.holders.insert(row.zone, holders);
        }
    }

    /// Returns the expected time of all present agents for an amount of work; `None` without known agents.
    ///
    /// - `seconds`: reference-machine time of everything unfinished, including what is held.
    /// - `zone_seconds`: reference-machine time of an average zone: so much must be painted before measured speeds
    ///   outweigh reported ones.
    pub(crate) fn time_for(&self, now: Time, seconds: f64, zone_seconds: f64) -> Option<f64> {
        let weight = zone_seconds.max(1e-6);
        let ratio = self.all.ratio(1.0, weight);
        let is_there = |pace: &&AgentPace| !pace.held.is_empty() || now.since(pace.given_until.min(now)) < IDLE_MAX;
        let (mut speed, mut under_way) = (0.0, 0.0);
        for pace in self.agents.values().filter(is_there) {
            let own = pace.painted.ratio(ratio, weight);
            speed += pace.speed * own;
            let left = now.since(pace.given_until.min(now)).as_secs_f64() * pace.speed;
            let begun = pace.begun(self.at_once);
            for held in pace.held.values() {
                let share = begun.share(held);
                let most = (1.0 - UNPAINTED_MIN) * held.estimated.unwrap_or(0.0);
                under_way += (own * (held.given + left * share)).min(most);
            }
        }
        (speed > 0.0).then(|| (seconds - under_way).max(0.0) / speed)
    }
}
