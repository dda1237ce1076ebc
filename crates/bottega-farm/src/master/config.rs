//! The configuration of a Master.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use bottega_agents::AgentId;

use crate::{AuctionRule, Credit, GoalRules, RegistrationConfig, WorkId};

/// The timeouts of the Master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Time for bids; an agent without a bid by then has refused.
    pub bids: Duration,
    /// Interval of the Master's checks, and of the agents' heartbeats.
    pub heartbeat: Duration,
    /// Time without a message after which an agent counts as gone.
    pub lease: Duration,
}

impl Timing {
    /// The timeouts for agents on several machines: with a shorter lease, because machines disappear without notice
    /// more often than processes do.
    pub const AMONG_MACHINES: Self = Self {
        bids: Duration::from_millis(500),
        heartbeat: Duration::from_millis(500),
        lease: Duration::from_millis(2500),
    };
}

impl Default for Timing {
    fn default() -> Self {
        Self { bids: Duration::from_millis(500), heartbeat: Duration::from_secs(1), lease: Duration::from_secs(5) }
    }
}

/// The configuration of a Master: its work, the rule of its auction, and its checks.
#[derive(Clone, Debug)]
pub struct MasterConfig {
    /// The Master's own id.
    pub id: AgentId,
    /// The id of the work.
    pub work: WorkId,
    /// The rule of the auction.
    pub auction: AuctionRule,
    /// Number of zones that an agent works on at once: as [`RenderAgentConfig::prefetch`](crate::RenderAgentConfig::prefetch).
    pub prefetch: u32,
    /// `true`: near the end, zones are cut and zones of slow agents are also given to idle ones. Useful if agents have
    /// machines of their own; agents that share a machine use all its processors anyway.
    pub shares_tail: bool,
    /// Number of agents on different machines whose paintings of a zone must agree; 1: paintings are not compared.
    pub verify: u32,
    /// `true`: the engine is not bit-identical between agents, so paintings are compared by their look.
    pub compares_by_look: bool,
    /// A secret that selects which paintings of believed agents are compared anyway.
    pub secret: u64,
    /// Credit of machines in earlier works, by [name](bottega_agents::machine_of).
    pub credits: Arc<BTreeMap<String, Credit>>,
    /// The rules for goals of error and time.
    pub goals: GoalRules,
    /// The timeouts of rounds, leases and retries.
    pub timing: Timing,
    /// The platform at which the Master registers; `None`: it does not.
    pub registration: Option<RegistrationConfig>,
}

impl MasterConfig {
    /// Returns true if paintings are compared.
    pub(super) fn verifies(&self) -> bool {
        self.verify > 1
    }

    /// Returns true if zones are dealt out and agents take them from one another, instead of auctions.
    pub(super) fn deals(&self) -> bool {
        self.auction == AuctionRule::Stealing
    }
}
