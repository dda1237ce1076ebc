//! Path tracing with next-event estimation and multiple importance sampling.
//!
//! Sources: Kajiya 1986, *The Rendering Equation*; Veach 1997, *Robust Monte Carlo Methods for Light Transport
//! Simulation*, chapters 8 to 10.

mod branch;
mod guidance;
mod learn;
mod light;
mod scatter;
mod setup;
mod state;
mod suspended;
mod trial;
mod vertex;

use bottega_kernels::{Hit, Ray};
use bottega_scene::{ColorParam, Spectrum, Surface};
use glam::Vec3;

use super::record::PathRecord;
use crate::{
    bsdf::Bsdf,
    camera::CameraRay,
    guide::{Guide, Trail},
    interaction::Interaction,
    lights::Receiver,
    sampler::{DimensionSet, PixelSampler, Quad},
    segment::SegmentRays,
    surfaces::PreparedMaterial,
    vertex::{SurfaceVertex, attenuate, bsdf_at_vertex, receiver_at},
};
pub(super) use guidance::Guidance;
use guidance::NO_LEAF;
pub(crate) use learn::LEARNING_STAGES;
pub use learn::learn_together;
pub use setup::PathIntegrator;
pub(super) use setup::PlannedWays;
use state::Previous;
pub(super) use state::{BRANCHES_MAX, Branch, Path};
pub(super) use suspended::{DeferredLight, SuspendedPath};
use vertex::PathVertex;

/// Cost of a path vertex in [`SampleValues::cost`](bottega_image::SampleValues::cost), in traversal steps.
const VERTEX_STEPS: f32 = 8.0;
/// Cost of a shadow ray whose traversal steps are not counted, in traversal steps.
const SHADOW_STEPS: f32 = 8.0;

impl PathIntegrator<'_> {
    /// Starts a path at the camera ray `ray`.
    ///
    /// - `guide`: guides the directions; `None`: the BSDF alone draws them.
    /// - `trail`: records the vertices for learning.
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
            groups: None,
        }
    }
}

impl Path<'_> {
    /// Moves the path to the hit of its ray, and adds the light that it finds there. Returns the interaction; `None` when
    /// the path ends.
    ///
    /// - `hit`: the result of [`Self::intersect`].
    /// - `AGENTS`: use what agents learned.
    #[inline(always)]
    pub(super) fn arrive<const AGENTS: bool>(&mut self, hit: &Hit) -> Option<Interaction> {
        let before = self.radiance;
        // Add the environment if the ray left the scene
        if hit.is_none() {
            self.add_environment::<AGENTS>();
            self.split_branch::<AGENTS>(before);
            return None;
        }
        // Compute the interaction at the hit
        let point = self.interaction(hit);
        let (material, known) = self.integrator.prepared.material(point.material);
        // Add the color of an unlit surface and stop
        if let Surface::Unlit(color) = &material.surface {
            self.add_unlit(&point, color);
            self.split_branch::<AGENTS>(before);
            return None;
        }
        // Add emission
        if known.shines && material.emission_sides.has(point.front) {
            self.add_emission::<AGENTS>(&point);
        }
        self.mark_direct(before);
        // Stop at the maximum depth
        if self.is_last() && !self.wants_albedo {
            return None;
        }
        self.request_leaf(&point);
        Some(point)
    }

    /// Shades the vertex at which the path arrived, and draws the direction that leaves it. Returns `false` when the path
    /// ends.
    ///
    /// - `guidance`: the result of [`Self::look_up`].
    /// - `AGENTS`: use what agents learned; the path may then split, and all branches but the current one go to
    ///   `branches`.
    /// - `deferred`: receives the light samples, for the caller to test for occlusion before the path continues. Only where
    ///   surfaces let rays pass, and where the path is learned from, their shadow rays are traced here.
    #[inline(always)]
    pub(super) fn meet<const AGENTS: bool>(
        &mut self,
        point: &Interaction,
        guidance: Guidance<'_>,
        branches: &mut Vec<Branch>,
        deferred: &mut Vec<DeferredLight>,
    ) -> bool {
        let known = self.integrator.prepared.material(point.material).1;
        let is_last = self.is_last();
        // Evaluate the BSDF's parameters
        let mut storage = None;
        let bsdf = self.bsdf(point, known, &mut storage);
        let wo = point.to_local(point.wo);
        let is_delta_only = bsdf.is_delta_only();
        // Record the albedo of the first surface that is not a perfect mirror
        if self.wants_albedo && (is_last || !is_delta_only) {
            self.record.record_albedo(&mut self.wants_albedo, bsdf.albedo(wo));
        }
        if is_last {
            return false;
        }
        // Decide on the number of branches
        let [u_light, u_scattering] = self.numbers();
        let guidance = if is_delta_only { Guidance::NONE } else { guidance };
        let count =
            if AGENTS { self.split(guidance.agent(), u_scattering[3], BRANCHES_MAX - branches.len()) } else { 1 };
        if count == 0 {
            return false;
        }
        // Sample direct illumination and the next direction, once per branch
        let (receiver, bsdf) = (receiver_at(point, known), &bsdf.at_carrying(wo, self.throughput));
        let surface = SurfaceVertex { point, bsdf, receiver, wo };
        let vertex = PathVertex { surface, is_delta_only, guidance };
        if !is_delta_only && let Some(trail) = &mut self.trail {
            trail.record_vertex(point.p, point.frame[2], self.throughput, self.radiance);
        }
        self.leave::<AGENTS>(&vertex, [u_light, u_scattering], count, branches, deferred)
    }

    /// Returns `true` if the path scatters no more.
    #[inline(always)]
    fn is_last(&self) -> bool {
        self.depth >= self.integrator.settings.max_depth
    }

    /// Moves the path to a hit: applies absorption along the segment and widens the ray cone. Returns the interaction
    /// there.
    #[inline(always)]
    fn interaction(&mut self, hit: &Hit) -> Interaction {
        self.record.vertex_count += 1;
        attenuate(&mut self.throughput, self.absorption, hit.t);
        self.cone = self.cone.at(hit.t);
        let point = Interaction::new(self.integrator.prepared, hit, self.origin, self.direction, self.cone);
        if self.depth == 0 {
            self.record.record_first(self.start + hit.t, point.frame[2]);
        }
        point
    }

    /// Adds the color of an unlit surface, which takes no part in light transport.
    #[inline(always)]
    fn add_unlit(&mut self, point: &Interaction, color: &ColorParam) {
        let color = point.unlit(self.integrator.prepared.scene(), color);
        self.add_of_hit(&point.hit, self.throughput * color);
        self.record.record_albedo(&mut self.wants_albedo, color);
    }

    /// Records the radiance found so far as direct light, at the second vertex, if costs or direct light are wanted.
    ///
    /// - `before`: radiance before that of this vertex.
    #[inline(always)]
    fn mark_direct(&mut self, before: Spectrum) {
        let wanted = self.integrator.wanted;
        if self.depth == 1 && (wanted.cost | wanted.direct) {
            if wanted.direct {
                self.record.split_at_second(before, self.radiance);
            }
            if wanted.cost {
                self.record.mark_direct(self.radiance);
            }
        }
    }

    /// Records the direct light of a branch that ends at its second vertex: others may add indirect light later.
    #[inline(always)]
    fn split_branch<const AGENTS: bool>(&mut self, before: Spectrum) {
        if AGENTS && self.depth == 1 && self.integrator.wanted.direct {
            self.record.split_at_second(before, self.radiance);
        }
    }

    /// Returns the BSDF at a point: a shared constant one, or one evaluated from textures and stored in `storage`.
    #[inline(always)]
    fn bsdf<'b>(
        &mut self,
        point: &Interaction,
        known: &PreparedMaterial,
        storage: &'b mut Option<Bsdf<'b>>,
    ) -> &'b Bsdf<'b>
    where
        Self: 'b,
    {
        let bsdf = bsdf_at_vertex(self.integrator.prepared, point, &self.sampler, self.depth, storage);
        if self.integrator.wanted.cost {
            self.record.counts.meet(bsdf, known);
        }
        bsdf
    }

    /// Returns the random numbers of this vertex: for light sampling and for scattering.
    #[inline(always)]
    fn numbers(&self) -> [Quad; 2] {
        self.sampler.two_quads(DimensionSet::light(self.depth), DimensionSet::scattering(self.depth))
    }

    /// Samples direct illumination and scatters, `count` times; see [`Self::meet`]. Returns `false` when no branch
    /// continues here.
    #[inline(always)]
    fn leave<const AGENTS: bool>(
        &mut self,
        vertex: &PathVertex<'_>,
        [mut u_light, mut u_scattering]: [Quad; 2],
        count: u32,
        branches: &mut Vec<Branch>,
        deferred: &mut Vec<DeferredLight>,
    ) -> bool {
        let here = self.branch();
        let mut branch = 0;
        loop {
            // Sample direct illumination
            if !vertex.is_delta_only {
                self.add_direct_light::<AGENTS>(vertex, u_light, deferred);
            }
            // Sample the next direction
            let goes_on = self.scatter::<AGENTS>(vertex, u_scattering);
            branch += 1;
            if !AGENTS || branch >= count {
                return goes_on;
            }
            // Store this branch and start the next one from the same vertex
            if goes_on {
                branches.push(self.branch());
            }
            self.go_back(&here);
            self.sampler = here.sampler().branch(self.depth, branch);
            [u_light, u_scattering] = self.numbers();
        }
    }

    /// Prefetches the guide's data at a hit.
    #[inline(always)]
    pub(super) fn request_guide(&self, hit: &Hit) {
        if let Some(guide) = self.guide {
            guide.request(self.origin + self.direction * hit.t);
        }
    }

    /// Prefetches the guide's node for a point.
    #[inline(always)]
    fn request_leaf(&self, point: &Interaction) {
        if let Some(guide) = self.guide {
            guide.request_leaf(point.p, point.frame[2]);
        }
    }

    /// Traces the path's next ray; counts its traversal steps if costs are wanted. Returns the closest hit.
    #[inline(always)]
    pub(super) fn intersect(&mut self) -> Hit {
        let prepared = self.integrator.prepared;
        let t_max = if self.depth == 0 { self.reach } else { f32::INFINITY };
        let ray = Ray { t_max, ..Ray::new(self.origin, self.direction) };
        // Count traversal steps
        if self.integrator.wanted.cost {
            let mut steps = 0;
            let hit = prepared.accel().intersect_counted(&ray, &mut steps);
            self.record.values.cost += steps as f32 + VERTEX_STEPS;
            if !prepared.has_opacity() && !self.integrator.hides_emitters {
                return hit;
            }
        }
        // Filter hits on emitters hidden from the camera and on transparent parts of surfaces
        let rays = self.rays();
        if self.depth == 0 && self.integrator.hides_emitters {
            rays.intersect_unlit(&ray)
        } else {
            rays.intersect(&ray)
        }
    }

    /// Returns the rays that leave the path's current vertex.
    #[inline(always)]
    fn rays(&self) -> SegmentRays<'_> {
        SegmentRays::of_path(self.integrator.prepared, &self.sampler, self.depth)
    }

    /// Traces a shadow ray. Returns `true` if something opaque is hit.
    #[inline(always)]
    fn is_occluded(&mut self, ray: &Ray) -> bool {
        let prepared = self.integrator.prepared;
        if self.integrator.wanted.cost && !prepared.has_opacity() {
            let mut steps = 0;
            let occluded = prepared.accel().occluded_counted(ray, &mut steps);
            self.record.values.cost += steps as f32;
            return occluded;
        }
        self.record.values.cost += SHADOW_STEPS;
        self.rays().is_occluded(ray)
    }

    /// Returns the record of a path that has ended, multiplied by the factor of its sample.
    #[inline(always)]
    pub(super) fn finish(&mut self, factor: f32) -> PathRecord {
        let kept = self.record.keep(self.radiance, self.integrator.settings.sample_max);
        if let Some(groups) = &mut self.groups {
            groups.scale(kept * factor);
        }
        self.record.scaled(factor)
    }
}
