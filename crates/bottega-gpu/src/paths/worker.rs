//! The thread that keeps a device busy: two packets are there at a time, one under way and one that waits or is read.

use std::mem;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender};
use std::time::{Duration, Instant};

use bottega_hra::{DataId, Failed, Reply, Work as _};
use bottega_image::{AovSet, Layout, Rect, Tile};
use bottega_render::{BlockWork, PathSettings, RenderOutput, RenderWork, View};

use super::batch::{BatchKind, BlockBatch, PATHS_MAX, path_count};
use super::limits::{PIXELS_MAX, UNKNOWN_SCENE, refusal};
use super::shelf::{EncodedScene, SceneShelf};
use super::tracer::{Flight, Tracer};
use crate::compiling::Compiling;
use crate::error::GpuError;

/// What the thread is told.
pub(super) enum Message {
    /// Units to be done, and where the outcomes go.
    Paint(Vec<RenderWork>, Reply<RenderWork>),
    /// Make the device anew if it failed, and say how that went.
    Recover(Sender<Result<(), String>>),
    /// Compile what a scene asks of the kernels, and say how that went where somebody waits for it.
    Compile(EncodedScene, Option<Sender<Result<(), GpuError>>>),
    /// Throw a scene out.
    Evict(DataId),
    /// Nobody has work any more.
    End,
}

type BlockResult = Result<RenderOutput, Failed<RenderWork>>;
/// Opens the device.
type Open = Box<dyn Fn() -> Result<Tracer, GpuError> + Send>;

/// See the [module](self).
pub(super) struct PathWorker {
    shelf: Arc<SceneShelf>,
    /// Of the device.
    name: String,
    open: Open,
    /// None after it failed, until it is made anew.
    tracer: Option<Tracer>,
    /// Devices so far: what was begun on an earlier one is lost.
    device_number: u64,
    /// When the device was last seen to have ended something.
    last_end: Instant,
}

/// A unit, and its place among all that have come.
struct Unit {
    place: usize,
    block: BlockWork,
}

/// Units of one packet: what is known of their outcomes, and what the device has not ended.
struct StartedBatch {
    outcomes: Vec<Option<BlockResult>>,
    /// Whether the device has not the memory for the scene: then all of it goes back.
    out_of_memory: bool,
    flight: Option<BatchFlight>,
    /// Of the device for this packet, so far.
    busy: Duration,
}

/// A batch on the device.
struct BatchFlight {
    units: Vec<Unit>,
    batch: BlockBatch,
    flight: Flight,
    device_number: u64,
    begun: Instant,
}

impl PathWorker {
    /// # Errors
    /// The device cannot be had.
    pub(super) fn new(shelf: Arc<SceneShelf>, name: String, open: Open) -> Result<Self, GpuError> {
        let tracer = Some(open()?);
        Ok(Self { shelf, name, open, tracer, device_number: 0, last_end: Instant::now() })
    }

    /// Works until nobody sends messages any more. Each packet is a batch, so that the allocator sees what packets of its sizes
    /// take; and the next one is on the device before the last one is read.
    pub(super) fn run(mut self, inbox: &Receiver<Message>) {
        let mut before: Option<(StartedBatch, Reply<RenderWork>)> = None;
        loop {
            let message = if before.is_some() { inbox.try_recv().ok() } else { inbox.recv().ok() };
            let begun = match message {
                // Given up while the device was behind: dropping the reply says that nothing comes.
                Some(Message::Paint(_, reply)) if !reply.is_awaited() => None,
                Some(Message::Paint(works, reply)) => Some((self.begin(works), reply)),
                Some(Message::Recover(tell)) => {
                    let _ = tell.send(self.tracer().map(|_| ()).map_err(|error| error.to_string()));
                    None
                }
                Some(Message::Compile(encoded, tell)) => {
                    let compiled = self.compile(&encoded);
                    self.shelf.end_compiling();
                    match (tell, compiled) {
                        // Who has gone meanwhile need not know.
                        (Some(tell), compiled) => _ = tell.send(compiled),
                        (None, Err(error)) => tracing::warn!("{} cannot compile its kernels: {error}", self.name),
                        (None, Ok(())) => {}
                    }
                    None
                }
                Some(Message::Evict(data)) => {
                    if let Some(tracer) = &mut self.tracer {
                        tracer.evict(data);
                    }
                    self.note_bytes();
                    None
                }
                Some(Message::End) => {
                    if let Some((begun, reply)) = before {
                        self.answer(begun, reply);
                    }
                    return;
                }
                None if before.is_none() => return,
                None => None,
            };
            if let Some((begun, reply)) = mem::replace(&mut before, begun) {
                self.answer(begun, reply);
            }
        }
    }

    fn answer(&mut self, begun: StartedBatch, reply: Reply<RenderWork>) {
        let is_out_of_memory = begun.out_of_memory;
        let (outcomes, busy) = self.end(begun);
        if is_out_of_memory {
            let given_back = outcomes.into_iter().filter_map(|outcome| outcome.err().map(|failed| failed.work));
            reply.out_of_memory(given_back.collect());
        } else {
            reply.send_timed(outcomes, busy);
        }
    }

    /// Compiles what a scene asks of the kernels, unless it is, and paints a pixel with them: some drivers compile when a kernel is
    /// first used. No time limit holds meanwhile.
    fn compile(&mut self, encoded: &EncodedScene) -> Result<(), GpuError> {
        let (variant, id) = (encoded.flat.variant(), encoded.scene.data_id());
        if self.tracer()?.has_kernels(variant) {
            return Ok(());
        }
        let compiling = Compiling::begin(&self.name);
        let tried = self.tracer()?.compile(variant).and_then(|()| self.try_kernels(encoded));
        drop(compiling);
        self.note_bytes();
        match tried {
            // It has no room for the scene, or that is none to try kernels on. They are compiled when they are used, then.
            Ok(()) | Err(GpuError::OutOfMemory { .. } | GpuError::Invalid(_)) => Ok(()),
            Err(error) => {
                tracing::debug!(?id, %error, "kernels do not work");
                self.lose_device();
                Err(error)
            }
        }
    }

    /// Paints one pixel of a scene.
    fn try_kernels(&mut self, encoded: &EncodedScene) -> Result<(), GpuError> {
        let EncodedScene { flat, scene } = encoded;
        let settings = PathSettings { guiding: false, ..PathSettings::default() };
        let block = BlockWork {
            scene: Arc::clone(scene),
            prepass: Arc::default(),
            view: View { camera: 0, width: 1, height: 1 },
            settings: Arc::new(settings),
            tile: Tile::new(Rect::of_size(1, 1), Layout::new(AovSet::NONE)),
            samples: 0..1,
        };
        let kind = BatchKind::of(&block);
        let batch = BlockBatch::new(scene, &kind, &[&block])?;
        let tracer = self.tracer()?;
        tracer.admit(kind.data, flat)?;
        tracer.patiently(|tracer| {
            let flight = tracer.start(kind.data, &batch)?;
            tracer.finish(flight, |_| {})
        })
    }

    /// Tells the shelf what is on the device.
    fn note_bytes(&mut self) {
        let (sent, there) = self.tracer.as_mut().map_or((0, 0), Tracer::scene_bytes);
        self.shelf.note(sent, there);
    }

    /// Has the scene of a packet on the device.
    fn admit(&mut self, works: &[RenderWork]) -> Result<(), GpuError> {
        let Some(id) = works.iter().find_map(RenderWork::data) else { return Ok(()) };
        // What is not on the shelf is refused unit by unit.
        let Some(flat) = self.shelf.get(id) else { return Ok(()) };
        let admitted = self.tracer().and_then(|tracer| tracer.admit(id, &flat));
        self.note_bytes();
        admitted
    }

    /// The outcome of each unit, in their order.
    #[cfg(test)]
    pub(super) fn perform(&mut self, works: Vec<RenderWork>) -> Vec<BlockResult> {
        let begun = self.begin(works);
        self.end(begun).0
    }

    /// Puts the units of a packet on the device. All but the last batch of them, if there is more than one, is waited for.
    fn begin(&mut self, works: Vec<RenderWork>) -> StartedBatch {
        let start = Instant::now();
        let mut begun = StartedBatch { outcomes: Vec::new(), out_of_memory: false, flight: None, busy: Duration::ZERO };
        if let Err(error) = self.admit(&works) {
            begun.out_of_memory = matches!(error, GpuError::OutOfMemory { .. });
            if !begun.out_of_memory {
                self.lose_device();
            }
            let failed = |work| Some(Err(Failed { work, reason: error.to_string() }));
            begun.outcomes = works.into_iter().map(failed).collect();
            return begun;
        }
        let mut groups: Vec<(BatchKind, Vec<Unit>)> = Vec::new();
        for (place, work) in works.into_iter().enumerate() {
            begun.outcomes.push(None);
            let block = match work {
                RenderWork::Block(block) => block,
                // A look at a few pixels is nothing for a device, nor are photons: they are done here.
                RenderWork::Probe(_)
                | RenderWork::Wave(_)
                | RenderWork::Photons(_)
                | RenderWork::Irradiance(_)
                | RenderWork::Agents(_)
                | RenderWork::Sensors(_) => {
                    begun.outcomes[place] = Some(Ok(work.perform()));
                    continue;
                }
                RenderWork::Rays { .. } | RenderWork::Occlusion { .. } => {
                    begun.outcomes[place] = Some(self.follow(work));
                    continue;
                }
            };
            let is_unknown = self.shelf.get(block.scene.data_id()).is_none();
            if let Some(reason) = is_unknown.then(|| UNKNOWN_SCENE.to_owned()).or_else(|| refusal(&block)) {
                begun.outcomes[place] = Some(Err(Failed { work: RenderWork::Block(block), reason }));
                continue;
            }
            let kind = BatchKind::of(&block);
            let unit = Unit { place, block };
            match groups.iter_mut().find(|(other, _)| *other == kind) {
                Some((_, units)) => units.push(unit),
                None => groups.push((kind, vec![unit])),
            }
        }
        if groups.is_empty() {
            begun.busy = start.elapsed();
        }
        for (kind, units) in groups {
            for units in batches(units) {
                self.land(&mut begun);
                match self.start(&kind, &units) {
                    Ok((batch, flight)) => {
                        let device_number = self.device_number;
                        begun.flight = Some(BatchFlight { units, batch, flight, device_number, begun: Instant::now() });
                    }
                    Err(error) => {
                        self.lose_device();
                        give_back(units, &error, &mut begun.outcomes);
                    }
                }
            }
        }
        begun
    }

    /// Waits for the rest; also tells how long the device was at work on it.
    fn end(&mut self, mut begun: StartedBatch) -> (Vec<BlockResult>, Duration) {
        self.land(&mut begun);
        (begun.outcomes.into_iter().flatten().collect(), begun.busy)
    }

    /// Waits for the batch that is on the device.
    fn land(&mut self, begun: &mut StartedBatch) {
        let Some(BatchFlight { units, batch, flight, device_number, begun: since }) = begun.flight.take() else {
            return;
        };
        let mut sums = Vec::new();
        let read = match &mut self.tracer {
            Some(tracer) if device_number == self.device_number => {
                tracer.finish(flight, |words| sums.extend_from_slice(words))
            }
            _ => Err(GpuError::Lost("it was lost with what was on it before".to_owned())),
        };
        let now = Instant::now();
        begun.busy += now.duration_since(since.max(self.last_end));
        self.last_end = now;
        if let Err(error) = read {
            self.lose_device();
            return give_back(units, &error, &mut begun.outcomes);
        }
        let (places, blocks): (Vec<_>, Vec<_>) = units.into_iter().map(|unit| (unit.place, unit.block)).unzip();
        for (place, output) in places.into_iter().zip(batch.add(&sums, blocks)) {
            begun.outcomes[place] = Some(Ok(RenderOutput::Block(output)));
        }
    }

    /// Begins a batch of units of one kind.
    fn start(&mut self, kind: &BatchKind, units: &[Unit]) -> Result<(BlockBatch, Flight), GpuError> {
        let Some(first) = units.first() else { return Err(GpuError::Invalid("a batch without units".to_owned())) };
        let scene = Arc::clone(&first.block.scene);
        let batch = BlockBatch::new(&scene, kind, &units.iter().map(|unit| &unit.block).collect::<Vec<_>>())?;
        let flight = self.tracer()?.start(kind.data, &batch)?;
        Ok((batch, flight))
    }

    fn lose_device(&mut self) {
        self.tracer = None;
        self.device_number += 1;
        self.note_bytes();
    }

    /// Answers a batch of rays.
    #[expect(clippy::result_large_err, reason = "work that failed is given back whole, once a batch")]
    fn follow(&mut self, work: RenderWork) -> BlockResult {
        let answer = match &work {
            RenderWork::Rays { scene, .. } | RenderWork::Occlusion { scene, .. }
                if self.shelf.get(scene.data_id()).is_none() =>
            {
                return Err(Failed { work, reason: UNKNOWN_SCENE.to_owned() });
            }
            RenderWork::Rays { scene, rays } => {
                self.tracer().and_then(|tracer| tracer.intersect(scene.data_id(), rays)).map(RenderOutput::Hits)
            }
            RenderWork::Occlusion { scene, rays } => {
                self.tracer().and_then(|tracer| tracer.occluded(scene.data_id(), rays)).map(RenderOutput::Occlusion)
            }
            RenderWork::Block(_)
            | RenderWork::Wave(_)
            | RenderWork::Probe(_)
            | RenderWork::Photons(_)
            | RenderWork::Irradiance(_)
            | RenderWork::Agents(_)
            | RenderWork::Sensors(_) => {
                return Ok(work.perform());
            }
        };
        answer.map_err(|error| {
            self.lose_device();
            Failed { work, reason: error.to_string() }
        })
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

/// What was not painted goes back to whoever asked.
fn give_back(units: Vec<Unit>, error: &GpuError, outcomes: &mut [Option<BlockResult>]) {
    for Unit { place, block } in units {
        outcomes[place] = Some(Err(Failed { work: RenderWork::Block(block), reason: error.to_string() }));
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
