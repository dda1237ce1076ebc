//! The Master: keeps the list of agents, assigns zones by auction, takes the results and has them composed.
//!
//! **Invariant:** its memory holds nothing that is not on the Blackboard, except for what can be lost without harm,
//! such as rounds of the auction and leases. A new Master reads the work's rows and continues.
//!
//! Every order is a compare-and-set on the zone's row. The new revision is the fencing token that the report must
//! carry; a report with an older one is refused. So a zone that was taken from a silent agent and given to another is
//! accepted once, from the first agent to finish with a valid token.

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

/// Maximum number of zones being composed at a time.
const COMPOSING_MAX: usize = 8;

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
    /// Shorter lease for agents on several machines, which disappear without notice more often than processes do.
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
    /// The Master's own id.
    pub id: AgentId,
    /// The id of the work.
    pub work: WorkId,
    /// The rule of the auction.
    pub auction: AuctionRule,
    /// Maximum number of zones an agent holds: as [`RenderAgentConfig::prefetch`](crate::RenderAgentConfig::prefetch).
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
    /// The timeouts.
    pub timing: Timing,
    /// The platform at which it registers; `None`: it does not.
    pub registration: Option<RegistrationConfig>,
}

/// A pending write of a zone's row.
#[derive(Clone, Debug)]
struct Write {
    /// The ticket of the last request.
    ticket: Ticket,
    /// The new row, and the revision that the row must have before.
    row: Arc<ZoneRow>,
    expected_revision: Revision,
    then: RowFollowUp,
}

/// The action after a row is written.
#[derive(Clone, Debug)]
enum RowFollowUp {
    /// Send the order to the agent, in this conversation.
    Order(u64),
    /// Confirm the report to the agent.
    Receive {
        /// The confirmation to send.
        confirmation: Box<FarmMessage>,
        /// True if the report is a success.
        well: bool,
        /// The measured promise, if the report ends an award and its time is valid.
        promise: Option<KeptPromise>,
    },
    /// None: the zone was taken back or prepared for its next order.
    TakenBack,
}

/// The measurement of a promise to paint a zone.
#[derive(Clone, Copy, Debug)]
struct KeptPromise {
    /// Time from order to report, by this Master's clock.
    taken: Duration,
    /// Time expected for the order from other agents' measurements, in reference-machine time; `None`: no measurements.
    worth: Option<Duration>,
}

/// A round of the auction in progress.
#[derive(Clone, Debug)]
struct Round {
    deadline: Time,
    offers: Vec<Offer>,
    /// Number of agents called.
    called: u32,
    awaited: Vec<MemberId>,
    proposals: Vec<(MemberId, Proposal)>,
}

/// The state machine of a Master.
#[derive(Clone, Debug)]
pub struct Master {
    config: MasterConfig,
    keys: WorkKeys,
    /// The registration at the directories, if there are any.
    registrant: Option<Box<Registrant>>,
    board: Blackboard,
    /// Rows of an interrupted work to write to an empty Blackboard first, by ticket, until written.
    kept: BTreeMap<Ticket, FarmValue>,
    /// The ticket of the subscription to the rows.
    watch: Ticket,
    /// True when the subscription has delivered all existing rows.
    caught_up: bool,
    begun: bool,
    stopping: bool,
    finished: bool,
    ledger: Ledger,
    roster: Roster,
    composition: Composition,
    /// Excluded agents, with the reason in their rows. A hash map for speed; never iterated.
    left_out: FxHashMap<AgentId, Arc<AgentRow>>,
    /// Number of unusable tiles of each agent; mostly empty.
    lost: BTreeMap<MemberId, u32>,
    /// Zones whose rows may depend on a painting of an agent found wrong; mostly empty.
    dubious: Vec<ZoneId>,
    /// Results of comparing paintings by their look.
    looks: Looks,
    worth: ZoneWorth,
    /// True if the film contains a zone that is painted again: a new film begins when the pending compositions are
    /// answered.
    film_is_stale: bool,
    /// Number of consecutive checks with too few machines to compare paintings.
    lacking: u32,
    /// Rounds in progress, by conversation. Each has its own zones and bidders.
    rounds: BTreeMap<u64, Round>,
    /// True if a zone has become open or an agent has less load since [`Self::recall`] last ran.
    recalls: bool,
    /// Bidders of rounds without any award, since the last award, report or newly open zone: they would bid the same
    /// again. A zone whose row is being written is on offer already, but cannot be awarded.
    in_vain: BTreeSet<MemberId>,
    /// Rounds in which all called agents have answered.
    answered: Vec<u64>,
    /// Pieces that were cut off and have no row yet, with the zones they were cut from.
    owed: BTreeMap<ZoneId, ZoneId>,
    /// Those of `owed` whose row must be written, again if a write failed.
    due: Vec<ZoneId>,
    /// Pending writes. Hash maps for speed, as the two below; never iterated.
    writes: FxHashMap<ZoneId, Write>,
    tickets: FxHashMap<Ticket, ZoneId>,
    /// Time at which the current order of a zone was sent.
    sent: FxHashMap<ZoneId, Time>,
    /// Agents whose credit has changed since it was written, in order of the change.
    credits_due: VecDeque<MemberId>,
    /// The members of `credits_due`; a hash set for speed, never iterated.
    credited: FxHashSet<MemberId>,
    /// Scratch space: agents whose load has changed.
    changed: Vec<MemberId>,
    /// Start of the current pass over the picture, with a goal of time.
    pass_begun: Time,
    /// Reference-machine time painted in the current pass.
    pass_painted: Duration,
    last_number: u64,
    watchdog: Watchdog,
    /// Number of orders sent so far.
    orders_sent: u64,
    /// True after a stall: the Master restarts when the film has answered.
    must_begin_again: bool,
    next_look: Option<Time>,
    /// Until then agents that an earlier Master knew may report to this one.
    expects_until: Time,
}

impl Master {
    /// A new Master, which continues from what it finds on the Blackboard.
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

    /// A Master that resumes a work from stored rows, on an empty Blackboard.
    ///
    /// Zones in hand are open again; finished zones stay finished.
    pub fn recover(config: MasterConfig, work: WorkRow, rows: impl IntoIterator<Item = ZoneRow>) -> Self {
        let mut master = Self::new(config);
        let rows = rows.into_iter().map(|row| FarmValue::Zone(Arc::new(row.resumed())));
        for value in std::iter::once(FarmValue::Work(Arc::new(work))).chain(rows) {
            let ticket = Ticket(master.number());
            master.kept.insert(ticket, value);
        }
        master
    }

    /// Its view of the Blackboard.
    pub fn board(&self) -> &Blackboard {
        &self.board
    }

    /// True if all zones are in the film or given up.
    pub fn is_finished(&self) -> bool {
        self.finished
    }

    /// Number of zones that wait for an agent.
    pub(crate) fn waiting_count(&self) -> usize {
        if self.begun && !self.stopping { self.ledger.waiting_count() } else { 0 }
    }

    /// A new number for a conversation or ticket.
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
        // Rounds end in the order in which they began.
        let round = self.rounds.values().next().map(|round| round.deadline);
        let holds_rounds = self.config.auction != AuctionRule::Stealing;
        let calls = holds_rounds && self.begun && !self.stopping && self.ledger.open.has_waiting();
        let due = self.roster.next_due().filter(|_| calls);
        let directories = self.registrant.as_ref().and_then(|registrant| registrant.next_deadline());
        [self.next_look, round, due, directories].into_iter().flatten().min()
    }
}
