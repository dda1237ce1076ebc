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
    interaction::{Interaction, SurfaceQuery, is_there, shines},
    lights::Receiver,
    sampler::{DimensionSet, PixelSampler, Quad},
    shading::{BLEND, DEPTH_SHIFT, bsdf_at, exp},
    surfaces::PreparedMaterial,
};
use guidance::{Guidance, NO_LEAF};
pub use learn::learn_together;
pub use setup::PathIntegrator;
pub(super) use setup::PlannedWays;
use state::Previous;
pub(super) use state::{BRANCHES_MAX, Branch, Path};
pub(super) use suspended::{DeferredLight, SuspendedPath};
use vertex::PathVertex;

/// Cost of a vertex, in traversal steps.
const VERTEX_STEPS: f32 = 8.0;
/// Cost of a shadow ray in traversal steps, where they are not counted.
const SHADOW_STEPS: f32 = 8.0;

impl PathIntegrator<'_> {
    #[inline(always)]
    pub(super) fn follow(
        &self,
        sampler: PixelSampler,
        ray: &CameraRay,
        guide: Option<&Guide>,
        trail: Option<&mut Trail>,
    ) -> PathRecord {
        let mut path = self.begin(sampler, ray, guide, trail);
        loop {
            let hit = path.intersect();
            if !path.meet::<false, false>(&hit, &mut Vec::new(), &mut Vec::new()) {
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

impl Path<'_> {
    /// Comes to the next surface and scatters there. False when the path is at its end.
    ///
    /// - `AGENTS`: whether agents are asked; paths may then go on as several, of which all but one wait in `branches`.
    /// - `DEFERS`: whether light that may be hidden is put into `deferred` for others to look, and not looked for at once.
    #[inline(always)]
    pub(super) fn meet<const AGENTS: bool, const DEFERS: bool>(
        &mut self,
        hit: &Hit,
        branches: &mut Vec<Branch>,
        deferred: &mut Vec<DeferredLight>,
    ) -> bool {
        if hit.is_none() {
            self.add_environment::<AGENTS>();
            return false;
        }
        let point = self.arrive(hit);
        let (material, known) = self.integrator.prepared.material(point.material);
        if let Surface::Unlit(color) = &material.surface {
            self.add_unlit(&point, color);
            return false;
        }
        if known.shines && material.emission_sides.has(point.front) {
            self.add_emission::<AGENTS>(&point);
        }
        self.mark_direct();
        let is_last = self.depth >= self.integrator.settings.max_depth;
        if is_last && !self.wants_albedo {
            return false;
        }
        let mut place = None;
        let bsdf = self.bsdf(&point, known, &mut place);
        let wo = point.to_local(point.wo);
        let is_delta_only = bsdf.is_delta_only();
        if self.wants_albedo && (is_last || !is_delta_only) {
            self.record.record_albedo(&mut self.wants_albedo, bsdf.albedo(wo));
        }
        if is_last {
            return false;
        }
        let [u_light, u_scattering] = self.numbers();
        let guidance = if is_delta_only { Guidance::NONE } else { self.guidance::<AGENTS>(&point, known) };
        let count =
            if AGENTS { self.split(guidance.agent(), u_scattering[3], BRANCHES_MAX - branches.len()) } else { 1 };
        if count == 0 {
            return false;
        }
        let n = if known.transmits { Vec3::ZERO } else { point.frame[2] };
        let receiver = Receiver { p: point.p_outside, n };
        let bsdf = &bsdf.at_carrying(wo, self.throughput);
        let vertex = PathVertex { point: &point, receiver, bsdf, is_delta_only, guidance };
        if !is_delta_only && let Some(trail) = &mut self.trail {
            trail.come(point.p, point.frame[2], self.throughput, self.radiance);
        }
        self.leave::<AGENTS, DEFERS>(&vertex, [u_light, u_scattering], count, branches, deferred)
    }

    /// Comes to the point that was hit: through the solid that the path is in, with a beam that grew on the way.
    #[inline(always)]
    fn arrive(&mut self, hit: &Hit) -> Interaction {
        self.record.vertex_count += 1;
        if self.absorption != Spectrum::ZERO {
            self.throughput *= exp(-self.absorption * hit.t);
        }
        self.cone = self.cone.at(hit.t);
        let point = Interaction::new(self.integrator.prepared, hit, self.origin, self.direction, self.cone);
        if self.depth == 0 {
            self.record.record_first(self.start + hit.t, point.frame[2]);
        }
        point
    }

    /// Adds what a surface shows that takes no part in light transport.
    #[inline(always)]
    fn add_unlit(&mut self, point: &Interaction, color: &ColorParam) {
        let color = point.unlit(self.integrator.prepared.scene(), color);
        self.radiance += self.throughput * color;
        self.record.record_albedo(&mut self.wants_albedo, color);
    }

    /// Notes what was found before light could come over more than one scattering.
    #[inline(always)]
    fn mark_direct(&mut self) {
        if self.depth == 1 && self.integrator.wanted.cost {
            self.record.mark_direct(self.radiance);
        }
    }

    /// How the surface scatters, put into `place` if it was not known before.
    #[inline(always)]
    fn bsdf<'b>(&mut self, point: &Interaction, known: &PreparedMaterial, place: &'b mut Option<Bsdf>) -> &'b Bsdf
    where
        Self: 'b,
    {
        let chance = || self.sampler.hashed(BLEND ^ u64::from(self.depth) << DEPTH_SHIFT ^ u64::from(point.material));
        let bsdf = bsdf_at(self.integrator.prepared, point, chance, place);
        if self.integrator.wanted.cost {
            self.record.counts.meet(bsdf, known);
        }
        bsdf
    }

    /// The numbers of this vertex: for its light and for its scattering.
    #[inline(always)]
    fn numbers(&self) -> [Quad; 2] {
        self.sampler.two_quads(DimensionSet::light(self.depth), DimensionSet::scattering(self.depth))
    }

    /// Looks for lights and goes on, `count` times. False when the path ends here.
    #[inline(always)]
    fn leave<const AGENTS: bool, const DEFERS: bool>(
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
            if !vertex.is_delta_only {
                self.add_direct_light::<AGENTS, DEFERS>(vertex, u_light, deferred);
            }
            let goes_on = self.scatter::<AGENTS>(vertex, u_scattering);
            branch += 1;
            if !AGENTS || branch >= count {
                return goes_on;
            }
            if goes_on {
                branches.push(self.branch());
            }
            self.go_back(&here);
            self.sampler = here.sampler().branch(self.depth, branch);
            [u_light, u_scattering] = self.numbers();
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
            let is_seen = |hit: &Hit| !shines(prepared, hit) && self.is_there(&ray, hit, SurfaceQuery::Path);
            prepared.accel().intersect_filtered(&ray, is_seen)
        } else if prepared.has_opacity() {
            prepared.accel().intersect_filtered(&ray, |hit| self.is_there(&ray, hit, SurfaceQuery::Path))
        } else {
            prepared.accel().intersect(&ray)
        }
    }

    /// Whether a candidate hit is to be taken. It depends on the segment of the path and on the surface alone, so all
    /// candidates of one ray may be asked in any order and more than once.
    #[inline(always)]
    fn is_there(&self, ray: &Ray, hit: &Hit, asks: SurfaceQuery) -> bool {
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
            prepared.accel().occluded_filtered(ray, |hit| self.is_there(ray, hit, SurfaceQuery::Shadow))
        } else {
            prepared.accel().occluded(ray)
        }
    }

    #[inline(always)]
    pub(super) fn finish(&mut self) -> PathRecord {
        self.record.keep(self.radiance, self.integrator.settings.sample_max);
        self.record
    }
}
