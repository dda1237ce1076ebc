//! The Visitor: a Render Agent whose painter is an agent of another platform, with any engine.
//!
//! It holds the conversation with the Master like other agents: heartbeats, repeated reports, V_cp adapted to measured
//! times. Calls for proposals and paint orders are passed to the visitor ([`VisitorEffect`]), which replies with a
//! [`VisitorReport`].

use std::{sync::Arc, time::Duration};

use bottega_agents::{Action, ActionOf, AgentId, Event, EventOf, Performative, Revision, StateMachine, Time};
use rustc_hash::FxHashMap;

use crate::{
    AdaptationRule, AuctionRule, Bid, Expert, FarmCompletion, FarmContent, FarmEffect, FarmMessage, FarmValue,
    MasterSource, Offer, PaintOrder, PaintResult, RelativePower, RenderAgent, RenderAgentConfig, ResultRef, Timing,
    WorkRow, ZoneId,
    contents::{answer, message},
    protocol,
};

/// Number of orders that a visitor holds at once: while it paints one zone, the next order has already arrived. Further
/// orders wait in its Render Agent.
const PREFETCH: u32 = 2;
/// Maximum number of unanswered calls for proposals; older ones are refused in its name.
const CALLS_MAX: usize = 16;

/// A message to a visitor.
#[derive(Clone, Debug)]
pub enum VisitorEffect {
    /// The Master has admitted the visitor to this work.
    Welcome(Box<WorkRow>),
    /// Zones on offer: answered by [`VisitorReport::Bids`] or [`VisitorReport::Refuses`] with the same call.
    Offers {
        /// The id of the call.
        call: u64,
        /// The offered zones.
        offers: Arc<[Offer]>,
        /// The number of zones that the visitor may win.
        room: u32,
        /// Time until the deadline of the answer.
        within: Duration,
    },
    /// The Master awarded the zones of this call to others.
    Rejected {
        /// The id of the call.
        call: u64,
    },
    /// An order to paint, answered by [`VisitorReport::Painted`].
    Paint {
        /// The order to pass to the visitor.
        order: Box<PaintOrder>,
        /// The call in which the zone was won; `None`: first samples of a zone.
        call: Option<u64>,
    },
    /// The order is cancelled; its result is ignored.
    Withdrawn {
        /// The id of the zone.
        zone: ZoneId,
        /// The fencing token of the order.
        fence: Revision,
    },
    /// The Master has excluded this visitor.
    LeftOut {
        /// The reason, as text for the user.
        reason: String,
    },
}

/// A message from a visitor.
#[derive(Clone, Debug)]
pub enum VisitorReport {
    /// Bids for zones of a call.
    Bids {
        /// The id of the call.
        call: u64,
        /// The maximum number of zones that the visitor wants.
        room: u32,
        /// One bid per zone that the visitor wants.
        bids: Vec<Bid>,
    },
    /// The visitor wants none of the zones of a call.
    Refuses {
        /// The id of the call.
        call: u64,
    },
    /// The result of an order; ignored if the order was cancelled meanwhile.
    Painted {
        /// The id of the zone.
        zone: ZoneId,
        /// The fencing token of the order.
        fence: Revision,
        /// The samples and the visitor's own time for them; or the error, as text.
        outcome: Result<(ResultRef, Duration), String>,
    },
    /// The visitor leaves; its zones are given to others.
    Leaves,
    /// The visitor is back after [`Self::Leaves`] and takes zones again.
    Returns,
}

/// The configuration of a visitor: its Master, its claimed speed, and its rules.
#[derive(Clone, Debug)]
pub struct VisitorConfig {
    /// The visitor's id in the farm.
    pub id: AgentId,
    /// The id of the Master.
    pub master: AgentId,
    /// The V_cp that the visitor claims; corrected by measured times.
    pub power: RelativePower,
    /// Number of zones that the visitor paints at once.
    pub lanes: f64,
    /// The rule that adapts V_cp.
    pub adaptation: AdaptationRule,
    /// The rules that choose the settings of its zones.
    pub expert: Expert,
    /// Heartbeat and other timeouts.
    pub timing: Timing,
}

/// The state machine that negotiates with the Master in place of a visitor.
pub struct Visitor {
    agent: RenderAgent,
    id: AgentId,
    master: AgentId,
    benchmark: (RelativePower, f64),
    /// Unanswered calls, the oldest first.
    calls: Vec<FarmMessage>,
    /// The number of samples per pixel to which each of its orders goes. A hash map for speed; never iterated.
    orders: FxHashMap<ZoneId, (Revision, u32)>,
    /// `true`: the visitor has painted something since it came. The first zone's time may include reading the scene or
    /// compiling.
    is_warm: bool,
    /// The call in which each of its zones was won. A hash map for speed; never iterated.
    won: FxHashMap<ZoneId, u64>,
    is_away: bool,
}

type VisitorActions = Vec<ActionOf<Visitor>>;

impl Visitor {
    /// Makes a visitor that has not joined its Master yet.
    pub fn new(config: VisitorConfig) -> Self {
        let VisitorConfig { id, master, power, lanes, adaptation, expert, timing } = config;
        let agent = RenderAgent::new(RenderAgentConfig {
            id: id.clone(),
            master: MasterSource::Known(master.clone()),
            adaptation,
            prefetch: PREFETCH,
            auction: AuctionRule::default(),
            heartbeat: timing.heartbeat,
            expert,
            knowledge: crate::Foreknowledge::default(),
        });
        Self {
            agent,
            id,
            master,
            benchmark: (power, lanes),
            calls: Vec::new(),
            orders: FxHashMap::default(),
            is_warm: false,
            won: FxHashMap::default(),
            is_away: false,
        }
    }

    /// Passes an event to the Render Agent and executes its actions.
    fn forward(&mut self, now: Time, event: EventOf<RenderAgent>, actions: &mut VisitorActions) {
        let mut events = vec![event];
        while let Some(event) = events.pop() {
            let mut wanted = Vec::new();
            self.agent.handle(now, event, &mut wanted);
            for action in wanted {
                match action {
                    Action::Effect(effect) => events.extend(self.perform(effect, actions).map(Event::Completed)),
                    Action::Send(message) => actions.push(Action::Send(message)),
                    Action::Stop => actions.push(Action::Stop),
                    // A Render Agent has none of these
                    Action::Store { .. } | Action::Enqueue { .. } | Action::JoinQueue(_) | Action::WatchPresence => {}
                }
            }
        }
    }

    /// Executes an effect: passes it to the visitor, or returns its completion at once.
    fn perform(&mut self, effect: FarmEffect, actions: &mut VisitorActions) -> Option<FarmCompletion> {
        let mut put = |effect| actions.push(Action::Effect(effect));
        match effect {
            FarmEffect::Benchmark => {
                let (power, lanes) = self.benchmark;
                return Some(FarmCompletion::Benchmarked { power, lanes });
            }
            // The visitor fetches what it needs itself
            FarmEffect::Fetch(work) => return Some(FarmCompletion::Fetched(work)),
            FarmEffect::Paint(order) => {
                // Paint from the first sample: another engine must not continue samples of this one, which may be of
                // other pixels
                let order = PaintOrder { samples: 0..order.samples.end, from: None, ..order };
                self.orders.insert(order.zone, (order.fence, order.samples.end));
                let call = self.won.remove(&order.zone);
                put(VisitorEffect::Paint { order: Box::new(order), call });
            }
            FarmEffect::Drop { zone, fence } => {
                self.orders.remove(&zone);
                put(VisitorEffect::Withdrawn { zone, fence });
            }
            // A visitor does not report progress, so it must deliver within the Master's patience
            FarmEffect::Look(_) => {}
            FarmEffect::Dismissed { reason } => put(VisitorEffect::LeftOut { reason }),
            _ => {}
        }
        None
    }

    fn hear(&mut self, now: Time, heard: FarmMessage, actions: &mut VisitorActions) {
        match (heard.performative, &heard.content) {
            // The Render Agent replies that it does not understand
            _ if heard.sender != self.master => self.forward(now, Event::Message(heard), actions),
            (Performative::CallForProposal, FarmContent::Offers(offers)) => {
                let room = self.agent.room();
                let within = heard.reply_by.map_or(Duration::ZERO, |by| by.since(now));
                if self.is_away || room == 0 || offers.is_empty() || within.is_zero() {
                    return self.answer(&heard, Performative::Refuse, FarmContent::Nothing, actions);
                }
                let (call, offers) = (heard.conversation_id, Arc::clone(offers));
                actions.push(Action::Effect(VisitorEffect::Offers { call, offers, room, within }));
                self.calls.push(heard);
                if self.calls.len() > CALLS_MAX {
                    let old = self.calls.remove(0);
                    self.answer(&old, Performative::Refuse, FarmContent::Nothing, actions);
                }
            }
            (Performative::RejectProposal, _) => {
                actions.push(Action::Effect(VisitorEffect::Rejected { call: heard.conversation_id }));
            }
            _ if self.is_away => {}
            (Performative::Inform, FarmContent::Scene(work)) => {
                actions.push(Action::Effect(VisitorEffect::Welcome(Box::new((**work).clone()))));
                self.forward(now, Event::Message(heard), actions);
            }
            (Performative::AcceptProposal, FarmContent::Award(order)) => {
                self.won.insert(order.row.zone, heard.conversation_id);
                self.forward(now, Event::Message(heard), actions);
            }
            _ => self.forward(now, Event::Message(heard), actions),
        }
    }

    fn handle_report(&mut self, now: Time, report: VisitorReport, actions: &mut VisitorActions) {
        match report {
            VisitorReport::Bids { call, room, bids } => {
                if let Some(call) = self.take_call(call) {
                    let room = room.min(self.agent.room());
                    self.answer(&call, Performative::Propose, FarmContent::Bids { room, bids }, actions);
                }
            }
            VisitorReport::Refuses { call } => {
                if let Some(call) = self.take_call(call) {
                    self.answer(&call, Performative::Refuse, FarmContent::Nothing, actions);
                }
            }
            VisitorReport::Painted { zone, fence, outcome } => {
                let samples = self.orders.get(&zone).filter(|(other, _)| *other == fence).map(|(_, samples)| *samples);
                let Some(samples) = samples else { return };
                self.orders.remove(&zone);
                let is_measured = self.is_warm;
                self.is_warm |= outcome.is_ok();
                let outcome = outcome.map(|(result, busy)| PaintResult {
                    result: ResultRef { fence, samples, ..result },
                    busy,
                    is_measured,
                    error: None,
                    unfinished: 1.0,
                });
                self.forward(now, Event::Completed(FarmCompletion::Painted { zone, fence, outcome }), actions);
            }
            VisitorReport::Leaves => {
                (self.is_away, self.is_warm) = (true, false);
                self.calls.clear();
                self.orders.clear();
                self.won.clear();
                self.agent.forget_master();
                let (me, to) = (&self.id, vec![self.master.clone()]);
                let bye = message(Performative::Cancel, protocol::SUBSCRIBE, me, to, FarmContent::Unsubscription);
                actions.push(Action::Send(bye));
            }
            VisitorReport::Returns => self.is_away = false,
        }
    }

    fn take_call(&mut self, call: u64) -> Option<FarmMessage> {
        let place = self.calls.iter().position(|message| message.conversation_id == call)?;
        Some(self.calls.remove(place))
    }

    fn answer(&self, to: &FarmMessage, act: Performative, content: FarmContent, actions: &mut VisitorActions) {
        actions.push(Action::Send(answer(to, &self.id, act, content)));
    }
}

impl StateMachine for Visitor {
    type Content = FarmContent;
    type Value = FarmValue;
    type Effect = VisitorEffect;
    type Completion = VisitorReport;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut VisitorActions) {
        match event {
            Event::Start => self.forward(now, Event::Start, actions),
            Event::Message(message) => self.hear(now, message, actions),
            Event::Completed(report) => self.handle_report(now, report, actions),
            Event::Deadline if self.is_away => {}
            Event::Deadline => self.forward(now, Event::Deadline, actions),
            Event::Store { .. } | Event::Presence { .. } => {}
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        self.agent.next_deadline().filter(|_| !self.is_away)
    }
}

#[cfg(test)]
mod tests {
    use bottega_agents::AclMessage;
    use bottega_engines::Tunables;
    use bottega_image::Rect;

    use super::*;
    use crate::{
        Choice, Goal, InputRanges, NeighborDifference, Optimization, Order, WorkId, WorkSettings, ZoneRow, ZoneState,
        contents::asking,
    };

    fn after(visitor: &mut Visitor, event: EventOf<Visitor>) -> Vec<VisitorEffect> {
        let mut actions = Vec::new();
        visitor.handle(Time::ZERO, event, &mut actions);
        let effect = |action| match action {
            Action::Effect(effect) => Some(effect),
            _ => None,
        };
        actions.into_iter().filter_map(effect).collect()
    }

    fn work() -> WorkRow {
        let frame = Rect::of_size(16, 16);
        let settings = WorkSettings {
            picture: frame,
            frame,
            samples: 4,
            goal: Goal::Samples,
            tunables: Tunables { max_depth: 8, light_samples: 1 },
            optimization: Optimization::Off,
        };
        WorkRow {
            work: WorkId(1),
            settings,
            zone_count: 4,
            ranges: InputRanges::of(Vec::<ZoneRow>::new()),
            features: crate::TaskFeatures::default(),
        }
    }

    #[test]
    fn who_comes_back_has_nothing_in_hand_and_is_called_again() {
        let (id, master) = (AgentId::new("py@stranger-studio"), AgentId::new("master@work-1"));
        let says = |act, content| {
            let said = message(act, protocol::CONTRACT_NET, &master, vec![id.clone()], content);
            Event::Message(AclMessage { reply_by: Some(Time::ZERO + Duration::from_secs(1)), ..asking(said, 7, None) })
        };
        let mut visitor = Visitor::new(VisitorConfig {
            id: id.clone(),
            master: master.clone(),
            power: RelativePower::REFERENCE,
            lanes: 1.0,
            adaptation: AdaptationRule::MedianRatio,
            expert: Expert::path_tracing(),
            timing: Timing::AMONG_MACHINES,
        });
        after(&mut visitor, Event::Start);
        after(&mut visitor, says(Performative::Agree, FarmContent::Subscribed));
        let call = || {
            let offer = Offer { zone: ZoneId(3), complexity: 1.0, time_estimated: Duration::from_secs(1) };
            says(Performative::CallForProposal, FarmContent::Offers([offer].into()))
        };
        let is_called = |effects: &[VisitorEffect]| matches!(effects, [VisitorEffect::Offers { call: 7, .. }]);
        let hand = AuctionRule::default().window(PREFETCH);
        for zone in 0..hand {
            let row = ZoneRow {
                state: ZoneState::Awarded,
                choice: Some(Choice::unchanged(&work().settings)),
                ..ZoneRow::open(WorkId(1), ZoneId(zone), Rect::of_size(8, 8), 1.0, NeighborDifference::default())
            };
            let fence = Revision(u64::from(zone) + 1);
            let order = Order { work: Arc::new(work()), row: Arc::new(row), fence, decides: false };
            let effects = after(&mut visitor, says(Performative::AcceptProposal, FarmContent::Award(order)));
            let is_begun = matches!(&effects[..], [VisitorEffect::Paint { call: Some(7), .. }]);
            assert_eq!(is_begun, zone < PREFETCH, "the others wait: {effects:?}");
        }
        assert!(!is_called(&after(&mut visitor, call())), "its hands are full");
        after(&mut visitor, Event::Completed(VisitorReport::Leaves));
        assert!(!is_called(&after(&mut visitor, call())), "it is away");
        after(&mut visitor, Event::Completed(VisitorReport::Returns));
        assert!(is_called(&after(&mut visitor, call())));
    }
}
