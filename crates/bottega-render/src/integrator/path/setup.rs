//! The setup that all paths of a picture share.

use std::sync::Arc;

use bottega_scene::MediumId;
use glam::Vec2;

use super::super::record::Wanted;
use crate::{
    camera::{CameraRay, CameraRays},
    catchers::ShadowCatchers,
    error::RenderError,
    filter::FilterSampler,
    guide::{Guide, PaintingWay},
    prepare::PreparedScene,
    sampler::{DimensionSet, PixelSampler},
    settings::{PathSettings, View},
};

/// The path tracer of one picture. Cheap to create once its guide is learnt: one per block of work.
pub struct PathIntegrator<'a> {
    /// The prepared scene.
    pub(super) prepared: &'a PreparedScene,
    /// Settings of the picture.
    pub(super) settings: &'a PathSettings,
    /// Camera of the view.
    pub(super) camera: CameraRays,
    /// Size of the picture, in pixels.
    pub(super) size: Vec2,
    /// Medium that contains the camera; `None`: vacuum.
    pub(super) camera_medium: Option<MediumId>,
    /// `true`: the camera does not see emitters.
    pub(super) hides_emitters: bool,
    /// Share of the shutter's time for which a row is exposed, if rows are exposed one after another.
    pub(super) rolling_shutter: Option<f32>,
    /// Sampler of the pixel filter.
    pub(super) filter: FilterSampler,
    /// Optional values of each sample.
    pub(super) wanted: Wanted,
    /// Guide of all pixels; `None`: not guided, or guided by `plan`.
    pub(super) guide: Option<Arc<Guide>>,
    /// Guide whose plan picks the rendering way of each pixel; `None`: all pixels are rendered in one way.
    pub(super) plan: Option<Arc<Guide>>,
    /// Shadow catchers; `None`: there are none.
    pub(super) catchers: Option<&'a ShadowCatchers>,
    /// `true`: agents decide where paths end and where they split.
    pub(super) splits: bool,
    /// `true`: agents decide how often shadow rays are traced.
    pub(super) looks_rarely: bool,
}

impl<'a> PathIntegrator<'a> {
    /// Creates an integrator without a guide.
    ///
    /// # Errors
    /// [`RenderError::EmptyPicture`].
    pub(crate) fn unguided(
        prepared: &'a PreparedScene,
        view: &View,
        settings: &'a PathSettings,
    ) -> Result<Self, RenderError> {
        let camera = &*view.camera;
        if view.width == 0 || view.height == 0 {
            return Err(RenderError::EmptyPicture { width: view.width, height: view.height });
        }
        Ok(Self {
            prepared,
            settings,
            camera: CameraRays::new(camera, view.width, view.height).moving(prepared.motion().camera(camera)),
            size: Vec2::new(view.width as f32, view.height as f32),
            camera_medium: camera.medium,
            hides_emitters: camera.hides_emitters,
            rolling_shutter: camera.rolling_shutter,
            filter: FilterSampler::new(settings.filter),
            wanted: Wanted::default(),
            guide: None,
            plan: None,
            catchers: None,
            splits: false,
            looks_rarely: false,
        })
    }

    /// Takes over a learned guide: for the whole picture if its plan has one way, else zone by zone.
    pub(super) fn take_plan(&mut self, guide: Arc<Guide>) {
        match guide.plan().only_way() {
            Some(PaintingWay::Plain) => {}
            Some(way) => *self = self.in_way(way, &guide),
            None => self.plan = Some(guide),
        }
    }

    /// Returns a copy of this integrator that renders in the given way, with the given guide.
    pub(super) fn in_way(&self, way: PaintingWay, guide: &Arc<Guide>) -> Self {
        let agents = self.settings.agents;
        let by_worth = way == PaintingWay::ByWorth;
        Self {
            camera: self.camera.clone(),
            filter: self.filter.clone(),
            guide: (way != PaintingWay::Plain).then(|| Arc::clone(guide)),
            plan: None,
            splits: by_worth && agents.roulette,
            looks_rarely: by_worth && agents.shadows,
            ..*self
        }
    }

    /// Returns integrators for all ways, indexed by [`PaintingWay::number`]; `None`: this one renders all pixels.
    pub(in crate::integrator) fn ways(&self) -> Option<PlannedWays<'a>> {
        let guide = self.plan.as_ref()?;
        Some(PlannedWays { by_way: PaintingWay::ALL.map(|way| self.in_way(way, guide)), guide: Arc::clone(guide) })
    }

    /// Returns a copy of this integrator with other settings, such as another seed.
    pub(in crate::integrator) fn with_settings(&self, settings: &'a PathSettings) -> Self {
        Self {
            settings,
            camera: self.camera.clone(),
            filter: self.filter.clone(),
            guide: self.guide.clone(),
            plan: self.plan.clone(),
            ..*self
        }
    }

    /// Returns `true` if paths look up a guide, at least in some zones.
    pub(in crate::integrator) fn is_guided(&self) -> bool {
        self.guide.is_some() || self.plan.is_some()
    }

    /// Returns this integrator with other optional values requested.
    #[must_use]
    pub(crate) fn with_wanted(self, wanted: Wanted) -> Self {
        Self { wanted, ..self }
    }

    /// Returns this integrator with shadow catchers.
    #[must_use]
    pub(in crate::integrator) fn with_catchers(self, catchers: Option<&'a ShadowCatchers>) -> Self {
        Self { catchers, ..self }
    }

    /// Returns the shadow catchers; `None`: there are none.
    pub(in crate::integrator) fn catchers(&self) -> Option<&'a ShadowCatchers> {
        self.catchers
    }

    /// Returns the scene.
    pub(in crate::integrator) fn prepared(&self) -> &'a PreparedScene {
        self.prepared
    }

    /// Returns the settings.
    pub(in crate::integrator) fn settings(&self) -> &'a PathSettings {
        self.settings
    }

    /// Returns the rays of the camera.
    pub(in crate::integrator) fn camera(&self) -> &CameraRays {
        &self.camera
    }

    /// Returns which optional values are requested.
    pub(in crate::integrator) fn wanted(&self) -> Wanted {
        self.wanted
    }

    /// Returns the medium that contains the camera; `None`: vacuum.
    pub(in crate::integrator) fn camera_medium(&self) -> Option<MediumId> {
        self.camera_medium
    }

    /// Returns `true` if the camera does not see emitters.
    #[inline(always)]
    pub(in crate::integrator) fn hides_emitters(&self) -> bool {
        self.hides_emitters
    }

    /// Samples the camera ray of a pixel, by the pixel filter and the lens. Returns the ray and the factor of the
    /// sample.
    #[inline(always)]
    pub(crate) fn camera_ray(&self, sampler: &PixelSampler, x: u32, y: u32) -> (CameraRay, f32) {
        let [filter_u, filter_v, lens_u, lens_v] = sampler.quad(DimensionSet::CAMERA);
        let ([dx, dy], factor) = self.filter.sample([filter_u, filter_v]);
        let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let ray = self.camera.ray_of_pixel(center, Vec2::new(dx, dy), [lens_u, lens_v]);
        (ray, factor * ray.weight)
    }

    /// Samples the camera ray of a pixel as [`Self::camera_ray`], with the camera as it is at a time.
    pub(crate) fn camera_ray_at(&self, sampler: &PixelSampler, x: u32, y: u32, time: f32) -> (CameraRay, f32) {
        let [filter_u, filter_v, lens_u, lens_v] = sampler.quad(DimensionSet::CAMERA);
        let ([dx, dy], factor) = self.filter.sample([filter_u, filter_v]);
        let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let ray = self.camera.ray_at(center, Vec2::new(dx, dy), [lens_u, lens_v], time);
        (ray, factor * ray.weight)
    }

    /// Returns the time of a sample of a row, from 0 to 1, for a time while the shutter is open. They differ if rows are
    /// exposed one after another.
    pub(in crate::integrator) fn time_of_row(&self, time: f32, y: u32) -> f32 {
        match self.rolling_shutter {
            None => time,
            Some(exposure) => (y as f32 + 0.5) / self.size.y * (1.0 - exposure) + time * exposure,
        }
    }

    /// Returns the centre of a pixel in the picture, in [0, 1)².
    #[inline(always)]
    pub(in crate::integrator) fn place(&self, x: u32, y: u32) -> [f32; 2] {
        [(x as f32 + 0.5) / self.size.x, (y as f32 + 0.5) / self.size.y]
    }

    /// Returns `true` if paths must be traced one by one to their end: those through media and panes, those that must
    /// know the kind of their last event, those that have a time, and those that may meet shadow catchers.
    #[inline(always)]
    pub(in crate::integrator) fn goes_alone(&self) -> bool {
        self.prepared.needs_volume()
            || self.prepared.has_panes()
            || self.prepared.tells_bounces_apart()
            || self.prepared.moves()
            || self.catchers.is_some()
    }

    /// Returns `true` if agents are used for more than directions.
    #[inline(always)]
    pub(in crate::integrator) fn asks_agents(&self) -> bool {
        self.settings.agents.any() && self.guide.is_some()
    }

    /// Returns the guide; `None`: not guided.
    #[inline(always)]
    pub(in crate::integrator) fn guide(&self) -> Option<&Guide> {
        self.guide.as_deref()
    }
}

/// Integrators of a picture whose zones are rendered in different ways.
pub(in crate::integrator) struct PlannedWays<'a> {
    by_way: [PathIntegrator<'a>; PaintingWay::ALL.len()],
    guide: Arc<Guide>,
}

impl<'a> PlannedWays<'a> {
    /// Returns the integrator of a pixel.
    #[inline(always)]
    pub(in crate::integrator) fn of_pixel(&self, x: u32, y: u32) -> &PathIntegrator<'a> {
        let plain = &self.by_way[0];
        let way = self.guide.plan().at(plain.place(x, y));
        &self.by_way[way.number()]
    }

    /// Returns the integrator of all the samples; `None`: they use different ones.
    pub(in crate::integrator) fn of_all(&self, samples: &[(u32, u32, u32)]) -> Option<&PathIntegrator<'a>> {
        let way = |&(x, y, _): &(u32, u32, u32)| self.guide.plan().at(self.by_way[0].place(x, y));
        let first = way(samples.first()?);
        samples.iter().all(|sample| way(sample) == first).then(|| &self.by_way[first.number()])
    }
}
