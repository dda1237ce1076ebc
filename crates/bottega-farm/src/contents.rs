//! Contents of the messages between the farm's agents: the ontology `bottega-farm`.

use std::{sync::Arc, time::Duration};

use bottega_agents::{AclMessage, AgentId, Performative, Revision, Time, platform::ManagementContent};

use crate::{Painting, RelativePower, WorkId, WorkRow, ZoneId, ZoneRow};

/// The ontology of all messages of this crate.
pub const ONTOLOGY: &str = "bottega-farm";
/// The language of messages within one process, which are not encoded.
pub(crate) const LANGUAGE: &str = "bottega-typed";

/// The interaction protocols of the farm.
pub mod protocol {
    /// The protocol of the auctions of zones.
    pub const CONTRACT_NET: &str = "fipa-contract-net";
    /// The protocol of profiling and of the life cycle of agents.
    pub const REQUEST: &str = "fipa-request";
    /// The protocol of the transfer of waiting zones from one agent to another.
    pub const STEALING: &str = "bottega-stealing";
    /// The protocol of the registration of agents with a Master.
    pub const SUBSCRIBE: &str = "fipa-subscribe";
}

/// A zone on offer in a round of the auction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offer {
    /// The id of the zone.
    pub zone: ZoneId,
    /// Predicted cost of the zone's pixels, in average pixels of the frame.
    pub complexity: f64,
    /// T_est, in reference-machine time.
    pub time_estimated: Duration,
}

/// The bid of an agent for a zone on offer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bid {
    /// The id of the zone.
    pub zone: ZoneId,
    /// Time from the bid until the agent finishes the zone, if it is the agent's next zone.
    pub finish: Duration,
}

/// An order to an agent: a request to profile a zone, or an award.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// The row of the work.
    pub work: Arc<WorkRow>,
    /// The row of the zone on the Blackboard.
    pub row: Arc<ZoneRow>,
    /// The revision of the zone's row: the fencing token, which the result must carry.
    pub fence: Revision,
    /// `true`: the agent's own rules choose the settings of the zone, not those of the agent that profiled it.
    pub decides: bool,
}

/// The report of an agent on an order: the painting, or the error.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The id of the zone.
    pub zone: ZoneId,
    /// The fencing token of the order.
    pub fence: Revision,
    /// The painting; or the error, as text for the user.
    pub outcome: Result<Painting, String>,
    /// The rules that chose the settings: see [`Expert::reasons`](crate::Expert::reasons). `None`: the agent's rules
    /// did not choose them, or optimization is off.
    pub reasons: Option<Arc<str>>,
}

/// An order that an agent holds, as its heartbeat reports it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Holding {
    /// The id of the zone.
    pub zone: ZoneId,
    /// The fencing token of the order.
    pub fence: Revision,
    /// Progress: 1 plus the number of painted samples, summed over the pixels, as last queried. 0: not begun, because
    /// the order waits for others, or preparation for all zones is not finished; `u64::MAX`: reported.
    pub progress: u64,
}

/// An order that an agent hands over to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassedOrder {
    /// The id of the zone.
    pub zone: ZoneId,
    /// The fencing token of the order.
    pub fence: Revision,
    /// The share of the zone that the giver keeps, 0..1; 0: nothing. A zone that cannot be cut is handed over as a
    /// whole if the share is at most 0.5, and stays with the giver otherwise.
    pub kept: f64,
}

/// A life-cycle operation that a Master requests of its Render Agents (MAGarRO, section 3.1; FIPA00023).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LifeCycle {
    /// Take no new zones, but finish those in hand.
    Suspend,
    /// Take zones again.
    Resume,
    /// End at once.
    Terminate,
}

/// The content of a message between agents of the farm.
#[derive(Clone, Debug, PartialEq)]
pub enum FarmContent {
    /// *subscribe*: an agent registers, with the results of its benchmark.
    Subscription {
        /// V_cp: the relative power of the agent; 1 is the reference machine, 0.5 is twice as fast.
        power: RelativePower,
        /// Number of processors that work on the agent's zones at once.
        lanes: f64,
    },
    /// *agree*: the Master has added the agent to its list.
    Subscribed,
    /// *cancel*: the agent leaves the Master.
    Unsubscription,
    /// *inform*: there is a scene to paint.
    Scene(Arc<WorkRow>),
    /// *inform*: the Analyst has written the zones to the Blackboard.
    Analyzed(WorkId),
    /// *request*: paint the first samples of a zone.
    Profile(Order),
    /// *cfp*: these zones are on offer.
    Offers(Arc<[Offer]>),
    /// *propose*: the agent's bids.
    Bids {
        /// The number of zones that the agent has room for.
        room: u32,
        /// One bid per zone that the agent wants.
        bids: Vec<Bid>,
    },
    /// *accept-proposal*: paint this zone.
    Award(Order),
    /// *inform* after success, *failure* otherwise. Shared, because it is kept until it is confirmed.
    Report(Arc<Report>),
    /// *confirm*: the report of this order is on the Blackboard.
    Received {
        /// The id of the zone.
        zone: ZoneId,
        /// The fencing token of the order.
        fence: Revision,
    },
    /// *disconfirm*: the report of this order is rejected.
    Refused {
        /// The id of the zone.
        zone: ZoneId,
        /// The fencing token of the order.
        fence: Revision,
        /// The reason, as text for the user.
        reason: String,
    },
    /// *cancel*: the order is void, because another agent has painted the zone, or the order made no progress for too
    /// long.
    Withdrawn {
        /// The id of the zone.
        zone: ZoneId,
        /// The fencing token of the order.
        fence: Revision,
    },
    /// *inform*: the heartbeat of an agent.
    Alive {
        /// V_cp: the relative power of the agent; 1 is the reference machine, 0.5 is twice as fast.
        power: RelativePower,
        /// The orders that the agent holds.
        orders: Vec<Holding>,
    },
    /// *refuse*: the Master no longer calls this agent and accepts nothing from it.
    LeftOut {
        /// The reason, as text for the user.
        reason: String,
    },
    /// *inform*: the agents from which the receiver may take zones.
    Neighbors(Vec<AgentId>),
    /// *request* to a neighbor: the sender has no waiting zones and asks for some of the neighbor's.
    Steal {
        /// Seconds that all processors of the sender together need for one second of work of the reference machine.
        own: f64,
        /// Time until the sender has painted what it holds.
        load: Duration,
    },
    /// *agree*: the number of waiting zones that the sender gives; they change hands when the Master confirms it.
    Yielded(u32),
    /// *inform* to the Master: the sender hands these orders, none of them begun, to another agent.
    HandedOver {
        /// The name of the receiver.
        to: AgentId,
        /// The orders handed over.
        orders: Vec<PassedOrder>,
    },
    /// *request*: suspend, resume, terminate.
    LifeCycle(LifeCycle),
    /// No content, because the performative says all: *refuse*, *reject-proposal*, *not-understood*.
    Nothing,
    /// A message to or from the platform's services; never leaves the process.
    Management(Arc<ManagementContent>),
}

/// A message between agents of the farm.
pub type FarmMessage = AclMessage<FarmContent>;

/// Returns a message outside any conversation.
pub(crate) fn message(
    performative: Performative,
    protocol: &'static str,
    sender: &AgentId,
    receivers: Vec<AgentId>,
    content: FarmContent,
) -> FarmMessage {
    AclMessage {
        performative,
        sender: sender.clone(),
        receivers,
        content,
        language: LANGUAGE,
        ontology: ONTOLOGY,
        protocol,
        conversation_id: 0,
        reply_with: 0,
        in_reply_to: 0,
        reply_by: None,
    }
}

/// Returns the message as the start of a conversation whose replies are accepted until `reply_by`.
pub(crate) fn asking(message: FarmMessage, conversation_id: u64, reply_by: Option<Time>) -> FarmMessage {
    AclMessage { conversation_id, reply_with: conversation_id, reply_by, ..message }
}

/// Returns the reply to a message, in its conversation.
pub(crate) fn answer(
    to: &FarmMessage,
    sender: &AgentId,
    performative: Performative,
    content: FarmContent,
) -> FarmMessage {
    AclMessage {
        conversation_id: to.conversation_id,
        in_reply_to: to.reply_with,
        ..message(performative, to.protocol, sender, vec![to.sender.clone()], content)
    }
}
