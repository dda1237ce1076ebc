//! Results of comparing paintings by their look.

use std::collections::{BTreeMap, BTreeSet};

use bottega_agents::BlobId;

use crate::{FarmMessage, ZoneId};

/// Two tiles of a zone.
pub(super) type Pair = (ZoneId, BlobId, BlobId);

/// Results of comparisons, and reports that wait for one. A new Master compares again.
#[derive(Clone, Debug, Default)]
pub(super) struct Looks {
    /// Compared pairs of tiles: true if they may be the same picture.
    seen: BTreeMap<Pair, bool>,
    /// Tiles that could not be fetched.
    gone: BTreeSet<(ZoneId, BlobId)>,
    /// Reports that wait for a comparison.
    waiting: BTreeMap<ZoneId, FarmMessage>,
}

impl Looks {
    /// True if two tiles may be the same picture; `None`: not compared yet.
    pub(super) fn found(&self, pair: &Pair) -> Option<bool> {
        self.seen.get(pair).copied()
    }

    pub(super) fn see(&mut self, pair: Pair, same: bool) {
        self.seen.insert(pair, same);
    }

    /// True if a tile could not be fetched.
    pub(super) fn is_gone(&self, zone: ZoneId, tile: BlobId) -> bool {
        self.gone.contains(&(zone, tile))
    }

    pub(super) fn lose(&mut self, zone: ZoneId, tile: BlobId) {
        self.gone.insert((zone, tile));
    }

    /// True if a tile could not be fetched; removes the mark, so that it is tried again.
    pub(super) fn take_gone(&mut self, zone: ZoneId, tile: BlobId) -> bool {
        self.gone.remove(&(zone, tile))
    }

    /// True if a report of the zone waits for a comparison.
    pub(super) fn is_awaited(&self, zone: ZoneId) -> bool {
        self.waiting.contains_key(&zone)
    }

    pub(super) fn wait(&mut self, zone: ZoneId, report: FarmMessage) {
        self.waiting.insert(zone, report);
    }

    pub(super) fn take_waiting(&mut self, zone: ZoneId) -> Option<FarmMessage> {
        self.waiting.remove(&zone)
    }

    /// Drops the results for a zone.
    pub(super) fn forget(&mut self, zone: ZoneId) {
        let (first, last) = (BlobId([0; 32]), BlobId([u8::MAX; 32]));
        let pairs: Vec<_> = self.seen.range((zone, first, first)..=(zone, last, last)).map(|(pair, _)| *pair).collect();
        pairs.iter().for_each(|pair| _ = self.seen.remove(pair));
        let gone: Vec<_> = self.gone.range((zone, first)..=(zone, last)).copied().collect();
        gone.iter().for_each(|tile| _ = self.gone.remove(tile));
    }
}
