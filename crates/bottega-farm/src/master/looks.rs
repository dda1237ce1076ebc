//! The pixels of zones that several agents have painted.

use std::collections::{BTreeMap, BTreeSet};

use bottega_agents::BlobId;

use crate::{FarmMessage, ZoneId};

/// Two tiles of a zone.
pub(super) type Pair = (ZoneId, BlobId, BlobId);

/// What looking at pixels has shown, and reports that wait for it. A Master that takes over looks again.
#[derive(Clone, Debug, Default)]
pub(super) struct Looks {
    /// Pairs of tiles that were looked at, and whether they may be the same picture.
    seen: BTreeMap<Pair, bool>,
    /// Tiles that could not be had.
    gone: BTreeSet<(ZoneId, BlobId)>,
    /// Reports for which pixels are being looked at.
    waiting: BTreeMap<ZoneId, FarmMessage>,
}

impl Looks {
    /// Whether two tiles may be the same picture; `None`: nobody has looked yet.
    pub(super) fn found(&self, pair: &Pair) -> Option<bool> {
        self.seen.get(pair).copied()
    }

    pub(super) fn see(&mut self, pair: Pair, same: bool) {
        self.seen.insert(pair, same);
    }

    /// Whether a tile could not be had.
    pub(super) fn is_gone(&self, zone: ZoneId, tile: BlobId) -> bool {
        self.gone.contains(&(zone, tile))
    }

    pub(super) fn lose(&mut self, zone: ZoneId, tile: BlobId) {
        self.gone.insert((zone, tile));
    }

    /// Whether a tile could not be had; from now on it may be there again.
    pub(super) fn take_gone(&mut self, zone: ZoneId, tile: BlobId) -> bool {
        self.gone.remove(&(zone, tile))
    }

    /// Whether a report of the zone waits for a look.
    pub(super) fn is_awaited(&self, zone: ZoneId) -> bool {
        self.waiting.contains_key(&zone)
    }

    pub(super) fn wait(&mut self, zone: ZoneId, report: FarmMessage) {
        self.waiting.insert(zone, report);
    }

    pub(super) fn take_waiting(&mut self, zone: ZoneId) -> Option<FarmMessage> {
        self.waiting.remove(&zone)
    }

    /// Forgets what was seen of a zone.
    pub(super) fn forget(&mut self, zone: ZoneId) {
        let (first, last) = (BlobId([0; 32]), BlobId([u8::MAX; 32]));
        let pairs: Vec<_> = self.seen.range((zone, first, first)..=(zone, last, last)).map(|(pair, _)| *pair).collect();
        pairs.iter().for_each(|pair| _ = self.seen.remove(pair));
        let gone: Vec<_> = self.gone.range((zone, first)..=(zone, last)).copied().collect();
        gone.iter().for_each(|tile| _ = self.gone.remove(tile));
    }
}
