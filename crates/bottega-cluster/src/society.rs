//! The agents of a job and its auction, as its leader tells of them; and how far the promises of machines held.
//!
//! - `society/N`: the agents of a job, and what its auction came to; kept until the job is removed.
//! - `credit/MACHINE`: how far a machine's promises held in the jobs so far. Whoever leads the next job reads it.

use std::{collections::BTreeMap, sync::Arc};

use bottega::events::AgentEvent;
use bottega_agents::driver::nats::Notice;
use bottega_agents::machine_of;
use bottega_farm::{AgentRow, AuctionTally, Credit, RoundSummary, Theft};
use serde::{Deserialize, Serialize};

use crate::{
    job_board::{JobBoard, Presence},
    usage::JobUsage,
};

/// How the names of all notices of credits begin.
const CREDITS: &str = "credit/";
/// Agents that are told of at most.
const AGENTS_TOLD_MAX: usize = 256;

/// The agents of a job, and what its auction came to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Society {
    /// What all rounds of the auction came to.
    pub auction: AuctionTally,
    /// The agents, by name.
    pub agents: Vec<AgentEvent>,
    /// What each process has used for it, by name.
    #[serde(default)]
    pub usages: BTreeMap<String, JobUsage>,
}

/// How far a machine's promises held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct HeldPromises {
    /// What it promised lately, in seconds; the older, the less it counts.
    promised: f64,
    /// What that took.
    taken: f64,
}

/// What a leader has seen of the agents of its job and of the auction.
#[derive(Debug, Default)]
pub(crate) struct SeenSociety {
    tally: AuctionTally,
    agents: BTreeMap<String, AgentRow>,
    usages: BTreeMap<String, JobUsage>,
    is_news: bool,
}

impl SeenSociety {
    /// One that goes on from what a leader before this one has told.
    pub(crate) fn after(before: Option<Society>) -> Self {
        let Society { auction, usages, .. } = before.unwrap_or_default();
        Self { tally: auction, usages, ..Self::default() }
    }

    pub(crate) fn see_agent(&mut self, row: &AgentRow) {
        self.agents.insert(row.agent.to_string(), row.clone());
        self.is_news = true;
    }

    pub(crate) fn see_round(&mut self, round: &RoundSummary) {
        self.tally.add(round);
        self.is_news = true;
    }

    pub(crate) fn see_theft(&mut self, theft: &Theft) {
        self.tally.add_theft(theft);
        self.is_news = true;
    }

    /// Takes in what the machines that are there have used for a work.
    pub(crate) fn see_usages(&mut self, work: u64, seats: &[Presence]) {
        for seat in seats {
            let Some(usage) = seat.usages.iter().find(|usage| usage.work == work) else { continue };
            let is_known = self.usages.get(&seat.name) == Some(usage);
            if !is_known && (self.usages.len() < AGENTS_TOLD_MAX || self.usages.contains_key(&seat.name)) {
                self.usages.insert(seat.name.clone(), usage.clone());
                self.is_news = true;
            }
        }
    }

    /// Tells the farm what is new.
    pub(crate) fn tell(&mut self, board: &JobBoard, number: u32) {
        if !std::mem::take(&mut self.is_news) {
            return;
        }
        let told = board.put_notice(&society_name(number), &self.view());
        if let Err(error) = told {
            tracing::debug!(%error, "the agents of the job were not told of");
            self.is_news = true;
        }
    }

    /// Keeps how far the promises of the machines held, for the next job.
    pub(crate) fn keep_credits(&self, board: &JobBoard) {
        let mut held: BTreeMap<&str, HeldPromises> = BTreeMap::new();
        for row in self.agents.values().filter(|row| row.credit.taken > 0.0) {
            let machine = held.entry(machine_of(&row.agent.name)).or_default();
            machine.promised += row.credit.promised;
            machine.taken += row.credit.taken;
        }
        for (machine, held) in held {
            if let Err(error) = board.put_notice(&credit_name(machine), &held) {
                tracing::debug!(%error, machine, "its credit was not kept");
            }
        }
    }

    fn view(&self) -> Society {
        let agents = self.agents.values().take(AGENTS_TOLD_MAX).map(|row| AgentEvent::new(row, None)).collect();
        Society { auction: self.tally, agents, usages: self.usages.clone() }
    }
}

impl JobBoard {
    /// The agents of a job, and what its auction came to, as far as its leader has told.
    pub fn society(&self, number: u32) -> Option<Society> {
        self.read_notice(&society_name(number))
    }

    /// How far the promises of machines held in the jobs so far, by machine.
    pub fn credits(&self) -> Arc<BTreeMap<String, Credit>> {
        let credit = |notice: &Notice| {
            let machine = notice.name.strip_prefix(CREDITS)?.to_owned();
            let HeldPromises { promised, taken } = serde_json::from_slice(&notice.text).ok()?;
            let is_sound = [promised, taken].iter().all(|seconds| seconds.is_finite() && *seconds > 0.0);
            is_sound.then_some((machine, Credit { sum: 0.0, promised, taken }))
        };
        Arc::new(self.uplink.notices().all(CREDITS).iter().filter_map(credit).collect())
    }

    /// How far the promises of a machine held in the jobs so far, by its name: 1, when what it promised took as long as it said.
    pub fn reliabilities(&self) -> BTreeMap<String, f64> {
        self.credits().iter().map(|(machine, credit)| (machine.clone(), credit.reliability())).collect()
    }

    /// Forgets the agents of a job.
    pub(crate) fn forget_society(&self, number: u32) {
        if let Err(error) = self.uplink.notices().remove(&society_name(number)) {
            tracing::debug!(%error, "the farm does not answer");
        }
    }
}

fn society_name(number: u32) -> String {
    format!("society/{number}")
}

pub(crate) fn credit_name(machine: &str) -> String {
    format!("{CREDITS}{machine}")
}
