//! Packets and traffic of resources: the packets that each got, and the bytes on the cable of a far one.

use std::time::Duration;

/// The traffic of a packet in one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Transfer {
    /// Number of bytes.
    pub bytes: u64,
    /// Number of bytes that followed others without a gap: only they measure the bandwidth. 0: not measured.
    pub timed_bytes: u64,
    /// The time that [`Self::timed_bytes`] took.
    pub time: Duration,
}

/// The packets that a resource got: their number and sizes, as the allocator tuned them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PacketUse {
    /// Number of packets sent.
    pub packets: u64,
    /// Number of units in them.
    pub units: u64,
    /// Number of units in the largest one since the allocator was made.
    pub largest: usize,
    /// Largest number of packets in flight at once since the allocator was made: the window. 1 for a near resource.
    pub window: usize,
    /// Minimum round trip of a packet that does not wait, measured again every 30 s; `None`: not measured, or the resource
    /// is near.
    pub round_trip: Option<Duration>,
}

impl PacketUse {
    /// Returns the mean number of units per packet; 0 without packets.
    pub fn mean_units(&self) -> f64 {
        self.units as f64 / self.packets.max(1) as f64
    }

    /// Counts a packet.
    ///
    /// - `in_flight`: number of packets in flight, with this one.
    pub(crate) fn sent(&mut self, units: usize, in_flight: usize) {
        self.packets += 1;
        self.units += units as u64;
        self.largest = self.largest.max(units);
        self.window = self.window.max(in_flight);
    }

    /// Returns the packets since an earlier moment.
    pub(crate) fn since(&self, before: &Self) -> Self {
        Self {
            packets: self.packets.saturating_sub(before.packets),
            units: self.units.saturating_sub(before.units),
            ..*self
        }
    }
}

/// The traffic on the cable of a far resource.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CableUse {
    /// Bytes sent, including data.
    pub sent_bytes: u64,
    /// Bytes of answers.
    pub received_bytes: u64,
    /// Bandwidth to the resource, in bytes per second: that of the link's description, corrected by measurements; `None`
    /// unless it is known to limit.
    pub bandwidth_there: Option<f64>,
    /// Bandwidth from the resource, likewise.
    pub bandwidth_back: Option<f64>,
    /// Number of packets answered.
    pub packets: u64,
    /// Total time between sending and answer, over all packets.
    pub away: Duration,
}

impl CableUse {
    /// Returns the mean time between the sending of a packet and its answer; `None`: no packets.
    pub fn packet_time(&self) -> Option<Duration> {
        (self.packets > 0).then(|| self.away.div_f64(self.packets as f64))
    }

    /// Returns the traffic since an earlier moment.
    pub(crate) fn since(&self, before: &Self) -> Self {
        Self {
            sent_bytes: self.sent_bytes.saturating_sub(before.sent_bytes),
            received_bytes: self.received_bytes.saturating_sub(before.received_bytes),
            packets: self.packets.saturating_sub(before.packets),
            away: self.away.saturating_sub(before.away),
            ..*self
        }
    }
}
