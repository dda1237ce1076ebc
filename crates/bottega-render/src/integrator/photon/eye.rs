//! One path from the camera, and those that it sends out to gather light.

mod light;
mod surroundings;
mod walk;

use bottega_kernels::{Hit, Ray};
use bottega_scene::{Spectrum, Surface};
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

use super::{
    super::{record::PathRecord, transport::SCATTERED_SPREAD},
    PhotonIntegrator,
};
use crate::{
    PreparedScene,
    ala::{Agents, Tally},
    bsdf::Bsdf,
    camera::{CameraRay, RayCone},
    interaction::{Asks, Interaction, is_there, shines},
    lights::Receiver,
    photon::{
        Arrived, BOUNCES_KEPT, ByBounces, Nearest, PhotonMaps,
        cache::{self, IrradianceCache, Surroundings},
        kept,
    },
    sampler::{DimensionSet, PixelSampler},
    shading::{BLEND, bsdf_at, exp, is_broad_sample, is_matte},
};

use walk::{Comes, Left, LightShare, Place, Walk, is_sharp, scatter, survives};

/// Bounces of a path that have numbers of their own before those of a gathering ray begin.
const VERTICES: u32 = 64;
/// A gathering ray that ends nearer than this, as a share of the reach of the map, goes on: the map is too coarse for what is
/// so near.
const NEAR: f32 = 0.35;

/// Cost of a surface that a path comes to, and of a shadow ray, in traversal steps.
const VERTEX_STEPS: f32 = 16.0;
const SHADOW_STEPS: f32 = 8.0;

/// Where irradiance may be kept: a matte surface that is seen.
pub(super) struct Spot {
    point: Interaction,
    /// Width of the beam there.
    width: f32,
}

impl Spot {
    pub(super) fn new(point: Interaction, width: f32) -> Self {
        Self { point, width }
    }

    pub(super) fn p(&self) -> Vec3 {
        self.point.p
    }

    pub(super) fn n(&self) -> Vec3 {
        self.point.frame[2]
    }

    pub(super) fn width(&self) -> f32 {
        self.width
    }
}

/// What is known of the light in the scene.
#[derive(Clone, Copy)]
pub(crate) struct Known<'a> {
    pub(crate) maps: &'a PhotonMaps,
    pub(crate) cache: Option<&'a IrradianceCache>,
    /// Who is asked, if the picture is one of agents; nobody while these are still looking around.
    pub(crate) agents: Option<&'a Agents>,
}

/// What a thread works with, sample after sample.
pub(crate) struct Hands {
    found: Nearest,
    /// The irradiance sensors that were found.
    sensors: Nearest,
    /// What agents were asked.
    pub(crate) tally: Tally,
    /// What was found since it was last cleared, by number of bounces; if that is wanted.
    by_bounces: Option<Box<ByBounces>>,
}

impl Hands {
    pub(crate) fn new(integrator: &PhotonIntegrator<'_>) -> Self {
        Self::gathering(integrator.photons.gather)
    }

    /// For a sensor: the mean of its many rays needs no smooth caustics where they end.
    pub(crate) fn of_sensor(integrator: &PhotonIntegrator<'_>) -> Self {
        const GATHERED: u32 = 12;
        Self::gathering(integrator.photons.gather.min(GATHERED)).telling_bounces()
    }

    fn gathering(count: u32) -> Self {
        let found = Nearest::new(count as usize);
        Self { found, sensors: Nearest::new(Agents::SENSORS), tally: Tally::default(), by_bounces: None }
    }

    /// The same that keeps light apart by how often it was scattered.
    pub(crate) fn telling_bounces(self) -> Self {
        Self { by_bounces: Some(Box::new([Spectrum::ZERO; BOUNCES_KEPT])), ..self }
    }

    /// What was found, by number of bounces.
    pub(crate) fn bounces(&self) -> &ByBounces {
        const NOTHING: &ByBounces = &[Spectrum::ZERO; BOUNCES_KEPT];
        self.by_bounces.as_deref().unwrap_or(NOTHING)
    }

    /// Begins anew.
    pub(super) fn clear_bounces(&mut self) {
        self.by_bounces.iter_mut().for_each(|sums| sums.fill(Spectrum::ZERO));
    }

    /// Multiplies what was found by number of bounces.
    pub(super) fn scale_bounces(&mut self, factor: f32) {
        self.by_bounces.iter_mut().flat_map(|sums| sums.iter_mut()).for_each(|sum| *sum *= factor);
    }
}

impl Eye<'_> {
    /// Adds light that was scattered so often.
    #[inline(always)]
    pub(super) fn add(&mut self, light: Spectrum, bounces: u32) {
        self.radiance += light;
        if let Some(sums) = &mut self.hands.by_bounces {
            sums[kept(bounces)] += light;
        }
    }

    /// Adds light that comes to a place with so many bounces behind it.
    ///
    /// - `shares`: says how often the light has been scattered; asked where that is wanted.
    #[inline(always)]
    fn add_shared(&mut self, light: Spectrum, behind: u32, shares: impl FnOnce(&Self) -> Option<ByBounces>) {
        self.radiance += light;
        if self.hands.by_bounces.is_none() {
            return;
        }
        let shares = shares(self);
        let Some(sums) = &mut self.hands.by_bounces else { return };
        match shares {
            Some(shares) => {
                shares.iter().zip(behind..).for_each(|(share, bounces)| sums[kept(bounces)] += light * *share);
            }
            None => sums[BOUNCES_KEPT - 1] += light,
        }
    }

    /// How often light may have been scattered that a path finds at a surface, the scattering there among it.
    #[inline(always)]
    fn bounces_left(&self, walk: &Walk) -> u32 {
        self.integrator.base.settings().max_depth.saturating_sub(walk.depth)
    }
}

/// Who looks: one sample of a pixel.
pub(super) struct Eye<'a> {
    integrator: &'a PhotonIntegrator<'a>,
    prepared: &'a PreparedScene,
    maps: &'a PhotonMaps,
    cache: Option<&'a IrradianceCache>,
    agents: Option<&'a Agents>,
    sampler: PixelSampler,
    hands: &'a mut Hands,
    radiance: Spectrum,
    wants_albedo: bool,
    record: PathRecord,
}

impl<'a> Eye<'a> {
    #[inline(always)]
    pub(super) fn new(
        integrator: &'a PhotonIntegrator<'a>,
        known: Known<'a>,
        sampler: PixelSampler,
        hands: &'a mut Hands,
    ) -> Self {
        let Known { maps, cache, agents } = known;
        Self {
            integrator,
            prepared: integrator.base.prepared(),
            maps,
            cache,
            agents,
            sampler,
            hands,
            radiance: Spectrum::ZERO,
            wants_albedo: integrator.base.wanted().albedo,
            record: PathRecord::default(),
        }
    }

    #[inline(always)]
    pub(super) fn look(mut self, ray: &CameraRay) -> PathRecord {
        debug_assert!(self.integrator.camera_medium().is_none());
        let mut walk = Walk::of_camera(ray);
        while self.step(&mut walk) {}
        self.record.keep(self.radiance);
        let (vertices, shadow_rays) = (self.record.vertex_count as f32, self.record.counts.shadow_rays as f32);
        self.record.values.cost = vertices * VERTEX_STEPS + shadow_rays * SHADOW_STEPS;
        self.record
    }

    /// Goes to the next surface. False when the path is at its end.
    fn step(&mut self, walk: &mut Walk) -> bool {
        let t_max = std::mem::replace(&mut walk.reach, f32::INFINITY);
        let ray = Ray { t_max, ..Ray::new(walk.origin, walk.direction) };
        let hides_emitters = walk.vertex == 0 && self.integrator.base.hides_emitters();
        let hit = if hides_emitters { self.intersect_unlit(&ray) } else { self.intersect(&ray, walk.vertex) };
        if hit.is_none() && hides_emitters {
            return false;
        }
        if hit.is_none() {
            self.add_environment(walk);
            return false;
        }
        self.arrive(walk, hit)
    }

    /// Comes to a surface. False when the path is at its end.
    fn arrive(&mut self, walk: &mut Walk, hit: Hit) -> bool {
        self.record.vertex_count += 1;
        if walk.absorption != Spectrum::ZERO {
            walk.throughput *= exp(-walk.absorption * hit.t);
        }
        walk.cone = walk.cone.at(hit.t);
        let prepared = self.prepared;
        let point = Interaction::new(prepared, &hit, walk.origin, walk.direction, walk.cone);
        if walk.vertex == 0 {
            self.record.record_first(walk.start + hit.t, point.frame[2]);
        }
        let (material, known) = prepared.material(point.material);
        if let Surface::Unlit(color) = &material.surface {
            let color = point.unlit(prepared.scene(), color);
            self.add(walk.throughput * color, walk.depth);
            self.record.record_albedo(&mut self.wants_albedo, color);
            return false;
        }
        if known.shines && material.emission_sides.has(point.front) {
            self.add_emission(walk, &point);
        }
        let is_last = walk.depth >= self.integrator.base.settings().max_depth || walk.is_short;
        if is_last && !self.wants_albedo {
            return false;
        }
        let mut place = None;
        let chance = || self.sampler.hashed(BLEND ^ u64::from(walk.vertex) << 56 ^ u64::from(point.material));
        let bsdf = bsdf_at(prepared, &point, chance, &mut place);
        self.record.counts.meet(bsdf, known);
        let wo = point.to_local(point.wo);
        if self.wants_albedo && (is_last || !bsdf.is_delta_only()) {
            self.record.record_albedo(&mut self.wants_albedo, bsdf.albedo(wo));
        }
        if is_last {
            return false;
        }
        let n = if known.transmits { Vec3::ZERO } else { point.frame[2] };
        let receiver = Receiver { p: point.p_outside, n };
        let place = Place { point: &point, bsdf: &bsdf.at_carrying(wo, walk.throughput), receiver, wo };
        let mut surroundings = None;
        if bsdf.has_non_delta() {
            match self.meet(walk, &place, bsdf, hit.t, &mut surroundings) {
                Left::Nothing => return false,
                Left::Lamps => walk.is_short = true,
                Left::Light => {}
            }
        }
        let u = self.sampler.quad(DimensionSet::scattering(walk.vertex));
        // What is left for a path that comes to a surface from the camera is to go on over its mirrors.
        let only_mirrors = bsdf.has_non_delta() && matches!(walk.comes, Comes::Camera);
        match place.bsdf.sample(u[0], [u[1], u[2]]) {
            Some(sample) if !only_mirrors || sample.is_delta() => {
                if let Some(known) = surroundings.filter(|_| is_broad_sample(&sample)) {
                    self.add_from(walk, &place, &known, &sample, 1.0);
                    walk.is_short = true;
                }
                scatter(prepared, walk, &place, &sample, 1.0) && survives(walk, u[3])
            }
            _ => false,
        }
    }

    /// Adds the light that a surface spreads. What there is more to be had by going on.
    ///
    /// - `surroundings`: take what is known of light from all sides, for the path to go on with.
    fn meet(
        &mut self,
        walk: &Walk,
        place: &Place<'_>,
        bsdf: &Bsdf,
        distance: f32,
        surroundings: &mut Option<Surroundings<'a>>,
    ) -> Left {
        let photons = &self.integrator.photons;
        let is_first = matches!(walk.comes, Comes::Camera);
        let (is_gathered, has_agents) = (self.is_gathered(), photons.agents.is_some());
        if !is_first && !has_agents {
            let is_near = distance < NEAR * self.maps.irradiance_reach_at(place.point.p);
            if is_gathered && is_matte(bsdf) && !is_near && self.add_known(walk, place, bsdf) {
                return Left::Nothing;
            }
        }
        let is_known = !is_first && has_agents && {
            *surroundings = self.surroundings(walk, place, bsdf);
            surroundings.is_none() && self.add_interpolated(walk, place, bsdf)
        };
        // Where the path ends nothing is left that might run into lights.
        let is_end = is_known && self.prepared.lights().are_all_found();
        let share = if is_end { LightShare::All } else { LightShare::Mis };
        self.add_direct_light(walk, place, share);
        if self.bounces_left(walk) >= 2 {
            self.add_photons(walk, place, is_gathered);
        }
        if !is_first {
            return match (is_end, is_known) {
                (true, _) => Left::Nothing,
                (false, true) => Left::Lamps,
                (false, false) => Left::Light,
            };
        }
        let known = self.surroundings(walk, place, bsdf);
        if let Some(known) = &known {
            self.add_surroundings(walk, place, known);
        }
        let is_cached = known.is_none() && self.add_interpolated(walk, place, bsdf);
        let is_short = is_cached || !is_gathered;
        let count = if is_short { 1 } else { photons.final_rays.max(1) };
        self.gather(walk, place, count, is_short, known.is_some());
        Left::Light
    }

    /// Adds what a matte surface sends back of the indirect light that is known of places near it, if there is any.
    fn add_interpolated(&mut self, walk: &Walk, place: &Place<'_>, bsdf: &Bsdf) -> bool {
        let Some(agents) = self.agents else { return self.add_cached(walk, place, bsdf) };
        let point = place.point;
        let normals = [if point.front { point.ng } else { -point.ng }, point.frame[2]];
        let bounces = self.bounces_left(walk);
        let ask = || agents.irradiance_at(point.p, normals, bounces, &mut self.hands.sensors);
        let known = is_matte(bsdf).then(ask).flatten();
        self.hands.tally.irradiance_computed += u64::from(known.is_none());
        self.hands.tally.irradiance_interpolated += u64::from(known.is_some());
        if let Some(irradiance) = known.filter(|_| bounces >= 2) {
            let light = walk.throughput * bsdf.albedo(place.wo) * irradiance * FRAC_1_PI;
            self.add_shared(light, walk.depth, |_| agents.shares_at(point.p, normals[1], bounces));
        }
        known.is_some()
    }

    /// Adds what the photons at the place bring.
    fn add_photons(&mut self, walk: &Walk, place: &Place<'_>, is_gathered: bool) {
        let Place { point, bsdf, .. } = place;
        let normal = if point.front { point.ng } else { -point.ng };
        let (prepared, most) = (self.prepared, self.bounces_left(walk));
        let Hands { found, by_bounces, .. } = &mut *self.hands;
        let mut sum = Spectrum::ZERO;
        let take = |photon: &Arrived| {
            // It is scattered here once more.
            if photon.bounces >= most {
                return;
            }
            let wi = point.to_local(photon.to_light);
            // A photon that grazes the surface may seem to come from its other side.
            let is_sound = (wi.z > 0.0) == photon.is_before && photon.is_before == point.is_reflection(photon.to_light);
            let (f, pdf) = if is_sound { bsdf.eval_pdf(wi) } else { (Spectrum::ZERO, 0.0) };
            if is_gathered && is_sharp(prepared, pdf) {
                return;
            }
            let light = walk.throughput * f * photon.light;
            sum += light;
            if let Some(sums) = by_bounces {
                sums[kept(walk.depth + 1 + photon.bounces)] += light;
            }
        };
        let maps = self.maps;
        if self.integrator.photons.progressive {
            maps.estimator.gather_within(&maps.seen, point.p, normal, maps.reach_at(point.p), take);
        } else {
            // What is brought together by glass is sharper than what is spread all over.
            let reach = if is_gathered { maps.reach_at(point.p) } else { maps.irradiance_reach_at(point.p) };
            maps.estimator.gather(&maps.seen, point.p, normal, reach, found, take);
        }
        self.radiance += sum;
    }

    /// Adds what a matte surface sends back of all the light that the map knows there, if it knows any.
    fn add_known(&mut self, walk: &Walk, place: &Place<'_>, bsdf: &Bsdf) -> bool {
        let point = place.point;
        let normal = if point.front { point.ng } else { -point.ng };
        let Some(number) = self.maps.irradiance_near(point.p, normal) else { return false };
        let reflected = walk.throughput * bsdf.albedo(place.wo) * FRAC_1_PI;
        // It is scattered here once more.
        let most = self.bounces_left(walk).saturating_sub(1);
        let known = &self.maps.irradiance;
        self.radiance += reflected * known.irradiance(number, most);
        if let Some(sums) = &mut self.hands.by_bounces {
            for (light, bounces) in known.by_bounces(number).iter().zip(0..=most) {
                sums[kept(walk.depth + 1 + bounces)] += reflected * *light;
            }
        }
        true
    }

    /// Adds what a matte surface sends back of the indirect light that is kept for places near it, if there is any.
    fn add_cached(&mut self, walk: &Walk, place: &Place<'_>, bsdf: &Bsdf) -> bool {
        let Some(cache) = self.cache.filter(|_| is_matte(bsdf)) else { return false };
        let bounces = self.bounces_left(walk);
        let Some(irradiance) = cache.at(place.point.p, place.point.frame[2], bounces) else { return false };
        if bounces >= 2 {
            self.radiance += walk.throughput * bsdf.albedo(place.wo) * irradiance * FRAC_1_PI;
        }
        true
    }

    /// The first matte surface that is seen from the camera, over mirrors and through glass.
    pub(super) fn spot(&mut self, ray: &CameraRay) -> Option<Spot> {
        /// Mirrors on the way.
        const MIRRORS_MAX: u32 = 8;
        let prepared = self.prepared;
        let mut walk = Walk::of_camera(ray);
        for _ in 0..=MIRRORS_MAX {
            let t_max = std::mem::replace(&mut walk.reach, f32::INFINITY);
            let hit = self.intersect(&Ray { t_max, ..Ray::new(walk.origin, walk.direction) }, walk.vertex);
            if hit.is_none() {
                return None;
            }
            walk.cone = walk.cone.at(hit.t);
            let point = Interaction::new(prepared, &hit, walk.origin, walk.direction, walk.cone);
            let mut kept = None;
            let chance = || self.sampler.hashed(BLEND ^ u64::from(walk.vertex) << 56 ^ u64::from(point.material));
            let bsdf = bsdf_at(prepared, &point, chance, &mut kept);
            if bsdf.has_non_delta() {
                return is_matte(bsdf).then_some(Spot { width: walk.cone.width, point });
            }
            let wo = point.to_local(point.wo);
            let receiver = Receiver { p: point.p_outside, n: Vec3::ZERO };
            let place = Place { point: &point, bsdf: &bsdf.at(wo), receiver, wo };
            let u = self.sampler.quad(DimensionSet::scattering(walk.vertex));
            let sample = place.bsdf.sample(u[0], [u[1], u[2]])?;
            if !scatter(prepared, &mut walk, &place, &sample, 1.0) {
                return None;
            }
        }
        None
    }

    /// Indirect light that comes to a place from a direction, what shines there itself left out.
    pub(super) fn look_from(&mut self, spot: &Spot, direction: Vec3, index: u32) -> cache::Look {
        let point = &spot.point;
        let nothing = cache::Look { radiance: Spectrum::ZERO, distance: f32::INFINITY };
        if !point.is_reflection(direction) {
            return nothing;
        }
        let origin = point.ray_origin(direction);
        let hit = self.intersect(&Ray::new(origin, direction), 0);
        if hit.is_none() {
            return nothing;
        }
        let cone = RayCone { width: spot.width, spread: SCATTERED_SPREAD };
        let ray = CameraRay { origin, direction, cone, start: 0.0, reach: f32::INFINITY };
        let mut walk = Walk {
            depth: 1,
            vertex: VERTICES * (2 + index),
            comes: Comes::Mirrored { sharply: false },
            ..Walk::of_camera(&ray)
        };
        self.radiance = Spectrum::ZERO;
        let mut goes_on = self.arrive(&mut walk, hit);
        while goes_on {
            goes_on = self.step(&mut walk);
        }
        let radiance = if self.radiance.is_finite() { self.radiance } else { Spectrum::ZERO };
        cache::Look { radiance, distance: hit.t }
    }

    /// Sends out rays that look for light, each of them to its end.
    ///
    /// - `is_known`: whether light from directions that the surface scatters to broadly has been added.
    fn gather(&mut self, walk: &Walk, place: &Place<'_>, count: u32, is_short: bool, is_known: bool) {
        for part in 0..count {
            let u = self.sampler.split_quad(DimensionSet::scattering(VERTICES + walk.vertex), part, count);
            let Some(sample) = place.bsdf.sample(u[0], [u[1], u[2]]) else { continue };
            if sample.is_delta() {
                continue;
            }
            let is_short = is_short || (is_known && is_broad_sample(&sample));
            let mut ray = Walk { vertex: VERTICES * (2 + walk.depth * count + part), is_short, ..*walk };
            if scatter(self.prepared, &mut ray, place, &sample, 1.0 / count as f32) {
                while self.step(&mut ray) {}
            }
        }
    }

    fn intersect(&self, ray: &Ray, vertex: u32) -> Hit {
        if self.prepared.has_opacity() {
            self.prepared.accel().intersect_filtered(ray, |hit| self.is_there(ray, hit, vertex, Asks::Path))
        } else {
            self.prepared.accel().intersect(ray)
        }
    }

    /// What a camera sees that does not see what shines.
    fn intersect_unlit(&self, ray: &Ray) -> Hit {
        let is_seen = |hit: &Hit| !shines(self.prepared, hit) && self.is_there(ray, hit, 0, Asks::Path);
        self.prepared.accel().intersect_filtered(ray, is_seen)
    }

    fn is_there(&self, ray: &Ray, hit: &Hit, vertex: u32, asks: Asks) -> bool {
        let asks = asks.of_vertex(vertex);
        is_there(self.prepared, ray, hit, asks, |surface| {
            self.sampler.hashed(surface ^ u64::from(vertex) << 56 ^ u64::from(vertex) >> 8)
        })
    }

    fn is_occluded(&mut self, ray: &Ray, vertex: u32) -> bool {
        self.record.counts.shadow_rays += 1;
        if self.prepared.has_opacity() {
            self.prepared.accel().occluded_filtered(ray, |hit| self.is_there(ray, hit, vertex, Asks::Shadow))
        } else {
            self.prepared.accel().occluded(ray)
        }
    }

    /// Whether light is gathered by rays.
    fn is_gathered(&self) -> bool {
        let photons = &self.integrator.photons;
        (photons.final_rays > 0 && !photons.progressive) || photons.agents.is_some()
    }
}
