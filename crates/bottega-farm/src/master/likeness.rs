//! Comparison by look: for engines that are not bit-identical between agents, the pixels of two paintings are compared
//! before their votes are.

use super::*;
use crate::{ResultRef, Vote};

impl Master {
    /// True if two paintings of a zone agree: bit for bit, or by their look.
    pub(super) fn is_same(&self, zone: ZoneId, one: &Painting, other: &Painting) -> bool {
        if !self.config.compares_by_look {
            return one.is_same(other);
        }
        let pair = (zone, one.result.digest, other.result.digest);
        one.may_look_like(other) && (pair.1 == pair.2 || self.looks.found(&pair) == Some(true))
    }

    /// True if the tile of a vote could not be fetched, so the vote does not count.
    pub(super) fn is_gone(&self, zone: ZoneId, painting: &Painting) -> bool {
        self.looks.is_gone(zone, painting.result.digest)
    }

    /// The same for a reported tile, whose mark is removed: the next report of it may be of a tile that exists.
    pub(super) fn take_gone(&mut self, zone: ZoneId, painting: &Painting) -> bool {
        self.looks.take_gone(zone, painting.result.digest)
    }

    /// True if the votes of others can be compared with this report now. If not, a comparison of pixels is pending, and
    /// the report is processed after it.
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
            // The agent repeats its report later; so does another agent whose report is not the waiting one
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

    /// Records a comparison of two tiles and processes the report that waited for it.
    ///
    /// - `outcome`: true if they may be the same picture; or the tile that could not be fetched.
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

    /// Drops the comparisons of a zone without votes.
    pub(super) fn forget_likeness(&mut self, row: &ZoneRow) {
        if row.votes.is_empty() {
            self.looks.forget(row.zone);
        }
    }
}
