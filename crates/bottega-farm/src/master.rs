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
mod deal;
mod ledger;
mod likeness;
mod looks;
mod members;
mod pace;
mod plan;
mod results;
mod roster;
mod rows;
mod stall;
mod tail;
mod trust;
mod verify;
mod watched;
mod worth;

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    sync::Arc,
    time::Duration,
};

use bottega_agents::{AgentId, Performative, Revision, StateMachine, StoreReply, StoreRequest, Ticket, Time};
use rustc_hash::{FxHashMap, FxHashSet};

use self::{composition::Composition, ledger::Ledger, looks::Looks, roster::Roster, worth::ZoneWorth};
use crate::{
    AgentRow, AuctionRule, Award, Bidder, BidderStanding, Blackboard, Choice, Credit, Decision, FarmAction,
    FarmCompletion, FarmContent, FarmEffect, FarmEvent, FarmMessage, FarmValue, GoalRules, Holding, LifeCycle,
    MemberId, Offer, Order, Painting, Partition, Proposal, RegistrationConfig, RelativePower, Report, Rival,
    RoundSummary, Watchdog, WorkId, WorkKeys, WorkRow, ZoneId, ZoneRow, ZoneState,
    auction::BIDDERS_MAX,
    contents::{answer, asking, message},
    decide,
    directory::MASTER_SERVICES,
    protocol,
    registrant::Registrant,
};

/// Results that the film is given at once.
const COMPOSING_MAX: usize = 8;

/// The waiting times of the Master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// For bids: silence is a refusal.
    pub bids: Duration,
    /// Between two looks at those who say nothing; agents speak as often.
    pub heartbeat: Duration,
    /// Until a silent agent counts as gone.
    pub lease: Duration,
}

impl Timing {
    /// Machines go without a word, processes hardly.
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

/// The configuration of a Master.
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
    /// Agents of different machines that must make the same of a zone before it counts; 1: whoever paints it is believed.
    pub verify: u32,
    /// Whether engines give no two agents the same bits, so that pixels are looked at to compare them.
    pub compares_by_look: bool,
    /// What nobody else knows: it decides what of agents that are believed is compared all the same.
    pub secret: u64,
    /// How far the promises of machines held in works before, by [name](bottega_agents::machine_of).
    pub credits: Arc<BTreeMap<String, Credit>>,
    /// How a goal is neared.
    pub goals: GoalRules,
    /// How long it waits for what.
    pub timing: Timing,
    /// Where it registers, if it does.
    pub registration: Option<RegistrationConfig>,
}

/// A row that is being written.
#[derive(Clone, Debug)]
struct Write {
    /// Of the request that was sent last.
    ticket: Ticket,
    /// What the row shall be, and the revision that it must have before.
    row: Arc<ZoneRow>,
    expected_revision: Revision,
    then: RowFollowUp,
}

/// What follows when a row is written.
#[derive(Clone, Debug)]
enum RowFollowUp {
    /// The agent gets its order, in this conversation.
    Order(u64),
    /// The agent learns, by this message, that its report is on the blackboard.
    Receive {
        confirmation: Box<FarmMessage>,
        /// Whether something was painted.
        well: bool,
        /// How the promise held, where it was one and its end was measured.
        promise: Option<KeptPromise>,
    },
    /// Nothing: the zone is open again.
    TakenBack,
}

/// The end of a promise to paint a zone.
#[derive(Clone, Copy, Debug)]
struct KeptPromise {
    /// How long the agent had the order, by this Master's clock.
    taken: Duration,
    /// What the order was worth, in reference-machine time; `None`: nobody has measured anything.
    worth: Option<Duration>,
}

/// One round of the auction.
#[derive(Clone, Debug)]
struct Round {
    deadline: Time,
    offers: Vec<Offer>,
    /// How many were called.
    called: u32,
    awaited: Vec<MemberId>,
    proposals: Vec<(MemberId, Proposal)>,
}

/// The state machine of a Master.
#[derive(Clone, Debug)]
pub struct Master {
    config: MasterConfig,
    keys: WorkKeys,
    /// Its part that talks to the directories, where there are some.
    registrant: Option<Box<Registrant>>,
    board: Blackboard,
    /// Rows to put on an empty Blackboard first: what was kept of an interrupted work. By ticket, until written.
    kept: BTreeMap<Ticket, FarmValue>,
    /// The ticket of the watch over the rows.
    watch: Ticket,
    /// The watch has told all that there was.
    caught_up: bool,
    begun: bool,
    stopping: bool,
    finished: bool,
    ledger: Ledger,
    roster: Roster,
    composition: Composition,
    /// Agents that are left out, with the reason in their rows. A hash map, for speed: never gone through.
    left_out: FxHashMap<AgentId, Arc<AgentRow>>,
    /// Of whom tiles could not be used, and how many; mostly nobody.
    lost: BTreeMap<MemberId, u32>,
    /// Zones whose rows may rest on the word of one that was found wrong; mostly none.
    dubious: Vec<ZoneId>,
    /// What is known of pixels that were compared by their look.
    looks: Looks,
    worth: ZoneWorth,
    /// Something in the film is to be painted again: it is begun anew when it has answered.
    film_is_stale: bool,
    /// For how many looks there have been too few machines to compare.
    lacking: u32,
    /// Rounds under way, by conversation. Each has its own zones and its own bidders.
    rounds: BTreeMap<u64, Round>,
    /// Whether a zone has come to wait for a winner, or somebody has less to do, since the agent that would have it soonest was looked for.
    recalls: bool,
    /// Who bid in rounds that gave nothing away, since something was given or painted or a zone came to wait: asked again at once, they would bid
    /// the same. A zone whose row is being written is offered already, but cannot be given.
    in_vain: BTreeSet<MemberId>,
    /// Those of them in which all have answered.
    answered: Vec<u64>,
    /// Pieces that were cut off and have no row yet, with the zones that say so.
    owed: BTreeMap<ZoneId, ZoneId>,
    /// Those of them that nobody has tried to write yet, or not well.
    due: Vec<ZoneId>,
    /// Hash maps, as the two below, for speed: never gone through.
    writes: FxHashMap<ZoneId, Write>,
    tickets: FxHashMap<Ticket, ZoneId>,
    /// When the present order of a zone was sent.
    sent: FxHashMap<ZoneId, Time>,
    /// Whose credit has changed since it was written, in that order.
    credits_due: VecDeque<MemberId>,
    /// The same; a hash set, for speed: never gone through.
    credited: FxHashSet<MemberId>,
    /// Kept for its memory: whose hands have changed.
    changed: Vec<MemberId>,
    /// When the present pass over the picture began, where there is a time to keep.
    pass_begun: Time,
    /// Reference-machine time painted since then.
    pass_painted: Duration,
    last_number: u64,
    watchdog: Watchdog,
    /// Orders that were sent so far.
    orders_sent: u64,
    /// Nothing has begun for long: it begins again when the film has answered.
    must_begin_again: bool,
    next_look: Option<Time>,
    /// Until then agents that a Master before it knew may tell this one that they are there.
    expects_until: Time,
}

impl Master {
    /// A Master that has just been born. It goes on from what it finds on the Blackboard.
    pub fn new(config: MasterConfig) -> Self {
        let ledger = Ledger::new(config.auction);
        let window = config.auction.window(config.prefetch) as usize;
        let roster = Roster::new(window, config.auction.weighs_promises());
        let place = config.registration.clone();
        let registrant = place.map(|place| Box::new(Registrant::new(config.id.clone(), place, &MASTER_SERVICES)));
        Self {
            keys: WorkKeys::new(config.work),
            config,
            registrant,
            board: Blackboard::default(),
            kept: BTreeMap::new(),
            watch: Ticket(0),
            caught_up: false,
            begun: false,
            stopping: false,
            finished: false,
            ledger,
            roster,
            composition: Composition::default(),
            left_out: FxHashMap::default(),
            lost: BTreeMap::new(),
            dubious: Vec::new(),
            looks: Looks::default(),
            worth: ZoneWorth::default(),
            film_is_stale: false,
            lacking: 0,
            rounds: BTreeMap::new(),
            recalls: false,
            in_vain: BTreeSet::new(),
            answered: Vec::new(),
            owed: BTreeMap::new(),
            due: Vec::new(),
            writes: FxHashMap::default(),
            tickets: FxHashMap::default(),
            sent: FxHashMap::default(),
            credits_due: VecDeque::new(),
            credited: FxHashSet::default(),
            changed: Vec::new(),
            pass_begun: Time::ZERO,
            pass_painted: Duration::ZERO,
            last_number: 0,
            watchdog: Watchdog::default(),
            orders_sent: 0,
            must_begin_again: false,
            next_look: None,
            expects_until: Time::ZERO,
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

    /// Zones that wait for an agent.
    pub(crate) fn waiting_count(&self) -> usize {
        if self.begun && !self.stopping { self.ledger.waiting_count() } else { 0 }
    }

    fn number(&mut self) -> u64 {
        self.last_number += 1;
        self.last_number
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
        let mut news = true;
        match event {
            FarmEvent::Start => {
                self.start(actions);
                self.next_look = Some(now + self.config.timing.heartbeat);
                self.expects_until = now + self.config.timing.lease;
            }
            FarmEvent::Message(message) if let FarmContent::Management(_) = message.content => {
                self.registrant.as_mut().and_then(|registrant| registrant.hear(now, &message));
                news = false;
            }
            FarmEvent::Message(message) => self.handle_message(now, &message, actions),
            FarmEvent::Store { ticket, reply } => news = self.handle_store(now, ticket, reply, actions),
            FarmEvent::Completed(FarmCompletion::Composed { zone, outcome }) => {
                self.composed(now, zone, outcome, actions);
            }
            FarmEvent::Completed(FarmCompletion::Compared { zone, results, outcome }) => {
                self.looked_at(now, zone, results, outcome, actions);
            }
            FarmEvent::Completed(FarmCompletion::Requeue { zone, fence }) => self.requeue(now, zone, fence, actions),
            FarmEvent::Completed(FarmCompletion::Stop) => {
                self.stopping = true;
                self.rounds.clear();
            }
            FarmEvent::Completed(_) | FarmEvent::Presence { .. } | FarmEvent::Deadline => {}
        }
        if self.next_look.is_some_and(|at| at <= now) {
            self.look(now, actions);
            news = true;
        }
        if let Some(registrant) = self.registrant.as_mut().filter(|_| !self.finished) {
            registrant.tick(now, actions);
        }
        if news {
            self.advance(now, actions);
            self.assert_invariants();
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        // Rounds that began later end later.
        let round = self.rounds.values().next().map(|round| round.deadline);
        let holds_rounds = self.config.auction != AuctionRule::Stealing;
        let calls = holds_rounds && self.begun && !self.stopping && self.ledger.open.has_waiting();
        let due = self.roster.next_due().filter(|_| calls);
        let directories = self.registrant.as_ref().and_then(|registrant| registrant.next_deadline());
        [self.next_look, round, due, directories].into_iter().flatten().min()
    }
}
