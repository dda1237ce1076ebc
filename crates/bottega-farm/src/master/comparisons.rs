//! Results of comparing paintings by their look.

use std::collections::{BTreeMap, BTreeSet};

use bottega_agents::BlobId;

use crate::{FarmMessage, ZoneId};

/// Two tiles of a zone.
pub(super) type Pair = (ZoneId, BlobId, BlobId);

/// Results of comparing the pixels of tiles, and reports that wait for one. A new Master compares again.
#[derive(Clone, Debug, Default)]
pub(super) struct Comparisons {
    /// Compared pairs of tiles: true if they may be the same picture.
    seen: BTreeMap<Pair, bool>,
    /// Tiles that could not be fetched.
    missing: BTreeSet<(ZoneId, BlobId)>,
    /// Reports that wait for a comparison.
    postponed: BTreeMap<ZoneId, FarmMessage>,
}

impl Comparisons {
    /// Returns true if two tiles may be the same picture; `None`: not compared yet.
    pub(super) fn result(&self, pair: &Pair) -> Option<bool> {
        self.seen.get(pair).copied()
    }

    /// Records the result for a pair of tiles.
    pub(super) fn record(&mut self, pair: Pair, same: bool) {
        self.seen.insert(pair, same);
    }

    /// Returns true if a tile could not be fetched.
    pub(super) fn is_missing(&self, zone: ZoneId, tile: BlobId) -> bool {
        self.missing.contains(&(zone, tile))
    }

    /// Records that a tile could not be fetched.
    pub(super) fn record_missing(&mut self, zone: ZoneId, tile: BlobId) {
        self.missing.insert((zone, tile));
    }

    /// Returns true if a tile could not be fetched; removes the mark, so that it is tried again.
    pub(super) fn take_missing(&mut self, zone: ZoneId, tile: BlobId) -> bool {
        self.missing.remove(&(zone, tile))
    }

    /// Returns true if a report of the zone waits for a comparison.
    pub(super) fn is_awaited(&self, zone: ZoneId) -> bool {
        self.postponed.contains_key(&zone)
    }

    /// Keeps a report until the comparison that it needs is answered.
    pub(super) fn postpone(&mut self, zone: ZoneId, report: FarmMessage) {
        self.postponed.insert(zone, report);
    }

    /// Takes the report of the zone that waited for a comparison.
    pub(super) fn take_postponed(&mut self, zone: ZoneId) -> Option<FarmMessage> {
        self.postponed.remove(&zone)
    }

    /// Drops the results for a zone.
    pub(super) fn forget(&mut self, zone: ZoneId) {
        let (first, last) = (BlobId([0; 32]), BlobId([u8::MAX; 32]));
        let pairs: Vec<_> = self.seen.range((zone, first, first)..=(zone, last, last)).map(|(pair, _)| *pair).collect();
        pairs.iter().for_each(|pair| _ = self.seen.remove(pair));
        let missing: Vec<_> = self.missing.range((zone, first)..=(zone, last)).copied().collect();
        missing.iter().for_each(|tile| _ = self.missing.remove(tile));
    }
}
