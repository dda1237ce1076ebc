//! The sliding window of a far resource: the number of packets in flight, and their size.
//!
//! **Window.** Like BBR (Cardwell et al., *BBR: Congestion-Based Congestion Control*, 2016) it aims at the least that
//! saturates the resource: the product of the minimum round trip and the delivery rate. Measured in the resource's
//! time, a round trip R is covered by work of length R, whatever the primitives: a packet is sent while less than
//! [`GAIN`] · R of work is in flight, with R that of the largest recent packet. The quarter beyond R detects a resource
//! that has become faster, or processes several packets at once: answers then come closer together, the same packets
//! count for less work, and more are sent, a quarter more per round trip. BBR uses the maximum rate, because it shares
//! the link; here the resource is exclusive, and the mean of the cost model is used.
//!
//! **Rate.** If a packet waited for the one before it, its time on the resource is the time between both answers. In
//! general it is the time since the later of two moments: the answer before it, and the moment at which it is answered
//! if it takes no time (Lindley's recursion, shifted by the way back).
//!
//! **Minimum round trip.** That of a packet sent when no other was in flight. It is valid for [`FLOOR_VALID`]; then
//! sending pauses until nothing is in flight, and it is measured again.
//!
//! **Start.** Two packets of one unit, whose answers give rate and round trip; then, as in TCP's slow start but with
//! [`GROWTH`] instead of one, additional packets for each one answered: four times as many per round trip. Packets have
//! at most twice the units of the largest one answered.
//!
//! **Packet.** As many units as are done in an eighth of the round trip, since larger ones do not reduce waiting. More
//! if handing over a packet, the cost model's fixed part, otherwise takes more than [`OVERHEAD_MAX`] of its time. Never
//! more than a fair share of the remaining work. Behind a slow cable bytes decide instead ([`super::cable`]).

use std::time::Duration;

use super::time::Time;
use crate::Primitive;

/// Target amount of work in flight, in round trips.
const GAIN: f64 = 1.25;
/// Maximum share of a packet's time for handing it over.
const OVERHEAD_MAX: f64 = 0.02;
/// Minimum number of packets per round trip, if units are small enough.
const PACKETS_A_ROUND_TRIP: f64 = 8.0;
/// One in this many packets has twice the size, to learn the cost per packet.
const LARGER_EVERY: u64 = 4;
/// Additional packets in flight for each one answered, until there are enough.
const GROWTH: usize = 3;
/// Number of consecutive packets without another in flight, after which the round trip counts as the packet's cost.
const ALONE_MIN: u32 = 4;
/// Time for which a minimum round trip is valid.
const FLOOR_VALID: Duration = Duration::from_secs(30);

/// The minimum round trip, with the packet it was measured on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PaceFloor {
    pub(crate) round_trip_ns: f64,
    pub(crate) primitive: Primitive,
    pub(crate) size: u64,
    at: Time,
}

/// The state that determines number and size of packets.
#[derive(Clone, Debug)]
pub(crate) struct Flow {
    packets_max: usize,
    units_max: usize,
    /// Maximum units per packet; halved when memory runs out.
    units_allowed: usize,
    /// Number of packets that slow start allows.
    grown: usize,
    largest_answered: usize,
    floor: Option<PaceFloor>,
    last_answer: Time,
    /// Sending time of the packet that was answered last.
    last_sent: Time,
    packets: usize,
    alone_in_a_row: u32,
    /// Predicted time of the work in flight.
    work_ns: f64,
    /// Predicted time of the largest recent packet.
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

    /// Returns true if that many packets in a row were alone in flight: the resource answers before the next packet is sent, so
    /// no pair is expected.
    pub(crate) fn is_one_by_one(&self) -> bool {
        self.alone_in_a_row >= ALONE_MIN
    }

    /// Returns true if a packet sent at `sent` and answered `now` probably waited for the one before it: both were
    /// sent within much less time than there is between their answers.
    pub(crate) fn was_pair(&self, now: Time, sent: Time) -> bool {
        2 * sent.since(self.last_sent) <= now.since(self.last_answer)
    }

    pub(crate) fn work_ns(&self) -> f64 {
        self.work_ns
    }

    /// Returns true if one more packet may be sent, over a link with this latency.
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

    /// Returns true if the round trip must be measured again. With two packets at most it does not matter.
    fn is_floor_old(&self, now: Time) -> bool {
        self.packets_max > 2 && self.floor.is_some_and(|floor| now.since(floor.at) > FLOOR_VALID)
    }

    /// Returns the number of units for packet number `sequence`, given the cost per packet and per unit in nanoseconds;
    /// `None`: unknown.
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

    /// Returns the maximum number of units per packet.
    pub(crate) fn units_bound(&self) -> usize {
        self.units_allowed.min((2 * self.largest_answered).max(1))
    }

    /// Notes that a packet is sent. Returns true if no other is in flight.
    pub(crate) fn sent(&mut self, predicted_ns: f64) -> bool {
        self.packets += 1;
        self.large_ns = predicted_ns.max(0.95 * self.large_ns);
        self.work_ns += predicted_ns;
        self.packets == 1
    }

    /// Notes that a packet is answered or lost.
    pub(crate) fn landed(&mut self, predicted_ns: f64) {
        self.packets = self.packets.saturating_sub(1);
        self.work_ns = if self.packets == 0 { 0.0 } else { (self.work_ns - predicted_ns).max(0.0) };
    }

    /// Takes in an answer to a packet of `units` units sent at `sent`; `alone` if no other was in flight.
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

    /// Notes that a packet with this number of units exceeded the resource's memory.
    pub(crate) fn out_of_memory(&mut self, units: usize) {
        self.units_allowed = (units / 2).max(1);
    }

    /// Resets the window after a failure; the learned size limits stay.
    pub(crate) fn failed(&mut self) {
        self.grown = 2;
    }
}
