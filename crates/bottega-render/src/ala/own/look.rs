//! The visibility of lights by pooled readings with an error bound.

use std::ops::Range;

use super::super::{
    network::Network,
    probe::SensorKind,
    sensing::{Discovery, SensingContext, SensorReadings},
    swarm::{Swarm, has_number},
    visibility::ShadowVerdict,
};

/// Sensors of an agent in the first round.
pub(super) const FIRST: u32 = 5;
/// Sensors of an agent in total where neighbours disagree.
pub(super) const ALL: u32 = 16;
/// Greatest distance of an agent from a surface edge to be at the edge, as a share of its neighbourhood's radius.
const NEAR: f32 = 0.72;
/// Greatest tolerated share of a neighbourhood that contradicts its sensors, by the mean of Jeffreys' posterior: with
/// the half count of the prior, twenty-four agreeing sensors are enough.
const DOUBT: f32 = 0.02;

/// Lets agents test the visibility of their lights from points around them.
///
/// - `numbers`: numbers of the sensors, which lie on a disc of the neighbourhood's radius.
pub(in crate::ala) fn look(sensing: &SensingContext<'_>, agents: &[u32], numbers: Range<u32>) -> SensorReadings {
    let mut sensed = SensorReadings::default();
    let count = numbers.len() as f32;
    for &index in agents {
        let probe = sensing.probe(index);
        let mut discovery = Discovery::default();
        for number in numbers.clone() {
            let share = ((number - numbers.start) as f32 + 0.5) / count;
            let distance = probe.reach * share.sqrt();
            let seen = probe
                .place(SensorKind::Penumbra, number, distance, probe.agent.normal)
                .and_then(|point| probe.surfaces_to_light(&point, number, 1));
            sensed.sensors[SensorKind::Penumbra as usize] += 1;
            match seen {
                Some((surfaces, _)) => discovery.add(surfaces == 1),
                None if distance <= NEAR * probe.reach => discovery.lost += 1,
                None => {}
            }
        }
        sensed.discoveries.push(discovery);
    }
    sensed
}

impl Discovery {
    /// Counts one reading.
    pub(super) fn add(&mut self, is_lit: bool) {
        let count = if is_lit { &mut self.lit } else { &mut self.shaded };
        *count += 1;
    }

    /// Adds the counts of another.
    pub(super) fn join(&mut self, other: Self) {
        self.lit += other.lit;
        self.shaded += other.shaded;
        self.lost += other.lost;
    }

    /// Returns `true` if both lit and shaded sensors were counted.
    fn is_mixed(self) -> bool {
        self.lit > 0 && self.shaded > 0
    }
}

/// Returns `true` if an agent can answer for its light.
pub(super) fn can_answer(swarm: &Swarm, index: u32) -> bool {
    has_number(swarm.agents[index as usize].light)
}

/// Returns the readings of the agents' own flights: lit if it came directly from its light, else shaded.
pub(super) fn arrivals(swarm: &Swarm) -> Vec<Discovery> {
    let arrival = |clone: u32| Discovery { lit: u32::from(clone == 0), shaded: u32::from(clone > 0), lost: 0 };
    swarm.agents.iter().map(|agent| arrival(agent.clone)).collect()
}

/// Returns the agents near a shadow edge: those with a neighbour whose pooled readings are mixed.
pub(super) fn doubtful(network: &Network, discoveries: &[Discovery]) -> Vec<u32> {
    let pooled = pooled(network, discoveries);
    let is_near = |&index: &u32| network.neighbors(index).any(|other| pooled[other as usize].is_mixed());
    (0..discoveries.len() as u32).filter(is_near).collect()
}

/// Returns each agent's answer: that of its own sensors and those of two rings of neighbours, if they agree and are
/// enough. Where a light is nearly hidden, most sensors do not see it: the second ring keeps answers away from there.
pub(super) fn answers(network: &Network, discoveries: &[Discovery]) -> Vec<ShadowVerdict> {
    let pooled = pooled(network, discoveries);
    let answer = |(own, index): (&Discovery, u32)| {
        // At surface edges, shadows may be narrower than the tested disc
        let is_edge = discoveries[index as usize].lost > 0;
        let doubt = 0.5 / (own.lit + own.shaded + 1) as f32;
        let around = || network.neighbors(index).map(|other| pooled[other as usize]);
        match (own.lit, own.shaded) {
            _ if doubt > DOUBT || is_edge => ShadowVerdict::Trace,
            (_, 0) if around().all(|all| all.shaded == 0) => ShadowVerdict::Lit,
            (0, _) if around().all(|all| all.lit == 0) => ShadowVerdict::Shaded,
            _ => ShadowVerdict::Trace,
        }
    };
    pooled.iter().zip(0..).map(answer).collect()
}

/// Returns the pooled readings of each agent and its neighbours.
fn pooled(network: &Network, discoveries: &[Discovery]) -> Vec<Discovery> {
    let join = |(own, index): (&Discovery, u32)| {
        let mut all = *own;
        network.neighbors(index).for_each(|other| all.join(discoveries[other as usize]));
        all
    };
    discoveries.iter().zip(0..).map(join).collect()
}
