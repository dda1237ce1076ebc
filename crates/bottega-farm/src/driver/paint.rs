//! Zones in progress in the engine: in passes, with an estimate of their errors.

use std::{sync::Arc, time::Duration};

use bottega_agents::{BlobId, Revision};
use bottega_engines::{CancelSwitch, EngineError, Painted, TaskProgress, ZoneTask};
use bottega_image::Tile;

use super::shared::{FarmMailbox, Shared};
use crate::{ErrorUse, FarmCompletion, PaintOrder, PaintResult, ResultRef, ZoneId, cells::Cells, digest};

/// The predicted time, on all processors, above which a zone is painted in passes. Each pass is stored, so an interruption
/// loses at most one.
const PASS: Duration = crate::STEP_MAX;

/// A zone in progress in the engine.
struct ZonePainting {
    order: PaintOrder,
    /// Samples per pixel in one pass.
    pass: u32,
    busy: Duration,
    /// True if all of `busy` is a valid measurement.
    is_measured: bool,
    shared: Arc<Shared>,
    mailbox: FarmMailbox,
    cancel: CancelSwitch,
    progress: TaskProgress,
    estimate: Estimate,
}

/// The estimation of a zone's error.
enum Estimate {
    /// No estimate of the error.
    None,
    /// An estimate for the whole zone: holds the samples of about the first half, once they are there.
    Zone(Option<Tile>),
    /// An estimate for each cell, which stops on its own.
    Cells(Cells),
}

impl Estimate {
    /// Returns the estimation that an order needs.
    ///
    /// - `by_cells`: `true` if the engine can render parts of a zone.
    fn of(order: &PaintOrder, by_cells: bool) -> Self {
        match order.error_use {
            ErrorUse::None => Self::None,
            ErrorUse::Stops(wanted) if by_cells => Self::Cells(Cells::new(order.rect, wanted, order.samples_max)),
            ErrorUse::Stops(_) | ErrorUse::Weighs => Self::Zone(None),
        }
    }

    /// Returns the error of a zone whose samples are `tile`, and the share of it that needs more samples.
    fn outcome(&mut self, order: &PaintOrder, tile: &Tile) -> (Option<f64>, f64) {
        match self {
            Self::None => (None, 1.0),
            Self::Cells(cells) => (cells.error(), cells.unfinished(order.samples.end)),
            Self::Zone(half) => {
                let error = half.take().and_then(|half| tile.relative_error(&half));
                let is_met =
                    matches!((order.error_use, error), (ErrorUse::Stops(wanted), Some(error)) if error <= wanted);
                (error, f64::from(u8::from(!is_met)))
            }
        }
    }
}

impl Shared {
    /// Paints an order, after fetching its tile if another machine has painted the samples before.
    pub(super) fn paint(self: &Arc<Self>, order: PaintOrder, mailbox: &FarmMailbox) {
        let Some(from) = order.from else { return self.paint_passes(order, mailbox) };
        let (shared, to) = (Arc::clone(self), mailbox.clone());
        // A tile that cannot be fetched is rendered again, bit-identically.
        self.with_tile(order.zone, from, move |_| shared.paint_passes(order, &to));
    }

    fn paint_passes(self: &Arc<Self>, order: PaintOrder, mailbox: &FarmMailbox) {
        let tile = order.from.and_then(|from| {
            let (id, tile) = self.composer().take(order.zone)?;
            // If the tile is not the expected one, render the zone from the start, bit-identically.
            (id == from.digest && tile.rect() == order.rect).then_some(tile)
        });
        let start = if tile.is_some() { order.samples.start } else { 0 };
        let count = order.samples.end - start;
        let wall = order.time_estimated.unwrap_or_default().as_secs_f64() / self.processors as f64;
        let passes = (wall / PASS.as_secs_f64()).ceil().clamp(1.0, f64::from(count.max(1))) as u32;
        let engine = self.engine.describe();
        // An engine that cannot resume starts again with each pass.
        let passes = if engine.resumes_samples { passes } else { 1 };
        self.begin_outstanding();
        let (cancel, progress) = (CancelSwitch::default(), TaskProgress::default());
        self.state().orders.insert((order.zone, order.fence), (cancel.clone(), progress.clone()));
        if self.stop.is_requested() {
            // The stop may have cancelled all orders before this one was added.
            cancel.cancel();
        }
        let painting = ZonePainting {
            cancel,
            progress,
            // If an engine is not profiled, its windows are expensive: do not render parts.
            estimate: Estimate::of(&order, engine.resumes_samples && engine.is_profiled),
            pass: count.div_ceil(passes).max(1),
            busy: Duration::ZERO,
            is_measured: true,
            shared: Arc::clone(self),
            mailbox: mailbox.clone(),
            order,
        };
        painting.go_on(start, tile);
    }

    /// Cancels the painting of all orders.
    pub(super) fn cancel_orders(&self) {
        self.state().orders.values().for_each(|(cancel, _)| cancel.cancel());
        self.changed.notify_all();
    }

    /// Cancels the painting of an order.
    pub(super) fn drop_order(&self, zone: ZoneId, fence: Revision) {
        if let Some((cancel, _)) = self.state().orders.get(&(zone, fence)) {
            cancel.cancel();
        }
    }

    /// Returns the progress of those of the orders that are running.
    pub(super) fn look(&self, orders: &[(ZoneId, Revision)]) -> Vec<(ZoneId, Revision, u64)> {
        let state = self.state();
        let found = orders.iter().filter_map(|&(zone, fence)| {
            let (_, progress) = state.orders.get(&(zone, fence))?;
            Some((zone, fence, progress.get()))
        });
        found.collect()
    }
}

impl ZonePainting {
    /// Starts the next pass.
    fn go_on(mut self, start: u32, mut tile: Option<Tile>) {
        let shared = Arc::clone(&self.shared);
        if shared.stop.is_requested() {
            return self.interrupted(tile);
        }
        let (mut end, mut parts) = (start.saturating_add(self.pass).min(self.order.samples.end), None);
        match &mut self.estimate {
            Estimate::None | Estimate::Zone(Some(_)) => {}
            Estimate::Zone(half) => {
                // Split at the middle of all samples: the second half is compared with the first, so an agent without the
                // earlier samples gets the same estimate.
                let middle = (self.order.samples.end / 2).max(self.order.samples.start);
                if start >= middle {
                    half.clone_from(&tile);
                } else {
                    end = end.min(middle);
                }
            }
            Estimate::Cells(cells) => match (cells.next(start, tile.as_ref(), self.order.samples.end), tile) {
                (Some(next), before) => {
                    (end, parts, tile) = (next.end, next.parts, before);
                }
                // No cell is unfinished: this happens if another agent has finished the zone.
                (None, Some(before)) => return self.complete(before),
                (None, None) => return self.done(Err("a zone without cells".to_owned())),
            },
        }
        let PaintOrder { rect, tunables, preference, .. } = self.order;
        let (cancel, progress) = (self.cancel.clone(), self.progress.clone());
        let task = ZoneTask { rect, samples: start..end, tunables, preference, tile, parts, cancel, progress };
        shared.engine.start(task, Box::new(move |painted| self.painted(end, painted)));
    }

    fn painted(mut self, end: u32, painted: Result<Painted, EngineError>) {
        match painted {
            Err(error) => {
                let reason = error.to_string();
                self.done(Err(reason));
            }
            Ok(Painted { tile, busy, complete: false, .. }) => {
                self.busy += busy;
                if self.shared.stop.is_requested() {
                    self.interrupted(Some(tile));
                } else if self.cancel.is_cancelled() {
                    self.end();
                } else {
                    self.done(Err("the engine was cancelled".to_owned()));
                }
            }
            Ok(Painted { mut tile, busy, is_warm, complete: true, .. }) => {
                self.busy += busy;
                self.is_measured &= is_warm;
                if tile.rect() != self.order.rect {
                    return self.done(Err("the engine painted another rectangle".to_owned()));
                }
                // The engine may only notice now that it is complete.
                self.progress.add(1);
                let mut can_be_kept = true;
                if let Estimate::Cells(cells) = &mut self.estimate {
                    cells.painted(end, &mut tile);
                    if cells.unfinished(end) == 0.0 {
                        return self.complete(tile);
                    }
                    // Within an octave the tile does not tell which cells have stopped.
                    can_be_kept = end.is_power_of_two();
                }
                if end < self.order.samples.end {
                    if can_be_kept {
                        self.pass_done(end, &tile);
                    }
                    return self.go_on(end, Some(tile));
                }
                self.complete(tile);
            }
        }
    }

    /// Reports the result: all ordered samples are there, or are not needed.
    fn complete(mut self, tile: Tile) {
        let digest = digest(&tile);
        let result = ResultRef { fence: self.order.fence, samples: self.order.samples.end, digest };
        let (error, unfinished) = self.estimate.outcome(&self.order, &tile);
        if let Some(Err(reason)) = self.shared.link.as_ref().map(|link| link.put(digest, &tile, &self.shared.stop)) {
            return self.done(Err(reason));
        }
        self.shared.composer().put(self.order.zone, digest, tile);
        let Self { busy, is_measured, .. } = self;
        self.done(Ok(PaintResult { result, busy, is_measured, error, unfinished }));
    }

    /// Stores a pass.
    fn pass_done(&self, samples: u32, tile: &Tile) {
        let PaintOrder { zone, fence, .. } = self.order;
        let done = self.shared.composer().pass_done(zone, fence, samples, tile, self.mailbox.now());
        if let Some((kept, progress)) = done {
            self.shared.tell_kept(kept);
            self.shared.observer.progress(&progress);
        }
    }

    /// Adds the tile to the picture of a stopped job, without a report.
    fn interrupted(self, tile: Option<Tile>) {
        if let Some(tile) = tile {
            // Pixels may have different sample counts, so it cannot be resumed: it gets no digest.
            self.shared.composer().put(self.order.zone, BlobId([0; 32]), tile);
        }
        self.end();
    }

    fn done(self, outcome: Result<PaintResult, String>) {
        let PaintOrder { zone, fence, .. } = self.order;
        self.mailbox.complete(FarmCompletion::Painted { zone, fence, outcome });
        self.end();
    }

    fn end(self) {
        self.shared.composer().painting_took(self.busy);
        self.shared.state().orders.remove(&(self.order.zone, self.order.fence));
        self.shared.end_outstanding();
    }
}
