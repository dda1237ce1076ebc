//! The driver in virtual time: processes events in the order of their times and checks invariants.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, VecDeque};
use std::time::Duration;

use super::device::{Fate, Parcel, SimulatedDevice};
use super::load::{Arrival, Load};
use super::model::Model;
use crate::policy::cable::CableBytes;
use crate::policy::core::{Core, DrawnPacket, FollowUps, Next, PacketLanding};
use crate::policy::faults::GiveUp;
use crate::policy::incident::Fault;
use crate::policy::ledger::Ledger;
use crate::policy::time::Time;
use crate::policy::unit::{Chunk, Data, Meta, Unit};
use crate::{CostBook, HraConfig, HraReport, ResourceId, Transfer, UnitError};

/// The outcome of a unit.
#[derive(Clone, Debug, PartialEq)]
pub struct AnsweredUnit {
    /// The result. `None`: cancelled.
    pub outcome: Option<Result<(), UnitError>>,
    /// Time of the answer.
    pub at: Time,
    /// Time of submission; zero if the unit was cancelled before.
    pub submitted: Time,
    /// Waiting time in the bin before it was first given to a resource, if it was.
    pub waited: Option<Duration>,
    /// The resource whose attempt led to the answer; `None`: the unit was answered or cancelled while it waited.
    pub resource: Option<ResourceId>,
}

/// The outcome of a simulation.
#[derive(Clone, Debug)]
pub struct DayOutcome {
    /// The answers, one per unit, in the order of the load. `None`: the unit was lost, a violation.
    pub answers: Vec<Option<AnsweredUnit>>,
    /// Number of units answered more than once, a violation.
    pub doubled: usize,
    /// True if a resource had to hold more than its memory, a violation.
    pub overfull: bool,
    /// Time of the last answer or cancellation.
    pub end: Time,
    /// Maximum number of units waiting in the bin.
    pub waiting_max: usize,
    /// The report of the allocator at the end.
    pub report: HraReport,
}

impl DayOutcome {
    /// Returns the number of units that were done without an error.
    pub fn done(&self) -> usize {
        self.answers.iter().flatten().filter(|answer| answer.outcome == Some(Ok(()))).count()
    }

    /// Returns the number of units that were never answered.
    pub fn lost(&self) -> usize {
        self.answers.iter().filter(|answer| answer.is_none()).count()
    }
}

/// Runs a load until every unit is answered, and returns the outcome. Equal arguments give equal outcomes.
///
/// - `models`: the resources of the allocator.
/// - `costs`: the costs that are known at the start.
/// - `seed`: the seed of the noise of times and of faults.
///
/// Every unit can be attempted again, like one with a [`Work::backup`](crate::Work::backup).
pub fn simulate(config: HraConfig, models: &[Model], load: &Load, costs: &CostBook, seed: u64) -> DayOutcome {
    let mut world = VirtualWorld::new(config, models, load, costs, seed);
    world.run();
    world.outcome()
}

/// An event of the simulation, at a point of virtual time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum WorldEvent {
    /// All units from this index on with the same time are submitted.
    Arrive(usize),
    CancelAll,
    /// A reply arrives, if the device is still of that generation.
    Reply {
        lane: u32,
        sequence: u64,
        generation: u64,
    },
    Ask(u32),
    Tick,
}

struct VirtualWorld<'a> {
    core: Core<usize>,
    devices: Vec<SimulatedDevice>,
    ledgers: Vec<Ledger<usize>>,
    load: &'a [Arrival],
    /// Units that wait for room in the bin.
    outside: VecDeque<(usize, bool)>,
    answers: Vec<Option<AnsweredUnit>>,
    first_waits: Vec<Option<Duration>>,
    submitted: Vec<Time>,
    doubled: usize,
    waiting_max: usize,
    /// The planned fault of each packet, by lane and packet; `None`: it succeeds.
    fates: Vec<BTreeMap<u64, Option<Fault>>>,
    /// The traffic that a far device measures on its cable.
    transfers: Vec<BTreeMap<u64, [Transfer; 2]>>,
    events: BinaryHeap<Reverse<(Time, u64, WorldEvent)>>,
    event_count: u64,
    next_tick: Time,
    to_ask: VecDeque<ResourceId>,
    now: Time,
    max_delay_bound: Duration,
    end: Time,
}

impl<'a> VirtualWorld<'a> {
    fn new(config: HraConfig, models: &[Model], load: &'a Load, costs: &CostBook, seed: u64) -> Self {
        let described = models.iter().map(|model| (model.descriptor(), model.window)).collect();
        let count = load.arrivals.len();
        let seeds = (0..models.len() as u64).map(|lane| seed.wrapping_mul(1_000_003).wrapping_add(lane));
        let mut world = Self {
            core: Core::new(config, described, costs),
            devices: models.iter().cloned().zip(seeds).map(|(model, seed)| SimulatedDevice::new(model, seed)).collect(),
            ledgers: models.iter().map(|_| Ledger::new()).collect(),
            load: &load.arrivals,
            outside: VecDeque::new(),
            answers: vec![None; count],
            first_waits: vec![None; count],
            submitted: vec![Time::ZERO; count],
            doubled: 0,
            waiting_max: 0,
            fates: models.iter().map(|_| BTreeMap::new()).collect(),
            transfers: models.iter().map(|_| BTreeMap::new()).collect(),
            events: BinaryHeap::new(),
            event_count: 0,
            next_tick: Time::NEVER,
            to_ask: (0..models.len() as u32).map(ResourceId).collect(),
            now: Time::ZERO,
            max_delay_bound: config.max_delay_bound,
            end: Time::ZERO,
        };
        if let Some(first) = load.arrivals.first() {
            world.schedule(first.at, WorldEvent::Arrive(0));
        }
        for &at in &load.cancelled {
            world.schedule(at, WorldEvent::CancelAll);
        }
        world
    }

    fn schedule(&mut self, at: Time, event: WorldEvent) {
        self.event_count += 1;
        self.events.push(Reverse((at.max(self.now), self.event_count, event)));
    }

    fn run(&mut self) {
        self.settle_down();
        while let Some(Reverse((at, _, event))) = self.events.pop() {
            self.now = at;
            self.happen(event);
            self.settle_down();
            self.waiting_max = self.waiting_max.max(self.core.waiting());
        }
    }

    fn outcome(mut self) -> DayOutcome {
        let report = {
            let waiting = self.core.waiting();
            HraReport::of(&mut self.core, self.end, waiting)
        };
        DayOutcome {
            answers: self.answers,
            doubled: self.doubled,
            overfull: self.devices.iter().any(|device| device.overfull),
            end: self.end,
            waiting_max: self.waiting_max,
            report,
        }
    }

    fn happen(&mut self, event: WorldEvent) {
        match event {
            WorldEvent::Arrive(from) => self.arrive(from),
            WorldEvent::CancelAll => {
                for unit in self.core.cancel(|_| true) {
                    self.answer(unit.load, None, None);
                }
                for (index, announced) in std::mem::take(&mut self.outside) {
                    if announced {
                        self.core.retract(self.load[index].primitive, self.load[index].size);
                    }
                    self.answer(index, None, None);
                }
            }
            WorldEvent::Reply { lane, sequence, generation } => {
                if self.devices[lane as usize].generation == generation {
                    self.reply(ResourceId(lane), sequence);
                }
            }
            WorldEvent::Ask(lane) => self.to_ask.push_back(ResourceId(lane)),
            // Ignore ticks that an earlier tick has replaced; each sets another one
            WorldEvent::Tick if self.now < self.next_tick => {}
            WorldEvent::Tick => {
                self.next_tick = Time::NEVER;
                self.with_core(Core::tick);
            }
        }
    }

    fn with_core<R>(&mut self, decide: impl FnOnce(&mut Core<usize>, Time, &mut FollowUps<usize>) -> R) -> R {
        let mut out = FollowUps::default();
        let decided = decide(&mut self.core, self.now, &mut out);
        self.follow(out);
        decided
    }

    fn follow(&mut self, out: FollowUps<usize>) {
        self.to_ask.extend(out.wake);
        for unit in out.expired {
            self.answer(unit.load, Some(Err(UnitError::Expired)), None);
        }
        for unit in out.orphans {
            self.answer(unit.load, Some(Err(UnitError::NoResource(unit.meta.primitive))), None);
        }
        let overdue = out.overdue.into_iter().map(|packet| (packet, true));
        for ((id, sequence), blamed) in overdue.chain(out.doubtful.into_iter().map(|packet| (packet, false))) {
            let units = self.ledgers[id.index()].settle(sequence).into_iter().flatten().collect();
            self.with_core(|core, now, out| core.hung(now, id, sequence, out));
            self.give_back(id, units, blamed);
            self.to_ask.push_back(id);
        }
    }

    /// Does everything due at the current time.
    fn settle_down(&mut self) {
        loop {
            self.let_in();
            let Some(id) = self.to_ask.pop_front() else { break };
            self.ask(id);
        }
        if let Some(next) = self.core.next_event(self.now)
            && next < self.next_tick
        {
            self.next_tick = next;
            self.schedule(next, WorldEvent::Tick);
        }
    }

    // ---- The submitter.

    fn arrive(&mut self, from: usize) {
        let at = self.load[from].at;
        let group = self.load[from..].iter().take_while(|arrival| arrival.at == at).count();
        let room = self.core.capacity().saturating_sub(self.core.waiting() + self.outside.len());
        for index in from..from + group {
            let announced = index - from >= room;
            if announced {
                self.core.announce(self.load[index].primitive, self.load[index].size);
            }
            self.outside.push_back((index, announced));
        }
        if let Some(next) = self.load.get(from + group) {
            self.schedule(next.at, WorldEvent::Arrive(from + group));
        }
    }

    /// Puts waiting units into the bin while it has room.
    fn let_in(&mut self) {
        while self.core.waiting() < self.core.capacity() {
            let Some(&(first, announced)) = self.outside.front() else { return };
            let mut chunk = Chunk::new(self.unit(first), announced);
            self.outside.pop_front();
            while self.core.waiting() + chunk.len() < self.core.capacity()
                && let Some(&(next, announced)) = self.outside.front()
            {
                let unit = self.unit(next);
                if !chunk.accepts(&unit.meta, announced) {
                    break;
                }
                chunk.push(unit);
                self.outside.pop_front();
            }
            self.with_core(|core, now, out| core.submit(now, chunk, out));
        }
    }

    fn unit(&mut self, index: usize) -> Unit<usize> {
        let Arrival { primitive, size, data, priority, max_delay, validity, payload_bytes, answer_bytes, .. } =
            self.load[index];
        self.submitted[index] = self.now;
        let meta = Meta {
            primitive,
            size,
            bytes: CableBytes { there: payload_bytes, back: answer_bytes },
            data: data.map(|(id, bytes)| Data { id, bytes }),
            priority,
            submitted: self.now,
            late: self.now.after(max_delay.min(self.max_delay_bound)),
            expires: self.now.after(validity),
            attempts: 0,
            failed_on: Vec::new(),
        };
        Unit { meta, load: index }
    }

    // ---- The resources.

    fn ask(&mut self, id: ResourceId) {
        loop {
            match self.with_core(|core, now, out| core.next(now, id, out)) {
                Next::Packet(packet) => self.send(id, packet),
                Next::Recover(evicted) => {
                    evicted.into_iter().for_each(|data| self.devices[id.index()].evict(data));
                    let outcome = self.devices[id.index()].recover(self.now);
                    self.with_core(|core, now, out| core.recovered(now, id, outcome, out));
                }
                Next::Wait(until) => {
                    if let Some(until) = until {
                        self.schedule(until, WorldEvent::Ask(id.0));
                    }
                    return;
                }
                Next::End => return,
            }
            if !self.devices[id.index()].is_far() && self.ledgers[id.index()].is_busy() {
                return; // It is called directly, and its thread is gone until it returns.
            }
        }
    }

    fn send(&mut self, id: ResourceId, packet: DrawnPacket<usize>) {
        let DrawnPacket { sequence, units, evicted, .. } = packet;
        let device = &mut self.devices[id.index()];
        evicted.into_iter().for_each(|data| device.evict(data));
        let Some(first) = units.first().map(|unit| &unit.meta) else { return };
        let parcel = Parcel {
            primitive: first.primitive,
            units: units.len(),
            items: units.iter().map(|unit| unit.meta.size).sum(),
            bytes: units.iter().map(|unit| unit.meta.bytes).fold(CableBytes::default(), CableBytes::add),
            data: first.data.map(|data| (data.id, data.bytes)),
        };
        for unit in &units {
            self.first_waits[unit.load].get_or_insert(self.now.since(unit.meta.submitted));
        }
        if let Some(transfers) = device.transfers(parcel.bytes) {
            self.transfers[id.index()].insert(sequence, transfers);
        }
        let before = device.generation;
        let Fate { at, fault } = device.send(self.now, &parcel);
        let (after, is_far) = (device.generation, device.is_far());
        self.ledgers[id.index()].enter(sequence, units);
        self.fates[id.index()].insert(sequence, fault);
        if let Some(at) = at {
            self.schedule(at, WorldEvent::Reply { lane: id.0, sequence, generation: after });
        }
        // A device that dies loses everything else that it holds
        if is_far && after != before && fault == Some(Fault::Died) {
            for other in self.ledgers[id.index()].sequences() {
                self.fates[id.index()].insert(other, Some(Fault::Died));
                self.schedule(self.now, WorldEvent::Reply { lane: id.0, sequence: other, generation: after });
            }
        }
    }

    fn reply(&mut self, id: ResourceId, sequence: u64) {
        let fault = self.fates[id.index()].remove(&sequence).flatten();
        self.to_ask.push_back(id);
        let Some(units) = self.ledgers[id.index()].settle(sequence) else {
            self.with_core(|core, now, out| core.landed(now, id, sequence, PacketLanding::default(), out));
            return;
        };
        let is_late = |unit: &&Unit<usize>| fault.is_none() && unit.meta.expires <= self.now;
        let mut landing = PacketLanding {
            transfers: self.transfers[id.index()].remove(&sequence),
            expired: units.iter().filter(is_late).count() as u64,
            ..PacketLanding::default()
        };
        match fault {
            None => {
                landing.done = units.len();
                landing.done_items = units.iter().map(|unit| unit.meta.size).sum();
            }
            Some(fault) => {
                landing.failed = units.len();
                landing.fault = Some((fault, fault.name().to_owned()));
            }
        }
        let landed = self.with_core(|core, now, out| core.landed(now, id, sequence, landing, out));
        let blamed = landed.as_ref().is_none_or(|landed| landed.blamed);
        let device = &mut self.devices[id.index()];
        landed.into_iter().flat_map(|landed| landed.evicted).for_each(|data| device.evict(data));
        if fault.is_some() {
            self.give_back(id, units, blamed);
        } else {
            for unit in units {
                let expired = unit.meta.expires <= self.now;
                self.answer(unit.load, Some(if expired { Err(UnitError::Expired) } else { Ok(()) }), Some(id));
            }
        }
    }

    fn give_back(&mut self, id: ResourceId, units: Vec<Unit<usize>>, blamed: bool) {
        for unit in units {
            let given_up = self.with_core(|core, now, out| core.give_back(now, id, unit, blamed, out));
            if let Some((unit, why)) = given_up {
                let error = match why {
                    GiveUp::Failed => UnitError::Failed { attempts: unit.meta.attempts, reason: String::new() },
                    GiveUp::NoResource => UnitError::NoResource(unit.meta.primitive),
                    GiveUp::Closed => UnitError::Closed,
                    GiveUp::Expired => UnitError::Expired,
                };
                self.answer(unit.load, Some(Err(error)), Some(id));
            }
        }
    }

    fn answer(&mut self, index: usize, outcome: Option<Result<(), UnitError>>, resource: Option<ResourceId>) {
        let (at, submitted, waited) = (self.now, self.submitted[index], self.first_waits[index]);
        self.end = at;
        self.doubled += usize::from(self.answers[index].is_some());
        self.answers[index] = Some(AnsweredUnit { outcome, at, submitted, waited, resource });
    }
}
