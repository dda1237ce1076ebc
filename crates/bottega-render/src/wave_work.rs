//! Work units of wavefront path tracing: shading of a wave of paths, given the hits of its rays.

use std::{ops::Range, sync::Arc};

use bottega_image::{Aov, Layout, Rect, Tile};

use crate::{
    error::RenderError,
    integrator::{PathIntegrator, Wanted, WantedSurface, Wave, WaveAnswers},
    prepare::PreparedScene,
    prepass::Prepass,
    settings::{PathSettings, View},
};

/// A work unit that advances a wave of paths from the hits of its rays to its next rays.
#[derive(Clone)]
pub struct WaveWork {
    /// The scene to render.
    pub scene: Arc<PreparedScene>,
    /// Prepass data of the scene.
    pub prepass: Arc<Prepass>,
    /// Camera and size of the picture.
    pub view: View,
    /// Settings of the path integrator.
    pub settings: Arc<PathSettings>,
    /// Layout of the picture, which says what layers are requested.
    pub layout: Layout,
    /// The paths of the wave.
    pub wave: Wave,
    /// Results of the wave's rays; empty for a new wave.
    pub answers: WaveAnswers,
}

impl WaveWork {
    /// Shades on the calling thread. Returns the wave with its next rays.
    ///
    /// # Errors
    /// [`RenderError::EmptyPicture`].
    pub fn perform(self) -> Result<Wave, RenderError> {
        let Self { scene, prepass, view, settings, layout, mut wave, answers } = self;
        let wanted = Wanted { cost: false, ..Wanted::by(&layout) };
        let integrator = PathIntegrator::new(&scene, &prepass, &view, &settings)?.with_wanted(wanted);
        wave.step(&integrator, &answers);
        if let Some(wanted) = WantedSurface::by(&layout).filter(|_| wave.is_over()) {
            wave.find_surfaces(&integrator, wanted);
        }
        Ok(wave)
    }
}

impl Wave {
    /// Returns the paths for all samples of a block of pixels; they have not started.
    ///
    /// - `rect`: the block, in pixels of the whole picture.
    /// - `samples`: indices of the samples of each pixel.
    pub fn of_block(rect: Rect, samples: &Range<u32>) -> Self {
        let pixels = rect.pixels().flat_map(|(x, y)| samples.clone().map(move |sample| (x, y, sample)));
        Self::new(pixels.collect())
    }

    /// Adds the finished samples to the sums of their pixels, in the order of samples within each pixel. Returns the
    /// number of samples whose radiance was not finite and counted as 0.
    ///
    /// - `tile`: contains the pixels of the wave.
    pub fn add_to(&self, tile: &mut Tile) -> u64 {
        let mut dropped_count = 0;
        for (&(x, y, _), record) in self.samples().iter().zip(self.records()) {
            dropped_count += u64::from(record.is_dropped);
            tile.add(x, y, &record.values);
        }
        for (&(x, y, _), surface) in self.samples().iter().zip(self.surfaces()) {
            tile.add_surface(x, y, surface);
        }
        dropped_count
    }

    /// Returns the reason why wavefront rendering does not support a picture, as a clause for display; `None`: it does.
    pub fn refusal(
        prepared: &PreparedScene,
        view: &View,
        settings: &PathSettings,
        layout: &Layout,
    ) -> Option<&'static str> {
        if settings.photons.is_some() {
            return Some("photons and lighting agents follow rays of their own");
        }
        if !layout.layers().is_empty() {
            return Some("light groups are kept by whole paths on processors");
        }
        if layout.aovs().contains(Aov::ShadowCatcher) {
            return Some("light on shadow catchers is traced by whole paths on processors");
        }
        if prepared.moves() {
            return Some("something moves while the shutter is open, and its rays need a time");
        }
        if prepared.has_media() || prepared.has_boundaries() {
            return Some("it has media or panes, which change light along a ray");
        }
        if prepared.has_opacity() || view.camera.hides_emitters {
            return Some("it has surfaces that let rays pass");
        }
        layout.offset(Aov::Cost).map(|_| "devices that trace rays do not count their cost (layer `cost`)")
    }
}
