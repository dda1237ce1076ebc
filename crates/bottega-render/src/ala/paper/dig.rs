//! The four sensors of table 1, and the agents that deploy them (§4.3).
//!
//! Lengths are in mean distances between objects, so the scene's unit does not matter.

use std::ops::Range;

use bottega_kernels::{Ray, math};
use bottega_scene::Spectrum;
use glam::Vec3;

use super::{
    super::{
        agent::meets,
        probe::{Probe, SURFACES_MAX, SensorKind},
        sensing::{Discovery, SensingContext, SensorReadings},
        swarm::{NEAREST, has_number},
    },
    miner::{Miner, SensorParams},
};
use crate::{
    color::luminance,
    integrator::GatherBuffers,
    interaction::Interaction,
    photon::{Nearest, Photon, is_alike},
    sampling::uniform_sphere,
};

/// Medians of table 1: geometry gradient and penumbra.
const GEOMETRY_MEDIAN: f32 = 2.0 / 3.0;
const PENUMBRA_MEDIAN: f32 = 1.0;
/// Median of the proximity, as a share of the agents that one light casts; and radius of the disc that this share hits
/// if it faces the light, relative to the distance to the light: 1 % of all directions.
const PROXIMITY_MEDIAN: f32 = 0.01;
const PROXIMITY_DISC: f32 = 0.2;
/// Stimulation that each sensor costs.
const TOIL: f32 = -0.25;
/// Interest of a sensor that finds no surface: an edge.
const EDGE: f32 = 0.5;
/// Least distance in the geometry gradient, in mean distances between objects.
const NEAR: f32 = 1e-3;
/// Radius in which only the agent with the lowest index measures irradiance, in local distances between objects; and
/// its bounds, the lower in neighbourhood radii, the upper in mean distances between objects.
const IRRADIANCE_SPACING: f32 = 0.05;
const SPACING_BOUNDS: [f32; 2] = [0.5, 0.2];
/// Least cosine between the normals of agents that measure irradiance for each other.
const SAME_WAY: f32 = 0.9;
/// Relative difference of irradiance with zero interest.
const IRRADIANCE_GRADIENT: f32 = 0.12;
/// Lets agents dig for gold, one after the other.
pub(in crate::ala) fn dig(sensing: &SensingContext<'_>, indices: Range<u32>) -> SensorReadings {
    let mut sensed = SensorReadings::default();
    let (mut found, mut buffers) = (Nearest::new(2 * NEAREST), GatherBuffers::new(sensing.integrator).with_bounces());
    for index in indices {
        let probe = sensing.probe(index);
        let (found, buffers, sensed) = (&mut found, &mut buffers, &mut sensed);
        let discovery = Scout { sensing, probe, index, found, buffers, sensed: &mut *sensed }.look_around();
        sensed.discoveries.push(discovery);
    }
    sensed
}

/// An agent that deploys sensors.
struct Scout<'a, 'b> {
    sensing: &'a SensingContext<'a>,
    probe: Probe<'a>,
    index: u32,
    found: &'b mut Nearest,
    buffers: &'b mut GatherBuffers,
    sensed: &'b mut SensorReadings,
}

impl Scout<'_, '_> {
    /// Deploys all kinds of sensors.
    fn look_around(&mut self) -> Discovery {
        let gradient = self.sense_geometry();
        let crowd = self.sense_proximity();
        // Discourage where surfaces are planar and where everything is as usual
        let excitement = TOIL + 0.25 * (gradient - GEOMETRY_MEDIAN).clamp(-1.0, 1.0) + 0.25 * crowd.max(0.0);
        let [lit, shaded] = self.sense_penumbra(excitement);
        if self.probe.agent.is_matte {
            let local = self.sensing.swarm.object_distance / gradient.max(NEAR);
            self.sense_irradiance(excitement, local);
        }
        Discovery { lit, shaded, lost: 0 }
    }

    /// Runs the gold miner with one kind of sensor. `deploy` receives the number of a sensor and its distance from the
    /// agent, and returns its coefficient of interest.
    fn dig(&mut self, kind: SensorKind, params: SensorParams, mut deploy: impl FnMut(&mut Self, u32, f32) -> f32) {
        let mut miner = Miner::new(params);
        while let Some((number, distance)) = miner.next() {
            let sigma = deploy(self, number, distance);
            miner.take(sigma);
        }
        self.sensed.sensors[kind as usize] += u64::from(miner.count());
    }

    /// Returns the mean geometry gradient: 1 where objects are as far away as on average.
    fn sense_geometry(&mut self) -> f32 {
        let params = SensorParams { few: 2, many: 6, most: 8, step: self.probe.reach / 8.0, excitement: TOIL };
        let (mut sum, mut count) = (0.0, 0.0_f32);
        self.dig(SensorKind::Geometry, params, |scout, number, distance| {
            let Some(point) = scout.probe.place(SensorKind::Geometry, number, distance, scout.probe.agent.normal)
            else {
                return EDGE;
            };
            let gradient = scout.geometry_at(&point, number);
            sum += gradient;
            count += 1.0;
            gradient - GEOMETRY_MEDIAN
        });
        if count > 0.0 { sum / count } else { GEOMETRY_MEDIAN }
    }

    /// Returns the geometry gradient of one sensor: (1/3) Σ 1/d over three directions.
    fn geometry_at(&self, point: &Interaction, number: u32) -> f32 {
        let n = point.facing_ng();
        let inverse = |part: u32| {
            let [u, v, ..] = self.probe.numbers(SensorKind::Geometry, 1, 3 * number + part);
            let w = uniform_sphere([u, v]);
            let w = if w.dot(n) < 0.0 { -w } else { w };
            let hit = meets(self.probe.prepared, &Ray::new(point.ray_origin(w), w));
            (self.sensing.swarm.object_distance / hit.t).min(1.0 / NEAR)
        };
        (0..3).map(inverse).sum::<f32>() / 3.0
    }

    /// Returns the mean coefficient of interest of the agent density, in [−1, 1]: below 0 where it is usual.
    fn sense_proximity(&mut self) -> f32 {
        let params = SensorParams { few: 1, many: 3, most: 4, step: self.probe.reach / 4.0, excitement: TOIL };
        let (mut sum, mut count) = (0.0, 0.0);
        self.dig(SensorKind::Proximity, params, |scout, number, distance| {
            let value = scout.proximity_at(scout.probe.beside(
                SensorKind::Proximity,
                number,
                distance,
                scout.probe.agent.normal,
            ));
            let median = PROXIMITY_MEDIAN * scout.sensing.swarm.cast_by_light;
            let sigma = 0.25 * math::ln((value / median).max(1e-6)).abs() - 0.5;
            sum += sigma.clamp(-1.0, 1.0);
            count += 1.0;
            sigma
        });
        if count > 0.0 { sum / count } else { 0.0 }
    }

    /// Returns the number of agents of the same light on the disc that 1 % of them hit if it faces the light.
    fn proximity_at(&mut self, p: Vec3) -> f32 {
        let swarm = self.sensing.swarm;
        swarm.tree.nearest(p, f32::INFINITY, self.found);
        let is_like = |number: u32| {
            let (_, other) = swarm.by_number(number);
            other.light == self.probe.agent.light && is_alike(other.normal, self.probe.agent.normal)
        };
        let count = self.found.iter().filter(|&(number, _)| is_like(number)).count();
        let from = if has_number(self.probe.agent.light) { self.probe.agent.distance } else { swarm.object_distance };
        let radius = PROXIMITY_DISC * from;
        count as f32 * radius * radius / self.found.farthest().max(f32::MIN_POSITIVE)
    }

    /// Returns the number of penumbra sensors that see the light, and that do not.
    fn sense_penumbra(&mut self, excitement: f32) -> [u32; 2] {
        let mut counts = [0; 2];
        if !has_number(self.probe.agent.light) || self.probe.prepared.has_opacity() {
            return counts;
        }
        let params = SensorParams { few: 4, many: 16, most: 24, step: self.probe.reach / 12.0, excitement };
        self.dig(SensorKind::Penumbra, params, |scout, number, distance| {
            let Some(point) = scout.probe.place(SensorKind::Penumbra, number, distance, scout.probe.agent.normal)
            else {
                return 0.0;
            };
            let Some((value, is_lit)) = scout.penumbra_at(&point, number) else { return 0.0 };
            counts[usize::from(!is_lit)] += 1;
            (value - PENUMBRA_MEDIAN).abs()
        });
        counts
    }

    /// Returns the penumbra value of one sensor: the number of surfaces up to a point on the light, including the
    /// light's own, divided by the distance; and `true` if only the light is hit. `None`: the light does not shine
    /// there at all.
    fn penumbra_at(&self, point: &Interaction, number: u32) -> Option<(f32, bool)> {
        let (count, distance) = self.probe.surfaces_to_light(point, number, SURFACES_MAX)?;
        let distance = distance / self.probe.agent.distance.max(f32::MIN_POSITIVE);
        Some((count as f32 / distance.max(NEAR), count == 1))
    }

    /// Measures indirect irradiance on both sides of the surface, unless another agent nearby does so.
    ///
    /// - `local`: harmonic mean distance to other objects.
    fn sense_irradiance(&mut self, excitement: f32, local: f32) {
        let swarm = self.sensing.swarm;
        let [least, most] = [SPACING_BOUNDS[0] * self.probe.reach, SPACING_BOUNDS[1] * swarm.object_distance];
        let spacing = (IRRADIANCE_SPACING * local).min(most).max(least);
        let agent = self.probe.agent;
        let is_before = |number: u32| {
            let (index, other) = swarm.by_number(number);
            let is_same = other.normal.dot(agent.normal).abs() > SAME_WAY;
            index < self.index && other.is_matte && is_same
        };
        if swarm.tree.nearest_where(agent.p, spacing * spacing, is_before).is_some() {
            return;
        }
        for normal in [agent.normal, -agent.normal] {
            let params = SensorParams { few: 2, many: 6, most: 10, step: 0.4 * spacing, excitement: TOIL + excitement };
            let (mut sum, mut count) = (0.0, 0.0);
            self.dig(SensorKind::Irradiance, params, |scout, number, distance| {
                let Some(point) = scout.probe.place(SensorKind::Irradiance, number, distance, normal) else {
                    return -1.0;
                };
                let brightness = scout.irradiance_at(point, number, spacing);
                sum += brightness;
                count += 1.0;
                let mean = sum / count;
                if mean > 0.0 { (brightness - mean).abs() / (mean * IRRADIANCE_GRADIENT) - 1.0 } else { -1.0 }
            });
        }
    }

    /// Stores the irradiance at a sensor, and returns its luminance.
    fn irradiance_at(&mut self, point: Interaction, number: u32, width: f32) -> f32 {
        let (p, n) = (point.p, point.facing_ng());
        let side_number = u32::from(n.dot(self.probe.agent.normal) < 0.0);
        let sampler = self.probe.sampler(2 * number + side_number, 1);
        let irradiance = self.sensing.integrator.irradiance(self.sensing.maps, point, width, sampler, self.buffers);
        // Skip dark backs: no query is made behind a wall
        if side_number == 0 || irradiance != Spectrum::ZERO {
            self.sensed.irradiance.push(Photon::new(p, n, n, irradiance), self.buffers.bounces());
        }
        luminance(irradiance)
    }
}
