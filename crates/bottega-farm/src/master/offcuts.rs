//! Offcuts: the pieces that were cut off zones and have no row on the Blackboard yet.

use std::collections::BTreeMap;

use bottega_agents::Time;

use super::{assignments::Assignments, rows::RowFollowUp};
use crate::{Blackboard, FarmAction, ZoneId, ZoneRow};

/// The pieces without a row. The cut in the zone's own row is binding: a Master that fails in between is followed by one
/// that writes the piece's row.
#[derive(Clone, Debug, Default)]
pub(super) struct Offcuts {
    /// Pieces without a row, with the zones they were cut from.
    missing: BTreeMap<ZoneId, ZoneId>,
    /// The zones of `missing` whose row must be written, again if a write failed.
    due: Vec<ZoneId>,
}

impl Offcuts {
    /// Takes in a zone's row: it is a piece's row that was missing, or the zone was cut.
    ///
    /// - `board`: the Blackboard, already with this row.
    pub(super) fn see(&mut self, row: &ZoneRow, board: &Blackboard) {
        self.missing.remove(&row.zone);
        if let Some(cut) = row.cut.filter(|cut| board.zone(cut.zone).is_none()) {
            self.missing.insert(cut.zone, row.zone);
            self.due.push(cut.zone);
        }
    }

    /// Notes that a write of a zone that has no row has failed.
    pub(super) fn note_failed_write(&mut self, zone: ZoneId) {
        if self.missing.contains_key(&zone) {
            self.due.push(zone);
        }
    }

    /// Writes the rows of new pieces.
    pub(super) fn write(&mut self, now: Time, assignments: &mut Assignments, actions: &mut Vec<FarmAction>) {
        while let Some(piece) = self.due.pop() {
            let rows = &assignments.rows;
            let Some(&zone) = self.missing.get(&piece).filter(|_| !rows.is_being_written(piece)) else { continue };
            if let Some(row) = rows.zone(zone).and_then(|(_, row)| row.offcut()) {
                assignments.write(now, row, RowFollowUp::TakenBack, actions);
            }
        }
    }

    /// Returns true if all pieces have rows.
    pub(super) fn is_empty(&self) -> bool {
        self.missing.is_empty()
    }
}
