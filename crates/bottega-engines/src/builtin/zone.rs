//! A zone in progress: its blocks as work units, a few at a time.

use std::{
    collections::VecDeque,
    sync::{Arc, atomic::Ordering},
    time::{Duration, Instant},
};

use bottega_hra::{Completed, HraClient, UnitError, WorkUnit};
use bottega_image::{Layout, Rect, Tile};
use bottega_render::{
    BlockWork, PathSettings, RenderOutput, RenderWork, WaveWork,
    integrator::{Wave, WaveAnswers},
};

use super::{
    shared::{NAME, Shared},
    waves::{WaveStep, WaveUnderWay, samples_at_once},
};
use crate::{CancelSwitch, EngineError, Painted, TaskProgress, ZoneTask};

/// Side of the pixel blocks of a work unit.
const BLOCK_SIDE: u32 = 16;

/// The target time of a work unit: long enough to amortize its overhead, short enough that the last units of a picture end
/// together.
const UNIT_TIME: Duration = Duration::from_millis(8);

/// The target time of a work unit where devices take part, which finish a unit quickly and have a higher overhead per
/// unit.
const UNIT_TIME_WITH_DEVICES: Duration = Duration::from_millis(60);

/// The most units of a zone per processor, waiting or running: enough to keep it busy, few enough that blocks finish in order.
const UNITS_PER_LANE: usize = 3;

/// The most units of a zone per device, which takes many at once; and the most waves of paths, which use host memory.
const UNITS_PER_DEVICE: usize = 1024;
const WAVES_PER_DEVICE: usize = 128;

/// The delay after which a unit precedes all younger ones.
const MAX_DELAY: Duration = Duration::from_secs(10);

/// Interval between checks for cancellation.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// The time to wait for running units after a cancellation.
const PATIENCE: Duration = Duration::from_millis(500);

/// The kinds of units of a wave; a ticket is `KINDS · block + kind`.
const KINDS: u64 = 3;
const SHADE: u64 = 0;
const RAYS: u64 = 1;
const SHADOWS: u64 = 2;

/// Renders one zone: submits its blocks, a few at a time, and the samples of each block pass by pass.
pub(super) struct ZonePainter<'a> {
    shared: &'a Shared,
    client: HraClient<RenderWork>,
    settings: Arc<PathSettings>,
    rect: Rect,
    tile: Tile,
    samples: std::ops::Range<u32>,
    waiting: VecDeque<Rect>,
    under_way: Vec<Option<BlockUnderWay>>,
    busy: Duration,
    /// True if the engine has rendered before: devices get their kernels and scenes with their first units.
    is_warm: bool,
    /// The time of each finished block.
    parts: Vec<(Rect, Duration)>,
    complete: bool,
    cancel: CancelSwitch,
    progress: TaskProgress,
}

struct BlockUnderWay {
    rect: Rect,
    /// Processor time so far.
    busy: Duration,
    /// The first sample not submitted yet.
    next_sample: u32,
    /// The number of samples in the running unit.
    in_unit: u32,
    /// The paths of the running unit, in wavefront mode.
    wave: Option<WaveUnderWay>,
}

/// Returns the blocks of a zone, or of parts of it.
fn blocks(rect: Rect, parts: Option<&[Rect]>) -> VecDeque<Rect> {
    let parts =
        parts.map_or_else(|| vec![rect], |parts| parts.iter().filter_map(|it| it.intersection(&rect)).collect());
    parts.iter().flat_map(|part| part.blocks(BLOCK_SIDE)).collect()
}

impl<'a> ZonePainter<'a> {
    /// Returns the renderer of a zone, with the settings of its task.
    pub(super) fn new(shared: &'a Shared, client: HraClient<RenderWork>, task: ZoneTask) -> Self {
        let mut settings = shared.options.settings;
        settings.max_depth = task.tunables.max_depth;
        settings.light_samples = task.tunables.light_samples;
        let tile = task.tile.unwrap_or_else(|| Tile::new(task.rect, shared.options.layout.clone()));
        let is_warm = shared.devices == 0 || shared.samples_done.load(Ordering::Relaxed) > 0;
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
            is_warm,
            parts: Vec::new(),
            complete: true,
            cancel: task.cancel,
            progress: task.progress,
        }
    }

    fn is_cancelled(&self) -> bool {
        self.cancel.is_cancelled() || self.shared.cancelled.load(Ordering::Relaxed)
    }

    /// Renders the zone. Blocks until it is finished or cancelled.
    pub(super) fn paint(mut self) -> Result<Painted, EngineError> {
        // Submit the first units
        let per_device = if self.shared.options.wavefront { WAVES_PER_DEVICE } else { UNITS_PER_DEVICE };
        let window = UNITS_PER_LANE * self.shared.options.threads + per_device * self.shared.devices;
        for _ in 0..window {
            let ticket = self.under_way.len();
            self.under_way.push(None);
            self.start_block(ticket)?;
        }
        // Process finished units, each of which submits the next
        let mut cancelled_at = None;
        while self.client.outstanding() > 0 {
            let completed = self.client.take_timeout(LOOK_EVERY);
            if let Some(completed) = completed {
                self.finish_unit(completed)?;
            }
            if self.is_cancelled() {
                let since = *cancelled_at.get_or_insert_with(Instant::now);
                self.take_back();
                // Give up units of a device that does not answer.
                if since.elapsed() > PATIENCE {
                    self.complete = false;
                    break;
                }
            }
        }
        let Self { tile, busy, is_warm, parts, complete, .. } = self;
        Ok(Painted { tile, busy, is_warm, parts, complete })
    }

    /// Submits the first unit of the next waiting block that lacks samples.
    fn start_block(&mut self, ticket: usize) -> Result<(), EngineError> {
        while let Some(rect) = self.waiting.pop_front() {
            let mut block = Tile::new(rect, self.shared.options.layout.clone());
            block.copy_from(&self.tile);
            // After an interruption blocks may have different sample counts, but the pixels of a block have the same.
            let taken = block.pixel(rect.x0, rect.y0)[Layout::SAMPLE_COUNT] as u32;
            let next_sample = self.samples.start.max(taken);
            if next_sample >= self.samples.end {
                continue;
            }
            if self.is_cancelled() {
                self.complete = false;
                continue;
            }
            return self.submit(
                ticket,
                BlockUnderWay { rect, busy: Duration::ZERO, next_sample, in_unit: 0, wave: None },
                block,
            );
        }
        Ok(())
    }

    /// Submits a unit with the next samples of a block.
    fn submit(&mut self, ticket: usize, mut block: BlockUnderWay, tile: Tile) -> Result<(), EngineError> {
        let sample_ns = self.shared.sample_ns.load(Ordering::Relaxed).max(1) * block.rect.area();
        let unit_time = if self.shared.devices == 0 { UNIT_TIME } else { UNIT_TIME_WITH_DEVICES };
        let wanted = if self.shared.options.wavefront {
            samples_at_once(block.rect)
        } else {
            (unit_time.as_nanos() as u64 / sample_ns.max(1)).clamp(1, u64::from(u32::MAX)) as u32
        };
        let left = self.samples.end - block.next_sample;
        block.in_unit = if wanted.saturating_mul(3) / 2 >= left { left } else { wanted };
        if self.shared.options.wavefront {
            return self.begin_wave(ticket, block, tile);
        }
        let work = RenderWork::Block(BlockWork {
            scene: Arc::clone(&self.shared.scene),
            prepass: Arc::clone(&self.shared.prepass),
            view: self.shared.options.view.clone(),
            settings: Arc::clone(&self.settings),
            tile,
            samples: block.next_sample..block.next_sample + block.in_unit,
            light_groups: self.shared.light_groups.clone(),
            catchers: self.shared.catchers.clone(),
        });
        block.next_sample += block.in_unit;
        self.under_way[ticket] = Some(block);
        self.hand_out(work, ticket as u64)
    }

    fn hand_out(&self, work: RenderWork, ticket: u64) -> Result<(), EngineError> {
        let unit = WorkUnit { max_delay: MAX_DELAY, ..WorkUnit::new(work, ticket) };
        self.client.submit(unit).map_err(|error| self.failure(&error))
    }

    fn finish_unit(&mut self, completed: Completed<RenderOutput>) -> Result<(), EngineError> {
        self.busy += completed.busy;
        if self.shared.options.wavefront {
            return self.go_on_with_wave(completed);
        }
        let ticket = completed.ticket as usize;
        let tile = match completed.output {
            Ok(RenderOutput::Block(output)) => {
                self.shared.dropped_count.fetch_add(output.dropped_count, Ordering::Relaxed);
                output.tile
            }
            Ok(RenderOutput::Refused(error)) => return Err(self.failure(&error)),
            Ok(_) => unreachable!("a block was requested"),
            Err(UnitError::Expired) => return self.give_up(ticket),
            Err(error) => return Err(self.failure(&error)),
        };
        let Some(mut block) = self.under_way[ticket].take() else { unreachable!("a unit that was never handed out") };
        block.busy += completed.busy;
        let samples = block.rect.area() * u64::from(block.in_unit);
        // Ignore devices, which run several units at once: the allocator measures them.
        let threads = self.shared.options.threads;
        if completed.resource.is_some_and(|id| (id.0 as usize) < threads) {
            self.learn(completed.busy, samples);
        }
        self.keep(ticket, block, tile)
    }

    /// Drops a block whose unit has expired.
    fn give_up(&mut self, ticket: usize) -> Result<(), EngineError> {
        self.under_way[ticket] = None;
        self.waiting.clear();
        self.complete = false;
        Ok(())
    }

    /// Adds the samples of a unit, and continues with the block or with the next one.
    fn keep(&mut self, ticket: usize, block: BlockUnderWay, tile: Tile) -> Result<(), EngineError> {
        let samples = block.rect.area() * u64::from(block.in_unit);
        self.shared.samples_done.fetch_add(samples, Ordering::Relaxed);
        self.progress.add(samples);
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

    /// Takes back waiting units: a cancelled zone only waits for running ones.
    fn take_back(&mut self) {
        // The rays of a wave may be partly running: let it finish.
        if self.shared.options.wavefront {
            return;
        }
        for unit in self.client.cancel_pending() {
            self.complete = false;
            let Some(block) = self.under_way[unit.ticket as usize].take() else { continue };
            if let RenderWork::Block(work) = unit.work {
                self.tile.copy_from(&work.tile);
                self.parts.push((block.rect, block.busy));
            }
        }
    }

    /// Starts the paths of a block's next samples.
    fn begin_wave(&mut self, ticket: usize, mut block: BlockUnderWay, tile: Tile) -> Result<(), EngineError> {
        let samples = block.next_sample..block.next_sample + block.in_unit;
        let (begun, wave) = WaveUnderWay::begin(block.rect, &samples, tile);
        block.next_sample = samples.end;
        block.wave = Some(begun);
        self.under_way[ticket] = Some(block);
        self.shade(ticket, wave, WaveAnswers::default())
    }

    fn shade(&self, ticket: usize, wave: Wave, answers: WaveAnswers) -> Result<(), EngineError> {
        let work = WaveWork {
            scene: Arc::clone(&self.shared.scene),
            prepass: Arc::clone(&self.shared.prepass),
            view: self.shared.options.view.clone(),
            settings: Arc::clone(&self.settings),
            layout: self.shared.options.layout.clone(),
            wave,
            answers,
        };
        self.hand_out(RenderWork::Wave(Box::new(work)), KINDS * ticket as u64 + SHADE)
    }

    /// Processes the output of a unit of a wave, and submits the next ones.
    fn go_on_with_wave(&mut self, completed: Completed<RenderOutput>) -> Result<(), EngineError> {
        let ticket = (completed.ticket / KINDS) as usize;
        let output = match completed.output {
            Ok(RenderOutput::Refused(error)) => return Err(self.failure(&error)),
            Ok(output) => output,
            Err(UnitError::Expired) => return self.give_up(ticket),
            Err(error) => return Err(self.failure(&error)),
        };
        // Answers may arrive for a wave that was dropped.
        let Some(block) = &mut self.under_way[ticket] else { return Ok(()) };
        block.busy += completed.busy;
        let Some(wave) = &mut block.wave else { unreachable!("a block without a wave") };
        match wave.take(output) {
            WaveStep::Wait => Ok(()),
            WaveStep::Shade(wave, answers) => self.shade(ticket, wave, answers),
            WaveStep::Ask(rays, shadows) => {
                let (scene, first) = (&self.shared.scene, KINDS * ticket as u64);
                if !rays.is_empty() {
                    self.hand_out(RenderWork::Rays { scene: Arc::clone(scene), rays }, first + RAYS)?;
                }
                if !shadows.is_empty() {
                    let work = RenderWork::Occlusion { scene: Arc::clone(scene), rays: shadows };
                    self.hand_out(work, first + SHADOWS)?;
                }
                Ok(())
            }
            WaveStep::Over(tile, dropped_count) => {
                let Some(block) = self.under_way[ticket].take() else { return Ok(()) };
                self.shared.dropped_count.fetch_add(dropped_count, Ordering::Relaxed);
                self.keep(ticket, block, tile)
            }
        }
    }

    /// Updates the estimated cost of a sample, so that units take about [`UNIT_TIME`] in each part of the picture. It only
    /// affects the division into units; pixels are the same.
    fn learn(&self, busy: Duration, samples: u64) {
        let measured = busy.as_nanos() as u64 / samples.max(1);
        let before = self.shared.sample_ns.load(Ordering::Relaxed);
        self.shared.sample_ns.store((before * 3 + measured) / 4, Ordering::Relaxed);
    }

    fn failure(&self, reason: &impl std::fmt::Display) -> EngineError {
        EngineError::Zone { engine: NAME.to_owned(), rect: self.rect, reason: reason.to_string() }
    }
}
