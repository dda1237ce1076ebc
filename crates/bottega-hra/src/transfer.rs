//! Bytes on the cable of a far resource: of one packet as its driver measured them, and of all.

use std::time::Duration;

/// The bytes of one packet in one direction, and how fast they passed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Transfer {
    /// All of them.
    pub bytes: u64,
    /// Of these, the ones that followed others without a pause: only they tell how fast the cable is. 0: not measured.
    pub timed_bytes: u64,
    /// The time in which these passed.
    pub time: Duration,
}

/// What passed on the cable of a far resource.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CableUse {
    /// Bytes sent there, data included.
    pub sent_bytes: u64,
    /// Bytes of answers.
    pub received_bytes: u64,
    /// Bytes a second that pass there, as measured last; `None` where nothing is known to be slow.
    pub bandwidth_there: Option<f64>,
    /// The same on the way back.
    pub bandwidth_back: Option<f64>,
    /// Packets that were answered.
    pub packets: u64,
    /// Time from sending to the answer, all of them together.
    pub away: Duration,
}

impl CableUse {
    /// Mean time between the sending of a packet and its answer.
    pub fn packet_time(&self) -> Option<Duration> {
        (self.packets > 0).then(|| self.away.div_f64(self.packets as f64))
    }

    /// What has passed since an earlier moment.
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
