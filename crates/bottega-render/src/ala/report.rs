//! The figures of agents.

use std::{
    sync::atomic::{AtomicU64, Ordering},
    time::Duration,
};

/// The report of a swarm: its properties, its cost, and the questions it was asked.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AgentReport {
    /// Agents that were sent out.
    pub cast: u32,
    /// Agents that are stored, clones and scouts among them.
    pub agents: u64,
    /// Clones: those behind the first surface.
    pub clones: u64,
    /// Sensors of geometry, proximity, penumbra and irradiance.
    pub sensors: [u64; 4],
    /// Links of the proximity network.
    pub links: u64,
    /// Agents that answer "lit", "shaded" and "trace a ray".
    pub answers: [u64; 3],
    /// Mean distance between objects.
    pub object_distance: f32,
    /// Bytes of the maps that are kept.
    pub map_bytes: u64,
    /// Of the photons that come to mirrors and glass, the share whose light the camera sees: sent without asking lookouts, and sent by
    /// them. `None`: nobody was asked, or none comes there.
    pub caustics_seen: Option<[f64; 2]>,
    /// How long casting took.
    pub casting: Duration,
    /// How long sensing took.
    pub sensing: Duration,
    /// What was asked so far.
    pub tally: Tally,
}

/// The tally of the oracle's questions and answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Shadow rays that were traced, and that were not.
    pub shadow_traced: u64,
    /// See above.
    pub shadow_spared: u64,
    /// Places whose indirect light was gathered, and whose it was interpolated.
    pub irradiance_computed: u64,
    /// See above.
    pub irradiance_interpolated: u64,
}

/// Sums that many threads add to.
#[derive(Debug, Default)]
pub(super) struct Tallies([AtomicU64; 4]);

impl Tallies {
    pub(super) fn add(&self, tally: &Tally) {
        let Tally { shadow_traced, shadow_spared, irradiance_computed, irradiance_interpolated } = *tally;
        let parts = [shadow_traced, shadow_spared, irradiance_computed, irradiance_interpolated];
        for (sum, part) in self.0.iter().zip(parts) {
            sum.fetch_add(part, Ordering::Relaxed);
        }
    }

    pub(super) fn sum(&self) -> Tally {
        let [shadow_traced, shadow_spared, irradiance_computed, irradiance_interpolated] =
            [0, 1, 2, 3].map(|i| self.0[i].load(Ordering::Relaxed));
        Tally { shadow_traced, shadow_spared, irradiance_computed, irradiance_interpolated }
    }
}
