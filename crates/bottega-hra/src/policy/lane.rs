//! The state of one resource: health, packets in flight, costs and resident data.

use std::collections::BTreeMap;
use std::time::Duration;

use super::account::Account;
use super::backoff::Backoff;
use super::bin::PacketBound;
use super::cable::{Cable, CableBytes};
use super::cost::CostModel;
use super::flow::Flow;
use super::residency::Residency;
use super::time::Time;
use super::unit::{Data, UnitNeeds};
use crate::{DataId, HraConfig, PacketUse, Primitive, ResourceDescriptor};

/// Maximum amount of work given to a near resource at once, in nanoseconds: several units together, so that it asks
/// less often.
const QUANTUM_NS: f64 = 50_000.0;
/// Maximum number of units given to a near resource at once.
const NEAR_UNITS_MAX: usize = 512;

/// Cost of giving a packet to a near resource, in addition to its units: the lock, the choice, the ledger. It is not in
/// the cost model, which contains the resource's own time.
const NEAR_HANDOVER_NS: f64 = 4_000.0;

/// The health of a resource, which decides whether it gets work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Health {
    Up,
    /// Suspended until this time; then it must recover.
    Paused(Time),
    /// Recovering after a suspension.
    Recovering,
    /// Near, and not returning from a call.
    Hung,
    Retired,
}

/// A packet in flight.
#[derive(Clone, Debug)]
pub(crate) struct Flight {
    pub(crate) sent: Time,
    pub(crate) units: usize,
    pub(crate) items: u64,
    pub(crate) bytes: CableBytes,
    pub(crate) primitive: Primitive,
    pub(crate) data: Option<DataId>,
    /// Bytes of data sent with the packet.
    pub(crate) moved_bytes: u64,
    pub(crate) predicted_ns: f64,
    /// The time from which the resource counts as hanging.
    pub(crate) deadline: Time,
    /// Age from which it is checked whether the packet is all that is pending, and others could have done it long ago.
    /// Never, for a packet of known time on a near resource.
    pub(crate) doubt_after: Duration,
    /// Maximum time allowed, including the packets before it.
    patience: Duration,
    alone: bool,
}

/// Number of checks of a doubtful packet per [`HraConfig::hang_min`]: from that age on if its time was unknown, from a
/// fraction of it if the time is known or the resource has just failed.
const LOOKS: u32 = 8;
/// Minimum multiple of the expected time plus uncertainty before a packet is doubtful.
const DOUBT_FACTOR: f64 = 3.0;

impl Flight {
    /// Returns the time of the next check whether it is overdue.
    pub(crate) fn next_look(&self, now: Time, hang_min: Duration) -> Time {
        let first = self.sent.after(self.doubt_after);
        let next = if now < first { first } else { now.after((hang_min / LOOKS).max(Duration::from_millis(1))) };
        self.deadline.min(next)
    }
}

/// The state of a resource.
pub(crate) struct LaneState {
    pub(crate) descriptor: ResourceDescriptor,
    pub(crate) health: Health,
    pub(crate) backoff: Backoff,
    pub(crate) flights: BTreeMap<u64, Flight>,
    pub(crate) residency: Residency,
    /// The cable to the resource; unused for a near resource.
    pub(crate) cable: Cable,
    pub(crate) account: Account,
    /// True if the resource waits to be woken.
    pub(crate) dozes: bool,
    /// True if the resource was woken and has not requested work yet.
    pub(crate) called: bool,
    /// True if the resource's data survives a time without an answer.
    pub(crate) keeps_data: bool,
    /// True if the resource failed in a way that leaves its contents unknown.
    pub(crate) is_lost: bool,
    next_sequence: u64,
    /// `None`: called directly, with one packet at a time.
    pub(crate) flow: Option<Flow>,
    /// Maximum time to wait for an answer.
    patience: Duration,
    costs: [CostModel; Primitive::COUNT],
    /// Upper bounds of the time per item, in nanoseconds, until it is measured.
    guesses: [Option<f64>; Primitive::COUNT],
    /// For a near resource: number of units in the last packet.
    last_units: usize,
}

impl LaneState {
    pub(crate) fn new(
        descriptor: ResourceDescriptor,
        flow: Option<Flow>,
        patience: Duration,
        costs: [CostModel; Primitive::COUNT],
        account: Account,
    ) -> Self {
        Self {
            health: Health::Up,
            backoff: Backoff::default(),
            flights: BTreeMap::new(),
            residency: match descriptor.memory_bytes {
                None if descriptor.link.bandwidth.is_infinite() => Residency::here(),
                memory => Residency::new(memory),
            },
            cable: Cable::new(&descriptor.link),
            account,
            dozes: false,
            called: false,
            keeps_data: false,
            is_lost: false,
            next_sequence: 0,
            flow,
            patience,
            costs,
            guesses: [None; Primitive::COUNT],
            last_units: 1,
            descriptor,
        }
    }

    pub(crate) fn costs(&self) -> &[CostModel; Primitive::COUNT] {
        &self.costs
    }

    /// Returns true if the resource can be sent one more packet.
    pub(crate) fn has_room(&self, now: Time) -> bool {
        match &self.flow {
            Some(flow) => flow.has_room(now, self.latency_ns()),
            None => self.flights.is_empty(),
        }
    }

    /// Returns the nanoseconds of the resource for a unit, without transfer; `None`: unknown.
    pub(crate) fn predict_ns(&self, primitive: Primitive, size: u64) -> Option<f64> {
        let index = primitive.index();
        self.costs[index].predict_ns(size).or_else(|| self.guesses[index].map(|item| item * size as f64))
    }

    /// Returns true if the primitive was measured.
    pub(crate) fn knows(&self, primitive: Primitive) -> bool {
        self.costs[primitive.index()].units() > 0
    }

    /// Returns true if a primitive is being tried for the first time, while others are known.
    pub(crate) fn is_trying(&self, primitive: Primitive) -> bool {
        !self.knows(primitive)
            && self.costs.iter().any(|cost| cost.units() > 0)
            && self.flights.values().any(|flight| flight.primitive == primitive)
    }

    /// Returns the long-term nanoseconds per item, for items in units of the usual size.
    pub(crate) fn ns_per_item(&self, primitive: Primitive) -> Option<f64> {
        let cost = &self.costs[primitive.index()];
        if cost.units() == 0 || cost.items() == 0 {
            return None;
        }
        let mean_size = cost.items() as f64 / cost.units() as f64;
        let fixed_per_unit = match &self.flow {
            Some(flow) => {
                cost.fixed_ns() / flow.units(Some((cost.fixed_ns(), cost.ns_per_item() * mean_size)), 0) as f64
            }
            None => cost.fixed_ns(),
        };
        Some((cost.ns_per_item() + fixed_per_unit / mean_size).max(1e-3))
    }

    /// Returns the latency of the link in both directions, in nanoseconds.
    pub(crate) fn latency_ns(&self) -> f64 {
        let Some(flow) = &self.flow else { return 0.0 };
        match flow.floor() {
            Some(floor) => {
                // Until the service time is known, attribute everything to the link: a resource that seems too fast is
                // soon used and measured, one that seems too slow never is.
                let service = self.costs[floor.primitive.index()].predict_ns(floor.size).unwrap_or(0.0);
                (floor.round_trip_ns - service).max(0.0)
            }
            None => 2.0 * self.descriptor.link.latency.as_nanos() as f64,
        }
    }

    /// Returns the expected time at which everything in flight is answered.
    pub(crate) fn free_at(&self, now: Time) -> Time {
        let Some((_, oldest)) = self.flights.first_key_value() else { return now };
        let done = match &self.flow {
            Some(flow) => oldest.sent.plus_ns(self.latency_ns()).max(flow.last_answer()).plus_ns(flow.work_ns()),
            None => oldest.sent.plus_ns(oldest.predicted_ns),
        };
        done.max(now)
    }

    /// Returns the packets so far, with the round trip of the window.
    pub(crate) fn packets(&self) -> PacketUse {
        let floor = self.flow.as_ref().and_then(Flow::floor);
        let round_trip = floor.map(|floor| Duration::from_nanos(floor.round_trip_ns as u64));
        PacketUse { round_trip, ..self.account.packets }
    }

    /// Returns the nanoseconds to send data that is not resident; 0 for data that is.
    pub(crate) fn moving_ns(&self, data: Option<Data>) -> f64 {
        let missing = data.filter(|data| !self.residency.is_resident(data.id));
        missing.map_or(0.0, |data| self.cable.moving_ns(data.bytes))
    }

    /// Returns the nanoseconds for the bytes of a unit and its non-resident data, plus those of its answer.
    pub(crate) fn longest_way_ns(&self, unit: &UnitNeeds) -> f64 {
        let way_ns = if self.flow.is_some() { self.cable.way_ns(unit.bytes) } else { 0.0 };
        self.moving_ns(unit.data) + way_ns
    }

    /// Nanoseconds for which work occupies the resource or its cable, whichever is longer; `None`: unknown.
    fn occupied_ns(&self, primitive: Primitive, items: u64, bytes: CableBytes) -> Option<f64> {
        let service = self.predict_ns(primitive, items)?;
        Some(if self.flow.is_some() { service.max(self.cable.ns(bytes)) } else { service })
    }

    /// Returns the time at which a unit given now is answered; `None`: unknown.
    pub(crate) fn finish(&self, now: Time, unit: &UnitNeeds) -> Option<Time> {
        let &UnitNeeds { primitive, size, bytes, data } = unit;
        let service = self.occupied_ns(primitive, size, bytes)? + self.moving_ns(data);
        Some(now.plus_ns(self.latency_ns()).max(self.free_at(now)).plus_ns(service))
    }

    /// Returns the nanoseconds per packet, and per unit of `size` items; `None`: unknown.
    pub(crate) fn cost_ns(&self, primitive: Primitive, size: u64) -> Option<(f64, f64)> {
        let cost = &self.costs[primitive.index()];
        (cost.units() > 0).then(|| (cost.fixed_ns(), cost.ns_per_item() * size as f64))
    }

    /// Returns the minimum total time of units that is worth a packet, given the fixed cost of a packet.
    pub(crate) fn least_ns(&self, fixed_ns: f64) -> f64 {
        if self.flow.is_some() { fixed_ns } else { fixed_ns.max(NEAR_HANDOVER_NS) }
    }

    /// Returns the limit on a packet that starts with this unit.
    pub(crate) fn packet_bound(&self, unit: &UnitNeeds) -> PacketBound {
        let most = if self.flow.is_some() { usize::MAX } else { 2 * self.last_units };
        let usual = self.usual_bound(unit);
        PacketBound { units: usual.units.min(most), ..usual }
    }

    /// Returns the long-term limit on a packet.
    pub(crate) fn usual_bound(&self, unit: &UnitNeeds) -> PacketBound {
        let cost = &self.costs[unit.primitive.index()];
        let known = self.cost_ns(unit.primitive, unit.size);
        let most = known.and_then(|(_, unit_ns)| self.cable.most_bytes(unit.bytes, unit_ns));
        if let (Some(flow), Some(most)) = (&self.flow, most) {
            return PacketBound { units: most.units(unit.bytes).min(flow.units_bound()), bytes: Some(most) };
        }
        let units = match (&self.flow, known) {
            (Some(flow), known) => flow.units(known, self.next_sequence),
            (None, Some(_)) => {
                let unit_ns = cost.predict_ns(unit.size).unwrap_or(QUANTUM_NS).max(1.0);
                ((QUANTUM_NS / unit_ns) as usize).clamp(1, NEAR_UNITS_MAX)
            }
            (None, None) => 1,
        };
        PacketBound { units, bytes: None }
    }

    /// Sends a packet. Returns its number.
    pub(crate) fn launch(&mut self, now: Time, packet: &Launch, config: &HraConfig) -> u64 {
        let &Launch { primitive, units, items, bytes, data, moved_bytes } = packet;
        let moving_ns = self.cable.moving_ns(moved_bytes);
        self.cable.moved(moved_bytes);
        let cost = self.costs[primitive.index()];
        let known = self.occupied_ns(primitive, items, bytes).map(|ns| ns + moving_ns);
        let predicted_ns = known.unwrap_or(moving_ns);
        let soon = config.hang_min / LOOKS;
        let (patience, doubt_after) = match known {
            None => (self.patience, if self.backoff.has_failed() { soon } else { config.hang_min }),
            Some(_) => {
                let answer = self.free_at(now).max(now.plus_ns(self.latency_ns())).plus_ns(predicted_ns).since(now);
                let spread = 1.0 + 2.0 * cost.uncertainty().unwrap_or(1.0);
                let times = |factor: f64| if factor * spread > 1.0 { (factor * spread).min(1e3) } else { 1.0 }; // Also if it is NaN.
                let patience =
                    answer.mul_f64(times(config.hang_factor)).clamp(config.hang_min.min(self.patience), self.patience);
                let doubt_after = match (&self.flow, self.backoff.has_failed()) {
                    (_, true) => soon,
                    (Some(_), false) => answer.mul_f64(times(DOUBT_FACTOR)).max(soon),
                    (None, false) => Duration::MAX,
                };
                (patience, doubt_after)
            }
        };
        let alone = self.flow.as_mut().is_none_or(|flow| flow.sent(predicted_ns));
        self.last_units = units.max(self.last_units / 2);
        let deadline = now.after(patience);
        let sent = now;
        let flight = Flight {
            sent,
            units,
            items,
            bytes,
            primitive,
            data,
            moved_bytes,
            predicted_ns,
            deadline,
            doubt_after,
            patience,
            alone,
        };
        let sequence = self.next_sequence;
        self.next_sequence += 1;
        self.flights.insert(sequence, flight);
        self.account.packets.sent(units, self.flights.len());
        sequence
    }

    /// Removes a packet from those in flight.
    pub(crate) fn land(&mut self, sequence: u64) -> Option<Flight> {
        let flight = self.flights.remove(&sequence)?;
        if let Some(flow) = &mut self.flow {
            flow.landed(flight.predicted_ns);
        }
        if let Some(id) = flight.data {
            self.residency.release(id);
        }
        Some(flight)
    }

    /// Notes an answer, which shows that the resource does not hang: packets sent later have their full time from now
    /// on. Earlier ones do not, because they may be lost.
    pub(crate) fn goes_on(&mut self, now: Time, answered: u64) {
        for flight in self.flights.range_mut(answered..).map(|(_, flight)| flight) {
            flight.deadline = flight.deadline.max(now.after(flight.patience));
        }
    }

    /// Learns from an answer to a whole packet; `busy` if the driver measured it. Returns the time of the packet on the
    /// resource.
    pub(crate) fn learn(&mut self, now: Time, flight: &Flight, busy: Option<Duration>) -> Duration {
        let index = flight.primitive.index();
        let Some(flow) = &self.flow else {
            let busy = busy.unwrap_or_else(|| now.since(flight.sent));
            if flight.moved_bytes == 0 {
                self.costs[index].observe_many(flight.units as u64, flight.items, busy);
            }
            return busy;
        };
        let known = self.costs[index].units() > 0;
        let way_known = flow.floor().is_some() && self.costs.iter().any(|cost| cost.units() > 0);
        let arrived = flight.sent.plus_ns(if way_known { self.latency_ns() } else { 0.0 });
        let service = busy.unwrap_or_else(|| now.since(arrived.max(flow.last_answer())));
        let believed = match busy {
            Some(_) => true,
            // A round trip shorter than the assumed latency: the latency is wrong, and the service time is unknown
            None if way_known => arrived < now && (known || !service.is_zero()),
            None => flow.is_one_by_one() || (!flight.alone && flow.was_pair(now, flight.sent)),
        };
        if believed && flight.moved_bytes == 0 {
            self.costs[index].observe_many(flight.units as u64, flight.items, service);
        } else if !known {
            let at_most = now.since(flight.sent.max(flow.last_answer()));
            self.guesses[index] = Some(at_most.as_nanos() as f64 / flight.items.max(1) as f64);
        }
        if let Some(flow) = &mut self.flow {
            flow.answered(
                now,
                flight.sent,
                flight.alone && flight.moved_bytes == 0,
                flight.units,
                (flight.primitive, flight.items),
            );
        }
        service
    }
}

/// A packet to send.
pub(crate) struct Launch {
    pub(crate) primitive: Primitive,
    pub(crate) units: usize,
    pub(crate) items: u64,
    pub(crate) bytes: CableBytes,
    pub(crate) data: Option<DataId>,
    pub(crate) moved_bytes: u64,
}
