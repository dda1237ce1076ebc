//! The cable of a far resource: its bandwidth, learned from the traffic, and the resulting limit on packets.
//!
//! Both directions are used at the same time, so the slower one decides. A cable is slow if the bytes of a unit take
//! longer than the unit itself. Packets over a slow cable occupy it for [`PACKET_TIME`], whatever their other costs:
//! while one is sent the one before is computed, and no unit waits longer for the others of its packet.
//!
//! Source: Pereira et al., *Efficient use of Multiple Hardware Components for Image Synthesis*, section 3.3.6.

use crate::{CableUse, Link, Transfer};

/// Time for which a packet of more than one unit occupies a slow cable, in nanoseconds: about fifty times that of
/// handing it over.
const PACKET_TIME: f64 = 10e6;
/// Share of a unit's time from which its bytes count as its cost.
const SLOW_FROM: f64 = 0.5;
/// Number of bytes with which the initial bandwidth is weighted.
const BYTES_BEFORE: f64 = 65_536.0;
/// Factor on the weight of old measurements at each new one.
const KEPT: f64 = 0.9;

/// Bytes of a unit or a packet in both directions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct CableBytes {
    pub(crate) there: u64,
    pub(crate) back: u64,
}

impl CableBytes {
    pub(crate) fn add(self, other: Self) -> Self {
        Self { there: self.there.saturating_add(other.there), back: self.back.saturating_add(other.back) }
    }

    pub(crate) fn fits(self, bound: Self) -> bool {
        self.there <= bound.there && self.back <= bound.back
    }

    /// Returns the number of units of this size that fit; at least one.
    pub(crate) fn units(self, unit: Self) -> usize {
        let [there, back] = [self.there / unit.there.max(1), self.back / unit.back.max(1)];
        usize::try_from(there.min(back)).unwrap_or(usize::MAX).max(1)
    }
}

/// One direction: bytes and the time they took, both decaying.
#[derive(Clone, Copy, Debug)]
struct CableWay {
    bytes: f64,
    ns: f64,
}

impl CableWay {
    fn new(bandwidth: f64) -> Self {
        let ns = BYTES_BEFORE / bandwidth * 1e9;
        Self { bytes: BYTES_BEFORE, ns: if ns.is_finite() { ns.max(0.0) } else { 0.0 } }
    }

    fn observe(&mut self, transfer: &Transfer) {
        if transfer.timed_bytes > 0 {
            self.bytes = KEPT * self.bytes + transfer.timed_bytes as f64;
            self.ns = KEPT * self.ns + transfer.time.as_nanos() as f64;
        }
    }

    fn ns(&self, bytes: u64) -> f64 {
        bytes as f64 * self.ns / self.bytes
    }

    fn bytes_in(&self, ns: f64) -> u64 {
        if self.ns > 0.0 { (ns * self.bytes / self.ns) as u64 } else { u64::MAX }
    }

    fn bandwidth(&self) -> Option<f64> {
        (self.ns > 0.0).then(|| self.bytes / self.ns * 1e9)
    }
}

/// The cable of a resource, with its learned bandwidth.
#[derive(Clone, Debug)]
pub(crate) struct Cable {
    there: CableWay,
    back: CableWay,
    passed: CableUse,
}

impl Cable {
    /// Makes a cable without measurements.
    pub(crate) fn new(link: &Link) -> Self {
        let (there, back) = (CableWay::new(link.bandwidth), CableWay::new(link.bandwidth));
        Self { there, back, passed: CableUse::default() }
    }

    /// Adds data sent with a packet.
    pub(crate) fn moved(&mut self, bytes: u64) {
        self.passed.sent_bytes = self.passed.sent_bytes.saturating_add(bytes);
    }

    /// Takes in an answered packet, `away_ns` after it was sent. `measured`: the traffic in both directions, if the
    /// driver measured it; else the bytes of its units count.
    pub(crate) fn answered(&mut self, bytes: CableBytes, away: std::time::Duration, measured: Option<&[Transfer; 2]>) {
        let passed = measured.map_or(bytes, |[there, back]| CableBytes { there: there.bytes, back: back.bytes });
        self.passed.sent_bytes = self.passed.sent_bytes.saturating_add(passed.there);
        self.passed.received_bytes = self.passed.received_bytes.saturating_add(passed.back);
        self.passed.packets += 1;
        self.passed.away = self.passed.away.saturating_add(away);
        if let Some([there, back]) = measured {
            self.there.observe(there);
            self.back.observe(back);
        }
    }

    /// Returns the time for which bytes occupy the cable, in nanoseconds.
    pub(crate) fn ns(&self, bytes: CableBytes) -> f64 {
        self.there.ns(bytes.there).max(self.back.ns(bytes.back))
    }

    /// Returns the time of bytes to the resource plus that of the answer, in nanoseconds.
    pub(crate) fn way_ns(&self, bytes: CableBytes) -> f64 {
        self.there.ns(bytes.there) + self.back.ns(bytes.back)
    }

    /// Returns the time to send data, in nanoseconds.
    pub(crate) fn moving_ns(&self, bytes: u64) -> f64 {
        self.there.ns(bytes)
    }

    /// Returns the maximum number of bytes in a packet of such units, if each takes `unit_ns` in all; `None`: the
    /// cable sets no limit.
    pub(crate) fn most_bytes(&self, unit: CableBytes, unit_ns: f64) -> Option<CableBytes> {
        let cable_ns = self.ns(unit);
        let is_slow = cable_ns > 0.0 && cable_ns >= SLOW_FROM * unit_ns;
        is_slow.then(|| CableBytes { there: self.there.bytes_in(PACKET_TIME), back: self.back.bytes_in(PACKET_TIME) })
    }

    pub(crate) fn report(&self) -> CableUse {
        CableUse { bandwidth_there: self.there.bandwidth(), bandwidth_back: self.back.bandwidth(), ..self.passed }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn cable(bandwidth: f64) -> Cable {
        Cable::new(&Link { latency: Duration::ZERO, bandwidth })
    }

    const RAYS: CableBytes = CableBytes { there: 10_000, back: 5_000 };

    #[test]
    fn the_bandwidth_is_that_of_what_was_sent_and_follows_a_change() {
        let mut cable = cable(1e9);
        let at = |bandwidth: f64, bytes: u64| {
            let time = Duration::from_secs_f64(bytes as f64 / bandwidth);
            Transfer { bytes: bytes + 40, timed_bytes: bytes, time }
        };
        for _ in 0..40 {
            cable.answered(RAYS, Duration::ZERO, Some(&[at(1e6, RAYS.there), at(2e6, RAYS.back)]));
        }
        let used = cable.report();
        let is = |measured: Option<f64>, wanted: f64| (measured.unwrap() / wanted - 1.0).abs() < 0.1;
        assert!(is(used.bandwidth_there, 1e6) && is(used.bandwidth_back, 2e6), "{used:?}");
        assert_eq!((used.sent_bytes, used.received_bytes), (40 * 10_040, 40 * 5_040));
        for _ in 0..40 {
            cable.answered(RAYS, Duration::ZERO, Some(&[at(1e5, RAYS.there), at(2e6, RAYS.back)]));
        }
        assert!(is(cable.report().bandwidth_there, 1e5), "{:?}", cable.report());
    }

    #[test]
    fn a_packet_occupies_a_slow_cable_for_a_while_and_a_fast_one_sets_no_bound() {
        let most = |bandwidth, unit_ns| cable(bandwidth).most_bytes(RAYS, unit_ns).map(|most| most.units(RAYS));
        // 10 kB are there in 1 ms.
        assert_eq!(most(1e7, 1e6), Some(10));
        assert_eq!(most(1e6, 1e7), Some(1), "never less than one");
        assert_eq!(most(1e7, 1e7), None, "computing takes longer than sending");
        assert_eq!(most(f64::INFINITY, 1.0), None);
        assert_eq!(cable(1e6).most_bytes(CableBytes::default(), 1.0), None, "nothing travels");
    }
}
