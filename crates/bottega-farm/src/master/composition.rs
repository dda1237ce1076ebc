//! How far the picture is put together.

use std::collections::BTreeSet;

use crate::{Blackboard, Mask, Partition, ZoneId, ZoneRow, ZoneState, masks};

/// Which zones are in the film. Each is put there once.
#[derive(Clone, Debug, Default)]
pub(super) struct Composition {
    /// Painted, and not yet handed to the film.
    ready: BTreeSet<ZoneId>,
    /// Handed to the film, which has not answered.
    composing: BTreeSet<ZoneId>,
    composed: BTreeSet<ZoneId>,
    /// Known when the bands of all zones are.
    masks: Option<Vec<Mask>>,
    /// With bands, all zones before this one are in the film.
    cursor: u32,
}

impl Composition {
    /// A zone is painted, or (`false`) no longer is, because its samples were lost.
    pub(super) fn set_painted(&mut self, zone: ZoneId, painted: bool) {
        if !painted {
            self.ready.remove(&zone);
        } else if !self.composing.contains(&zone) && !self.composed.contains(&zone) {
            self.ready.insert(zone);
        }
    }

    /// The next zone to hand to the film, with its mask; `None`: none is painted, or not all bands are known. With
    /// optimization off there are none.
    ///
    /// - `all_chosen`: a quick count says that all bands may be known.
    pub(super) fn next(&mut self, board: &Blackboard, all_chosen: bool) -> Option<(ZoneId, Mask)> {
        let work = board.work()?;
        let plain = work.settings.optimization.rule_input().is_none();
        let zone = *self.ready.first()?;
        // Where more than two bands meet, the order of sums shows in the last bit: so it is always the same.
        if !plain && zone != self.next_in_order(board) {
            return None;
        }
        let settled = |row: &ZoneRow| row.choice.is_some() || row.state == ZoneState::Failed;
        if self.masks.is_none() && (plain || all_chosen && board.zones().all(settled)) {
            let rects = board.zones().map(|row| row.rect).collect();
            let bands: Vec<u32> = board.zones().map(|row| row.choice.map_or(0, |choice| choice.band)).collect();
            self.masks = Some(masks(&Partition::of_zones(work.settings.frame, rects), &bands));
        }
        let mask = self.masks.as_ref()?[zone.index()].clone();
        self.ready.remove(&zone);
        self.composing.insert(zone);
        Some((zone, mask))
    }

    /// The film has answered. Returns whether it was asked.
    pub(super) fn composed(&mut self, zone: ZoneId, well: bool) -> bool {
        let asked = self.composing.remove(&zone);
        if asked && well {
            self.composed.insert(zone);
        } else if asked {
            self.cursor = self.cursor.min(zone.0);
        }
        asked
    }

    fn next_in_order(&mut self, board: &Blackboard) -> ZoneId {
        let passed = |zone: ZoneId| {
            let failed = board.zone(zone).is_some_and(|(_, row)| row.state == ZoneState::Failed);
            failed || self.composing.contains(&zone) || self.composed.contains(&zone)
        };
        while passed(ZoneId(self.cursor)) {
            self.cursor += 1;
        }
        ZoneId(self.cursor)
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
        assert!(self.ready.is_disjoint(&self.composing) && self.ready.is_disjoint(&self.composed));
        assert!(self.composing.is_disjoint(&self.composed), "no zone goes into the film twice");
    }
}
