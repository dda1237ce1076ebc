//! Learning of a picture's guide from paths that are traced before rendering.

use std::{convert::Infallible, ops::Range, sync::Arc};

use bottega_kernels::compiled::{self, Task};
use glam::Vec2;

use super::{
    super::{record::PathRecord, turns::in_turn},
    setup::PathIntegrator,
    trial::{AllTrials, LEARNING_SEED, Trial},
};
use crate::{
    camera::CameraRay,
    error::RenderError,
    guide::{FoundLight, Guide, LearningBudget, LearningPath, PaintPlan, PaintingWay, Trail, Training},
    prepare::PreparedScene,
    prepass::Prepass,
    sampler::{DimensionSet, PixelSampler},
    settings::{PathSettings, View},
    sharing::Sharing,
};

/// Number of stages that [`learn_together`] shares, at most: one per trial.
pub(crate) const LEARNING_STAGES: u32 = 2;
/// Greatest number of bounces of the paths that the guide learns from.
const LEARNING_DEPTH: u32 = 24;

impl<'a> PathIntegrator<'a> {
    /// Creates the path tracer of the picture `view`, and learns its guide if the settings ask for one and `prepass`
    /// has none, which takes long.
    ///
    /// - `prepass`: belongs to `prepared`.
    ///
    /// # Errors
    /// [`RenderError::EmptyPicture`].
    pub fn new(
        prepared: &'a PreparedScene,
        prepass: &Prepass,
        view: &View,
        settings: &'a PathSettings,
    ) -> Result<Self, RenderError> {
        let mut integrator = Self::unguided(prepared, view, settings)?;
        if integrator.is_to_learn(view) {
            let learn = || integrator.learn(view, |trial, _| Ok::<_, Infallible>(trial.alone()));
            let guide = prepass.guide(view, settings, || learn().unwrap_or_else(|never| match never {}));
            integrator.take_plan(guide);
        }
        Ok(integrator)
    }

    /// Returns `true` if the picture needs a guide and the scene can learn one.
    fn is_to_learn(&self, view: &View) -> bool {
        let PathSettings { guiding, agents, planned_samples, .. } = *self.settings;
        (guiding || agents.any()) && self.prepared.can_learn(view, planned_samples)
    }

    /// Learns a guide, for as many passes as pay off, and plans where the picture uses it.
    ///
    /// - `paint`: renders the pixels of a trial; the second argument is the number of the trial, 0 or 1.
    fn learn<E>(&self, view: &View, paint: impl Fn(&Trial<'_>, u32) -> Result<Vec<AllTrials>, E>) -> Result<Guide, E> {
        let PathSettings { agents, guiding, filter, planned_samples, .. } = *self.settings;
        // Set up an integrator that follows paths without a guide, deeper than the picture's
        let max_depth = LEARNING_DEPTH;
        let settings = PathSettings { max_depth, agents, guiding, filter, planned_samples, ..PathSettings::default() };
        let integrator = PathIntegrator {
            settings: &settings,
            camera: self.camera.clone(),
            filter: self.filter.clone(),
            guide: None,
            plan: None,
            ..*self
        };
        // Plan the number of passes and of paths per pass from the samples of the whole picture
        let samples = view.pixel_count() * u64::from(planned_samples);
        let budget = LearningBudget::new(samples);
        let lights = agents.any().then(|| self.prepared.lights());
        let mut training = Training::new([view.width, view.height], lights);
        // Trace a pass: the first ones plainly, over pixels; later ones guided by earlier passes
        let follow = |training: &mut Training<'_>, passes: Range<u32>| {
            for pass in passes {
                let count = budget.paths(pass);
                if pass < budget.plain_passes() {
                    training.pass_of_pixels(count, |paths, trails| integrator.follow(None, paths, trails));
                } else {
                    let directions = training.directions();
                    training.pass(count, |paths, trails| integrator.follow(Some(&directions), paths, trails));
                }
            }
        };
        // Trace the passes before a guide exists, and measure the noise of their light
        let noise = self.prepared.on_threads(|| {
            follow(&mut training, 0..budget.plain_passes());
            training.noise()
        });
        // Stop where learning cannot pay off
        if !budget.goes_on(noise) {
            return Ok(Guide::default());
        }
        let mut taken = budget.plain_passes();
        // Long trainings: run a small trial first
        if let Some(before) = budget.passes_before_trial(noise) {
            let guide = self.prepared.on_threads(|| {
                follow(&mut training, taken..before);
                Arc::new(training.guide())
            });
            let trial = Trial::first(&integrator, samples, &guide);
            if !budget.is_promising(noise, trial.findings(&paint(&trial, 0)?).shown_ratio()) {
                return Ok(Guide::default());
            }
            taken = before;
        }
        let guide = self.prepared.on_threads(|| {
            // Trace the remaining passes
            follow(&mut training, taken..budget.passes(noise));
            Arc::new(training.guide())
        });
        // Run the trial that decides which way each zone takes
        let trial = Trial::last(&integrator, samples, &guide);
        let plan = trial.findings(&paint(&trial, 1)?).plan();
        Ok(settled(guide, plan))
    }

    /// Traces paths to learn from, and records their trails.
    fn follow(&self, guide: Option<&Guide>, paths: &[LearningPath], trails: &mut [Trail]) -> Vec<FoundLight> {
        let starts: Vec<LearningStart> = paths.iter().map(|&path| self.learning_start(path)).collect();
        let mut records = vec![PathRecord::default(); starts.len()];
        compiled::run(TrailBatch { integrator: self, guide, starts: &starts, trails, records: &mut records });
        let found = |(start, record): (&LearningStart, &PathRecord)| FoundLight {
            radiance: record.values.radiance.into(),
            place: start.place,
        };
        starts.iter().zip(&records).map(found).collect()
    }

    /// Samples the camera ray of a path to learn from.
    fn learning_start(&self, path: LearningPath) -> LearningStart {
        let place = |number| {
            // One sample sequence for the whole picture
            let sampler = PixelSampler::new(LEARNING_SEED, 0, 0, number);
            (sampler, sampler.quad(DimensionSet::CAMERA))
        };
        match path {
            LearningPath::Single(number) => {
                let (sampler, [x, y, lens_u, lens_v]) = place(number);
                let ray = self.camera.ray(Vec2::new(x, y) * self.size, [lens_u, lens_v]);
                LearningStart { sampler, ray, place: [x, y] }
            }
            LearningPath::OfPixel { number, picture, sample } => {
                let [x, y, ..] = place(number).1;
                let (x, y) = ((x * self.size.x) as u32, (y * self.size.y) as u32);
                // Distinct seeds: two paths may be of the same pixel
                let seed = LEARNING_SEED ^ (u64::from(number) << 1 | u64::from(picture)) << 32;
                let sampler = PixelSampler::new(seed, x, y, sample);
                LearningStart { sampler, ray: self.camera_ray(&sampler, x, y).0, place: self.place(x, y) }
            }
        }
    }
}

/// The start of a path to learn from.
struct LearningStart {
    sampler: PixelSampler,
    ray: CameraRay,
    /// Position in the picture, in [0, 1)².
    place: [f32; 2],
}

/// Returns the guide with its plan, or an empty guide if no zone uses it.
fn settled(guide: Arc<Guide>, plan: PaintPlan) -> Guide {
    match plan.only_way() {
        Some(PaintingWay::Plain) => Guide::default(),
        _ => Arc::unwrap_or_clone(guide).planned(plan),
    }
}

/// Learns the guide of a picture together with other machines that render it, if `prepass` has none. Does nothing for
/// pictures without guiding.
///
/// - `prepass`: belongs to `prepared`.
/// - `others`: the other machines, which must call this for the same picture.
///
/// # Errors
/// [`RenderError::EmptyPicture`], or an error of [`Sharing::share`], such as [`RenderError::Left`].
pub fn learn_together(
    prepared: &PreparedScene,
    prepass: &Prepass,
    view: &View,
    settings: &PathSettings,
    others: &dyn Sharing,
) -> Result<(), RenderError> {
    let integrator = PathIntegrator::unguided(prepared, view, settings)?;
    if integrator.is_to_learn(view) && !prepass.has_guide(view, settings) {
        let guide = integrator.learn(view, |trial, stage| trial.together(others, stage))?;
        prepass.guide(view, settings, || guide);
    }
    Ok(())
}

/// Paths that record their vertices into trails, one each.
struct TrailBatch<'a> {
    integrator: &'a PathIntegrator<'a>,
    /// Guide of the directions; `None`: the BSDF alone draws them.
    guide: Option<&'a Guide>,
    starts: &'a [LearningStart],
    trails: &'a mut [Trail],
    /// Receives the records, in the order of `starts`.
    records: &'a mut [PathRecord],
}

impl Task for TrailBatch<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { integrator, guide, starts, trails, records } = self;
        let waiting = starts.iter().zip(trails);
        let waiting =
            waiting.map(|(start, trail)| (integrator.begin(start.sampler, &start.ray, guide, Some(trail)), 1.0));
        in_turn::<false>(integrator.prepared, waiting, records);
    }
}
