//! The state of the composition of a picture.

use std::collections::{BTreeMap, BTreeSet};

use bottega_image::Sides;
use rustc_hash::FxHashSet;

use crate::{Blackboard, Mask, Partition, ZoneId, ZoneRow, ZoneState, masks};

/// So many of the zones that wait are checked after each event.
const READY_CHECKED: usize = 4;

/// Which zones are in the film. Each is put there once, and each piece of a zone in its place among the zones.
#[derive(Clone, Debug, Default)]
pub(super) struct Composition {
    /// Painted, and not yet handed to the film; by zone, then by piece.
    ready: BTreeSet<(ZoneId, ZoneId)>,
    /// Handed to the film, which has not answered.
    composing: BTreeSet<ZoneId>,
    /// A hash set, for speed: never gone through.
    composed: FxHashSet<ZoneId>,
    /// Where there are bands; known when those of all zones are.
    masks: Option<Vec<Mask>>,
    /// The widths that they were made for, by zone.
    bands: Vec<Sides<u32>>,
    /// With bands, all zones before this one are in the film.
    cursor: u32,
    /// The pieces of zones that were cut, as far as a row has told of them.
    pieces: BTreeMap<ZoneId, BTreeSet<ZoneId>>,
}

impl Composition {
    /// Whether the masks were made for another band than a zone has now: its samples were lost or it was given up, and who
    /// painted it after all decided otherwise.
    pub(super) fn is_outdated(&self, row: &ZoneRow) -> bool {
        let made_for =
            self.bands.get(row.zone.index()).filter(|_| row.root.is_none() && row.state != ZoneState::Failed);
        made_for.is_some_and(|made_for| *made_for != bands(row))
    }

    /// Takes in a zone's row: it is painted, or no longer is because its samples were lost.
    pub(super) fn see(&mut self, row: &ZoneRow) {
        if let Some(cut) = row.cut {
            self.pieces.entry(row.root()).or_default().insert(cut.zone);
        }
        if row.root.is_some() {
            self.pieces.entry(row.root()).or_default().insert(row.zone);
        }
        if row.state != ZoneState::Failed && !self.has(row.zone) {
            // What was given up may be painted after all.
            self.cursor = self.cursor.min(row.root().0);
        }
        if row.state != ZoneState::Done {
            self.ready.remove(&(row.root(), row.zone));
        } else if !self.composing.contains(&row.zone) && !self.composed.contains(&row.zone) {
            self.ready.insert((row.root(), row.zone));
        }
    }

    /// The next zone to hand to the film, with its mask; `None`: none is painted, or not all bands are known. With
    /// optimization off there are none.
    ///
    /// - `all_chosen`: a quick count says that all bands may be known.
    pub(super) fn next(&mut self, board: &Blackboard, all_chosen: bool) -> Option<(ZoneId, Mask)> {
        let work = board.work()?;
        let plain = work.settings.optimization.rule_input().is_none();
        let (root, zone) = *self.ready.first()?;
        // Where more than two bands meet, the order of sums shows in the last bit: so it is always the same. The pieces
        // of one zone do not meet.
        if !plain && root != self.next_in_order(board) {
            return None;
        }
        let settled = |row: &ZoneRow| row.choice.is_some() || row.state == ZoneState::Failed;
        let mask = if plain {
            Mask::without_band(board.zone(root)?.1.rect, work.settings.frame)
        } else {
            if self.masks.is_none() && all_chosen && board.zones().all(settled) {
                let zones = || board.zones().filter(|row| row.root.is_none());
                let rects = zones().map(|row| row.rect).collect();
                self.bands = zones().map(bands).collect();
                self.masks = Some(masks(&Partition::of_zones(work.settings.frame, rects), &self.bands));
            }
            self.masks.as_ref()?[root.index()].clone()
        };
        self.ready.remove(&(root, zone));
        self.composing.insert(zone);
        Some((zone, mask))
    }

    /// The film has answered. Returns whether it was asked.
    pub(super) fn composed(&mut self, zone: ZoneId, well: bool) -> bool {
        let asked = self.composing.remove(&zone);
        if asked && well {
            self.composed.insert(zone);
        } else if asked {
            let root = self.pieces.iter().find(|(_, pieces)| pieces.contains(&zone)).map_or(zone, |(root, _)| *root);
            self.cursor = self.cursor.min(root.0);
        }
        asked
    }

    fn next_in_order(&mut self, board: &Blackboard) -> ZoneId {
        let passed = |zone: ZoneId| {
            let failed = board.zone(zone).is_some_and(|(_, row)| row.state == ZoneState::Failed);
            failed || self.composing.contains(&zone) || self.composed.contains(&zone)
        };
        let all_passed = |root: ZoneId| {
            let mut pieces = self.pieces.get(&root).into_iter().flatten();
            passed(root) && pieces.all(|&piece| passed(piece))
        };
        while all_passed(ZoneId(self.cursor)) {
            self.cursor += 1;
        }
        ZoneId(self.cursor)
    }

    /// Whether a zone is in the film, or on its way there.
    pub(super) fn has(&self, zone: ZoneId) -> bool {
        self.composing.contains(&zone) || self.composed.contains(&zone)
    }

    /// Zones that the film has not answered about.
    pub(super) fn composing_count(&self) -> usize {
        self.composing.len()
    }

    /// Zones in the film.
    pub(super) fn composed_count(&self) -> usize {
        self.composed.len()
    }

    pub(super) fn assert_invariants(&self) {
        let handed = |zone: &ZoneId| self.composing.contains(zone) || self.composed.contains(zone);
        // The next ones: all of them would be too many to look at after each event.
        assert!(
            !self.ready.iter().take(READY_CHECKED).any(|(_, zone)| handed(zone)),
            "a zone waits that was handed over"
        );
        let twice = self.composing.iter().any(|zone| self.composed.contains(zone));
        assert!(!twice, "no zone goes into the film twice");
    }
}

/// The widths of a zone's bands; none, where nobody has decided.
fn bands(row: &ZoneRow) -> Sides<u32> {
    row.choice.map_or(Sides::all(0), |choice| choice.bands)
}
