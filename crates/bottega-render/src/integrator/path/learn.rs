//! Paths from which a picture learns where light comes from, before any of it is painted.

use std::sync::Arc;

use bottega_kernels::compiled::{self, Task};
use glam::Vec2;

use super::{super::record::PathRecord, setup::PathIntegrator};
use crate::{
    PathSettings, PreparedScene, Prepass, RenderError, View,
    camera::CameraRay,
    guide::{Guide, Trail, Training, train},
    sampler::{DimensionSet, PixelSampler},
};

/// Bounces of the paths that the guide learns from.
const LEARNING_DEPTH: u32 = 24;
/// Seed of the paths that the guide learns from, which no picture shares: what is learnt must not know the picture's
/// samples.
pub(super) const LEARNING_SEED: u64 = 0x6775_6964_655f_7365;

impl<'a> PathIntegrator<'a> {
    /// An integrator for the picture `view`.
    pub fn new(
        prepared: &'a PreparedScene,
        prepass: &Prepass,
        view: View,
        settings: &'a PathSettings,
    ) -> Result<Self, RenderError> {
        let mut integrator = Self::unguided(prepared, view, settings)?;
        if (settings.guiding || settings.agents.any()) && prepared.can_learn(view, settings.planned_samples) {
            let guide = prepass.guide(view, settings, || integrator.learn(view));
            integrator.splits = settings.agents.roulette && guide.goes_by_worth();
            integrator.looks_rarely = settings.agents.shadows && guide.goes_by_worth();
            integrator.guide = Some(guide);
        }
        Ok(integrator)
    }

    /// Traces paths all over the picture for a guide.
    fn learn(&self, view: View) -> Guide {
        let PathSettings { agents, guiding, .. } = *self.settings;
        let settings = PathSettings { max_depth: LEARNING_DEPTH, agents, guiding, ..PathSettings::default() };
        let integrator = PathIntegrator {
            settings: &settings,
            camera: self.camera.clone(),
            filter: self.filter.clone(),
            guide: None,
            ..*self
        };
        let size = self.size;
        let training = Training {
            samples: u64::from(view.width) * u64::from(view.height) * u64::from(self.settings.planned_samples),
            size: [view.width, view.height],
            lights: agents.any().then(|| self.prepared.lights()),
            threads: self.prepared.threads(),
        };
        let guide = train(&training, |guide, index, trail| {
            // One sequence of samples for the whole picture.
            let sampler = PixelSampler::new(LEARNING_SEED, 0, 0, index);
            let [x, y, lens_u, lens_v] = sampler.quad(DimensionSet::CAMERA);
            let ray = integrator.camera.ray(Vec2::new(x, y) * size, [lens_u, lens_v]);
            let path = FollowedPath { integrator: &integrator, sampler, ray: &ray, guide, trail };
            (compiled::run(path).values.radiance.into(), [x, y])
        });
        if !(agents.roulette || agents.shadows) {
            return guide;
        }
        let guide = Arc::new(guide);
        let pays = self.prepared.on_threads(|| integrator.worth_pays(training.samples, &guide));
        Arc::unwrap_or_clone(guide).going_by_worth(pays)
    }
}

/// A path that leaves a trail.
struct FollowedPath<'a> {
    integrator: &'a PathIntegrator<'a>,
    sampler: PixelSampler,
    ray: &'a CameraRay,
    guide: Option<&'a Guide>,
    trail: &'a mut Trail,
}

impl Task for FollowedPath<'_> {
    type Output = PathRecord;

    #[inline(always)]
    fn run(self) -> PathRecord {
        self.integrator.follow(self.sampler, self.ray, self.guide, Some(self.trail))
    }
}
