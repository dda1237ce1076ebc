//! The contents of messages between the farm's agents: the ontology `bottega-farm`.

use std::{sync::Arc, time::Duration};

use bottega_agents::{AclMessage, AgentId, Performative, Revision, Time, platform::ManagementContent};

use crate::{Painting, RelativePower, WorkId, WorkRow, ZoneId, ZoneRow};

/// The vocabulary of all messages of this crate.
pub const ONTOLOGY: &str = "bottega-farm";
/// Within one process nothing is encoded.
pub(crate) const LANGUAGE: &str = "bottega-typed";

/// The interaction protocols that the farm speaks.
pub mod protocol {
    /// Zones by auction.
    pub const CONTRACT_NET: &str = "fipa-contract-net";
    /// Profiling, life cycle.
    pub const REQUEST: &str = "fipa-request";
    /// Zones that an agent takes from another.
    pub const STEALING: &str = "bottega-stealing";
    /// Agents at a Master.
    pub const SUBSCRIBE: &str = "fipa-subscribe";
}

/// A zone on offer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offer {
    /// Which.
    pub zone: ZoneId,
    /// Predicted cost in average pixels.
    pub complexity: f64,
    /// T_est, reference-machine time.
    pub time_estimated: Duration,
}

/// The bid of an agent for a zone on offer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bid {
    /// Which.
    pub zone: ZoneId,
    /// How long after now it would be finished if it were the agent's next.
    pub finish: Duration,
}

/// A zone in an agent's hand: a request to profile it, or an award.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// What the zone is part of.
    pub work: Arc<WorkRow>,
    /// The zone as the blackboard has it.
    pub row: Arc<ZoneRow>,
    /// The revision of that row: the fencing token that the result must carry.
    pub fence: Revision,
    /// Whether the agent's own rules decide what the zone is painted with, not those of the agent that profiled it.
    pub decides: bool,
}

/// The result of an order.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Which zone.
    pub zone: ZoneId,
    /// The token of the order.
    pub fence: Revision,
    /// What was painted, or why nothing was.
    pub outcome: Result<Painting, String>,
    /// Which rules decided what it was painted with: see [`Expert::reasons`](crate::Expert::reasons).
    pub reasons: Option<Arc<str>>,
}

/// An order in an agent's hand, as the agent tells of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Holding {
    /// Which zone.
    pub zone: ZoneId,
    /// The token of the order.
    pub fence: Revision,
    /// How far it is; it goes up while it is painted. 0: it is not begun, for what all zones need is not there yet.
    pub progress: u64,
}

/// An order that an agent gives to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassedOrder {
    /// Which zone.
    pub zone: ZoneId,
    /// The token of the order.
    pub fence: Revision,
    /// How much of the zone the giver keeps, if it can be cut, 0..1; 0: nothing.
    pub kept: f64,
}

/// The operations that each agent has (MAGarRO, section 3.1; FIPA00023).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LifeCycle {
    /// Takes no new zones. Those in hand are finished.
    Suspend,
    /// Takes zones again.
    Resume,
    /// Ends.
    Terminate,
}

/// The content of a message.
#[derive(Clone, Debug, PartialEq)]
pub enum FarmContent {
    /// *subscribe*: an agent and what its benchmark said.
    Subscription {
        /// V_cp.
        power: RelativePower,
        /// Processors that work on its zones at once.
        lanes: f64,
    },
    /// *agree*: the Master has the agent on its list.
    Subscribed,
    /// *cancel*: the agent leaves the Master.
    Unsubscription,
    /// *inform*: there is a scene to paint.
    Scene(Arc<WorkRow>),
    /// *inform*: the Analyst has put the zones on the blackboard.
    Analyzed(WorkId),
    /// *request*: render the first samples of a zone.
    Profile(Order),
    /// *cfp*: these zones are to be had.
    Offers(Arc<[Offer]>),
    /// *propose*: the agent has room for so many zones, and would finish each at such a time.
    Bids {
        /// Zones that it has room for.
        room: u32,
        /// One for each zone that it wants.
        bids: Vec<Bid>,
    },
    /// *accept-proposal*: paint this zone.
    Award(Order),
    /// *inform* when it was painted, *failure* when not. Shared, for it is kept until it is answered.
    Report(Arc<Report>),
    /// *confirm*: the report of this order is on the blackboard.
    Received {
        /// Which zone.
        zone: ZoneId,
        /// The token of the order.
        fence: Revision,
    },
    /// *disconfirm*: the report of this order is not wanted.
    Refused {
        /// Which zone.
        zone: ZoneId,
        /// The token of the order.
        fence: Revision,
        /// Why not.
        reason: String,
    },
    /// *cancel*: another agent has painted this zone; this order is void.
    Withdrawn {
        /// Which zone.
        zone: ZoneId,
        /// The token of the order.
        fence: Revision,
    },
    /// *inform*: the agent lives, has V_cp `power` and these orders in hand.
    Alive {
        /// V_cp.
        power: RelativePower,
        /// Its orders.
        hands: Vec<Holding>,
    },
    /// *refuse*: the Master does not call this agent any more, and takes nothing from it.
    LeftOut {
        /// Why not.
        reason: String,
    },
    /// *inform*: the agents that this one may take zones from.
    Neighbors(Vec<AgentId>),
    /// *request* to a neighbor: the agent has nothing that waits, and would take what waits in the neighbor's hand.
    Steal {
        /// Its own time for a second of the reference machine's, all its processors together.
        own: f64,
        /// When it will have painted what it has in hand, from now.
        load: Duration,
    },
    /// *agree*: so many zones that waited are the asking agent's, once the Master has said so.
    Yielded(u32),
    /// *inform* to the Master: the agent gives these orders, of which it has begun none, to another.
    HandedOver {
        /// To whom.
        to: AgentId,
        /// What it gives.
        orders: Vec<PassedOrder>,
    },
    /// *request*: suspend, resume, terminate.
    LifeCycle(LifeCycle),
    /// Nothing but the performative: *refuse*, *reject-proposal*, *not-understood*.
    Nothing,
    /// To and from the services of the platform. It stays within the process.
    Management(Arc<ManagementContent>),
}

/// A message of the farm.
pub type FarmMessage = AclMessage<FarmContent>;

/// A message that begins a conversation.
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

/// The same message in a conversation whose answers count until `reply_by`.
pub(crate) fn asking(message: FarmMessage, conversation_id: u64, reply_by: Option<Time>) -> FarmMessage {
    AclMessage { conversation_id, reply_with: conversation_id, reply_by, ..message }
}

/// The answer to a message, in its conversation.
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
