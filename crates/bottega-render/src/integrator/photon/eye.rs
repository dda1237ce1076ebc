//! One path from the camera, and those that it sends out to gather light.

mod gathering;
mod hands;
mod light;
mod maps;
mod spot;
mod surroundings;
mod walk;
mod ways;

use std::f32::consts::FRAC_1_PI;

use bottega_kernels::{Hit, Ray};
use bottega_scene::{Spectrum, Surface};
use glam::Vec3;

use super::{super::record::PathRecord, PhotonIntegrator};
use crate::{
    PreparedScene,
    ala::Agents,
    bsdf::Bsdf,
    camera::CameraRay,
    interaction::{Interaction, SurfaceQuery, is_there, shines},
    lights::Receiver,
    luminance,
    photon::{
        BOUNCES_KEPT, BounceShares, PhotonMaps,
        cache::{IrradianceCache, Surroundings},
        kept,
    },
    sampler::{DimensionSet, PixelSampler},
    shading::{BLEND, bsdf_at, exp, is_broad_sample, is_matte},
};

use gathering::{Aiming, Gathering};
pub(crate) use hands::Hands;
pub(super) use spot::Spot;
use walk::{ArrivalKind, LightShare, Place, Remainder, Walk, scatter, survives};

/// Bounces of a path that have numbers of their own before those of a gathering ray begin.
const VERTICES: u32 = 64;
/// A gathering ray that ends nearer than this, as a share of the reach of the map, goes on: the map is too coarse for what is
/// so near.
const NEAR: f32 = 0.35;

/// Cost of a surface that a path comes to, and of a shadow ray, in traversal steps.
const VERTEX_STEPS: f32 = 16.0;
const SHADOW_STEPS: f32 = 8.0;

/// What is known of the light in the scene.
#[derive(Clone, Copy)]
pub(crate) struct KnownLight<'a> {
    pub(crate) maps: &'a PhotonMaps,
    pub(crate) cache: Option<&'a IrradianceCache>,
    /// Who is asked, if the picture is one of agents; nobody while these are still looking around.
    pub(crate) agents: Option<&'a Agents>,
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
    fn add_shared(&mut self, light: Spectrum, behind: u32, shares: impl FnOnce(&Self) -> Option<BounceShares>) {
        self.radiance += light;
        if self.hands.by_bounces.is_none() {
            return;
        }
        let shares = shares(self);
        let Some(sums) = &mut self.hands.by_bounces else { return };
        match shares {
            Some(shares) => {
                shares
                    .as_slice()
                    .iter()
                    .zip(behind..)
                    .for_each(|(share, bounces)| sums[kept(bounces)] += light * *share);
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
        known: KnownLight<'a>,
        sampler: PixelSampler,
        hands: &'a mut Hands,
    ) -> Self {
        let KnownLight { maps, cache, agents } = known;
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
        self.record.keep(self.radiance, self.integrator.base.settings().sample_max);
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
            self.add(walk.throughput * walk.unknown * color, walk.depth);
            self.record.record_albedo(&mut self.wants_albedo, color);
            return false;
        }
        if known.shines && material.emission_sides.has(point.front) {
            self.add_emission(walk, &point);
        }
        walk.throughput *= std::mem::replace(&mut walk.unknown, 1.0);
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
                Remainder::Nothing => return false,
                Remainder::Lamps => (walk.is_short, walk.unknown) = (true, 0.0),
                Remainder::Light => {}
            }
        }
        if matches!(walk.comes, ArrivalKind::Camera)
            && bsdf.is_delta_only()
            && let Some(ways) = self.ways_worth_going(walk, &place)
        {
            return self.go_both_ways(walk, &place, ways);
        }
        let u = self.sampler.quad(DimensionSet::scattering(walk.vertex));
        // What is left for a path that comes to a surface from the camera is to go on over its mirrors.
        let only_mirrors = bsdf.has_non_delta() && matches!(walk.comes, ArrivalKind::Camera);
        match place.bsdf.sample(u[0], [u[1], u[2]]) {
            Some(sample) if !only_mirrors || sample.is_delta() => {
                if let Some(known) = surroundings.filter(|_| is_broad_sample(&sample)) {
                    self.add_from(walk, &place, &known, &sample, 1.0);
                    (walk.is_short, walk.unknown) = (true, 0.0);
                }
                let worth = self.worth(walk, &place, bsdf);
                scatter(prepared, walk, &place, &sample, 1.0) && survives(walk, worth, u[3])
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
    ) -> Remainder {
        let photons = &self.integrator.photons;
        let is_first = matches!(walk.comes, ArrivalKind::Camera);
        let (is_gathered, has_agents) = (self.is_gathered(), photons.agents.is_some());
        if !is_first && !has_agents {
            let is_near = distance < NEAR * self.maps.irradiance_reach_at(place.point.p);
            if is_gathered && is_matte(bsdf) && !is_near && self.add_known(walk, place, bsdf) {
                return Remainder::Nothing;
            }
        }
        let known = if has_agents && photons.indirect { self.surroundings(walk, place, bsdf) } else { None };
        let unknown = match photons.indirect {
            true if (is_first || has_agents) && known.is_none() => 1.0 - self.add_interpolated(walk, place, bsdf),
            true => 1.0,
            false => f32::from(u8::from(!is_matte(bsdf))),
        };
        let is_interpolated = unknown == 0.0;
        // Where all indirect light is known nothing is left that might run into lights.
        let is_end = is_interpolated && self.prepared.lights().are_all_found();
        let share = if is_end { LightShare::All } else { LightShare::Mis };
        let aiming = if is_first && !is_interpolated { self.aim(place, bsdf) } else { None };
        self.add_direct_light(walk, place, share, aiming);
        if self.bounces_left(walk) >= 2 {
            self.add_photons(walk, place, is_gathered);
        }
        if !is_first {
            *surroundings = known;
            return match (is_end, is_interpolated) {
                (true, _) => Remainder::Nothing,
                (false, true) => Remainder::Lamps,
                (false, false) => Remainder::Light,
            };
        }
        if let Some(known) = &known {
            self.add_surroundings(walk, place, known);
        }
        if !is_end {
            let is_short = is_interpolated || !is_gathered || !photons.indirect;
            // As many as what is left is worth.
            let count = if is_short { 1 } else { (photons.final_rays as f32 * unknown).ceil().max(1.0) as u32 };
            self.gather(walk, place, &Gathering { count, is_short, unknown, is_known: known.is_some(), aiming });
        }
        // A matte surface has no mirrors for the path to go on over.
        if is_matte(bsdf) { Remainder::Nothing } else { Remainder::Light }
    }

    /// Sends out rays that look for light, each of them to its end.
    fn gather(&mut self, walk: &Walk, place: &Place<'_>, how: &Gathering<'_>) {
        let Gathering { count, is_known, .. } = *how;
        for part in 0..count {
            let u = self.sampler.split_quad(DimensionSet::scattering(VERTICES + walk.vertex), part, count);
            let Some((sample, density)) = how.drawn(place, u) else { continue };
            if sample.is_delta() {
                continue;
            }
            let is_short = how.is_short || (is_known && is_broad_sample(&sample));
            let unknown = if is_known && is_short { 0.0 } else { how.unknown };
            let mut ray = Walk { vertex: VERTICES * (2 + walk.depth * count + part), is_short, unknown, ..*walk };
            if scatter(self.prepared, &mut ray, place, &sample, 1.0 / count as f32) {
                ray.redraw(sample.pdf, density);
                while self.step(&mut ray) {}
            }
        }
    }

    fn intersect(&self, ray: &Ray, vertex: u32) -> Hit {
        if self.prepared.has_opacity() {
            self.prepared.accel().intersect_filtered(ray, |hit| self.is_there(ray, hit, vertex, SurfaceQuery::Path))
        } else {
            self.prepared.accel().intersect(ray)
        }
    }

    /// What a camera sees that does not see what shines.
    fn intersect_unlit(&self, ray: &Ray) -> Hit {
        let is_seen = |hit: &Hit| !shines(self.prepared, hit) && self.is_there(ray, hit, 0, SurfaceQuery::Path);
        self.prepared.accel().intersect_filtered(ray, is_seen)
    }

    fn is_there(&self, ray: &Ray, hit: &Hit, vertex: u32, asks: SurfaceQuery) -> bool {
        let asks = asks.of_vertex(vertex);
        is_there(self.prepared, ray, hit, asks, |surface| {
            self.sampler.hashed(surface ^ u64::from(vertex) << 56 ^ u64::from(vertex) >> 8)
        })
    }

    fn is_occluded(&mut self, ray: &Ray, vertex: u32) -> bool {
        self.record.counts.shadow_rays += 1;
        if self.prepared.has_opacity() {
            self.prepared.accel().occluded_filtered(ray, |hit| self.is_there(ray, hit, vertex, SurfaceQuery::Shadow))
        } else {
            self.prepared.accel().occluded(ray)
        }
    }

    /// The chance with which a path is worth going on at a surface, as far as agents can tell: what it can bring from there, over a part of
    /// what has been found so far. Whatever they say, those that go on stand for those that do not.
    fn worth(&self, walk: &Walk, place: &Place<'_>, bsdf: &Bsdf) -> f32 {
        /// What is worth a path of its own, as a share of what has been found.
        const PART: f32 = 0.05;
        const WORTH_MIN: f32 = 0.1;
        let ask = |agents: &Agents| agents.rough_irradiance_at(place.point.p, place.point.frame[2]);
        let Some(irradiance) = self.agents.filter(|_| !matches!(walk.comes, ArrivalKind::Camera)).and_then(ask) else {
            return 1.0;
        };
        let light = luminance(walk.throughput * bsdf.albedo(place.wo) * irradiance * FRAC_1_PI);
        let found = PART * luminance(self.radiance);
        if light < found { (light / found).max(WORTH_MIN) } else { 1.0 }
    }

    /// Where indirect light comes from to a surface that rays gather light for, if that is known and wanted.
    fn aim(&self, place: &Place<'_>, bsdf: &Bsdf) -> Option<Aiming<'a>> {
        let photons = &self.integrator.photons;
        // A lobe as narrow as that of a polished surface tells more than some hundred photons.
        const ROUGHNESS_MIN: f32 = 0.3;
        let is_wanted =
            photons.gather_directions && photons.indirect && self.is_gathered() && bsdf.roughness() >= ROUGHNESS_MIN;
        if !is_wanted || bsdf.is_transmissive() {
            return None;
        }
        let normal = if place.point.front { place.point.ng } else { -place.point.ng };
        let arrival = self.maps.arrival_at(place.point.p, [normal, place.point.frame[2]])?;
        Some(Aiming { arrival, is_matte: is_matte(bsdf) })
    }

    /// Whether light is gathered by rays.
    fn is_gathered(&self) -> bool {
        let photons = &self.integrator.photons;
        (photons.final_rays > 0 && !photons.progressive) || photons.agents.is_some()
    }
}
