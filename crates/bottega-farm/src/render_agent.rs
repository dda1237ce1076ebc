//! The Render Agent: runs its benchmark, bids for zones, chooses their settings by its rules, and has them painted.
//!
//! Its state is divided among values that know nothing of each other but their arguments: [`FarmMembership`], [`Speed`],
//! [`Orders`] and [`Thief`]. This file knows all of them, and passes messages and completions on.

mod held_order;
mod membership;
mod orders;
mod speed;
mod stealing;
mod thief;

use std::{sync::Arc, time::Duration};

use bottega_agents::{
    AgentId, Performative, Revision, StateMachine, Time,
    platform::{LifeCycleRequest, LifeCycleState},
};

use self::{
    held_order::HeldOrder,
    membership::FarmMembership,
    orders::{Orders, UnansweredReport},
    speed::Speed,
    stealing::{Neighbor, orders_for},
    thief::Thief,
};
use crate::{
    AdaptationRule, AuctionRule, Bid, Expert, FarmAction, FarmCompletion, FarmContent, FarmEffect, FarmEvent,
    FarmMessage, Foreknowledge, LifeCycle, Offer, Order, PaintResult, Painting, RelativePower, Report, WorkRow, ZoneId,
    ZoneState,
    adaptation::scaled,
    contents::{asking, message},
    protocol,
    registrant::{DirectoryEvent, MasterSource},
};

/// The configuration of a Render Agent: its Master, its rules, and what it learned before.
#[derive(Clone, Debug)]
pub struct RenderAgentConfig {
    /// The agent's own id.
    pub id: AgentId,
    /// The way in which the agent finds its Master.
    pub master: MasterSource,
    /// The rule that adapts V_cp.
    pub adaptation: AdaptationRule,
    /// Number of zones that the agent works on at once; others wait in its queue. With 2, the next zone is there before
    /// the present one ends, and no core idles.
    pub prefetch: u32,
    /// The rule of the auction: it bounds how many zones may wait in the agent's queue. Under
    /// [`AuctionRule::Stealing`] zones are dealt to the agent, which takes zones from its neighbors when it has none.
    pub auction: AuctionRule,
    /// Interval of heartbeats and of repeated reports.
    pub heartbeat: Duration,
    /// The rules that choose the settings of zones.
    pub expert: Expert,
    /// The experience of the agent's machine and farm from earlier works.
    pub knowledge: Foreknowledge,
}

/// The state machine of one Render Agent.
#[derive(Clone, Debug)]
pub struct RenderAgent {
    config: RenderAgentConfig,
    membership: FarmMembership,
    speed: Speed,
    orders: Orders,
    thief: Thief,
    /// The work that the agent paints.
    work: Option<WorkRow>,
    /// True if the scene of the work is fetched.
    is_fetched: bool,
    /// Suspended by its Master: it takes no new zones.
    takes_nothing: bool,
    next_heartbeat: Option<Time>,
}

impl RenderAgent {
    /// Makes an agent that has not started.
    pub fn new(config: RenderAgentConfig) -> Self {
        Self {
            membership: FarmMembership::new(config.id.clone(), &config.master),
            speed: Speed::unknown(config.adaptation),
            orders: Orders::default(),
            thief: Thief::default(),
            work: None,
            is_fetched: false,
            takes_nothing: false,
            next_heartbeat: None,
            config,
        }
    }

    /// Returns the current V_cp; 1 before the benchmark is done.
    pub fn power(&self) -> RelativePower {
        self.speed.power()
    }

    /// Returns true if the agent is subscribed and willing, and holds nothing.
    pub(crate) fn is_free(&self) -> bool {
        let membership = &self.membership;
        membership.is_subscribed() && !membership.is_excluded() && self.orders.is_empty() && self.room() > 0
    }

    /// Returns the zones that the agent holds, with the fencing tokens of their orders.
    pub fn held_zones(&self) -> impl Iterator<Item = (ZoneId, Revision)> {
        self.orders.held()
    }

    /// Returns the number of zones that it has room for.
    pub(crate) fn room(&self) -> u32 {
        if self.takes_nothing || !self.speed.is_known() {
            return 0;
        }
        let RenderAgentConfig { auction, prefetch, .. } = self.config;
        let hand = if self.steals() { prefetch } else { auction.window(prefetch) };
        hand.saturating_sub(self.orders.held_count() as u32)
    }

    /// Returns true if zones are dealt to it and it takes zones from its neighbors.
    fn steals(&self) -> bool {
        self.config.auction == AuctionRule::Stealing
    }

    /// Leaves the Master without a message. After the next subscription the agent holds nothing.
    pub(crate) fn forget_master(&mut self) {
        self.membership.note_unsubscribed();
        self.orders.clear();
    }

    fn handle_message(&mut self, now: Time, message: &FarmMessage, actions: &mut Vec<FarmAction>) {
        if let FarmContent::Management(_) = message.content {
            return self.handle_directory_message(now, message, actions);
        }
        if self.steals() && message.protocol == protocol::STEALING {
            return self.handle_neighbor_message(now, message, actions);
        }
        if self.membership.master() != Some(&message.sender) {
            // Only the Master may send orders and end the work
            if message.performative != Performative::NotUnderstood {
                self.membership.answer(message, Performative::NotUnderstood, FarmContent::Nothing, actions);
            }
            return;
        }
        if self.membership.is_suspended() && self.membership.repeat_goodbye(message, actions) {
            return;
        }
        match (message.performative, &message.content) {
            (Performative::Agree, FarmContent::Subscribed) => self.membership.note_subscribed(),
            (Performative::Refuse, FarmContent::LeftOut { reason }) => self.handle_exclusion(reason, actions),
            // The Master does not know this agent (any more)
            (Performative::Refuse, FarmContent::Nothing) => {
                if self.membership.note_unsubscribed() {
                    self.membership.seek_master(now, &self.speed, self.next_heartbeat, actions);
                }
            }
            (Performative::Inform, FarmContent::Scene(work)) => self.fetch_scene(work, actions),
            (Performative::Inform, FarmContent::Neighbors(agents)) => {
                self.thief.set_neighbors(&self.config.id, agents);
            }
            (Performative::CallForProposal, FarmContent::Offers(offers)) => self.propose(now, message, offers, actions),
            (Performative::Request, FarmContent::Profile(order))
            | (Performative::AcceptProposal, FarmContent::Award(order)) => self.take(now, message, order, actions),
            (Performative::Confirm, FarmContent::Received { zone, fence }) => {
                self.orders.note_answer(*zone, *fence);
            }
            (Performative::Disconfirm, FarmContent::Refused { zone, fence, .. }) => {
                self.orders.note_refusal(*zone, *fence);
            }
            (Performative::Cancel, FarmContent::Withdrawn { zone, fence }) => {
                self.orders.cancel(*zone, *fence, actions);
                self.begin_waiting(actions);
            }
            (Performative::Request, FarmContent::LifeCycle(change)) => match change {
                LifeCycle::Suspend => self.takes_nothing = true,
                LifeCycle::Resume => self.takes_nothing = false,
                LifeCycle::Terminate => self.membership.end(actions),
            },
            (Performative::RejectProposal | Performative::NotUnderstood, _) => {}
            _ => self.membership.answer(message, Performative::NotUnderstood, FarmContent::Nothing, actions),
        }
    }

    /// Handles the exclusion by the Master. The agent subscribes again now and then, in case the Master has no other
    /// agents.
    fn handle_exclusion(&mut self, reason: &str, actions: &mut Vec<FarmAction>) {
        self.give_up_orders(actions);
        if self.membership.note_excluded() {
            actions.push(FarmAction::Effect(FarmEffect::Dismissed { reason: reason.to_owned() }));
        }
    }

    /// Gives up all zones that it holds.
    fn give_up_orders(&mut self, actions: &mut Vec<FarmAction>) {
        self.orders.cancel_all(actions);
        self.membership.note_unsubscribed();
    }

    /// Processes a message of a directory.
    fn handle_directory_message(&mut self, now: Time, message: &FarmMessage, actions: &mut Vec<FarmAction>) {
        match self.membership.hear_directory(now, message) {
            Some(DirectoryEvent::Master(master)) => {
                self.membership.set_master(master);
                if self.membership.may_subscribe() && self.speed.is_known() {
                    self.membership.subscribe(&self.speed, self.next_heartbeat, actions);
                }
            }
            Some(DirectoryEvent::LifeCycle(request)) => self.obey(now, message, request, actions),
            // The AMS's request may have been lost, so follow the state it lists
            Some(DirectoryEvent::State(LifeCycleState::Suspended)) => self.suspend(actions),
            Some(DirectoryEvent::State(LifeCycleState::Active)) => self.resume(now, actions),
            Some(DirectoryEvent::State(_)) | None => {}
        }
    }

    /// Carries out a request of the AMS and confirms it.
    fn obey(&mut self, now: Time, message: &FarmMessage, request: LifeCycleRequest, actions: &mut Vec<FarmAction>) {
        let ends = matches!(request, LifeCycleRequest::Quit | LifeCycleRequest::Destroy);
        match request {
            LifeCycleRequest::Suspend => self.suspend(actions),
            LifeCycleRequest::Resume => self.resume(now, actions),
            LifeCycleRequest::Quit | LifeCycleRequest::Destroy => {
                self.membership.unsubscribe(actions);
                self.give_up_orders(actions);
                let reason = format!("ended by {}", message.sender);
                actions.push(FarmAction::Effect(FarmEffect::Dismissed { reason }));
            }
        }
        self.membership.confirm(message, request, actions);
        if ends {
            self.membership.end(actions);
        }
    }

    /// Leaves the Master until resumed.
    fn suspend(&mut self, actions: &mut Vec<FarmAction>) {
        if self.membership.suspend(actions) {
            self.give_up_orders(actions);
        }
    }

    fn resume(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        if self.membership.resume() && self.speed.is_known() {
            self.membership.seek_master(now, &self.speed, self.next_heartbeat, actions);
        }
    }

    /// Workflow, step 5: fetches the 3D model from the repository when a new work begins.
    fn fetch_scene(&mut self, work: &WorkRow, actions: &mut Vec<FarmAction>) {
        if self.work.as_ref() != Some(work) {
            self.work = Some(work.clone());
            self.is_fetched = false;
            self.orders.reset();
            self.recall_speed();
            actions.push(FarmAction::Effect(FarmEffect::Fetch(work.work)));
        }
    }

    /// Starts from the V_cp that similar works ended with, if there is experience.
    fn recall_speed(&mut self) {
        let Foreknowledge { experience, technique, .. } = &self.config.knowledge;
        let power = self.work.as_ref().and_then(|work| experience.power(technique, &work.features));
        if let Some(power) = power {
            self.speed.restart_from(power);
        }
    }

    /// Returns the time from now until it has painted what it holds.
    fn load(&self, now: Time) -> Duration {
        self.orders.load(now, &self.speed, &self.config.expert)
    }

    /// Replies to a call for proposals with a bid for each zone on offer, or refuses without room.
    fn propose(&self, now: Time, message: &FarmMessage, offers: &[Offer], actions: &mut Vec<FarmAction>) {
        let room = self.room();
        if room == 0 || offers.is_empty() {
            return self.membership.answer(message, Performative::Refuse, FarmContent::Nothing, actions);
        }
        let load = self.load(now);
        let finish = |offer: &Offer| self.speed.own(offer.time_estimated).saturating_add(load);
        let bid = |offer: &Offer| Bid { zone: offer.zone, finish: finish(offer) };
        let bids = offers.iter().map(bid).collect();
        self.membership.answer(message, Performative::Propose, FarmContent::Bids { room, bids }, actions);
    }

    /// Takes an order, unless it is invalid, late or a duplicate.
    fn take(&mut self, now: Time, message: &FarmMessage, order: &Order, actions: &mut Vec<FarmAction>) {
        let zone = order.row.zone;
        if !order.is_sound() {
            return self.membership.answer(message, Performative::NotUnderstood, FarmContent::Nothing, actions);
        }
        if message.reply_by.is_some_and(|reply_by| reply_by < now) {
            // The Master no longer waits for it, and sends it again after the next heartbeat if it still wants it
            return;
        }
        self.fetch_scene(&order.work, actions);
        match self.orders.newest(zone) {
            Some(newest) if newest > order.fence => return,
            Some(newest) if newest == order.fence => {
                // The report was lost, or this order is a duplicate
                if let Some(unanswered) = self.orders.unanswered(zone) {
                    actions.push(FarmAction::Send(self.report_message(unanswered)));
                }
                return;
            }
            _ => {}
        }
        // Use the settings of the order, or choose them by the own rules
        let decided = order.row.choice.filter(|_| !order.decides);
        let choice = decided.unwrap_or_else(|| self.config.expert.decide(&order.work, &order.row));
        let conversation = message.conversation_id;
        let profiled = order.row.choice.unwrap_or(choice);
        let order = if choice == profiled { order.clone() } else { order.with_choice(choice) };
        let held = HeldOrder {
            was_ready: self.is_fetched,
            order,
            choice,
            is_estimated: choice.tunables == profiled.tunables,
            decided: decided.is_none(),
            begun: false,
            since: now,
            painted: 0,
            conversation,
        };
        self.orders.hold(now, zone, held);
        self.thief.reset();
        self.begin_waiting(actions);
    }

    /// Begins waiting zones, once the scene is fetched.
    fn begin_waiting(&mut self, actions: &mut Vec<FarmAction>) {
        if self.is_fetched {
            let most = self.config.prefetch as usize;
            self.orders.begin_waiting(most, &self.speed, &self.config.expert, actions);
        }
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
        let Some(held) = self.orders.finish(now, zone, fence) else { return };
        let outcome = outcome.map(|painted| self.painting(&held, painted));
        let reasons = self.config.expert.reasons(&held.order.work, &held.order.row).filter(|_| held.decided);
        let report = Arc::new(Report { zone, fence, outcome, reasons });
        let unanswered = UnansweredReport { report, conversation: held.conversation, since: now };
        actions.push(FarmAction::Send(self.report_message(&unanswered)));
        self.orders.await_answer(zone, unanswered);
    }

    /// Returns the painting of an order, for its report. Adapts V_cp if its time is a measurement under the estimated
    /// settings.
    fn painting(&mut self, held: &HeldOrder, painted: PaintResult) -> Painting {
        let power = self.speed.power();
        let row = &held.order.row;
        let samples = painted.result.samples;
        let settings = &held.order.work.settings;
        let goal = self.config.expert.next_samples(settings, samples, &held.choice, painted.unfinished);
        // T_est of the remaining samples; of one sample if none remain, for the Master to scale
        let left = f64::from(goal.saturating_sub(samples).max(1));
        let taken = f64::from(samples.saturating_sub(row.samples_done()).max(1));
        if row.state != ZoneState::Profiling
            && held.is_estimated
            && painted.is_measured
            && let Some(estimated) = row.time_estimated
        {
            self.speed.learn(painted.busy, estimated);
        }
        Painting {
            choice: held.choice,
            result: painted.result,
            time_measured: power.to_reference(painted.busy),
            busy: painted.busy,
            is_measured: painted.is_measured,
            was_ready: held.was_ready,
            goal,
            error: painted.error,
            time_left: power.to_reference(scaled(painted.busy, painted.unfinished * left / taken)),
        }
    }

    fn report_message(&self, UnansweredReport { report, conversation, .. }: &UnansweredReport) -> FarmMessage {
        let performative = if report.outcome.is_ok() { Performative::Inform } else { Performative::Failure };
        let content = FarmContent::Report(Arc::clone(report));
        let report = self.membership.to_master(performative, protocol::CONTRACT_NET, content);
        // Repeated then, or soon after
        asking(report, *conversation, self.next_heartbeat)
    }

    /// Sends the heartbeat, and repeats reports without a reply.
    fn beat(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        if !self.speed.is_known() {
            return;
        }
        self.next_heartbeat = Some(now + self.config.heartbeat);
        if self.membership.is_suspended() {
            return;
        }
        if !self.membership.is_subscribed() {
            return self.membership.seek_master(now, &self.speed, self.next_heartbeat, actions);
        }
        let content = FarmContent::Alive { power: self.speed.power(), orders: self.orders.holdings() };
        let alive = self.membership.to_master(Performative::Inform, protocol::SUBSCRIBE, content);
        actions.push(FarmAction::Send(alive));
        // Repeat older reports only, to spare a busy Master
        for unanswered in self.orders.unanswered_since(now, self.config.heartbeat / 2) {
            actions.push(FarmAction::Send(self.report_message(unanswered)));
        }
        // Query the progress of long orders, for the next heartbeat
        let long = self.orders.long_running(now);
        if !long.is_empty() {
            actions.push(FarmAction::Effect(FarmEffect::Look(long)));
        }
    }

    /// Asks a neighbor for zones, if the agent has room and is not waiting for an answer.
    fn steal(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        let is_member = self.membership.is_subscribed() && !self.membership.is_suspended();
        if !self.steals() || !self.is_fetched || !is_member || self.room() == 0 {
            return;
        }
        let content = FarmContent::Steal { own: self.speed.own_seconds(), load: self.load(now) };
        let Some(neighbor) = self.thief.next_neighbor() else { return };
        let to = vec![neighbor.clone()];
        let plea = message(Performative::Request, protocol::STEALING, &self.config.id, to, content);
        actions.push(FarmAction::Send(asking(plea, 0, Some(now + self.config.heartbeat))));
    }

    /// Processes a neighbor's request or answer.
    fn handle_neighbor_message(&mut self, now: Time, message: &FarmMessage, actions: &mut Vec<FarmAction>) {
        match (message.performative, &message.content) {
            (Performative::Request, FarmContent::Steal { own, load }) => {
                let is_late = message.reply_by.is_some_and(|reply_by| reply_by < now);
                if !is_late {
                    self.yield_to(now, message, Neighbor::new(*own, *load), actions);
                }
            }
            (Performative::Agree, FarmContent::Yielded(_)) => self.thief.note_success(),
            (Performative::Refuse, _) => {
                if self.thief.note_refusal(&message.sender) && self.orders.holds_nothing() {
                    // Send a heartbeat: the Master may have something
                    self.beat(now, actions);
                }
            }
            (Performative::NotUnderstood | Performative::Agree, _) => {}
            _ => self.membership.answer(message, Performative::NotUnderstood, FarmContent::Nothing, actions),
        }
    }

    /// Gives waiting zones to a neighbor, so that both finish together, or refuses.
    fn yield_to(&mut self, now: Time, message: &FarmMessage, neighbor: Neighbor, actions: &mut Vec<FarmAction>) {
        let (waiting, load) = (self.orders.waiting(), self.load(now));
        let orders = orders_for(neighbor, waiting, load, &self.speed, &self.config.expert);
        if orders.is_empty() || self.membership.master().is_none() {
            return self.membership.answer(message, Performative::Refuse, FarmContent::Nothing, actions);
        }
        // Remove the given zones and inform the neighbor and the Master
        for order in &orders {
            self.orders.give_away(order.zone);
        }
        let yielded = FarmContent::Yielded(orders.len() as u32);
        self.membership.answer(message, Performative::Agree, yielded, actions);
        let content = FarmContent::HandedOver { to: message.sender.clone(), orders };
        let inform = self.membership.to_master(Performative::Inform, protocol::STEALING, content);
        actions.push(FarmAction::Send(inform));
    }

    fn assert_invariants(&self) {
        self.orders.assert_invariants(self.config.prefetch as usize, self.is_fetched);
        let is_idle = self.orders.holds_nothing();
        assert!(!self.membership.is_suspended() || is_idle, "a suspended agent has given up its orders");
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
                self.speed.set(power, lanes);
                self.recall_speed();
                self.next_heartbeat = Some(now);
            }
            FarmEvent::Completed(FarmCompletion::Fetched(work)) => {
                if self.work.as_ref().is_some_and(|row| row.work == work) {
                    self.is_fetched = true;
                    self.begin_waiting(actions);
                }
            }
            FarmEvent::Completed(FarmCompletion::Painted { zone, fence, outcome }) => {
                self.painted(now, zone, fence, outcome, actions);
                self.begin_waiting(actions);
            }
            FarmEvent::Completed(FarmCompletion::Looked(orders)) => self.orders.note_progress(&orders),
            FarmEvent::Completed(_) | FarmEvent::Store { .. } | FarmEvent::Presence { .. } | FarmEvent::Deadline => {}
        }
        if self.next_heartbeat.is_some_and(|at| at <= now) {
            self.thief.reset();
            self.beat(now, actions);
        }
        self.steal(now, actions);
        self.membership.tick(now, actions);
        self.assert_invariants();
    }

    fn next_deadline(&self) -> Option<Time> {
        [self.next_heartbeat, self.membership.next_deadline()].into_iter().flatten().min()
    }
}
