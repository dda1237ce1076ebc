//! One zone being painted: its blocks as work units, a few at a time.

use std::{
    collections::VecDeque,
    sync::{Arc, atomic::Ordering},
    time::{Duration, Instant},
};

use bottega_hra::{Completed, HraClient, UnitError, WorkUnit};
use bottega_image::{Aov, Layout, Rect, Tile};
use bottega_render::{
    BlockWork, PathSettings, RenderOutput, RenderWork, WaveWork,
    integrator::{Wave, WaveAnswers},
};

use super::{
    shared::{NAME, Shared},
    waves::{WaveStep, WaveUnderWay, samples_at_once},
};
use crate::{CancelSwitch, EngineError, Painted, TaskProgress, ZoneTask};

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

/// The same for each device beside them, which takes many units at once; and where a block is a wave of paths, which take memory
/// here.
const UNITS_PER_DEVICE: usize = 1024;
const WAVES_PER_DEVICE: usize = 128;

/// Past this a unit goes before all younger ones.
const MAX_DELAY: Duration = Duration::from_secs(10);

/// How often is looked whether the zone was cancelled while no unit is answered.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// So long units under way are waited for after that.
const PATIENCE: Duration = Duration::from_millis(500);

/// What a unit of a wave asks for, as its ticket says beside the block's.
const KINDS: u64 = 3;
const SHADE: u64 = 0;
const RAYS: u64 = 1;
const SHADOWS: u64 = 2;

/// Paints one zone: hands out its blocks, a few at a time, and each block's samples pass by pass.
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
    /// Whether the engine had painted something before: devices get their kernels and scenes with the first units.
    is_warm: bool,
    /// By block, of those that are done.
    parts: Vec<(Rect, Duration)>,
    complete: bool,
    cancel: CancelSwitch,
    progress: TaskProgress,
}

struct BlockUnderWay {
    rect: Rect,
    /// Processor time so far.
    busy: Duration,
    /// The first sample that no unit has been asked for.
    next_sample: u32,
    /// Samples in the unit at work.
    in_unit: u32,
    /// Their paths, where they are followed in waves.
    wave: Option<WaveUnderWay>,
}

/// The blocks of a zone, or of parts of it.
fn blocks(rect: Rect, parts: Option<&[Rect]>) -> VecDeque<Rect> {
    let parts =
        parts.map_or_else(|| vec![rect], |parts| parts.iter().filter_map(|it| it.intersection(&rect)).collect());
    parts.iter().flat_map(|part| part.blocks(BLOCK_SIDE)).collect()
}

impl<'a> ZonePainter<'a> {
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

    pub(super) fn paint(mut self) -> Result<Painted, EngineError> {
        let per_device = if self.shared.options.wavefront { WAVES_PER_DEVICE } else { UNITS_PER_DEVICE };
        let window = UNITS_PER_LANE * self.shared.options.threads + per_device * self.shared.devices;
        for _ in 0..window {
            let ticket = self.under_way.len();
            self.under_way.push(None);
            self.start_block(ticket)?;
        }
        let mut cancelled_at = None;
        while self.client.outstanding() > 0 {
            let completed = self.client.take_timeout(LOOK_EVERY);
            if let Some(completed) = completed {
                self.finish_unit(completed)?;
            }
            if self.is_cancelled() {
                let since = *cancelled_at.get_or_insert_with(Instant::now);
                self.take_back();
                // A device that does not answer keeps nobody: what it has is given up.
                if since.elapsed() > PATIENCE {
                    self.complete = false;
                    break;
                }
            }
        }
        let Self { tile, busy, is_warm, parts, complete, .. } = self;
        Ok(Painted { tile, busy, is_warm, parts, complete })
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
            return self.submit(
                ticket,
                BlockUnderWay { rect, busy: Duration::ZERO, next_sample, in_unit: 0, wave: None },
                block,
            );
        }
        Ok(())
    }

    /// Hands out as many of the block's next samples as one unit should hold.
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
            view: self.shared.options.view,
            settings: Arc::clone(&self.settings),
            tile,
            samples: block.next_sample..block.next_sample + block.in_unit,
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
            Ok(_) => unreachable!("a block was asked for"),
            Err(UnitError::Expired) => return self.give_up(ticket),
            Err(error) => return Err(self.failure(&error)),
        };
        let Some(mut block) = self.under_way[ticket].take() else { unreachable!("a unit that was never handed out") };
        block.busy += completed.busy;
        let samples = block.rect.area() * u64::from(block.in_unit);
        // What devices take is another matter, which the allocator learns: they have several units at once.
        let threads = self.shared.options.threads;
        if completed.resource.is_some_and(|id| (id.0 as usize) < threads) {
            self.learn(completed.busy, samples);
        }
        self.keep(ticket, block, tile)
    }

    /// Nobody looks at the block any more.
    fn give_up(&mut self, ticket: usize) -> Result<(), EngineError> {
        self.under_way[ticket] = None;
        self.waiting.clear();
        self.complete = false;
        Ok(())
    }

    /// Takes in samples of a block, and goes on with it or with the next one.
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

    /// Takes back what waits for a processor: who ends a zone waits for what is under way alone.
    fn take_back(&mut self) {
        // Of a wave some rays may be under way while others wait: it goes on to its end.
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

    /// Begins the paths of a block's next samples.
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
            view: self.shared.options.view,
            settings: Arc::clone(&self.settings),
            albedo: self.shared.options.layout.offset(Aov::Albedo).is_some(),
            wave,
            answers,
        };
        self.hand_out(RenderWork::Wave(Box::new(work)), KINDS * ticket as u64 + SHADE)
    }

    /// Takes in what came of a unit of a wave, and asks for what it needs next.
    fn go_on_with_wave(&mut self, completed: Completed<RenderOutput>) -> Result<(), EngineError> {
        let ticket = (completed.ticket / KINDS) as usize;
        let output = match completed.output {
            Ok(RenderOutput::Refused(error)) => return Err(self.failure(&error)),
            Ok(output) => output,
            Err(UnitError::Expired) => return self.give_up(ticket),
            Err(error) => return Err(self.failure(&error)),
        };
        // Of a wave that was given up there may be answers to come.
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
