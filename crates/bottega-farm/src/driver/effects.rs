//! The effects that agents request, and how each is carried out.

use std::sync::Arc;

use bottega_image::Tile;

use super::shared::{End, FarmMailbox, Shared};
use crate::{FarmCompletion, FarmEffect, Mask, ResultRef, ZoneId};

impl Shared {
    /// Carries out an effect of an agent; results go to its mailbox.
    pub(super) fn perform(self: &Arc<Self>, effect: FarmEffect, mailbox: &FarmMailbox) {
        match effect {
            FarmEffect::Survey { width, height, .. } => self.survey(width, height, mailbox),
            FarmEffect::Analyzed { map, partition, outlook } => {
                self.learner().begin(outlook);
                self.observer.analyzed(&map, &partition);
            }
            FarmEffect::Benchmark => {
                let power = self.knowledge.benchmark;
                // Other programs take their share of the processors
                let lanes = self.processors as f64 / self.agents as f64 / self.load;
                mailbox.complete(FarmCompletion::Benchmarked { power, lanes });
            }
            FarmEffect::Fetch(work) => self.fetch(work, mailbox),
            FarmEffect::Paint(order) => self.paint(order, mailbox),
            FarmEffect::Drop { zone, fence } => self.drop_order(zone, fence),
            FarmEffect::Look(orders) => mailbox.complete(FarmCompletion::Looked(self.look(&orders))),
            FarmEffect::Dismissed { reason } => self.dismissed(reason),
            FarmEffect::LeftOut { agent, reason } => self.observer.left_out(&agent, &reason),
            FarmEffect::TooFew { present, needed } => self.observer.too_few(present, needed),
            FarmEffect::Stalled { waited, zones, free } => self.observer.stalled(waited, zones, free),
            FarmEffect::BeginFilm(work) => {
                self.learner().see_work(&work);
                let kept = self.composer().begin(&work);
                self.tell_kept(kept);
            }
            FarmEffect::ZoneChanged(row) => {
                self.learner().see_zone(&row);
                let (kept, progress) = self.composer().zone_changed(&row, mailbox.now());
                self.tell_kept(kept);
                self.observer.zone_changed(&row);
                self.observer.progress(&progress);
            }
            FarmEffect::AgentChanged(row) => {
                self.learner().see_agent(&row);
                self.composer().agent_changed(&row);
                self.observer.agent_changed(&row);
            }
            FarmEffect::RoundClosed(round) => self.observer.round_closed(&round),
            FarmEffect::Stolen(theft) => self.observer.stolen(&theft),
            FarmEffect::Compare { zone, results } => self.compare(zone, results, mailbox),
            FarmEffect::Compose { zone, result, mask } => {
                let shared = Arc::clone(self);
                let to = mailbox.clone();
                self.with_tile(zone, result, move |found| shared.compose(zone, &result, &mask, found, &to));
            }
            FarmEffect::Finish { failed } => self.end(End::Finished(failed)),
            FarmEffect::Abandon { reason } => self.end(End::Abandoned(reason)),
        }
    }

    /// Compares two paintings of a zone, once both tiles are here.
    fn compare(self: &Arc<Self>, zone: ZoneId, results: [ResultRef; 2], mailbox: &FarmMailbox) {
        self.begin_outstanding();
        let (shared, to) = (Arc::clone(self), mailbox.clone());
        let look = move || {
            let outcome = results.each_ref().map(|result| shared.tile_of(zone, result));
            let outcome = match outcome {
                [Ok(one), Ok(other)] => Ok(one.looks_like(&other)),
                [Err(reason), _] | [_, Err(reason)] if shared.stop.is_requested() => {
                    tracing::debug!(reason, "stopped before two paintings were compared");
                    return shared.end_outstanding();
                }
                [one, _] => Err(results[usize::from(one.is_ok())]),
            };
            to.complete(FarmCompletion::Compared { zone, results, outcome });
            shared.end_outstanding();
        };
        if let Err(error) = self.fetchers.begin(look) {
            self.end_outstanding();
            self.end(End::Abandoned(format!("cannot start a thread: {error}")));
        }
    }

    /// Returns the tile of a result, from here or from another machine.
    fn tile_of(&self, zone: ZoneId, result: &ResultRef) -> Result<Tile, String> {
        let here = self.composer().tile(zone, result);
        let link = self.link.as_ref().ok_or("its pixels are not here");
        here.map_or_else(|| link?.get(result, &self.stop), Ok)
    }

    fn compose(&self, zone: ZoneId, result: &ResultRef, mask: &Mask, found: Result<(), String>, mailbox: &FarmMailbox) {
        let before = mailbox.now();
        let outcome = found.and_then(|()| self.composer().compose(zone, result, mask));
        self.composer().composition_took(mailbox.now() - before);
        mailbox.complete(FarmCompletion::Composed { zone, outcome });
    }
}
