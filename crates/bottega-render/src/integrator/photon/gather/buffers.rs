//! Reusable buffers of a thread.

use bottega_scene::Spectrum;

use super::super::PhotonIntegrator;
use crate::{
    ala::{Agents, Tally},
    photon::{BOUNCES_KEPT, ByBounces, Nearest},
};

/// Reusable buffers of a thread, kept from sample to sample.
pub(crate) struct GatherBuffers {
    /// Photons that the last lookup found.
    pub(super) found: Nearest,
    /// Irradiance sensors found.
    pub(super) sensors: Nearest,
    /// Counts of questions to agents.
    pub(crate) tally: Tally,
    /// Radiance since the last [`Self::clear_bounces`], by number of bounces; `None`: not wanted.
    pub(super) by_bounces: Option<Box<ByBounces>>,
}

impl GatherBuffers {
    /// Creates buffers for camera paths.
    pub(crate) fn new(integrator: &PhotonIntegrator<'_>) -> Self {
        Self::gathering(integrator.photons.gather)
    }

    /// Creates buffers for a sensor. It looks up fewer photons: the mean over its rays smooths caustics.
    pub(crate) fn of_sensor(integrator: &PhotonIntegrator<'_>) -> Self {
        const GATHERED: u32 = 12;
        Self::gathering(integrator.photons.gather.min(GATHERED)).with_bounces()
    }

    /// Creates buffers for lookups of `count` photons.
    fn gathering(count: u32) -> Self {
        let found = Nearest::new(count as usize);
        Self { found, sensors: Nearest::new(Agents::SENSORS), tally: Tally::default(), by_bounces: None }
    }

    /// Returns these buffers with sums by number of bounces.
    pub(crate) fn with_bounces(self) -> Self {
        Self { by_bounces: Some(Box::new([Spectrum::ZERO; BOUNCES_KEPT])), ..self }
    }

    /// Returns the radiance by number of bounces; zeros if it is not wanted.
    pub(crate) fn bounces(&self) -> &ByBounces {
        const NOTHING: &ByBounces = &[Spectrum::ZERO; BOUNCES_KEPT];
        self.by_bounces.as_deref().unwrap_or(NOTHING)
    }

    /// Resets the sums by number of bounces.
    pub(in crate::integrator) fn clear_bounces(&mut self) {
        self.by_bounces.iter_mut().for_each(|sums| sums.fill(Spectrum::ZERO));
    }

    /// Multiplies the sums by number of bounces.
    pub(in crate::integrator) fn scale_bounces(&mut self, factor: f32) {
        self.by_bounces.iter_mut().flat_map(|sums| sums.iter_mut()).for_each(|sum| *sum *= factor);
    }
}
