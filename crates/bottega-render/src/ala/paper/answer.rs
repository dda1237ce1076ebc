//! The paper's answer to "should I trace a shadow ray?" (§4.4).

use super::super::{network::Network, sensing::Discovery, visibility::ShadowVerdict};

/// Least number of agreeing penumbra sensors.
const PENUMBRA_MIN: u32 = 4;

impl Discovery {
    /// Returns the share of its penumbra sensors that do not see the light; `None`: it has none.
    fn shaded_share(&self) -> Option<f32> {
        let count = self.lit + self.shaded;
        (count > 0).then(|| self.shaded as f32 / count as f32)
    }
}

/// Returns each agent's answer: "trace" unless its own sensors and the median of its neighbours agree.
pub(in crate::ala) fn answers(network: &Network, discoveries: &[Discovery]) -> Vec<ShadowVerdict> {
    let answer = |(own, index): (&Discovery, u32)| {
        let share = |other: u32| discoveries[other as usize].shaded_share();
        let mut shares: Vec<f32> = network.neighbors(index).filter_map(share).collect();
        shares.sort_by(f32::total_cmp);
        let median = match shares.len() {
            0 => own.shaded_share(),
            count => Some(0.5 * (shares[(count - 1) / 2] + shares[count / 2])),
        };
        match (own.lit, own.shaded, median) {
            (PENUMBRA_MIN.., 0, Some(0.0)) => ShadowVerdict::Lit,
            (0, PENUMBRA_MIN.., Some(1.0)) => ShadowVerdict::Shaded,
            _ => ShadowVerdict::Trace,
        }
    };
    discoveries.iter().zip(0..).map(answer).collect()
}
