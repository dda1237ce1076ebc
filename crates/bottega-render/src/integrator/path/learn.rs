//! Paths from which a picture learns where light comes from, before any of it is painted.

use std::{convert::Infallible, sync::Arc};

use bottega_kernels::compiled::{self, Task};

use super::{
    super::record::PathRecord,
    setup::PathIntegrator,
    trial::{AllTrials, LEARNING_SEED, Trial},
};
use crate::{
    PathSettings, PreparedScene, Prepass, RenderError, Sharing, View,
    camera::CameraRay,
    guide::{FoundLight, Guide, LearningPath, PaintPlan, Trail, Training, train},
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
            integrator.take_plan(guide);
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
    fn learn<E>(&self, view: View, paint: impl FnOnce(&Trial<'_>) -> Result<Vec<AllTrials>, E>) -> Result<Guide, E> {
        let PathSettings { agents, guiding, .. } = *self.settings;
        let PathSettings { filter, planned_samples, .. } = *self.settings;
        let settings =
            PathSettings { max_depth: LEARNING_DEPTH, agents, guiding, filter, planned_samples, ..PathSettings::default() };
        let integrator = PathIntegrator {
            settings: &settings,
            camera: self.camera.clone(),
            filter: self.filter.clone(),
            guide: None,
            plan: None,
            ..*self
        };
        let size = self.size;
        let training = Training {
            samples: u64::from(view.width) * u64::from(view.height) * u64::from(self.settings.planned_samples),
            size: [view.width, view.height],
            lights: agents.any().then(|| self.prepared.lights()),
            threads: self.prepared.threads(),
        };
        let guide = train(&training, |guide, learning: LearningPath, trail| {
            let place = PixelSampler::new(LEARNING_SEED, 0, 0, learning.block).get_2d(DimensionSet::CAMERA) * size;
            let (x, y) = (place.x as u32, place.y as u32);
            let way = u64::from(learning.is_guided) << 33 | u64::from(learning.picture) << 32;
            let seed = LEARNING_SEED ^ way ^ u64::from(learning.block) << 34;
            let sampler = PixelSampler::new(seed, x, y, learning.sample);
            let (ray, _) = integrator.camera_ray(&sampler, x, y);
            let guide = guide.filter(|_| learning.is_guided);
            let record = compiled::run(FollowedPath { integrator: &integrator, sampler, ray: &ray, guide, trail });
            FoundLight { radiance: record.values.radiance.into(), place: integrator.place(x, y), work: record.work(guide.is_some()) as f32 }
        });
        let Some(guide) = guide.map(Arc::new) else { return Ok(Guide::default()) };
        let plan = match Trial::new(&integrator, training.samples, &guide) {
            Some(trial) => trial.plan(&paint(&trial)?),
            None => PaintPlan::default(),
        };
        Ok(Arc::unwrap_or_clone(guide).planned(plan))
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
