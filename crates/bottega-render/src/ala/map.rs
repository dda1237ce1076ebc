//! What a swarm knows, and the oracle that is asked while the picture is painted (§4.4).

use bottega_kernels::compiled;
use bottega_scene::Spectrum;
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use std::time::{Duration, Instant};

use super::{
    agent::{Agent, Casting},
    cast::{AGENTS, SENSING},
    network::{Answer, Network},
    report::{AgentReport, Tallies, Tally},
    sensing::{Sensed, Sensing},
    swarm::Swarm,
};
use crate::{
    AgentSettings,
    integrator::PhotonIntegrator,
    photon::{Nearest, Photon, PhotonMap, PhotonMaps, is_alike, parts},
    prepare::PreparedScene,
    sampling::orthonormal_basis,
};

/// Irradiance sensors that are looked for, and how many of them must be on the same surface.
const SENSORS: usize = 32;
const SENSORS_MIN: usize = 3;
/// Of those on the same surface so many are taken.
const TAKEN: usize = 12;
/// Cosine between normals with which a sensor counts nothing, and what each counts at least.
const COSINE_MIN: f32 = 0.6;
const WEIGHT_MIN: f32 = 1e-3;
/// How reluctant the plane through sensors is to be steep.
const SLOPE_RIDGE: f32 = 0.02;
/// How far off the plane of a surface sensors may be, as a share of how far off they are.
const FLATNESS: f32 = 0.35;

/// Agents after they have looked around.
#[derive(Debug)]
pub(crate) struct Agents {
    settings: AgentSettings,
    /// Where they are; in place of a power light and answer.
    places: PhotonMap,
    /// How far each one's word goes, by number in the map; and the farthest of all.
    reach: Vec<f32>,
    reach_max: f32,
    /// In place of a power the indirect irradiance.
    irradiance: PhotonMap,
    /// σ of the irradiance sensors: mean distance between objects.
    object_distance: f32,
    report: AgentReport,
    tallies: Tallies,
}

/// The bits of an answer below those of a light.
const ANSWER: u32 = 3;

/// Light and answer in place of a power.
fn tag(light: u32, answer: Answer) -> u32 {
    light << 2 | answer as u32
}

/// Casts agents on the threads of the present pool.
fn cast(prepared: &PreparedScene, settings: AgentSettings, seed: u64) -> Vec<Agent> {
    let works: Vec<_> = parts(settings.cast, AGENTS).collect();
    let parts: Vec<Vec<Agent>> =
        works.into_par_iter().map(|indices| compiled::run(Casting { prepared, seed, indices })).collect();
    parts.concat()
}

impl Agents {
    /// Irradiance sensors that are looked for.
    pub(crate) const SENSORS: usize = SENSORS;

    /// Casts agents and lets them look around, on the threads of the present pool.
    ///
    /// - `integrator`: follows the light that comes to a sensor.
    /// - `maps`: know the caustics.
    pub(crate) fn new(
        prepared: &PreparedScene,
        settings: AgentSettings,
        integrator: &PhotonIntegrator<'_>,
        maps: &PhotonMaps,
        seed: u64,
    ) -> Self {
        let begun = Instant::now();
        let swarm = Swarm::new(prepared, cast(prepared, settings, seed), settings.cast);
        let casting = begun.elapsed();
        let works: Vec<_> = parts(swarm.len() as u32, SENSING).collect();
        let sense = |indices| compiled::run(Sensing { integrator, maps, swarm: &swarm, seed, indices });
        let parts: Vec<Sensed> = works.into_par_iter().map(sense).collect();
        let sensed = joined(parts);
        Self::of(settings, &swarm, sensed, [casting, begun.elapsed() - casting])
    }

    /// Joins what was found out.
    ///
    /// - `times`: of casting and of sensing.
    pub(super) fn of(settings: AgentSettings, swarm: &Swarm, sensed: Sensed, times: [Duration; 2]) -> Self {
        let network = Network::new(swarm);
        let answers = network.answers(&sensed.discoveries);
        let numbers = 0..swarm.len() as u32;
        let index = |number: u32| swarm.by_number(number).0 as usize;
        let reach: Vec<f32> = numbers.map(|number| sensed.discoveries[index(number)].reach).collect();
        let reach_max = reach.iter().fold(0.0, |most: f32, &reach| most.max(reach));
        let places =
            swarm.tree.clone().retagged(|index| tag(swarm.agents[index as usize].light, answers[index as usize]));
        let irradiance = PhotonMap::new(sensed.irradiance);
        let mut agents = Self {
            settings,
            places,
            reach,
            reach_max,
            irradiance,
            object_distance: swarm.object_distance,
            report: AgentReport::default(),
            tallies: Tallies::default(),
        };
        let count = |answer: Answer| answers.iter().filter(|&&it| it == answer).count() as u64;
        agents.report = AgentReport {
            cast: settings.cast,
            agents: swarm.len() as u64,
            clones: swarm.agents.iter().filter(|agent| agent.clone > 0).count() as u64,
            sensors: sensed.sensors,
            links: network.link_count(),
            answers: [count(Answer::Lit), count(Answer::Shaded), count(Answer::Trace)],
            object_distance: swarm.object_distance,
            map_bytes: agents.memory_bytes() as u64,
            casting: times[0],
            sensing: times[1],
            tally: Tally::default(),
        };
        agents
    }

    /// Bytes held.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.places.memory_bytes() + size_of_val(&*self.reach) + self.irradiance.memory_bytes()
    }

    /// What there is to tell, with all that was asked so far.
    pub(crate) fn report(&self) -> AgentReport {
        AgentReport { tally: self.tallies.sum(), ..self.report }
    }

    /// Adds what was asked.
    pub(crate) fn count(&self, tally: &Tally) {
        self.tallies.add(tally);
    }

    /// "Should I trace a shadow ray?" `None`: yes; else whether the light is seen.
    ///
    /// - `normal`: of the surface, on the side that is asked for.
    #[inline(always)]
    pub(crate) fn visibility_at(&self, p: Vec3, normal: Vec3, light: u32) -> Option<bool> {
        if !self.settings.decides_shadows {
            return None;
        }
        let accept = |number: u32| {
            let mark = self.places.mark(number);
            mark.tag() >> 2 == light && is_alike(mark.normal(), normal)
        };
        let number = self.places.nearest_where(p, self.reach_max * self.reach_max, accept)?;
        let reach = self.reach[number as usize];
        if self.places.photon(number).p.distance_squared(p) > reach * reach {
            return None;
        }
        match self.places.mark(number).tag() & ANSWER {
            tag if tag == Answer::Lit as u32 => Some(true),
            tag if tag == Answer::Shaded as u32 => Some(false),
            _ => None,
        }
    }

    /// "Should I compute incoming irradiance?" `None`: yes; else what the sensors near by say of it.
    #[inline(always)]
    pub(crate) fn irradiance_at(&self, p: Vec3, normal: Vec3, found: &mut Nearest) -> Option<Spectrum> {
        if !self.settings.decides_irradiance {
            return None;
        }
        self.irradiance.nearest(p, f32::INFINITY, found);
        let mut near = [(f32::INFINITY, 0_u32); SENSORS];
        let mut count = 0;
        for (number, distance_squared) in found.iter() {
            let sensor = self.irradiance.photon(number);
            let off_plane = (sensor.p - p).dot(normal);
            let is_flat = off_plane * off_plane <= FLATNESS * FLATNESS * distance_squared;
            if is_flat && is_alike(sensor.mark().normal(), normal) && count < SENSORS {
                near[count] = (distance_squared, number);
                count += 1;
            }
        }
        let near = &mut near[..count];
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let near = &near[..count.min(TAKEN)];
        let distance: f32 = near.iter().map(|(squared, _)| squared.sqrt()).sum::<f32>() / near.len() as f32;
        // (Σ |x_j − x|) ∕ n − σ > 0: yes.
        if near.len() < SENSORS_MIN || distance > self.object_distance {
            return None;
        }
        Some(self.fitted(p, normal, near))
    }

    /// The irradiance at a place by a plane through that of sensors near it, which those next to it count most for; no brighter
    /// and no darker than they are.
    ///
    /// - `near`: squared distances and numbers, ascending; one at least.
    fn fitted(&self, p: Vec3, normal: Vec3, near: &[(f32, u32)]) -> Spectrum {
        let radius_squared = near[near.len() - 1].0 * 1.1 + f32::MIN_POSITIVE;
        let scale = 1.0 / radius_squared.sqrt();
        let (s, t) = orthonormal_basis(normal);
        let (mut matrix, mut sums) = (Mat3::ZERO, [Vec3::ZERO; 3]);
        let (mut low, mut high) = (Spectrum::INFINITY, Spectrum::ZERO);
        for &(squared, number) in near {
            let sensor = self.irradiance.photon(number);
            let (mark, way) = (sensor.mark(), (sensor.p - p) * scale);
            let facing = (mark.normal().dot(normal) - COSINE_MIN).max(0.0) / (1.0 - COSINE_MIN);
            let weight = (1.0 - squared / radius_squared) * facing * facing + WEIGHT_MIN;
            let (power, row) = (mark.power(), Vec3::new(1.0, way.dot(s), way.dot(t)));
            matrix += Mat3::from_cols(row * row.x, row * row.y, row * row.z) * weight;
            for channel in 0..3 {
                sums[channel] += row * (power[channel] * weight);
            }
            (low, high) = (low.min(power), high.max(power));
        }
        // Where sensors do not tell of a slope there is none.
        let ridge = SLOPE_RIDGE * matrix.x_axis.x;
        matrix.y_axis.y += ridge;
        matrix.z_axis.z += ridge;
        let inverse = matrix.inverse();
        // Only the height of the plane is asked for.
        let height = Vec3::new(inverse.x_axis.x, inverse.y_axis.x, inverse.z_axis.x);
        let fitted = Vec3::from_array(sums.map(|sum| sum.dot(height)));
        if fitted.is_finite() { fitted.clamp(low, high) } else { low }
    }

    /// How much of its light arrives at an agent of the first map, as it answers: 1 where it is lit, 0 where it is shaded, and a
    /// half in between.
    pub(super) fn lit_share(agent: &Photon) -> f32 {
        match agent.mark().tag() & ANSWER {
            tag if tag == Answer::Lit as u32 => 1.0,
            tag if tag == Answer::Shaded as u32 => 0.0,
            _ => 0.5,
        }
    }

    /// Where the agents are, and their irradiance sensors.
    pub(crate) fn maps(&self) -> [&PhotonMap; 2] {
        [&self.places, &self.irradiance]
    }
}

/// Joins parts in their order.
pub(super) fn joined(parts: Vec<Sensed>) -> Sensed {
    parts.into_iter().fold(Sensed::default(), |mut all, part| {
        all.append(part);
        all
    })
}
