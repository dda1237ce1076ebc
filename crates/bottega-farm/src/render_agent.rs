//! The Render Agent: runs its benchmark, bids for zones, chooses their settings by its rules, and has them painted.

mod hand;
mod membership;
mod stealing;
mod thief;

use std::{sync::Arc, time::Duration};

use bottega_agents::{AclMessage, AgentId, Performative, Revision, StateMachine, Time};
use rustc_hash::FxHashMap;

use self::{hand::ZoneInHand, thief::Thief};
use crate::{
    Adaptation, AdaptationRule, Bid, Expert, FarmAction, FarmCompletion, FarmContent, FarmEffect, FarmEvent,
    FarmMessage, Foreknowledge, Holding, LifeCycle, Offer, Order, PaintResult, Painting, RelativePower, Report,
    WorkRow, ZoneId, ZoneState,
    adaptation::scaled,
    contents::{answer, asking, message},
    protocol,
    registrant::{MasterSource, Registrant},
    short_map::ShortMap,
};

/// Age of an order from which its progress is queried: most orders are done earlier.
const LOOK_AFTER: Duration = Duration::from_secs(5);

/// The configuration of a Render Agent.
#[derive(Clone, Debug)]
pub struct RenderAgentConfig {
    /// The agent's own id.
    pub id: AgentId,
    /// The way to find its Master.
    pub master: MasterSource,
    /// The rule that adapts V_cp.
    pub adaptation: AdaptationRule,
    /// The agent bids while it holds fewer zones than this: with 2, the next zone is there before the present one ends,
    /// and no core idles.
    pub prefetch: u32,
    /// `true`: zones are dealt to the agent, which begins them one after the other and takes zones from its neighbors
    /// when it has none: see [`AuctionRule::Stealing`](crate::AuctionRule::Stealing).
    pub steals: bool,
    /// Interval of heartbeats and of repeated reports.
    pub heartbeat: Duration,
    /// The rules that choose the settings of zones.
    pub expert: Expert,
    /// V_cp learned by its machine in earlier works.
    pub knowledge: Foreknowledge,
}

/// A report without a reply.
#[derive(Clone, Debug)]
struct Unanswered {
    report: Arc<Report>,
    conversation: u64,
    /// The time at which it was made.
    since: Time,
}

/// The state machine of one Render Agent.
#[derive(Clone, Debug)]
pub struct RenderAgent {
    config: RenderAgentConfig,
    /// Its Master; `None` until it is found.
    master: Option<AgentId>,
    /// The registration at the directories, if there are any.
    registrant: Option<Box<Registrant>>,
    /// Suspended by the AMS: it has left its Master.
    is_suspended: bool,
    /// V_cp; `None` until the benchmark is done.
    adaptation: Option<Adaptation>,
    lanes: f64,
    subscribed: bool,
    /// Suspended by its Master.
    suspended: bool,
    /// Excluded by its Master.
    left_out: bool,
    work: Option<WorkRow>,
    fetched: bool,
    hands: ShortMap<ZoneInHand>,
    /// Reports that the Master has not answered.
    unanswered: ShortMap<Unanswered>,
    /// The newest fencing token of each zone that is neither held nor unanswered, so that late or duplicated orders are
    /// ignored. A hash map for speed; never iterated.
    past: FxHashMap<ZoneId, Revision>,
    next_heartbeat: Option<Time>,
    /// Time since which it works on the first zone that it holds.
    since: Time,
    thief: Thief,
}

impl RenderAgent {
    /// A new agent.
    pub fn new(config: RenderAgentConfig) -> Self {
        let (master, registrant) = config.master.of(&config.id);
        Self {
            config,
            master,
            registrant,
            is_suspended: false,
            adaptation: None,
            lanes: 1.0,
            subscribed: false,
            suspended: false,
            left_out: false,
            work: None,
            fetched: false,
            hands: ShortMap::default(),
            unanswered: ShortMap::default(),
            past: FxHashMap::default(),
            next_heartbeat: None,
            since: Time::ZERO,
            thief: Thief::default(),
        }
    }

    /// The current V_cp.
    pub fn power(&self) -> RelativePower {
        self.adaptation.as_ref().map_or(RelativePower::REFERENCE, Adaptation::power)
    }

    /// True if it is subscribed and willing, and holds nothing.
    pub(crate) fn is_free(&self) -> bool {
        self.subscribed && !self.left_out && self.hands.is_empty() && self.unanswered.is_empty() && self.room() > 0
    }

    /// The zones that it holds, with the fencing tokens of their orders.
    pub fn hands(&self) -> impl Iterator<Item = (ZoneId, Revision)> {
        self.hands.iter().map(|(zone, hand)| (zone, hand.order.fence))
    }

    fn handle_message(&mut self, now: Time, message: &FarmMessage, actions: &mut Vec<FarmAction>) {
        if let FarmContent::Management(_) = message.content {
            return self.hear_directories(now, message, actions);
        }
        if self.config.steals && message.protocol == protocol::STEALING {
            return self.hear_neighbor(now, message, actions);
        }
        if self.master.as_ref() != Some(&message.sender) {
            // Only the Master may send orders and end the work
            if message.performative != Performative::NotUnderstood {
                self.answer(message, Performative::NotUnderstood, FarmContent::Nothing, actions);
            }
            return;
        }
        if self.is_suspended && self.says_goodbye(message, actions) {
            return;
        }
        match (message.performative, &message.content) {
            (Performative::Agree, FarmContent::Subscribed) => (self.subscribed, self.left_out) = (true, false),
            (Performative::Refuse, FarmContent::LeftOut { reason }) => self.dismissed(reason, actions),
            // The Master does not know this agent (any more)
            (Performative::Refuse, FarmContent::Nothing) => {
                if std::mem::replace(&mut self.subscribed, false) {
                    self.seek_master(now, actions);
                }
            }
            (Performative::Inform, FarmContent::Scene(work)) => self.get_scene(work, actions),
            (Performative::Inform, FarmContent::Neighbors(agents)) => self.thief.meet(&self.config.id, agents),
            (Performative::CallForProposal, FarmContent::Offers(offers)) => self.propose(now, message, offers, actions),
            (Performative::Request, FarmContent::Profile(order))
            | (Performative::AcceptProposal, FarmContent::Award(order)) => self.take(now, message, order, actions),
            (Performative::Confirm, FarmContent::Received { zone, fence }) => _ = self.answered(*zone, *fence),
            (Performative::Disconfirm, FarmContent::Refused { zone, fence, .. }) => {
                if self.answered(*zone, *fence) {
                    // If the order comes again, the Master wants the zone after all
                    self.past.remove(zone);
                }
            }
            (Performative::Cancel, FarmContent::Withdrawn { zone, fence }) => self.drop_order(*zone, *fence, actions),
            (Performative::Request, FarmContent::LifeCycle(change)) => match change {
                LifeCycle::Suspend => self.suspended = true,
                LifeCycle::Resume => self.suspended = false,
                LifeCycle::Terminate => self.leave(actions),
            },
            (Performative::RejectProposal | Performative::NotUnderstood, _) => {}
            _ => self.answer(message, Performative::NotUnderstood, FarmContent::Nothing, actions),
        }
    }

    /// Handles the exclusion by the Master. The agent subscribes again now and then, in case the Master has no other
    /// agents.
    fn dismissed(&mut self, reason: &str, actions: &mut Vec<FarmAction>) {
        self.hand_back(actions);
        if !std::mem::replace(&mut self.left_out, true) {
            actions.push(FarmAction::Effect(FarmEffect::Dismissed { reason: reason.to_owned() }));
        }
    }

    /// Leaves the Master without a message. After the next subscription the agent holds nothing.
    pub(crate) fn let_go(&mut self) {
        self.subscribed = false;
        self.hands.clear();
        self.unanswered.clear();
    }

    /// Removes the unanswered report of this order. Returns true if there was one.
    fn answered(&mut self, zone: ZoneId, fence: Revision) -> bool {
        let waits = self.unanswered.get(zone).is_some_and(|it| it.report.fence == fence);
        if waits {
            self.unanswered.remove(zone);
            self.past.insert(zone, fence);
        }
        waits
    }

    /// The newest fencing token seen for a zone.
    fn newest(&self, zone: ZoneId) -> Option<Revision> {
        let in_hand = self.hands.get(zone).map(|hand| hand.order.fence);
        let reported = || self.unanswered.get(zone).map(|it| it.report.fence);
        in_hand.or_else(reported).or_else(|| self.past.get(&zone).copied())
    }

    /// Workflow, step 5: fetches the 3D model from the repository when a new work begins.
    fn get_scene(&mut self, work: &WorkRow, actions: &mut Vec<FarmAction>) {
        if self.work.as_ref() != Some(work) {
            self.work = Some(work.clone());
            self.fetched = false;
            self.hands.clear();
            self.unanswered.clear();
            self.past.clear();
            self.remember(work);
            actions.push(FarmAction::Effect(FarmEffect::Fetch(work.work)));
        }
    }

    /// Starts from the V_cp that similar works ended with, if there is experience.
    fn remember(&mut self, work: &WorkRow) {
        let Foreknowledge { experience, technique, .. } = &self.config.knowledge;
        if let (Some(power), Some(adaptation)) = (experience.power(technique, &work.features), &mut self.adaptation) {
            *adaptation = Adaptation::new(self.config.adaptation, power);
        }
    }

    /// The number of zones that it has room for.
    pub(crate) fn room(&self) -> u32 {
        if self.suspended || self.adaptation.is_none() {
            return 0;
        }
        self.config.prefetch.saturating_sub(self.hands.len() as u32)
    }

    /// Time from now until it has painted what it holds.
    fn load(&self, now: Time) -> Duration {
        let hands = self.hands.values().map(|hand| self.own(hand.time(&self.config.expert).unwrap_or_default()));
        hands.sum::<Duration>().saturating_sub(now - self.since)
    }

    /// Converts reference-machine time to this agent's time, with all its processors together.
    fn own(&self, reference: Duration) -> Duration {
        scaled(reference, self.power().get() / self.lanes)
    }

    /// Replies to a call for proposals with a bid for each zone on offer, or refuses without room.
    fn propose(&self, now: Time, message: &FarmMessage, offers: &[Offer], actions: &mut Vec<FarmAction>) {
        let room = self.room();
        if room == 0 || offers.is_empty() {
            return self.answer(message, Performative::Refuse, FarmContent::Nothing, actions);
        }
        let load = self.load(now);
        let finish = |offer: &Offer| self.own(offer.time_estimated).saturating_add(load);
        let bid = |offer: &Offer| Bid { zone: offer.zone, finish: finish(offer) };
        let bids = offers.iter().map(bid).collect();
        self.answer(message, Performative::Propose, FarmContent::Bids { room, bids }, actions);
    }

    /// Drops an order after another agent has painted the zone.
    fn drop_order(&mut self, zone: ZoneId, fence: Revision, actions: &mut Vec<FarmAction>) {
        if self.hands.get(zone).is_some_and(|hand| hand.order.fence == fence)
            && let Some(hand) = self.hands.remove(zone)
        {
            self.past.insert(zone, fence);
            if hand.begun {
                actions.push(FarmAction::Effect(FarmEffect::Drop { zone, fence }));
            }
        }
        self.answered(zone, fence);
        self.begin_waiting(actions);
    }

    /// Takes an order, unless it is invalid, late or a duplicate.
    fn take(&mut self, now: Time, message: &FarmMessage, order: &Order, actions: &mut Vec<FarmAction>) {
        let zone = order.row.zone;
        if !order.is_sound() {
            return self.answer(message, Performative::NotUnderstood, FarmContent::Nothing, actions);
        }
        if message.reply_by.is_some_and(|reply_by| reply_by < now) {
            // The Master no longer waits for it, and sends it again after the next heartbeat if it still wants it
            return;
        }
        self.get_scene(&order.work, actions);
        match self.newest(zone) {
            Some(newest) if newest > order.fence => return,
            Some(newest) if newest == order.fence => {
                // The report was lost, or this order is a duplicate
                if let Some(unanswered) = self.unanswered.get(zone) {
                    actions.push(FarmAction::Send(self.report_message(unanswered)));
                }
                return;
            }
            _ => {}
        }
        self.unanswered.remove(zone);
        // Use the settings of the order, or choose them by the own rules
        let decided = order.row.choice.filter(|_| !order.decides);
        let choice = decided.unwrap_or_else(|| self.config.expert.decide(&order.work, &order.row));
        let conversation = message.conversation_id;
        let profiled = order.row.choice.unwrap_or(choice);
        let order = if choice == profiled { order.clone() } else { order.decided_anew(choice) };
        let is_estimated = choice.tunables == profiled.tunables;
        let decided = decided.is_none();
        let hand = ZoneInHand {
            was_ready: self.fetched,
            order,
            choice,
            is_estimated,
            decided,
            begun: false,
            since: now,
            painted: 0,
            conversation,
        };
        if self.hands.is_empty() {
            self.since = now;
        }
        self.hands.insert(zone, hand);
        self.thief.is_served();
        self.begin_waiting(actions);
    }

    /// Reports a painted order to the Master and adapts V_cp.
    fn painted(
        &mut self,
        now: Time,
        zone: ZoneId,
        fence: Revision,
        outcome: Result<PaintResult, String>,
        actions: &mut Vec<FarmAction>,
    ) {
        // Ignore it if the order was taken back and given again since
        if self.hands.get(zone).is_none_or(|hand| hand.order.fence != fence) {
            return;
        }
        let Some(hand) = self.hands.remove(zone) else { return };
        self.since = now;
        let outcome = outcome.map(|painted| {
            let power = self.power();
            let profiling = hand.order.row.state == ZoneState::Profiling;
            let samples = painted.result.samples;
            let settings = &hand.order.work.settings;
            let goal = self.config.expert.next_samples(settings, samples, &hand.choice, painted.unfinished);
            // T_est of the remaining samples; of one sample if none remain, for the Master to scale
            let left = f64::from(goal.saturating_sub(samples).max(1));
            let taken = f64::from(painted.result.samples.saturating_sub(hand.order.row.samples_done()).max(1));
            // Adapt V_cp, if the time is a measurement under the estimated settings
            if !profiling
                && hand.is_estimated
                && painted.is_measured
                && let (Some(adaptation), Some(estimated)) = (&mut self.adaptation, hand.order.row.time_estimated)
            {
                adaptation.learn(painted.busy, estimated);
            }
            Painting {
                choice: hand.choice,
                result: painted.result,
                time_measured: power.to_reference(painted.busy),
                busy: painted.busy,
                is_measured: painted.is_measured,
                was_ready: hand.was_ready,
                goal,
                error: painted.error,
                time_left: power.to_reference(scaled(painted.busy, painted.unfinished * left / taken)),
            }
        });
        let reasons = self.config.expert.reasons(&hand.order.work, &hand.order.row).filter(|_| hand.decided);
        let report = Arc::new(Report { zone, fence, outcome, reasons });
        let unanswered = Unanswered { report, conversation: hand.conversation, since: now };
        actions.push(FarmAction::Send(self.report_message(&unanswered)));
        self.unanswered.insert(zone, unanswered);
    }

    fn report_message(&self, Unanswered { report, conversation, .. }: &Unanswered) -> FarmMessage {
        let performative = if report.outcome.is_ok() { Performative::Inform } else { Performative::Failure };
        let to = self.master.iter().cloned().collect();
        let report = FarmContent::Report(Arc::clone(report));
        let report = message(performative, protocol::CONTRACT_NET, &self.config.id, to, report);
        // Repeated then, or soon after
        asking(report, *conversation, self.next_heartbeat)
    }

    fn subscribe(&self, actions: &mut Vec<FarmAction>) {
        let content = FarmContent::Subscription { power: self.power(), lanes: self.lanes };
        let to = self.master.iter().cloned().collect();
        let subscription = message(Performative::Subscribe, protocol::SUBSCRIBE, &self.config.id, to, content);
        // Repeated then
        actions.push(FarmAction::Send(AclMessage { reply_by: self.next_heartbeat, ..subscription }));
    }

    /// Sends the heartbeat, and repeats reports without a reply.
    fn beat(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        if self.adaptation.is_none() {
            return;
        }
        self.next_heartbeat = Some(now + self.config.heartbeat);
        if self.is_suspended {
            return;
        }
        if !self.subscribed {
            return self.seek_master(now, actions);
        }
        let in_hand = self.hands.iter().map(|(zone, hand)| {
            let progress = if hand.begun { hand.painted.saturating_add(1) } else { 0 };
            Holding { zone, fence: hand.order.fence, progress }
        });
        let reported = self.unanswered.iter();
        let reported = reported.map(|(zone, it)| Holding { zone, fence: it.report.fence, progress: u64::MAX });
        let content = FarmContent::Alive { power: self.power(), hands: in_hand.chain(reported).collect() };
        let to = self.master.iter().cloned().collect();
        let alive = message(Performative::Inform, protocol::SUBSCRIBE, &self.config.id, to, content);
        actions.push(FarmAction::Send(alive));
        // Repeat older reports only, to spare a busy Master
        let is_late = |it: &&Unanswered| now - it.since >= self.config.heartbeat / 2;
        for unanswered in self.unanswered.values().filter(is_late) {
            actions.push(FarmAction::Send(self.report_message(unanswered)));
        }
        self.look(now, actions);
    }

    /// Queries the progress of long orders, for the next heartbeat.
    fn look(&self, now: Time, actions: &mut Vec<FarmAction>) {
        let long = self.hands.iter().filter(|(_, hand)| hand.begun && hand.since + LOOK_AFTER <= now);
        let long: Vec<_> = long.map(|(zone, hand)| (zone, hand.order.fence)).collect();
        if !long.is_empty() {
            actions.push(FarmAction::Effect(FarmEffect::Look(long)));
        }
    }

    fn looked(&mut self, orders: &[(ZoneId, Revision, u64)]) {
        for (zone, hand) in self.hands.iter_mut() {
            let found = orders.iter().find(|(other, fence, _)| (*other, *fence) == (zone, hand.order.fence));
            hand.painted = hand.painted.max(found.map_or(0, |(_, _, painted)| *painted));
        }
    }

    fn answer(
        &self,
        to: &FarmMessage,
        performative: Performative,
        content: FarmContent,
        actions: &mut Vec<FarmAction>,
    ) {
        actions.push(FarmAction::Send(answer(to, &self.config.id, performative, content)));
    }

    fn assert_invariants(&self) {
        for (zone, hand) in self.hands.iter() {
            assert!(self.unanswered.get(zone).is_none(), "a zone in hand is not reported");
            assert!(hand.begun || !self.fetched || self.config.steals, "what can be painted is begun");
        }
        assert!(!self.is_suspended || self.hands.is_empty(), "who is suspended has handed back what it had");
    }
}

impl StateMachine for RenderAgent {
    type Content = FarmContent;
    type Value = crate::FarmValue;
    type Effect = FarmEffect;
    type Completion = FarmCompletion;

    fn handle(&mut self, now: Time, event: FarmEvent, actions: &mut Vec<FarmAction>) {
        match event {
            FarmEvent::Start => actions.push(FarmAction::Effect(FarmEffect::Benchmark)),
            FarmEvent::Message(message) => self.handle_message(now, &message, actions),
            FarmEvent::Completed(FarmCompletion::Benchmarked { power, lanes }) => {
                self.adaptation = Some(Adaptation::new(self.config.adaptation, power));
                self.lanes = if lanes.is_finite() { lanes.clamp(1e-3, 1e6) } else { 1.0 };
                if let Some(work) = self.work.clone() {
                    self.remember(&work);
                }
                self.next_heartbeat = Some(now);
            }
            FarmEvent::Completed(FarmCompletion::Fetched(work)) => {
                if self.work.as_ref().is_some_and(|row| row.work == work) {
                    self.fetched = true;
                    self.begin_waiting(actions);
                }
            }
            FarmEvent::Completed(FarmCompletion::Painted { zone, fence, outcome }) => {
                self.painted(now, zone, fence, outcome, actions);
                self.begin_waiting(actions);
            }
            FarmEvent::Completed(FarmCompletion::Looked(orders)) => self.looked(&orders),
            FarmEvent::Completed(_) | FarmEvent::Store { .. } | FarmEvent::Presence { .. } | FarmEvent::Deadline => {}
        }
        if self.next_heartbeat.is_some_and(|at| at <= now) {
            self.thief.try_again();
            self.beat(now, actions);
        }
        self.steal(now, actions);
        if let Some(registrant) = &mut self.registrant {
            registrant.tick(now, actions);
        }
        self.assert_invariants();
    }

    fn next_deadline(&self) -> Option<Time> {
        let directories = self.registrant.as_ref().and_then(|registrant| registrant.next_deadline());
        [self.next_heartbeat, directories].into_iter().flatten().min()
    }
}
