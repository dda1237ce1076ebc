//! Indirect light: measured where those who have measured before cannot tell.

use super::super::{
    map::Agents,
    probe::SensorKind,
    sensing::{Candidate, Sensing, SensorReadings},
};
use crate::integrator::{Hands, SensorPlace as Place};

/// Some of the candidates measure what the others do not know.
pub(in crate::ala) fn measure(sensing: &Sensing<'_>, who: &[Candidate], others: &Agents) -> SensorReadings {
    let mut sensed = SensorReadings::default();
    let mut hands = Hands::of_sensor(sensing.integrator);
    for &Candidate { index, is_back } in who {
        let probe = sensing.probe(index);
        let normal = if is_back { -probe.agent.normal } else { probe.agent.normal };
        let is_directed = !probe.agent.is_matte;
        if others.knows(probe.agent.p, normal, is_directed) {
            continue;
        }
        let Some(point) = probe.place(SensorKind::Irradiance, 0, 0.0, normal) else { continue };
        let sampler = probe.sampler(u32::from(is_back), 1);
        let reach = others.reach_of_records(probe.agent.p, probe.reach);
        let effort = others.effort_at(probe.agent.p, normal);
        let place = Place { point, width: probe.reach, reach, effort, is_directed };
        let record = sensing.integrator.record(sensing.maps, place, sampler, others, &mut hands);
        sensed.records.push(record);
        sensed.sensors[SensorKind::Irradiance as usize] += 1;
    }
    sensed
}
