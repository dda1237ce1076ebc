//! Tracing of photons: from the lights over mirrors, through glass, and from surface to surface.

use std::ops::Range;

use bottega_kernels::{Hit, Ray, compiled::Task};
use bottega_scene::{Spectrum, Surface};
use glam::Vec3;

use super::{
    bytes::{ByteForm, Reader, Writer},
    projection::Projection,
    record::Photon,
};
use crate::{
    bsdf::{BsdfAt, BsdfSample, LobeFlags, TransportMode},
    camera::RayCone,
    density::SolidAnglePdf,
    interaction::{Interaction, opacity_of},
    lights::{AimCone, Emission, EmissionPlan, EmittedPhoton},
    prepare::PreparedScene,
    sampler::{DimensionSet, PixelSampler, Quad},
    segment::SegmentRays,
    vertex::{LeavingDirection, absorption_behind, attenuate, bsdf_at_vertex, leaving_direction},
};

/// Key of the random numbers of photons, distinct from pixels.
const PHOTON_SEED: u64 = 0x7068_6f74_6f6e_7321;
/// Key of the random numbers of caustic photons that are sent to mirrors and glass.
const SENT_SEED: u64 = 0x6361_7573_7469_6373;
/// Key of the random numbers that decide whether a photon is aimed.
const AIMING: u64 = 0x6169_6d65_6421_2121;
/// Greatest factor by which the shading normal makes a photon stronger.
const NORMALS_RATIO_MAX: f32 = 8.0;
/// Greatest number of shadow photons per photon, one per surface behind the first.
const SHADOWS_MAX: u32 = 16;

/// The photon tracer of a pass. A photon depends only on the scene, these settings and its index.
#[derive(Clone, Copy)]
pub(crate) struct Tracer<'a> {
    /// The prepared scene.
    pub(crate) prepared: &'a PreparedScene,
    /// Light sources of the scene.
    pub(crate) emission: &'a Emission,
    /// Plan of emission: the region that photons are sent to.
    pub(crate) plan: &'a EmissionPlan,
    /// Seed of the random numbers.
    pub(crate) seed: u64,
    /// Number of the pass; each pass has its own photons.
    pub(crate) pass: u32,
    /// Greatest number of surfaces that a photon hits.
    pub(crate) bounces: u32,
    /// `true`: also store shadow photons.
    pub(crate) with_shadows: bool,
    /// `true`: store only caustic photons, and end paths at the first BSDF that is not specular.
    pub(crate) only_caustics: bool,
    /// Factor of the power.
    pub(crate) strength: f32,
    /// Projection map that sends photons to mirrors and glass; `None`: they are sent everywhere.
    pub(crate) projection: Option<&'a Projection>,
}

/// The photons that a range of emitted photons stored on surfaces, in the order of their indices. Each carries the
/// power of all light: divide by the number emitted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TracedPhotons {
    /// Photons that arrived directly from a light.
    pub direct: Vec<Photon>,
    /// Photons that arrived over mirrors and glass only.
    pub caustic: Vec<Photon>,
    /// Photons that scattered at least once at a BSDF that is not specular.
    pub indirect: Vec<Photon>,
    /// Shadow photons, on the first surface along a photon's ray and on those behind. The tag is twice the number of
    /// the light, plus 1 where it is lit.
    pub(crate) visibility: Vec<Photon>,
}

impl TracedPhotons {
    /// Appends the photons of `later`, whose indices follow those of `self`.
    pub fn append(&mut self, mut later: Self) {
        self.direct.append(&mut later.direct);
        self.caustic.append(&mut later.caustic);
        self.indirect.append(&mut later.indirect);
        self.visibility.append(&mut later.visibility);
    }
}

impl ByteForm for TracedPhotons {
    fn write(&self, to: &mut Writer) {
        [&self.direct, &self.caustic, &self.indirect, &self.visibility].into_iter().for_each(|kind| to.photons(kind));
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        let mut photons = || from.photons();
        Some(Self { direct: photons()?, caustic: photons()?, indirect: photons()?, visibility: photons()? })
    }
}

/// A range of photons to trace.
pub(crate) struct TraceRange<'a> {
    /// Tracer of the pass.
    pub(crate) tracer: Tracer<'a>,
    /// Indices of the photons.
    pub(crate) indices: Range<u32>,
}

impl Task for TraceRange<'_> {
    type Output = TracedPhotons;

    #[inline(always)]
    fn run(self) -> TracedPhotons {
        let mut traced = TracedPhotons::default();
        for index in self.indices {
            self.tracer.trace(index, &mut traced);
        }
        traced
    }
}

/// Returns the tag of a shadow photon.
pub(super) fn visibility_tag(light: u32, is_lit: bool) -> u32 {
    light.wrapping_mul(2) | u32::from(is_lit)
}

impl Tracer<'_> {
    /// Returns the random numbers of a photon.
    fn sampler(&self, index: u32) -> PixelSampler {
        let sent = if self.projection.is_some() { SENT_SEED } else { 0 };
        PixelSampler::new(self.seed ^ PHOTON_SEED ^ sent, self.pass, 0, index)
    }

    /// Returns the random numbers of a photon's emission.
    pub(super) fn numbers(&self, index: u32) -> [Quad; 2] {
        self.sampler(index).two_quads(DimensionSet::CAMERA, DimensionSet::light(0))
    }

    /// Traces one photon and appends what it stores to `traced`.
    #[inline(always)]
    pub(super) fn trace(&self, index: u32, traced: &mut TracedPhotons) {
        let sampler = self.sampler(index);
        let [u, v] = self.numbers(index);
        // Emit the photon, aimed by the projection map if there is one
        let (u, v, weight) = self.projection.map_or((u, v, 1.0), |projection| projection.sent(u, v));
        let Some(emitted) = self.emission.emit(self.prepared, self.plan, u, v) else { return };
        if self.with_shadows {
            self.leave_shadows(&emitted, traced);
        }
        let EmittedPhoton { mut origin, mut direction, mut power, .. } = emitted;
        power *= weight * self.strength;
        let mut absorption = Spectrum::ZERO;
        let (mut is_specular, mut is_direct) = (true, true);
        for depth in 0..self.bounces {
            // Intersect, and attenuate inside solids
            let ray = Ray::new(origin, direction);
            let hit = SegmentRays::of_photon(self.prepared, &sampler, depth).intersect(&ray);
            if hit.is_none() {
                return;
            }
            attenuate(&mut power, absorption, hit.t);
            let mut point = Interaction::new(self.prepared, &hit, origin, direction, RayCone::default());
            let (material, known) = self.prepared.material(point.material);
            if matches!(material.surface, Surface::Unlit(_)) {
                return;
            }
            // Keep the relief's shadowing apart: it depends on the direction of the light
            let lifted = point.lifted.take();
            // Evaluate the BSDF's parameters
            let mut storage = None;
            let bsdf = bsdf_at_vertex(self.prepared, &point, &sampler, depth, &mut storage);
            let bsdf = bsdf.with_mode(TransportMode::Importance);
            let wo = point.to_local(point.wo);
            // Photon density follows the geometric normal; scattering follows the shading normal
            let arriving = (wo.z / point.wo.dot(point.ng).abs()).min(NORMALS_RATIO_MAX);
            if bsdf.has_non_delta() {
                let normal = point.facing_ng();
                let power = power * (arriving / self.opacity(&ray, &hit));
                // Store the photon by its kind
                let photon = Photon::new(point.p, point.wo, normal, power).with_bounces(depth);
                match (is_direct, is_specular) {
                    (true, _) if self.only_caustics => {}
                    (true, _) => traced.direct.push(photon),
                    (false, true) => traced.caustic.push(photon),
                    (false, false) => traced.indirect.push(photon),
                }
            }
            // Sample the BSDF, or aim at the visible region
            let u = sampler.quad(DimensionSet::scattering(depth));
            let aim = if bsdf.has_non_delta() { self.plan.aim(point.p) } else { None };
            let bsdf = bsdf.at_carrying(wo, power);
            let Some((sample, is_aimed)) = scattered(&bsdf, aim, &point, u, &sampler, depth) else { return };
            let Some(LeavingDirection { wi, is_reflection }) = leaving_direction(&point, &sample) else { return };
            // Correct for the shading normal: the adjoint BSDF (Veach 1997, eq. 5.19)
            let leaving = wi.dot(point.ng).abs() / sample.wi.z.abs();
            let mut next = power * sample.weight() * (arriving * leaving);
            if let Some(lifted) = lifted {
                let seen = if lifted.factor(sample.wi) > 0.0 { lifted.factor(wo) } else { 0.0 };
                next *= seen;
            }
            // Terminate with Russian roulette by the remaining power, which keeps photons equally strong; aimed photons
            // survive, as they are weaker
            let survival = if is_aimed { 1.0 } else { (next.max_element() / power.max_element()).min(1.0) };
            if !(survival > 0.0 && u[3] < survival && next.is_finite()) {
                return;
            }
            power = next / survival;
            if !is_reflection {
                absorption = absorption_behind(&point, known, absorption);
            }
            // Spawn the next ray
            is_specular &= sample.is_delta();
            if self.only_caustics && !is_specular {
                return;
            }
            is_direct = false;
            (origin, direction) = (point.ray_origin(wi), wi);
        }
    }

    /// Returns the share of photons that a semi-transparent surface stops. Stored photons are divided by it: camera
    /// paths hit the surface with the same probability.
    #[inline(always)]
    fn opacity(&self, ray: &Ray, hit: &Hit) -> f32 {
        /// Least opacity, which bounds the factor.
        const OPACITY_MIN: f32 = 1.0 / 64.0;
        if self.prepared.has_opacity() { opacity_of(self.prepared, ray, 0.0, hit).0.max(OPACITY_MIN) } else { 1.0 }
    }

    /// Stores shadow photons at all surfaces along the photon's ray, and marks the first one as lit.
    fn leave_shadows(&self, emitted: &EmittedPhoton, traced: &mut TracedPhotons) {
        let mut origin = emitted.origin;
        for number in 0..SHADOWS_MAX {
            let hit = self.prepared.accel().intersect(&Ray::new(origin, emitted.direction));
            if hit.is_none() {
                return;
            }
            let point = Interaction::new(self.prepared, &hit, origin, emitted.direction, RayCone::default());
            let normal = point.facing_ng();
            let tag = visibility_tag(emitted.light, number == 0);
            traced.visibility.push(Photon::tagged(point.p, point.wo, normal, tag));
            origin = point.ray_origin(emitted.direction);
            if origin == point.p && hit.t <= 0.0 {
                return;
            }
        }
    }
}

/// Samples a photon's next direction. Returns `true` with it if it points to the visible region: from far away, half of
/// the photons are aimed there, with accordingly less power.
fn scattered(
    bsdf: &BsdfAt<'_>,
    aim: Option<AimCone>,
    point: &Interaction,
    u: Quad,
    sampler: &PixelSampler,
    depth: u32,
) -> Option<(BsdfSample, bool)> {
    let Some(aim) = aim else { return Some((bsdf.sample(u[0], [u[1], u[2]])?, false)) };
    let is_aimed = sampler.hashed(AIMING ^ u64::from(depth) << 56) < AimCone::SHARE;
    if !is_aimed {
        let sample = bsdf.sample(u[0], [u[1], u[2]])?;
        let is_within = !sample.is_delta() && aim.contains(point.to_world(sample.wi));
        let pdf = aim.mixed(is_within, SolidAnglePdf::new(sample.pdf)).per_sr();
        return Some((BsdfSample { pdf, ..sample }, is_within));
    }
    let w = aim.sample([u[1], u[2]]);
    let wi = point.to_local(w);
    let (value, own_pdf) = bsdf.eval_pdf(wi);
    let pdf = aim.mixed(true, SolidAnglePdf::new(own_pdf)).per_sr();
    (value.max_element() > 0.0).then_some((BsdfSample { wi, value, pdf, lobe: LobeFlags::DIFFUSE, eta: 1.0 }, true))
}

/// Returns `true` if two normals may belong to the same surface.
#[inline(always)]
pub(crate) fn is_alike(a: Vec3, b: Vec3) -> bool {
    /// Least cosine of the angle between them.
    const COSINE_MIN: f32 = 0.6;
    a.dot(b) > COSINE_MIN
}
