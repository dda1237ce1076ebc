//! The state of one resource: its health, what it has in hand, what it costs and holds.

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
use crate::{DataId, HraConfig, Primitive, ResourceDescriptor};

/// How long a near resource is kept from asking again: several units go to it at once, up to so much work.
const QUANTUM_NS: f64 = 50_000.0;
/// Most units handed to a near resource at once.
const NEAR_UNITS_MAX: usize = 512;

/// What it costs to hand a packet to a near resource, beside its units: the lock, the choice, the ledger. It is not in the cost
/// model, which knows what the resource takes.
const NEAR_HANDOVER_NS: f64 = 4_000.0;

/// Whether a resource gets work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Health {
    Up,
    /// Left alone until then; then it is asked to recover.
    Paused(Time),
    /// Asked to recover.
    Recovering,
    /// Near, and does not return from a call.
    Hung,
    Retired,
}

/// A packet under way.
#[derive(Clone, Debug)]
pub(crate) struct Flight {
    pub(crate) sent: Time,
    pub(crate) units: usize,
    pub(crate) items: u64,
    pub(crate) bytes: CableBytes,
    pub(crate) primitive: Primitive,
    pub(crate) data: Option<DataId>,
    /// Of data that went along.
    pub(crate) moved_bytes: u64,
    pub(crate) predicted_ns: f64,
    /// Without an answer by then the resource hangs.
    pub(crate) deadline: Time,
    /// From this age on it is looked at whether it is all that is waited for, and others could have done it long since. Never, for one
    /// of a near resource of which is known how long it takes.
    pub(crate) doubt_after: Duration,
    /// How long it may take, what is before it included.
    patience: Duration,
    alone: bool,
}

/// A packet that may be doubted is looked at so many times in [`HraConfig::hang_min`]: from that age on where nobody knew how long it
/// should take, from such a part of it on where that is known, or the resource has just failed.
const LOOKS: u32 = 8;
/// No packet is doubted before it has taken so many times what was expected, uncertainty on top.
const DOUBT_FACTOR: f64 = 3.0;

impl Flight {
    /// When it is next to be looked at whether it is overdue.
    pub(crate) fn next_look(&self, now: Time, hang_min: Duration) -> Time {
        let first = self.sent.after(self.doubt_after);
        let next = if now < first { first } else { now.after((hang_min / LOOKS).max(Duration::from_millis(1))) };
        self.deadline.min(next)
    }
}

/// One resource.
pub(crate) struct LaneState {
    pub(crate) descriptor: ResourceDescriptor,
    pub(crate) health: Health,
    pub(crate) backoff: Backoff,
    pub(crate) flights: BTreeMap<u64, Flight>,
    pub(crate) residency: Residency,
    /// What is between here and there; not used by a near one.
    pub(crate) cable: Cable,
    pub(crate) account: Account,
    /// Waits to be woken.
    pub(crate) dozes: bool,
    /// Was woken and has not asked yet.
    pub(crate) called: bool,
    /// Whether its data outlasts a time without an answer.
    pub(crate) keeps_data: bool,
    /// Whether it has failed so that nobody knows what it holds.
    pub(crate) is_lost: bool,
    next_sequence: u64,
    /// None: called directly, with one packet at a time.
    pub(crate) flow: Option<Flow>,
    /// Longest wait for an answer.
    patience: Duration,
    costs: [CostModel; Primitive::COUNT],
    /// Upper bounds of the time of an item, in nanoseconds, where nothing better is known.
    guesses: [Option<f64>; Primitive::COUNT],
    /// Near: units in the last packet.
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

    /// Whether it could be sent one more packet.
    pub(crate) fn has_room(&self, now: Time) -> bool {
        match &self.flow {
            Some(flow) => flow.has_room(now, self.latency_ns()),
            None => self.flights.is_empty(),
        }
    }

    /// Nanoseconds of the resource that a unit needs, its way apart; `None` while nothing is known.
    pub(crate) fn predict_ns(&self, primitive: Primitive, size: u64) -> Option<f64> {
        let index = primitive.index();
        self.costs[index].predict_ns(size).or_else(|| self.guesses[index].map(|item| item * size as f64))
    }

    /// Whether the primitive was measured.
    pub(crate) fn knows(&self, primitive: Primitive) -> bool {
        self.costs[primitive.index()].units() > 0
    }

    /// Whether a primitive is being tried, while others are known.
    pub(crate) fn is_trying(&self, primitive: Primitive) -> bool {
        !self.knows(primitive)
            && self.costs.iter().any(|cost| cost.units() > 0)
            && self.flights.values().any(|flight| flight.primitive == primitive)
    }

    /// Nanoseconds an item in the long run, for items in units of the usual size.
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

    /// The way there and back, in nanoseconds.
    pub(crate) fn latency_ns(&self) -> f64 {
        let Some(flow) = &self.flow else { return 0.0 };
        match flow.floor() {
            Some(floor) => {
                // While that is unknown all of it counts as way: what is then thought too fast is soon asked for, and known
                // better, and what is thought too slow would never be.
                let service = self.costs[floor.primitive.index()].predict_ns(floor.size).unwrap_or(0.0);
                (floor.round_trip_ns - service).max(0.0)
            }
            None => 2.0 * self.descriptor.link.latency.as_nanos() as f64,
        }
    }

    /// When all that is under way will be answered, as things look.
    pub(crate) fn free_at(&self, now: Time) -> Time {
        let Some((_, oldest)) = self.flights.first_key_value() else { return now };
        let done = match &self.flow {
            Some(flow) => oldest.sent.plus_ns(self.latency_ns()).max(flow.last_answer()).plus_ns(flow.work_ns()),
            None => oldest.sent.plus_ns(oldest.predicted_ns),
        };
        done.max(now)
    }

    /// Nanoseconds that data takes to get there, if it is not there.
    pub(crate) fn moving_ns(&self, data: Option<Data>) -> f64 {
        let missing = data.filter(|data| !self.residency.is_resident(data.id));
        missing.map_or(0.0, |data| self.cable.moving_ns(data.bytes))
    }

    /// Nanoseconds that the bytes of a unit, with data that is not there, take there, and those of its answer back.
    pub(crate) fn longest_way_ns(&self, unit: &UnitNeeds) -> f64 {
        let way_ns = if self.flow.is_some() { self.cable.way_ns(unit.bytes) } else { 0.0 };
        self.moving_ns(unit.data) + way_ns
    }

    /// Nanoseconds for which work occupies the resource or its cable, whichever is longer; `None` while nothing is known.
    fn occupied_ns(&self, primitive: Primitive, items: u64, bytes: CableBytes) -> Option<f64> {
        let service = self.predict_ns(primitive, items)?;
        Some(if self.flow.is_some() { service.max(self.cable.ns(bytes)) } else { service })
    }

    /// When a unit that is handed over now would be answered; `None` while nothing is known.
    pub(crate) fn finish(&self, now: Time, unit: &UnitNeeds) -> Option<Time> {
        let &UnitNeeds { primitive, size, bytes, data } = unit;
        let service = self.occupied_ns(primitive, size, bytes)? + self.moving_ns(data);
        Some(now.plus_ns(self.latency_ns()).max(self.free_at(now)).plus_ns(service))
    }

    /// What a packet costs before its first unit, and each unit of `size` items, in nanoseconds; `None` while that is not known.
    pub(crate) fn cost_ns(&self, primitive: Primitive, size: u64) -> Option<(f64, f64)> {
        let cost = &self.costs[primitive.index()];
        (cost.units() > 0).then(|| (cost.fixed_ns(), cost.ns_per_item() * size as f64))
    }

    /// Shortest time of units that is worth a packet, given what the cost model says that a packet costs before its first unit.
    pub(crate) fn least_ns(&self, fixed_ns: f64) -> f64 {
        if self.flow.is_some() { fixed_ns } else { fixed_ns.max(NEAR_HANDOVER_NS) }
    }

    /// What is to be handed over at once, if such a unit is in front.
    pub(crate) fn packet_bound(&self, unit: &UnitNeeds) -> PacketBound {
        let most = if self.flow.is_some() { usize::MAX } else { 2 * self.last_units };
        let usual = self.usual_bound(unit);
        PacketBound { units: usual.units.min(most), ..usual }
    }

    /// What is handed over at once in the long run.
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

    /// Sends a packet on its way. Returns its number.
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
                let times = |factor: f64| if factor * spread > 1.0 { (factor * spread).min(1e3) } else { 1.0 }; // Also where it is no number.
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
        sequence
    }

    /// A packet is not under way any more.
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

    /// A packet was answered, so the resource does not hang: those that were sent after it have their time from now on. Those before
    /// it do not, for they may be lost.
    pub(crate) fn goes_on(&mut self, now: Time, answered: u64) {
        for flight in self.flights.range_mut(answered..).map(|(_, flight)| flight) {
            flight.deadline = flight.deadline.max(now.after(flight.patience));
        }
    }

    /// Learns from an answer to a whole packet; `busy` where the driver measured it. Returns the time that the packet
    /// took of the resource.
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
            // There and back in less than the way is thought to take: the way is not, and the rest says nothing.
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

/// A packet to be sent.
pub(crate) struct Launch {
    pub(crate) primitive: Primitive,
    pub(crate) units: usize,
    pub(crate) items: u64,
    pub(crate) bytes: CableBytes,
    pub(crate) data: Option<DataId>,
    pub(crate) moved_bytes: u64,
}
