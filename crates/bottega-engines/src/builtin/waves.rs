//! A block painted in waves: its rays are asked of whoever follows rays, and shading is what comes between.

use std::{mem, ops::Range, sync::Arc};

use bottega_image::{Rect, Tile};
use bottega_kernels::Ray;
use bottega_render::{
    RenderOutput,
    integrator::{Wave, WaveAnswers},
};

/// Paths of a wave, about: enough that handing out its rays costs little, few enough that they stay in a processor's cache.
const PATHS_AT_ONCE: u64 = 4096;

/// The paths of a block that are under way.
pub(super) struct WaveUnderWay {
    /// The running sums of all samples before.
    tile: Tile,
    wave: Wave,
    answers: WaveAnswers,
    /// Answers that are waited for before it is shaded.
    missing: u8,
}

/// What a wave needs next.
pub(super) enum WaveStep {
    /// What these rays find, and whether these find anything; either may be none.
    Ask(Arc<Vec<Ray>>, Arc<Vec<Ray>>),
    /// To be shaded.
    Shade(Wave, WaveAnswers),
    /// More answers.
    Wait,
    /// Nothing: these are the sums, and so many samples had no finite radiance.
    Over(Tile, u64),
}

/// Samples of a block whose paths make a wave.
pub(super) fn samples_at_once(rect: Rect) -> u32 {
    (PATHS_AT_ONCE / rect.area().max(1)).clamp(1, PATHS_AT_ONCE) as u32
}

impl WaveUnderWay {
    /// The paths of samples of a block, to be shaded first.
    pub(super) fn begin(rect: Rect, samples: &Range<u32>, tile: Tile) -> (Self, Wave) {
        let begun = Self { tile, wave: Wave::default(), answers: WaveAnswers::default(), missing: 0 };
        (begun, Wave::of_block(rect, samples))
    }

    /// Takes in what came of a unit.
    pub(super) fn take(&mut self, output: RenderOutput) -> WaveStep {
        match output {
            RenderOutput::Wave(wave) if wave.is_over() => {
                let dropped_count = wave.add_to(&mut self.tile);
                return WaveStep::Over(self.tile.clone(), dropped_count);
            }
            RenderOutput::Wave(wave) => {
                self.wave = *wave;
                let (rays, shadows) = (self.wave.rays().clone(), self.wave.shadow_rays().clone());
                self.missing = u8::from(!rays.is_empty()) + u8::from(!shadows.is_empty());
                return WaveStep::Ask(rays, shadows);
            }
            RenderOutput::Hits(hits) => self.answers.hits = hits,
            RenderOutput::Occlusion(occluded) => self.answers.occluded = occluded,
            other => unreachable!("neither rays nor shading: {other:?}"),
        }
        self.missing -= 1;
        if self.missing > 0 {
            return WaveStep::Wait;
        }
        WaveStep::Shade(mem::take(&mut self.wave), mem::take(&mut self.answers))
    }
}
