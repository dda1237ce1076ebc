//! The worker thread that keeps a device busy: it has two packets on the device, one under way and one that waits or is read.

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
use crate::compiling::CompilingGuard;
use crate::error::GpuError;

/// A message to the worker thread.
pub(super) enum Message {
    /// Render these units, and reply with the outcomes.
    Paint(Vec<RenderWork>, Reply<RenderWork>),
    /// Open the device again if it failed, and reply with the result.
    Recover(Sender<Result<(), String>>),
    /// Compile the kernels of a scene, and send the result if a sender is given.
    Compile(EncodedScene, Option<Sender<Result<(), GpuError>>>),
    /// Evict a scene.
    Evict(DataId),
    /// End the thread.
    End,
}

type BlockResult = Result<RenderOutput, Failed<RenderWork>>;
/// A function that opens the device.
type OpenDevice = Box<dyn Fn() -> Result<Tracer, GpuError> + Send>;

/// The state of the worker thread; see the [module](self).
pub(super) struct PathWorker {
    shelf: Arc<SceneShelf>,
    /// The device's name.
    name: String,
    open: OpenDevice,
    /// The open device. `None`: the last one failed, and it is opened again on the next use.
    tracer: Option<Tracer>,
    /// The number of times the device was opened; batches started on an earlier one are lost.
    device_number: u64,
    /// The last time a batch was seen to finish.
    last_end: Instant,
}

/// A unit of work, and its index in the packet.
struct Unit {
    place: usize,
    block: BlockWork,
}

/// The units of a packet: the outcomes known so far, and the batch still on the device.
struct StartedBatch {
    outcomes: Vec<Option<BlockResult>>,
    /// `true`: the device has no memory for the scene, and the whole packet is returned.
    out_of_memory: bool,
    flight: Option<BatchFlight>,
    /// The time that the device has spent on this packet so far.
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
    /// Opens the device.
    ///
    /// # Errors
    /// The device cannot be opened.
    pub(super) fn new(shelf: Arc<SceneShelf>, name: String, open: OpenDevice) -> Result<Self, GpuError> {
        let tracer = Some(open()?);
        Ok(Self { shelf, name, open, tracer, device_number: 0, last_end: Instant::now() })
    }

    /// Runs until all senders are gone. Each packet is a batch, so that the allocator measures packets of its own sizes; the next
    /// packet is on the device before the last one is read.
    pub(super) fn run(mut self, inbox: &Receiver<Message>) {
        let mut before: Option<(StartedBatch, Reply<RenderWork>)> = None;
        loop {
            let message = if before.is_some() { inbox.try_recv().ok() } else { inbox.recv().ok() };
            let begun = match message {
                // Canceled while it waited: dropping the reply reports that nothing comes.
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
                        // The requester may have gone meanwhile.
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

    /// Compiles the kernels of a scene, unless that is done, and renders a pixel with them: some drivers compile a kernel on its
    /// first use. Timeouts are off meanwhile.
    fn compile(&mut self, encoded: &EncodedScene) -> Result<(), GpuError> {
        let (variant, id) = (encoded.flat.variant(), encoded.scene.data_id());
        if self.tracer()?.has_kernels(variant) {
            return Ok(());
        }
        let compiling = CompilingGuard::begin(&self.name);
        let tried = self.tracer()?.compile(variant).and_then(|()| self.try_kernels(encoded));
        drop(compiling);
        self.note_bytes();
        match tried {
            // The scene does not fit, or kernels cannot be tried on it; they are compiled on first use.
            Ok(()) | Err(GpuError::OutOfMemory { .. } | GpuError::Invalid(_)) => Ok(()),
            Err(error) => {
                tracing::debug!(?id, %error, "kernels do not work");
                self.lose_device();
                Err(error)
            }
        }
    }

    /// Renders one pixel of a scene.
    fn try_kernels(&mut self, encoded: &EncodedScene) -> Result<(), GpuError> {
        let EncodedScene { flat, scene } = encoded;
        let settings = PathSettings { guiding: false, ..PathSettings::default() };
        let view = View::of_scene(scene.scene(), 0, 1, 1).map_err(|error| GpuError::Invalid(error.to_string()))?;
        let block = BlockWork {
            scene: Arc::clone(scene),
            prepass: Arc::default(),
            view,
            settings: Arc::new(settings),
            tile: Tile::new(Rect::of_size(1, 1), Layout::new(AovSet::NONE)),
            samples: 0..1,
            light_groups: None,
            catchers: None,
        };
        let kind = BatchKind::of(&block);
        let batch = BlockBatch::new(&kind, &[&block])?;
        let tracer = self.tracer()?;
        tracer.admit(kind.data, flat)?;
        tracer.patiently(|tracer| {
            let flight = tracer.start(kind.data, &batch)?;
            tracer.finish(flight, |_| {})
        })
    }

    /// Updates the shelf's counts of bytes.
    fn note_bytes(&mut self) {
        let (sent, there) = self.tracer.as_mut().map_or((0, 0), Tracer::scene_bytes);
        self.shelf.note(sent, there);
    }

    /// Uploads the scene of a packet, unless it is on the device.
    fn admit(&mut self, works: &[RenderWork]) -> Result<(), GpuError> {
        let Some(id) = works.iter().find_map(RenderWork::data) else { return Ok(()) };
        // Units of scenes that are not on the shelf are refused one by one.
        let Some(flat) = self.shelf.get(id) else { return Ok(()) };
        let admitted = self.tracer().and_then(|tracer| tracer.admit(id, &flat));
        self.note_bytes();
        admitted
    }

    /// Returns the outcome of each unit, in order.
    #[cfg(test)]
    pub(super) fn perform(&mut self, works: Vec<RenderWork>) -> Vec<BlockResult> {
        let begun = self.begin(works);
        self.end(begun).0
    }

    /// Starts the units of a packet on the device. If they take several batches, waits for all but the last.
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
                // Probes of a few pixels and photons are too small for a device; they run on the CPU.
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
        // Start a batch per kind; wait for the previous one.
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

    /// Waits for the rest; also returns the time that the device spent on the packet.
    fn end(&mut self, mut begun: StartedBatch) -> (Vec<BlockResult>, Duration) {
        self.land(&mut begun);
        (begun.outcomes.into_iter().flatten().collect(), begun.busy)
    }

    /// Waits for the batch on the device.
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

    /// Starts a batch of units of one kind.
    fn start(&mut self, kind: &BatchKind, units: &[Unit]) -> Result<(BlockBatch, Flight), GpuError> {
        if units.is_empty() {
            return Err(GpuError::Invalid("a batch without units".to_owned()));
        }
        let batch = BlockBatch::new(kind, &units.iter().map(|unit| &unit.block).collect::<Vec<_>>())?;
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

    /// Returns the device; opens it again if the last one failed.
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

/// Returns the units as failed with this error.
fn give_back(units: Vec<Unit>, error: &GpuError, outcomes: &mut [Option<BlockResult>]) {
    for Unit { place, block } in units {
        outcomes[place] = Some(Err(Failed { work: RenderWork::Block(block), reason: error.to_string() }));
    }
}

/// Splits units into batches within the limits of paths and pixels.
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
