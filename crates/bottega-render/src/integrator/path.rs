//! Path tracing with next-event estimation and multiple importance sampling.
//!
//! Sources: Kajiya 1986, *The Rendering Equation*; Veach 1997, *Robust Monte Carlo Methods for Light Transport
//! Simulation*, chapters 8 to 10.

mod branch;
pub(super) mod light;
mod scatter;
mod trial;

use std::sync::Arc;

use bottega_image::SampleValues;
use bottega_kernels::{
    Hit, Ray,
    compiled::{self, Task},
    math,
};
use bottega_scene::{MediumId, Spectrum, Surface};
use glam::{Vec2, Vec3};

use super::{turns::Painting, volume};
use crate::{
    PathSettings, PreparedScene, Prepass, RenderError, View,
    bsdf::{Bsdf, SurfacePoint, scattering},
    camera::{CameraRay, CameraRays, RayCone},
    filter::FilterSampler,
    guide::{Guide, Trail, Training, train},
    interaction::{Asks, Interaction, is_there, shines},
    lights::{Choice, Receiver},
    luminance,
    prepare::PreparedMaterial,
    sampler::{DimensionSet, PixelSampler},
};
pub(super) use branch::{BRANCHES_MAX, Branch};

/// Greatest probability with which a path survives Russian roulette.
pub const ROULETTE_SURVIVAL_MAX: f32 = 0.95;
/// How far from its target a shadow ray ends, as a share of its length.
pub const SHADOW_MARGIN: f32 = 1e-4;
/// Cost of a vertex, in traversal steps.
const VERTEX_STEPS: f32 = 8.0;
/// Cost of a shadow ray in traversal steps, where they are not counted.
const SHADOW_STEPS: f32 = 8.0;
/// Sets the numbers that choose between blended surfaces apart from those that decide on opacity.
pub const BLEND: u64 = 0x9e37_79b9_7f4a_7c15;
/// Where the depth of a vertex begins in the keys of both.
pub const DEPTH_SHIFT: u32 = 56;
/// Bounces of the paths that the guide learns from.
const LEARNING_DEPTH: u32 = 24;
/// Seed of the paths that the guide learns from, which no picture shares: what is learnt must not know the picture's
/// samples.
const LEARNING_SEED: u64 = 0x6775_6964_655f_7365;
/// Growth of the beam after a scattering that spreads over one steradian.
pub const SCATTERED_SPREAD: f32 = 0.05;

/// Which values beside radiance a sample is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Wanted {
    pub(crate) albedo: bool,
    pub(crate) cost: bool,
}

/// What came of one path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PathRecord {
    pub(crate) values: SampleValues,
    /// Surfaces that it met.
    pub(crate) vertex_count: u32,
    /// What else it took, if that was asked for.
    pub(crate) counts: PathCounts,
    /// Luminance found before light could come over more than one scattering; `None` when the path ended there, or when what
    /// it took was not asked for.
    direct: Option<f32>,
    /// Whether its radiance was not finite, and counts as 0.
    pub(crate) is_dropped: bool,
}

/// What a path takes beside its traversal steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PathCounts {
    /// Rays towards lights.
    pub(crate) shadow_rays: u32,
    /// Vertices at surfaces of several lobes, which are dearer to evaluate than a single one.
    pub(crate) layered: u32,
    /// Textures of the surfaces at its vertices.
    pub(crate) lookups: u32,
}

impl PathCounts {
    /// Counts a vertex.
    #[inline(always)]
    pub(super) fn meet(&mut self, bsdf: &Bsdf, known: &PreparedMaterial) {
        self.layered += u32::from(bsdf.is_layered());
        self.lookups += u32::from(known.texture_count);
    }
}

impl PathRecord {
    /// With `factor` times the radiance.
    #[inline(always)]
    pub(super) fn scaled(mut self, factor: f32) -> Self {
        self.values.radiance = self.values.radiance.map(|value| value * factor);
        self.direct = self.direct.map(|value| value * factor);
        self
    }

    /// Takes in what the path found, when it is at its end.
    #[inline(always)]
    pub(super) fn keep(&mut self, radiance: Spectrum) {
        self.is_dropped = !radiance.is_finite();
        if !self.is_dropped {
            self.values.radiance = radiance.to_array();
        }
    }

    /// Marks all that was found so far as direct light; only the first mark counts.
    #[inline(always)]
    pub(super) fn mark_direct(&mut self, radiance: Spectrum) {
        self.direct.get_or_insert(luminance(radiance));
    }

    /// Luminance that came over more than one scattering.
    pub(crate) fn indirect(&self) -> f32 {
        let found = luminance(self.values.radiance.into());
        self.direct.map_or(0.0, |direct| (found - direct).max(0.0))
    }
}

/// Paints samples of one picture. Cheap to make: one for each block of work.
pub struct PathIntegrator<'a> {
    prepared: &'a PreparedScene,
    settings: &'a PathSettings,
    camera: CameraRays,
    /// Of the picture, in pixels.
    size: Vec2,
    camera_medium: Option<MediumId>,
    /// Whether the camera does not see what shines.
    hides_emitters: bool,
    filter: FilterSampler,
    wanted: Wanted,
    guide: Option<Arc<Guide>>,
    /// Whether agents decide where paths end, and where they go on as several.
    splits: bool,
    /// Whether agents decide how often to look whether a light is seen.
    looks_rarely: bool,
}

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

    /// One whose paths learn nothing.
    pub(crate) fn unguided(
        prepared: &'a PreparedScene,
        view: View,
        settings: &'a PathSettings,
    ) -> Result<Self, RenderError> {
        let cameras = &prepared.scene().cameras;
        let camera =
            cameras.get(view.camera).ok_or(RenderError::NoCamera { index: view.camera, count: cameras.len() })?;
        if view.width == 0 || view.height == 0 {
            return Err(RenderError::EmptyPicture { width: view.width, height: view.height });
        }
        Ok(Self {
            prepared,
            settings,
            camera: CameraRays::new(camera, view.width, view.height),
            size: Vec2::new(view.width as f32, view.height as f32),
            camera_medium: camera.medium,
            hides_emitters: camera.hides_emitters,
            filter: FilterSampler::new(settings.filter),
            wanted: Wanted::default(),
            guide: None,
            splits: false,
            looks_rarely: false,
        })
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
            let path = Followed { integrator: &integrator, sampler, ray: &ray, guide, trail };
            (compiled::run(path).values.radiance.into(), [x, y])
        });
        if !(agents.roulette || agents.shadows) {
            return guide;
        }
        let guide = Arc::new(guide);
        let pays = self.prepared.on_threads(|| integrator.worth_pays(training.samples, &guide));
        Arc::unwrap_or_clone(guide).going_by_worth(pays)
    }

    #[must_use]
    pub(crate) fn with_wanted(self, wanted: Wanted) -> Self {
        Self { wanted, ..self }
    }

    /// One sample of the pixel (x, y). Radiance that is not finite counts as 0.
    pub fn sample(&self, x: u32, y: u32, sample_index: u32) -> SampleValues {
        let mut records = Vec::new();
        compiled::run(Painting { integrator: self, samples: &[(x, y, sample_index)], records: &mut records });
        records.first().copied().unwrap_or_default().values
    }

    pub(super) fn prepared(&self) -> &'a PreparedScene {
        self.prepared
    }

    pub(super) fn settings(&self) -> &'a PathSettings {
        self.settings
    }

    pub(super) fn wanted(&self) -> Wanted {
        self.wanted
    }

    /// What the camera stands in.
    pub(super) fn camera_medium(&self) -> Option<MediumId> {
        self.camera_medium
    }

    /// Whether the camera does not see what shines.
    #[inline(always)]
    pub(super) fn hides_emitters(&self) -> bool {
        self.hides_emitters
    }

    /// Where a sample's path begins, and the factor with which the sample counts.
    #[inline(always)]
    pub(crate) fn camera_ray(&self, sampler: &PixelSampler, x: u32, y: u32) -> (CameraRay, f32) {
        let [filter_u, filter_v, lens_u, lens_v] = sampler.quad(DimensionSet::CAMERA);
        let ([dx, dy], factor) = self.filter.sample([filter_u, filter_v]);
        (self.camera.ray(Vec2::new(x as f32 + 0.5 + dx, y as f32 + 0.5 + dy), [lens_u, lens_v]), factor)
    }

    /// One sample in which media take part.
    pub(super) fn trace_volume(&self, x: u32, y: u32, sample_index: u32) -> PathRecord {
        let sampler = PixelSampler::new(self.settings.seed, x, y, sample_index);
        let (ray, factor) = self.camera_ray(&sampler, x, y);
        volume::trace(self, sampler, &ray).scaled(factor)
    }

    /// Where the middle of a pixel is in the picture, in [0, 1)².
    #[inline(always)]
    pub(super) fn place(&self, x: u32, y: u32) -> [f32; 2] {
        [(x as f32 + 0.5) / self.size.x, (y as f32 + 0.5) / self.size.y]
    }

    /// Whether paths cannot be followed in turn: those through media and panes are followed to their end in one go.
    #[inline(always)]
    pub(super) fn goes_alone(&self) -> bool {
        self.prepared.needs_volume() || self.prepared.has_panes()
    }

    /// Whether agents are asked for more than directions.
    #[inline(always)]
    pub(super) fn asks_agents(&self) -> bool {
        self.settings.agents.any() && self.guide.is_some()
    }

    #[inline(always)]
    pub(super) fn guide(&self) -> Option<&Guide> {
        self.guide.as_deref()
    }

    #[inline(always)]
    fn follow(
        &self,
        sampler: PixelSampler,
        ray: &CameraRay,
        guide: Option<&Guide>,
        trail: Option<&mut Trail>,
    ) -> PathRecord {
        let mut path = self.begin(sampler, ray, guide, trail);
        loop {
            let hit = path.intersect();
            if !path.meet::<false>(&hit, &mut Vec::new()) {
                return path.finish();
            }
        }
    }

    #[inline(always)]
    pub(super) fn begin<'b>(
        &'b self,
        sampler: PixelSampler,
        ray: &CameraRay,
        guide: Option<&'b Guide>,
        trail: Option<&'b mut Trail>,
    ) -> Path<'b> {
        Path {
            integrator: self,
            sampler,
            guide,
            trail,
            throughput: Spectrum::ONE,
            radiance: Spectrum::ZERO,
            absorption: Spectrum::ZERO,
            roulette_scale: 1.0,
            depth: 0,
            origin: ray.origin,
            direction: ray.direction,
            cone: ray.cone,
            start: ray.start,
            reach: ray.reach,
            previous: Previous { receiver: Receiver { p: ray.origin, n: Vec3::ZERO }, pdf: None, leaf: NO_LEAF },
            worth: 0.0,
            due: None,
            wants_albedo: self.wanted.albedo,
            record: PathRecord::default(),
        }
    }
}

/// A path that leaves a trail.
struct Followed<'a> {
    integrator: &'a PathIntegrator<'a>,
    sampler: PixelSampler,
    ray: &'a CameraRay,
    guide: Option<&'a Guide>,
    trail: &'a mut Trail,
}

impl Task for Followed<'_> {
    type Output = PathRecord;

    #[inline(always)]
    fn run(self) -> PathRecord {
        self.integrator.follow(self.sampler, self.ray, self.guide, Some(self.trail))
    }
}

/// Where the path comes from, as far as multiple importance sampling must know.
#[derive(Clone, Copy)]
struct Previous {
    /// The point for which lights were sampled.
    receiver: Receiver,
    /// Density per solid angle of the direction taken; `None`: light sampling could not have found what comes.
    pdf: Option<f32>,
    /// The leaf of the guide whose agent chose among lights there; [`NO_LEAF`]: none did.
    leaf: u32,
}

/// See [`Previous`].
const NO_LEAF: u32 = u32::MAX;

/// A path under way.
pub(super) struct Path<'a> {
    integrator: &'a PathIntegrator<'a>,
    sampler: PixelSampler,
    guide: Option<&'a Guide>,
    /// Where it is to be written down, to learn from it.
    trail: Option<&'a mut Trail>,
    throughput: Spectrum,
    radiance: Spectrum,
    /// Of the solid that the path is in.
    absorption: Spectrum,
    /// By how much the throughput is smaller than what the surfaces left of the light: because radiance was squeezed into
    /// a denser solid, or because the path was guided to where more light comes from than elsewhere.
    roulette_scale: f32,
    depth: u32,
    origin: Vec3,
    direction: Vec3,
    cone: RayCone,
    /// Where the camera's ray starts and how far it reaches, see [`CameraRay`].
    start: f32,
    reach: f32,
    previous: Previous,
    /// What a unit of light is worth to the pixel; 0: nobody knows.
    worth: f32,
    /// How much of one look at lights is due, below 1, on all branches together; `None`: no light was left out so far.
    due: Option<f32>,
    wants_albedo: bool,
    record: PathRecord,
}

impl Path<'_> {
    /// Comes to the next surface and scatters there. False when the path is at its end.
    ///
    /// - `AGENTS`: whether agents are asked; paths may then go on as several, of which all but one wait in `branches`.
    #[inline(always)]
    pub(super) fn meet<const AGENTS: bool>(&mut self, hit: &Hit, branches: &mut Vec<Branch>) -> bool {
        let prepared = self.integrator.prepared;
        if hit.is_none() {
            self.add_environment::<AGENTS>();
            return false;
        }
        self.record.vertex_count += 1;
        if self.absorption != Spectrum::ZERO {
            self.throughput *= exp(-self.absorption * hit.t);
        }
        self.cone = self.cone.at(hit.t);
        let point = Interaction::new(prepared, hit, self.origin, self.direction, self.cone);
        if self.depth == 0 {
            self.record_first(&point, self.start + hit.t);
        }
        let (material, known) = prepared.material(point.material);
        if let Surface::Unlit(color) = &material.surface {
            let color = point.unlit(prepared.scene(), color);
            self.radiance += self.throughput * color;
            self.record_albedo(color);
            return false;
        }
        if known.shines && material.emission_sides.has(point.front) {
            self.add_emission::<AGENTS>(&point);
        }
        if self.depth == 1 && self.integrator.wanted.cost {
            self.record.mark_direct(self.radiance);
        }
        let is_last = self.depth >= self.integrator.settings.max_depth;
        if is_last && !self.wants_albedo {
            return false;
        }
        let mut place = None;
        let chance = || self.sampler.hashed(BLEND ^ u64::from(self.depth) << DEPTH_SHIFT ^ u64::from(point.material));
        let bsdf = bsdf_at(prepared, &point, chance, &mut place);
        if self.integrator.wanted.cost {
            self.record.counts.meet(bsdf, known);
        }
        let wo = point.to_local(point.wo);
        let is_delta_only = bsdf.is_delta_only();
        if self.wants_albedo && (is_last || !is_delta_only) {
            self.record_albedo(bsdf.albedo(wo));
        }
        if is_last {
            return false;
        }
        let [mut u_light, mut u_scattering] =
            self.sampler.two_quads(DimensionSet::light(self.depth), DimensionSet::scattering(self.depth));
        let (mut region, mut agent, mut leaf) = (None, None, NO_LEAF);
        if AGENTS
            && !is_delta_only
            && let Some(guide) = self.guide
            && let Some(number) = guide.leaf(point.p, point.frame[2])
        {
            if self.integrator.settings.guiding && !known.transmits {
                region = guide.region(number);
            }
            agent = guide.agent(number);
            leaf = number as u32;
        }
        let count = if AGENTS { self.split(agent, u_scattering[3], BRANCHES_MAX - branches.len()) } else { 1 };
        if count == 0 {
            return false;
        }
        let bsdf = bsdf.at_carrying(wo, self.throughput);
        let n = if known.transmits { Vec3::ZERO } else { point.frame[2] };
        let receiver = Receiver { p: point.p_outside, n };
        if !is_delta_only {
            // (Closures are not compiled for the vector unit: there are none where it is busy.)
            if let (Some(guide), false, false) = (self.guide, known.transmits, AGENTS) {
                region = guide.at(point.p, point.frame[2]);
            }
            if let Some(trail) = &mut self.trail {
                trail.come(point.p, point.frame[2], self.throughput, self.radiance);
            }
        }
        let here = self.branch();
        let mut branch = 0;
        loop {
            if !is_delta_only {
                self.add_direct_light::<AGENTS>(&point, &receiver, &bsdf, region, agent, u_light);
            }
            let goes_on = self.scatter::<AGENTS>(&point, receiver, &bsdf, region, leaf, u_scattering);
            branch += 1;
            if !AGENTS || branch >= count {
                return goes_on;
            }
            if goes_on {
                branches.push(self.branch());
            }
            self.go_back(&here);
            self.sampler = here.sampler().branch(self.depth, branch);
            [u_light, u_scattering] =
                self.sampler.two_quads(DimensionSet::light(self.depth), DimensionSet::scattering(self.depth));
        }
    }

    /// Asks memory for what the guide knows of a hit.
    #[inline(always)]
    pub(super) fn request_guide(&self, hit: &Hit) {
        if let Some(guide) = self.guide {
            guide.request(self.origin + self.direction * hit.t);
        }
    }

    #[inline(always)]
    pub(super) fn intersect(&mut self) -> Hit {
        let prepared = self.integrator.prepared;
        let t_max = if self.depth == 0 { self.reach } else { f32::INFINITY };
        let ray = Ray { t_max, ..Ray::new(self.origin, self.direction) };
        if self.integrator.wanted.cost {
            let mut steps = 0;
            let hit = prepared.accel().intersect_counted(&ray, &mut steps);
            self.record.values.cost += steps as f32 + VERTEX_STEPS;
            if !prepared.has_opacity() && !self.integrator.hides_emitters {
                return hit;
            }
        }
        if self.depth == 0 && self.integrator.hides_emitters {
            let is_seen = |hit: &Hit| !shines(prepared, hit) && self.is_there(&ray, hit, Asks::Path);
            prepared.accel().intersect_filtered(&ray, is_seen)
        } else if prepared.has_opacity() {
            prepared.accel().intersect_filtered(&ray, |hit| self.is_there(&ray, hit, Asks::Path))
        } else {
            prepared.accel().intersect(&ray)
        }
    }

    /// Whether a candidate hit is to be taken. It depends on the segment of the path and on the surface alone, so all
    /// candidates of one ray may be asked in any order and more than once.
    #[inline(always)]
    fn is_there(&self, ray: &Ray, hit: &Hit, asks: Asks) -> bool {
        let asks = asks.of_vertex(self.depth);
        is_there(self.integrator.prepared, ray, hit, asks, |surface| {
            self.sampler.hashed(surface ^ u64::from(self.depth) << DEPTH_SHIFT)
        })
    }

    #[inline(always)]
    fn is_occluded(&mut self, ray: &Ray) -> bool {
        let prepared = self.integrator.prepared;
        self.record.counts.shadow_rays += 1;
        if self.integrator.wanted.cost && !prepared.has_opacity() {
            let mut steps = 0;
            let occluded = prepared.accel().occluded_counted(ray, &mut steps);
            self.record.values.cost += steps as f32;
            return occluded;
        }
        self.record.values.cost += SHADOW_STEPS;
        if prepared.has_opacity() {
            prepared.accel().occluded_filtered(ray, |hit| self.is_there(ray, hit, Asks::Shadow))
        } else {
            prepared.accel().occluded(ray)
        }
    }

    #[inline(always)]
    fn record_first(&mut self, point: &Interaction, distance: f32) {
        let values = &mut self.record.values;
        values.alpha = 1.0;
        values.depth = distance;
        values.normal = point.frame[2].to_array();
    }

    #[inline(always)]
    fn record_albedo(&mut self, albedo: Spectrum) {
        if self.wants_albedo {
            self.record.values.albedo = albedo.to_array();
            self.wants_albedo = false;
        }
    }

    /// What is known of the lights where the path comes from.
    #[inline(always)]
    fn previous_choice(&self) -> Option<&Choice> {
        self.guide?.agent(self.previous.leaf as usize)?.lights()
    }

    #[inline(always)]
    pub(super) fn finish(&mut self) -> PathRecord {
        self.record.keep(self.radiance);
        self.record
    }
}

/// The scattering at a point; `chance` is asked for a number in [0, 1) where surfaces are blended. It is put into `place` if it was not known before.
#[inline(always)]
pub(crate) fn bsdf_at<'a>(
    prepared: &'a PreparedScene,
    point: &Interaction,
    chance: impl FnOnce() -> f32,
    place: &'a mut Option<Bsdf>,
) -> &'a Bsdf {
    let (material, known) = prepared.material(point.material);
    if let Some(sides) = &known.bsdfs
        && !point.is_colored
    {
        return &sides[usize::from(point.front)];
    }
    let point = SurfacePoint {
        uvs: point.uvs,
        spot: point.spot(),
        footprint: point.footprint,
        vertex_color: point.color,
        front: point.front,
        coat_normal: point.coat_normal,
        lifted: point.lifted,
        chance: if material.is_blended() { chance() } else { 0.0 },
    };
    place.insert(scattering(prepared.scene(), material, &point))
}

#[inline(always)]
pub(crate) fn exp(v: Vec3) -> Vec3 {
    Vec3::new(math::exp(v.x), math::exp(v.y), math::exp(v.z))
}
