//! The core of the allocator, without threads: units come in, resources ask for work and answer, and decisions go out.

use std::time::Duration;

use super::account::Account;
use super::bin_log::BinReport;
use super::cable::CableBytes;
use super::choice::LaneChoice;
use super::flow::Flow;
use super::incident::{Fault, Incidents};
use super::lane::{Flight, Health, LaneState, Launch};
use super::placement::Placement;
use super::resource_states::ResourceStates;
use super::time::Time;
use super::unit::{Chunk, Unit};
use super::waiting::WaitingWork;
use crate::{
    Activity, CostBook, DataId, Expiries, HraConfig, Primitive, ResourceDescriptor, ResourceId, Transfer, Window,
};

/// State and decisions of an allocator whose units carry a `T`.
pub(crate) struct Core<T> {
    pub(super) config: HraConfig,
    pub(super) lanes: ResourceStates,
    pub(super) waiting: WaitingWork<T>,
    pub(super) placement: Placement,
    pub(super) incidents: Incidents,
    pub(super) expiries: Expiries,
    pub(super) closed: bool,
}

/// The next step of a resource.
pub(crate) enum Next<T> {
    /// Compute this packet.
    Packet(DrawnPacket<T>),
    /// Evict this data, because after such a failure its contents are unknown; recover, and report the result.
    Recover(Vec<DataId>),
    /// Ask again when woken, when something is answered, and at this time.
    Wait(Option<Time>),
    /// End: the resource is not used again.
    End,
}

/// Units given to a resource together; all of one primitive and on the same data.
pub(crate) struct DrawnPacket<T> {
    pub(crate) sequence: u64,
    pub(crate) units: Vec<Unit<T>>,
    /// Data to evict first.
    pub(crate) evicted: Vec<DataId>,
    /// The time at which the packet is overdue.
    pub(crate) deadline: Time,
}

/// Follow-up actions after an event.
pub(crate) struct FollowUps<T> {
    /// Wake these resources.
    pub(crate) wake: Vec<ResourceId>,
    /// Answer these units as expired.
    pub(crate) expired: Vec<Unit<T>>,
    /// Answer these units, which no remaining resource can do.
    pub(crate) orphans: Vec<Unit<T>>,
    /// These packets are overdue. If their units can be done again, call [`Core::hung`], else [`Core::spare`].
    pub(crate) overdue: Vec<(ResourceId, u64)>,
    /// Nothing else is left to do, these packets take longer than expected, and others could have done them long ago.
    /// If their units can be done again, call [`Core::hung`].
    pub(crate) doubtful: Vec<(ResourceId, u64)>,
}

impl<T> Default for FollowUps<T> {
    fn default() -> Self {
        Self { wake: Vec::new(), expired: Vec::new(), orphans: Vec::new(), overdue: Vec::new(), doubtful: Vec::new() }
    }
}

/// The result of a packet.
#[derive(Debug, Default)]
pub(crate) struct PacketLanding {
    /// Number of units done, and of their items.
    pub(crate) done: usize,
    pub(crate) done_items: u64,
    /// Number of failed units.
    pub(crate) failed: usize,
    pub(crate) fault: Option<(Fault, String)>,
    /// The time of the packet, if measured at the resource.
    pub(crate) busy: Option<Duration>,
    /// The traffic of the packet in both directions, if measured.
    pub(crate) transfers: Option<[Transfer; 2]>,
    /// Number of units done too late.
    pub(crate) expired: u64,
    /// True if nothing of it was started, because the resource must prepare first.
    pub(crate) is_not_ready: bool,
}

/// The consequences of a packet's result.
#[derive(Debug)]
pub(crate) struct LandedPacket {
    /// Time of the packet on its resource.
    pub(crate) busy: Duration,
    /// Data to evict, to free memory.
    pub(crate) evicted: Vec<DataId>,
    /// True if the resource is to blame for failed units.
    pub(crate) blamed: bool,
}

impl<T> Core<T> {
    /// Makes an allocator of these resources; far ones have a window. Costs in the book are known from the start.
    pub(crate) fn new(
        config: HraConfig,
        resources: Vec<(ResourceDescriptor, Option<Window>)>,
        book: &CostBook,
    ) -> Self {
        let lane = |(descriptor, window): (ResourceDescriptor, Option<Window>)| {
            let flow = window.map(|window| Flow::new(window.packets, window.units_per_packet));
            let patience = window.map_or(config.hang_max, |window| window.patience);
            let costs = book.costs_of(&descriptor.name);
            let account = Account::new(Time::ZERO, config.spans_kept);
            let mut lane = LaneState::new(descriptor, flow, patience, costs, account);
            lane.keeps_data = window.is_some_and(|window| window.keeps_data);
            lane
        };
        let lanes = ResourceStates::new(resources.into_iter().map(lane).collect());
        Self {
            waiting: WaitingWork::new(&config, lanes.count()),
            lanes,
            placement: Placement::default(),
            incidents: Incidents::default(),
            expiries: Expiries::default(),
            closed: false,
            config,
        }
    }

    // ---- The submitters' side.

    /// Returns the current capacity of the bin.
    pub(crate) fn capacity(&self) -> usize {
        self.waiting.length.capacity()
    }

    /// Returns the number of waiting units.
    pub(crate) fn waiting(&self) -> usize {
        self.waiting.bin.len()
    }

    /// Returns true if arrivals must be reported at once: some resource waits to be woken, and none is about to ask.
    pub(crate) fn listens(&self) -> bool {
        self.lanes.listen()
    }

    /// Returns the maximum size of data for `primitive`; `None` if no resource supports it.
    pub(crate) fn most_data(&self, primitive: Primitive) -> Option<u64> {
        self.lanes.capabilities.most_data(primitive)
    }

    /// Announces work that will be submitted as soon as there is room.
    pub(crate) fn announce(&mut self, primitive: Primitive, items: u64) {
        self.waiting.demand.announce(primitive, items);
    }

    /// Withdraws announced items that will not follow.
    pub(crate) fn retract(&mut self, primitive: Primitive, items: u64) {
        self.waiting.demand.arrived(primitive, items);
    }

    /// Takes in units. After shutdown, or if no resource can do them, they come back as orphans.
    pub(crate) fn submit(&mut self, now: Time, mut chunk: Chunk<T>, out: &mut FollowUps<T>) {
        let Some(front) = chunk.front() else { return };
        let needs = front.needs();
        let (primitive, data) = (needs.primitive, needs.data);
        self.waiting.length.may_wait(front.late.since(front.submitted));
        if chunk.announced {
            self.waiting.demand.arrived(primitive, chunk.items());
        }
        if self.closed || !self.lanes.capabilities.anybody_can(primitive, data.map_or(0, |data| data.bytes)) {
            out.orphans.extend(std::iter::from_fn(|| chunk.pop()));
            return;
        }
        if !chunk.announced {
            self.waiting.demand.came(now);
        }
        let units = chunk.len();
        self.waiting.bin.push(chunk);
        self.waiting.note_level(now);
        self.lanes.call(now, &needs, units, &mut out.wake);
    }

    /// Removes the waiting units for which `wanted` holds.
    pub(crate) fn cancel(&mut self, wanted: impl Fn(&Unit<T>) -> bool) -> Vec<Unit<T>> {
        self.waiting.bin.extract(wanted)
    }

    /// Ends the life time of the units for which `over` holds.
    pub(crate) fn expire(&mut self, now: Time, over: impl Fn(&Unit<T>) -> bool, out: &mut FollowUps<T>) {
        let expired = self.waiting.bin.extract(over);
        self.expiries.note_waiting(now, expired.len() as u64);
        out.expired.extend(expired);
    }

    /// Counts units that were done after the end of their life time.
    pub(crate) fn note_late(&mut self, now: Time, units: u64) {
        self.expiries.note_late(now, units);
    }

    /// Removes expired waiting units.
    fn take_expired(&mut self, now: Time, out: &mut FollowUps<T>) {
        let before = out.expired.len();
        self.waiting.bin.take_expired(now, &mut out.expired);
        self.expiries.note_waiting(now, (out.expired.len() - before) as u64);
    }

    /// Stops handing out work; returns the waiting units.
    pub(crate) fn close(&mut self) -> Vec<Unit<T>> {
        self.closed = true;
        self.waiting.bin.extract(|_| true)
    }

    // ---- The resources' side.

    /// Returns the next step of a resource.
    pub(crate) fn next(&mut self, now: Time, id: ResourceId, out: &mut FollowUps<T>) -> Next<T> {
        self.take_expired(now, out);
        self.lanes.note_asking(id);
        let lane = &mut self.lanes[id];
        match lane.health {
            Health::Retired => return Next::End,
            _ if self.closed => return if lane.flights.is_empty() { Next::End } else { Next::Wait(None) },
            Health::Paused(until) if until <= now => {
                lane.health = Health::Recovering;
                let holds_nothing = std::mem::take(&mut lane.is_lost);
                return Next::Recover(if holds_nothing { lane.residency.evict_all() } else { Vec::new() });
            }
            Health::Paused(until) => return Next::Wait(Some(until)),
            Health::Recovering | Health::Hung => return Next::Wait(None),
            Health::Up => {}
        }
        if !lane.has_room(now) {
            return Next::Wait(None);
        }
        let (packet, until) = match self.placement.choose(now, id, &self.config, &self.lanes, &mut self.waiting) {
            LaneChoice::Retry(unit) => (self.launch(now, id, vec![unit]), None),
            LaneChoice::Draw { head, bound } => {
                let drawn = self.waiting.bin.draw(&head, bound);
                (self.launch(now, id, drawn), None)
            }
            LaneChoice::Decline { until, sooner } => {
                sooner.into_iter().for_each(|id| self.lanes.wake(id, &mut out.wake));
                (None, Some(until))
            }
            LaneChoice::Nothing => {
                self.note_if_dry(now);
                (None, None)
            }
        };
        if let Some(packet) = packet {
            self.lanes.call_for_rest(now, &self.waiting.bin, &mut out.wake);
            return Next::Packet(packet);
        }
        self.lanes.doze(id);
        Next::Wait(until)
    }

    fn note_if_dry(&mut self, now: Time) {
        if self.waiting.bin.len() == 0 && self.lanes.iter().all(|(lane, _)| lane.flights.is_empty()) {
            self.waiting.demand.ran_dry(now);
        }
    }

    /// Sends a packet. `None`: the resource lacks memory for its data at the moment, and the units are back in the bin.
    fn launch(&mut self, now: Time, id: ResourceId, units: Vec<Unit<T>>) -> Option<DrawnPacket<T>> {
        let lane = &mut self.lanes[id];
        let first = &units.first()?.meta;
        let (primitive, data) = (first.primitive, first.data);
        let admission = match data {
            None => None,
            Some(data) => match lane.residency.admit(data) {
                Some(admission) => Some(admission),
                None => {
                    units.into_iter().for_each(|unit| self.waiting.bin.push_retry(unit));
                    return None;
                }
            },
        };
        let items = units.iter().map(|unit| unit.meta.size).fold(0, u64::saturating_add);
        let bytes = units.iter().map(|unit| unit.meta.bytes).fold(CableBytes::default(), CableBytes::add);
        let (evicted, moved_bytes) =
            admission.map_or((Vec::new(), 0), |admission| (admission.evicted, admission.moved_bytes));
        let launch =
            Launch { primitive, units: units.len(), items, bytes, data: data.map(|data| data.id), moved_bytes };
        let sequence = lane.launch(now, &launch, &self.config);
        lane.account.enter(Activity::Working, now);
        self.waiting.note_taken(now, units.len());
        let hang_min = self.config.hang_min;
        let deadline = lane.flights.get(&sequence).map_or(Time::NEVER, |flight| flight.next_look(now, hang_min));
        Some(DrawnPacket { sequence, units, evicted, deadline })
    }

    /// Takes in the result of a packet. `None`: it was given up before, so its result must be dropped.
    pub(crate) fn landed(
        &mut self,
        now: Time,
        id: ResourceId,
        sequence: u64,
        landing: PacketLanding,
        out: &mut FollowUps<T>,
    ) -> Option<LandedPacket> {
        let lane = &mut self.lanes[id];
        let Some(mut flight) = lane.land(sequence) else {
            self.returned(now, id);
            return None;
        };
        if landing.is_not_ready {
            self.make_ready(now, id, out);
            return Some(LandedPacket { busy: Duration::ZERO, evicted: Vec::new(), blamed: false });
        }
        let PacketLanding { done, done_items, failed, fault, busy, transfers, expired, .. } = landing;
        lane.account.units += done as u64;
        self.expiries.note_late(now, expired);
        if done > 0 {
            lane.goes_on(now, sequence);
            lane.cable.answered(flight.bytes, now.since(flight.sent), transfers.as_ref());
        }
        let sent_units = flight.units;
        let mut landed = LandedPacket { busy: busy.unwrap_or(Duration::ZERO), evicted: Vec::new(), blamed: true };
        if done > 0 && failed == 0 {
            (flight.units, flight.items) = (done, done_items);
            landed.busy = lane.learn(now, &flight, busy);
        }
        match fault {
            None => lane.backoff.succeeded(),
            Some((Fault::OutOfMemory, reason)) if sent_units > 1 => {
                // The units have not failed: fewer of them may fit
                landed.blamed = false;
                landed.evicted = lane.residency.evict_all();
                if let Some(flow) = &mut lane.flow {
                    flow.out_of_memory(sent_units);
                }
                self.incidents.note(now, id, Fault::OutOfMemory, &reason);
            }
            Some((fault, reason)) => {
                if fault == Fault::OutOfMemory {
                    landed.evicted = lane.residency.evict_all();
                }
                lane.account.failures += failed.max(1) as u64;
                self.fail(now, id, fault, &reason, out);
            }
        }
        self.lanes.settle_activity(now, id);
        Some(landed)
    }

    /// Takes in the free memory that the resource reports.
    pub(crate) fn set_memory_free(&mut self, id: ResourceId, bytes: u64) {
        self.lanes[id].residency.set_free(bytes);
    }

    // ---- Time.

    /// Handles the passing of time: expired units and overdue packets.
    pub(crate) fn tick(&mut self, now: Time, out: &mut FollowUps<T>) {
        self.take_expired(now, out);
        for (lane, id) in self.lanes.iter() {
            let overdue = lane.flights.iter().filter(|(_, flight)| flight.deadline <= now);
            out.overdue.extend(overdue.map(|(&sequence, _)| (id, sequence)));
            let is_doubtful = |flight: &Flight| flight.deadline > now && self.is_doubtful(now, id, flight);
            let doubtful = lane.flights.iter().filter(|(_, flight)| is_doubtful(flight));
            out.doubtful.extend(doubtful.map(|(&sequence, _)| (id, sequence)));
        }
    }

    /// Returns true if a packet is doubtful: it takes longer than expected, nothing else is left to do, and another
    /// idle resource could have done it several times since it was sent, or could at least have tried.
    fn is_doubtful(&self, now: Time, id: ResourceId, flight: &Flight) -> bool {
        let age = now.since(flight.sent);
        if self.waiting.bin.len() > 0 || age < flight.doubt_after {
            return false;
        }
        let is_far_better = |(lane, other): (&LaneState, ResourceId)| {
            let is_sound = lane.health == Health::Up && !lane.backoff.has_failed();
            let is_free = other != id && is_sound && lane.flights.is_empty();
            let takes = lane.predict_ns(flight.primitive, flight.items).filter(|_| lane.knows(flight.primitive));
            let is_far_older = |ns: f64| ns * self.config.hang_factor <= age.as_nanos() as f64;
            let can = || self.lanes.capabilities.primitives(other).contains(flight.primitive);
            is_free && takes.map_or_else(can, is_far_older)
        };
        self.lanes.iter().any(is_far_better)
    }

    /// Returns the time at which [`Core::tick`] must be called next.
    pub(crate) fn next_event(&self, now: Time) -> Option<Time> {
        let look = |flight: &Flight| flight.next_look(now, self.config.hang_min);
        let flights = self.lanes.iter().filter_map(|(lane, _)| lane.flights.values().map(look).min());
        flights.chain(self.waiting.bin.next_expiry()).min()
    }

    // ---- The user's side.

    pub(crate) fn lanes(&self) -> &[LaneState] {
        self.lanes.states()
    }

    /// Returns the fill level of the bin until now.
    pub(crate) fn bin_report(&mut self, now: Time) -> BinReport {
        self.waiting.report(now)
    }

    pub(crate) fn incidents(&self) -> &Incidents {
        &self.incidents
    }

    pub(crate) fn expiries(&self) -> Expiries {
        self.expiries
    }
}
