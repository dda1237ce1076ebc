//! The verdict whether a light is seen: by all that an agent and those next to it have seen, with the doubt that is left.

use std::ops::Range;

use super::super::{
    network::Network,
    probe::SensorKind,
    sensing::{Discovery, Sensing, SensorReadings},
    swarm::{Swarm, is_told},
    visibility::ShadowVerdict,
};

/// Sensors of an agent in the first round, and all of them where it has doubtful neighbors.
pub(super) const FIRST: u32 = 5;
pub(super) const ALL: u32 = 16;
/// How near to an agent a surface must end for it to be at an edge, as a share of how far it looks around.
const NEAR: f32 = 0.72;
/// Greatest share of a neighborhood that may be otherwise than all its sensors say, on the mean of Jeffreys' posterior: with
/// the half count of his prior, twenty-four that agree are enough.
const DOUBT: f32 = 0.02;

/// Agents look for their lights from places around them.
///
/// - `numbers`: of the sensors, which lie on a disc as far as the agent looks around.
pub(in crate::ala) fn look(sensing: &Sensing<'_>, who: &[u32], numbers: Range<u32>) -> SensorReadings {
    let mut sensed = SensorReadings::default();
    let count = numbers.len() as f32;
    for &index in who {
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
    pub(super) fn add(&mut self, is_lit: bool) {
        let count = if is_lit { &mut self.lit } else { &mut self.shaded };
        *count += 1;
    }

    pub(super) fn join(&mut self, other: Self) {
        self.lit += other.lit;
        self.shaded += other.shaded;
        self.lost += other.lost;
    }

    fn is_mixed(self) -> bool {
        self.lit > 0 && self.shaded > 0
    }
}

/// Whether an agent can be asked for its light.
pub(super) fn is_asked(swarm: &Swarm, index: u32) -> bool {
    is_told(swarm.agents[index as usize].light)
}

/// What each agent has found out on its way: it came straight from its light, or through something.
pub(super) fn arrivals(swarm: &Swarm) -> Vec<Discovery> {
    let arrival = |clone: u32| Discovery { lit: u32::from(clone == 0), shaded: u32::from(clone > 0), lost: 0 };
    swarm.agents.iter().map(|agent| arrival(agent.clone)).collect()
}

/// Who sees light and shade near by: those next to an edge of a shadow, and those next to them.
pub(super) fn doubtful(network: &Network, discoveries: &[Discovery]) -> Vec<u32> {
    let pooled = pooled(network, discoveries);
    let is_near = |&index: &u32| network.neighbors(index).any(|other| pooled[other as usize].is_mixed());
    (0..discoveries.len() as u32).filter(is_near).collect()
}

/// What each answers: what all sensors of it, of its neighbors and of theirs agree on, if they are enough. Where a light is
/// nearly hidden, most sensors do not see it: a ring of neighbors more keeps away from there.
pub(super) fn answers(network: &Network, discoveries: &[Discovery]) -> Vec<ShadowVerdict> {
    let pooled = pooled(network, discoveries);
    let answer = |(own, index): (&Discovery, u32)| {
        // At an edge, shade may be narrower than what was looked at.
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

/// What each agent and its neighbors know together.
fn pooled(network: &Network, discoveries: &[Discovery]) -> Vec<Discovery> {
    let join = |(own, index): (&Discovery, u32)| {
        let mut all = *own;
        network.neighbors(index).for_each(|other| all.join(discoveries[other as usize]));
        all
    };
    discoveries.iter().zip(0..).map(join).collect()
}
