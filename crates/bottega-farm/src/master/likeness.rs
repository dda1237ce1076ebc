//! Works whose engines give no two agents the same bits: before a report can be compared with the words of others, somebody
//! looks at the pixels of both.

use super::*;
use crate::{ResultRef, Vote};

impl Master {
    /// Whether two agents made the same of a zone.
    pub(super) fn is_same(&self, zone: ZoneId, one: &Painting, other: &Painting) -> bool {
        if !self.config.compares_by_look {
            return one.is_same(other);
        }
        let pair = (zone, one.result.digest, other.result.digest);
        one.may_look_like(other) && (pair.1 == pair.2 || self.looks.found(&pair) == Some(true))
    }

    /// Whether the tile of a vote cannot be had, so that it says nothing.
    pub(super) fn is_gone(&self, zone: ZoneId, painting: &Painting) -> bool {
        self.looks.is_gone(zone, painting.result.digest)
    }

    /// The same of a tile that is reported; the next report of it may be of one that is there.
    pub(super) fn take_gone(&mut self, zone: ZoneId, painting: &Painting) -> bool {
        self.looks.take_gone(zone, painting.result.digest)
    }

    /// Whether the words of others can be compared with this report now. If not, pixels are being looked at, and the report is
    /// taken when that is done.
    pub(super) fn can_compare(
        &mut self,
        before: &ZoneRow,
        painting: &Painting,
        message: &FarmMessage,
        actions: &mut Vec<FarmAction>,
    ) -> bool {
        if !self.verifies() || !self.config.compares_by_look {
            return true;
        }
        let zone = before.zone;
        if self.looks.is_awaited(zone) {
            // It is repeated; so is that of another, who is not the one that waits.
            return false;
        }
        let is_open = |vote: &&Vote| {
            let pair = (zone, painting.result.digest, vote.painting.result.digest);
            vote.agent != message.sender
                && !self.is_wrong(&vote.agent)
                && !self.is_gone(zone, &vote.painting)
                && painting.may_look_like(&vote.painting)
                && pair.1 != pair.2
                && self.looks.found(&pair).is_none()
        };
        let Some(vote) = before.votes.iter().find(is_open).filter(|_| !self.is_gone(zone, painting)) else {
            return true;
        };
        let results = [painting.result, vote.painting.result];
        self.looks.wait(zone, message.clone());
        actions.push(FarmAction::Effect(FarmEffect::Compare { zone, results }));
        false
    }

    /// Somebody has looked at two tiles; the report that waits for it is taken as if it came now.
    ///
    /// - `outcome`: whether they may be the same picture, or which of them cannot be had.
    pub(super) fn looked_at(
        &mut self,
        now: Time,
        zone: ZoneId,
        results: [ResultRef; 2],
        outcome: Result<bool, ResultRef>,
        actions: &mut Vec<FarmAction>,
    ) {
        let [one, other] = results.map(|result| result.digest);
        match outcome {
            Ok(same) => self.looks.see((zone, one, other), same),
            Err(gone) => self.looks.lose(zone, gone.digest),
        }
        let Some(message) = self.looks.take_waiting(zone) else { return };
        if let FarmContent::Report(report) = &message.content {
            self.take_report(now, &message, report, actions);
        }
    }

    /// Nobody's word is open on a zone any more.
    pub(super) fn forget_likeness(&mut self, row: &ZoneRow) {
        if row.votes.is_empty() {
            self.looks.forget(row.zone);
        }
    }
}
