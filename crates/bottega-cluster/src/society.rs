//! The agents of a job and its auction, as its leader tells of them; and how far the promises of machines held.
//!
//! - `society/N`: the agents of a job, and what its auction came to; kept until the job is removed.
//! - `credit/MACHINE`: how far a machine's promises held in the jobs so far. Whoever leads the next job reads it.

use std::{collections::BTreeMap, sync::Arc};

use bottega_agents::driver::nats::Notice;
use bottega_farm::{AgentRow, AuctionTally, Credit, RoundSummary, home};
use serde::{Deserialize, Serialize};

use crate::job_board::JobBoard;

/// How the names of all notices of credits begin.
const CREDITS: &str = "credit/";
/// Agents that are told of at most.
const AGENTS_TOLD_MAX: usize = 256;

/// The agents of a job, and what its auction came to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Society {
    /// Rounds of the auction.
    pub rounds: u64,
    /// Of them those with several bidders.
    pub contested: u64,
    /// Of them those that would have been otherwise if all had been believed alike.
    pub credit_decided: u64,
    /// Agents that made a proposal, all rounds together.
    pub bidders: u64,
    /// Bids for single zones, all rounds together.
    pub bids: u64,
    /// Zones, or parts of zones, that were given away.
    pub awards: u64,
    /// The agents, by name.
    pub agents: Vec<AgentView>,
}

/// An agent as others are told of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AgentView {
    /// Its name.
    pub agent: String,
    /// V_cp.
    pub power: f64,
    /// Processors that work on its zones at once.
    pub lanes: f64,
    /// Its credit, in seconds of reference-machine time.
    pub credit: f64,
    /// How far its promises held lately.
    pub reliability: f64,
    /// Why it is left out, if it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out: Option<String>,
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
    is_news: bool,
}

impl SeenSociety {
    pub(crate) fn see_agent(&mut self, row: &AgentRow) {
        self.agents.insert(row.agent.to_string(), row.clone());
        self.is_news = true;
    }

    pub(crate) fn see_round(&mut self, round: &RoundSummary) {
        self.tally.add(round);
        self.is_news = true;
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
            let machine = held.entry(home(&row.agent)).or_default();
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
        let AuctionTally { rounds, contested, credit_decided, bidders, bids, awards } = self.tally;
        let agents = self.agents.values().take(AGENTS_TOLD_MAX).map(AgentView::from).collect();
        Society { rounds, contested, credit_decided, bidders, bids, awards, agents }
    }
}

impl From<&AgentRow> for AgentView {
    fn from(row: &AgentRow) -> Self {
        Self {
            agent: row.agent.to_string(),
            power: row.power.get(),
            lanes: row.lanes,
            credit: row.credit.sum,
            reliability: row.credit.reliability(),
            left_out: row.left_out.clone(),
        }
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

fn credit_name(machine: &str) -> String {
    format!("{CREDITS}{machine}")
}
