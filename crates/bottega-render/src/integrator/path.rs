//! Path tracing with next-event estimation and multiple importance sampling.
//!
//! Sources: Kajiya 1986, *The Rendering Equation*; Veach 1997, *Robust Monte Carlo Methods for Light Transport
//! Simulation*, chapters 8 to 10.

use std::sync::Arc;

use bottega_image::SampleValues;
use bottega_kernels::{Hit, Ray, math};
use bottega_scene::{MediumId, Spectrum, Surface};
use glam::{Vec2, Vec3};

use super::volume;
use crate::{
    PathSettings, PreparedScene, RenderError, View,
    bsdf::{Bsdf, BsdfAt, BsdfSample, LobeFlags, SurfacePoint, scattering, warp::ONE_MINUS_EPSILON},
    camera::{CameraRay, CameraRays, RayCone},
    filter::FilterSampler,
    guide::{Guide, Region, Trail, train},
    interaction::{Interaction, emitted, is_there, sphere_uv},
    lights::{LightSample, Receiver},
    sampler::{DimensionSet, PixelSampler, Quad},
    settings::DirectLight,
};

/// Greatest probability with which a path survives Russian roulette.
pub(super) const ROULETTE_SURVIVAL_MAX: f32 = 0.95;
/// How far from its target a shadow ray ends, as a share of its length.
pub(super) const SHADOW_MARGIN: f32 = 1e-4;
/// Cost of a vertex, in traversal steps.
const VERTEX_STEPS: f32 = 8.0;
/// Cost of a shadow ray in traversal steps, where they are not counted.
const SHADOW_STEPS: f32 = 8.0;
/// Sets the numbers that choose between blended surfaces apart from those that decide on opacity.
pub(super) const BLEND: u64 = 0x9e37_79b9_7f4a_7c15;
/// Bounces of the paths that the guide learns from.
const LEARNING_DEPTH: u32 = 24;
/// Seed of the paths that the guide learns from, which no picture shares: what is learnt must not know the picture's
/// samples.
const LEARNING_SEED: u64 = 0x6775_6964_655f_7365;
/// A picture of fewer pixels gives too few paths to learn from: with a poor guide its noise would grow.
const GUIDED_PIXELS_MIN: u64 = 128 * 128;
/// Growth of the beam after a scattering that spreads over one steradian.
pub(super) const SCATTERED_SPREAD: f32 = 0.05;

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
    /// Whether its radiance was not finite, and counts as 0.
    pub(crate) is_dropped: bool,
}

/// Paints samples of one picture. Cheap to make: one for each block of work.
pub struct PathIntegrator<'a> {
    prepared: &'a PreparedScene,
    settings: &'a PathSettings,
    camera: CameraRays,
    camera_medium: Option<MediumId>,
    filter: FilterSampler,
    wanted: Wanted,
    guide: Option<Arc<Guide>>,
}

impl<'a> PathIntegrator<'a> {
    /// An integrator for the picture `view`.
    pub fn new(prepared: &'a PreparedScene, view: View, settings: &'a PathSettings) -> Result<Self, RenderError> {
        let cameras = &prepared.scene().cameras;
        let camera =
            cameras.get(view.camera).ok_or(RenderError::NoCamera { index: view.camera, count: cameras.len() })?;
        if view.width == 0 || view.height == 0 {
            return Err(RenderError::EmptyPicture { width: view.width, height: view.height });
        }
        let mut integrator = Self {
            prepared,
            settings,
            camera: CameraRays::new(camera, view.width, view.height),
            camera_medium: camera.medium,
            filter: FilterSampler::new(settings.filter),
            wanted: Wanted::default(),
            guide: None,
        };
        let is_worth_it = u64::from(view.width) * u64::from(view.height) >= GUIDED_PIXELS_MIN;
        if settings.guiding && is_worth_it && !prepared.needs_volume() {
            integrator.guide = Some(prepared.guide(view, || integrator.learn(view)));
        }
        Ok(integrator)
    }

    /// Traces paths all over the picture for a guide.
    fn learn(&self, view: View) -> Guide {
        let settings = PathSettings { max_depth: LEARNING_DEPTH, ..PathSettings::default() };
        let integrator = PathIntegrator {
            settings: &settings,
            camera: self.camera.clone(),
            filter: self.filter.clone(),
            guide: None,
            ..*self
        };
        let size = Vec2::new(view.width as f32, view.height as f32);
        train(u64::from(view.width) * u64::from(view.height), self.prepared.threads(), |guide, index, trail| {
            // One sequence of samples for the whole picture.
            let sampler = PixelSampler::new(LEARNING_SEED, 0, 0, index);
            let [x, y, lens_u, lens_v] = sampler.quad(DimensionSet::CAMERA);
            let ray = integrator.camera.ray(Vec2::new(x, y) * size, [lens_u, lens_v]);
            let record = integrator.follow(sampler, &ray, guide, Some(trail));
            record.values.radiance.into()
        })
    }

    #[must_use]
    pub(crate) fn with_wanted(self, wanted: Wanted) -> Self {
        Self { wanted, ..self }
    }

    /// One sample of the pixel (x, y). Radiance that is not finite counts as 0.
    pub fn sample(&self, x: u32, y: u32, sample_index: u32) -> SampleValues {
        self.trace(x, y, sample_index).values
    }

    pub(super) fn prepared(&self) -> &'a PreparedScene {
        self.prepared
    }

    pub(super) fn settings(&self) -> &'a PathSettings {
        self.settings
    }

    pub(super) fn wants_albedo(&self) -> bool {
        self.wanted.albedo
    }

    /// What the camera stands in.
    pub(super) fn camera_medium(&self) -> Option<MediumId> {
        self.camera_medium
    }

    /// Where a sample's path begins, and the factor with which the sample counts.
    pub(crate) fn camera_ray(&self, sampler: &PixelSampler, x: u32, y: u32) -> (CameraRay, f32) {
        let [filter_u, filter_v, lens_u, lens_v] = sampler.quad(DimensionSet::CAMERA);
        let ([dx, dy], factor) = self.filter.sample([filter_u, filter_v]);
        (self.camera.ray(Vec2::new(x as f32 + 0.5 + dx, y as f32 + 0.5 + dy), [lens_u, lens_v]), factor)
    }

    #[inline]
    pub(crate) fn trace(&self, x: u32, y: u32, sample_index: u32) -> PathRecord {
        let sampler = PixelSampler::new(self.settings.seed, x, y, sample_index);
        let (ray, factor) = self.camera_ray(&sampler, x, y);
        let mut record = if self.prepared.needs_volume() {
            volume::trace(self, sampler, &ray)
        } else {
            self.follow(sampler, &ray, self.guide.as_deref(), None)
        };
        record.values.radiance = record.values.radiance.map(|value| value * factor);
        record
    }

    #[inline]
    fn follow(
        &self,
        sampler: PixelSampler,
        ray: &CameraRay,
        guide: Option<&Guide>,
        trail: Option<&mut Trail>,
    ) -> PathRecord {
        let mut path = Path {
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
            previous: Previous { receiver: Receiver { p: ray.origin, n: Vec3::ZERO }, pdf: None },
            wants_albedo: self.wanted.albedo,
            record: PathRecord::default(),
        };
        while path.advance() {}
        path.finish()
    }
}

/// Where the path comes from, as far as multiple importance sampling must know.
#[derive(Clone, Copy)]
struct Previous {
    /// The point for which lights were sampled.
    receiver: Receiver,
    /// Density per solid angle of the direction taken; `None`: light sampling could not have found what comes.
    pdf: Option<f32>,
}

/// A path under way.
struct Path<'a> {
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
    previous: Previous,
    wants_albedo: bool,
    record: PathRecord,
}

impl Path<'_> {
    /// Goes to the next surface and scatters there. False when the path is at its end.
    #[inline]
    fn advance(&mut self) -> bool {
        let prepared = self.integrator.prepared;
        let hit = self.intersect();
        if hit.is_none() {
            self.add_environment();
            return false;
        }
        self.record.vertex_count += 1;
        if self.absorption != Spectrum::ZERO {
            self.throughput *= exp(-self.absorption * hit.t);
        }
        self.cone = self.cone.at(hit.t);
        let point = Interaction::new(prepared, &hit, self.origin, self.direction, self.cone);
        if self.depth == 0 {
            self.record_first(&point, hit.t);
        }
        let (material, known) = prepared.material(point.material);
        if let Surface::Unlit(color) = &material.surface {
            let color = color.eval(prepared.scene(), point.uvs, point.footprint) * point.color.truncate();
            self.radiance += self.throughput * color;
            self.record_albedo(color);
            return false;
        }
        if known.shines && material.emission_sides.has(point.front) {
            self.add_emission(&point);
        }
        let is_last = self.depth >= self.integrator.settings.max_depth;
        if is_last && !self.wants_albedo {
            return false;
        }
        let mut place = None;
        let chance = || self.sampler.hashed(BLEND ^ u64::from(self.depth) << 56 ^ u64::from(point.material));
        let bsdf = bsdf_at(prepared, &point, chance, &mut place);
        let wo = point.to_local(point.wo);
        let is_delta_only = bsdf.is_delta_only();
        if self.wants_albedo && (is_last || !is_delta_only) {
            self.record_albedo(bsdf.albedo(wo));
        }
        if is_last {
            return false;
        }
        let bsdf = bsdf.at_carrying(wo, self.throughput);
        let mut region = None;
        if !is_delta_only {
            if !known.transmits {
                region = self.guide.and_then(|guide| guide.at(point.p, point.frame[2]));
            }
            if let Some(trail) = &mut self.trail {
                trail.come(point.p, point.frame[2], self.throughput, self.radiance);
            }
            self.add_direct_light(&point, &bsdf, region);
        }
        self.scatter(&point, &bsdf, region)
    }

    #[inline]
    fn intersect(&mut self) -> Hit {
        let prepared = self.integrator.prepared;
        let ray = Ray::new(self.origin, self.direction);
        if self.integrator.wanted.cost {
            let mut steps = 0;
            let hit = prepared.accel().intersect_counted(&ray, &mut steps);
            self.record.values.cost += steps as f32 + VERTEX_STEPS;
            if !prepared.has_opacity() {
                return hit;
            }
        }
        if prepared.has_opacity() {
            prepared.accel().intersect_filtered(&ray, |hit| self.is_there(&ray, hit))
        } else {
            prepared.accel().intersect(&ray)
        }
    }

    /// Whether a candidate hit is to be taken. It depends on the segment of the path and on the surface alone, so all
    /// candidates of one ray may be asked in any order and more than once.
    fn is_there(&self, ray: &Ray, hit: &Hit) -> bool {
        is_there(self.integrator.prepared, ray, hit, || {
            let surface = u64::from(hit.instance) << 32 | u64::from(hit.primitive);
            self.sampler.hashed(surface ^ u64::from(self.depth) << 56)
        })
    }

    #[inline]
    fn is_occluded(&mut self, ray: &Ray) -> bool {
        let prepared = self.integrator.prepared;
        if self.integrator.wanted.cost && !prepared.has_opacity() {
            let mut steps = 0;
            let occluded = prepared.accel().occluded_counted(ray, &mut steps);
            self.record.values.cost += steps as f32;
            return occluded;
        }
        self.record.values.cost += SHADOW_STEPS;
        if prepared.has_opacity() {
            prepared.accel().occluded_filtered(ray, |hit| self.is_there(ray, hit))
        } else {
            prepared.accel().occluded(ray)
        }
    }

    fn add_environment(&mut self) {
        let prepared = self.integrator.prepared;
        let radiance = prepared.lights().environment_radiance(prepared.scene(), self.direction);
        if radiance != Spectrum::ZERO {
            let weight = self.found_by_bsdf(|from| prepared.lights().environment_pdf(from, self.direction));
            self.radiance += self.throughput * radiance * weight;
        }
    }

    /// Adds what a surface emits towards the path.
    fn add_emission(&mut self, point: &Interaction) {
        let prepared = self.integrator.prepared;
        let scene = &**prepared.scene();
        let hit = &point.hit;
        let radiance = match hit.sphere() {
            Some(sphere) => {
                let uv = sphere_uv(&scene.spheres[sphere as usize], point.ng);
                prepared.material(point.material).0.emission.eval(scene, [uv; 2], 0.0)
            }
            None => emitted(scene, hit.instance, hit.primitive, (hit.u, hit.v), 0.0),
        };
        if radiance == Spectrum::ZERO {
            return;
        }
        let weight = self.found_by_bsdf(|from| prepared.lights().hit_pdf(prepared, hit, from, point.p));
        self.radiance += self.throughput * radiance * weight;
    }

    /// The weight of light that the path ran into; `light_pdf` tells with which density light sampling would have
    /// found it from the point before.
    #[inline]
    fn found_by_bsdf(&self, light_pdf: impl FnOnce(&Receiver) -> f32) -> f32 {
        let settings = self.integrator.settings;
        let Some(pdf) = self.previous.pdf else { return 1.0 };
        match settings.direct_light {
            DirectLight::LightSampling => 0.0,
            DirectLight::BsdfSampling => 1.0,
            DirectLight::Combined => {
                power_heuristic(pdf, settings.light_samples.max(1) as f32 * light_pdf(&self.previous.receiver))
            }
        }
    }

    /// Next-event estimation.
    #[inline]
    fn add_direct_light(&mut self, point: &Interaction, bsdf: &BsdfAt<'_>, region: Option<&Region>) {
        let settings = self.integrator.settings;
        let prepared = self.integrator.prepared;
        if settings.direct_light == DirectLight::BsdfSampling || prepared.lights().is_empty() {
            return;
        }
        let count = settings.light_samples.max(1);
        let receiver = receiver(prepared, point);
        for part in 0..count {
            let u = self.sampler.split_quad(DimensionSet::light(self.depth), part, count);
            let Some(light) = prepared.lights().sample(prepared, &receiver, u) else { continue };
            let contribution = self.light_contribution(point, bsdf, region, &light, count as f32);
            if contribution != Spectrum::ZERO && !self.is_occluded(&shadow_ray(point, &light)) {
                self.radiance += self.throughput * contribution;
            }
        }
    }

    /// What one of `count` light samples adds if nothing is between.
    #[inline]
    fn light_contribution(
        &self,
        point: &Interaction,
        bsdf: &BsdfAt<'_>,
        region: Option<&Region>,
        light: &LightSample,
        count: f32,
    ) -> Spectrum {
        let wi = point.to_local(light.wi);
        // A shading normal must not let light through the real surface.
        if (wi.z > 0.0) != point.is_reflection(light.wi) {
            return Spectrum::ZERO;
        }
        let (value, bsdf_pdf) = bsdf.eval_pdf(wi);
        if value == Spectrum::ZERO {
            return Spectrum::ZERO;
        }
        let expected = count * light.pdf;
        let is_shared = !light.is_delta && self.integrator.settings.direct_light == DirectLight::Combined;
        let found = || region.map_or(bsdf_pdf, |region| mixed(region.share(), region.pdf(light.wi), bsdf_pdf));
        let weight = if is_shared { power_heuristic(expected, found()) } else { 1.0 };
        value * light.radiance * (wi.z.abs() * weight / expected)
    }

    /// Chooses where the path goes on. False when it ends here.
    #[inline]
    fn scatter(&mut self, point: &Interaction, bsdf: &BsdfAt<'_>, region: Option<&Region>) -> bool {
        let u = self.sampler.quad(DimensionSet::scattering(self.depth));
        let drawn = match region {
            Some(region) => guided_sample(point, bsdf, region, u),
            None => bsdf.sample(u[0], [u[1], u[2]]).map(|sample| (sample, sample.pdf)),
        };
        let Some((sample, bsdf_pdf)) = drawn else { return false };
        let wi = point.to_world(sample.wi);
        let is_reflection = point.is_reflection(wi);
        if (sample.wi.z > 0.0) != is_reflection {
            return false;
        }
        let is_delta = sample.is_delta();
        if let Some(trail) = &mut self.trail
            && !is_delta
        {
            trail.go(wi, bsdf_pdf, sample.pdf, self.radiance);
        }
        self.throughput *= sample.weight();
        if !is_reflection {
            let (material, known) = self.integrator.prepared.material(point.material);
            // Into the solid when the path came from its outside, else out of it.
            if !material.surface.is_thin() {
                self.absorption = known.absorption[usize::from(point.front)];
            }
            self.roulette_scale *= sample.eta * sample.eta;
        }
        if !is_delta {
            self.cone.spread = self.cone.spread.max(SCATTERED_SPREAD / sample.pdf.sqrt());
            if region.is_some() {
                self.roulette_scale *= sample.pdf / bsdf_pdf.max(1e-6);
            }
        }
        self.previous =
            Previous { receiver: receiver(self.integrator.prepared, point), pdf: (!is_delta).then_some(sample.pdf) };
        self.origin = point.ray_origin(wi);
        self.direction = wi;
        self.depth += 1;
        self.survives(u[3])
    }

    /// Russian roulette: a path goes on with the square root of what it still carries as its probability. With that part
    /// itself, error times vertices is up to an eighth larger (`bench/runs/2026-11-21-paths.txt`).
    #[inline]
    fn survives(&mut self, u: f32) -> bool {
        let carried = self.throughput.max_element() * self.roulette_scale;
        if carried <= 0.0 || carried.is_nan() {
            return false;
        }
        if self.depth <= self.integrator.settings.roulette_depth {
            return true;
        }
        let survival = carried.sqrt().min(ROULETTE_SURVIVAL_MAX);
        self.throughput /= survival;
        u < survival
    }

    fn record_first(&mut self, point: &Interaction, distance: f32) {
        let values = &mut self.record.values;
        values.alpha = 1.0;
        values.depth = distance;
        values.normal = point.frame[2].to_array();
    }

    fn record_albedo(&mut self, albedo: Spectrum) {
        if self.wants_albedo {
            self.record.values.albedo = albedo.to_array();
            self.wants_albedo = false;
        }
    }

    #[inline]
    fn finish(mut self) -> PathRecord {
        self.record.is_dropped = !self.radiance.is_finite();
        if !self.record.is_dropped {
            self.record.values.radiance = self.radiance.to_array();
        }
        self.record
    }
}

/// The scattering at a point; `chance` is asked for a number in [0, 1) where surfaces are blended. It is put into `place` if it was not known before.
#[inline]
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
        footprint: point.footprint,
        vertex_color: point.color,
        front: point.front,
        coat_normal: point.coat_normal,
        chance: if material.is_blended() { chance() } else { 0.0 },
    };
    place.insert(scattering(prepared.scene(), material, &point))
}

/// A surface's point as the lights see it.
#[inline]
fn receiver(prepared: &PreparedScene, point: &Interaction) -> Receiver {
    let n = if prepared.material(point.material).1.transmits { Vec3::ZERO } else { point.frame[2] };
    Receiver { p: point.p_outside, n }
}

/// The ray that asks whether a light is seen.
#[inline]
fn shadow_ray(point: &Interaction, light: &LightSample) -> Ray {
    let origin = point.ray_origin(light.wi);
    if light.distance.is_infinite() {
        return Ray::new(origin, light.wi);
    }
    // Aim at the light's point itself: from the shifted origin it lies in a slightly different direction.
    let target = point.p_outside + light.wi * light.distance;
    Ray { origin, t_min: 0.0, direction: target - origin, t_max: 1.0 - SHADOW_MARGIN }
}

/// Draws a direction by the guide or the BSDF, with the density of both together, and tells that of the BSDF as well.
#[inline]
fn guided_sample(point: &Interaction, bsdf: &BsdfAt<'_>, region: &Region, u: Quad) -> Option<(BsdfSample, f32)> {
    let share = region.share();
    if u[0] < share {
        let (wi, guide_pdf) = region.sample([u[1], u[2]]);
        let wi = point.to_local(wi);
        let (value, bsdf_pdf) = bsdf.eval_pdf(wi);
        let pdf = mixed(share, guide_pdf, bsdf_pdf);
        let lobe = LobeFlags::REFLECTION.union(LobeFlags::DIFFUSE);
        return (value != Spectrum::ZERO).then_some((BsdfSample { wi, value, pdf, lobe, eta: 1.0 }, bsdf_pdf));
    }
    let rest = ((u[0] - share) / (1.0 - share)).min(ONE_MINUS_EPSILON);
    let sample = bsdf.sample(rest, [u[1], u[2]])?;
    let guide_pdf = if sample.is_delta() { 0.0 } else { region.pdf(point.to_world(sample.wi)) };
    Some((BsdfSample { pdf: mixed(share, guide_pdf, sample.pdf), ..sample }, sample.pdf))
}

/// Density of a choice between the guide and the BSDF.
#[inline]
fn mixed(share: f32, guide_pdf: f32, bsdf_pdf: f32) -> f32 {
    share * guide_pdf + (1.0 - share) * bsdf_pdf
}

/// Weight of the strategy with density `chosen` against the one with density `other` (Veach 1997, eq. 9.13, β = 2).
#[inline]
fn power_heuristic(chosen: f32, other: f32) -> f32 {
    // By the ratio, so that squares of large densities do not overflow.
    let ratio = other / chosen;
    1.0 / (1.0 + ratio * ratio)
}

fn exp(v: Vec3) -> Vec3 {
    Vec3::new(math::exp(v.x), math::exp(v.y), math::exp(v.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_two_strategies_add_up_to_one() {
        for (a, b) in [(1.0, 2.0), (1e30, 1e-3), (1e-20, 1e20), (3.0, 0.0)] {
            assert!((power_heuristic(a, b) + power_heuristic(b, a) - 1.0).abs() < 1e-6, "{a} {b}");
        }
        assert_eq!(power_heuristic(1.0, f32::INFINITY), 0.0);
    }
}
