//! A hostile agent: it subscribes beside honest ones, and then violates the protocol.

use std::{sync::Arc, time::Duration};

use bottega_agents::{AclMessage, Action, AgentId, BlobId, Event, Performative, Random, Revision, StateMachine, Time};
use bottega_farm::{
    Bid, Choice, ErrorUse, FarmAction, FarmCompletion, FarmContent, FarmEffect, FarmEvent, FarmMessage, FarmValue,
    Holding, LifeCycle, ONTOLOGY, Order, PaintOrder, Painting, PassedOrder, RelativePower, Report, ResultRef, ZoneId,
    protocol,
};
use bottega_image::Sides;

/// Maximum number of things seen that it uses again.
const KEPT: usize = 16;

/// The habits of a hostile agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Vice {
    /// Bids for zones that are not on offer, twice, too late, with absurd times, and with room for none or for all.
    Bids,
    /// Claims to be the fastest, and never bids. It paints its profiles.
    Declines,
    /// Sends heartbeats only; does not answer calls and orders.
    Dawdles,
    /// Is silent after its subscription, and subscribes again when it counts as gone.
    Vanishes,
    /// Reports paintings that were never made, with any fields wrong.
    Forges,
    /// Reports a failure at once.
    Fails,
    /// Leaves and joins again.
    Leaves,
    /// Reports orders that it does not have, hides those that it has, or reports progress that was not made.
    Claims,
    /// Sends messages in the names of honest agents.
    Impersonates,
    /// Sends many messages at once.
    Floods,
    /// Sends other agents messages that only their Master may send.
    Meddles,
    /// Subscribes in the name of the Master.
    Usurps,
    /// Shares its processor with a thousand agents, sends random messages, and never a heartbeat.
    Mumbles,
    /// Paints some of its orders correctly, so that its failures are forgotten.
    Works,
    /// Takes zones from others without painting them, and gives away zones that it does not hold. Only with stealing.
    Robs,
}

impl Vice {
    pub(super) const ALL: [Self; 14] = [
        Self::Bids,
        Self::Declines,
        Self::Dawdles,
        Self::Vanishes,
        Self::Forges,
        Self::Fails,
        Self::Leaves,
        Self::Claims,
        Self::Impersonates,
        Self::Floods,
        Self::Meddles,
        Self::Usurps,
        Self::Mumbles,
        Self::Works,
    ];
}

/// The configuration of a hostile agent.
#[derive(Clone, Debug)]
pub(super) struct HostileConfig {
    pub(super) id: AgentId,
    pub(super) master: AgentId,
    /// The names in which it sends messages.
    pub(super) honest: Vec<AgentId>,
    pub(super) vices: Vec<Vice>,
    /// Time between two of its actions, at first.
    pub(super) pace: Duration,
    /// The time from which it acts every few seconds.
    pub(super) tires: Time,
    pub(super) seed: u64,
}

/// The state machine of one hostile agent.
pub(super) struct HostileAgent {
    config: HostileConfig,
    random: Random,
    orders: Vec<(Order, u64)>,
    calls: Vec<FarmMessage>,
    next: Option<Time>,
    progress: u64,
}

impl HostileAgent {
    pub(super) fn new(config: HostileConfig) -> Self {
        let random = Random::new(config.seed);
        Self { config, random, orders: Vec::new(), calls: Vec::new(), next: None, progress: 1 }
    }

    fn has(&self, vice: Vice) -> bool {
        self.config.vices.contains(&vice)
    }

    fn one_of<T: Copy>(&mut self, these: &[T]) -> T {
        these[self.random.below(these.len())]
    }

    fn chance(&mut self, share: f64) -> bool {
        self.random.unit() < share
    }

    fn honest(&mut self) -> AgentId {
        self.config.honest[self.random.below(self.config.honest.len())].clone()
    }

    fn power(&mut self) -> RelativePower {
        RelativePower::new(self.one_of(&[0.0, 1e-4, 1.0, 1e9, f64::NAN]))
    }

    fn lanes(&mut self) -> f64 {
        self.one_of(&[0.0, 1.0, 1e300, -1.0, f64::NAN, f64::INFINITY])
    }

    fn time(&mut self) -> Duration {
        self.one_of(&[Duration::ZERO, Duration::from_nanos(1), Duration::from_secs(1 << 30), Duration::MAX])
    }

    fn number(&mut self) -> u32 {
        self.one_of(&[0, 1, 2, 7, 64, 1 << 20, u32::MAX])
    }

    fn fence(&mut self) -> Revision {
        let fences: Vec<Revision> = self.orders.iter().map(|(order, _)| order.fence).collect();
        let made_up = [Revision::ABSENT, Revision(u64::MAX)];
        if fences.is_empty() || self.chance(0.1) { self.one_of(&made_up) } else { self.one_of(&fences) }
    }

    fn zone(&mut self) -> ZoneId {
        ZoneId(self.one_of(&[0, 1, 2, 3, 4, 5, 6, 7, 1000, u32::MAX]))
    }

    fn digest(&mut self) -> BlobId {
        let mut digest = [0xff; 32];
        digest[..8].copy_from_slice(&self.random.bits().to_le_bytes());
        BlobId(digest)
    }

    fn say(
        &self,
        sender: &AgentId,
        to: &AgentId,
        performative: Performative,
        content: FarmContent,
        conversation_id: u64,
    ) -> FarmAction {
        Action::Send(AclMessage {
            performative,
            sender: sender.clone(),
            receivers: vec![to.clone()],
            content,
            language: "bottega-typed",
            ontology: ONTOLOGY,
            protocol: protocol::CONTRACT_NET,
            conversation_id,
            reply_with: conversation_id,
            in_reply_to: conversation_id,
            reply_by: None,
        })
    }

    fn tell(&self, performative: Performative, content: FarmContent, conversation: u64) -> FarmAction {
        self.say(&self.config.id, &self.config.master, performative, content, conversation)
    }

    fn subscribe(&mut self, sender: &AgentId) -> FarmAction {
        let (power, lanes) = (self.power(), self.lanes());
        let (power, lanes) = if self.has(Vice::Declines) { (RelativePower::new(0.0), 1e6) } else { (power, lanes) };
        let lanes = if self.has(Vice::Mumbles) { 1e-3 } else { lanes };
        let content = FarmContent::Subscription { power, lanes };
        self.say(sender, &self.config.master, Performative::Subscribe, content, 0)
    }

    /// Returns senseless bids, for a real call or without one.
    fn bids(&mut self) -> (FarmContent, u64) {
        let call = self.calls.last().cloned().filter(|_| self.random.unit() < 0.9);
        let conversation = call.as_ref().map_or_else(|| self.random.bits() % 64, |call| call.conversation_id);
        let mut bids = Vec::new();
        if let Some(FarmContent::Offers(offers)) = call.as_ref().map(|call| &call.content)
            && self.chance(0.6)
        {
            for offer in offers.iter() {
                let finish = self.time();
                bids.push(Bid { zone: offer.zone, finish });
            }
        }
        while self.chance(0.4) {
            let (zone, finish) = (self.zone(), self.time());
            bids.push(Bid { zone, finish });
        }
        let room = self.number();
        (FarmContent::Bids { room, bids }, conversation)
    }

    /// Returns a report of an order that it holds, held, or never had.
    fn report(&mut self) -> (Performative, FarmContent, u64) {
        let order = self.orders.get(self.random.below(KEPT)).cloned();
        let (zone, fence) = match &order {
            Some((order, _)) if self.chance(0.7) => (order.row.zone, order.fence),
            _ => (self.zone(), self.fence()),
        };
        let conversation = order.as_ref().map_or(0, |(_, conversation)| *conversation);
        let outcome = match &order {
            Some((order, _)) if !self.has(Vice::Fails) || self.chance(0.5) => Ok(self.forged(order, fence)),
            _ => Err("no reason".to_owned()),
        };
        let performative = if outcome.is_ok() { Performative::Inform } else { Performative::Failure };
        (performative, FarmContent::Report(Arc::new(Report { zone, fence, outcome, reasons: None })), conversation)
    }

    /// Returns a painting that was never made, sometimes with correct fields otherwise.
    fn forged(&mut self, order: &Order, fence: Revision) -> Painting {
        let mut choice = order.row.choice.unwrap_or(Choice::unchanged(&order.work.settings));
        let samples = order.row.goal_samples(&choice);
        let mut result = ResultRef { fence, samples, digest: self.digest() };
        let (mut goal, mut error) = (choice.samples, None);
        let (mut time_measured, mut time_left) = (Duration::from_secs(1), Duration::from_secs(1));
        while self.chance(0.5) {
            match self.random.below(10) {
                0 => choice.tunables.max_depth = self.number(),
                1 => choice.tunables.light_samples = self.number(),
                2 => choice.samples = self.number(),
                3 => choice.bands = Sides::all(self.number()),
                4 => result.samples = self.number(),
                5 => result.fence = self.fence(),
                6 => time_measured = self.time(),
                7 => time_left = self.time(),
                8 => goal = self.number(),
                _ => error = Some(self.one_of(&[f64::NAN, -1.0, 0.0, f64::INFINITY])),
            }
        }
        Painting {
            choice,
            result,
            time_measured,
            busy: time_measured,
            is_measured: true,
            was_ready: true,
            goal,
            time_left,
            error,
        }
    }

    /// The progress of its orders that it reports with a heartbeat.
    fn alive(&mut self) -> FarmContent {
        let claims = self.has(Vice::Claims);
        let mut holdings: Vec<Holding> = Vec::new();
        if !claims || self.chance(0.5) {
            self.progress += u64::from(claims);
            let progress = self.progress;
            let hold = |(order, _): &(Order, u64)| Holding { zone: order.row.zone, fence: order.fence, progress };
            holdings.extend(self.orders.iter().map(hold));
        }
        while claims && self.chance(0.5) {
            let (zone, fence) = (self.zone(), self.fence());
            let progress = self.one_of(&[0, 1, u64::MAX]);
            holdings.push(Holding { zone, fence, progress });
        }
        let power = self.power();
        FarmContent::Alive {
            power: if self.has(Vice::Declines) { RelativePower::new(0.0) } else { power },
            orders: holdings,
        }
    }

    fn impersonate(&mut self) -> FarmAction {
        let honest = self.honest();
        let me = if self.chance(0.1) { self.config.master.clone() } else { honest };
        let (performative, content, conversation) = match self.random.below(6) {
            0 => return self.subscribe(&me),
            1 => (Performative::Cancel, FarmContent::Unsubscription, 0),
            2 => (Performative::Inform, self.alive(), 0),
            3 => {
                let (bids, conversation) = self.bids();
                (Performative::Propose, bids, conversation)
            }
            4 => (Performative::Refuse, FarmContent::Nothing, self.random.bits() % 64),
            _ => self.report(),
        };
        self.say(&me, &self.config.master, performative, content, conversation)
    }

    /// Sends an honest agent a message that only its Master may send.
    fn meddle(&mut self) -> FarmAction {
        let (me, to) = (self.config.id.clone(), self.honest());
        let order = self.orders.last().map(|(order, _)| order.clone());
        let (zone, fence) = (self.zone(), self.fence());
        let (performative, content) = match (self.random.below(6), order) {
            (0, _) => (Performative::Request, FarmContent::LifeCycle(LifeCycle::Terminate)),
            (1, _) => (Performative::Request, FarmContent::LifeCycle(LifeCycle::Suspend)),
            (2, _) => (Performative::Refuse, FarmContent::LeftOut { reason: "no reason".to_owned() }),
            (3, Some(order)) => {
                let order = Order { fence: Revision(u64::MAX), ..order };
                (Performative::AcceptProposal, FarmContent::Award(order))
            }
            (4, Some(order)) => {
                let mut work = (*order.work).clone();
                work.work.0 += 1;
                (Performative::Inform, FarmContent::Scene(Arc::new(work)))
            }
            (5, _) => (Performative::Confirm, FarmContent::Received { zone, fence }),
            _ => (Performative::Cancel, FarmContent::Withdrawn { zone, fence }),
        };
        self.say(&me, &to, performative, content, 0)
    }

    /// Asks for zones of others, or gives away zones that it does not hold.
    fn rob(&mut self) -> FarmAction {
        let (me, honest) = (self.config.id.clone(), self.honest());
        let own = self.one_of(&[f64::NAN, 0.0, -1.0, 1e-9, 1.0]);
        let load = self.time();
        let (zone, fence) = (self.zone(), self.fence());
        let kept = self.one_of(&[f64::NAN, -1.0, 0.0, 0.5, 7.0]);
        let taken = self.orders.last().map(|(order, _)| (order.row.zone, order.fence));
        let (zone, fence) = taken.filter(|_| kept != 7.0).unwrap_or((zone, fence));
        let to = if kept == -1.0 { AgentId::new("nobody") } else { honest.clone() };
        let orders = vec![PassedOrder { zone, fence, kept }; 3];
        let (to, performative, content) = match self.random.below(5) {
            0 | 1 => (&honest, Performative::Request, FarmContent::Steal { own, load }),
            2 => (&honest, Performative::Agree, FarmContent::Yielded(u32::MAX)),
            3 => (&honest, Performative::Inform, FarmContent::Neighbors(vec![me.clone(); 3])),
            _ => (&self.config.master, Performative::Inform, FarmContent::HandedOver { to, orders }),
        };
        match self.say(&me, to, performative, content, 0) {
            Action::Send(message) => Action::Send(AclMessage { protocol: protocol::STEALING, ..message }),
            other => other,
        }
    }

    /// Runs one random action.
    fn act(&mut self, actions: &mut Vec<FarmAction>) {
        let vices = self.config.vices.clone();
        let vice = self.one_of(&vices);
        match vice {
            Vice::Bids => {
                let (bids, conversation) = self.bids();
                actions.push(self.tell(Performative::Propose, bids, conversation));
            }
            Vice::Forges | Vice::Fails => {
                let (performative, report, conversation) = self.report();
                actions.push(self.tell(performative, report, conversation));
            }
            Vice::Leaves => actions.push(self.tell(Performative::Cancel, FarmContent::Unsubscription, 0)),
            Vice::Impersonates => actions.push(self.impersonate()),
            Vice::Meddles => actions.push(self.meddle()),
            Vice::Floods => {
                for _ in 0..12 {
                    let vice = self.one_of(&[Vice::Bids, Vice::Forges, Vice::Impersonates]);
                    let action = match vice {
                        Vice::Bids => self.bids(),
                        Vice::Forges => {
                            let (_, report, conversation) = self.report();
                            (report, conversation)
                        }
                        _ => (self.alive(), 0),
                    };
                    let act = self.one_of(&Performative::ALL);
                    actions.push(self.tell(act, action.0, action.1));
                }
            }
            Vice::Usurps => {
                let master = self.config.master.clone();
                actions.push(self.subscribe(&master));
            }
            Vice::Mumbles => actions.push(self.tell(Performative::NotUnderstood, FarmContent::Nothing, 0)),
            Vice::Robs => actions.push(self.rob()),
            Vice::Declines | Vice::Dawdles | Vice::Vanishes | Vice::Claims | Vice::Works => {}
        }
        if !self.has(Vice::Vanishes) && !self.has(Vice::Mumbles) {
            let alive = self.alive();
            actions.push(self.tell(Performative::Inform, alive, 0));
        }
        // It gets no message when it is removed from the list.
        if !self.has(Vice::Usurps) && self.chance(0.3) {
            let me = self.config.id.clone();
            actions.push(self.subscribe(&me));
        }
    }

    fn called(&mut self, call: FarmMessage, actions: &mut Vec<FarmAction>) {
        self.calls.push(call);
        let old = self.calls.len().saturating_sub(KEPT);
        self.calls.drain(..old);
        if self.has(Vice::Declines) {
            let call = self.calls.last().map_or(0, |call| call.conversation_id);
            let bids = FarmContent::Bids { room: self.random.below(2) as u32, bids: Vec::new() };
            actions.push(self.tell(Performative::Propose, bids, call));
        }
        while self.has(Vice::Bids) && self.chance(0.6) {
            let (bids, conversation) = self.bids();
            actions.push(self.tell(Performative::Propose, bids, conversation));
        }
    }

    fn ordered(&mut self, order: &Order, conversation: u64, actions: &mut Vec<FarmAction>) {
        self.orders.retain(|(other, _)| other.fence != order.fence);
        self.orders.push((order.clone(), conversation));
        let old = self.orders.len().saturating_sub(KEPT);
        self.orders.drain(..old);
        if self.has(Vice::Declines) || self.has(Vice::Works) && self.chance(0.5) {
            actions.push(Action::Effect(FarmEffect::Paint(whole(order))));
        } else if self.has(Vice::Fails) || self.has(Vice::Forges) && self.chance(0.5) {
            let (zone, fence) = (order.row.zone, order.fence);
            let lies = self.has(Vice::Forges);
            let outcome = if lies { Ok(self.forged(order, fence)) } else { Err("at once".to_owned()) };
            let act = if lies { Performative::Inform } else { Performative::Failure };
            let report = FarmContent::Report(Arc::new(Report { zone, fence, outcome, reasons: None }));
            actions.push(self.tell(act, report, conversation));
        }
    }

    /// An order is painted: reports it as an honest agent does.
    fn painted(&mut self, zone: ZoneId, fence: Revision, result: ResultRef, actions: &mut Vec<FarmAction>) {
        let known = self.orders.iter().find(|(order, _)| (order.row.zone, order.fence) == (zone, fence));
        let Some((order, conversation)) = known.cloned() else { return };
        let choice = order.row.choice.unwrap_or(Choice::unchanged(&order.work.settings));
        let time = Duration::from_secs(1);
        let painting = Painting {
            choice,
            result,
            time_measured: time,
            goal: choice.samples,
            time_left: time,
            busy: time,
            is_measured: true,
            was_ready: true,
            error: None,
        };
        let report = Arc::new(Report { zone, fence, outcome: Ok(painting), reasons: None });
        actions.push(self.tell(Performative::Inform, FarmContent::Report(report), conversation));
    }
}

/// All samples of a zone, from the first.
fn whole(order: &Order) -> PaintOrder {
    let settings = &order.work.settings;
    let choice = order.row.choice.unwrap_or(Choice::unchanged(settings));
    PaintOrder {
        zone: order.row.zone,
        fence: order.fence,
        rect: order.row.painted(&choice, &settings.frame),
        samples: 0..order.row.goal_samples(&choice),
        tunables: choice.tunables,
        preference: Default::default(),
        from: None,
        error_use: ErrorUse::None,
        samples_max: choice.samples,
        time_estimated: None,
    }
}

impl StateMachine for HostileAgent {
    type Content = FarmContent;
    type Value = FarmValue;
    type Effect = FarmEffect;
    type Completion = FarmCompletion;

    fn handle(&mut self, now: Time, event: FarmEvent, actions: &mut Vec<FarmAction>) {
        match event {
            Event::Start => {
                let me = if self.has(Vice::Usurps) { &self.config.master } else { &self.config.id }.clone();
                actions.push(self.subscribe(&me));
                self.next = Some(now + self.config.pace);
            }
            Event::Message(message) => match &message.content {
                FarmContent::Offers(_) => self.called(message, actions),
                FarmContent::Profile(order) | FarmContent::Award(order) => {
                    self.ordered(order, message.conversation_id, actions);
                }
                _ => {}
            },
            Event::Completed(FarmCompletion::Painted { zone, fence, outcome: Ok(painted) }) => {
                self.painted(zone, fence, painted.result, actions);
            }
            _ => {}
        }
        if self.next.is_some_and(|at| at <= now) {
            self.act(actions);
            let pace = if now < self.config.tires { self.config.pace } else { Duration::from_secs(3) };
            self.next = Some(now + pace.mul_f64(0.5 + self.random.unit()));
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        self.next
    }
}
