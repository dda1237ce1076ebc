//! The casting of agents: from the lights in all directions, straight through all surfaces (§4.2).

use std::ops::Range;

use bottega_kernels::{Hit, Ray, compiled::Task};
use glam::Vec3;

use crate::{
    bsdf::warp::cosine_hemisphere,
    camera::RayCone,
    interaction::{Interaction, SurfaceQuery, is_there},
    lights::{Emission, EmissionPlan, EmittedPhoton, NO_LIGHT},
    prepare::PreparedScene,
    sampler::{DimensionSet, PixelSampler},
    sampling::orthonormal_basis,
    shading::{is_broad, is_matte},
    vertex::bsdf_at_vertex,
};

/// Key of the random numbers of agents, distinct from pixels and photons.
const AGENT_SEED: u64 = 0x6167_656e_7473_2121;
/// Greatest number of surfaces at which an agent and its clones are stored.
const SURFACES_MAX: u32 = 32;
/// Greatest number of surfaces that they pass, including the light's own and those without a broad BSDF.
const CROSSINGS_MAX: u32 = 64;
/// Key of the random numbers of scouts.
const SCOUT_SEED: u64 = 0x7363_6f75_7473_2121;
/// Share of the agents that send a scout, and clone number of the first scout.
const SCOUTS: f32 = 0.125;
const FIRST_SCOUT: u32 = 64;
/// Clone number of the agents of the camera, above that of all scouts.
pub(super) const CAMERA_CLONE: u32 = 128;
/// Least opacity of a surface that stops agents and sensors.
const OPAQUE: f32 = 0.5;

/// A lighting agent: a place on a surface that light or the camera reaches, which answers questions about the light around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agent {
    /// Position on a surface, in world space.
    pub p: Vec3,
    /// Geometric normal on the side that it came from; unit length.
    pub normal: Vec3,
    /// Direction against the agent's flight; unit length.
    pub to_light: Vec3,
    /// Number of the agent's light in the light tree; `u32::MAX`: a light at infinity, or no light: a scout, or an
    /// agent of the camera.
    pub light: u32,
    /// Distance from the point from which the agent was cast, in scene units; 0 for an agent of the camera.
    pub distance: f32,
    /// Distance from the previous surface or from the light, in scene units; for an agent of the camera, the radius of its
    /// neighbourhood.
    pub gap: f32,
    /// Number of the cast, from 0; identifies the agent together with `clone`.
    pub cast: u32,
    /// Number of surfaces before it: 0 for the agent itself, more for its clones; scouts have numbers above all clones,
    /// and agents of the camera numbers above all scouts.
    pub clone: u32,
    /// `true`: the surface is matte, so irradiance is all that matters.
    pub is_matte: bool,
    /// `true`: the surface is not matte, but scatters so much light broadly that directions of the light matter.
    pub is_glossy: bool,
}

impl Agent {
    /// Returns `true` if another agent sent it on.
    pub(super) fn is_scout(&self) -> bool {
        self.clone >= FIRST_SCOUT
    }

    /// Returns `true` for an agent of the camera: the picture shows its place.
    pub(super) fn is_camera(&self) -> bool {
        self.clone == CAMERA_CLONE
    }
}

/// A range of agents to cast.
pub(crate) struct CastRange<'a> {
    /// The prepared scene.
    pub(crate) prepared: &'a PreparedScene,
    /// Sources that cast the agents.
    pub(crate) sources: &'a Emission,
    /// Region to which the agents are sent.
    pub(crate) plan: &'a EmissionPlan,
    /// Seed of the random numbers.
    pub(crate) seed: u64,
    /// Indices of the agents.
    pub(crate) indices: Range<u32>,
    /// `true`: agents send scouts to surfaces without direct light.
    pub(crate) has_scouts: bool,
}

impl Task for CastRange<'_> {
    type Output = Vec<Agent>;

    #[inline(always)]
    fn run(self) -> Vec<Agent> {
        let mut agents = Vec::new();
        for index in self.indices.clone() {
            self.cast(index, &mut agents);
        }
        agents
    }
}

impl CastRange<'_> {
    /// Casts one agent: stores it at the first surface, and its clones at those behind.
    fn cast(&self, index: u32, agents: &mut Vec<Agent>) {
        let sampler = PixelSampler::new(self.seed ^ AGENT_SEED, 0, 0, index);
        let [u, v] = sampler.two_quads(DimensionSet::CAMERA, DimensionSet::light(0));
        // Emit the agent from a light
        let Some(start) = self.sources.cast(self.prepared, self.plan, u, v) else { return };
        let EmittedPhoton { mut origin, direction, light, .. } = start;
        let (mut distance, mut gap, mut clone) = (0.0, 0.0, 0);
        for _ in 0..CROSSINGS_MAX {
            let hit = meets(self.prepared, &Ray::new(origin, direction));
            if hit.is_none() || clone == SURFACES_MAX {
                return;
            }
            distance += hit.t;
            gap += hit.t;
            let point = Interaction::new(self.prepared, &hit, origin, direction, RayCone::default());
            let normal = point.facing_ng();
            // Store it at the surface, unless this is its own light, and send a scout
            let is_own = self.prepared.lights().light_of(self.prepared, &hit) == Some(light);
            if !is_own && point.p.is_finite() && distance.is_finite() {
                if let Some([is_matte, is_glossy]) = self.spreads(&point, &sampler) {
                    let (p, to_light, cast) = (point.p, point.wo, index);
                    let agent = Agent { p, normal, to_light, light, distance, gap, cast, clone, is_matte, is_glossy };
                    agents.push(agent);
                    if self.has_scouts {
                        self.send_scout(&agent, &point, agents);
                    }
                }
                clone += 1;
                gap = 0.0;
            }
            // Continue straight on, as a clone
            let next = point.ray_origin(direction);
            if next == origin && hit.t <= 0.0 {
                return;
            }
            origin = next;
        }
    }

    /// Sends a scout from some of the agents: one diffuse bounce to surfaces without direct light, such as the ceiling
    /// around a light. A scout belongs to no light.
    fn send_scout(&self, from: &Agent, point: &Interaction, agents: &mut Vec<Agent>) {
        let sampler = PixelSampler::new(self.seed ^ SCOUT_SEED, from.clone, 0, from.cast);
        let [chance, u, v, _] = sampler.quad(DimensionSet::CAMERA);
        if chance >= SCOUTS {
            return;
        }
        let (s, t) = orthonormal_basis(from.normal);
        let local = cosine_hemisphere([u, v]);
        let direction = s * local.x + t * local.y + from.normal * local.z;
        let origin = point.ray_origin(direction);
        let hit = meets(self.prepared, &Ray::new(origin, direction));
        if hit.is_none() {
            return;
        }
        let place = Interaction::new(self.prepared, &hit, origin, direction, RayCone::default());
        let is_light = self.prepared.lights().light_of(self.prepared, &hit).is_some();
        if is_light || !place.p.is_finite() || !hit.t.is_finite() {
            return;
        }
        if let Some([is_matte, is_glossy]) = self.spreads(&place, &sampler) {
            let normal = place.facing_ng();
            agents.push(Agent {
                p: place.p,
                normal,
                to_light: place.wo,
                light: NO_LIGHT,
                distance: from.distance + hit.t,
                gap: hit.t,
                clone: FIRST_SCOUT + from.clone,
                is_matte,
                is_glossy,
                ..*from
            });
        }
    }

    /// Returns `true` for matte and for glossy surfaces, in this order. `None`: mirrors and clear glass, where agents
    /// are not needed.
    fn spreads(&self, point: &Interaction, sampler: &PixelSampler) -> Option<[bool; 2]> {
        let mut storage = None;
        let bsdf = bsdf_at_vertex(self.prepared, point, sampler, 0, &mut storage);
        bsdf.has_non_delta().then(|| [is_matte(bsdf), is_broad(bsdf, point.to_local(point.wo))])
    }
}

/// Returns the closest hit of an agent or a sensor; surfaces that are less than half opaque do not count.
pub(super) fn meets(prepared: &PreparedScene, ray: &Ray) -> Hit {
    if prepared.has_opacity() {
        prepared
            .accel()
            .intersect_filtered(ray, |hit| is_there(prepared, ray, 0.0, hit, SurfaceQuery::Path, |_| OPAQUE))
    } else {
        prepared.accel().intersect(ray)
    }
}
