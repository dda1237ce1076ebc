//! Paths from which a picture learns where light comes from, before any of it is painted.

use std::{convert::Infallible, sync::Arc};

use bottega_kernels::compiled::{self, Task};
use glam::Vec2;

use super::{
    super::record::PathRecord,
    setup::PathIntegrator,
    trial::{BothTrials, LEARNING_SEED, Trial},
};
use crate::{
    PathSettings, PreparedScene, Prepass, RenderError, Sharing, View,
    camera::CameraRay,
    guide::{Guide, Trail, Training, train},
    sampler::{DimensionSet, PixelSampler},
};

/// Bounces of the paths that the guide learns from.
const LEARNING_DEPTH: u32 = 24;

impl<'a> PathIntegrator<'a> {
    /// An integrator for the picture `view`.
    pub fn new(
        prepared: &'a PreparedScene,
        prepass: &Prepass,
        view: View,
        settings: &'a PathSettings,
    ) -> Result<Self, RenderError> {
        let mut integrator = Self::unguided(prepared, view, settings)?;
        if integrator.is_to_learn(view) {
            let learn = || integrator.learn(view, |trial| Ok::<_, Infallible>(trial.alone()));
            let guide = prepass.guide(view, settings, || learn().unwrap_or_else(|never| match never {}));
            integrator.splits = settings.agents.roulette && guide.goes_by_worth();
            integrator.looks_rarely = settings.agents.shadows && guide.goes_by_worth();
            integrator.guide = Some(guide);
        }
        Ok(integrator)
    }

    fn is_to_learn(&self, view: View) -> bool {
        let PathSettings { guiding, agents, planned_samples, .. } = *self.settings;
        (guiding || agents.any()) && self.prepared.can_learn(view, planned_samples)
    }

    /// Traces paths all over the picture for a guide.
    ///
    /// - `paint`: paints what is tried with it.
    fn learn<E>(&self, view: View, paint: impl FnOnce(&Trial<'_>) -> Result<Vec<BothTrials>, E>) -> Result<Guide, E> {
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
            return Ok(guide);
        }
        let guide = Arc::new(guide);
        let pays = match Trial::new(&integrator, training.samples, &guide) {
            Some(trial) => trial.pays(&paint(&trial)?),
            None => false,
        };
        Ok(Arc::unwrap_or_clone(guide).going_by_worth(pays))
    }
}

/// Learns what guides the paths of a picture, if nobody has yet, with others who paint it. Does nothing for pictures that
/// learn nothing.
///
/// # Errors
/// There is no such picture, or it was left before its end.
pub fn learn_together(
    prepared: &PreparedScene,
    prepass: &Prepass,
    view: View,
    settings: &PathSettings,
    others: &dyn Sharing,
) -> Result<(), RenderError> {
    let integrator = PathIntegrator::unguided(prepared, view, settings)?;
    if integrator.is_to_learn(view) && !prepass.has_guide(view, settings) {
        let guide = integrator.learn(view, |trial| trial.together(others))?;
        prepass.guide(view, settings, || guide);
    }
    Ok(())
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
