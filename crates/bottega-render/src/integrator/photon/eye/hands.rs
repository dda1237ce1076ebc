//! The buffers of a thread.

use bottega_scene::Spectrum;

use super::super::PhotonIntegrator;
use crate::{
    ala::{Agents, Tally},
    photon::{BOUNCES_KEPT, ByBounces, Nearest},
};

/// What a thread works with, sample after sample.
pub(crate) struct Hands {
    pub(super) found: Nearest,
    /// The irradiance sensors that were found.
    pub(super) sensors: Nearest,
    /// What agents were asked.
    pub(crate) tally: Tally,
    /// What was found since it was last cleared, by number of bounces; if that is wanted.
    pub(super) by_bounces: Option<Box<ByBounces>>,
}

impl Hands {
    pub(crate) fn new(integrator: &PhotonIntegrator<'_>) -> Self {
        Self::gathering(integrator.photons.gather)
    }

    /// For a sensor: the mean of its many rays needs no smooth caustics where they end.
    pub(crate) fn of_sensor(integrator: &PhotonIntegrator<'_>) -> Self {
        const GATHERED: u32 = 12;
        Self::gathering(integrator.photons.gather.min(GATHERED)).telling_bounces()
    }

    fn gathering(count: u32) -> Self {
        let found = Nearest::new(count as usize);
        Self { found, sensors: Nearest::new(Agents::SENSORS), tally: Tally::default(), by_bounces: None }
    }

    /// The same that keeps light apart by how often it was scattered.
    pub(crate) fn telling_bounces(self) -> Self {
        Self { by_bounces: Some(Box::new([Spectrum::ZERO; BOUNCES_KEPT])), ..self }
    }

    /// What was found, by number of bounces.
    pub(crate) fn bounces(&self) -> &ByBounces {
        const NOTHING: &ByBounces = &[Spectrum::ZERO; BOUNCES_KEPT];
        self.by_bounces.as_deref().unwrap_or(NOTHING)
    }

    /// Begins anew.
    pub(in crate::integrator) fn clear_bounces(&mut self) {
        self.by_bounces.iter_mut().for_each(|sums| sums.fill(Spectrum::ZERO));
    }

    /// Multiplies what was found by number of bounces.
    pub(in crate::integrator) fn scale_bounces(&mut self, factor: f32) {
        self.by_bounces.iter_mut().flat_map(|sums| sums.iter_mut()).for_each(|sum| *sum *= factor);
    }
}
