//! Agents on their way: from the lights to all sides, straight through all that they meet (§4.2).

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
    shading::{BLEND, bsdf_at, is_broad, is_matte},
};

/// Sets the numbers of agents apart from those of pixels and photons.
const AGENT_SEED: u64 = 0x6167_656e_7473_2121;
/// Surfaces at which an agent and its clones are stored.
const SURFACES_MAX: u32 = 32;
/// Surfaces that they go through in all, their own light and those that spread no light among them.
const CROSSINGS_MAX: u32 = 64;
/// Sets the numbers of scouts apart from those of agents.
const SCOUT_SEED: u64 = 0x7363_6f75_7473_2121;
/// The share of the agents that send a scout, and the number of the first of a cast.
const SCOUTS: f32 = 0.125;
const FIRST_SCOUT: u32 = 64;
/// How opaque a surface must be to be there for an agent.
const OPAQUE: f32 = 0.5;

/// One of the swarm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agent {
    /// Where it is, in world space, on a surface.
    pub p: Vec3,
    /// Of the surface, on the side that it came from; unit length.
    pub normal: Vec3,
    /// Back along the way that it came; unit length.
    pub to_light: Vec3,
    /// Number of the light that cast it in the tree of lights; `u32::MAX` for light from infinitely far away.
    pub light: u32,
    /// How far it is from the place that it was cast from.
    pub distance: f32,
    /// How far the surface before it is, or the light.
    pub gap: f32,
    /// The cast that it belongs to, and how many surfaces lie before it: both together are its identity.
    pub cast: u32,
    /// 0 for the agent itself, more for its clones, and more again for the scouts that they sent.
    pub clone: u32,
    /// Whether its surface sends light back to all sides alike, so that irradiance is all there is to know.
    pub is_matte: bool,
    /// Whether it is not, but sends back so much of it broadly that it is worth knowing what comes from where.
    pub is_glossy: bool,
}

impl Agent {
    /// Whether it was sent on by another.
    pub(super) fn is_scout(&self) -> bool {
        self.clone >= FIRST_SCOUT
    }
}

/// Agents to cast.
pub(crate) struct Casting<'a> {
    pub(crate) prepared: &'a PreparedScene,
    /// What casts them, and where they are sent.
    pub(crate) sources: &'a Emission,
    pub(crate) plan: &'a EmissionPlan,
    pub(crate) seed: u64,
    pub(crate) indices: Range<u32>,
    /// Whether they send scouts to what no light shines at straight.
    pub(crate) has_scouts: bool,
}

impl Task for Casting<'_> {
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

impl Casting<'_> {
    /// Sends out one agent, which is stored at the first surface and goes on, as clones, to those behind.
    fn cast(&self, index: u32, agents: &mut Vec<Agent>) {
        let sampler = PixelSampler::new(self.seed ^ AGENT_SEED, 0, 0, index);
        let [u, v] = sampler.two_quads(DimensionSet::CAMERA, DimensionSet::light(0));
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
            let normal = if point.front { point.ng } else { -point.ng };
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
            let next = point.ray_origin(direction);
            if next == origin && hit.t <= 0.0 {
                return;
            }
            origin = next;
        }
    }

    /// Sends one of a few agents on to where its surface scatters light: a scout of no light, for what no light shines at straight, as a
    /// ceiling around its lamp.
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
            let normal = if place.front { place.ng } else { -place.ng };
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

    /// Whether a surface spreads light, and if so whether it is matte or glossy. At mirrors and clear glass nobody asks for
    /// anything.
    fn spreads(&self, point: &Interaction, sampler: &PixelSampler) -> Option<[bool; 2]> {
        let mut place = None;
        let chance = || sampler.hashed(BLEND ^ u64::from(point.material));
        let bsdf = bsdf_at(self.prepared, point, chance, &mut place);
        bsdf.has_non_delta().then(|| [is_matte(bsdf), is_broad(bsdf, point.to_local(point.wo))])
    }
}

/// What an agent or a sensor meets: surfaces that are more than half there.
pub(super) fn meets(prepared: &PreparedScene, ray: &Ray) -> Hit {
    if prepared.has_opacity() {
        prepared.accel().intersect_filtered(ray, |hit| is_there(prepared, ray, hit, SurfaceQuery::Path, |_| OPAQUE))
    } else {
        prepared.accel().intersect(ray)
    }
}
