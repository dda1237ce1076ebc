//! A block rendered in waves of paths: its rays are traced as work units, and shaded in between.

use std::{mem, ops::Range, sync::Arc};

use bottega_image::{Rect, Tile};
use bottega_kernels::Ray;
use bottega_render::{
    RenderOutput,
    integrator::{Wave, WaveAnswers},
};

/// The approximate number of paths in a wave: enough to amortize the cost of a unit, few enough to stay in the processor's
/// cache.
const PATHS_AT_ONCE: u64 = 4096;

/// The paths of a block in progress.
pub(super) struct WaveUnderWay {
    /// The running sums of all samples before.
    tile: Tile,
    wave: Wave,
    answers: WaveAnswers,
    /// The number of answers still missing before shading.
    missing: u8,
}

/// The next step of a wave.
pub(super) enum WaveStep {
    /// Trace these rays: closest hits of the first, occlusion of the second; either may be empty.
    Ask(Arc<Vec<Ray>>, Arc<Vec<Ray>>),
    /// Shade the wave, with the answers to its rays.
    Shade(Wave, WaveAnswers),
    /// Wait for more answers.
    Wait,
    /// Done: the sums, and the number of samples with non-finite radiance.
    Over(Tile, u64),
}

/// Returns the number of samples of a block in a wave.
pub(super) fn samples_at_once(rect: Rect) -> u32 {
    (PATHS_AT_ONCE / rect.area().max(1)).clamp(1, PATHS_AT_ONCE) as u32
}

impl WaveUnderWay {
    /// Starts the paths of a block's samples. The returned wave must be shaded first.
    pub(super) fn begin(rect: Rect, samples: &Range<u32>, tile: Tile) -> (Self, Wave) {
        let begun = Self { tile, wave: Wave::default(), answers: WaveAnswers::default(), missing: 0 };
        (begun, Wave::of_block(rect, samples))
    }

    /// Processes the output of a unit.
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
