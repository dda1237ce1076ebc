//! The sliding window of a far resource: how many packets are under way, and how much is in each.
//!
//! **Window.** As BBR does (Cardwell et al., *BBR: Congestion-Based Congestion Control*, 2016) it aims at the least
//! that keeps the resource saturated: the product of the least round trip and the rate of delivery. Counted in the time
//! that the resource needs for it, a round trip R is covered by work of the length R, whatever the primitives: a packet
//! goes out while less than [`GAIN`] · R of work is under way, R being that of the largest of the last packets. The
//! quarter beyond R finds out when the resource has
//! become faster, or does several packets at once: then answers come closer together, the same packets count for less
//! work, and more go out, a quarter more each round trip. Where BBR takes the greatest rate seen, for a link that it
//! shares, this takes the mean that the cost model learns: the resource is ours alone.
//!
//! **Rate.** An answer tells what its packet took of the resource if the packet had to wait for the one before:
//! then it is the time between both answers. In general it is that since the later of the answer before, and of when
//! the packet would have been answered had it taken no time (Lindley's recursion, shifted by the way back).
//!
//! **Least round trip.** That of a packet sent when nothing else was under way. It is believed for
//! [`FLOOR_VALID`]; then sending pauses until nothing is under way, and it is measured anew.
//!
//! **Start.** Two packets of one unit, whose answers give rate and round trip; then, as in TCP's slow start but with
//! [`GROWTH`] instead of one, more packets for each that is answered: four times as many each round trip. Packets have
//! at most twice the units of the largest answered.
//!
//! **Packet.** As many units as are done in an eighth of the round trip: larger ones would not wait any shorter. More
//! where handing over a packet, the cost model's fixed part, would otherwise cost more than [`OVERHEAD_MAX`] of its
//! time. Never more than a fair part of what is left to do. Behind a slow cable bytes decide instead ([`super::cable`]).

use std::time::Duration;

use super::time::Time;
use crate::Primitive;

/// Work under way, in round trips.
const GAIN: f64 = 1.25;
/// Share of a packet's time that handing it over may cost.
const OVERHEAD_MAX: f64 = 0.02;
/// Packets that a round trip is at least cut into, where units are small enough.
const PACKETS_A_ROUND_TRIP: f64 = 8.0;
/// Every so many packets one of twice the size goes out, so that what a packet costs beside its units is learnt.
const LARGER_EVERY: u64 = 4;
/// Packets that may be under way in addition for each one answered, until there are enough.
const GROWTH: usize = 3;
/// Packets in a row that went alone, after which a round trip is taken for what a packet costs.
const ALONE_MIN: u32 = 4;
/// How long a least round trip is believed.
const FLOOR_VALID: Duration = Duration::from_secs(30);

/// The least round trip, and of what.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PaceFloor {
    pub(crate) round_trip_ns: f64,
    pub(crate) primitive: Primitive,
    pub(crate) size: u64,
    at: Time,
}

/// What decides how many packets are under way and how large they are.
#[derive(Clone, Debug)]
pub(crate) struct Flow {
    packets_max: usize,
    units_max: usize,
    /// Halved when memory runs out.
    units_allowed: usize,
    /// Packets that slow start allows.
    grown: usize,
    largest_answered: usize,
    floor: Option<PaceFloor>,
    last_answer: Time,
    /// When the packet that was answered last was sent.
    last_sent: Time,
    packets: usize,
    alone_in_a_row: u32,
    /// Predicted time of what is under way.
    work_ns: f64,
    /// That of the largest of the last packets.
    large_ns: f64,
}

impl Flow {
    pub(crate) fn new(packets_max: usize, units_max: usize) -> Self {
        let (packets_max, units_max) = (packets_max.max(1), units_max.max(1));
        Self {
            packets_max,
            units_max,
            units_allowed: units_max,
            grown: 2,
            largest_answered: 0,
            floor: None,
            last_answer: Time::ZERO,
            last_sent: Time::ZERO,
            packets: 0,
            alone_in_a_row: 0,
            work_ns: 0.0,
            large_ns: 0.0,
        }
    }

    pub(crate) fn floor(&self) -> Option<PaceFloor> {
        self.floor
    }

    pub(crate) fn last_answer(&self) -> Time {
        self.last_answer
    }

    /// Whether so many packets went all alone that there will be no pair: this resource answers before the next is sent.
    pub(crate) fn is_one_by_one(&self) -> bool {
        self.alone_in_a_row >= ALONE_MIN
    }

    /// Whether a packet sent at `sent` and answered `now` had to wait for the one before, as far as that can be told
    /// without knowing the way: both were sent in much less time than there is between their answers.
    pub(crate) fn was_pair(&self, now: Time, sent: Time) -> bool {
        2 * sent.since(self.last_sent) <= now.since(self.last_answer)
    }

    pub(crate) fn work_ns(&self) -> f64 {
        self.work_ns
    }

    /// Whether one more packet may be sent, over a way of so long.
    pub(crate) fn has_room(&self, now: Time, latency_ns: f64) -> bool {
        if self.packets == 0 {
            return true;
        }
        if self.packets >= self.packets_max.min(self.grown) || self.is_floor_old(now) {
            return false;
        }
        let round_trip = |floor: PaceFloor| floor.round_trip_ns.max(latency_ns + self.large_ns);
        self.packets < 2 || self.floor.is_none_or(|floor| self.work_ns < GAIN * round_trip(floor))
    }

    /// Whether the round trip must be measured anew. Where two packets are enough it does not matter.
    fn is_floor_old(&self, now: Time) -> bool {
        self.packets_max > 2 && self.floor.is_some_and(|floor| now.since(floor.at) > FLOOR_VALID)
    }

    /// Units that packet number `sequence` should have. Given is what a packet costs before its first unit, and each
    /// unit, in nanoseconds; none while that is not known.
    pub(crate) fn units(&self, cost: Option<(f64, f64)>, sequence: u64) -> usize {
        let wanted = match cost {
            None => 1,
            Some((fixed_ns, unit_ns)) if unit_ns > 0.0 => {
                let enough = (fixed_ns * (1.0 - OVERHEAD_MAX) / OVERHEAD_MAX / unit_ns).ceil().max(1.0) as usize;
                let round_trip_ns = self.floor.map_or(0.0, |floor| floor.round_trip_ns);
                let usual = enough.max((round_trip_ns / PACKETS_A_ROUND_TRIP / unit_ns) as usize);
                if sequence % LARGER_EVERY == LARGER_EVERY - 1 { usual.saturating_mul(2) } else { usual }
            }
            Some(_) => usize::MAX,
        };
        wanted.clamp(1, self.units_bound())
    }

    /// Most units in a packet.
    pub(crate) fn units_bound(&self) -> usize {
        self.units_allowed.min((2 * self.largest_answered).max(1))
    }

    /// A packet goes out. Returns whether nothing else is under way.
    pub(crate) fn sent(&mut self, predicted_ns: f64) -> bool {
        self.packets += 1;
        self.large_ns = predicted_ns.max(0.95 * self.large_ns);
        self.work_ns += predicted_ns;
        self.packets == 1
    }

    /// A packet is not under way any more, answered or lost.
    pub(crate) fn landed(&mut self, predicted_ns: f64) {
        self.packets = self.packets.saturating_sub(1);
        self.work_ns = if self.packets == 0 { 0.0 } else { (self.work_ns - predicted_ns).max(0.0) };
    }

    /// Takes in an answer: a packet of so many units, sent at `sent`, `alone` if nothing else was under way.
    pub(crate) fn answered(&mut self, now: Time, sent: Time, alone: bool, units: usize, of: (Primitive, u64)) {
        (self.last_answer, self.last_sent) = (self.last_answer.max(now), sent);
        self.grown = (self.grown + GROWTH).min(self.packets_max.max(2));
        self.largest_answered = self.largest_answered.max(units);
        self.units_allowed = (self.units_allowed + 1).min(self.units_max);
        self.alone_in_a_row = if alone { self.alone_in_a_row.saturating_add(1) } else { 0 };
        if !alone {
            return;
        }
        let round_trip_ns = now.since(sent).as_nanos() as f64;
        let old = self.is_floor_old(now);
        if self.floor.is_none_or(|floor| old || round_trip_ns <= floor.round_trip_ns) {
            self.floor = Some(PaceFloor { round_trip_ns, primitive: of.0, size: of.1, at: now });
        } else if let Some(floor) = &mut self.floor {
            floor.at = if round_trip_ns < 1.1 * floor.round_trip_ns { now } else { floor.at };
        }
    }

    /// The resource ran out of memory over a packet of so many units.
    pub(crate) fn out_of_memory(&mut self, units: usize) {
        self.units_allowed = (units / 2).max(1);
    }

    /// The resource failed: what was learnt of its size stays, the window starts anew.
    pub(crate) fn failed(&mut self) {
        self.grown = 2;
    }
}
