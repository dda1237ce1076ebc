//! The thread that keeps a device busy: all packets that have come make one batch.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender};

use bottega_hra::{Failed, Reply};
use bottega_render::{BlockOutput, BlockWork, PreparedScene, RenderOutput, RenderWork};

use super::batch::{Batch, Kind, PATHS_MAX, path_count};
use super::tracer::Tracer;
use super::{OTHER_SCENE, PIXELS_MAX, refusal};
use crate::GpuError;

/// What the thread is told.
pub(super) enum Message {
    /// Units to be done, and where the outcomes go.
    Paint(Vec<RenderWork>, Reply<RenderWork>),
    /// Make the device anew if it failed, and say how that went.
    Recover(Sender<Result<(), String>>),
}

type Outcome = Result<RenderOutput, Failed<RenderWork>>;
/// Opens the device.
type Open = Box<dyn Fn() -> Result<Tracer, GpuError> + Send>;

/// See the [module](self).
pub(super) struct Worker {
    scene: Arc<PreparedScene>,
    open: Open,
    /// None after it failed, until it is made anew.
    tracer: Option<Tracer>,
}

/// A unit, and its place among all that have come.
struct Unit {
    place: usize,
    block: BlockWork,
}

impl Worker {
    /// # Errors
    /// The device cannot be had.
    pub(super) fn new(scene: Arc<PreparedScene>, open: Open) -> Result<Self, GpuError> {
        let tracer = Some(open()?);
        Ok(Self { scene, open, tracer })
    }

    /// Works until nobody sends messages any more.
    pub(super) fn run(mut self, inbox: &Receiver<Message>) {
        let mut asked = Vec::new();
        while let Ok(message) = inbox.recv() {
            let mut packets = Vec::new();
            for message in [message].into_iter().chain(inbox.try_iter()) {
                match message {
                    Message::Paint(works, reply) => packets.push((works, reply)),
                    Message::Recover(tell) => asked.push(tell),
                }
            }
            self.paint(packets);
            for tell in asked.drain(..) {
                let _ = tell.send(self.tracer().map(|_| ()).map_err(|error| error.to_string()));
            }
        }
    }

    /// Does the units of some packets, and answers these in their order.
    fn paint(&mut self, packets: Vec<(Vec<RenderWork>, Reply<RenderWork>)>) {
        let (mut works, mut replies) = (Vec::new(), Vec::new());
        for (packet, reply) in packets {
            replies.push((packet.len(), reply));
            works.extend(packet);
        }
        let mut outcomes = self.perform(works).into_iter();
        for (count, reply) in replies {
            reply.send(outcomes.by_ref().take(count).collect());
        }
    }

    /// The outcome of each unit, in their order.
    pub(super) fn perform(&mut self, works: Vec<RenderWork>) -> Vec<Outcome> {
        let mut outcomes: Vec<Option<Outcome>> = Vec::new();
        let mut groups: Vec<(Kind, Vec<Unit>)> = Vec::new();
        for (place, work) in works.into_iter().enumerate() {
            outcomes.push(None);
            let block = match work {
                RenderWork::Block(block) => block,
                // A look at a few pixels is nothing for a device, nor are photons: they are done here.
                RenderWork::Probe(_)
                | RenderWork::Photons(_)
                | RenderWork::Irradiance(_)
                | RenderWork::Agents(_)
                | RenderWork::Sensors(_) => {
                    outcomes[place] = Some(Ok(work.perform()));
                    continue;
                }
                RenderWork::Rays { .. } | RenderWork::Occlusion { .. } => {
                    outcomes[place] = Some(self.follow(work));
                    continue;
                }
            };
            if let Some(reason) = refusal(self.scene.data_id(), &block) {
                outcomes[place] = Some(Err(Failed { work: RenderWork::Block(block), reason }));
                continue;
            }
            let kind = Kind::of(&block);
            let unit = Unit { place, block };
            match groups.iter_mut().find(|(other, _)| *other == kind) {
                Some((_, units)) => units.push(unit),
                None => groups.push((kind, vec![unit])),
            }
        }
        for (kind, units) in groups {
            for units in batches(units) {
                let (places, blocks): (Vec<_>, Vec<_>) = units.into_iter().map(|unit| (unit.place, unit.block)).unzip();
                for (place, outcome) in places.into_iter().zip(self.paint_batch(&kind, blocks)) {
                    outcomes[place] = Some(outcome);
                }
            }
        }
        outcomes.into_iter().flatten().collect()
    }

    /// Answers a batch of rays.
    fn follow(&mut self, work: RenderWork) -> Outcome {
        let answer = match &work {
            RenderWork::Rays { scene, .. } | RenderWork::Occlusion { scene, .. }
                if scene.data_id() != self.scene.data_id() =>
            {
                return Err(Failed { work, reason: OTHER_SCENE.to_owned() });
            }
            RenderWork::Rays { rays, .. } => {
                self.tracer().and_then(|tracer| tracer.intersect(rays)).map(RenderOutput::Hits)
            }
            RenderWork::Occlusion { rays, .. } => {
                self.tracer().and_then(|tracer| tracer.occluded(rays)).map(RenderOutput::Occlusion)
            }
            RenderWork::Block(_)
            | RenderWork::Probe(_)
            | RenderWork::Photons(_)
            | RenderWork::Irradiance(_)
            | RenderWork::Agents(_)
            | RenderWork::Sensors(_) => {
                return Ok(work.perform());
            }
        };
        answer.map_err(|error| {
            self.tracer = None;
            Failed { work, reason: error.to_string() }
        })
    }

    fn paint_batch(&mut self, kind: &Kind, blocks: Vec<BlockWork>) -> Vec<Outcome> {
        match self.try_batch(kind, &blocks) {
            Ok(added) => added(blocks).into_iter().map(|output| Ok(RenderOutput::Block(output))).collect(),
            Err(error) => {
                self.tracer = None;
                let reason = error.to_string();
                let give_back = |block| Err(Failed { work: RenderWork::Block(block), reason: reason.clone() });
                blocks.into_iter().map(give_back).collect()
            }
        }
    }

    /// Paints blocks of one kind; what comes back adds what was painted to them.
    fn try_batch(
        &mut self,
        kind: &Kind,
        blocks: &[BlockWork],
    ) -> Result<impl FnOnce(Vec<BlockWork>) -> Vec<BlockOutput> + use<>, GpuError> {
        let batch = Batch::new(&self.scene, kind, &blocks.iter().collect::<Vec<_>>())?;
        let mut sums = Vec::new();
        if batch.path_count == 0 {
            sums.resize(batch.sums(), 0);
        } else {
            self.tracer()?.run(&batch, |words| sums.extend_from_slice(words))?;
        }
        Ok(move |blocks| batch.add(&sums, blocks))
    }

    /// The device, made anew if the last one failed.
    fn tracer(&mut self) -> Result<&mut Tracer, GpuError> {
        let tracer = match self.tracer.take() {
            Some(tracer) => tracer,
            None => (self.open)()?,
        };
        Ok(self.tracer.insert(tracer))
    }

    #[cfg(test)]
    pub(super) fn device(&self) -> Option<&Tracer> {
        self.tracer.as_ref()
    }
}

/// Cuts units into as many as may be painted at once.
fn batches(units: Vec<Unit>) -> Vec<Vec<Unit>> {
    let mut all: Vec<Vec<Unit>> = Vec::new();
    let (mut paths, mut pixels) = (u64::MAX, 0);
    for unit in units {
        let (more_paths, more_pixels) = (path_count(&unit.block), unit.block.tile.rect().area());
        let is_full = paths.saturating_add(more_paths) >= PATHS_MAX || pixels + more_pixels > PIXELS_MAX;
        if is_full {
            all.push(Vec::new());
            (paths, pixels) = (0, 0);
        }
        paths += more_paths;
        pixels += more_pixels;
        if let Some(last) = all.last_mut() {
            last.push(unit);
        }
    }
    all
}
