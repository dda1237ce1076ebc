//! The cable of a far resource: how many bytes a second pass, learnt from what was sent, and how much a packet may hold for it.
//!
//! Both directions are in use at the same time, so that the slower one decides. A resource behind a slow cable is one for which the
//! bytes of a unit take longer than the unit; it gets packets that occupy the cable for [`PACKET_TIME`], whatever else a packet
//! costs: while one is sent the one before is computed, and no unit waits longer for the others of its packet.
//!
//! Source: Pereira et al., *Efficient use of Multiple Hardware Components for Image Synthesis*, section 3.3.6.

use crate::{CableUse, Link, Transfer};

/// How long a packet occupies a slow cable, in nanoseconds, if it has more than one unit: some fifty times what it takes to hand it over.
const PACKET_TIME: f64 = 10e6;
/// Share of a unit's time from which on its bytes count as what it costs.
const SLOW_FROM: f64 = 0.5;
/// Bytes for which the bandwidth counts that was there before any was measured.
const BYTES_BEFORE: f64 = 65_536.0;
/// Part of the old measurements that is left after each new one.
const KEPT: f64 = 0.9;

/// Bytes of a unit, or of a packet, in both directions.
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

    /// How many units of so many bytes fit; at least one.
    pub(crate) fn units(self, unit: Self) -> usize {
        let [there, back] = [self.there / unit.there.max(1), self.back / unit.back.max(1)];
        usize::try_from(there.min(back)).unwrap_or(usize::MAX).max(1)
    }
}

/// One direction: bytes, and the time in which they passed, both fading.
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

/// The cable of a resource.
#[derive(Clone, Debug)]
pub(crate) struct Cable {
    there: CableWay,
    back: CableWay,
    passed: CableUse,
}

impl Cable {
    /// A cable of which only the description is known.
    pub(crate) fn new(link: &Link) -> Self {
        let (there, back) = (CableWay::new(link.bandwidth), CableWay::new(link.bandwidth));
        Self { there, back, passed: CableUse::default() }
    }

    /// Data goes along with a packet.
    pub(crate) fn moved(&mut self, bytes: u64) {
        self.passed.sent_bytes = self.passed.sent_bytes.saturating_add(bytes);
    }

    /// A packet is answered, `away_ns` after it was sent. `measured`: the bytes there and back, where the driver knows; else those
    /// of its units count.
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

    /// Nanoseconds for which bytes occupy the cable.
    pub(crate) fn ns(&self, bytes: CableBytes) -> f64 {
        self.there.ns(bytes.there).max(self.back.ns(bytes.back))
    }

    /// Nanoseconds that bytes take there and their answer back, one after the other.
    pub(crate) fn way_ns(&self, bytes: CableBytes) -> f64 {
        self.there.ns(bytes.there) + self.back.ns(bytes.back)
    }

    /// Nanoseconds until data is there.
    pub(crate) fn moving_ns(&self, bytes: u64) -> f64 {
        self.there.ns(bytes)
    }

    /// Most bytes in a packet of such units, if each takes `unit_ns` in all; `None`: the cable sets no bound.
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
