//! The choice of integrators for samples in zones that are rendered in different ways.

use super::path::{PathIntegrator, PlannedWays};

/// The integrators of some samples.
pub(super) enum SampleIntegrators<'a, 'b> {
    /// One for all samples.
    One(&'a PathIntegrator<'b>),
    /// One per zone.
    ByPixel(&'a PlannedWays<'b>),
}

impl<'a, 'b> SampleIntegrators<'a, 'b> {
    /// Chooses the integrators of some samples.
    ///
    /// - `ways`: integrators of a picture whose zones are rendered in different ways.
    pub(super) fn new(
        integrator: &'a PathIntegrator<'b>,
        ways: Option<&'a PlannedWays<'b>>,
        samples: &[(u32, u32, u32)],
    ) -> Self {
        match ways {
            None => Self::One(integrator),
            Some(ways) => ways.of_all(samples).map_or(Self::ByPixel(ways), Self::One),
        }
    }

    /// Returns the integrator of a pixel.
    #[inline(always)]
    pub(super) fn of_pixel(&self, x: u32, y: u32) -> &'a PathIntegrator<'b> {
        match self {
            Self::One(integrator) => integrator,
            Self::ByPixel(ways) => ways.of_pixel(x, y),
        }
    }

    /// Returns `true` if agents are used for more than directions. Samples without agents are bit-identical either way.
    pub(super) fn ask_agents(&self) -> bool {
        match self {
            Self::One(integrator) => integrator.asks_agents(),
            Self::ByPixel(_) => true,
        }
    }
}
