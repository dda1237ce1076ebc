//! The agents of a job and its auction, as its leader publishes them; and the credit of machines.
//!
//! - `society/N`: the agents of a job and the result of its auction; kept until the job is removed.
//! - `credit/MACHINE`: how well the machine has kept its predicted times. The leader of the next job reads it.

use std::{collections::BTreeMap, sync::Arc};

use bottega::events::AgentEvent;
use bottega_agents::driver::nats::Notice;
use bottega_agents::machine_of;
use bottega_farm::{AgentRow, AuctionTally, Credit, RoundSummary, Theft};
use serde::{Deserialize, Serialize};

use crate::job::{board::JobBoard, presence::Presence, usage::JobUsage};

/// Prefix of the notices of credits.
const CREDITS: &str = "credit/";
/// The most agents that are published.
const AGENTS_MAX: usize = 256;

/// The agents of a job, and the result of its auction.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Society {
    /// The totals over all rounds of the auction.
    pub auction: AuctionTally,
    /// The agents, in the order of their names; at most 256.
    pub agents: Vec<AgentEvent>,
    /// The usage of each process for the job, by its name.
    #[serde(default)]
    pub usages: BTreeMap<String, JobUsage>,
}

/// The predicted and measured times of a machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct HeldPromises {
    /// The recently predicted time in seconds; older predictions count less.
    promised: f64,
    /// The measured time of the same work, in seconds.
    taken: f64,
}

/// A leader's record of the agents and the auction of its job.
#[derive(Debug, Default)]
pub(crate) struct SeenSociety {
    tally: AuctionTally,
    agents: BTreeMap<String, AgentRow>,
    usages: BTreeMap<String, JobUsage>,
    has_changed: bool,
}

impl SeenSociety {
    /// Returns a record that continues the one that a previous leader published.
    pub(crate) fn after(before: Option<Society>) -> Self {
        let Society { auction, usages, .. } = before.unwrap_or_default();
        Self { tally: auction, usages, ..Self::default() }
    }

    /// Records the row of an agent.
    pub(crate) fn see_agent(&mut self, row: &AgentRow) {
        self.agents.insert(row.agent.to_string(), row.clone());
        self.has_changed = true;
    }

    /// Records a round of the auction.
    pub(crate) fn see_round(&mut self, round: &RoundSummary) {
        self.tally.add(round);
        self.has_changed = true;
    }

    /// Records the theft of zones.
    pub(crate) fn see_theft(&mut self, theft: &Theft) {
        self.tally.add_theft(theft);
        self.has_changed = true;
    }

    /// Records what the machines have used for a work.
    pub(crate) fn see_usages(&mut self, work: u64, machines: &[Presence]) {
        for machine in machines {
            let Some(usage) = machine.usages.iter().find(|usage| usage.work == work) else { continue };
            let is_known = self.usages.get(&machine.name) == Some(usage);
            if !is_known && (self.usages.len() < AGENTS_MAX || self.usages.contains_key(&machine.name)) {
                self.usages.insert(machine.name.clone(), usage.clone());
                self.has_changed = true;
            }
        }
    }

    /// Publishes the record if it has changed.
    pub(crate) fn tell(&mut self, board: &JobBoard, number: u32) {
        if !std::mem::take(&mut self.has_changed) {
            return;
        }
        let published = board.put_notice(&society_name(number), &self.view());
        if let Err(error) = published {
            tracing::debug!(%error, "cannot publish the agents of the job");
            self.has_changed = true;
        }
    }

    /// Stores the credit of the machines for the next job.
    pub(crate) fn keep_credits(&self, board: &JobBoard) {
        let mut held: BTreeMap<&str, HeldPromises> = BTreeMap::new();
        for row in self.agents.values().filter(|row| row.credit.taken > 0.0) {
            let machine = held.entry(machine_of(&row.agent.name)).or_default();
            machine.promised += row.credit.promised;
            machine.taken += row.credit.taken;
        }
        for (machine, held) in held {
            if let Err(error) = board.put_notice(&credit_name(machine), &held) {
                tracing::debug!(%error, machine, "cannot store its credit");
            }
        }
    }

    fn view(&self) -> Society {
        let agents = self.agents.values().take(AGENTS_MAX).map(|row| AgentEvent::new(row, None)).collect();
        Society { auction: self.tally, agents, usages: self.usages.clone() }
    }
}

impl JobBoard {
    /// Returns the agents of a job and the result of its auction; `None`: its leader has not published them, or they cannot be
    /// read.
    pub fn society(&self, number: u32) -> Option<Society> {
        self.read_notice(&society_name(number))
    }

    /// Returns the credit of machines from earlier jobs, by the machine's name.
    pub fn credits(&self) -> Arc<BTreeMap<String, Credit>> {
        let credit = |notice: &Notice| {
            let machine = notice.name.strip_prefix(CREDITS)?.to_owned();
            let HeldPromises { promised, taken } = serde_json::from_slice(&notice.text).ok()?;
            let is_sound = [promised, taken].iter().all(|seconds| seconds.is_finite() && *seconds > 0.0);
            is_sound.then_some((machine, Credit { sum: 0.0, promised, taken }))
        };
        Arc::new(self.uplink.notices().all(CREDITS).iter().filter_map(credit).collect())
    }

    /// Returns the reliability of machines in earlier jobs, by the machine's name: predicted over measured time. It is 1 if their
    /// work took as long as predicted, 0.5 if it took twice as long.
    pub fn reliabilities(&self) -> BTreeMap<String, f64> {
        self.credits().iter().map(|(machine, credit)| (machine.clone(), credit.reliability())).collect()
    }

    /// Deletes the agents of a job.
    pub(crate) fn forget_society(&self, number: u32) {
        if let Err(error) = self.uplink.notices().remove(&society_name(number)) {
            tracing::debug!(%error, "the farm does not answer");
        }
    }
}

fn society_name(number: u32) -> String {
    format!("society/{number}")
}

/// Returns the name of the notice of a machine's credit.
pub(crate) fn credit_name(machine: &str) -> String {
    format!("{CREDITS}{machine}")
}
