//! Composition: the state of each zone on its way into the film.

use std::collections::{BTreeMap, BTreeSet};

use bottega_image::Sides;
use rustc_hash::FxHashSet;

use crate::{Blackboard, FarmAction, FarmEffect, Mask, Partition, ZoneId, ZoneRow, ZoneState, masks};

/// Maximum number of zones being composed at a time.
const COMPOSING_MAX: usize = 8;
/// Number of ready zones checked by the invariants after each event.
const READY_CHECKED: usize = 4;

/// The zones ready for the film, handed to it, and composed. Each enters the film once, pieces at their zone's place in
/// the order.
#[derive(Clone, Debug, Default)]
pub(super) struct Composition {
    /// Painted zones not yet handed to the film; by zone, then by piece.
    ready: BTreeSet<(ZoneId, ZoneId)>,
    /// Zones handed to the film without an answer yet.
    composing: BTreeSet<ZoneId>,
    /// Zones in the film. A hash set for speed; never iterated.
    composed: FxHashSet<ZoneId>,
    /// The masks if there are bands; made when the bands of all zones are known.
    masks: Option<Vec<Mask>>,
    /// The bands that the masks were made for, by zone.
    bands: Vec<Sides<u32>>,
    /// With bands: all zones before this one are in the film.
    cursor: u32,
    /// Known pieces of zones that were cut.
    pieces: BTreeMap<ZoneId, BTreeSet<ZoneId>>,
    /// True if the film contains a zone that is painted again: a new film begins when the pending compositions are
    /// answered.
    is_stale: bool,
}

impl Composition {
    /// Returns true if the masks were made for another band than the zone has now. That happens if its samples were
    /// lost or it was given up, and the next agent chose other settings.
    fn is_outdated(&self, row: &ZoneRow) -> bool {
        let made_for =
            self.bands.get(row.zone.index()).filter(|_| row.root.is_none() && row.state != ZoneState::Failed);
        made_for.is_some_and(|made_for| *made_for != bands(row))
    }

    /// Takes in a zone's row: the zone is painted, or its samples were discarded.
    pub(super) fn see(&mut self, row: &ZoneRow) {
        self.is_stale |= row.state != ZoneState::Done && self.has(row.zone);
        self.is_stale |= self.is_outdated(row);
        if let Some(cut) = row.cut {
            self.pieces.entry(row.root()).or_default().insert(cut.zone);
        }
        if row.root.is_some() {
            self.pieces.entry(row.root()).or_default().insert(row.zone);
        }
        if row.state != ZoneState::Failed && !self.has(row.zone) {
            // A zone that was given up may be painted after all.
            self.cursor = self.cursor.min(row.root().0);
        }
        if row.state != ZoneState::Done {
            self.ready.remove(&(row.root(), row.zone));
        } else if !self.composing.contains(&row.zone) && !self.composed.contains(&row.zone) {
            self.ready.insert((row.root(), row.zone));
        }
    }

    /// Hands painted zones to the film, as many as it takes at a time.
    ///
    /// - `all_chosen`: a cheap count that shows that the bands of all zones may be known.
    pub(super) fn hand_over(&mut self, board: &Blackboard, all_chosen: bool, actions: &mut Vec<FarmAction>) {
        if self.is_stale {
            if self.composing_count() > 0 {
                return;
            }
            self.begin_new_film(board, actions);
        }
        while self.composing_count() < COMPOSING_MAX {
            let Some((zone, mask)) = self.next(board, all_chosen) else { return };
            let Some(result) = board.zone(zone).and_then(|(_, row)| row.result) else { return };
            actions.push(FarmAction::Effect(FarmEffect::Compose { zone, result, mask }));
        }
    }

    /// Begins a new film, into which all painted zones are composed again.
    fn begin_new_film(&mut self, board: &Blackboard, actions: &mut Vec<FarmAction>) {
        let Some(work) = board.work().cloned() else { return };
        *self = Self::default();
        board.zones().for_each(|row| self.see(row));
        actions.push(FarmAction::Effect(FarmEffect::BeginFilm(work)));
    }

    /// Returns the next zone to hand to the film, with its mask. `None`: none is ready, or not all bands are known.
    fn next(&mut self, board: &Blackboard, all_chosen: bool) -> Option<(ZoneId, Mask)> {
        let work = board.work()?;
        let plain = work.settings.optimization.rule_input().is_none();
        let (root, zone) = *self.ready.first()?;
        // Where more than two bands overlap, rounding depends on the order of the sum, so zones enter in a fixed order.
        // Pieces of one zone do not overlap.
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

    /// Takes in the film's answer. Returns true if it was expected.
    pub(super) fn composed(&mut self, zone: ZoneId, well: bool) -> bool {
        let was_expected = self.composing.remove(&zone);
        if was_expected && well {
            self.composed.insert(zone);
        } else if was_expected {
            let root = self.pieces.iter().find(|(_, pieces)| pieces.contains(&zone)).map_or(zone, |(root, _)| *root);
            self.cursor = self.cursor.min(root.0);
        }
        was_expected
    }

    /// Returns the first zone that is neither composed nor given up, with all its pieces.
    fn next_in_order(&mut self, board: &Blackboard) -> ZoneId {
        // A zone is passed when it and all its pieces are in the film, on the way there, or given up
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

    /// Returns true if a zone is in the film or handed to it.
    fn has(&self, zone: ZoneId) -> bool {
        self.composing.contains(&zone) || self.composed.contains(&zone)
    }

    /// Returns true if the film contains a zone that is painted again.
    pub(super) fn is_stale(&self) -> bool {
        self.is_stale
    }

    /// Returns the number of zones handed to the film without an answer.
    pub(super) fn composing_count(&self) -> usize {
        self.composing.len()
    }

    /// Returns the number of zones in the film.
    pub(super) fn composed_count(&self) -> usize {
        self.composed.len()
    }

    pub(super) fn assert_invariants(&self) {
        let handed = |zone: &ZoneId| self.composing.contains(zone) || self.composed.contains(zone);
        // Check the next few only, because all would be too many after each event.
        assert!(
            !self.ready.iter().take(READY_CHECKED).any(|(_, zone)| handed(zone)),
            "a zone waits that was handed over"
        );
        let twice = self.composing.iter().any(|zone| self.composed.contains(zone));
        assert!(!twice, "no zone goes into the film twice");
    }
}

/// Returns the widths of a zone's bands; 0 without a choice.
fn bands(row: &ZoneRow) -> Sides<u32> {
    row.choice.map_or(Sides::all(0), |choice| choice.bands)
}
