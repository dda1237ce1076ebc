//! Figures of lighting agents.

use std::{
    sync::atomic::{AtomicU64, Ordering},
    time::Duration,
};

/// The report of a picture's lighting agents: their number, their cost, and the answers that they gave.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AgentReport {
    /// Number of agents sent out by all lights together, without clones and scouts:
    /// [`AgentSettings::cast`](crate::AgentSettings::cast).
    pub cast: u32,
    /// Number of agents that are stored, including clones, scouts and agents of the camera.
    pub agents: u64,
    /// Number of clones: agents behind the first surface.
    pub clones: u64,
    /// Number of sensors of each kind: geometry, proximity, penumbra, irradiance.
    pub sensors: [u64; 4],
    /// Number of links of the proximity network.
    pub links: u64,
    /// Number of agents that answer "lit", "shaded" and "trace a shadow ray".
    pub answers: [u64; 3],
    /// Mean distance from a light to the first surface, and from surface to surface, of the agents on the visible part
    /// of the scene; in scene units.
    pub object_distance: f32,
    /// Memory of the agents' maps, in bytes.
    pub map_bytes: u64,
    /// Share of the caustic photons that the camera sees: sent without the importance of lookouts, and with it; in [0,
    /// 1]. `None`: lookouts are not used, or there are no caustics.
    pub caustics_seen: Option<[f64; 2]>,
    /// Time that casting took.
    pub casting: Duration,
    /// Time that sensing took.
    pub sensing: Duration,
    /// Counts of the answers given so far.
    pub tally: Tally,
}

/// Counts of the answers of lighting agents: work that was done, and work that they made unnecessary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Number of shadow rays that were traced.
    pub shadow_traced: u64,
    /// Number of shadow rays that agents made unnecessary.
    pub shadow_spared: u64,
    /// Number of points whose indirect light was gathered.
    pub irradiance_computed: u64,
    /// Number of points whose indirect light was interpolated between agents.
    pub irradiance_interpolated: u64,
}

/// A [`Tally`] that many threads add to.
#[derive(Debug, Default)]
pub(super) struct Tallies([AtomicU64; 4]);

impl Tallies {
    /// Adds the counts of a tally.
    pub(super) fn add(&self, tally: &Tally) {
        let Tally { shadow_traced, shadow_spared, irradiance_computed, irradiance_interpolated } = *tally;
        let parts = [shadow_traced, shadow_spared, irradiance_computed, irradiance_interpolated];
        for (sum, part) in self.0.iter().zip(parts) {
            sum.fetch_add(part, Ordering::Relaxed);
        }
    }

    /// Returns the sums over all threads.
    pub(super) fn sum(&self) -> Tally {
        let [shadow_traced, shadow_spared, irradiance_computed, irradiance_interpolated] =
            [0, 1, 2, 3].map(|i| self.0[i].load(Ordering::Relaxed));
        Tally { shadow_traced, shadow_spared, irradiance_computed, irradiance_interpolated }
    }
}
