//! The outcome of a simulation.

use std::{collections::BTreeMap, time::Duration};

use super::{Span, TimeLeft};
use crate::{Credit, RelativePower, RoundSummary, Theft};

/// The outcome of a simulation: times, counts and records of agents.
#[derive(Clone, Debug)]
pub struct SimulationOutcome {
    /// Time at which the picture was complete, from the start of the platform.
    pub makespan: Duration,
    /// Lower bound on the time taken, for the painted samples and the agents present, including the survey; `None`: they
    /// cannot finish.
    pub least: Option<Duration>,
    /// Time of the most expensive zone on the fastest machine, in one piece, including the survey.
    pub longest_zone: Duration,
    /// Processor time at speed 1 of all samples in the picture.
    pub work: Duration,
    /// Number of zones.
    pub zones: usize,
    /// Number of zones that were given up.
    pub failed: usize,
    /// Number of zones in the picture that were painted wrong.
    pub wrong: usize,
    /// True if zones ever waited because there were too few machines to compare paintings.
    pub lacked_machines: bool,
    /// Number of messages until the picture was complete.
    pub messages: u64,
    /// Number of films begun: the first, and one more each time that a Master restarted or a composed zone was painted
    /// again.
    pub films: u32,
    /// The rounds of the auction, in the order in which they ended.
    pub rounds: Vec<RoundSummary>,
    /// The thefts, in the order in which they happened.
    pub thefts: Vec<Theft>,
    /// The agents, in the order of the farm.
    pub agents: Vec<AgentOutcome>,
    /// The spans of all agents, in the order of their ends.
    pub spans: Vec<Span>,
    /// Number of spans beyond [`SPANS_MAX`](super::SPANS_MAX), which are not kept.
    pub spans_left_out: u64,
    /// The trace, one line per event, if requested.
    pub trace: String,
    /// The predictions of the remaining time, if requested.
    pub times_left: Vec<TimeLeft>,
}

/// The result of one agent of a simulation: its work, credit and speed.
#[derive(Clone, Debug, PartialEq)]
pub struct AgentOutcome {
    /// The name of the agent.
    pub name: String,
    /// Speed of each of the agent's processors: 1 is the measured machine, 2 is twice as fast.
    pub speed: f64,
    /// The agent's share of the processors of its machine, in processors.
    pub lanes: f64,
    /// Processor time spent, in time of the agent's machine.
    pub busy: Duration,
    /// Number of orders finished.
    pub orders: u32,
    /// The reason why the agent was excluded; `None`: it was not.
    pub left_out: Option<String>,
    /// The agent's credit at the end.
    pub credit: Credit,
    /// V_cp at the end, as known to its Master.
    pub power: RelativePower,
    /// V_cp at the start.
    pub first_power: RelativePower,
}

impl SimulationOutcome {
    /// Returns the credit of the agents, for [`Plan::credits`](super::Plan::credits) of the next work.
    pub fn credits(&self) -> BTreeMap<String, Credit> {
        self.agents.iter().map(|agent| (agent.name.clone(), agent.credit)).collect()
    }

    /// Returns V_cp of the agents, for [`Plan::powers`](super::Plan::powers) of the next work. Agents learn it from
    /// estimates that they themselves have made, so all may drift together: their geometric mean is scaled to that at
    /// the start.
    pub fn powers(&self) -> BTreeMap<String, RelativePower> {
        let drift = |agent: &AgentOutcome| (agent.power.get() / agent.first_power.get()).ln();
        let mean = self.agents.iter().map(drift).sum::<f64>() / self.agents.len().max(1) as f64;
        let power = |agent: &AgentOutcome| RelativePower::new(agent.power.get() / mean.exp());
        self.agents.iter().map(|agent| (agent.name.clone(), power(agent))).collect()
    }

    /// Returns the ratio of the lower bound to the time taken, 0..=1; 0 without a bound.
    pub fn efficiency(&self) -> f64 {
        self.least.map_or(0.0, |least| least.as_secs_f64() / self.makespan.as_secs_f64().max(1e-12))
    }

    /// Returns the largest factor between predicted and actual remaining time, in either direction, over the
    /// predictions made once a share of the work was done; at least 1. Errors below a second, or below a twentieth of
    /// the whole time, count as 1. `None`: there are no such predictions.
    ///
    /// - `from`: share of the cost, 0..1.
    pub fn worst_time_left(&self, from: f64) -> Option<f64> {
        let borne = 1.0_f64.max(self.makespan.as_secs_f64() / 20.0);
        let wrong = |predicted: &TimeLeft| {
            let (said, true_left) =
                (predicted.said.as_secs_f64(), self.makespan.saturating_sub(predicted.at).as_secs_f64());
            let factor = said.max(true_left) / said.min(true_left).max(1e-9);
            if (said - true_left).abs() <= borne { 1.0 } else { factor }
        };
        self.times_left.iter().filter(|predicted| predicted.done >= from).map(wrong).reduce(f64::max)
    }

    /// Returns the number of messages sent, per zone.
    pub fn messages_per_zone(&self) -> f64 {
        self.messages as f64 / self.zones.max(1) as f64
    }
}
