//! Shading as a primitive of its own: a wave of paths, and what others found of its rays.

use std::{ops::Range, sync::Arc};

use bottega_image::{Aov, Layout, Rect, Tile};

use crate::{
    PathSettings, PreparedScene, Prepass, RenderError, View,
    integrator::{PathIntegrator, Wave, WaveAnswers},
};

/// A wave of paths to be brought from what its rays met to the next rays.
#[derive(Clone)]
pub struct WaveWork {
    /// The scene.
    pub scene: Arc<PreparedScene>,
    /// What is known of it.
    pub prepass: Arc<Prepass>,
    /// The picture.
    pub view: View,
    /// How.
    pub settings: Arc<PathSettings>,
    /// Whether the reflectance of surfaces is wanted.
    pub albedo: bool,
    /// The paths.
    pub wave: Wave,
    /// What was found of their rays; nothing for those that begin.
    pub answers: WaveAnswers,
}

impl WaveWork {
    /// Shades on the calling thread.
    ///
    /// # Errors
    /// The picture cannot be painted.
    pub fn perform(self) -> Result<Wave, RenderError> {
        let Self { scene, prepass, view, settings, albedo, mut wave, answers } = self;
        let wanted = crate::integrator::Wanted { albedo, cost: false };
        let integrator = PathIntegrator::new(&scene, &prepass, view, &settings)?.with_wanted(wanted);
        wave.step(&integrator, &answers);
        Ok(wave)
    }
}

impl Wave {
    /// Paths for samples of a block of pixels.
    pub fn of_block(rect: Rect, samples: &Range<u32>) -> Self {
        let pixels = rect.pixels().flat_map(|(x, y)| samples.clone().map(move |sample| (x, y, sample)));
        Self::new(pixels.collect())
    }

    /// Adds what came of all samples to the sums of their pixels, each pixel's in their order. Returns how many had no finite
    /// radiance, and count as 0.
    pub fn add_to(&self, tile: &mut Tile) -> u64 {
        let mut dropped_count = 0;
        for (&(x, y, _), record) in self.samples().iter().zip(self.records()) {
            dropped_count += u64::from(record.is_dropped);
            tile.add(x, y, &record.values);
        }
        dropped_count
    }

    /// Why a picture cannot be painted in waves; `None`: it can.
    pub fn refusal(
        prepared: &PreparedScene,
        view: View,
        settings: &PathSettings,
        layout: &Layout,
    ) -> Option<&'static str> {
        let hides_emitters = prepared.camera(view.camera).is_some_and(|camera| camera.hides_emitters);
        if settings.photons.is_some() {
            return Some("photons and lighting agents follow rays of their own");
        }
        if prepared.has_media() || prepared.has_boundaries() {
            return Some("its media and panes are asked while rays are under way");
        }
        if prepared.has_opacity() || hides_emitters {
            return Some("surfaces that let rays pass are asked while these are under way");
        }
        layout.offset(Aov::Cost).map(|_| "what rays cost (layer `cost`) is not told by those who follow them")
    }
}
