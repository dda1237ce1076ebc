//! The built-in engine: paints zones with `bottega-render`, every block of pixels a work unit of the allocator.

use std::{
    collections::VecDeque,
    sync::{
        Arc, Mutex, OnceLock,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use bottega_hra::{
    Completed, CostBook, Hra, HraClient, HraConfig, HraReport, Lane, Primitive, PrimitiveSet, VirtualCpu, WorkUnit,
};
use bottega_image::{Layout, Rect, Tile};
use bottega_render::{
    AgentUse, BlockWork, PathSettings, PreparedScene, Prepass, RenderOutput, RenderWork, View,
    ala::AgentReport,
    integrator::PathIntegrator,
    photon::{MapBytes, cast_photons},
};

use crate::{
    CancelSwitch, EngineDescription, EngineError, Painted, RenderEngine, Sharing, Survey, TaskProgress, ZoneTask,
};

pub(crate) const NAME: &str = "builtin";

/// Side of the blocks of pixels that one work unit holds.
const BLOCK_SIDE: u32 = 16;

/// What one work unit should take: long enough that handing it out costs nothing, short enough that the last ones of
/// a picture end together.
const UNIT_TIME: Duration = Duration::from_millis(8);

/// The same where a device is beside the processors, for which a unit is over in no time and handing it out is not.
const UNIT_TIME_WITH_DEVICES: Duration = Duration::from_millis(60);

/// Work units of one zone that are in the bin or at work, per processor: enough that none waits, few enough that a
/// zone's blocks end one after the other.
const UNITS_PER_LANE: usize = 3;

/// The same for each device beside them, which takes many units at once.
const UNITS_PER_DEVICE: usize = 1024;

/// What a sample of a pixel may take before any was measured.
const SAMPLE_NS_GUESSED: u64 = 2_000;

/// Past this a unit goes before all younger ones.
const MAX_DELAY: Duration = Duration::from_secs(10);

/// Where and how the built-in engine paints.
#[derive(Clone, Debug)]
pub struct BuiltinOptions {
    /// Which camera, at which size.
    pub view: View,
    /// Seed, filter and depth; the farm's tunables take the place of depth and light samples zone by zone.
    pub settings: PathSettings,
    /// Which values a pixel keeps.
    pub layout: Layout,
    /// Processors to use; 0: none, the devices do all.
    pub threads: usize,
}

/// Who paints beside the processors.
#[derive(Default)]
pub struct Devices {
    /// Each is told of all work of an allocator that also has the processors.
    pub lanes: Vec<Lane<RenderWork>>,
    /// What is known of the costs of any of them, and of the processors.
    pub costs: Option<CostBook>,
}

/// The built-in engine over the processors of this machine.
pub struct BuiltinEngine {
    shared: Arc<Shared>,
    hra: Hra<RenderWork>,
    zones: Mutex<Vec<JoinHandle<()>>>,
}

/// Sees blocks of pixels as they are painted.
type Watcher = Box<dyn Fn(&Tile) + Send + Sync>;

struct Shared {
    scene: Arc<PreparedScene>,
    prepass: Arc<Prepass>,
    options: BuiltinOptions,
    /// How many there are beside the processors.
    devices: usize,
    cancelled: AtomicBool,
    /// Nanoseconds that one sample of one pixel takes, learnt from the units done so far.
    sample_ns: AtomicU64,
    /// Samples taken, all pixels together.
    samples_done: AtomicU64,
    /// Samples whose radiance was not finite.
    dropped_count: AtomicU64,
    watcher: OnceLock<Watcher>,
}

impl BuiltinEngine {
    /// An engine on `options.threads` processors, and on whatever else is given as `devices`: with these, pixels are no
    /// longer the same to the last bit.
    pub fn new(scene: Arc<PreparedScene>, options: BuiltinOptions, devices: Devices) -> Self {
        Self::with_prepass(scene, Arc::default(), options, devices)
    }

    /// The same with what other engines have found out of the scene, and will.
    pub fn with_prepass(
        scene: Arc<PreparedScene>,
        prepass: Arc<Prepass>,
        mut options: BuiltinOptions,
        devices: Devices,
    ) -> Self {
        let processors = VirtualCpu::lanes(options.threads, RenderWork::perform);
        let Devices { lanes, costs } = devices;
        let device_count = lanes.len();
        // Devices are not guided, so nobody needs to learn.
        if options.threads == 0 {
            options.settings.guiding = false;
            options.settings.agents = AgentUse::default();
        }
        let lanes = processors.into_iter().map(Lane::from).chain(lanes).chain(looker(&options)).collect();
        let costs = costs.unwrap_or_else(|| CostBook::new(""));
        let hra = Hra::with_costs(HraConfig::default(), lanes, &costs);
        let shared = Shared {
            scene,
            prepass,
            options,
            devices: device_count,
            cancelled: AtomicBool::new(false),
            sample_ns: AtomicU64::new(SAMPLE_NS_GUESSED),
            samples_done: AtomicU64::new(0),
            dropped_count: AtomicU64::new(0),
            watcher: OnceLock::new(),
        };
        Self { shared: Arc::new(shared), hra, zones: Mutex::default() }
    }

    /// Samples taken so far, all pixels together; those of zones under way are in it.
    pub fn samples_done(&self) -> u64 {
        self.shared.samples_done.load(Ordering::Relaxed)
    }

    /// Samples so far whose radiance was not finite, and which therefore counted as black.
    pub fn dropped_count(&self) -> u64 {
        self.shared.dropped_count.load(Ordering::Relaxed)
    }

    /// From now on shows the blocks of pixels to `watcher` as they are painted: each after some milliseconds of work on
    /// it, with the running sums that it has then. Called from several threads, and must return soon. There is one
    /// watcher: a second call does nothing.
    pub fn watch(&self, watcher: impl Fn(&Tile) + Send + Sync + 'static) {
        let _ = self.shared.watcher.set(Box::new(watcher));
    }

    /// What the lighting agents of the picture were like and what they were asked so far, if it has any.
    pub fn lighting_agents(&self) -> Option<AgentReport> {
        let Shared { scene, prepass, options: BuiltinOptions { view, settings, .. }, .. } = &*self.shared;
        prepass.lighting_agents(scene, *view, settings.photons?, settings.seed)
    }

    /// What the maps of a picture by photons take so far.
    pub fn map_bytes(&self) -> MapBytes {
        let Shared { scene, prepass, options: BuiltinOptions { view, settings, .. }, .. } = &*self.shared;
        let bytes = |photons| prepass.map_bytes(scene, *view, photons, settings.seed);
        settings.photons.map_or_else(MapBytes::default, bytes)
    }

    /// What the resources of the allocator have done so far.
    pub fn report(&self) -> HraReport {
        self.hra.report()
    }

    fn prepared(&self, others: Option<&dyn Sharing>) -> Result<(), EngineError> {
        // With the settings of the user: a zone whose settings are lowered must not be the one from which all learn.
        let Shared { scene, prepass, options, .. } = &*self.shared;
        let prepared = match options.settings.photons {
            None => PathIntegrator::new(scene, prepass, options.view, &options.settings).map(|_| ()),
            Some(_) => cast_photons(scene, prepass, options.view, &options.settings, &self.hra.client(), others),
        };
        prepared.map_err(|error| EngineError::Survey { engine: NAME.to_owned(), reason: error.to_string() })
    }
}

/// Where the devices do all, a processor is there for what they know nothing of: the rays of a look at the scene.
fn looker(options: &BuiltinOptions) -> Option<Lane<RenderWork>> {
    let rays = [Primitive::Intersect, Primitive::Occluded];
    let looker = VirtualCpu::new("cpu".to_owned(), PrimitiveSet::from(rays), RenderWork::perform);
    (options.threads == 0).then(|| Lane::Direct(Box::new(looker)))
}

impl RenderEngine for BuiltinEngine {
    fn describe(&self) -> EngineDescription {
        EngineDescription {
            name: NAME.to_owned(),
            has_max_depth: true,
            has_light_samples: true,
            resumes_samples: true,
            is_profiled: true,
            exact_by_pixel: self.shared.devices == 0,
        }
    }

    fn survey(&self, width: u32, height: u32) -> Result<Survey, EngineError> {
        let view = View { camera: self.shared.options.view.camera, width, height };
        let max_depth = self.shared.options.settings.max_depth;
        bottega_render::survey(&self.shared.scene, view, max_depth, &self.hra.client())
            .map_err(|error| EngineError::Survey { engine: NAME.to_owned(), reason: error.to_string() })
    }

    fn prepare(&self) -> Result<(), EngineError> {
        self.prepared(None)
    }

    fn prepare_with(&self, others: &dyn Sharing) -> Result<(), EngineError> {
        // What guides paths is learnt by one, and told.
        if self.shared.options.settings.photons.is_some() { self.prepared(Some(others)) } else { Ok(()) }
    }

    fn learnt(&self) -> Option<Vec<u8>> {
        let Shared { scene, prepass, options, .. } = &*self.shared;
        prepass.learnt(scene, options.view, &options.settings)
    }

    fn learn_from(&self, bytes: &[u8]) -> Result<(), EngineError> {
        let Shared { scene, prepass, options, .. } = &*self.shared;
        let learnt = prepass.learn_from(scene, options.view, &options.settings, bytes);
        learnt.map_err(|error| EngineError::Survey { engine: NAME.to_owned(), reason: error.to_string() })
    }

    fn start(&self, task: ZoneTask, done: Box<dyn FnOnce(Result<Painted, EngineError>) + Send>) {
        let shared = Arc::clone(&self.shared);
        let client = self.hra.client();
        let zone = thread::spawn(move || done(ZonePainter::new(&shared, client, task).paint()));
        let mut zones = self.zones.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        zones.retain(|zone| !zone.is_finished());
        zones.push(zone);
    }
}

impl Drop for BuiltinEngine {
    fn drop(&mut self) {
        self.shared.cancelled.store(true, Ordering::Relaxed);
        let zones = self.zones.get_mut().unwrap_or_else(std::sync::PoisonError::into_inner);
        // Whoever was told of the last zone may be the last to know the engine: a thread does not wait for itself.
        let others = zones.drain(..).filter(|zone| zone.thread().id() != thread::current().id());
        for zone in others {
            // A panic in there was already reported by the thread itself; there is nothing left to lose.
            let _ = zone.join();
        }
    }
}

/// Paints one zone: hands out its blocks, a few at a time, and each block's samples pass by pass.
struct ZonePainter<'a> {
    shared: &'a Shared,
    client: HraClient<RenderWork>,
    settings: Arc<PathSettings>,
    rect: Rect,
    tile: Tile,
    samples: std::ops::Range<u32>,
    waiting: VecDeque<Rect>,
    under_way: Vec<Option<BlockUnderWay>>,
    busy: Duration,
    /// By block, of those that are done.
    parts: Vec<(Rect, Duration)>,
    complete: bool,
    cancel: CancelSwitch,
    progress: TaskProgress,
}

#[derive(Clone, Copy)]
struct BlockUnderWay {
    rect: Rect,
    /// Processor time so far.
    busy: Duration,
    /// The first sample that no unit has been asked for.
    next_sample: u32,
    /// Samples in the unit at work.
    in_unit: u32,
}

/// The blocks of a zone, or of parts of it.
fn blocks(rect: Rect, parts: Option<&[Rect]>) -> VecDeque<Rect> {
    let parts =
        parts.map_or_else(|| vec![rect], |parts| parts.iter().filter_map(|it| it.intersection(&rect)).collect());
    parts.iter().flat_map(|part| part.blocks(BLOCK_SIDE)).collect()
}

impl<'a> ZonePainter<'a> {
    fn new(shared: &'a Shared, client: HraClient<RenderWork>, task: ZoneTask) -> Self {
        let mut settings = shared.options.settings;
        settings.max_depth = task.tunables.max_depth;
        settings.light_samples = task.tunables.light_samples;
        let tile = task.tile.unwrap_or_else(|| Tile::new(task.rect, shared.options.layout.clone()));
        Self {
            shared,
            client,
            settings: Arc::new(settings),
            rect: task.rect,
            tile,
            samples: task.samples,
            waiting: blocks(task.rect, task.parts.as_deref()),
            under_way: Vec::new(),
            busy: Duration::ZERO,
            parts: Vec::new(),
            complete: true,
            cancel: task.cancel,
            progress: task.progress,
        }
    }

    fn is_cancelled(&self) -> bool {
        self.cancel.is_cancelled() || self.shared.cancelled.load(Ordering::Relaxed)
    }

    fn paint(mut self) -> Result<Painted, EngineError> {
        let window = UNITS_PER_LANE * self.shared.options.threads + UNITS_PER_DEVICE * self.shared.devices;
        for _ in 0..window {
            let ticket = self.under_way.len();
            self.under_way.push(None);
            self.start_block(ticket)?;
        }
        while let Some(completed) = self.client.take() {
            self.finish_unit(completed)?;
        }
        Ok(Painted { tile: self.tile, busy: self.busy, parts: self.parts, complete: self.complete })
    }

    /// Hands out the first samples of the next waiting block that lacks any.
    fn start_block(&mut self, ticket: usize) -> Result<(), EngineError> {
        while let Some(rect) = self.waiting.pop_front() {
            let mut block = Tile::new(rect, self.shared.options.layout.clone());
            block.copy_from(&self.tile);
            // After an interruption some blocks have more samples than others, but all pixels of a block the same.
            let taken = block.pixel(rect.x0, rect.y0)[Layout::SAMPLE_COUNT] as u32;
            let next_sample = self.samples.start.max(taken);
            if next_sample >= self.samples.end {
                continue;
            }
            if self.is_cancelled() {
                self.complete = false;
                continue;
            }
            return self.submit(ticket, BlockUnderWay { rect, busy: Duration::ZERO, next_sample, in_unit: 0 }, block);
        }
        Ok(())
    }

    /// Hands out as many of the block's next samples as one unit should hold.
    fn submit(&mut self, ticket: usize, mut block: BlockUnderWay, tile: Tile) -> Result<(), EngineError> {
        let sample_ns = self.shared.sample_ns.load(Ordering::Relaxed).max(1) * block.rect.area();
        let unit_time = if self.shared.devices == 0 { UNIT_TIME } else { UNIT_TIME_WITH_DEVICES };
        let wanted = (unit_time.as_nanos() as u64 / sample_ns.max(1)).clamp(1, u64::from(u32::MAX)) as u32;
        let left = self.samples.end - block.next_sample;
        block.in_unit = if wanted.saturating_mul(3) / 2 >= left { left } else { wanted };
        let work = RenderWork::Block(BlockWork {
            scene: Arc::clone(&self.shared.scene),
            prepass: Arc::clone(&self.shared.prepass),
            view: self.shared.options.view,
            settings: Arc::clone(&self.settings),
            tile,
            samples: block.next_sample..block.next_sample + block.in_unit,
        });
        block.next_sample += block.in_unit;
        self.under_way[ticket] = Some(block);
        let unit = WorkUnit { max_delay: MAX_DELAY, ..WorkUnit::new(work, ticket as u64) };
        self.client.submit(unit).map_err(|error| self.failure(&error))
    }

    fn finish_unit(&mut self, completed: Completed<RenderOutput>) -> Result<(), EngineError> {
        self.busy += completed.busy;
        let ticket = completed.ticket as usize;
        let tile = match completed.output {
            Ok(RenderOutput::Block(output)) => {
                self.shared.dropped_count.fetch_add(output.dropped_count, Ordering::Relaxed);
                output.tile
            }
            Ok(RenderOutput::Refused(error)) => return Err(self.failure(&error)),
            Ok(_) => unreachable!("a block was asked for"),
            Err(error) => return Err(self.failure(&error)),
        };
        let Some(mut block) = self.under_way[ticket].take() else { unreachable!("a unit that was never handed out") };
        block.busy += completed.busy;
        let samples = block.rect.area() * u64::from(block.in_unit);
        self.shared.samples_done.fetch_add(samples, Ordering::Relaxed);
        self.progress.add(samples);
        // What devices take is another matter, which the allocator learns: they have several units at once.
        let threads = self.shared.options.threads;
        if completed.resource.is_some_and(|id| (id.0 as usize) < threads) {
            self.learn(completed.busy, samples);
        }
        if let Some(watcher) = self.shared.watcher.get() {
            watcher(&tile);
        }
        if block.next_sample < self.samples.end {
            if !self.is_cancelled() {
                return self.submit(ticket, block, tile);
            }
            self.complete = false;
        }
        self.tile.copy_from(&tile);
        self.parts.push((block.rect, block.busy));
        self.start_block(ticket)
    }

    /// Follows the cost of a sample, so that units take about [`UNIT_TIME`] wherever in the picture they are. It
    /// decides only how samples are cut into units, which the picture does not show.
    fn learn(&self, busy: Duration, samples: u64) {
        let measured = busy.as_nanos() as u64 / samples.max(1);
        let before = self.shared.sample_ns.load(Ordering::Relaxed);
        self.shared.sample_ns.store((before * 3 + measured) / 4, Ordering::Relaxed);
    }

    fn failure(&self, reason: &impl std::fmt::Display) -> EngineError {
        EngineError::Zone { engine: NAME.to_owned(), rect: self.rect, reason: reason.to_string() }
    }
}
