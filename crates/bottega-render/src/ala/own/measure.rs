//! Measurement of indirect light where earlier records are not certain enough.

use super::super::{
    map::{Agents, LightUse},
    probe::SensorKind,
    sensing::{Candidate, SensingContext, SensorReadings},
};
use crate::integrator::{GatherBuffers, SensorPlace as Place};

/// Least radius of a record on the back of a surface, relative to that on the front.
const BACK_REACH: f32 = 0.05;

/// Measures irradiance at those candidates whose light the other records do not know.
pub(in crate::ala) fn measure(
    sensing: &SensingContext<'_>,
    candidates: &[Candidate],
    others: &Agents,
) -> SensorReadings {
    let mut sensed = SensorReadings::default();
    let mut buffers = GatherBuffers::of_sensor(sensing.integrator);
    for &Candidate { index, is_back } in candidates {
        let probe = sensing.probe(index);
        let normal = if is_back { -probe.agent.normal } else { probe.agent.normal };
        let is_directed = !probe.agent.is_matte;
        let what_for = if probe.agent.is_camera() { LightUse::Shown } else { LightUse::Gathered };
        if others.knows(probe.agent.p, normal, is_directed, what_for) {
            continue;
        }
        let Some(point) = probe.place(SensorKind::Irradiance, 0, 0.0, normal) else { continue };
        let sampler = probe.sampler(u32::from(is_back), 1);
        let [least, most] = others.reach_of_records(probe.agent.p, probe.reach);
        // A back may be inside a thin wall: its record must not count on the other side
        let reach = [if is_back { BACK_REACH * least } else { least }, most];
        let effort = others.effort_at(probe.agent.p, normal, what_for);
        let place = Place { point, width: probe.reach, reach, effort, is_directed };
        let record = sensing.integrator.record(sensing.maps, place, sampler, others, &mut buffers);
        sensed.records.push(record);
        sensed.sensors[SensorKind::Irradiance as usize] += 1;
    }
    sensed
}
