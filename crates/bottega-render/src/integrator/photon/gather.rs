//! A camera path of photon mapping, and the final gathering rays that it sends out.

mod buffers;
mod directions;
mod light;
mod maps;
mod record_point;
mod state;
mod surroundings;
mod ways;

use bottega_kernels::{Hit, Ray};
use bottega_scene::{Spectrum, Surface};

use super::{super::record::PathRecord, PhotonIntegrator};
use crate::{
    ala::Agents,
    bsdf::Bsdf,
    camera::CameraRay,
    density::SolidAnglePdf,
    interaction::Interaction,
    photon::{
        BOUNCES_KEPT, BounceShares, PhotonMaps,
        cache::{IrradianceCache, Surroundings},
        kept,
    },
    prepare::PreparedScene,
    sampler::{DimensionSet, PixelSampler},
    segment::SegmentRays,
    shading::{is_broad_sample, is_matte},
    vertex::{SurfaceVertex, attenuate, bsdf_at_vertex, receiver_at},
};

pub(crate) use buffers::GatherBuffers;
use directions::{GatherSettings, IncidentSampling};
pub(super) use record_point::RecordPoint;
use state::{ArrivalKind, GatherState, LightShare, Remainder, scatter, survives};

/// Number of vertices of a camera path with their own random numbers; those of gathering rays follow.
const VERTICES: u32 = 64;
/// Least length of a gathering ray, as a share of the map's radius. Shorter rays continue: the map is too coarse for such
/// distances.
const NEAR: f32 = 0.35;

/// Cost of a vertex and of a shadow ray, in traversal steps.
const VERTEX_STEPS: f32 = 16.0;
const SHADOW_STEPS: f32 = 8.0;

/// The light that was computed before the picture.
#[derive(Clone, Copy)]
pub(crate) struct KnownLight<'a> {
    /// Photon maps of the pass.
    pub(crate) maps: &'a PhotonMaps,
    /// Irradiance cache; `None`: not used.
    pub(crate) cache: Option<&'a IrradianceCache>,
    /// Lighting agents; `None`: the picture has none, or they are still being cast.
    pub(crate) agents: Option<&'a Agents>,
}

impl GatherPath<'_> {
    /// Adds light that scattered `bounces` times.
    #[inline(always)]
    pub(super) fn add(&mut self, light: Spectrum, bounces: u32) {
        self.radiance += light;
        if bounces <= 1 {
            self.record.add_direct(light);
        }
        if let Some(sums) = &mut self.buffers.by_bounces {
            sums[kept(bounces)] += light;
        }
    }

    /// Adds light that scattered at least `behind` times.
    ///
    /// - `shares`: returns how the light divides by number of bounces; called only if that is wanted.
    #[inline(always)]
    fn add_shared(&mut self, light: Spectrum, behind: u32, shares: impl FnOnce(&Self) -> Option<BounceShares>) {
        self.radiance += light;
        if self.buffers.by_bounces.is_none() {
            return;
        }
        let shares = shares(self);
        let Some(sums) = &mut self.buffers.by_bounces else { return };
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

    /// Returns how often light that arrives at a surface may have scattered, including the scattering there.
    #[inline(always)]
    fn bounces_left(&self, state: &GatherState) -> u32 {
        self.integrator.base.settings().max_depth.saturating_sub(state.depth)
    }
}

/// A camera path: one sample of a pixel.
pub(super) struct GatherPath<'a> {
    integrator: &'a PhotonIntegrator<'a>,
    prepared: &'a PreparedScene,
    maps: &'a PhotonMaps,
    cache: Option<&'a IrradianceCache>,
    agents: Option<&'a Agents>,
    sampler: PixelSampler,
    buffers: &'a mut GatherBuffers,
    radiance: Spectrum,
    wants_albedo: bool,
    record: PathRecord,
}

impl<'a> GatherPath<'a> {
    /// Creates the path of one sample, with empty sums.
    #[inline(always)]
    pub(super) fn new(
        integrator: &'a PhotonIntegrator<'a>,
        known: KnownLight<'a>,
        sampler: PixelSampler,
        buffers: &'a mut GatherBuffers,
    ) -> Self {
        let KnownLight { maps, cache, agents } = known;
        Self {
            integrator,
            prepared: integrator.base.prepared(),
            maps,
            cache,
            agents,
            sampler,
            buffers,
            radiance: Spectrum::ZERO,
            wants_albedo: integrator.base.wanted().albedo,
            record: PathRecord::split(),
        }
    }

    /// Traces the sample of a camera ray, with all its gathering rays.
    #[inline(always)]
    pub(super) fn trace(mut self, ray: &CameraRay) -> PathRecord {
        debug_assert!(self.integrator.camera_medium().is_none());
        let mut state = GatherState::of_camera(ray);
        while self.step(&mut state) {}
        self.record.keep(self.radiance, self.integrator.base.settings().sample_max);
        let (vertices, shadow_rays) = (self.record.vertex_count as f32, self.record.counts.shadow_rays as f32);
        self.record.values.cost = vertices * VERTEX_STEPS + shadow_rays * SHADOW_STEPS;
        self.record
    }

    /// Traces the next ray of a path. Returns `false` when the path ends.
    fn step(&mut self, state: &mut GatherState) -> bool {
        let t_max = std::mem::replace(&mut state.reach, f32::INFINITY);
        let ray = Ray { t_max, ..Ray::new(state.origin, state.direction) };
        let hides_emitters = state.vertex == 0 && self.integrator.base.hides_emitters();
        // Intersect the ray with the scene
        let rays = self.rays(state.vertex);
        let hit = if hides_emitters { rays.intersect_unlit(&ray) } else { rays.intersect(&ray) };
        // Add the environment if the ray left the scene
        if hit.is_none() && hides_emitters {
            return false;
        }
        if hit.is_none() {
            self.add_environment(state);
            return false;
        }
        self.arrive(state, hit)
    }

    /// Shades the surface that was hit, and scatters the path. Returns `false` when the path ends.
    fn arrive(&mut self, state: &mut GatherState, hit: Hit) -> bool {
        self.record.vertex_count += 1;
        // Attenuate, and compute the interaction at the hit
        attenuate(&mut state.throughput, state.absorption, hit.t);
        state.cone = state.cone.at(hit.t);
        let prepared = self.prepared;
        let point = Interaction::new(prepared, &hit, state.origin, state.direction, state.cone);
        if state.vertex == 0 {
            self.record.record_first(state.start + hit.t, point.frame[2]);
        }
        // Add the color of an unlit surface and stop
        let (material, known) = prepared.material(point.material);
        if let Surface::Unlit(color) = &material.surface {
            let color = point.unlit(prepared.scene(), color);
            self.add(state.throughput * state.unknown * color, state.depth);
            self.record.record_albedo(&mut self.wants_albedo, color);
            return false;
        }
        // Add emission
        if known.shines && material.emission_sides.has(point.front) {
            self.add_emission(state, &point);
        }
        state.throughput *= std::mem::replace(&mut state.unknown, 1.0);
        // Stop at the maximum depth, or where only emission was looked for
        let is_last = state.depth >= self.integrator.base.settings().max_depth || state.is_short;
        if is_last && !self.wants_albedo {
            return false;
        }
        // Evaluate the BSDF's parameters
        let mut storage = None;
        let bsdf = bsdf_at_vertex(prepared, &point, &self.sampler, state.vertex, &mut storage);
        self.record.counts.meet(bsdf, known);
        let wo = point.to_local(point.wo);
        if self.wants_albedo && (is_last || !bsdf.is_delta_only()) {
            self.record.record_albedo(&mut self.wants_albedo, bsdf.albedo(wo));
        }
        if is_last {
            return false;
        }
        // Add direct, cached and gathered light at surfaces that are not specular
        let receiver = receiver_at(&point, known);
        let vertex = SurfaceVertex { point: &point, bsdf: &bsdf.at_carrying(wo, state.throughput), receiver, wo };
        let mut surroundings = None;
        if bsdf.has_non_delta() {
            match self.meet(state, &vertex, bsdf, hit.t, &mut surroundings) {
                Remainder::Nothing => return false,
                Remainder::Emission => (state.is_short, state.unknown) = (true, 0.0),
                Remainder::Light => {}
            }
        }
        if matches!(state.comes, ArrivalKind::Camera)
            && bsdf.is_delta_only()
            && let Some(ways) = self.ways_worth_going(state, &vertex)
        {
            return self.go_both_ways(state, &vertex, ways);
        }
        // Sample the BSDF and continue, if Russian roulette lets the path survive
        let u = self.sampler.quad(DimensionSet::scattering(state.vertex));
        // Camera paths continue only over the mirrors of a surface: the rest was gathered
        let only_mirrors = bsdf.has_non_delta() && matches!(state.comes, ArrivalKind::Camera);
        match vertex.bsdf.sample(u[0], [u[1], u[2]]) {
            Some(sample) if !only_mirrors || sample.is_delta() => {
                if let Some(known) = surroundings.filter(|_| is_broad_sample(&sample)) {
                    self.add_from(state, &vertex, &known, &sample, 1.0);
                    (state.is_short, state.unknown) = (true, 0.0);
                }
                scatter(prepared, state, &vertex, &sample, 1.0) && survives(state, u[3])
            }
            _ => false,
        }
    }

    /// Adds direct and cached light at a surface that is not specular. Returns the light that the rest of the path
    /// still has to find.
    ///
    /// - `distance`: length of the ray to the surface.
    /// - `surroundings`: receives the directional light that agents know, for the path's next direction.
    fn meet(
        &mut self,
        state: &GatherState,
        vertex: &SurfaceVertex<'_>,
        bsdf: &Bsdf<'_>,
        distance: f32,
        surroundings: &mut Option<Surroundings<'a>>,
    ) -> Remainder {
        let photons = &self.integrator.photons;
        // End a gathering ray at the photon map
        let is_first = matches!(state.comes, ArrivalKind::Camera);
        let (is_gathered, has_agents) = (self.is_gathered(), photons.agents.is_some());
        if !is_first && !has_agents {
            let is_near = distance < NEAR * self.maps.irradiance_reach_at(vertex.point.p);
            if is_gathered && is_matte(bsdf) && !is_near && self.add_known(state, vertex, bsdf) {
                return Remainder::Nothing;
            }
        }
        // Interpolate indirect light between agents or cache records
        let known = if has_agents && photons.indirect { self.surroundings(state, vertex, bsdf) } else { None };
        let unknown = match photons.indirect {
            true if (is_first || has_agents) && known.is_none() => 1.0 - self.add_interpolated(state, vertex, bsdf),
            true => 1.0,
            false => f32::from(u8::from(!is_matte(bsdf))),
        };
        let is_interpolated = unknown == 0.0;
        // End the path if light sampling finds all that is left
        let is_end = is_interpolated && self.prepared.lights().are_all_found();
        let share = if is_end { LightShare::All } else { LightShare::Mis };
        // Sample direct illumination
        let aiming = if is_first && !is_interpolated { self.aim(vertex, bsdf) } else { None };
        self.add_direct_light(state, vertex, share, aiming);
        // Add caustic photons
        if self.bounces_left(state) >= 2 {
            self.add_photons(state, vertex, is_gathered);
        }
        if !is_first {
            // Return what is left for a path that was scattered before
            *surroundings = known;
            return match (is_end, is_interpolated) {
                (true, _) => Remainder::Nothing,
                (false, true) => Remainder::Emission,
                (false, false) => Remainder::Light,
            };
        }
        // Add directional light from agents
        if let Some(known) = &known {
            self.add_surroundings(state, vertex, known);
        }
        if !is_end {
            // Gather the rest
            let is_short = is_interpolated || !is_gathered || !photons.indirect;
            // Trace rays in proportion to the unknown share
            let count = if is_short { 1 } else { (photons.final_rays as f32 * unknown).ceil().max(1.0) as u32 };
            self.gather(state, vertex, &GatherSettings { count, is_short, unknown, is_known: known.is_some(), aiming });
        }
        // Matte surfaces have no mirrors to continue over
        if is_matte(bsdf) { Remainder::Nothing } else { Remainder::Light }
    }

    /// Traces final gathering rays from a surface, each to its end.
    fn gather(&mut self, state: &GatherState, vertex: &SurfaceVertex<'_>, how: &GatherSettings<'_>) {
        let GatherSettings { count, is_known, .. } = *how;
        for part in 0..count {
            let u = self.sampler.split_quad(DimensionSet::scattering(VERTICES + state.vertex), part, count);
            // Draw a direction; perfect mirrors are followed by the path itself
            let Some((sample, density)) = how.drawn(vertex, u) else { continue };
            if sample.is_delta() {
                continue;
            }
            let is_short = how.is_short || (is_known && is_broad_sample(&sample));
            let unknown = if is_known && is_short { 0.0 } else { how.unknown };
            // Trace the ray to its end
            let mut ray =
                GatherState { vertex: VERTICES * (2 + state.depth * count + part), is_short, unknown, ..*state };
            if scatter(self.prepared, &mut ray, vertex, &sample, 1.0 / count as f32) {
                ray.redraw(SolidAnglePdf::new(sample.pdf), density);
                while self.step(&mut ray) {}
            }
        }
    }

    /// Returns the rays that leave a vertex. Vertices of gathering rays have numbers above 255.
    fn rays(&self, vertex: u32) -> SegmentRays<'_> {
        SegmentRays::of_path(self.prepared, &self.sampler, vertex).with_high_bits(vertex)
    }

    /// Traces a shadow ray. Returns `true` if something opaque is hit.
    fn is_occluded(&mut self, ray: &Ray, vertex: u32) -> bool {
        self.record.counts.shadow_rays += 1;
        self.rays(vertex).is_occluded(ray)
    }

    /// Returns the distribution of indirect light at a gathering surface, if it is wanted and the photons give one.
    fn aim(&self, vertex: &SurfaceVertex<'_>, bsdf: &Bsdf<'_>) -> Option<IncidentSampling<'a>> {
        let photons = &self.integrator.photons;
        // A lobe as narrow as that of a polished surface guides better than some hundred photons
        const ROUGHNESS_MIN: f32 = 0.3;
        let is_wanted =
            photons.gather_directions && photons.indirect && self.is_gathered() && bsdf.roughness() >= ROUGHNESS_MIN;
        if !is_wanted || bsdf.is_transmissive() {
            return None;
        }
        let normal = vertex.point.facing_ng();
        let arrival = self.maps.arrival_at(vertex.point.p, [normal, vertex.point.frame[2]])?;
        Some(IncidentSampling { arrival, is_matte: is_matte(bsdf) })
    }

    /// Returns `true` if indirect light is gathered by rays.
    fn is_gathered(&self) -> bool {
        let photons = &self.integrator.photons;
        (photons.final_rays > 0 && !photons.progressive) || photons.agents.is_some()
    }
}
