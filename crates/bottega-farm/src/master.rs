//! The Master: knows the agents, gives out the zones by auction, takes the results and has them composed.
//!
//! **Invariant:** its memory holds nothing that the Blackboard does not, but for what may be lost without harm: a round of
//! an auction, a lease. A new Master watches the work's rows and goes on.
//!
//! Every order is a compare-and-set on the zone's row. The revision that it gets is the fencing token which the report
//! must carry; a report under an older one is refused. So a zone that was taken from a silent agent and given to another
//! is accepted once, whoever is first to finish under a valid token.

mod allot;
mod composition;
mod ledger;
mod plan;
mod results;
mod roster;
mod tail;

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
    time::Duration,
};

use bottega_agents::{AgentId, Entry, Performative, Revision, StateMachine, StoreReply, StoreRequest, Ticket, Time};

use self::{composition::Composition, ledger::Ledger, roster::Roster};
use crate::{
    AgentRow, AuctionRule, Award, Bidder, Blackboard, Choice, FarmAction, FarmCompletion, FarmContent, FarmEffect,
    FarmEvent, FarmMessage, FarmValue, GoalRules, LifeCycle, Offer, Order, Painting, Partition, Proposal, Report,
    Rival, Standing, WorkId, WorkRow, ZoneId, ZoneRow, ZoneState, agent_key,
    auction::BIDDERS_MAX,
    award,
    contents::{answer, asking, message},
    credit_after, protocol, work_key, work_prefix, zone_key,
};

/// The ticket of the watch.
const WATCH: Ticket = Ticket(0);
/// Results that the film is given at once.
const COMPOSING_MAX: usize = 8;

/// How long the Master waits for what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// For bids: silence is a refusal.
    pub bids: Duration,
    /// Between two looks at those who say nothing; agents speak as often.
    pub heartbeat: Duration,
    /// Until a silent agent counts as gone.
    pub lease: Duration,
}

impl Default for Timing {
    fn default() -> Self {
        Self { bids: Duration::from_millis(500), heartbeat: Duration::from_secs(1), lease: Duration::from_secs(5) }
    }
}

/// What a Master is told when it is made.
#[derive(Clone, Debug)]
pub struct MasterConfig {
    /// Its own name.
    pub id: AgentId,
    /// Which picture.
    pub work: WorkId,
    /// How winners are found.
    pub auction: AuctionRule,
    /// Zones that an agent has in hand at most: as [`RenderAgentConfig::prefetch`](crate::RenderAgentConfig::prefetch).
    pub prefetch: u32,
    /// Whether, near the end, zones are cut into pieces and slow agents' zones given to idle ones as well. Of use where
    /// agents have machines of their own; those who share one have its processors anyway.
    pub shares_tail: bool,
    /// How a goal is neared.
    pub goals: GoalRules,
    /// How long it waits for what.
    pub timing: Timing,
}

/// A row that is being written.
#[derive(Clone, Debug)]
struct Write {
    ticket: Ticket,
    /// What the row shall be, and the revision that it must have before.
    row: Arc<ZoneRow>,
    expected_revision: Revision,
    then: Then,
}

/// What follows when a row is written.
#[derive(Clone, Debug)]
enum Then {
    /// The agent gets its order, in this conversation.
    Order(u64),
    /// The agent learns that its report is on the blackboard.
    Receive(Box<FarmMessage>),
    /// Nothing: the zone is open again.
    TakenBack,
}

/// One round of the auction.
#[derive(Clone, Debug)]
struct Round {
    deadline: Time,
    offers: Vec<Offer>,
    awaited: BTreeSet<AgentId>,
    proposals: BTreeMap<AgentId, Proposal>,
}

/// The state machine of a Master.
#[derive(Clone, Debug)]
pub struct Master {
    config: MasterConfig,
    board: Blackboard,
    /// Rows to put on an empty Blackboard first: what was kept of an interrupted work. By ticket, until written.
    kept: BTreeMap<Ticket, FarmValue>,
    /// The watch has told all that there was.
    caught_up: bool,
    begun: bool,
    stopping: bool,
    finished: bool,
    ledger: Ledger,
    roster: Roster,
    composition: Composition,
    /// Rounds under way, by conversation. Each has its own zones and its own bidders.
    rounds: BTreeMap<u64, Round>,
    /// Whether a zone has come to wait for a winner since the agent that would have it soonest was looked for.
    recalls: bool,
    /// Those of them in which all have answered.
    answered: Vec<u64>,
    /// Pieces that were cut off and have no row yet, with the zones that say so.
    owed: BTreeMap<ZoneId, ZoneId>,
    writes: BTreeMap<ZoneId, Write>,
    tickets: BTreeMap<Ticket, ZoneId>,
    /// When the present order of a zone was sent.
    sent: BTreeMap<ZoneId, Time>,
    /// When the present pass over the picture began, where there is a time to keep.
    pass_begun: Time,
    /// Reference-machine time painted since then.
    pass_painted: Duration,
    last_number: u64,
    next_look: Option<Time>,
}

impl Master {
    /// A Master that has just been born. It goes on from what it finds on the Blackboard.
    pub fn new(config: MasterConfig) -> Self {
        let ledger = Ledger::new(config.auction);
        let roster = Roster::new(config.prefetch as usize);
        Self {
            config,
            board: Blackboard::default(),
            kept: BTreeMap::new(),
            caught_up: false,
            begun: false,
            stopping: false,
            finished: false,
            ledger,
            roster,
            composition: Composition::default(),
            rounds: BTreeMap::new(),
            recalls: false,
            answered: Vec::new(),
            owed: BTreeMap::new(),
            writes: BTreeMap::new(),
            tickets: BTreeMap::new(),
            sent: BTreeMap::new(),
            pass_begun: Time::ZERO,
            pass_painted: Duration::ZERO,
            last_number: 0,
            next_look: None,
        }
    }

    /// A Master that goes on with a work of which rows were kept, on a Blackboard that is empty.
    ///
    /// Zones that were in hand are open again; what is done is done.
    pub fn recover(config: MasterConfig, work: WorkRow, rows: impl IntoIterator<Item = ZoneRow>) -> Self {
        let mut master = Self::new(config);
        let rows = rows.into_iter().map(|row| FarmValue::Zone(Arc::new(row.resumed())));
        for value in std::iter::once(FarmValue::Work(Arc::new(work))).chain(rows) {
            let ticket = Ticket(master.number());
            master.kept.insert(ticket, value);
        }
        master
    }

    /// What it has seen of the Blackboard.
    pub fn board(&self) -> &Blackboard {
        &self.board
    }

    /// Whether all zones are in the film or given up.
    pub fn is_finished(&self) -> bool {
        self.finished
    }

    fn number(&mut self) -> u64 {
        self.last_number += 1;
        self.last_number
    }

    // The Blackboard.

    fn start(&mut self, actions: &mut Vec<FarmAction>) {
        for (&ticket, value) in &self.kept {
            actions.push(self.put_kept(ticket, value));
        }
        let prefix = work_prefix(self.config.work);
        actions.push(FarmAction::Store { ticket: WATCH, request: StoreRequest::Watch { prefix } });
    }

    fn put_kept(&self, ticket: Ticket, value: &FarmValue) -> FarmAction {
        let key = match value {
            FarmValue::Zone(row) => zone_key(row.work, row.zone),
            FarmValue::Work(row) => work_key(row.work),
            FarmValue::Agent(row) => agent_key(self.config.work, &row.agent),
        };
        let (expected_revision, value) = (Revision::ABSENT, value.clone());
        FarmAction::Store { ticket, request: StoreRequest::CompareAndSet { key, expected_revision, value } }
    }

    fn handle_store(&mut self, now: Time, ticket: Ticket, reply: StoreReply<FarmValue>, actions: &mut Vec<FarmAction>) {
        if let Some(value) = self.kept.remove(&ticket) {
            // Written, or there already; the watch reports it.
            if reply == StoreReply::Unavailable {
                actions.push(self.put_kept(ticket, &value));
                self.kept.insert(ticket, value);
            }
            return;
        }
        match reply {
            StoreReply::Changed(entry) => self.see(now, entry, actions),
            StoreReply::CaughtUp => self.caught_up = true,
            StoreReply::Written { key, revision } => {
                if let Some(write) = self.tickets.get(&ticket).and_then(|zone| self.writes.get(zone)) {
                    let value = FarmValue::Zone(write.row.clone());
                    self.see(now, Entry { key, revision, value }, actions);
                }
            }
            StoreReply::Conflict { entry, .. } => {
                let Some(zone) = self.tickets.get(&ticket).copied() else { return };
                if let Some(entry) = entry {
                    self.see(now, entry, actions);
                }
                // Somebody else wrote this row, and not what was to be written.
                self.end_write(now, zone);
            }
            StoreReply::Unavailable => self.repeat_write(ticket, actions),
            StoreReply::Got { .. } => {}
        }
    }

    /// Takes in a row. It may be the one that is being written, seen by the watch before the answer or instead of it.
    fn see(&mut self, now: Time, entry: Entry<FarmValue>, actions: &mut Vec<FarmAction>) {
        let revision = entry.revision;
        if let FarmValue::Agent(row) = &entry.value {
            // Known from an earlier life of this Master; its lease begins anew.
            if self.roster.get(&row.agent).is_none() {
                self.roster.join(now, row.clone());
                self.refresh_hands(now, &row.agent.clone());
            }
        }
        let zone = match &entry.value {
            FarmValue::Zone(row) => Some(Arc::clone(row)),
            _ => None,
        };
        let rivals = zone.as_ref().and_then(|row| self.rivals(row));
        if self.board.see(entry).is_none() {
            return;
        }
        let Some(row) = zone else { return };
        if let Some((zone, rivals)) = rivals {
            self.withdraw(zone, rivals, actions);
        }
        actions.push(FarmAction::Effect(FarmEffect::ZoneChanged(row.clone())));
        self.sent.remove(&row.zone);
        self.composition.see(&row);
        self.note_cut(&row);
        self.recalls |= row.state == ZoneState::Profiled;
        let write = self.writes.get(&row.zone).filter(|write| revision > write.expected_revision).cloned();
        match write {
            Some(write) if write.row == row => {
                self.end_write(now, row.zone);
                self.after_write(now, write, revision, actions);
            }
            Some(_) => self.end_write(now, row.zone),
            None => self.count(now, &row),
        }
    }

    fn count(&mut self, now: Time, row: &ZoneRow) {
        for agent in self.ledger.count(row) {
            self.refresh_hands(now, &agent);
        }
    }

    fn refresh_hands(&mut self, now: Time, agent: &AgentId) {
        self.roster.set_hands(now, agent, self.ledger.load(agent));
    }

    /// Writes a zone's row only if it is still as it was seen. There is one write for a zone at a time.
    fn write(&mut self, now: Time, row: impl Into<Arc<ZoneRow>>, then: Then, actions: &mut Vec<FarmAction>) {
        let row = row.into();
        let expected_revision = self.board.zone(row.zone).map_or(Revision::ABSENT, |(revision, _)| revision);
        debug_assert!(!self.writes.contains_key(&row.zone));
        let ticket = Ticket(self.number());
        actions.push(FarmAction::Store { ticket, request: self.board.compare_and_set(row.clone()) });
        self.count(now, &row);
        self.tickets.insert(ticket, row.zone);
        self.writes.insert(row.zone, Write { ticket, row, expected_revision, then });
    }

    /// The store did not answer, and may have written or not. The same write again finds out.
    fn repeat_write(&mut self, ticket: Ticket, actions: &mut Vec<FarmAction>) {
        let Some(zone) = self.tickets.remove(&ticket) else { return };
        let again = Ticket(self.number());
        let Some(write) = self.writes.get_mut(&zone) else { return };
        write.ticket = again;
        self.tickets.insert(again, zone);
        let (expected_revision, value) = (write.expected_revision, FarmValue::Zone(write.row.clone()));
        let key = zone_key(write.row.work, zone);
        let request = StoreRequest::CompareAndSet { key, expected_revision, value };
        actions.push(FarmAction::Store { ticket: again, request });
    }

    /// A write has ended, well or not: from now on the zone counts as the Blackboard has it.
    fn end_write(&mut self, now: Time, zone: ZoneId) {
        if let Some(write) = self.writes.remove(&zone) {
            self.tickets.remove(&write.ticket);
        }
        if let Some((_, row)) = self.board.zone(zone) {
            let row = row.clone();
            self.count(now, &row);
        }
    }

    fn after_write(&mut self, now: Time, write: Write, fence: Revision, actions: &mut Vec<FarmAction>) {
        match write.then {
            Then::Order(conversation) => self.send_order(now, &write.row, fence, conversation, actions),
            Then::Receive(report) => {
                if let FarmContent::Report(Report { zone, fence, .. }) = report.content {
                    self.answer(&report, Performative::Confirm, FarmContent::Received { zone, fence }, actions);
                }
                if write.row.state == ZoneState::Done {
                    self.credit(&write.row, actions);
                }
                self.help_out(now, &report.sender, actions);
            }
            Then::TakenBack => {}
        }
    }

    /// Credit rises or falls in proportion to T_est − T.
    fn credit(&mut self, row: &ZoneRow, actions: &mut Vec<FarmAction>) {
        let (Some(estimated), Some(measured), Some(agent)) = (row.time_estimated, row.time_measured, &row.agent) else {
            return;
        };
        if let Some(row) = self.roster.update(agent, |row| row.credit = credit_after(row.credit, estimated, measured)) {
            self.put_agent(row, actions);
        }
    }

    /// An agent's credit, power or lanes are on the Blackboard.
    fn put_agent(&mut self, row: AgentRow, actions: &mut Vec<FarmAction>) {
        let (key, ticket) = (agent_key(self.config.work, &row.agent), Ticket(self.number()));
        let request = StoreRequest::Put { key, value: FarmValue::Agent(row) };
        actions.push(FarmAction::Store { ticket, request });
    }

    // Messages.

    fn handle_message(&mut self, now: Time, message: &FarmMessage, actions: &mut Vec<FarmAction>) {
        self.roster.hear(now, &message.sender);
        match (message.performative, &message.content) {
            (Performative::Subscribe, FarmContent::Subscription { power, lanes }) => {
                let before = self.roster.get(&message.sender).map(|member| &member.row);
                let before = before.or_else(|| self.board.agents().find(|row| row.agent == message.sender));
                let credit = before.map_or(0.0, |row| row.credit);
                let lanes = if lanes.is_finite() { lanes.clamp(1e-3, 1e6) } else { 1.0 };
                self.subscribe(
                    now,
                    message,
                    AgentRow { agent: message.sender.clone(), power: *power, lanes, credit },
                    actions,
                );
            }
            (Performative::Cancel, FarmContent::Unsubscription) => self.dismiss(now, &message.sender, actions),
            (Performative::Inform, FarmContent::Alive { power, hands }) => {
                if self.roster.update(&message.sender, |row| row.power = *power).is_none() {
                    return self.answer(message, Performative::Refuse, FarmContent::Nothing, actions);
                }
                self.repeat_orders(now, &message.sender, hands, actions);
            }
            (Performative::Propose, FarmContent::Bids { room, bids }) => {
                let proposal = Proposal { room: (*room).min(self.config.prefetch), bids: bids.clone() };
                self.take_bid(message, Some(proposal));
            }
            (Performative::Refuse, FarmContent::Nothing) => {
                self.roster.rest(&message.sender, now + self.config.timing.heartbeat);
                self.take_bid(message, None);
            }
            (Performative::Inform | Performative::Failure, FarmContent::Report(report)) => {
                self.take_report(now, message, report, actions);
            }
            (Performative::Inform, FarmContent::Analyzed(_)) | (Performative::NotUnderstood, _) => {}
            _ => self.answer(message, Performative::NotUnderstood, FarmContent::Nothing, actions),
        }
    }

    /// Workflow, steps 1 and 4: the agent is on the list, and is told of the scene when there is one.
    fn subscribe(&mut self, now: Time, message: &FarmMessage, row: AgentRow, actions: &mut Vec<FarmAction>) {
        if self.roster.join(now, row.clone()).is_none() {
            return self.answer(message, Performative::Refuse, FarmContent::Nothing, actions);
        }
        self.refresh_hands(now, &row.agent);
        self.answer(message, Performative::Agree, FarmContent::Subscribed, actions);
        self.introduce(std::slice::from_ref(&row.agent), actions);
        self.put_agent(row, actions);
    }

    fn introduce(&self, agents: &[AgentId], actions: &mut Vec<FarmAction>) {
        if let Some(work) = self.board.work().filter(|_| self.begun && !agents.is_empty()) {
            let scene = FarmContent::Scene(work.clone());
            let to = agents.to_vec();
            let inform = message(Performative::Inform, protocol::SUBSCRIBE, &self.config.id, to, scene);
            actions.push(FarmAction::Send(inform));
        }
    }

    /// An agent is gone: what it had in hand is open again, or its rival's.
    fn dismiss(&mut self, now: Time, agent: &AgentId, actions: &mut Vec<FarmAction>) {
        let round = self.roster.leave(agent).and_then(|member| member.round);
        if let Some(round) = round.and_then(|round| self.rounds.get_mut(&round)) {
            round.awaited.remove(agent);
            round.proposals.remove(agent);
        }
        for zone in self.ledger.hands(agent) {
            self.take_back(now, zone, agent, actions);
        }
    }

    /// A zone is no longer in this agent's hand.
    fn take_back(&mut self, now: Time, zone: ZoneId, agent: &AgentId, actions: &mut Vec<FarmAction>) {
        if let Some((_, row)) = self.board.zone(zone)
            && row.is_in_hand()
            && !self.writes.contains_key(&zone)
        {
            let is_here = |other: &AgentId| other != agent && self.roster.get(other).is_some();
            let row = match (&row.agent, &row.rival) {
                // The other one goes on, under the token that it has.
                (Some(other), _) if is_here(other) => return,
                (Some(_), Some(rival)) if is_here(&rival.agent) => ZoneRow { agent: None, ..row.clone() },
                _ => row.taken_back(),
            };
            self.write(now, row, Then::TakenBack, actions);
        }
    }

    /// An agent does not know of an order that it should have: it was lost on the way, or with the agent's memory.
    fn repeat_orders(
        &mut self,
        now: Time,
        agent: &AgentId,
        known: &[(ZoneId, Revision)],
        actions: &mut Vec<FarmAction>,
    ) {
        let grace = self.config.timing.heartbeat;
        for zone in self.ledger.hands(agent) {
            let Some((revision, row)) = self.board.shared(zone) else { continue };
            let being_written = self.writes.contains_key(&zone);
            let on_its_way = self.sent.get(&zone).is_some_and(|&sent| now < sent + grace);
            let is_known = row.fence_of(agent, revision).is_none_or(|fence| known.contains(&(zone, fence)));
            if is_known || being_written || on_its_way {
                continue;
            }
            match &row.agent {
                Some(other) if other == agent => {
                    let (row, conversation) = (Arc::clone(row), self.number());
                    self.send_order(now, &row, revision, conversation, actions);
                }
                // Another has taken it over.
                Some(_) => {}
                // Its order is older than the row, so it cannot be given again.
                None => {
                    let row = row.taken_back();
                    self.write(now, row, Then::TakenBack, actions);
                }
            }
        }
    }

    fn send_order(
        &mut self,
        now: Time,
        row: &Arc<ZoneRow>,
        fence: Revision,
        conversation: u64,
        actions: &mut Vec<FarmAction>,
    ) {
        let (Some(work), Some(agent)) = (self.board.work(), &row.agent) else { return };
        let order = Order { work: work.clone(), row: row.clone(), fence };
        let (performative, protocol, content) = if row.state == ZoneState::Profiling {
            (Performative::Request, protocol::REQUEST, FarmContent::Profile(order))
        } else {
            (Performative::AcceptProposal, protocol::CONTRACT_NET, FarmContent::Award(order))
        };
        let order = message(performative, protocol, &self.config.id, vec![agent.clone()], content);
        actions.push(FarmAction::Send(asking(order, conversation, None)));
        self.sent.insert(row.zone, now);
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

    /// Looks for those who have fallen silent.
    fn look(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        self.next_look = Some(now + self.config.timing.heartbeat);
        self.roster.wake(now);
        self.roster.ask_again();
        let lease = self.config.timing.lease;
        if now.elapsed() > lease {
            for agent in self.roster.silent(Time::since_start(now.elapsed() - lease)) {
                tracing::info!(%agent, "agent fell silent");
                self.dismiss(now, &agent, actions);
            }
        }
        let strangers: Vec<AgentId> =
            self.ledger.holders().filter(|agent| self.roster.get(agent).is_none()).cloned().collect();
        for agent in strangers {
            for zone in self.ledger.hands(&agent) {
                self.take_back(now, zone, &agent, actions);
            }
        }
        self.help_all(now, actions);
    }

    fn assert_invariants(&self) {
        self.ledger.assert_invariants();
        self.composition.assert_invariants();
        assert_eq!(self.tickets.len(), self.writes.len(), "each write has one open ticket");
    }
}

impl StateMachine for Master {
    type Content = FarmContent;
    type Value = FarmValue;
    type Effect = FarmEffect;
    type Completion = FarmCompletion;

    fn handle(&mut self, now: Time, event: FarmEvent, actions: &mut Vec<FarmAction>) {
        match event {
            FarmEvent::Start => {
                self.start(actions);
                self.next_look = Some(now + self.config.timing.heartbeat);
            }
            FarmEvent::Message(message) => self.handle_message(now, &message, actions),
            FarmEvent::Store { ticket, reply } => self.handle_store(now, ticket, reply, actions),
            FarmEvent::Completed(FarmCompletion::Composed { zone, outcome }) => {
                self.composed(now, zone, outcome, actions);
            }
            FarmEvent::Completed(FarmCompletion::Stop) => {
                self.stopping = true;
                self.rounds.clear();
            }
            FarmEvent::Completed(_) | FarmEvent::Presence { .. } | FarmEvent::Deadline => {}
        }
        if self.next_look.is_some_and(|at| at <= now) {
            self.look(now, actions);
        }
        self.advance(now, actions);
        self.assert_invariants();
    }

    fn next_deadline(&self) -> Option<Time> {
        // Rounds that began later end later.
        let round = self.rounds.values().next().map(|round| round.deadline);
        [self.next_look, round].into_iter().flatten().min()
    }
}
