//! Traffic on the cable of a far resource: of one packet, as its driver measured it, and in total.

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

/// The traffic on the cable of a far resource.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CableUse {
    /// Bytes sent, including data.
    pub sent_bytes: u64,
    /// Bytes of answers.
    pub received_bytes: u64,
    /// Last measured bandwidth to the resource, in bytes per second; `None` unless it is known to limit.
    pub bandwidth_there: Option<f64>,
    /// Last measured bandwidth from the resource, in bytes per second; `None` unless it is known to limit.
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
