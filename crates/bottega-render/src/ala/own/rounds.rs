//! The rounds of sensing: each uses the readings of the earlier ones.

use std::sync::Arc;

use super::{
    super::{
        agent::Agent,
        map::Agents,
        network::Network,
        sensing::{Candidate, Discovery, MEASURING, Run, SENSING, SensingTask},
        swarm::Swarm,
        visibility::{ShadowVerdict, Visibility},
    },
    look::{self, ALL, FIRST},
};
use crate::{error::RenderError, extent::Extent, parts::parts, prepare::PreparedScene, settings::AgentSettings};

/// Number of candidates in the first round of measurements; each round has twice as many.
const FIRST_ROUND: usize = 128;

/// Runs the rounds of sensing of a swarm. Returns the agents, and the number of sensors by kind.
///
/// # Errors
/// A sensing task was not run.
pub(in crate::ala) fn sense(
    prepared: &PreparedScene,
    extent: Extent,
    settings: AgentSettings,
    swarm: &Swarm,
    network: &Network,
    run: &mut Run<'_>,
) -> Result<(Agents, [u64; 4]), RenderError> {
    let mut sensors = [0; 4];
    // Test the visibility of lights
    let answers = if settings.decides_shadows && !prepared.has_opacity() {
        look_for_lights(swarm, network, &mut sensors, run)?
    } else {
        vec![ShadowVerdict::Trace; swarm.len()]
    };
    let visibility = Visibility::new(swarm, network, &answers, settings.asks_network);
    let mut agents = Arc::new(Agents::without_light(prepared, extent, settings, Arc::new(visibility), &answers));
    if settings.decides_irradiance {
        // Measure indirect light, round by round, each with the records of the earlier ones
        let all = candidates(swarm, settings);
        let (mut first, mut count) = (0, FIRST_ROUND);
        while first < all.len() && agents.has_room() {
            let candidates: Arc<[Candidate]> = all[first..all.len().min(first + count)].into();
            let others = Arc::new(agents.settled());
            let task =
                |part| SensingTask::Measure { candidates: Arc::clone(&candidates), part, others: Arc::clone(&others) };
            let mut found = run(parts(candidates.len() as u32, MEASURING).map(task).collect())?;
            (first, count) = (first + count, 2 * count);
            if !found.records.is_empty() {
                agents = Arc::new(agents.with_records(std::mem::take(&mut found.records)));
            }
            sensors.iter_mut().zip(found.sensors).for_each(|(sum, part)| *sum += part);
        }
    }
    Ok((agents.settled(), sensors))
}

/// Returns each agent's answer about its light: a few sensors everywhere, more near shadow edges.
fn look_for_lights(
    swarm: &Swarm,
    network: &Network,
    sensors: &mut [u64; 4],
    run: &mut Run<'_>,
) -> Result<Vec<ShadowVerdict>, RenderError> {
    let mut discoveries: Vec<Discovery> = look::arrivals(swarm);
    let mut doubtful: Vec<u32> = (0..swarm.len() as u32).filter(|&index| look::can_answer(swarm, index)).collect();
    for numbers in [0..FIRST, FIRST..ALL] {
        let round: Arc<[u32]> = doubtful.into();
        let task = |part| SensingTask::Look { agents: Arc::clone(&round), part, numbers: numbers.clone() };
        let found = run(parts(round.len() as u32, SENSING).map(task).collect())?;
        round.iter().zip(found.discoveries).for_each(|(&index, part)| discoveries[index as usize].join(part));
        sensors.iter_mut().zip(found.sensors).for_each(|(sum, part)| *sum += part);
        doubtful = look::doubtful(network, &discoveries);
        doubtful.retain(|&index| look::can_answer(swarm, index));
    }
    Ok(look::answers(network, &discoveries))
}

/// Returns the candidates for measurements: in turn one of the camera's and one of the others, each in the order of
/// their identities. Any first part of these stratified sequences covers the whole picture and the whole scene.
fn candidates(swarm: &Swarm, settings: AgentSettings) -> Vec<Candidate> {
    let can_measure = |agent: &Agent| agent.is_matte || (agent.is_glossy && settings.decides_radiance);
    // Scouts and the camera's agents are sent to fronts; agents behind a surface cover its back
    let sides = |agent: &Agent| if agent.is_scout() { &[false][..] } else { &[false, true] };
    let of = |is_camera: bool| {
        let all = swarm.agents.iter().zip(0..);
        let measuring = all.filter(move |(agent, _)| agent.is_camera() == is_camera && can_measure(agent));
        measuring.flat_map(move |(agent, index)| sides(agent).iter().map(move |&is_back| Candidate { index, is_back }))
    };
    let (mut shown, mut others) = (of(true), of(false));
    let mut candidates = Vec::new();
    loop {
        let both = [shown.next(), others.next()];
        if both == [None; 2] {
            return candidates;
        }
        candidates.extend(both.into_iter().flatten());
    }
}
